"""Monotone stretching of one factor: families of maps of [0, 1] onto itself.

A response that is steep at one end of a factor's range becomes nearly quadratic once that end is stretched.
The paper names the technique but does not print its function; these families are this project's own choice,
from grid generation (Eriksson; Roberts; Vinokur), regression (Box & Tidwell 1962) and input warping of
Gaussian processes (Snoek et al. 2014). Every map has s(0) = 0 and s(1) = 1 and goes on linearly outside.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import betainc, betaincinv, betaln

from rsmkit.errors import RsmkitError
from rsmkit.language.expression import parse_expression
from rsmkit.language.space import Floats
from rsmkit.surfaces.estimation.stretch_changes import (
    beta_change,
    exponential_change,
    interior_changes,
    kumaraswamy_changes,
    roberts_change,
    twosided_change,
)

__all__ = ["FAMILIES", "Family", "Stretch", "free_parameters", "theta_of", "with_theta"]

Map = Callable[[Floats, "Stretch"], Floats]

SMALL = 1e-5
"""Parameters closer than this to the identity use the first Taylor terms."""
STEP = 1e-5
"""Difference in a parameter for the change of a slope at an end: central, so that 1e-10 of it is lost."""
STEEPEST = 1e3
"""Slopes of the straight continuation outside [0, 1] stay between this and its inverse."""


@dataclass(frozen=True)
class Family:
    """One family of maps.

    Parameters
    ----------
    parameters : tuple of str
        Names.
    identity, low, high, scale : tuple of float
        Per parameter: value that changes nothing, bounds, and size of a typical departure (the penalty's
        unit).
    forward, inverse, slope : callable
        Of (values in [0, 1], the Stretch).
    changes : tuple of callable
        Derivatives of `forward` by the parameters, of the same.
    """

    parameters: tuple[str, ...]
    identity: tuple[float, ...]
    low: tuple[float, ...]
    high: tuple[float, ...]
    scale: tuple[float, ...]
    forward: Map
    inverse: Map
    slope: Map
    changes: tuple[Map, ...] = ()


@dataclass(frozen=True)
class Stretch:
    """A member of a family, for a factor whose runs reach from `low` to `high`.

    Parameters
    ----------
    family : str
        A key of :data:`FAMILIES`.
    parameters : tuple of float
    low, high : float
        Natural units; ``natpower`` and ``fixed`` depend on them.
    expression : str
        For ``fixed``: the map as a formula of ``x`` (natural units), increasing or decreasing.
    """

    family: str
    parameters: tuple[float, ...]
    low: float
    high: float
    expression: str = ""

    def __post_init__(self) -> None:
        if self.family not in FAMILIES:
            raise RsmkitError(f"no stretch family '{self.family}'; there are {', '.join(FAMILIES)}")
        wanted = FAMILIES[self.family].parameters
        if len(self.parameters) != len(wanted) or not np.isfinite(self.parameters).all():
            raise RsmkitError(f"stretch family {self.family} needs {len(wanted)} finite parameters")
        if not self.low < self.high:
            raise RsmkitError(f"a stretch needs low < high, got {self.low:g} and {self.high:g}")
        if self.family == "natpower" and self.low <= 0:
            raise RsmkitError("stretch family natpower needs positive factor values; use power")
        if self.family == "fixed":
            self._check_expression()

    def forward(self, u: Floats) -> Floats:
        """Map u to s, any shape."""
        inside = np.clip(u, 0.0, 1.0)
        s = FAMILIES[self.family].forward(inside, self)
        return s + self._end_slope(u) * (u - inside) if (inside != u).any() else s

    def inside(self, u: Floats) -> Floats:
        """Map u to s where no u is outside [0, 1], which saves a search the asking."""
        return FAMILIES[self.family].forward(u, self)

    def moved(self, parameters: tuple[float, ...]) -> Stretch:
        """Another member of the family; only its parameters are new, and must be as many and finite."""
        other = object.__new__(Stretch)  # a search takes thousands: nothing else needs to be checked again
        other.__dict__.update(self.__dict__, parameters=parameters)
        return other

    def change(self, parameter: int, u: Floats) -> Floats:
        """Derivative of s by a parameter where no u is outside [0, 1]."""
        return FAMILIES[self.family].changes[parameter](u, self)

    def change_anywhere(self, parameter: int, u: Floats) -> Floats:
        """The same for any u."""
        inside = np.clip(u, 0.0, 1.0)
        low, high = self.end_changes(parameter)
        return np.asarray(self.change(parameter, inside) + np.where(u < 0.5, low, high) * (u - inside))

    def end_changes(self, parameter: int) -> Floats:
        """Derivatives of the two slopes of the straight continuation by a parameter, shape (2,)."""
        ends = []
        for sign in (1.0, -1.0):
            values = list(self.parameters)
            values[parameter] += sign * STEP
            ends.append(self.moved(tuple(values))._end_slope(np.array([0.0, 1.0])))
        return np.asarray((ends[0] - ends[1]) / (2.0 * STEP))

    def inverse(self, s: Floats) -> Floats:
        """Map s to u."""
        inside = np.clip(s, 0.0, 1.0)
        u = FAMILIES[self.family].inverse(inside, self)
        return u + (s - inside) / self._end_slope(s) if (inside != s).any() else u

    def slope(self, u: Floats) -> Floats:
        """Derivative ds/du."""
        inside = np.clip(u, 0.0, 1.0)
        with np.errstate(divide="ignore"):
            slope = FAMILIES[self.family].slope(inside, self)
        return np.asarray(np.where(inside == u, slope, self._end_slope(u)), float)

    def _end_slope(self, at: Floats) -> Floats:
        with np.errstate(divide="ignore"):
            ends = FAMILIES[self.family].slope(np.array([0.0, 1.0]), self)
        ends = np.clip(ends, 1.0 / STEEPEST, STEEPEST)
        return np.asarray(np.where(at < 0.5, ends[0], ends[1]), float)

    def _check_expression(self) -> None:
        values = _formula(np.linspace(0.0, 1.0, 257), self)
        steps = np.diff(values)
        if not np.isfinite(values).all() or not ((steps > 0).all() or (steps < 0).all()):
            raise RsmkitError(
                f"stretch '{self.expression}' must rise or fall all the way from x = {self.low:g} "
                f"to {self.high:g}"
            )


def free_parameters(stretches: Sequence[Stretch]) -> tuple[tuple[int, int], ...]:
    """Index of the factor and of the parameter of every fitted stretch parameter."""
    return tuple((j, i) for j, s in enumerate(stretches) for i in range(len(s.parameters)))


def theta_of(stretches: Sequence[Stretch]) -> Floats:
    """All stretch parameters as one vector, shape (q,)."""
    return np.array([value for s in stretches for value in s.parameters])


def with_theta(stretches: Sequence[Stretch], theta: Floats) -> tuple[Stretch, ...]:
    """Put a vector of parameters in place."""
    values = iter(theta.tolist())
    if not np.isfinite(theta).all():
        raise RsmkitError("stretch parameters must be finite")
    return tuple(s.moved(tuple(next(values) for _ in s.parameters)) if s.parameters else s for s in stretches)


def _linear(u: Floats, _: Stretch) -> Floats:
    return u


def _ones(u: Floats, _: Stretch) -> Floats:
    return np.ones_like(u)


# exp (Eriksson): s = (e^(a u) - 1) / (e^a - 1)


def _exp(u: Floats, stretch: Stretch) -> Floats:
    return _exponential(u, stretch.parameters[0])


def _exponential(u: Floats, a: float) -> Floats:
    if abs(a) < SMALL:
        return u + 0.5 * a * u * (u - 1.0)
    return np.asarray(np.expm1(a * u) / np.expm1(a))


def _logarithmic(s: Floats, a: float) -> Floats:
    """Inverse of :func:`_exponential`."""
    if abs(a) < SMALL:
        return s - 0.5 * a * s * (s - 1.0)
    return np.asarray(np.log1p(s * np.expm1(a)) / a)


def _exp_inverse(s: Floats, stretch: Stretch) -> Floats:
    return _logarithmic(s, stretch.parameters[0])


def _exp_slope(u: Floats, stretch: Stretch) -> Floats:
    return _exponential_slope(u, stretch.parameters[0])


def _exponential_slope(u: Floats, a: float) -> Floats:
    if abs(a) < SMALL:
        return 1.0 + a * (u - 0.5)
    return np.asarray(a * np.exp(a * u) / np.expm1(a))


def _exp_change(u: Floats, stretch: Stretch) -> Floats:
    return exponential_change(u, _exp(u, stretch), stretch.parameters[0])


# power (Box-Tidwell): s proportional to (u + c)^p, c = 1/2, or the natural origin: an exponential map of the
# logarithmic coordinate w = ln((u + c)/c) / ln((1 + c)/c) with a = p ln((1 + c)/c)


def _origin(stretch: Stretch) -> tuple[float, float]:
    c = 0.5 if stretch.family == "power" else stretch.low / (stretch.high - stretch.low)
    return c, float(np.log1p(1.0 / c))


def _power(u: Floats, stretch: Stretch) -> Floats:
    c, reach = _origin(stretch)
    return _exponential(np.log1p(u / c) / reach, stretch.parameters[0] * reach)


def _power_inverse(s: Floats, stretch: Stretch) -> Floats:
    c, reach = _origin(stretch)
    return np.asarray(c * np.expm1(reach * _logarithmic(s, stretch.parameters[0] * reach)))


def _power_slope(u: Floats, stretch: Stretch) -> Floats:
    c, reach = _origin(stretch)
    inner = _exponential_slope(np.log1p(u / c) / reach, stretch.parameters[0] * reach)
    return np.asarray(inner / ((u + c) * reach))


def _power_change(u: Floats, stretch: Stretch) -> Floats:
    c, reach = _origin(stretch)
    inner = exponential_change(np.log1p(u / c) / reach, _power(u, stretch), stretch.parameters[0] * reach)
    return np.asarray(reach * inner)


# twosided (Vinokur): tanh refines both ends, its inverse branch sinh the middle


def _twosided(u: Floats, stretch: Stretch) -> Floats:
    d = stretch.parameters[0]
    if abs(d) < 1e-4:
        return _twosided_series(u, d)
    if d > 0:
        return np.asarray(0.5 * (1.0 + np.tanh(d * (u - 0.5)) / np.tanh(0.5 * d)))
    return np.asarray(0.5 * (1.0 + np.sinh(-d * (u - 0.5)) / np.sinh(-0.5 * d)))


def _twosided_series(u: Floats, d: float) -> Floats:
    """To second order in d: tanh and sinh differ from their argument by -x^3/3 and x^3/6."""
    v = u - 0.5
    return u + (-1.0 / 3.0 if d > 0 else 1.0 / 6.0) * d * d * v * (v * v - 0.25)


def _twosided_inverse(s: Floats, stretch: Stretch) -> Floats:
    d = stretch.parameters[0]
    if abs(d) < 1e-4:
        return 2.0 * s - _twosided_series(s, d)
    if d > 0:
        return np.asarray(0.5 + np.arctanh(np.clip((2.0 * s - 1.0) * np.tanh(0.5 * d), -1, 1)) / d)
    return np.asarray(0.5 - np.arcsinh((2.0 * s - 1.0) * np.sinh(-0.5 * d)) / d)


def _twosided_slope(u: Floats, stretch: Stretch) -> Floats:
    d = stretch.parameters[0]
    if abs(d) < 1e-4:
        return 1.0 + (-1.0 / 3.0 if d > 0 else 1.0 / 6.0) * d * d * (3.0 * (u - 0.5) ** 2 - 0.25)
    if d > 0:
        return np.asarray(0.5 * d / np.cosh(d * (u - 0.5)) ** 2 / np.tanh(0.5 * d))
    return np.asarray(0.5 * -d * np.cosh(d * (u - 0.5)) / np.sinh(-0.5 * d))


def _twosided_change(u: Floats, stretch: Stretch) -> Floats:
    return twosided_change(u, _twosided(u, stretch), stretch.parameters[0])


# roberts: clusters at u = 1; b = 1 + e^-q


def _roberts(u: Floats, stretch: Stretch) -> Floats:
    b = 1.0 + np.exp(-stretch.parameters[0])
    return np.asarray(1.0 - np.log((b + 1.0 - u) / (b - 1.0 + u)) / np.log((b + 1.0) / (b - 1.0)))


def _roberts_inverse(s: Floats, stretch: Stretch) -> Floats:
    b = 1.0 + np.exp(-stretch.parameters[0])
    r = ((b + 1.0) / (b - 1.0)) ** (1.0 - s)
    return np.asarray(((b + 1.0) - (b - 1.0) * r) / (r + 1.0))


def _roberts_slope(u: Floats, stretch: Stretch) -> Floats:
    b = 1.0 + np.exp(-stretch.parameters[0])
    return np.asarray(2.0 * b / ((b * b - (1.0 - u) ** 2) * np.log((b + 1.0) / (b - 1.0))))


def _roberts_change(u: Floats, stretch: Stretch) -> Floats:
    return roberts_change(u, _roberts(u, stretch), stretch.parameters[0])


# roberts_interior: clusters around u = uc


def _interior(stretch: Stretch) -> tuple[float, float, float, float]:
    r, uc = stretch.parameters
    b = 0.5 * float(np.log1p(np.expm1(r) * uc) - np.log1p(np.expm1(-r) * uc)) / r
    return r, uc, b, float(np.sinh(r * b))


def _roberts_interior(u: Floats, stretch: Stretch) -> Floats:
    r, uc, b, k = _interior(stretch)
    return np.asarray(b + np.arcsinh((u / uc - 1.0) * k) / r)


def _roberts_interior_inverse(s: Floats, stretch: Stretch) -> Floats:
    r, uc, b, k = _interior(stretch)
    return np.asarray(uc * (1.0 + np.sinh(r * (s - b)) / k))


def _roberts_interior_slope(u: Floats, stretch: Stretch) -> Floats:
    r, uc, _, k = _interior(stretch)
    return np.asarray(k / (r * uc * np.sqrt(1.0 + ((u / uc - 1.0) * k) ** 2)))


def _interior_change(which: int) -> Map:
    return lambda u, stretch: interior_changes(u, _roberts_interior(u, stretch), *stretch.parameters)[which]


# kumaraswamy and beta: cumulative distributions with shape parameters A = e^ln A, B = e^ln B


def _shapes(stretch: Stretch) -> tuple[float, float]:
    return float(np.exp(stretch.parameters[0])), float(np.exp(stretch.parameters[1]))


def _kumaraswamy(u: Floats, stretch: Stretch) -> Floats:
    a, b = _shapes(stretch)
    with np.errstate(divide="ignore"):
        return np.asarray(-np.expm1(b * np.log1p(-(u**a))))


def _kumaraswamy_inverse(s: Floats, stretch: Stretch) -> Floats:
    a, b = _shapes(stretch)
    with np.errstate(divide="ignore"):
        return np.asarray((-np.expm1(np.log1p(-s) / b)) ** (1.0 / a))


def _kumaraswamy_slope(u: Floats, stretch: Stretch) -> Floats:
    a, b = _shapes(stretch)
    return np.asarray(a * b * u ** (a - 1.0) * (1.0 - u**a) ** (b - 1.0))


def _kumaraswamy_change(which: int) -> Map:
    return lambda u, stretch: kumaraswamy_changes(u, *_shapes(stretch))[which]


def _beta(u: Floats, stretch: Stretch) -> Floats:
    return np.asarray(betainc(*_shapes(stretch), u))


def _beta_inverse(s: Floats, stretch: Stretch) -> Floats:
    return np.asarray(betaincinv(*_shapes(stretch), s))


def _beta_slope(u: Floats, stretch: Stretch) -> Floats:
    a, b = _shapes(stretch)
    return np.asarray(u ** (a - 1.0) * (1.0 - u) ** (b - 1.0) * np.exp(-betaln(a, b)))


def _beta_change(which: int) -> Map:
    return lambda u, stretch: beta_change(u, *_shapes(stretch), which)


# fixed: the user's formula, brought to [0, 1]


def _formula(u: Floats, stretch: Stretch) -> Floats:
    expression = parse_expression(stretch.expression, ["x"])
    return np.broadcast_to(expression({"x": stretch.low + u * (stretch.high - stretch.low)}), np.shape(u))


def _fixed(u: Floats, stretch: Stretch) -> Floats:
    first, last = _formula(np.array([0.0, 1.0]), stretch)
    return np.asarray((_formula(u, stretch) - first) / (last - first))


def _fixed_inverse(s: Floats, stretch: Stretch) -> Floats:
    """Bisection on all values at once, to the last bit."""
    low, high = np.zeros_like(s), np.ones_like(s)
    for _ in range(60):
        middle = 0.5 * (low + high)
        below = _fixed(middle, stretch) < s
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return 0.5 * (low + high)


def _fixed_slope(u: Floats, stretch: Stretch) -> Floats:
    left, right = np.maximum(u - 1e-6, 0.0), np.minimum(u + 1e-6, 1.0)
    return np.asarray((_fixed(right, stretch) - _fixed(left, stretch)) / (right - left))


FAMILIES: dict[str, Family] = {
    "identity": Family((), (), (), (), (), _linear, _linear, _ones),
    "exp": Family(
        ("a",), (0.0,), (-8.0,), (8.0,), (2.0,),
        _exp, _exp_inverse, _exp_slope, (_exp_change,),
    ),
    "power": Family(
        ("p",), (1.0,), (-6.0,), (8.0,), (2.0,),
        _power, _power_inverse, _power_slope, (_power_change,),
    ),
    "natpower": Family(
        ("p",), (1.0,), (-6.0,), (8.0,), (2.0,),
        _power, _power_inverse, _power_slope, (_power_change,),
    ),
    "twosided": Family(
        ("d",), (0.0,), (-8.0,), (8.0,), (2.0,),
        _twosided, _twosided_inverse, _twosided_slope, (_twosided_change,),
    ),
    "roberts": Family(
        ("q",), (-6.0,), (-6.0,), (6.0,), (4.0,),
        _roberts, _roberts_inverse, _roberts_slope, (_roberts_change,),
    ),
    "roberts_interior": Family(
        ("r", "uc"), (1e-3, 0.5), (1e-3, 0.05), (8.0, 0.95), (2.0, 0.5),
        _roberts_interior, _roberts_interior_inverse, _roberts_interior_slope,
        (_interior_change(0), _interior_change(1)),
    ),
    "kumaraswamy": Family(
        ("ln A", "ln B"), (0.0, 0.0), (-1.6, -1.6), (1.6, 1.6), (0.75, 0.75),
        _kumaraswamy, _kumaraswamy_inverse, _kumaraswamy_slope,
        (_kumaraswamy_change(0), _kumaraswamy_change(1)),
    ),
    "beta": Family(
        ("ln A", "ln B"), (0.0, 0.0), (-1.6, -1.6), (1.6, 1.6), (0.75, 0.75), _beta, _beta_inverse,
        _beta_slope, (_beta_change(0), _beta_change(1)),
    ),
    "fixed": Family((), (), (), (), (), _fixed, _fixed_inverse, _fixed_slope),
}  # fmt: skip
