"""The information matrix of a design for a model, and the criteria that are read off it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rsmkit.design.design import Design
from rsmkit.design.optimal.criteria import precision_of
from rsmkit.design.quality.variance import inverse_of
from rsmkit.io.arguments import checked
from rsmkit.io.shown import Shown
from rsmkit.language.space import Floats
from rsmkit.language.terms import Terms, full_terms

__all__ = ["Information", "information_matrix"]


@dataclass(frozen=True, eq=False)
class Information(Shown):
    """What a design says of a model's coefficients, in coded units, error variance 1.

    What needs the inverse raises a RsmkitError where the design cannot estimate the model.

    Parameters
    ----------
    names : tuple of str
        Columns of the model.
    matrix : array, shape (p, p)
        ``X'X``; ``X' V^-1 X`` for runs in blocks or whole plots.
    """

    names: tuple[str, ...]
    matrix: Floats

    @cached_property
    def inverse(self) -> Floats:
        """Covariance of the coefficients, shape (p, p)."""
        return inverse_of(self.matrix)

    @cached_property
    def correlations(self) -> Floats:
        """Correlations of the estimated coefficients, shape (p, p)."""
        errors = np.sqrt(np.diag(self.inverse))
        found: Floats = self.inverse / np.outer(errors, errors)
        return found

    @property
    def largest_correlation(self) -> float:
        """Of two different coefficients, in size."""
        return float(np.abs(self.correlations - np.eye(len(self.names))).max())

    @cached_property
    def eigenvalues(self) -> Floats:
        """Of the matrix, ascending, shape (p,)."""
        return np.asarray(np.linalg.eigvalsh(self.matrix), float)

    @property
    def determinant(self) -> float:
        """``det X'X``, which D-optimal designs maximise."""
        sign, log = np.linalg.slogdet(self.matrix)
        return float(sign * np.exp(log))

    @property
    def d_criterion(self) -> float:
        """``det(X'X)^(1/p)``."""
        sign, log = np.linalg.slogdet(self.matrix)
        return float(np.exp(log / len(self.names))) if sign > 0 else 0.0

    @property
    def a_criterion(self) -> float:
        """Sum of the variances of the coefficients, ``tr (X'X)^-1``, which A-optimal designs minimise."""
        return float(np.trace(self.inverse))

    @property
    def e_criterion(self) -> float:
        """Smallest eigenvalue, which E-optimal designs maximise."""
        return float(self.eigenvalues[0])


@checked
def information_matrix(design: Design, *, order: int = 2, terms: Terms | None = None) -> Information:
    """Work out the information matrix, its inverse and the alphabetic criteria of a design.

    Parameters
    ----------
    design : Design
        Blocks count as fixed effects, whole plots with the ratio of variances that the design was made for.
    order, terms
        The model.

    Examples
    --------
    >>> import rsmkit as rk
    >>> design = rk.full_factorial(rk.Space(a=(0, 1), b=(0, 1)))
    >>> found = rk.information_matrix(design, order=1)
    >>> found.names, found.matrix.tolist()
    (('1', 'a', 'b'), [[4.0, 0.0, 0.0], [0.0, 4.0, 0.0], [0.0, 0.0, 4.0]])
    >>> round(found.determinant, 9), found.a_criterion
    (64.0, 0.75)
    """
    terms = full_terms(design.space, order) if terms is None else terms
    X, covariance = terms.matrix(design.coded), design.covariance
    precision = precision_of(len(design), (design.blocks or None) if covariance is None else None, covariance)
    matrix = X.T @ (precision @ X) if len(precision) else X.T @ X
    return Information(terms.names(design.space), np.asarray(matrix))
