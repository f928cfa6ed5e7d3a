"""Mean, variance and what each factor causes of it, of one response under given laws, with intervals."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from rsmkit.language.joint_law import JointLaw, normal_covariance
from rsmkit.language.space import Floats
from rsmkit.surfaces.posterior import DrawnPolynomials, Misses, Posterior
from rsmkit.variation.sensitivity.expansion import Expansion, expand_drawn
from rsmkit.variation.sensitivity.sampled_indices import sample_indices

__all__ = ["Decomposition", "Interval", "Quantity", "decompose"]

Interval = tuple[float, float]
Pair = tuple[int, int]
COARSER = 4
"""How many times fewer points drawn surfaces are asked at than the surface itself."""
STEP = 1e-3
"""Relative change of the width of a law for derivatives by it."""


@dataclass(frozen=True, eq=False)
class Quantity:
    """A number with what is not known about it.

    Parameters
    ----------
    value : float
        Of the surface itself.
    draws : array, shape (count,)
        Of drawn surfaces.
    error : float
        Standard error of sampling; 0 for a closed form.
    """

    value: float
    draws: Floats
    error: float = 0.0

    def interval(self, confidence: float, low: float = -np.inf, high: float = np.inf) -> Interval:
        """Interval that holds what the surface leaves open, the error of sampling, and the value itself."""
        tail = 0.5 * (1.0 - confidence)
        draws = self.draws[np.isfinite(self.draws)]
        if not len(draws):
            return low, high
        if self.error > 0.0:  # spread each draw by the quantiles of a normal law
            from scipy.special import ndtri

            steps = ndtri((np.arange(31) + 0.5) / 31)
            draws = (draws[:, None] + self.error * steps).ravel()
        ends = np.quantile(draws, [tail, 1.0 - tail])
        return (
            float(np.clip(min(ends[0], self.value), low, high)),
            float(np.clip(max(ends[1], self.value), low, high)),
        )

    def __truediv__(self, other: Quantity) -> Quantity:
        """A share; 0 of nothing. Errors of sampling are taken as those of the numerator."""
        with np.errstate(divide="ignore", invalid="ignore"):
            draws = np.where(other.draws > 0, np.clip(self.draws / other.draws, 0.0, None), 0.0)
        if not other.value > 0:
            return Quantity(0.0, draws)
        return Quantity(max(self.value, 0.0) / other.value, draws, self.error / other.value)


@dataclass(frozen=True, eq=False)
class Decomposition:
    """Mean and variance of a response, and the variance that factors cause.

    Parameters
    ----------
    names : tuple of str
        Factors that vary.
    mean, variance : Quantity
    first, total : tuple of Quantity
        Of each factor: variance that it causes alone, and that it has a part in.
    pairs : dict of pair of int to Quantity
        Variance that exactly two factors cause together; empty for correlated laws.
    widening : array, shape (m,)
        Derivative of the variance by the relative width of each law.
    exact : bool
        Whether all of it is in closed form.
    """

    names: tuple[str, ...]
    mean: Quantity
    variance: Quantity
    first: tuple[Quantity, ...]
    total: tuple[Quantity, ...]
    pairs: dict[tuple[int, int], Quantity]
    widening: Floats
    exact: bool


def decompose(posterior: Posterior, law: JointLaw, *, samples: int, seed: int) -> Decomposition:
    """Find what each factor causes: exact for polynomials under independent laws, else sampled.

    Parameters
    ----------
    posterior : Posterior
        The response.
    law : JointLaw
    samples : int
        Points of a sample, where one is needed.
    seed : int
    """
    if posterior.polynomials is not None and law.independent:
        return _exact(posterior, posterior.polynomials, law)
    return _sampled(posterior, law, samples, seed)


def _exact(posterior: Posterior, polynomials: DrawnPolynomials, law: JointLaw) -> Decomposition:
    own, drawn = expand_drawn(polynomials, law)
    count, means = len(law), drawn.mean
    if posterior.misses is not None:
        means, drawn = (
            means + posterior.misses.values(_centre(law))[:, 0],
            _tilted(drawn, posterior.misses, law),
        )

    def quantity(value: Floats, draws: Floats) -> Quantity:
        return _unbiased(Quantity(float(value[0]), draws))

    nothing = np.zeros(np.shape(drawn.variance))
    drawn_pairs = drawn.pairs

    return Decomposition(
        law.names,
        Quantity(float(own.mean[0]), means),
        quantity(own.variance, drawn.variance),
        tuple(quantity(own.first[j], drawn.first[j]) for j in range(count)),
        tuple(quantity(own.total[j], drawn.total[j]) for j in range(count)),
        {pair: quantity(part, drawn_pairs.get(pair, nothing)) for pair, part in own.pairs.items()},
        2.0 * own.stretching[:, 0],
        exact=True,
    )


def _centre(law: JointLaw) -> Floats:
    centre = law.point.copy()
    centre[law.columns] = [item.mean for item in law.laws.values()]
    return centre[None]


def _tilted(drawn: Expansion, misses: Misses, law: JointLaw) -> Expansion:
    """Add the slopes of what the surfaces miss, on average over each law, to their linear parts."""
    coefficients, slopes = drawn.coefficients.copy(), misses.slopes(_centre(law)[0])
    place = {index: row for row, index in enumerate(drawn.indices)}
    for j, (column, own) in enumerate(zip(law.columns, law.laws.values(), strict=True)):
        row = place.get(((j, 1),))
        if row is not None and law.space.numeric[column]:
            wide = misses.frequencies[:, column] * own.sd
            coefficients[row] += slopes[:, column] * own.sd * np.exp(-0.5 * wide**2)
    return replace(drawn, coefficients=coefficients)


def _unbiased(found: Quantity) -> Quantity:
    """Variances of estimates are too large by the variance of their errors, those of draws by twice that."""
    excess = float(np.mean(found.draws)) - found.value
    return replace(found, draws=np.maximum(found.draws - 2.0 * max(excess, 0.0), 0.0))


def _sampled(posterior: Posterior, law: JointLaw, samples: int, seed: int) -> Decomposition:
    def both(points: Floats) -> Floats:
        return np.vstack([posterior.predict(points), posterior.draw(points)])

    paired = law.independent
    indices = sample_indices(posterior.predict, law, samples, seed, pairs=paired)
    coarse = sample_indices(both, law, max(samples // COARSER, 1), seed + 1, pairs=paired)
    linear = posterior.polynomials is not None

    def quantity(key: str, j: int | Pair | None = None, *, variance: bool = True) -> Quantity:
        pick = () if j is None else j
        value, error = indices.mean_of(key)[pick], indices.error_of(key)[pick]
        row = coarse.mean_of(key)[pick]
        # the same points for all: what they miss of the surface itself they miss of the drawn ones
        found = Quantity(float(value), float(value) + row[1:] - row[0], float(error))
        return _unbiased(found) if variance and linear else found

    mean, spread = quantity("mean", variance=False), quantity("variance")
    exact = _normal_moments(posterior.polynomials, law)
    if exact is not None:
        mean, spread = replace(mean, value=exact[0], error=0.0), replace(spread, value=exact[1], error=0.0)
    return Decomposition(
        law.names,
        mean,
        spread,
        tuple(quantity("first", j) for j in range(len(law))),
        tuple(quantity("total", j) for j in range(len(law))),
        {pair: quantity("pairs", pair) for pair in combinations(range(len(law)), 2)} if paired else {},
        _widening(posterior.predict, law, samples, seed),
        exact=False,
    )


def _widening(predict: Callable[[Floats], Floats], law: JointLaw, samples: int, seed: int) -> Floats:
    """Twice the covariance of the response and ``(x - mean) dy/dx``."""
    from rsmkit.variation.sensitivity.sampled_indices import law_points

    points = law.of_uniform(law_points(law, samples, seed + 1)[0])
    values = predict(points)
    found = np.zeros(len(law))
    for j, (column, own) in enumerate(zip(law.columns, law.laws.values(), strict=True)):
        away = points[:, column] - own.mean
        ends = []
        for step in (STEP, -STEP):
            moved = points.copy()
            moved[:, column] = points[:, column] + step * away
            ends.append(predict(moved))
        slopes = (ends[0] - ends[1]) / (2.0 * STEP)
        found[j] = 2.0 * np.mean((values - values.mean()) * (slopes - slopes.mean()))
    return found


def _normal_moments(polynomials: DrawnPolynomials | None, law: JointLaw) -> tuple[float, float] | None:
    """Mean and variance of a polynomial of second order in correlated normal factors, in closed form.

    With gradient g and Hessian H at the mean and covariance S: ``f + tr(H S)/2`` and
    ``g' S g + tr(H S H S)/2``.
    """
    covariance = normal_covariance(law)
    if polynomials is None or covariance is None or polynomials.terms.order > 2:
        return None
    if any(stretch.family != "identity" for stretch in polynomials.coordinates.stretches):
        return None
    centre = law.of_normal(np.zeros((1, len(law))))
    z = polynomials.coordinates.forward(centre)
    scale = polynomials.coordinates.slopes(centre)[0, law.columns]
    terms, beta = polynomials.terms, polynomials.coefficients
    gradient = terms.slopes(z, beta)[0, law.columns] * scale
    hessian = terms.hessian(z[0], beta)[np.ix_(law.columns, law.columns)] * np.outer(scale, scale)
    curved = hessian @ covariance
    mean = float(terms.evaluate(z, beta)[0]) + 0.5 * float(np.trace(curved))
    return mean, float(gradient @ covariance @ gradient) + 0.5 * float(np.trace(curved @ curved))
