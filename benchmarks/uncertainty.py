"""Uncertainty: coverage of the intervals by simulation, failure rates by few runs, speed.

``python benchmarks/uncertainty.py coverage 200`` fits noisy runs of a known polynomial again and again and
counts how often the intervals (nominal 95 %) hold the truth; ``failures 100`` does so for the failure rates
of six analytic problems with 200 runs each; ``speed`` times a quadratic in 20 factors and a process of 300
runs in 10 factors; ``salib`` gives SALib and this project the values of the same samples, and measures both.
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
from rsmkit.variation.sensitivity.sampled_indices import sobol_estimates

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


def _salib_functions() -> dict[str, tuple[int, Callable[[Points], Points]]]:
    from SALib.test_functions import Ishigami, Sobol_G

    def ishigami(u: Points) -> Points:
        return np.asarray(Ishigami.evaluate(2.0 * np.pi * u - np.pi))

    return {
        "ishigami": (3, ishigami),
        "g-function": (8, lambda u: np.asarray(Sobol_G.evaluate(u))),
        "exponential": (5, lambda u: np.exp(u @ np.arange(5.0))),
    }


def salib() -> None:
    """The largest difference of any index from SALib's on the same sample, and the CPU seconds of both."""
    from SALib.analyze import morris as salib_morris
    from SALib.analyze import sobol as salib_sobol
    from SALib.sample import sobol as salib_sample

    for name, (k, response) in _salib_functions().items():
        problem = {"num_vars": k, "names": [f"x{i}" for i in range(k)], "bounds": [[0.0, 1.0]] * k}
        sample = salib_sample.sample(problem, 4096, calc_second_order=True, seed=1)
        y = response(sample)
        start = time.process_time()
        theirs = salib_sobol.analyze(problem, y, calc_second_order=True, num_resamples=100, seed=1)
        their_time = time.process_time() - start
        rows = y.reshape(-1, 2 * k + 2).T
        start = time.process_time()
        ours = sobol_estimates(rows[0], rows[-1], rows[1 : k + 1], rows[k + 1 : 2 * k + 1])
        our_time = time.process_time() - start
        upper = np.triu_indices(k, 1)
        assert ours.pairs is not None
        worst = max(
            np.abs(ours.first / ours.variance - theirs["S1"]).max(),
            np.abs(ours.total / ours.variance - theirs["ST"]).max(),
            np.abs((ours.pairs / ours.variance)[upper] - theirs["S2"][upper]).max(),
        )
        space = rk.Space(**{f"x{i}": (0.0, 1.0) for i in range(k)})
        paths = rk.morris(space, paths=50, seed=1)
        effects = rk.elementary_effects(paths, response(paths.points))
        screened = salib_morris.analyze(problem, paths.points, response(paths.points), num_levels=4, seed=1)
        apart = np.abs(np.array([item.mean_size for item in effects.values()]) - screened["mu_star"]).max()
        spread = np.abs(np.array([item.sd for item in effects.values()]) - screened["sigma"]).max()
        print(
            f"{name:12} Sobol indices differ by at most {worst:.1e} ({our_time:.3f} s, SALib "
            f"{their_time:.3f} with 100 resamples); Morris mu* by {apart:.1e}, sigma by {spread:.1e}"
        )


if __name__ == "__main__":
    what, *rest = sys.argv[1:] or ["speed"]
    {"coverage": coverage, "failures": failures, "speed": speed, "salib": salib}[what](*map(int, rest))
