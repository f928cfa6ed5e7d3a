"""Uncertainty: coverage of the intervals by simulation, failure rates by few runs, speed.

``python benchmarks/uncertainty.py coverage 200`` fits noisy runs of a known polynomial again and again and
counts how often the intervals (nominal 95 %) hold the truth; ``failures 100`` does so for the failure rates
of six analytic problems with 200 runs each; ``speed`` times a quadratic in 20 factors and a process of 300
runs in 10 factors.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

import numpy as np
from scipy.stats import chi2, qmc

import rsmkit as rk
from rsmkit.language.joint_law import JointLaw, box_law
from rsmkit.language.laws import Normal
from rsmkit.language.terms import full_terms
from rsmkit.surfaces.estimation.coordinates import bounds
from rsmkit.surfaces.kinds import posterior_of
from rsmkit.variation.conformity.proof import Trial, prove
from rsmkit.variation.options import Specification
from rsmkit.variation.sensitivity.decomposition import decompose
from rsmkit.variation.sensitivity.expansion import expand

Points = np.ndarray
REACH = 5.0


def coverage(repetitions: int) -> None:
    """Intervals of mean, deviation, indices and fraction outside, on noisy runs of a quadratic."""
    space = rk.Space(a=(-1.0, 1.0), b=(-1.0, 1.0), c=(-1.0, 1.0))
    terms = full_terms(space, 2)
    beta = np.array([10.0, 2.0, -1.5, 1.0, 0.8, 0.3, -0.4, 0.7, -0.5, 0.4])
    points = qmc.scale(qmc.Sobol(3, rng=np.random.default_rng(1)).random(32), -1.0, 1.0)
    exact = terms.evaluate(points, beta)
    laws = {name: {"law": "normal", "sd": 0.25} for name in space.names}
    law = JointLaw(space, np.zeros(3), {name: Normal(0.0, 0.25) for name in space.names})
    true = expand(terms, bounds(space), beta, law)
    x = law.draw(1 << 20, np.random.default_rng(2))
    limit, noise = 11.0, 0.5
    wet = terms.evaluate(x, beta) + noise * np.random.default_rng(3).standard_normal(len(x))
    outside = float(np.mean(wet > limit))
    variance = float(true.variance[0])
    hits: dict[str, int] = {}
    for seed in range(repetitions):
        y = exact + noise * np.random.default_rng(1000 + seed).standard_normal(len(points))
        surface = rk.fit_surface(space, points, y, response="y", order=2)
        own = rk.uncertainty(
            {"y": surface},
            laws,
            specifications={"y": {"high": limit}},
            deterministic=False,
            seed=seed,
            samples=64,
        ).responses["y"]
        intervals = {
            "mean": (own.mean_low, true.mean[0], own.mean_high),
            "sd": (own.sd_low, np.hypot(variance**0.5, noise), own.sd_high),
            "outside": (own.out_low, outside, own.out_high),
        }
        for j, name in enumerate(space.names):
            share = own.sobol[name]
            intervals[f"total {name}"] = (share.low, true.total[j, 0] / variance, share.high)
        for key, (low, value, high) in intervals.items():
            hits[key] = hits.get(key, 0) + bool(low <= value <= high)
    for key, count in hits.items():
        print(f"{key:10} {100 * count / repetitions:.1f} % of {repetitions}")


def _branches(z: Points) -> Points:
    s, d = (z[:, 0] + z[:, 1]) / 2**0.5, z[:, 0] - z[:, 1]
    parts = [3 + 0.1 * d**2 - s, 3 + 0.1 * d**2 + s, d + 6 / 2**0.5, -d + 6 / 2**0.5]
    return -np.min(parts, axis=0)


PROBLEMS: dict[str, tuple[int, Callable[[Points], Points], float | None, float]] = {
    "linear": (3, lambda z: z.sum(axis=1) / 3**0.5, 3.719016485455709, 1e-4),
    "parabola": (2, lambda z: z[:, 0] + 0.3 * z[:, 1] ** 2, None, 1e-3),
    "circle": (2, lambda z: (z**2).sum(axis=1), 9.0, float(chi2.sf(9.0, 2))),
    "wavy": (2, lambda z: z[:, 0] + z[:, 1] + 0.5 * np.sin(2 * z[:, 0]), None, 1e-3),
    "exponential": (3, lambda z: np.exp(0.3 * z.sum(axis=1)), np.exp(0.3 * 3**0.5 * 3.0902323), 1e-3),
    "branches": (2, _branches, None, 4.46e-3),
}
"""Of standard normal numbers: how many, the response, the limit, how often it is exceeded."""


def failures(repetitions: int, runs: int = 200) -> None:
    """Failure rates from a coarse quadratic surface and true runs."""
    for name, (k, response, given, truth) in PROBLEMS.items():
        limit = given
        if limit is None:
            rng = np.random.default_rng(99)
            drawn = np.concatenate([response(rng.standard_normal((1_000_000, k))) for _ in range(20)])
            limit = float(np.quantile(drawn, 1.0 - truth))
        space = rk.Space(**{f"z{i}": (-REACH, REACH) for i in range(k)})
        law = JointLaw(space, np.zeros(k), {factor: Normal(0.0, 1.0) for factor in space.names})
        inside, ratios = 0, []
        for seed in range(repetitions):
            rng = np.random.default_rng(1000 + seed)
            points = qmc.scale(qmc.LatinHypercube(k, rng=rng).random(10 * k), -REACH, REACH)
            surface = rk.fit_surface(space, points, response(points), response="y", order=2)
            posterior = posterior_of(surface, 200, rng)
            moments = decompose(posterior, law, samples=1024, seed=1)
            controls = {"y": (moments.mean.value, moments.variance.value)}
            trial = Trial(
                law,
                {"y": posterior},
                [*range(k)],
                controls,
                {"y": Specification(high=limit)},
                runs,
                seed=seed,
            )
            found = prove(trial, lambda x, response=response: {"y": response(x)}).responses["y"].outside
            assert found is not None
            inside += found.low <= truth <= found.high
            ratios.append((found.value / truth, found.low / truth, found.high / truth))
        value, low, high = np.median(ratios, axis=0)
        print(
            f"{name:12} {truth:.3g}: inside {inside} of {repetitions}; median estimate {value:.3f}, "
            f"interval {low:.3f} to {high:.3f} of the truth",
            flush=True,
        )


def speed() -> None:
    """CPU seconds."""
    rng = np.random.default_rng(1)
    space = rk.Space(**{f"x{i}": (-1.0, 1.0) for i in range(20)})
    terms = full_terms(space, 2)
    beta, law = rng.standard_normal(terms.p), box_law(space)
    expand(terms, bounds(space), beta, law)
    start = time.process_time()
    found = expand(terms, bounds(space), beta, law)
    assert found.total.shape == found.first.shape
    assert len(found.pairs) == 190
    print(f"all indices of a quadratic in 20 factors: {time.process_time() - start:.3f} s")
    space = rk.Space(**{f"x{i}": (-1.0, 1.0) for i in range(10)})
    points = 2.0 * rng.random((300, 10)) - 1.0
    y = np.sin(3.0 * points[:, 0]) + points[:, 1] * points[:, 2] + points[:, 3] ** 2
    options = rk.SurfaceOptions(model="gaussian process")
    surface = rk.choose_surface(space, points, y, response="y", options=options).surface
    start = time.process_time()
    posterior = posterior_of(surface, 400, rng)
    decompose(posterior, box_law(space), samples=4096, seed=1)
    print(f"all indices of a process of 300 runs in 10 factors: {time.process_time() - start:.1f} s")


if __name__ == "__main__":
    what, *rest = sys.argv[1:] or ["speed"]
    {"coverage": coverage, "failures": failures, "speed": speed}[what](*map(int, rest))
