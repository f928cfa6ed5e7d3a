"""What a design confuses: alias matrix and correlation map."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rsmkit.design.design import Design
from rsmkit.design.quality.power import power_of_terms
from rsmkit.design.quality.variance import coefficient_covariance
from rsmkit.errors import RsmkitError
from rsmkit.io.arguments import checked
from rsmkit.language.space import Floats
from rsmkit.language.space_terms import space_terms
from rsmkit.language.terms import Terms

__all__ = ["alias_matrix", "power_of_terms", "term_correlations"]


@checked
def alias_matrix(
    design: Design, *, order: int = 2, terms: Terms | None = None, potential: Terms | None = None
) -> tuple[Floats, tuple[str, ...], tuple[str, ...]]:
    """How much of each term left out of the model leaks into each coefficient of it.

    ``inv(X1'X1) X1'X2``, Box & Wilson (1951), J. R. Stat. Soc. B 13(1), 1-45.

    Parameters
    ----------
    order, terms
        The model.
    potential : Terms, optional
        Terms that may be active beside it; those of the next order by default.

    Returns
    -------
    matrix : array, shape (p, q)
        The bias of coefficient i per unit of potential coefficient j, coded units.
    rows, columns : tuple of str
        Names of the model's columns and of the potential ones.
    """
    terms = space_terms(design.space, order) if terms is None else terms
    next_order = min(terms.order + 1, 3) if design.space.mixtures else terms.order + 1
    wider = space_terms(design.space, next_order) if potential is None else potential
    beside = tuple(e for e in wider.exponents if e not in terms.exponents)
    if not beside:
        raise RsmkitError("aliases: the model holds all terms of the next order; name others (potential)")
    extra = replace(wider, exponents=beside)
    covariance = coefficient_covariance(design, terms)
    X1, X2 = terms.matrix(design.coded), extra.matrix(design.coded)
    return covariance @ (X1.T @ X2), terms.names(design.space), extra.names(design.space)


@checked
def term_correlations(
    design: Design, *, order: int = 2, terms: Terms | None = None
) -> tuple[Floats, tuple[str, ...]]:
    """Correlations of the model's columns over the runs, the constant left out.

    Returns
    -------
    matrix : array, shape (p - 1, p - 1)
        1 on the diagonal; a column that does not vary has correlation 0 with the others.
    names : tuple of str
    """
    terms = space_terms(design.space, order) if terms is None else terms
    names = terms.names(design.space)
    X = terms.matrix(design.coded)
    keep = [i for i, name in enumerate(names) if name != "1"]
    centred = X[:, keep] - X[:, keep].mean(axis=0)
    lengths = np.linalg.norm(centred, axis=0)
    scaled = centred / np.where(lengths > 1e-12, lengths, np.inf)
    matrix = scaled.T @ scaled
    np.fill_diagonal(matrix, 1.0)
    return matrix, tuple(names[i] for i in keep)
