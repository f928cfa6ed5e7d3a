"""Whether 95 % intervals hold 95 %: tolerance, after selection, after Box-Cox, after `auto`.

Normal noise, the expected response a full quadratic with coefficients drawn anew every time, a Latin
hypercube, 40 fresh points. `mean` is the share of points whose expected response (Box-Cox: median) lies in
its interval, `prediction` that of new runs, `simultaneous` that of experiments in which all 40 do. A
tolerance interval holds when at least 95 % of the runs at a point lie in it.

Usage: OMP_NUM_THREADS=1 python benchmarks/surfaces_intervals.py [tolerance] [reduced] [box-cox] [auto] [N]
"""

import sys

import numpy as np
from scipy.stats import norm

from rsmkit import Space, SurfaceOptions, choose_surface, fit_surface, full_terms, latin_hypercube
from rsmkit.surfaces.models.box_cox import power_inverse
from rsmkit.surfaces.statistics.intervals import simultaneous_band, tolerance_interval

POINTS = 40


class Experiment:
    """Runs of a random quadratic, and fresh points with their expected response."""

    def __init__(self, rng, k, n, size, constant=0.0, noise=1.0):
        self.space = Space(**{f"x{j}": (-1.0, 1.0) for j in range(k)})
        terms = full_terms(k, 2)
        self.points, self.fresh = latin_hypercube(self.space, n).points, rng.uniform(-1, 1, (POINTS, k))
        self.coefficients = coefficients = size * rng.normal(size=terms.p)
        coefficients[0] += constant
        self.y = terms.matrix(self.points) @ coefficients + noise * rng.normal(size=n)
        self.expected = terms.matrix(self.fresh) @ coefficients
        self.new = self.expected + noise * rng.normal(size=POINTS)


def inside(limits, values):
    """Share of values between limits."""
    return np.mean((limits[1] <= values) & (values <= limits[2]))


def tolerance(rng, times):
    for k, n in ((2, 12), (3, 20), (3, 50)):
        held = []
        for _ in range(times):
            trial = Experiment(rng, k, n, 1.0)
            surface = fit_surface(trial.space, trial.points, trial.y).surface
            trial.fresh[0] = 1.0  # a corner too
            at = full_terms(k, 2).matrix(trial.fresh) @ trial.coefficients
            _, low, high = tolerance_interval(surface, trial.fresh)
            held.append(norm.cdf(high - at) - norm.cdf(low - at) >= 0.95)
        share = np.array(held)
        inner, corner = 100 * share[:, 1:].mean(), 100 * share[:, 0].mean()
        print(f"tolerance k={k} n={n}: {inner:.1f} %, corner {corner:.1f} %", flush=True)


def chosen(rng, times, model, cases):
    for k, n, size in cases:
        shares = {"mean": [], "prediction": [], "simultaneous": []}
        for _ in range(times):
            trial = Experiment(rng, k, n, size)
            surface = choose_surface(
                trial.space, trial.points, trial.y, options=SurfaceOptions(model=model), deterministic=False
            ).surface
            shares["mean"].append(inside(surface.predict(trial.fresh, 0.95, "mean"), trial.expected))
            shares["prediction"].append(inside(surface.predict(trial.fresh, 0.95), trial.new))
            if model == "reduced":
                band = simultaneous_band(surface.surface, trial.fresh)
                shares["simultaneous"].append(inside(band, trial.expected) == 1.0)
        told = ", ".join(f"{name} {100 * np.mean(x):.1f} %" for name, x in shares.items() if x)
        print(f"{model} k={k} n={n} coefficients {size:g} sigma: {told}", flush=True)


def box_cox(rng, times):
    for k, n, power, constant, noise in ((2, 20, 0, 1, 0.2), (2, 20, 0, 1, 0.5), (2, 20, 0.5, 6, 0.3),
                                         (3, 30, 0, 1, 0.3), (2, 20, -0.5, 0.8, 0.1)):  # fmt: skip
        shares = {"median": [], "prediction": []}
        for _ in range(times):
            trial = Experiment(rng, k, n, 0.3, constant, noise)
            y, median, new = (power_inverse(z, power) for z in (trial.y, trial.expected, trial.new))
            if not (np.isfinite([*y, *median, *new]).all() and y.min() > 0):
                continue
            surface = choose_surface(
                trial.space, trial.points, y, options=SurfaceOptions(model="box-cox"), deterministic=False
            ).surface
            if surface.form != "box-cox":
                continue
            shares["median"].append(inside(surface.predict(trial.fresh, 0.95, "mean"), median))
            shares["prediction"].append(inside(surface.predict(trial.fresh, 0.95), new))
        told = ", ".join(f"{name} {100 * np.mean(x):.1f} %" for name, x in shares.items())
        print(f"box-cox k={k} n={n} power {power:g} sigma {noise:g}: {told}", flush=True)


def main():
    words = [word for word in sys.argv[1:] if not word.isdigit()]
    times = next((int(word) for word in sys.argv[1:] if word.isdigit()), 200)
    rng = np.random.default_rng(1)
    few = ((2, 20, 0.5), (3, 20, 0.0), (3, 20, 0.3), (3, 20, 1.0), (3, 40, 0.3))
    rows = {
        "tolerance": lambda: tolerance(rng, times),
        "reduced": lambda: chosen(rng, times, "reduced", few),
        "box-cox": lambda: box_cox(rng, times),
        "auto": lambda: chosen(rng, times, "auto", ((2, 20, 0.5), (2, 20, 2.0), (2, 40, 1.0))),
    }
    for word, run in rows.items():
        if not words or word in words:
            run()


if __name__ == "__main__":
    main()
