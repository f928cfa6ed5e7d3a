"""Second-order surfaces in stretched factors, and how the stretch is chosen.

The parameters theta of the stretch minimise ``n ln(PRESS/n) + sum(((theta - identity) / scale)^2)`` with
PRESS exact for given theta. Inference is joint: the derivatives of the prediction by theta are columns
beside the terms (Gauss-Newton), because tests that take theta as known reject far too often.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import solve_triangular
from scipy.optimize import minimize

from rsmkit.errors import FitError, RsmkitError
from rsmkit.space import Floats, Space
from rsmkit.surfaces.coordinates import Coordinates
from rsmkit.surfaces.data import FitData
from rsmkit.surfaces.least_squares import least_squares
from rsmkit.surfaces.polynomial import PolynomialSurface, fit_polynomial, read_model, with_blocks
from rsmkit.surfaces.reading import fail, read_item, read_number
from rsmkit.surfaces.stretch import FAMILIES, Stretch
from rsmkit.terms import Terms

__all__ = ["ADOPT", "StretchedSurface", "fit_stretched"]

ADOPT = 0.9
"""A stretch is adopted when its nested leave-one-out error is at most this part of the plain one's."""
KEEP = 2.0
"""A factor stays stretched when giving it up would raise the criterion by at least this much."""
LEVERAGE = 0.98
"""Stretches that let a single run decide its own fitted value are rejected."""
STEP = 1e-5
"""Difference in a stretch parameter for derivatives of the prediction."""


@dataclass(frozen=True, eq=False)
class StretchedSurface(PolynomialSurface):
    """A polynomial in stretched factors.

    The first coefficients of `fit` belong to the terms in stretched units, the last to the stretch
    parameters.

    Parameters
    ----------
    nested_press : float
        Sum of squared leave-one-out errors with the stretch chosen anew without each run.
    plain_press : float
        PRESS of the same terms without a stretch.
    """

    nested_press: float
    plain_press: float

    @property
    def adopted(self) -> bool:
        """Whether the stretch predicts clearly better than the plain surface."""
        return self.nested_press <= ADOPT**2 * self.plain_press

    @property
    def units(self) -> str:
        """Units of the coefficients."""
        return "stretched"

    def to_units(self, natural: Floats) -> Floats:
        """Natural to stretched units, shape (..., k)."""
        return self.coordinates.forward(natural)

    def from_units(self, values: Floats) -> Floats:
        """Stretched to natural units, shape (..., k)."""
        return self.coordinates.backward(values)

    @property
    def theta(self) -> Floats:
        """Fitted stretch parameters, shape (q,)."""
        return self.fit.coefficients[self.fit.p - self._extra_count :]

    @cached_property
    def coefficients(self) -> Floats:
        """Coefficients in stretched units, then the stretch parameters, shape (p,)."""
        return self.fit.coefficients

    @cached_property
    def coded_factor(self) -> Floats:
        """Joint covariance factor in stretched units."""
        return self.fit.factor

    @cached_property
    def coded_matrix(self) -> Floats:
        """Same as :attr:`matrix`."""
        return self.matrix

    def intervals_of_theta(self, confidence: float = 0.95) -> Floats:
        """Wald limits of the stretch parameters, shape (q, 2)."""
        return self.confidence_intervals(confidence)[self.fit.p - self._extra_count :]

    def report(self) -> dict[str, Any]:
        """All statistics as JSON values; tests and intervals are joint with the stretch."""
        from rsmkit.surfaces.report import stretched_report

        return stretched_report(self)

    def to_json(self) -> dict[str, Any]:
        """JSON values; inverse of :meth:`from_json`."""
        stretches = [
            {"family": s.family, "parameters": list(s.parameters), "expression": s.expression}
            for s in self.coordinates.stretches
        ]
        return {
            **super().to_json(),
            "model": "stretched",
            "stretches": stretches,
            "nested_press": self.nested_press,
            "plain_press": self.plain_press,
        }

    @classmethod
    def from_json(cls, data: Any) -> StretchedSurface:
        """Read what :meth:`to_json` wrote, checking that the coefficients belong to the runs."""
        space, terms, coordinates, runs = read_model(data)
        rows = read_item(data, "stretches", list)
        if len(rows) != len(space):
            raise fail("'stretches' should hold one entry per factor")
        stretches = []
        for row, low, high in zip(rows, coordinates.low, coordinates.high, strict=True):
            parameters = read_item(row, "parameters", list)
            if not all(isinstance(v, float | int) and not isinstance(v, bool) for v in parameters):
                raise fail("'parameters' of a stretch should be numbers")
            stretches.append(
                Stretch(
                    read_item(row, "family", str),
                    tuple(parameters),
                    low,
                    high,
                    read_item(row, "expression", str),
                )
            )
        surface = _surface_at(
            space,
            read_item(data, "response", str),
            runs,
            terms,
            replace(coordinates, stretches=tuple(stretches)),
            read_number(data, "nested_press"),
            read_number(data, "plain_press"),
        )
        return surface.restored(data)

    def polynomial(self) -> tuple[Terms, Floats]:
        """Terms and coefficients in stretched units of the predicted surface (blocks averaged)."""
        return self.terms, self.working_coefficients

    def _extra_names(self) -> tuple[str, ...]:
        members, factors = self.coordinates.stretches, self.space.names
        return tuple(
            f"stretch[{factors[j]}].{FAMILIES[members[j].family].parameters[i]}" for j, i in _free(members)
        )

    def _extra_columns(self, points: Floats) -> Floats:
        return _theta_columns(self.terms, self.coordinates, self.working_coefficients, points)


def fit_stretched(
    space: Space,
    response: str,
    data: FitData,
    terms: Terms,
    family: str | Mapping[str, str] = "exp",
    *,
    penalty: float = 1.0,
    seed: int = 0,
) -> StretchedSurface:
    """Choose a stretch per factor and fit the terms in it.

    Parameters
    ----------
    space, response, data, terms
        As for :func:`rsmkit.surfaces.polynomial.fit_polynomial`.
    family : str or mapping of str to str
        Family of all numeric factors, or of each by name (``identity`` where not named; a formula of ``x``
        is a fixed map of the user's own).
    penalty : float
        Weight that pulls the stretch towards none.
    seed : int
        For the three random starts of the search.

    Returns
    -------
    StretchedSurface
        The best one found, whether :attr:`StretchedSurface.adopted` or not.

    Raises
    ------
    FitError
        With too few runs, or when no factor gains from being stretched.
    """
    plain = fit_polynomial(space, response, data, terms)
    search = _Search(plain, penalty, seed)
    stretches = _identity_members(space, plain.coordinates, family)
    if not _free(stretches) and all(s.family != "fixed" for s in stretches):
        raise FitError(
            f"response {response}: no factor can be stretched (they have two levels or are categorical)"
        )
    needed = plain.fit.p + len(_free(stretches)) + 4
    if len(data) < needed:
        raise FitError(
            f"response {response}: {plain.fit.p} terms and {len(_free(stretches))} stretch parameters need "
            f"at least {needed} runs, there are {len(data)}; fit the plain surface or add runs"
        )
    stretches, value = search.best(stretches, starts=4)
    stretches = search.prune(stretches, value)
    if not any(s.family != "identity" for s in stretches):
        raise FitError(f"response {response}: no factor gains from being stretched")
    return _surface_at(
        space,
        response,
        data,
        terms,
        replace(plain.coordinates, stretches=stretches),
        search.nested_press(stretches),
        plain.fit.press,
    )


class _Search:
    """Minimises the penalised exact PRESS over the stretch parameters of one response."""

    def __init__(self, plain: PolynomialSurface, penalty: float, seed: int) -> None:
        self.plain = plain
        self.penalty = penalty
        self.rng = np.random.default_rng(seed)
        self.blocks = plain.data.block_columns()
        self.root = np.sqrt(plain.fit.weights)
        self.limit = max(LEVERAGE, float(plain.fit.leverages.max()) + 1e-6)
        self.runs = np.arange(len(plain.data))

    def best(self, stretches: tuple[Stretch, ...], starts: int = 1) -> tuple[tuple[Stretch, ...], float]:
        """Best members of the given families, from the given ones and further random starts."""
        free = _free(stretches)
        if not free:
            return stretches, self._criterion(np.empty(0), stretches)
        specs = [FAMILIES[stretches[j].family] for j, _ in free]
        low = np.array([spec.low[i] for spec, (_, i) in zip(specs, free, strict=True)])
        high = np.array([spec.high[i] for spec, (_, i) in zip(specs, free, strict=True)])
        scale = np.array([spec.scale[i] for spec, (_, i) in zip(specs, free, strict=True)])
        first = _theta(stretches)
        tries = [first, *(first + 0.7 * scale * self.rng.standard_normal((starts - 1, len(free))))]
        found = [
            minimize(
                self._criterion,
                np.clip(start, low, high),
                args=(stretches,),
                method="L-BFGS-B",
                bounds=list(zip(low, high, strict=True)),
                options={"maxiter": 60, "eps": 1e-6},
            )
            for start in tries
        ]
        winner = min(found, key=lambda result: float(result.fun))
        return _with_theta(stretches, winner.x), float(winner.fun)

    def prune(self, stretches: tuple[Stretch, ...], value: float) -> tuple[Stretch, ...]:
        """Give up stretching factors that gain little, the least useful first."""
        while True:
            options = []
            for j in sorted({j for j, _ in _free(stretches)}):
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
        everything = self.runs
        for i in everything:
            self.runs = np.delete(everything, i)
            without, _ = self.best(stretches)
            q, r = np.linalg.qr(self._matrix(without))
            beta = solve_triangular(r, q.T @ (self.plain.data.y * self.root)[self.runs])
            self.runs = everything[i : i + 1]
            total += float((self._matrix(without) @ beta - (self.plain.data.y * self.root)[i])[0] ** 2)
        self.runs = everything
        return total

    def _criterion(self, theta: Floats, stretches: tuple[Stretch, ...]) -> float:
        members = _with_theta(stretches, theta)
        matrix = self._matrix(members)
        if not np.isfinite(matrix).all():
            return 1e6
        q, _ = np.linalg.qr(matrix)
        leverages = np.einsum("ij,ij->i", q, q)
        if leverages.max() > self.limit:
            return 1e6 * float(leverages.max())
        y = (self.plain.data.y * self.root)[self.runs]
        errors = (y - q @ (q.T @ y)) / (1.0 - leverages)
        mean_square = max(float(errors @ errors) / len(y), 1e-300)
        departure = sum(
            ((members[j].parameters[i] - FAMILIES[members[j].family].identity[i])
             / FAMILIES[members[j].family].scale[i]) ** 2
            for j, i in _free(members)
        )  # fmt: skip
        return float(len(y) * np.log(mean_square) + self.penalty * departure)

    def _matrix(self, stretches: tuple[Stretch, ...]) -> Floats:
        z = replace(self.plain.coordinates, stretches=stretches).forward(self.plain.data.points[self.runs])
        matrix = with_blocks(self.plain.terms.matrix(z), self.blocks[self.runs])
        return np.asarray(matrix * self.root[self.runs, None])


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
        flat = factor.kind == "categorical" or (factor.kind == "discrete" and len(factor.levels) < 3)
        if flat and isinstance(family, str):
            word = "identity"
        if flat and word != "identity":
            raise RsmkitError(f"stretch: factor {factor.name} has no range to stretch")
        if word in FAMILIES and word != "fixed":
            members.append(Stretch(word, FAMILIES[word].identity, low, high))
        else:
            members.append(Stretch("fixed", (), low, high, word))
    return tuple(members)


def _free(stretches: Sequence[Stretch]) -> tuple[tuple[int, int], ...]:
    return tuple((j, i) for j, s in enumerate(stretches) for i in range(len(s.parameters)))


def _theta(stretches: Sequence[Stretch]) -> Floats:
    return np.array([value for s in stretches for value in s.parameters])


def _with_theta(stretches: Sequence[Stretch], theta: Floats) -> tuple[Stretch, ...]:
    """Put a vector of parameters in place."""
    values = iter(theta.tolist())
    return tuple(replace(s, parameters=tuple(next(values) for _ in s.parameters)) for s in stretches)


def _theta_columns(terms: Terms, coordinates: Coordinates, beta: Floats, points: Floats) -> Floats:
    theta = _theta(coordinates.stretches)
    columns = np.empty((len(points), len(theta)))
    for c in range(len(theta)):
        step = STEP * np.eye(len(theta))[c]
        values = [
            terms.evaluate(
                replace(
                    coordinates, stretches=_with_theta(coordinates.stretches, theta + sign * step)
                ).forward(points),
                beta,
            )
            for sign in (1.0, -1.0)
        ]
        columns[:, c] = (values[0] - values[1]) / (2.0 * STEP)
    return columns


def _surface_at(
    space: Space,
    response: str,
    data: FitData,
    terms: Terms,
    coordinates: Coordinates,
    nested_press: float,
    plain_press: float,
) -> StretchedSurface:
    """Fit the terms for a given stretch, with the joint covariance."""
    conditional = fit_polynomial(space, response, data, terms, coordinates)
    theta = _theta(coordinates.stretches)
    beta = conditional.working_coefficients
    joint = np.hstack([conditional.matrix, _theta_columns(terms, coordinates, beta, data.points)])
    names = (*conditional.names, *(f"stretch {c + 1}" for c in range(len(theta))))
    try:
        fit = least_squares(joint, data.y, data.weights, names=names, has_constant=terms.has_constant)
    except FitError as error:
        raise FitError(f"response {response}: {error}") from None
    fit = replace(fit, coefficients=np.r_[conditional.fit.coefficients, theta], fitted=conditional.fit.fitted)
    return StretchedSurface(space, response, terms, coordinates, data, fit, nested_press, plain_press)
