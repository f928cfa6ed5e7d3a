"""Runs of the simulator under the laws: what the surfaces promise of service against what is true.

Half of the runs are drawn from the laws, half where it is in doubt whether a specification is kept, and each
counts by the inverse of its probability: estimates are unbiased whatever the surfaces are worth. Surfaces are
the control variate: only what they miss is estimated from runs. Every wave of runs sharpens where doubt is (a
process of what the surfaces miss), and its own estimate uses only what was known before it, so that the waves
may be averaged (adaptive importance sampling; Owen, *Monte Carlo theory, methods and examples*, chapter 10).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy.special import ndtr, stdtrit

from rsmkit.language.joint_law import JointLaw
from rsmkit.language.space import Floats
from rsmkit.surfaces.estimation.processes.kriging import Kriging
from rsmkit.surfaces.estimation.processes.likelihood import fit_kriging
from rsmkit.surfaces.posterior import Posterior
from rsmkit.variation.conformity.conformance import ALL, Limits, excess
from rsmkit.variation.conformity.population import Guess, Population, make_population

__all__ = ["Estimate", "Proof", "ResponseProof", "Trial", "prove"]

WAVE = 20
"""Runs of a wave, however many there will be, so that a longer proof goes on where a shorter one ended."""
ANEW = (2, 5)
"""Waves before which the points in doubt are chosen anew, where they were too many."""
DEFENSIVE = 0.5
"""Part of every wave that is drawn from the laws themselves: no run counts for more than its inverse."""
DOUBTED = 2.0
"""By which standard deviations of what the surfaces miss are multiplied where runs are placed."""
RULED_OUT = 0.025
"""Chance of plain runs without a failure that rules a failure rate out."""
FEWEST = 8
"""Runs from which a process of what the surfaces miss is fitted."""
QUANTILES = (0.01, 0.05, 0.25, 0.5, 0.75, 0.95, 0.99)

Fly = Callable[[Floats], Mapping[str, Floats]]
"""True responses at points of everything that varies, shape (n, k); nan where a run fails."""


@dataclass(frozen=True)
class Estimate:
    """A number from runs.

    Parameters
    ----------
    value, low, high : float
        With its interval.
    error : float
        Standard error.
    gain : float
        How many times more runs drawn from the laws alone would be needed for the same error.
    """

    value: float
    low: float
    high: float
    error: float
    gain: float


@dataclass(frozen=True)
class ResponseProof:
    """What runs say of one response."""

    mean: Estimate
    sd: Estimate
    quantiles: dict[str, float]
    outside: Estimate | None


@dataclass(frozen=True)
class Proof:
    """What runs say of service.

    Parameters
    ----------
    responses : dict of str to ResponseProof
    outside : Estimate, optional
        Any specification that is not kept.
    runs, failed : int
    """

    responses: dict[str, ResponseProof]
    outside: Estimate | None
    runs: int
    failed: int


@dataclass(frozen=True, eq=False)
class Trial:
    """What is to be proven.

    Parameters
    ----------
    law : JointLaw
        Of everything that a run varies.
    posteriors : mapping of str to Posterior
        By response, on the columns `known` of the law's space.
    known : list of int
    controls : mapping of str to pair of float
        Mean and variance of each response's surface under the law.
    specifications : mapping of str to limits
    runs : int
        How many runs of the simulator.
    confidence : float
    seed : int
    """

    law: JointLaw
    posteriors: Mapping[str, Posterior]
    known: list[int]
    controls: Mapping[str, tuple[float, float]]
    specifications: Mapping[str, Limits]
    runs: int
    confidence: float = 0.95
    seed: int = 1


@dataclass
class _Waves:
    """Runs so far: points, what they count for, responses; and what each wave says of each specification."""

    points: Floats
    counts: Floats
    values: dict[str, Floats]
    estimates: dict[str, list[_Told]] = field(default_factory=dict)
    processes: dict[str, Kriging] = field(default_factory=dict)
    asked: int = 0


@dataclass(frozen=True)
class _Told:
    """What one wave says of a fraction outside.

    Parameters
    ----------
    value : float
    ahead, seen : float
        Variance of what its runs add: as it was expected, and as it is taken now.
    population : int
        Number of the wave from which its population is.
    sampled : float
        Variance of that population, which all waves from it share.
    """

    value: float
    ahead: float
    seen: float
    population: int
    sampled: float


def prove(trial: Trial, fly: Fly, *, on_wave: Callable[[int], None] | None = None) -> Proof:
    """Run the simulator under the laws, wave by wave.

    The same trial asks for the same points, wave by wave; with more runs the first ones stay.
    """
    width = len(trial.law.space)
    waves = _Waves(np.empty((0, width)), np.empty(0), {name: np.empty(0) for name in trial.posteriors})
    people, since = _people(trial, waves, 0), 0
    for number, start in enumerate(range(0, trial.runs, WAVE)):
        if people.thinned and number in ANEW:
            people, since = _people(trial, waves, number), number
        _one_wave(trial, people, since, waves, number, min(WAVE, trial.runs - start), fly)
        if on_wave:
            on_wave(waves.asked)
    return _proof(trial, waves)


def _people(trial: Trial, waves: _Waves, number: int) -> Population:
    guesses = {name: _guess(trial, waves, name) for name in trial.specifications}
    return make_population(trial.law, guesses, trial.specifications, [trial.seed, number])


def _one_wave(
    trial: Trial, people: Population, since: int, waves: _Waves, number: int, size: int, fly: Fly
) -> None:
    expected, chances = _expected(trial, people, waves), people.weights
    doubts = [people.weights * np.sqrt(doubt * (1.0 - doubt)) for _, doubt in expected.values()]
    doubts = [item / item.sum() for item in doubts if item.sum() > 0]
    if doubts:
        chances = DEFENSIVE * people.weights + (1.0 - DEFENSIVE) * np.mean(doubts, axis=0)
    # the numbers of a whole wave are drawn, so that a shorter last one is the beginning of a whole one
    rng = np.random.default_rng([trial.seed, 100 + number])
    rows = rng.choice(len(people.points), WAVE, p=chances / chances.sum())[:size]
    found = {name: np.asarray(y, float) for name, y in fly(people.points[rows]).items()}
    waves.asked += size
    alive = np.all([np.isfinite(found[name]) for name in trial.posteriors], axis=0)
    rows, found = rows[alive], {name: y[alive] for name, y in found.items()}
    if not len(rows):
        return
    counts = people.weights[rows] / chances[rows]
    waves.points = np.vstack([waves.points, people.points[rows]])
    waves.counts = np.append(waves.counts, counts)
    waves.values = {name: np.append(known, found[name]) for name, known in waves.values.items()}
    out = {name: excess(found[name], s) > 0 for name, s in trial.specifications.items()}
    if out:
        out[ALL] = np.any(list(out.values()), axis=0)
    for key, (chance, doubt) in expected.items():
        terms = counts * (out[key] - chance[rows])
        value = float(people.weights @ chance) + float(terms.mean())
        ahead = float(np.sum(people.weights**2 / chances * doubt * (1.0 - doubt))) / len(rows)
        seen = float(terms.var(ddof=1)) / len(rows) if len(rows) > 1 else 0.0
        # the population itself is a sample of the law
        sampled = people.sampling_variance(chance)
        told = _Told(value, ahead, max(ahead, seen), since, sampled)
        waves.estimates.setdefault(key, []).append(told)


def _expected(trial: Trial, people: Population, waves: _Waves) -> dict[str, tuple[Floats, Floats]]:
    """Probability that each specification is not kept at every point: as known, and as it is doubted."""
    if not trial.specifications:
        return {}
    kept = np.ones((2, len(people.points)))
    found = {}
    for name, limits in trial.specifications.items():
        guess = _guess(trial, waves, name)
        value, sd = guess.value(people.points), guess.sd(people.points)
        pair = [_chance(value, limits, times * sd) for times in (1.0, DOUBTED)]
        found[name] = (pair[0], pair[1])
        kept *= 1.0 - np.array(pair)
    return {**found, ALL: (1.0 - kept[0], 1.0 - kept[1])}


def _chance(values: Floats, limits: Limits, sd: Floats) -> Floats:
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        chance = np.asarray(ndtr(excess(values, limits) / sd))
    return np.where(sd > 0, chance, (excess(values, limits) > 0).astype(float))


def _guess(trial: Trial, waves: _Waves, name: str) -> Guess:
    """The surface with what runs have shown it to miss, and what is still open."""
    own, known = trial.posteriors[name], trial.known

    def surface(points: Floats) -> Floats:
        return np.asarray(own.predict(points[:, known]))

    def open_sd(points: Floats) -> Floats:
        return np.asarray(np.hypot(own.draw(points[:, known]).std(axis=0), own.noise_sd))

    if len(waves.points) < FEWEST:
        return Guess(surface, open_sd)
    missed = waves.values[name] - surface(waves.points)
    size = float(np.ptp(waves.values[name])) or 1.0
    if float(np.ptp(missed)) <= 1e-10 * size:
        shift = float(missed.mean())
        return Guess(lambda points: surface(points) + shift, lambda points: np.zeros(len(points)))
    process = waves.processes.get(name)
    if process is None or len(process.y) < len(missed):
        process = fit_kriging("matern52", _scaled(trial.law, waves.points), missed)
        waves.processes[name] = process
    calibration = max(1.0, math.sqrt(float(np.mean(process.loo_residuals**2 / process.loo_variances))))

    def value(points: Floats) -> Floats:
        return np.asarray(surface(points) + process.predict(_scaled(trial.law, points)))

    def sd(points: Floats) -> Floats:
        open_variance = process.variances(_scaled(trial.law, points)) + process.noise_variance
        return np.asarray(calibration * np.sqrt(open_variance))

    return Guess(value, sd)


def _scaled(law: JointLaw, points: Floats) -> Floats:
    """What varies, in standard deviations of each law."""
    sds = np.array([item.sd for item in law.laws.values()])
    return np.asarray((points[:, law.columns] - law.point[law.columns]) / sds)


# ---------------------------------------------------------------------- what it comes to


def _proof(trial: Trial, waves: _Waves) -> Proof:
    count = len(waves.points)
    failed = waves.asked - count
    if count < 3:
        return Proof({}, None, waves.asked, failed)
    width = float(stdtrit(count - 1, 0.5 + 0.5 * trial.confidence))
    outside = {key: _combined(found, width, count) for key, found in waves.estimates.items()}
    whole = make_population(trial.law, {}, {}, [trial.seed, 0]).points
    responses = {}
    for name, posterior in trial.posteriors.items():
        everywhere = posterior.predict(whole[:, trial.known])
        moments = _moments(trial, waves, name, width, everywhere)
        responses[name] = ResponseProof(*moments, outside.get(name))
    return Proof(responses, outside.get(ALL), waves.asked, failed)


def _combined(waves: list[_Told], width: float, count: int) -> Estimate:
    """Average the waves of each population, then these averages.

    Each counts by how well it was expected to do, which does not depend on what it found.
    """
    rows = []
    for since in sorted({told.population for told in waves}):
        own = [told for told in waves if told.population == since]
        value, ahead, seen = _average(*np.array([(told.value, told.ahead, told.seen) for told in own]).T)
        sampled = float(np.mean([told.sampled for told in own]))
        rows.append((value, ahead + sampled, seen + sampled))
    mean, _, variance = _average(*np.array(rows).T)
    value = min(max(mean, 0.0), 1.0)
    error = math.sqrt(variance)
    low, high = _proportion(value, error, width)
    gain = value * (1.0 - value) / count / variance if variance > 0 else math.inf
    if value == 0.0 and high > 0.0:  # so many plain runs without a failure say that there are as few
        gain = -math.log(RULED_OUT) / high / count
    return Estimate(value, low, high, error, min(gain, 1e9))


def _average(values: Floats, ahead: Floats, variances: Floats) -> tuple[float, float, float]:
    """Average of independent numbers by their expected variances, shape (n,); its variances, both ways."""
    weights = 1.0 / np.maximum(ahead, 1e-6 * ahead.max() + 1e-300)
    weights /= weights.sum()
    return float(weights @ values), float(weights**2 @ ahead), float(weights**2 @ variances)


def _proportion(value: float, error: float, width: float) -> tuple[float, float]:
    """Interval of a proportion on the scale of its logit, from 0 where that cannot be excluded."""
    odds = value * (1.0 - value)
    if odds <= 0.0 or error >= odds:
        return max(0.0, value - width * error), min(1.0, value + width * error)
    half, logit = width * error / odds, math.log(value / (1.0 - value))
    return 1.0 / (1.0 + math.exp(-(logit - half))), 1.0 / (1.0 + math.exp(-(logit + half)))


def _moments(
    trial: Trial, waves: _Waves, name: str, width: float, everywhere: Floats
) -> tuple[Estimate, Estimate, dict[str, float]]:
    """Mean, standard deviation and quantiles with the surface as control variate."""
    y, counts = waves.values[name], waves.counts
    at_runs = trial.posteriors[name].predict(waves.points[:, trial.known])
    middle, variance = trial.controls[name]
    means, squares = _with_control(y, at_runs - middle, variance, _leaving_each_out(counts))
    mean, square = float(means[0]), float(squares[0])
    error, of_square = _jackknife(means[1:]), _jackknife(squares[1:])
    plain, plain_square = _plain_error(y, counts), _plain_error((y - mean) ** 2, counts)
    sd = math.sqrt(max(square, 0.0))
    of_sd = of_square / (2.0 * sd) if sd > 0 else 0.0
    # the logarithm of a standard deviation is nearer to normal than it is itself
    factor = math.exp(min(width * of_sd / sd, 50.0)) if sd > 0 else 1.0
    return (
        Estimate(mean, mean - width * error, mean + width * error, error, _gain(plain, error)),
        Estimate(sd, sd / factor, sd * factor, of_sd, _gain(plain_square, of_square)),
        _true_quantiles(y, at_runs, counts, np.sort(everywhere)),
    )


def _gain(plain: float, error: float) -> float:
    return min((plain / error) ** 2, 1e9) if error > 0 else 1e9


def _leaving_each_out(counts: Floats) -> Callable[[Floats], Floats]:
    """Averages by counts: of all runs, then without each of them, shape (n + 1,)."""

    def averages(x: Floats) -> Floats:
        terms = counts * x
        return np.append(terms.sum() / counts.sum(), (terms.sum() - terms) / (counts.sum() - counts))

    return averages


def _with_control(
    y: Floats, control: Floats, variance: float, averages: Callable[[Floats], Floats]
) -> tuple[Floats, Floats]:
    """Mean and mean square of y about it, by a control of mean zero and known variance.

    Each is controlled about its own mean: a surface that lies too high everywhere still tells how y spreads.
    """
    centre = float(averages(y)[0])
    y, square = y - centre, control**2 - variance
    mean, low = averages(y), averages(control)
    mean = mean - _slope(averages(control * y) - low * mean, averages(control**2) - low**2) * low
    first, second, low = averages(y), averages(y**2), averages(square)
    shared = averages(square * y**2) - low * second - 2.0 * mean * (averages(square * y) - low * first)
    about = second - 2.0 * mean * first + mean**2
    return mean + centre, about - _slope(shared, averages(square**2) - low**2) * low


def _slope(shared: Floats, spread: Floats) -> Floats:
    return np.divide(shared, spread, out=np.zeros_like(shared), where=spread > 0)


def _jackknife(left_out: Floats) -> float:
    """Standard error of a number by what it is without each run: runs with much say count as much."""
    count = len(left_out)
    return math.sqrt((count - 1) / count * float(np.sum((left_out - left_out.mean()) ** 2)))


def _plain_error(y: Floats, counts: Floats) -> float:
    """Standard error of the mean of as many plain runs."""
    weights = counts / counts.sum()
    return math.sqrt(float(weights @ (y - weights @ y) ** 2) / len(y))


def _true_quantiles(y: Floats, at_runs: Floats, counts: Floats, everywhere: Floats) -> dict[str, float]:
    """Quantiles of the surface's distribution, corrected by how many runs lie on the other side."""
    weights = counts / counts.sum()
    shift = float(weights @ (y - at_runs))
    ends = min(y.min(), everywhere[0] + shift), max(y.max(), everywhere[-1] + shift)
    grid = np.linspace(*ends, 513)
    base = np.searchsorted(everywhere + shift, grid, side="right") / len(everywhere)
    seen = (y <= grid[:, None]).astype(float) - (at_runs + shift <= grid[:, None])
    heights = np.maximum.accumulate(np.clip(base + seen @ weights, 0.0, 1.0))
    return {f"{p:g}": float(np.interp(p, heights, grid)) for p in QUANTILES}
