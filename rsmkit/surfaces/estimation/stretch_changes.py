"""Derivatives of the maps of :mod:`rsmkit.surfaces.estimation.stretch` by their parameters.

Where a parameter changes nothing the textbook derivative is a difference of nearly equal numbers. These are
written as ratios whose departure from 1 is summed as a series, so that they are right to rounding for every
parameter.
"""

from __future__ import annotations

from math import factorial

import numpy as np
from scipy.special import betainc

from rsmkit.language.space import Floats

__all__ = [
    "beta_change",
    "exponential_change",
    "interior_changes",
    "kumaraswamy_changes",
    "roberts_change",
    "twosided_change",
]

NEAR = 0.5
"""Arguments nearer to zero than this are summed as series."""
COUNT = 10
"""Terms of a series: the first that is left out is below rounding."""
STEP = 0.02
"""Of the differences of an incomplete beta function in the logarithm of a shape."""
CENTRAL = (4 / 5, -1 / 5, 4 / 105, -1 / 280)
"""Central differences over one to four steps: an error of the eighth power of the step."""


def _series(x: Floats, top: list[float], bottom: list[float]) -> Floats:
    """Ratio of two series in x^2."""
    square = np.square(x)
    return np.asarray(np.polyval(top[::-1], square) / np.polyval(bottom[::-1], square))


ODD = [1 / factorial(2 * k + 1) for k in range(COUNT)]
EVEN = [1 / factorial(2 * k) for k in range(COUNT)]
ATANH = [1 / (2 * k + 1) for k in range(2 * COUNT)]


def _near(x: Floats, close: Floats, far: Floats) -> Floats:
    return np.where(np.abs(x) < NEAR, close, far)


def _coth(x: Floats) -> Floats:
    """``x coth x - 1``."""
    safe = np.where(np.abs(x) < NEAR, 1.0, x)
    close = _series(x, [e - o for e, o in zip(EVEN, ODD, strict=True)], ODD)
    return _near(x, close, safe / np.tanh(safe) - 1.0)


def _sinh(x: Floats) -> Floats:
    """``x / sinh x - 1``."""
    safe = np.where(np.abs(x) < NEAR, 1.0, x)
    return _near(x, _series(x, [0.0, *(-o for o in ODD[1:])], ODD), safe / np.sinh(safe) - 1.0)


def _atanh(x: Floats) -> Floats:
    """``x / ((1 - x^2) atanh x) - 1``; infinite at 1."""
    safe = np.where(np.abs(x) < NEAR, 0.5, x)
    with np.errstate(divide="ignore"):
        far = safe / ((1.0 - safe) * (1.0 + safe) * np.arctanh(safe)) - 1.0
    return _near(x, _series(x, [1.0 - a for a in ATANH], ATANH), far)


def exponential_change(u: Floats, s: Floats, a: float) -> Floats:
    """Of ``s = expm1(a u) / expm1(a)`` by a."""
    if a == 0:
        return np.asarray(0.5 * u * (u - 1.0))
    if abs(a) > 0.1:  # of a difference 1e-14 is lost, and searches ask for it most
        return np.asarray(u * (s + 1.0 / float(np.expm1(a))) - s * (1.0 + 1.0 / float(np.expm1(a))))
    return np.asarray(s * (0.5 * (u - 1.0) + (_coth(0.5 * a * u) - _coth(np.array(0.5 * a))) / a))


def twosided_change(u: Floats, s: Floats, d: float) -> Floats:
    """Of the tanh map (d > 0) or sinh map (d < 0) by d."""
    if d == 0:
        return np.zeros_like(u)
    x, end = d * (2.0 * u - 1.0), np.array(d)
    ratio = _sinh(x) - _sinh(end) if d > 0 else _coth(0.5 * x) - _coth(0.5 * end)
    return np.asarray((s - 0.5) * ratio / d)


def roberts_change(u: Floats, s: Floats, q: float) -> Floats:
    """Of ``s = 1 - atanh((1 - u) / b) / atanh(1 / b)``, b = 1 + e^-q, by q."""
    b = 1.0 + float(np.exp(-q))
    return np.asarray((1.0 - b) * (1.0 - s) * (_atanh((1.0 - u) / b) - _atanh(np.array(1.0 / b))) / b)


def interior_changes(u: Floats, s: Floats, r: float, centre: float) -> tuple[Floats, Floats]:
    """Of ``r s = B + asinh((u / centre - 1) sinh B)`` by r and by the centre."""
    rise, fall = float(np.expm1(r)), float(np.expm1(-r))
    up, down = 1.0 + rise * centre, 1.0 + fall * centre
    middle = 0.5 * float(np.log1p(rise * centre) - np.log1p(fall * centre))
    by_r = 0.5 * centre * ((1.0 + rise) / up + (1.0 + fall) / down)
    by_centre = 0.5 * (rise / up - fall / down)
    w, k = u / centre - 1.0, float(np.sinh(middle))
    root = np.sqrt(1.0 + np.square(w * k))
    follows = 1.0 + w * float(np.cosh(middle)) / root
    return (
        np.asarray((by_r * follows - s) / r),
        np.asarray((by_centre * follows - k * u / (centre**2 * root)) / r),
    )


def kumaraswamy_changes(u: Floats, a: float, b: float) -> tuple[Floats, Floats]:
    """Of ``s = 1 - (1 - u^a)^b`` by ln a and ln b."""
    ends = (u <= 0.0) | (u >= 1.0)
    log = np.log(np.where(ends, 0.5, u))
    rest = -np.expm1(a * log)
    by_a = a * b * log * (1.0 - rest) * rest ** (b - 1.0)
    by_b = -b * np.log(rest) * rest**b
    return np.where(ends, 0.0, by_a), np.where(ends, 0.0, by_b)


def beta_change(u: Floats, a: float, b: float, which: int) -> Floats:
    """Of a regularised incomplete beta function by the logarithm of a shape; it has no closed form."""

    def moved(step: float) -> Floats:
        shapes = [a, b]
        shapes[which] *= float(np.exp(step))
        return np.asarray(betainc(shapes[0], shapes[1], u))

    steps = [(k * STEP, weight / STEP) for k, weight in enumerate(CENTRAL, 1)]
    return np.asarray(sum(weight * (moved(step) - moved(-step)) for step, weight in steps))
