"""Correlations of Gaussian processes: how alike the response is at two points.

Rasmussen & Williams, *Gaussian Processes for Machine Learning* (2006), chapter 4; sums over factors and pairs
of factors: Durrande, Ginsbourger and Roustant, *Additive covariance kernels for high-dimensional Gaussian
process modeling* (2012), and Duvenaud, Nickisch and Rasmussen, *Additive Gaussian processes* (2011).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist, pdist, squareform

from rsmkit.language.space import Floats

__all__ = ["Among", "Correlation", "Kernel", "Radial", "Separable", "squared_differences"]

Kernel = Literal["matern52", "rbf"]


def _matern52(squares: Floats) -> tuple[Floats, Floats]:
    r = np.sqrt(5.0 * squares)
    decay = np.exp(-r)
    return (1.0 + r + r * r / 3.0) * decay, -5.0 / 6.0 * (1.0 + r) * decay


def _rbf(squares: Floats) -> tuple[Floats, Floats]:
    value = np.exp(-0.5 * squares)
    return value, -0.5 * value


KERNELS: dict[Kernel, Callable[[Floats], tuple[Floats, Floats]]] = {"matern52": _matern52, "rbf": _rbf}
"""Correlation by the squared distance in correlation lengths, and its derivative by that square."""


class Among(Protocol):
    """Correlations of points with each other."""

    @property
    def values(self) -> Floats:
        """Symmetric, ones on the diagonal, shape (n, n)."""
        ...

    def slopes(self, pull: Floats) -> Floats:
        """Differentiate ``(pull * values).sum()`` by the logarithms of the lengths, then by other parameters.

        `pull` is symmetric.
        """
        ...


class Correlation(Protocol):
    """What :class:`rsmkit.surfaces.estimation.processes.kriging.Kriging` needs of one."""

    @property
    def lengths(self) -> Floats:
        """Correlation lengths, shape (m,)."""
        ...

    def among(self, points: Floats) -> Among:
        """Correlate points (n, m) with each other."""
        ...

    def between(self, a: Floats, b: Floats) -> Floats:
        """Correlate points (p, m) with points (n, m), shape (p, n)."""
        ...

    def gradient(self, a: Floats, b: Floats, weights: Floats) -> Floats:
        """Differentiate ``(weights * between(a, b)).sum(axis=1)`` by the coordinates of `a`, shape (p, m)."""
        ...


@dataclass(frozen=True, eq=False)
class Radial:
    """By the Euclidean distance, each column in units of its correlation length.

    Parameters
    ----------
    kernel : {"matern52", "rbf"}
        The law.
    lengths : array, shape (m,)
        Correlation lengths.
    """

    kernel: Kernel
    lengths: Floats

    def among(self, points: Floats) -> Among:
        """See :class:`Correlation`."""
        z = (points - points[0]) / self.lengths
        return _AmongRadial(z, *KERNELS[self.kernel](squareform(pdist(z, "sqeuclidean"))))

    def between(self, a: Floats, b: Floats) -> Floats:
        """See :class:`Correlation`."""
        return self._law(a, b)[0]

    def gradient(self, a: Floats, b: Floats, weights: Floats) -> Floats:
        """See :class:`Correlation`."""
        pull, origin = self._law(a, b)[1] * weights, b[0]
        apart = pull.sum(axis=1)[:, None] * (a - origin) - pull @ (b - origin)
        return np.asarray(2.0 * apart / self.lengths**2)

    def _law(self, a: Floats, b: Floats) -> tuple[Floats, Floats]:
        return KERNELS[self.kernel](cdist(a / self.lengths, b / self.lengths, "sqeuclidean"))


@dataclass(frozen=True, eq=False)
class _AmongRadial:
    scaled: Floats
    values: Floats
    by_square: Floats

    def slopes(self, pull: Floats) -> Floats:
        pull, z = pull * self.by_square, self.scaled
        # sum over pairs of pull_ij (z_i - z_j)^2, without the array of all differences
        spread = 2.0 * (pull.sum(axis=1) @ z**2 - np.einsum("ic,ic->c", z, pull @ z))
        return np.asarray(-2.0 * spread)


@dataclass(frozen=True, eq=False)
class Separable:
    """Product over the columns; or a mixture of it with the mean over columns and over pairs of columns.

    With the mixture a response that is a sum of functions of one or two factors is learnt from few runs.

    Parameters
    ----------
    kernel : {"matern52", "rbf"}
        The law of each column.
    lengths : array, shape (m,)
        Correlation lengths.
    categorical : array of bool, shape (m,)
        Columns whose values are only equal or not, with a distance of 0 or 1.
    parts : array, shape (0,), (1,) or (2,)
        Logits of the shares of the mean over columns and over pairs; that of the product is 0.
    differences : array, shape (m, n (n - 1) / 2), optional
        :func:`squared_differences` of the runs, to be found once for all lengths that are tried.
    """

    kernel: Kernel
    lengths: Floats
    categorical: NDArray[np.bool_]
    parts: Floats
    differences: Floats | None = None

    def among(self, points: Floats) -> Among:
        """See :class:`Correlation`."""
        apart = self.differences
        if apart is None:
            apart = squared_differences(points, self.categorical)
        return _AmongSeparable(self, apart / self.lengths[:, None] ** 2)

    def between(self, a: Floats, b: Floats) -> Floats:
        """See :class:`Correlation`."""
        return self.mixed(self._columns(a, b)[0])

    def gradient(self, a: Floats, b: Floats, weights: Floats) -> Floats:
        """See :class:`Correlation`; zero for categorical columns."""
        values, slopes = self._columns(a, b)
        found = np.zeros_like(a)
        for j, by_value in enumerate(self.by_column(values)):
            if not self.categorical[j]:
                pull = by_value * slopes[j] * weights
                apart = pull.sum(axis=1) * (a[:, j] - b[0, j]) - pull @ (b[:, j] - b[0, j])
                found[:, j] = 2.0 * apart / self.lengths[j] ** 2
        return found

    @cached_property
    def shares(self) -> Floats:
        """Of the product, the mean over columns, the mean over pairs; they sum to 1."""
        grown = np.exp(np.append(0.0, self.parts) - max(0.0, self.parts.max(initial=0.0)))
        return np.asarray(grown / grown.sum())

    def mixed(self, values: Floats) -> Floats:
        """Mix the columns' correlations, shape (m, ...)."""
        if not len(self.parts):
            return np.asarray(values.prod(axis=0))
        forms = _forms(values, len(self.parts))
        return np.asarray(sum(share * form for share, form in zip(self.shares, forms, strict=True)))

    def by_column(self, values: Floats) -> Floats:
        """Derivative of the mixture by the correlation of each column, shape (m, ...)."""
        m = len(values)
        found = self.shares[0] * _products_of_others(values)
        if len(self.parts):
            found += self.shares[1] / m
        if len(self.parts) > 1:
            found += self.shares[2] * 2.0 / (m * (m - 1)) * (values.sum(axis=0) - values)
        return np.asarray(found)

    def by_part(self, values: Floats, pull: Floats) -> Floats:
        """Derivatives of ``(pull * mixed).sum()`` by the logits."""
        if not len(self.parts):
            return self.parts
        sums = np.array([float((pull * form).sum()) for form in _forms(values, len(self.parts))])
        return np.asarray(self.shares[1:] * (sums[1:] - self.shares @ sums))

    def _columns(self, a: Floats, b: Floats) -> tuple[Floats, Floats]:
        """Correlation of each column and its derivative by the squared distance, each (m, p, n)."""
        apart = a.T[:, :, None] - b.T[:, None, :]
        apart[self.categorical] = apart[self.categorical] != 0.0
        apart /= self.lengths[:, None, None]
        return KERNELS[self.kernel](np.square(apart, out=apart))


def squared_differences(points: Floats, categorical: NDArray[np.bool_]) -> Floats:
    """Squared differences of all pairs of points (n, m) by column, shape (m, n (n - 1) / 2)."""
    found = np.array([pdist(column[:, None], "sqeuclidean") for column in points.T])
    found[categorical] = found[categorical] != 0.0
    return found


@dataclass(frozen=True, eq=False)
class _AmongSeparable:
    """Every pair of points once."""

    law: Separable
    squares: Floats

    @property
    def values(self) -> Floats:
        found = squareform(self.law.mixed(self._columns[0]))
        np.fill_diagonal(found, 1.0)
        return np.asarray(found)

    def slopes(self, pull: Floats) -> Floats:
        values, by_square = self._columns
        pairs = 2.0 * squareform(pull, checks=False)
        # the ones on the diagonal do not change with anything
        by_length = -2.0 * (self.law.by_column(values) * by_square * self.squares) @ pairs
        return np.append(by_length, self.law.by_part(values, pairs))

    @cached_property
    def _columns(self) -> tuple[Floats, Floats]:
        return KERNELS[self.law.kernel](self.squares)


def _forms(values: Floats, parts: int) -> list[Floats]:
    """Product, mean over columns and, of two parts, mean over pairs of the columns' correlations."""
    m, total = len(values), values.sum(axis=0)
    forms = [values.prod(axis=0), total / m]
    if parts > 1:
        forms.append((total**2 - (values**2).sum(axis=0)) / (m * (m - 1)))
    return forms


def _products_of_others(values: Floats) -> Floats:
    """Product over all columns but each, without dividing by what may be zero; shape of `values`."""
    found = np.ones_like(values)
    for j in range(1, len(values)):
        found[j] = found[j - 1] * values[j - 1]
    behind = np.ones_like(values[0])
    for j in range(len(values) - 1, -1, -1):
        found[j] *= behind
        behind = behind * values[j]
    return found
