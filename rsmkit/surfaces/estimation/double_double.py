"""Arithmetic with about 32 digits: unevaluated sums of two doubles.

Only additions, multiplications and divisions of single elements are used, which IEEE 754 rounds in one way,
so that results are the same to the last bit on every processor and with every library of linear algebra.
(NumPy's ``longdouble`` is nothing but a double on some processors.) Algorithms: Dekker (1971), Numerische
Mathematik 18, 224-242; Joldes, Muller & Popescu (2017), ACM Trans. Math. Software 44(2), article 15.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rsmkit.language.space import Floats

__all__ = ["DoubleDouble", "double_double", "joined"]

SPLITTER = 2.0**27 + 1.0


@dataclass(frozen=True, eq=False)
class DoubleDouble:
    """An array of numbers ``high + low``, with ``high`` the nearest double to each.

    Parameters
    ----------
    high, low : array, of one shape
    """

    high: Floats
    low: Floats

    __array_ufunc__ = None  # an array on the left leaves the operation to this class

    def __getitem__(self, key: Any) -> DoubleDouble:
        return DoubleDouble(self.high[key], self.low[key])

    @property
    def T(self) -> DoubleDouble:
        """The transpose."""
        return DoubleDouble(self.high.T, self.low.T)

    def __neg__(self) -> DoubleDouble:
        return DoubleDouble(-self.high, -self.low)

    def __add__(self, other: DoubleDouble | ArrayLike) -> DoubleDouble:
        b = double_double(other)
        high, error = _two_sum(self.high, b.high)
        low, rest = _two_sum(self.low, b.low)
        high, error = _fast_two_sum(high, error + low)
        return DoubleDouble(*_fast_two_sum(high, error + rest))

    def __sub__(self, other: DoubleDouble | ArrayLike) -> DoubleDouble:
        return self + -double_double(other)

    def __mul__(self, other: DoubleDouble | ArrayLike) -> DoubleDouble:
        b = double_double(other)
        high, error = _two_product(self.high, b.high)
        return DoubleDouble(*_fast_two_sum(high, error + (self.high * b.low + self.low * b.high)))

    __rmul__ = __mul__

    def __truediv__(self, other: Floats) -> DoubleDouble:
        first = self.high / other
        rest = self - double_double(first) * other
        return DoubleDouble(*_fast_two_sum(first, rest.high / other))

    def power(self, exponent: int) -> DoubleDouble:
        """Multiply by itself, so many factors in all."""
        result = double_double(np.ones_like(self.high))
        for _ in range(exponent):
            result = result * self
        return result

    def total(self) -> DoubleDouble:
        """Sum over the first axis, in halves."""
        rest = self
        while len(rest.high) > 1:
            half = len(rest.high) // 2
            paired = rest[:half] + rest[half : 2 * half]
            rest = joined([paired, rest[2 * half :]])
        return rest[0]


def double_double(value: DoubleDouble | ArrayLike) -> DoubleDouble:
    """Numbers or doubles as double doubles."""
    if isinstance(value, DoubleDouble):
        return value
    high = np.asarray(value, float)
    return DoubleDouble(high, np.zeros_like(high))


def joined(parts: Sequence[DoubleDouble]) -> DoubleDouble:
    """Put arrays behind each other along the first axis."""
    return DoubleDouble(np.concatenate([x.high for x in parts]), np.concatenate([x.low for x in parts]))


def _two_sum(a: Floats, b: Floats) -> tuple[Floats, Floats]:
    """``a + b`` as the rounded sum and its error, exactly."""
    total = a + b
    part = total - a
    return total, (a - (total - part)) + (b - part)


def _fast_two_sum(a: Floats, b: Floats) -> tuple[Floats, Floats]:
    """Same for ``abs(a) >= abs(b)``."""
    total = a + b
    return total, b - (total - a)


def _two_product(a: Floats, b: Floats) -> tuple[Floats, Floats]:
    """``a * b`` as the rounded product and its error, exactly."""
    product = a * b
    (a1, a2), (b1, b2) = _split(a), _split(b)
    return product, ((a1 * b1 - product) + a1 * b2 + a2 * b1) + a2 * b2


def _split(a: Floats) -> tuple[Floats, Floats]:
    """Two parts of 26 bits each, whose products are exact."""
    scaled = SPLITTER * a
    high = scaled - (scaled - a)
    return high, a - high
