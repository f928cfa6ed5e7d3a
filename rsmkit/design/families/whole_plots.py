"""Designs of studies in which factors are hard to change: what the options say, in whole plots."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from rsmkit.design.design import Design
from rsmkit.design.families.registry import family_of
from rsmkit.design.families.site import Site, allowed, needed_runs
from rsmkit.design.optimal.split_plot import check_plots, plot_sizes, split_plot_design
from rsmkit.design.options import DesignOptions
from rsmkit.design.region import Region
from rsmkit.errors import RsmkitError
from rsmkit.language.space import Space
from rsmkit.language.terms import Terms

__all__ = ["RATIO", "design_in_plots"]

RATIO = 1.0
"""Variance of a plot over that of a run where nobody says it."""


def design_in_plots(
    space: Space,
    options: DesignOptions,
    site: Site,
    terms: Terms,
    hard: Sequence[str],
    region_of: Callable[[Design, DesignOptions, Site], Region],
) -> Design:
    """Make a design in whole plots: points of one's own with their plots, searched ones, or both.

    Raises
    ------
    RsmkitError
        When the options do not go with hard-to-change factors, or not with each other.
    """
    ratio = options.block_variance or RATIO
    own = bool(options.tables.get("points"))
    if not (options.searched or own):
        raise RsmkitError(
            f"design.kind: '{options.kind}' sets {', '.join(hard)} anew for every run, and it is hard to "
            "change; take kind = 'optimal' with runs and whole_plots, or kind = 'file' with a column block"
        )
    if options.spreads or options.criterion == "maximin":
        raise RsmkitError(
            f"design.kind: points spread by 'maximin' set {', '.join(hard)} anew for every run, and it is "
            "hard to change; take criterion = 'D' or 'I'"
        )
    idle = [key for key in ("covariance", "min_distance") if getattr(options, key)]
    if idle:
        raise RsmkitError(f"design.{idle[0]}: does not go with hard-to-change factors; leave it out")
    start = allowed(family_of(options.kind).make(space, options, site), site.constraints)
    total = options.augment_to or (needed_runs(options) if options.searched else len(start))
    check_plots(start, hard)
    if total == len(start):
        return replace(start, block_ratio=ratio)
    return split_plot_design(
        space,
        _sizes(options, start, total),
        hard,
        given=start if len(start) else None,
        terms=terms,
        criterion=options.criterion,
        ratio=ratio,
        region=region_of(start, options, site),
        starts=options.starts,
        seed=options.seed,
    )


def _sizes(options: DesignOptions, start: Design, total: int) -> tuple[int, ...]:
    """Runs of every plot, those of given runs first."""
    asked = options.blocks or options.whole_plots
    if isinstance(asked, tuple):
        if sum(asked) != total:
            key = "blocks" if options.blocks else "whole_plots"
            raise RsmkitError(
                f"design.{key}: {' + '.join(map(str, asked))} = {sum(asked)} runs, the design has {total}"
            )
        return asked
    if asked is None:
        raise RsmkitError(
            "design.whole_plots is missing: a factor is hard to change, so say in how many whole plots the "
            f"{total} runs are made, as in whole_plots = 6, or how many runs each has"
        )
    given = tuple(start.blocks.count(block) for block in dict.fromkeys(start.blocks))
    if not given:
        return plot_sizes(total, asked)
    if asked <= len(given):
        raise RsmkitError(
            f"design.whole_plots: the given runs fill {len(given)} plots already, {asked} in all were "
            "asked for"
        )
    return given + plot_sizes(total - len(start), asked - len(given))
