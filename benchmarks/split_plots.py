"""Size of tests and coverage of intervals of split plots with few whole plots, by simulation.

    python benchmarks/split_plots.py [runs] > split_plots.csv

For 4, 6 and 10 whole plots of four runs, and for several ratios of the variance of a plot to that of a run:
how often a nominal 5 % test rejects a term that is truly zero, at plot and at run level, by Kenward and
Roger, by Satterthwaite, and by ordinary least squares; and how often a 95 % interval holds the truth: of a
coefficient at both levels, of a run in a new plot, and of the two variances (profiled).
"""

import sys

import numpy as np

from rsmkit.language.space import Factor, Space
from rsmkit.language.terms import full_terms
from rsmkit.surfaces.estimation.fit_data import checked_data
from rsmkit.surfaces.models.mixed import fit_mixed
from rsmkit.surfaces.models.polynomial import fit_polynomial

PLOTS, RATIOS, RUNS = (4, 6, 10), (1.0, 4.0), 4
SPACE = Space([Factor("oven", -1.0, 1.0), Factor("t", -1.0, 1.0)])


def shares(plots, ratio, count, unbalanced, seed):
    """Rejections and coverages, in percent."""
    rng = np.random.default_rng(seed)
    sizes = [RUNS + (i % 3 - 1) * unbalanced for i in range(plots)]
    plot = np.repeat(np.arange(plots), sizes)
    oven = np.where(np.arange(plots) % 2, 1.0, -1.0)[plot]
    t = np.concatenate([np.linspace(-1.0, 1.0, size) for size in sizes])
    points = np.column_stack([oven, t])
    labels = {"plot": [str(i) for i in plot]}
    new = np.array([[1.0, 0.3]])
    truth = (ratio, 1.0)
    found = []
    for _ in range(count):
        shift = rng.normal(size=plots + 1) * np.sqrt(ratio)
        y = shift[plot] + rng.normal(size=len(plot))
        plain = fit_polynomial(
            SPACE, "y", checked_data(SPACE, points, y, random=labels), full_terms(SPACE, 1)
        )
        mixed = fit_mixed(plain)
        other = fit_mixed(plain, "satterthwaite")
        limits = mixed.confidence_intervals()
        _, low, high = mixed.predict(new, 0.95)
        run = shift[-1] + rng.normal()
        variances = mixed.variance_intervals() if len(found) % 5 == 0 else np.full((2, 2), np.nan)
        held = [np.nan if np.isnan(a) else a <= v <= b for v, (a, b) in zip(truth, variances, strict=True)]
        found.append(
            [
                *(mixed.p_values[1:] < 0.05),
                *(other.p_values[1:] < 0.05),
                *(plain.p_values[1:] < 0.05),
                *((limits[1:, 0] <= 0) & (limits[1:, 1] >= 0)),
                float(low[0]) <= run <= float(high[0]),
                *held,
            ]
        )
    return 100.0 * np.nanmean(np.array(found, float), axis=0)


def main(count=400):
    """Print a line per case."""
    heads = ("KR", "Satterthwaite", "OLS", "coverage")
    columns = [f"{head} {level}" for head in heads for level in ("plot", "run")]
    print(",".join(["plots", "ratio", "unbalanced", *columns, "new run", "plot variance", "run variance"]))
    for plots in PLOTS:
        for ratio in RATIOS:
            for unbalanced in (0, 1):
                row = shares(plots, ratio, count, unbalanced, seed=plots)
                print(
                    ",".join([str(plots), f"{ratio:g}", str(unbalanced), *(f"{x:.1f}" for x in row)]),
                    flush=True,
                )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
