"""Score tests in a stretched surface: is a coefficient zero, is a factor not stretched?

A coefficient and the stretch of its factor can stand in for each other, so the surface as it was fitted says
little about what it would be without the coefficient, and comparing an estimate with its standard error
rejects true hypotheses too often. A score test (Rao 1948; with nuisance parameters Neyman's C(alpha), 1959)
looks from the other side: everything else, the stretch included, is fitted *without* the tested columns,
where it is well determined; what is left is then regressed on the tested columns beside the derivatives by
all that was fitted.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import svd
from scipy.optimize import least_squares

from rsmkit.language.space import Floats
from rsmkit.newton import minimum_nearby
from rsmkit.surfaces.estimation.coordinates import Coordinates
from rsmkit.surfaces.estimation.least_squares import LeastSquares
from rsmkit.surfaces.estimation.stretch import FAMILIES, free_parameters

__all__ = ["Restrictable", "score_statistic"]

STEP = 1e-5
"""Difference in a stretch parameter for derivatives of the prediction."""
SETTLING_STEP = 2e-3
"""Difference, as a part of the family's scale, that settles the last digits of a restricted fit."""
DIGITS = 6
"""Decimals of a restricted stretch parameter that are kept; a score is regressed on what they leave."""
SMALL = 1e-7
"""A column of which less than this part is left beside others says nothing new."""


class Restrictable(Protocol):
    """A surface in stretched factors that can be fitted again with parameters held."""

    @property
    def coordinates(self) -> Coordinates:
        """Working coordinates, with a stretch per factor."""
        ...

    @property
    def fit(self) -> LeastSquares:
        """The joint fit: columns of blocks and terms, then of the stretch parameters."""
        ...

    @property
    def theta(self) -> Floats:
        """Fitted stretch parameters, shape (q,)."""
        ...

    def matrix_at(self, theta: Floats) -> Floats:
        """Columns of blocks and terms for other stretch parameters, shape (n, p - q)."""
        ...


def score_statistic(surface: Restrictable, columns: Sequence[int]) -> float:
    """F statistic of the hypothesis that coefficients are zero, or stretch parameters those of the identity.

    Parameters
    ----------
    surface : Restrictable
    columns : sequence of int
        Indices of what is tested among the columns of its fit.

    Returns
    -------
    float
        With ``len(columns)`` and :attr:`LeastSquares.df` degrees of freedom; nan when the runs cannot tell.
    """
    if surface.fit.df == 0:
        return math.nan
    root = np.sqrt(surface.fit.weights)
    y = surface.fit.y * root
    count = surface.fit.p - len(surface.theta)
    tested = np.isin(np.arange(surface.fit.p), columns)
    kept = ~tested[:count]

    def matrix(theta: Floats) -> Floats:
        return surface.matrix_at(theta) * root[:, None]

    theta = _restricted_theta(surface, tested[count:], lambda theta: matrix(theta)[:, kept], y)
    x = matrix(theta)
    beta = np.zeros(count)
    beta[kept] = np.linalg.lstsq(x[:, kept], y, rcond=None)[0]
    steps = STEP * np.eye(len(theta))
    slopes = [(matrix(theta + step) - matrix(theta - step)) @ beta / (2.0 * STEP) for step in steps]
    whole = np.column_stack([x, *slopes])
    nuisance = _basis(whole[:, ~tested])
    left = y - x @ beta
    left -= nuisance @ (nuisance.T @ left)
    new = whole[:, tested] - nuisance @ (nuisance.T @ whole[:, tested])
    if (np.linalg.norm(new, axis=0) <= SMALL * np.linalg.norm(whole[:, tested], axis=0)).any():
        return math.nan
    explained = float(np.square(_basis(new).T @ left).sum())
    rest = max(float(left @ left) - explained, 0.0)
    return explained / len(columns) / (rest / surface.fit.df) if rest else math.inf


def _restricted_theta(
    surface: Restrictable, tested: NDArray[np.bool_], matrix: Callable[[Floats], Floats], y: Floats
) -> Floats:
    """Least-squares stretch with the tested parameters at their identity, shape (q,)."""
    members = surface.coordinates.stretches
    families = [(FAMILIES[members[j].family], i) for j, i in free_parameters(members)]
    identity, low, high, scale = np.array(
        [[f.identity[i], f.low[i], f.high[i], f.scale[i]] for f, i in families]
    ).reshape(-1, 4).T  # fmt: skip
    theta = np.where(tested, identity, np.clip(surface.theta, low, high))
    if tested.all():
        return theta
    low, high, scale = low[~tested], high[~tested], scale[~tested]

    def residual(free: Floats) -> Floats:
        theta[~tested] = free
        q, _ = np.linalg.qr(matrix(theta))
        return np.asarray(y - q @ (q.T @ y))

    def log_of_squares(units: Floats) -> Floats:
        squares = [np.square(residual(unit * scale)).sum() for unit in units]
        return np.log(np.maximum(squares, 1e-300))[:, None]

    # dogbox, since a minimum on a bound must lie on it exactly to be settled along it
    bounds = (low, high)
    free = least_squares(residual, theta[~tested], bounds=bounds, x_scale=scale, method="dogbox").x
    found = minimum_nearby(log_of_squares, free / scale, low / scale, high / scale, SETTLING_STEP)
    if found is not None:  # where a descent ends depends on the processor
        free = np.clip(np.round(found.point * scale, DIGITS), low, high)
    theta[~tested] = free
    return theta


def _basis(matrix: Floats) -> Floats:
    """Orthonormal columns that span those of a matrix, however dependent they are."""
    lengths = np.linalg.norm(matrix, axis=0)
    used = lengths > 0
    if not used.any():
        return np.empty((len(matrix), 0))
    u, values, _ = svd(matrix[:, used] / lengths[used], full_matrices=False)
    return np.asarray(u[:, values > 1e-10 * values[0]])
