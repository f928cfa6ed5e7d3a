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
from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular, svd
from scipy.optimize import least_squares

from rsmkit.language.space import Floats
from rsmkit.newton import descended, minimum_nearby
from rsmkit.surfaces.estimation.coordinates import Coordinates
from rsmkit.surfaces.estimation.least_squares import LeastSquares
from rsmkit.surfaces.estimation.stretch import FAMILIES, free_parameters

__all__ = ["Restrictable", "score_statistic"]

NEAR = 1e-4
"""Gain and step, as parts, with which a search ends and the settling of its last digits begins."""
SETTLED = 1e-9
"""Last step of a restricted fit, as a part of the family's scale, to what no rounding can change."""
SETTLING_STEP = 2e-3
"""Difference, as a part of the family's scale, that settles the last digits where nothing shorter does."""
DIGITS = 6
"""Decimals of a restricted stretch parameter that are kept; a score is regressed on what they leave."""
LEAST = 1e-300
"""Least sum of squares of which a logarithm is taken."""
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

    def changes_at(self, theta: Floats) -> Floats:
        """Derivatives of :meth:`matrix_at` by the stretch parameters, shape (q, n, p - q)."""
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

    theta = _Restricted(surface, kept, tested[count:], root, y).theta()
    x = surface.matrix_at(theta) * root[:, None]
    beta = np.zeros(count)
    beta[kept] = np.linalg.lstsq(x[:, kept], y, rcond=None)[0]
    whole = np.column_stack([x, (surface.changes_at(theta) @ beta).T * root[:, None]])
    nuisance = _basis(whole[:, ~tested])
    left = y - x @ beta
    left -= nuisance @ (nuisance.T @ left)
    new = whole[:, tested] - nuisance @ (nuisance.T @ whole[:, tested])
    if (np.linalg.norm(new, axis=0) <= SMALL * np.linalg.norm(whole[:, tested], axis=0)).any():
        return math.nan
    explained = float(np.square(_basis(new).T @ left).sum())
    rest = max(float(left @ left) - explained, 0.0)
    return explained / len(columns) / (rest / surface.fit.df) if rest else math.inf


class _Restricted:
    """The least-squares fit of a surface with some parameters at what they are tested for.

    The coefficients follow from the stretch parameters (variable projection: Golub & Pereyra 1973).

    Parameters
    ----------
    surface : Restrictable
    kept : array of bool, shape (p - q,)
        Coefficients that are not tested.
    tested : array of bool, shape (q,)
        Stretch parameters that are.
    root, y : array, shape (n,)
        Roots of the weights, and the response times these.
    """

    def __init__(
        self,
        surface: Restrictable,
        kept: NDArray[np.bool_],
        tested: NDArray[np.bool_],
        root: Floats,
        y: Floats,
    ) -> None:
        members = surface.coordinates.stretches
        families = [(FAMILIES[members[j].family], i) for j, i in free_parameters(members)]
        identity, low, high, scales = np.array(
            [[f.identity[i], f.low[i], f.high[i], f.scale[i]] for f, i in families]
        ).reshape(-1, 4).T  # fmt: skip
        self.surface, self.kept, self.free, self.root, self.y = surface, kept, ~tested, root, y
        self.start = np.where(tested, identity, np.clip(surface.theta, low, high))
        self.scale = scales[self.free]
        self.low, self.high = low[self.free] / self.scale, high[self.free] / self.scale
        self.last: tuple[bytes, tuple[Floats, Floats, Floats, Floats]] | None = None

    def theta(self) -> Floats:
        """Stretch parameters, shape (q,)."""
        if not self.free.any():
            return self.start
        # dogbox, since a minimum on a bound must lie on it exactly to be settled along it
        near = least_squares(
            self.residuals,
            self.start[self.free] / self.scale,
            jac=self.slopes,
            bounds=(self.low, self.high),
            method="dogbox",
            ftol=NEAR,
            xtol=NEAR,
            gtol=NEAR * NEAR,
        )
        slopes = np.asarray(near.jac)
        bend = slopes.T @ slopes / max(float(near.cost), LEAST)
        found = descended(self.log_and_slopes, near.x, bend, self.low, self.high, SETTLED)
        if found is None:
            settled = minimum_nearby(self.log_of_squares, near.x, self.low, self.high, SETTLING_STEP)
            found = near.x if settled is None else settled.point
        # where a descent ends depends on the processor
        return self.whole(np.clip(np.round(found * self.scale, DIGITS) / self.scale, self.low, self.high))

    def whole(self, units: Floats) -> Floats:
        """All stretch parameters, from the free ones in units of their scales."""
        theta = self.start.copy()
        theta[self.free] = units * self.scale
        return theta

    def decomposed(self, units: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """Parameters, basis and triangle of the columns that are not tested, and residuals."""
        place = units.tobytes()
        if self.last is None or self.last[0] != place:  # a search asks for residuals, then for slopes there
            theta = self.whole(units)
            q, r = np.linalg.qr(self.surface.matrix_at(theta)[:, self.kept] * self.root[:, None])
            self.last = place, (theta, q, r, self.y - q @ (q.T @ self.y))
        return self.last[1]

    def residuals(self, units: Floats) -> Floats:
        """What is left of the response, shape (n,)."""
        return self.decomposed(units)[3]

    def slopes(self, units: Floats) -> Floats:
        """Derivatives of the residuals by the parameters, shape (n, free)."""
        theta, q, r, left = self.decomposed(units)
        changes = self.changes(theta)
        moved = (changes @ solve_triangular(r, q.T @ self.y)).T
        turned = solve_triangular(r, (left @ changes).T, trans="T")
        return np.asarray(-(moved - q @ (q.T @ moved)) - q @ turned)

    def log_and_slopes(self, units: Floats) -> tuple[float, Floats]:
        """Logarithm of the sum of squares and its derivatives: those while the coefficients are held."""
        theta, q, r, left = self.decomposed(units)
        squares = max(float(left @ left), LEAST)
        moved = self.changes(theta) @ solve_triangular(r, q.T @ self.y)
        return math.log(squares), -2.0 * (moved @ left) / squares

    def log_of_squares(self, units: Floats) -> Floats:
        """The same at many points, without derivatives, shape (m, 1)."""
        squares = [float(np.square(self.residuals(unit)).sum()) for unit in units]
        return np.log(np.maximum(squares, LEAST))[:, None]

    def changes(self, theta: Floats) -> Floats:
        """Derivatives of the columns by the free parameters, shape (free, n, kept)."""
        found = self.surface.changes_at(theta)[self.free][:, :, self.kept]
        return np.asarray(found * self.root[:, None] * self.scale[:, None, None])


def _basis(matrix: Floats) -> Floats:
    """Orthonormal columns that span those of a matrix, however dependent they are."""
    lengths = np.linalg.norm(matrix, axis=0)
    used = lengths > 0
    if not used.any():
        return np.empty((len(matrix), 0))
    u, values, _ = svd(matrix[:, used] / lengths[used], full_matrices=False)
    return np.asarray(u[:, values > 1e-10 * values[0]])
