"""Optimal designs of mixtures: efficiency and time beside AlgDesign's exchange over the same candidates.

    python benchmarks/mixture_designs.py [--r-library PATH] [CASE ...]

Needs R with the package AlgDesign (Wheeler 2004). It chooses among the corners and centroids our search
begins from, in 20 random starts; for I it averages over 2000 points spread evenly. Both designs are judged by
the exact average. Above 1 ours is better.
"""

from __future__ import annotations

import argparse
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np

import rsmkit as rk
from rsmkit.design.optimal.encoding import encode_model, moments
from rsmkit.design.region import box

PROGRAM = """
library(AlgDesign)
base <- read.csv("candidates.csv"); space <- read.csv("space.csv"); set.seed(1)
candidates <- base[rep(seq_len(nrow(base)), ceiling(max(3, 3 * {runs} / nrow(base)))), , drop = FALSE]
taken <- system.time(found <- optFederov({formula}, candidates, nTrials = {runs}, criterion = "{criterion}",
    nRepeats = 20, maxIteration = 200, space = if ("{criterion}" == "I") space else NULL))[3]
write.csv(found$design[, names(base)], "found.csv", row.names = FALSE)
cat(taken)
"""


def mixed(process: int = 0, **bounds: tuple[float, float]) -> rk.Space:
    """A mixture of components with these bounds, and process factors."""
    factors = bounds | {f"z{i + 1}": (-1.0, 1.0) for i in range(process)}
    return rk.Space(**factors).mixture(*bounds)


CASES = {
    "three components, whole simplex": (mixed(a=(0, 1), b=(0, 1), c=(0, 1)), 10),
    "flare (McLean & Anderson 1966)": (mixed(a=(0.4, 0.6), b=(0.1, 0.5), c=(0.1, 0.5), d=(0.03, 0.08)), 15),
    "gasoline (Snee & Marquardt 1974)": (
        mixed(a=(0, 0.1), b=(0, 0.1), c=(0.15, 0.4), d=(0.1, 0.4), e=(0.35, 0.6)),
        20,
    ),
    "six components": (mixed(**dict.fromkeys("abcdef", (0.02, 0.4))), 28),
    "eight components": (mixed(**dict.fromkeys("abcdefgh", (0.02, 0.3))), 45),
    "two process factors": (mixed(2, a=(0.2, 0.6), b=(0.1, 0.7), c=(0.1, 0.6)), 24),
}


def formula(names: tuple[str, ...]) -> str:
    """The model as R writes it."""
    return "~ -1 + " + " + ".join(f"I({x})" if "^" in x else x.replace("*", ":") for x in names)


def peer(space: rk.Space, runs: int, criterion: str, library: str) -> tuple[np.ndarray, float]:
    """AlgDesign's design, coded, and the seconds it took."""
    region, names = box(space), space.names
    with tempfile.TemporaryDirectory() as folder:
        for file, points in (("candidates", region.nodes(100_000)), ("space", region.sample(2000, 0))):
            np.savetxt(Path(folder, f"{file}.csv"), points, "%.17g", ",", header=",".join(names), comments="")
        model = formula(rk.space_terms(space).names(space))
        program = PROGRAM.format(runs=runs, formula=model, criterion=criterion)
        path = f'.libPaths(c("{library}", .libPaths()))' if library else ""
        done = subprocess.run(
            ["Rscript", "-e", path + program], cwd=folder, capture_output=True, text=True, check=True
        )
        return np.loadtxt(Path(folder, "found.csv"), delimiter=",", skiprows=1), float(done.stdout)


def main() -> None:
    """Print a line per case and criterion."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("cases", nargs="*", help="words of the cases to run; all by default")
    parser.add_argument("--r-library", default="", help="folder where R finds AlgDesign")
    options = parser.parse_args()
    rk.optimal_design(CASES["three components, whole simplex"][0], 7)  # compiled once
    print(f"{'case':36}{'':4}{'runs':>6}{'efficiency':>12}{'seconds':>10}{'AlgDesign':>10}")
    for name, (space, runs) in CASES.items():
        if options.cases and not any(word in name for word in options.cases):
            continue
        terms, region = rk.space_terms(space), box(space)
        for criterion in ("D", "I"):
            begun = time.perf_counter()
            design = rk.optimal_design(space, runs, criterion=criterion)
            ours = time.perf_counter() - begun
            points, theirs = peer(space, runs, criterion, options.r_library)
            weights = moments(encode_model(terms), region)
            values = []
            for coded in (design.coded, points):
                X = terms.matrix(coded)
                trace = np.trace(np.linalg.solve(X.T @ X, weights))
                log_det = np.linalg.slogdet(X.T @ X)[1] / terms.p
                values.append(np.exp(log_det) if criterion == "D" else 1.0 / trace)
            print(f"{name:36}{criterion:4}{runs:6}{values[0] / values[1]:12.4f}{ours:10.2f}{theirs:10.2f}")


if __name__ == "__main__":
    main()
