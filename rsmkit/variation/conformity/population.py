"""A large sample that stands for a law: many points where specifications are in doubt, few elsewhere."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from rsmkit.language.joint_law import JointLaw
from rsmkit.language.space import Floats
from rsmkit.variation.conformity.conformance import Limits, excess

__all__ = ["Guess", "Population", "make_population"]

BULK = 1 << 12
"""Points that stand for the whole law."""
USUAL = 1 << 17
DEEP = 1 << 20
"""Points of which those in doubt are kept: usually, and where few are outside."""
RARE = 1e-2
"""Fractions outside for which the larger sample is taken."""
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
    thinned : bool
        Whether points in doubt were left out for their number.
    """

    points: Floats
    weights: Floats
    thinned: bool


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
    bulk = law.of_uniform(_numbers(qmc.Sobol(len(law), rng=np.random.default_rng([*seed, 1])), BULK))
    if not specifications:
        return Population(bulk, np.full(BULK, 1.0 / BULK), False)
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
    sequence = qmc.Sobol(len(law), rng=np.random.default_rng([*seed, 2]))
    kept = []
    for _ in range(0, size, PART):
        points = law.of_uniform(_numbers(sequence, PART))
        kept.append(points[doubtful(points)])
    tail = np.vstack(kept)
    calm = bulk[~doubtful(bulk)]
    share = len(tail) / size if len(calm) else 1.0
    thinned = len(tail) > MOST_DOUBTFUL
    if thinned:
        tail = tail[np.random.default_rng([*seed, 3]).choice(len(tail), MOST_DOUBTFUL, replace=False)]
    weights = np.r_[
        np.full(len(tail), share / max(len(tail), 1)), np.full(len(calm), (1.0 - share) / max(len(calm), 1))
    ]
    return Population(np.vstack([tail, calm]), weights / weights.sum(), thinned)


def _numbers(sequence: qmc.Sobol, count: int) -> Floats:
    return np.asarray(np.clip(sequence.random(count), 2.0**-33, 1.0 - 2.0**-33))
