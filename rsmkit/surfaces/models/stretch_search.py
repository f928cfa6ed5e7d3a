"""Choosing a stretch: penalised exact PRESS, and the honest leave-one-out error of what was chosen.

The parameters theta minimise ``n ln(PRESS/n) + penalty sum(((theta - identity) / scale)^2)``, with PRESS
exact for given theta (one QR per evaluation); see docs/surfaces.md for why PRESS and why a penalty.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.optimize import minimize

from rsmkit.errors import FitError, RsmkitError
from rsmkit.language.space import Floats, Space
from rsmkit.newton import minimum_nearby
from rsmkit.surfaces.estimation.coordinates import Coordinates
from rsmkit.surfaces.estimation.stretch import FAMILIES, Stretch, free_parameters, theta_of, with_theta
from rsmkit.surfaces.models.polynomial import PolynomialSurface, with_blocks

__all__ = ["StretchSearch"]

KEEP = 2.0
"""A factor stays stretched when giving it up would raise the criterion by at least this much."""
STEP = 1e-6
"""Difference in a stretch parameter for the slope of the criterion."""
SETTLING_STEP = 2e-3
"""Difference, as a part of the family's scale, that settles the last digits: the criterion has a rounding
error of some 1e-12 and curvatures above 10, so that parameters are known to 1e-10."""
DIGITS = 6
"""Decimals of a stretch parameter that are kept; their statistical uncertainty is about 0.1."""
SAME = 1e-9
"""A difference of the criterion that means nothing."""
LEVERAGE = 0.98
"""Stretches that let a single run decide its own fitted value are rejected."""


@dataclass(frozen=True)
class _Rows:
    """What the criterion needs of some of the runs.

    Parameters
    ----------
    u : array, shape (n, k)
        Factors on [0, 1] of the hull of all runs.
    blocks : array, shape (n, blocks - 1)
    root : array, shape (n,)
        Square roots of the weights.
    y : array, shape (n,)
        Responses times `root`.
    """

    u: Floats
    blocks: Floats
    root: Floats
    y: Floats

    def only(self, keep: NDArray[np.intp]) -> _Rows:
        return _Rows(self.u[keep], self.blocks[keep], self.root[keep], self.y[keep])


class StretchSearch:
    """Minimises the penalised exact PRESS over the stretch parameters of one response.

    Its only state is the generator of random starts: each search takes the next ones, so that a second
    search looks elsewhere.

    Parameters
    ----------
    plain : PolynomialSurface
        The terms without a stretch.
    penalty : float
        Weight that pulls the stretch towards none.
    seed : int
        For the random starts.
    """

    def __init__(self, plain: PolynomialSurface, *, penalty: float = 1.0, seed: int = 0) -> None:
        self.plain = plain
        self.penalty = penalty
        self.rng = np.random.default_rng(seed)
        root = np.sqrt(plain.fit.weights)
        self.rows = _Rows(
            0.5 * (plain.coordinates.forward(plain.data.points) + 1.0),
            plain.data.block_columns(),
            root,
            plain.data.y * root,
        )
        self.limit = max(LEVERAGE, float(plain.fit.leverages.max()) + 1e-6)

    def find(self, family: str | Mapping[str, str]) -> tuple[Stretch, ...]:
        """Stretch of every factor; families as for :func:`rsmkit.surfaces.models.stretched.fit_stretched`.

        Raises
        ------
        FitError
            With too few runs, or when no factor gains from being stretched.
        """
        stretches = _identity_members(self.plain.space, self.plain.coordinates, family)
        response, count = self.plain.response, len(free_parameters(stretches))
        if all(s.family == "identity" for s in stretches):
            raise FitError(f"response {response}: no factor can be stretched (too few levels, or categories)")
        needed = self.plain.fit.p + count + 4
        runs = len(self.rows.y)
        if runs < needed:
            raise FitError(
                f"response {response}: {self.plain.fit.p} terms and {count} stretch parameters need at least "
                f"{needed} runs, there are {runs}; fit the plain surface or add runs"
            )
        stretches, value = self.best(stretches, starts=4)
        stretches = self.prune(stretches, value)
        if all(s.family == "identity" for s in stretches):
            raise FitError(f"response {response}: no factor gains from being stretched")
        return stretches

    def best(self, stretches: tuple[Stretch, ...], starts: int = 1) -> tuple[tuple[Stretch, ...], float]:
        """Best members of the given families, from the given ones and further random starts."""
        return self._settled(*self._best_for(self.rows, stretches, starts))

    def _best_for(
        self, rows: _Rows, stretches: tuple[Stretch, ...], starts: int = 1
    ) -> tuple[tuple[Stretch, ...], float]:
        free = free_parameters(stretches)
        if not free:
            return stretches, self._criterion(np.empty(0), stretches, rows)
        low, high, scale = _limits(stretches)
        first = theta_of(stretches)
        tries = [first, *(first + 0.7 * scale * self.rng.standard_normal((starts - 1, len(free))))]
        found = [
            minimize(
                self._criterion_and_slope,
                np.clip(start, low, high),
                args=(stretches, rows, high),
                jac=True,
                method="L-BFGS-B",
                bounds=list(zip(low, high, strict=True)),
                options={"maxiter": 60},
            )
            for start in tries
        ]
        winner = min(found, key=lambda result: float(result.fun))
        return with_theta(stretches, winner.x), float(winner.fun)

    def prune(self, stretches: tuple[Stretch, ...], value: float) -> tuple[Stretch, ...]:
        """Give up stretching factors that gain little, the least useful first."""
        while True:
            options = []
            for j in sorted({j for j, _ in free_parameters(stretches)}):
                fewer = list(stretches)
                fewer[j] = Stretch("identity", (), stretches[j].low, stretches[j].high)
                options.append(self.best(tuple(fewer)))
            if not options:
                return stretches
            best = min(options, key=lambda option: option[1])
            if best[1] - value >= KEEP:
                return stretches
            stretches, value = best

    def nested_press(self, stretches: tuple[Stretch, ...]) -> float:
        """Sum of squared errors at each run with everything, the stretch too, fitted without it."""
        total = 0.0
        everything = np.arange(len(self.rows.y))
        for i in everything:
            rest, left_out = self.rows.only(np.delete(everything, i)), self.rows.only(everything[i : i + 1])
            without, _ = self._best_for(rest, stretches)
            q, r = np.linalg.qr(self._matrix(without, rest))
            beta = solve_triangular(r, q.T @ rest.y)
            total += float((self._matrix(without, left_out) @ beta - left_out.y)[0] ** 2)
        return total

    def _settled(self, stretches: tuple[Stretch, ...], value: float) -> tuple[tuple[Stretch, ...], float]:
        """Parameters to the digits that no rounding can change, and their criterion.

        A descent ends about 1e-6 from the minimum; where, depends on the processor.
        """
        low, high, scale = _limits(stretches)

        def criteria(units: Floats) -> Floats:
            return np.array([[self._criterion(unit * scale, stretches, self.rows)] for unit in units])

        found = minimum_nearby(
            criteria, theta_of(stretches) / scale, low / scale, high / scale, SETTLING_STEP
        )
        if found is None:
            return stretches, value
        theta = np.clip(np.round(found.point * scale, DIGITS), low, high)
        reached = self._criterion(theta, stretches, self.rows)
        return (with_theta(stretches, theta), reached) if reached <= value + SAME else (stretches, value)

    def _criterion_and_slope(
        self, theta: Floats, stretches: tuple[Stretch, ...], rows: _Rows, high: Floats
    ) -> tuple[float, Floats]:
        """Criterion and its differences by theta, forward or, at the upper bound, backward."""
        value = self._criterion(theta, stretches, rows)
        slope = np.empty_like(theta)
        for i in range(len(theta)):
            moved = theta.copy()
            moved[i] += STEP if theta[i] + STEP <= high[i] else -STEP
            slope[i] = (self._criterion(moved, stretches, rows) - value) / (moved[i] - theta[i])
        return value, slope

    def _criterion(self, theta: Floats, stretches: tuple[Stretch, ...], rows: _Rows) -> float:
        members = with_theta(stretches, theta)
        matrix = self._matrix(members, rows)
        if not np.isfinite(matrix).all():
            return 1e6
        q, _ = np.linalg.qr(matrix)
        leverages = np.einsum("ij,ij->i", q, q)
        if leverages.max() > self.limit:
            return 1e6 * float(leverages.max())
        errors = (rows.y - q @ (q.T @ rows.y)) / (1.0 - leverages)
        mean_square = max(float(errors @ errors) / len(rows.y), 1e-300)
        departure = sum(
            ((members[j].parameters[i] - FAMILIES[members[j].family].identity[i])
             / FAMILIES[members[j].family].scale[i]) ** 2
            for j, i in free_parameters(members)
        )  # fmt: skip
        return float(len(rows.y) * np.log(mean_square) + self.penalty * departure)

    def _matrix(self, stretches: tuple[Stretch, ...], rows: _Rows) -> Floats:
        z = 2.0 * rows.u - 1.0
        for j, stretch in enumerate(stretches):
            if stretch.family != "identity":
                z[:, j] = 2.0 * stretch.forward(rows.u[:, j]) - 1.0
        matrix = with_blocks(self.plain.terms.matrix(z), rows.blocks)
        return np.asarray(matrix * rows.root[:, None])


def _limits(stretches: tuple[Stretch, ...]) -> tuple[Floats, Floats, Floats]:
    """Lower and upper bounds and scales of the free parameters, each of shape (q,)."""
    free = [(FAMILIES[stretches[j].family], i) for j, i in free_parameters(stretches)]
    rows = [[spec.low[i], spec.high[i], spec.scale[i]] for spec, i in free]
    low, high, scale = np.array(rows).reshape(-1, 3).T
    return low, high, scale


def _identity_members(
    space: Space, coordinates: Coordinates, family: str | Mapping[str, str]
) -> tuple[Stretch, ...]:
    """Families as asked for, each at its identity."""
    if not isinstance(family, str):
        unknown = [name for name in family if name not in space.names]
        if unknown:
            raise RsmkitError(f"stretch: {', '.join(unknown)} not among the factors {', '.join(space.names)}")
    members = []
    for factor, low, high in zip(space, coordinates.low, coordinates.high, strict=True):
        word = family if isinstance(family, str) else family.get(factor.name, "identity")
        flat = not factor.domain.is_numeric or len(factor.levels) == 2
        if flat and isinstance(family, str):
            word = "identity"
        if flat and word != "identity":
            raise RsmkitError(f"stretch: factor {factor.name} has no range to stretch")
        if word in FAMILIES and word != "fixed":
            members.append(Stretch(word, FAMILIES[word].identity, low, high))
        else:
            members.append(Stretch("fixed", (), low, high, word))
    return tuple(members)
