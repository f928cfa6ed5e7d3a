"""Sums and integrals that are the same to the last bit with every numerical library.

An adaptive flight shows a change of the last bit of its vehicle in the seventh digit of its integrals, and
NumPy's products of arrays, eigenvalues and elementary functions have another last bit on another processor.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache

import numpy as np
from numpy.typing import NDArray

__all__ = ["apply", "dot", "gauss_legendre"]

Floats = NDArray[np.float64]

_STEPS = 10


@cache
def gauss_legendre(points: int) -> tuple[Floats, Floats]:
    """Nodes and weights of Gauss-Legendre quadrature on (0, 1), by Newton's method on Legendre's recurrence.

    Abramowitz & Stegun, 22.7.10, 22.8.5 and 25.4.29.

    Parameters
    ----------
    points : int
        The rule is exact for polynomials of degree ``2 points - 1``.

    Returns
    -------
    nodes, weights : array, shape (points,)
        Nodes rise; not to be changed, they are kept for the next call.
    """
    nodes, weights = np.empty(points), np.empty(points)
    for i in range(points):
        x = -math.cos(math.pi * (i + 0.75) / (points + 0.5))
        for _ in range(_STEPS):
            value, slope = _legendre(points, x)
            x -= value / slope
        nodes[i] = 0.5 * (1.0 + x)
        weights[i] = 1.0 / ((1.0 - x * x) * _legendre(points, x)[1] ** 2)
    nodes.flags.writeable = weights.flags.writeable = False
    return nodes, weights


def dot(a: Floats, b: Floats) -> float:
    """Scalar product of two vectors."""
    return float((a * b).sum())


def apply(function: Callable[[float], float], values: Floats) -> Floats:
    """Apply a function of the ``math`` module to every number of a vector."""
    return np.array([function(value) for value in values.tolist()])


def _legendre(n: int, x: float) -> tuple[float, float]:
    """Legendre polynomial of degree n and its slope at x in (-1, 1)."""
    before, value = 1.0, x
    for k in range(2, n + 1):
        before, value = value, ((2 * k - 1) * x * value - (k - 1) * before) / k
    return value, n * (before - x * value) / (1.0 - x * x)
