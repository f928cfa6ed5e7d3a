"""A large sample that stands for a law: many points where specifications are in doubt, few elsewhere.

What fails is rare, so half of the sample is drawn from a normal law that is wide enough for its points to
lie as far out as rare failures do, and each point counts by the ratio of the densities (defensive importance
sampling; Hesterberg, *Technometrics* 37 (1995) 185).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri
from scipy.stats import qmc

from rsmkit.language.joint_law import JointLaw
from rsmkit.language.space import Floats
from rsmkit.variation.conformity.conformance import Limits, excess

__all__ = ["Guess", "Population", "make_population"]

BULK = 1 << 12
"""Points that stand for the whole law."""
USUAL = 1 << 17
DEEP = 1 << 18
"""Points of which those in doubt are kept: usually, and where few are outside."""
RARE = 1e-2
"""Fractions outside for which the larger sample is taken."""
FAR = 3.7
"""Standard deviations beyond which a normal number lies once in ten thousand."""
LEAST = 1e-9
"""What counts for less stands for no part of a law that any specification is about."""
MOST_DOUBTFUL = 20_000
PART = 1 << 15
REACH = 6.0
"""Standard deviations of a guess from a limit that count as doubt."""


@dataclass(frozen=True)
class Guess:
    """What is thought of a response before it is run.

    Parameters
    ----------
    value, sd : callable
        Points of everything that varies, (n, k), to the expected value and its standard deviation, (n,) each.
    """

    value: Callable[[Floats], Floats]
    sd: Callable[[Floats], Floats]


@dataclass(frozen=True, eq=False)
class Population:
    """Points that stand for a law.

    Parameters
    ----------
    points : array, shape (n, k)
        Natural units, all that varies.
    weights : array, shape (n,)
        Share of the law that each stands for; they sum to 1.
    variances : array, shape (n,)
        What each adds to the variance of a share that it is part of, for the points are a sample.
    drawn : int
        Number of the sample, or of what was chosen from it.
    thinned : bool
        Whether points in doubt were left out for their number.
    """

    points: Floats
    weights: Floats
    variances: Floats
    drawn: int
    thinned: bool

    def sampling_variance(self, chance: Floats) -> float:
        """Variance of the share for which points stand that are outside with these chances, shape (n,)."""
        return max(float(self.variances @ chance) - float(self.weights @ chance) ** 2 / self.drawn, 0.0)


def make_population(
    law: JointLaw, guesses: Mapping[str, Guess], specifications: Mapping[str, Limits], seed: list[int]
) -> Population:
    """Draw the points.

    Parameters
    ----------
    law : JointLaw
        Of everything that a run varies.
    guesses : mapping of str to Guess
        Of each response with a specification.
    specifications : mapping of str to limits
    seed : list of int
    """
    bulk = law.of_uniform(_numbers(_sequence(law, [*seed, 1]), BULK))
    if not specifications:
        return Population(bulk, np.full(BULK, 1.0 / BULK), np.full(BULK, 1.0 / BULK**2), BULK, False)
    first = {name: guess.value(bulk) for name, guess in guesses.items()}
    reach = {
        name: REACH * float(np.quantile(guess.sd(bulk), 0.99)) + 1e-9 * float(np.ptp(first[name]))
        for name, guess in guesses.items()
    }

    def doubtful(points: Floats) -> NDArray[np.bool_]:
        rows = [excess(guesses[name].value(points), s) > -reach[name] for name, s in specifications.items()]
        return np.asarray(np.any(rows, axis=0))

    outside = min(float(np.mean(excess(first[name], s) > 0)) for name, s in specifications.items())
    size = DEEP if outside < RARE else USUAL
    tail, weights = _in_doubt(law, doubtful, size, seed)
    calm = bulk[~doubtful(bulk)]
    variances, thinned = weights**2, len(tail) > MOST_DOUBTFUL
    if thinned:
        tail, weights, variances = _fewer(tail, weights, np.random.default_rng([*seed, 3]))
    each = max(1.0 - float(weights.sum()), 0.0) / max(len(calm), 1)
    weights = np.r_[weights, np.full(len(calm), each)]
    variances = np.r_[variances, np.full(len(calm), each**2)]
    drawn = MOST_DOUBTFUL if thinned else size
    return Population(np.vstack([tail, calm]), weights / weights.sum(), variances, drawn, thinned)


def _in_doubt(
    law: JointLaw, doubtful: Callable[[Floats], NDArray[np.bool_]], size: int, seed: list[int]
) -> tuple[Floats, Floats]:
    """Points in doubt of a sample of that size, and the share of the law that each stands for."""
    spread = math.sqrt(1.0 + FAR**2 / len(law))
    of_law, wide = _sequence(law, [*seed, 2]), _sequence(law, [*seed, 4])
    points, weights = [], []
    for _ in range(0, size, 2 * PART):
        for sequence, width in ((of_law, 1.0), (wide, spread)):
            z = width * np.asarray(ndtri(_numbers(sequence, PART)))
            weight = _ratio(z, spread) / size
            z, weight = z[weight * size > LEAST], weight[weight * size > LEAST]
            x = law.of_independent(z)
            kept = doubtful(x)
            points.append(x[kept])
            weights.append(weight[kept])
    return np.vstack(points), np.concatenate(weights)


def _ratio(z: Floats, spread: float) -> Floats:
    """Density of standard normal numbers, shape (n, m), over that of an even mixture with wider ones."""
    with np.errstate(over="ignore"):
        wide = np.exp(0.5 * (1.0 - spread**-2) * np.square(z).sum(axis=1)) / spread ** z.shape[1]
    return np.asarray(2.0 / (1.0 + wide))


def _fewer(points: Floats, weights: Floats, rng: np.random.Generator) -> tuple[Floats, Floats, Floats]:
    """Leave points out at random, those that stand for little more often; the rest, weights, variances."""
    chances = np.sqrt(weights)
    chances /= chances.sum()
    rows = rng.choice(len(points), MOST_DOUBTFUL, p=chances)
    grown = weights[rows] / chances[rows] / MOST_DOUBTFUL
    # one is of the choice, the other of the sample that was chosen from
    return points[rows], grown, grown**2 + grown * weights[rows]


def _sequence(law: JointLaw, seed: list[int]) -> qmc.Sobol:
    return qmc.Sobol(len(law), rng=np.random.default_rng(seed))


def _numbers(sequence: qmc.Sobol, count: int) -> Floats:
    return np.asarray(np.clip(sequence.random(count), 2.0**-33, 1.0 - 2.0**-33))
