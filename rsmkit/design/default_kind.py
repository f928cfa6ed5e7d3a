"""Which design a study gets that names none: composite while that is small, optimal otherwise."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import fields

from rsmkit.design.families.composite import CompositeOptions
from rsmkit.design.families.registry import design_options
from rsmkit.design.options import DesignOptions
from rsmkit.io.option_fields import given
from rsmkit.language.space import Space

__all__ = ["LARGEST_COMPOSITE", "USUAL_RUNS", "default_design"]

LARGEST_COMPOSITE = 80
"""Runs: the full cube of six factors, the star and three centre points are 79; of seven factors 145."""
USUAL_RUNS = 50


def default_design(
    options: DesignOptions, space: Space, terms: str | Sequence[str], order: int
) -> DesignOptions:
    """Choose the kind of a design whose file names none.

    The central composite design stays where it can be made, is not cut by constraints and has at most 80
    runs, and wherever a key of its own was given. Otherwise points are optimal for the model: 50 of them, or
    a tenth more than the model has terms where that is more, and at most twice as many as terms. Where all
    factors are categories, every combination is run.

    Parameters
    ----------
    options : DesignOptions
        What was read, of the default kind.
    space : Space
    terms : str or sequence of str
        The words of the model; without any it is full of that `order`.
    order : int
    """
    from rsmkit.language.space_terms import read_terms, space_terms

    factors = int(space.numeric.sum())
    cells = math.prod(f.domain.categories for f in space.factors if not f.domain.is_numeric)
    own = {item.name for item in fields(CompositeOptions)} - {item.name for item in fields(DesignOptions)}
    composite = (2.0**factors + 2 * factors + CompositeOptions.center) * cells
    enough = options.augment_to is not None and options.augment_to >= composite
    whole = not space.equalities and not options.subject_to
    fits = factors > 1 and whole and (composite <= LARGEST_COMPOSITE or enough)
    chosen = given(options)
    kept = {key: getattr(options, key) for key in chosen if key != "kind"}
    if factors == 0 and cells <= LARGEST_COMPOSITE and not own & set(chosen):
        return design_options("factorial", **kept)
    if fits or factors == 0 or own & set(chosen):
        return options
    model = read_terms(space, terms) if terms else space_terms(space, order)
    p = len(model.names(space))
    runs = min(max(USUAL_RUNS, p + max(4, p // 10)), 2 * p)
    return design_options("optimal", **({} if options.augment_to else {"runs": runs}), **kept)
