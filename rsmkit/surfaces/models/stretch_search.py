"""Choosing a stretch: penalised exact PRESS, and the honest leave-one-out error of what was chosen.

The parameters theta minimise ``n ln(PRESS/n) + penalty sum(((theta - identity) / scale)^2)``, with PRESS
exact for given theta (one QR per evaluation); see docs/surfaces.md for why PRESS and why a penalty.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.optimize import NonlinearConstraint, minimize

from rsmkit.errors import FitError, RsmkitError
from rsmkit.language.space import Floats, Space
from rsmkit.newton import Slopes, descended, minimum_nearby, slopes_changed
from rsmkit.surfaces.estimation.coordinates import Coordinates
from rsmkit.surfaces.estimation.stretch import FAMILIES, Stretch, free_parameters, theta_of, with_theta
from rsmkit.surfaces.models.polynomial import PolynomialSurface, with_blocks

__all__ = ["StretchSearch"]

KEEP = 2.0
"""A factor stays stretched when giving it up would raise the criterion by at least this much."""
REFUSED = 1e6
"""Stands for the criterion of a stretch that cannot be used."""
BEND_STEP = 1e-3
"""Difference of a parameter, as a part of the family's scale, for the curvatures that begin a descent."""
SETTLED = 1e-9
"""Last step to the place that no rounding can change, in the same units."""
NEAR = 1e-4
"""Last step to the stretch of all runs but one, which changes its prediction by a millionth of its error."""
DIGITS = 6
"""Decimals of a stretch parameter that are kept; their statistical uncertainty is about 0.1."""
ROUNDING = 1e-13
"""Leave-one-out error, as a part of the response, that no stretch can improve."""
UNSETTLED = 1e-3
"""A descent ends nearer than this to the least criterion there is nearby."""
LEVERAGE = 0.98
"""Stretches that let a single run decide its own fitted value are rejected."""
ALL = 1e-9
"""A leverage this close to one leaves nothing of a run's own error but rounding."""
CLOSE = 0.02
"""A descent that ends with a leverage this close to what is allowed may have been stopped by it."""
ROOM = 1e-7
"""How far below that a minimum is kept which it holds back: more than rounding to DIGITS can take away."""
WALL_STEP = 1e-3
"""Difference of a parameter, in its scale, for the last digits of such a minimum."""


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

    @cached_property
    def least(self) -> float:
        """Mean square error below which there is nothing but rounding: all such stretches are as good."""
        return max(ROUNDING**2 * float(self.y @ self.y) / len(self.y), 1e-300)

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
            self._on_hull(plain),
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
        if count and self.plain.fit.press <= ROUNDING**2 * float(self.rows.y @ self.rows.y):
            raise FitError(f"response {response}: the terms fit it to rounding without a stretch")
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
        ends = [self._least(rows, stretches, np.clip(start, low, high)) for start in tries]
        theta, value = min(ends, key=lambda end: end[1])
        return with_theta(stretches, theta), value

    def _least(self, rows: _Rows, stretches: tuple[Stretch, ...], start: Floats) -> tuple[Floats, float]:
        """Where a descent ends, and the criterion there; along the greatest leverage allowed if it must.

        A wall in the criterion itself would stop a line search somewhere before it, by chance.
        """
        low, high, scale = _limits(stretches)
        function, room = self._in_units(rows, stretches), self._room(rows, stretches)
        bounds = list(zip(low / scale, high / scale, strict=True))
        end = minimize(
            function, start / scale, jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": 60}
        )
        if room(end.x).min() < 0.0:
            end = minimize(
                function,
                start / scale,
                jac=True,
                method="SLSQP",
                bounds=bounds,
                constraints=NonlinearConstraint(room, 0.0, np.inf),
                options={"ftol": 1e-12},
            )
        theta = np.clip(end.x * scale, low, high)
        return theta, self._criterion(theta, stretches, rows)

    def _room(self, rows: _Rows, stretches: tuple[Stretch, ...]) -> Callable[[Floats], Floats]:
        """How far each leverage is below the greatest that is allowed, by parameters in their scales."""
        scale = _limits(stretches)[2]

        def room(units: Floats) -> Floats:
            found = self._at(with_theta(stretches, units * scale), rows)
            return np.full(len(rows.y), -1.0) if found is None else self.limit - ROOM - found[2]

        return room

    def prune(self, stretches: tuple[Stretch, ...], value: float) -> tuple[Stretch, ...]:
        """Give up stretching factors that gain little, the least useful first."""
        while True:
            options, free = [], free_parameters(stretches)
            bend = self.curvatures(stretches)
            for j in sorted({j for j, _ in free}):
                fewer = list(stretches)
                fewer[j] = Stretch("identity", (), stretches[j].low, stretches[j].high)
                kept = [c for c, (of, _) in enumerate(free) if of != j]
                near = self._near(self.rows, tuple(fewer), bend[np.ix_(kept, kept)])
                options.append((near, self._criterion(theta_of(near), near, self.rows)))
            if not options:
                return stretches
            least = min(value for _, value in options)
            best = min(
                (self._settled(*option) for option in options if option[1] <= least + UNSETTLED),
                key=lambda option: option[1],
            )
            if best[1] - value >= KEEP:
                return stretches
            stretches, value = best

    def nested_errors(self, stretches: tuple[Stretch, ...]) -> Floats:
        """Error at each run with everything, the stretch too, fitted without it, shape (n,).

        The stretch of all runs is where each descent begins, and its curvatures are nearly those there.
        """
        errors, bend = np.empty(len(self.rows.y)), self.curvatures(stretches)
        everything = np.arange(len(self.rows.y))
        for i in everything:
            rest, left_out = self.rows.only(np.delete(everything, i)), self.rows.only(everything[i : i + 1])
            without = self._near(rest, stretches, bend)
            q, r = np.linalg.qr(self._matrix(without, rest))
            beta = solve_triangular(r, q.T @ rest.y)
            errors[i] = (self._matrix(without, left_out) @ beta - left_out.y)[0]
        return errors

    def near(self, stretches: tuple[Stretch, ...], curvatures: Floats) -> tuple[Stretch, ...]:
        """Best members of the given families near the given ones, where the curvatures are about known."""
        return self._near(self.rows, stretches, curvatures)

    def _near(self, rows: _Rows, stretches: tuple[Stretch, ...], curvatures: Floats) -> tuple[Stretch, ...]:
        found = self._descended(rows, stretches, curvatures, NEAR)
        return self._best_for(rows, stretches)[0] if found is None else with_theta(stretches, found)

    def _settled(self, stretches: tuple[Stretch, ...], value: float) -> tuple[tuple[Stretch, ...], float]:
        """Parameters to the digits that no rounding can change, and their criterion.

        A descent ends about 1e-6 from the minimum; where, depends on the processor.
        """
        low, high, _ = _limits(stretches)
        found = self._descended(self.rows, stretches, self.curvatures(stretches), SETTLED)
        if found is None:
            found = self._at_the_limit(stretches)
        if found is None:
            return stretches, value
        theta = np.clip(np.round(found, DIGITS), low, high)
        reached = self._criterion(theta, stretches, self.rows)
        return (with_theta(stretches, theta), reached) if reached <= value + UNSETTLED else (stretches, value)

    def _at_the_limit(self, stretches: tuple[Stretch, ...]) -> Floats | None:
        """Parameters of a minimum nearby that the greatest leverage allowed holds back, if it does."""
        low, high, scale = _limits(stretches)
        function = self._in_units(self.rows, stretches)
        room = self._room(self.rows, stretches)

        def quantities(points: Floats) -> Floats:
            return np.array([[function(units)[0], *room(units)] for units in points])

        start = theta_of(stretches) / scale
        if room(start).min() > CLOSE:
            return None
        found = minimum_nearby(quantities, start, low / scale, high / scale, WALL_STEP)
        return None if found is None else np.asarray(np.clip(found.point * scale, low, high))

    def curvatures(self, stretches: tuple[Stretch, ...]) -> Floats:
        """Second derivatives of the criterion by the parameters in units of their scales, shape (q, q)."""
        low, high, scale = _limits(stretches)
        function = self._in_units(self.rows, stretches)
        return slopes_changed(function, theta_of(stretches) / scale, low / scale, high / scale, BEND_STEP)

    def _descended(
        self, rows: _Rows, stretches: tuple[Stretch, ...], curvatures: Floats, enough: float
    ) -> Floats | None:
        """Parameters of a minimum near the given ones, shape (q,); None where that is not the way to it."""
        low, high, scale = _limits(stretches)
        function = self._in_units(rows, stretches)
        start = theta_of(stretches) / scale
        found = descended(function, start, curvatures, low / scale, high / scale, enough)
        if found is None or self._room(rows, stretches)(found).min() < 0.0:
            return None
        return np.asarray(np.clip(found * scale, low, high))

    def _in_units(self, rows: _Rows, stretches: tuple[Stretch, ...]) -> Slopes:
        """The criterion by parameters in their scales, smooth where a leverage exceeds what is allowed."""
        scale = _limits(stretches)[2]

        def function(units: Floats) -> tuple[float, Floats]:
            value, slopes = self._criterion_and_slope(units * scale, stretches, rows)
            return value, slopes * scale

        return function

    def _criterion_and_slope(
        self, theta: Floats, stretches: tuple[Stretch, ...], rows: _Rows
    ) -> tuple[float, Floats]:
        """Criterion and its derivatives by theta, whatever the leverages up to one.

        PRESS is differentiated by the whole matrix of columns at once (the derivative of the hat matrix is in
        Golub & Pereyra 1973); each parameter moves the columns of its factor.
        """
        members = with_theta(stretches, theta)
        found = self._at(members, rows)
        if found is None or found[2].max() > 1.0 - ALL:
            return REFUSED, np.zeros_like(theta)
        q, r, leverages, left = found
        n, free = len(rows.y), free_parameters(members)
        inverse = solve_triangular(r, q.T, check_finite=False)  # pseudo-inverse of the matrix
        errors = left / (1.0 - leverages)
        mean_square = float(errors @ errors) / n
        value = float(n * np.log(max(mean_square, rows.least)) + self.penalty * self._departure(members))
        scale = 2.0 / mean_square if mean_square > rows.least else 0.0
        pull = scale * errors / (1.0 - leverages)
        weight = pull * errors
        # what the value changes by each entry of the matrix: through the residuals, then the leverages
        by_matrix = 2.0 * weight[:, None] * inverse.T
        by_matrix -= np.outer(pull, inverse @ rows.y)
        by_matrix -= q @ (q.T @ by_matrix)
        by_matrix -= np.outer(left, inverse @ pull)
        by_factor = self._by_factor(members, rows, by_matrix)
        slope = np.array([2.0 * by_factor[j] @ members[j].change(i, rows.u[:, j]) for j, i in free])
        for c, (j, i) in enumerate(free):
            family = FAMILIES[members[j].family]
            away = (members[j].parameters[i] - family.identity[i]) / family.scale[i]
            slope[c] += 2.0 * self.penalty * away / family.scale[i]
        return value, slope

    def _criterion(self, theta: Floats, stretches: tuple[Stretch, ...], rows: _Rows) -> float:
        members = with_theta(stretches, theta)
        found = self._at(members, rows)
        if found is None:
            return REFUSED
        _, _, leverages, left = found
        if leverages.max() > self.limit:
            return REFUSED * float(leverages.max())
        errors = left / (1.0 - leverages)
        mean_square = max(float(errors @ errors) / len(rows.y), rows.least)
        return float(len(rows.y) * np.log(mean_square) + self.penalty * self._departure(members))

    def _at(self, members: tuple[Stretch, ...], rows: _Rows) -> tuple[Floats, Floats, Floats, Floats] | None:
        """Decomposition of the matrix, leverages and residuals; None where the stretch overflows."""
        matrix = self._matrix(members, rows)
        if not np.isfinite(matrix).all():
            return None
        q, r = np.linalg.qr(matrix)
        leverages = np.einsum("ij,ij->i", q, q)
        return q, r, leverages, rows.y - q @ (q.T @ rows.y)

    def _departure(self, members: tuple[Stretch, ...]) -> float:
        """How far the parameters are from changing nothing, squared, in the sizes of typical departures."""
        return sum(
            ((members[j].parameters[i] - FAMILIES[members[j].family].identity[i])
             / FAMILIES[members[j].family].scale[i]) ** 2
            for j, i in free_parameters(members)
        )  # fmt: skip

    def _by_factor(self, members: tuple[Stretch, ...], rows: _Rows, by_matrix: Floats) -> Floats:
        """Derivatives by each stretched factor, of the runs it moves, shape (k, n)."""
        of_terms = np.delete(by_matrix, np.s_[1 : 1 + rows.blocks.shape[1]], axis=1)
        base, _ = self.plain.terms.derivatives
        lower, pull = base.matrix(self._stretched(members, rows)), of_terms * rows.root[:, None]
        return np.array([(lower[:, i] * pull[:, c]) @ by for i, c, by in self._derivatives])

    @cached_property
    def _derivatives(self) -> tuple[tuple[NDArray[np.intp], NDArray[np.intp], Floats], ...]:
        """Of the terms by each factor: rows, columns and values of what is not zero in the matrix."""
        found = []
        for by in self.plain.terms.derivatives[1]:
            i, c = np.nonzero(by)
            found.append((i, c, by[i, c]))
        return tuple(found)

    @staticmethod
    def _on_hull(plain: PolynomialSurface) -> Floats:
        """Runs on [0, 1] of their hull, whatever rounding; categories so that ``2 u - 1`` is their index."""
        u, numeric = 0.5 * (plain.coordinates.forward(plain.data.points) + 1.0), plain.space.numeric
        u[:, numeric] = np.clip(u[:, numeric], 0.0, 1.0)
        return np.asarray(u)

    def _matrix(self, stretches: tuple[Stretch, ...], rows: _Rows) -> Floats:
        matrix = with_blocks(self.plain.terms.matrix(self._stretched(stretches, rows)), rows.blocks)
        return np.asarray(matrix * rows.root[:, None])

    @staticmethod
    def _stretched(stretches: tuple[Stretch, ...], rows: _Rows) -> Floats:
        """Factors on [-1, 1], stretched, shape (n, k)."""
        z = 2.0 * rows.u - 1.0
        for j, stretch in enumerate(stretches):
            if stretch.family != "identity":
                z[:, j] = 2.0 * stretch.inside(rows.u[:, j]) - 1.0
        return z


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
