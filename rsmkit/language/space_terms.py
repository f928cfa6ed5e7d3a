"""The usual model of a space: full in factors that vary freely, Scheffe's in components of a mixture.

Under other equalities, and of further mixtures, one factor each is left out: the others say it.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from rsmkit.errors import RsmkitError
from rsmkit.io.arguments import checked
from rsmkit.language.scheffe import parse_scheffe, scheffe_terms
from rsmkit.language.space import Space
from rsmkit.language.terms import Terms, full_terms, parse_terms

__all__ = ["read_terms", "said_by_others", "space_terms"]


@checked
def space_terms(space: Space, order: int = 2) -> Terms:
    """All terms of an order that tell different things on a space.

    Parameters
    ----------
    space : Space
    order : int
        1 linear, 2 quadratic, 3 cubic.

    Examples
    --------
    >>> space = Space(a=(0, 1), b=(0, 1), c=(0, 1))
    >>> space_terms(space.mixture("a", "b", "c")).names(space)
    ('a', 'b', 'c', 'a*b', 'a*c', 'b*c')
    """
    if not space.equalities:
        return full_terms(space, order)
    if space.mixtures and order not in (1, 2, 3):
        raise RsmkitError(f"model terms: the order of a mixture model is 1, 2 or 3, got {order}")
    components = space.mixtures[0].components if space.mixtures else ()
    terms = scheffe_terms(space, components, order) if components else full_terms(space, order)
    left_out = [space.names.index(name) for name in said_by_others(space)]
    return replace(terms, exponents=tuple(e for e in terms.exponents if not any(e[j] for j in left_out)))


def read_terms(space: Space, words: Iterable[str]) -> Terms:
    """Read a model written by hand, as :func:`~rsmkit.language.terms.parse_terms`; of mixtures Scheffe's."""
    if not space.mixtures:
        return parse_terms(space, words)
    return parse_scheffe(space, space.mixtures[0].components, words)


def said_by_others(space: Space) -> tuple[str, ...]:
    """Factors that follow from the others, one for each equality but that of the first mixture."""
    affine = space.affine
    if affine is None:
        return ()
    first = space.mixtures[0].equality if space.mixtures else None
    last = set(first.names) if first else set()
    rows = np.array([r for r, e in zip(affine.matrix, space.equalities, strict=True) if e != first])
    found: list[str] = []
    for j in sorted(range(len(space)), key=lambda j: (space.names[j] in last, -j)):
        free = [i for i in range(len(rows)) if abs(rows[i, j]) > 1e-12]
        if not free:
            continue
        pivot = max(free, key=lambda i: abs(rows[i, j]))
        others = rows[np.arange(len(rows)) != pivot]
        rows = others - np.outer(others[:, j] / rows[pivot, j], rows[pivot])
        found.append(space.names[j])
    return tuple(found)
