"""How good the model is that `auto` chooses: against the best of those it compares, and the plain polynomial.

    python benchmarks/auto_choice.py [--seeds 1] [--first 0] [--factors 2 3 5 8] [--out runs.csv]

Twelve functions x three levels of noise x numbers of factors x seeds: twice as many runs as the quadratic has
terms, at least 20, a Latin hypercube. The error is the root mean square at 1,000 fresh points against the
function without noise, in units of its spread; what lies below 1e-6 counts as that. Of each group of cases a
line says

    best       geometric mean of the error of the chosen model over that of the best of the pool (aim 1.05)
    plain      the largest error of the chosen model over that of the plain polynomial (aim 1.1)
    one model  geometric mean, over the best of the pool, of the model that would be the best choice for all

With --out one line is appended for each model of each case, and cases that stand there are not run again.
"""

import argparse
import csv
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.stats import qmc

import rsmkit as rk
from rsmkit.surfaces import choose

NOISE = (0.0, 0.2, 0.8)
LEAST = 1e-6
FRESH = 1000
PLAIN = "polynomial"
AUTO = "auto"

Function = Callable[[np.ndarray], np.ndarray]

FUNCTIONS: dict[str, Function] = {
    "linear": lambda x: x @ (1.0 / (1.0 + np.arange(x.shape[1]))),
    "quadratic": lambda x: x[:, 0] + 2.0 * x[:, 0] ** 2 - x[:, 0] * x[:, -1] + (x**2).sum(axis=1),
    "products": lambda x: x[:, 0] + (x[:, :-1] * x[:, 1:]).sum(axis=1),
    "exponential": lambda x: np.exp(1.2 * x[:, 0]) + np.exp(0.6 * x[:, -1]),
    "skewed": lambda x: np.exp(x @ (1.5 / (1.0 + np.arange(x.shape[1])))),
    "reciprocal": lambda x: 1.0 / (1.3 + x[:, 0]) + 0.5 / (1.5 + x[:, -1]),
    "powers": lambda x: np.prod((2.0 + x[:, :3]) ** [1.5, -1.0, 0.5][: x[:, :3].shape[1]], axis=1),
    "valley": lambda x: ((1.5 * x[:, 1:] - 2.0 * x[:, :-1] ** 2) ** 2).sum(axis=1) + x[:, 0],
    "wave": lambda x: np.sin(2.5 * x[:, 0]) + 0.5 * np.cos(2.0 * x[:, -1]) + 0.3 * x[:, 0] * x[:, -1],
    "cubic": lambda x: x[:, 0] ** 3 + x[:, 0] * x[:, -1] ** 2 - x[:, -1],
    "saturation": lambda x: np.tanh(1.5 * x.sum(axis=1) / math.sqrt(x.shape[1])),
    "peak": lambda x: np.exp(-((x - 0.2) ** 2).sum(axis=1) / (0.5 + 0.25 * x.shape[1])),
}
"""Of points on [-1, 1], shape (n, k)."""


def errors_of(name: str, noise: float, factors: int, seed: int) -> dict[str, float]:
    """Hold-out errors of all models that were compared, and of the chosen one as ``auto``."""
    rng = np.random.default_rng([seed, factors, list(FUNCTIONS).index(name), NOISE.index(noise)])
    runs = max(20, (factors + 1) * (factors + 2))
    points = 2.0 * qmc.LatinHypercube(factors, rng=rng).random(runs) - 1.0
    fresh = rng.uniform(-1.0, 1.0, (FRESH, factors))
    truth = FUNCTIONS[name](fresh)
    spread = truth.std()
    y = FUNCTIONS[name](points) + noise * spread * rng.standard_normal(runs)
    space = rk.Space([rk.Factor(f"x{i}", -1.0, 1.0) for i in range(factors)])
    found, fit_kind = {}, choose.fit_kind

    def kept(kind, request):
        fit = fit_kind(kind, request)
        found[next(word for word, row in choose.KINDS.items() if row is kind)] = fit.surface
        return fit

    choose.fit_kind = kept
    try:
        options = rk.SurfaceOptions(model="auto")
        chosen = rk.choose_surface(space, points, y, options=options, deterministic=False)
    finally:
        choose.fit_kind = fit_kind
    found[AUTO] = chosen.surface
    return {
        word: max(float(np.sqrt(np.mean((surface.predict(fresh) - truth) ** 2)) / spread), LEAST)
        for word, surface in found.items()
    }


def read(path: Path | None) -> dict[tuple[str, float, int, int], dict[str, float]]:
    """Cases that were run before."""
    known: dict[tuple[str, float, int, int], dict[str, float]] = {}
    if path and path.exists():
        with path.open(encoding="utf-8", newline="") as lines:
            for name, noise, factors, seed, word, error in csv.reader(lines):
                known.setdefault((name, float(noise), int(factors), int(seed)), {})[word] = float(error)
    return known


def geometric(ratios: list[float]) -> float:
    return math.exp(sum(map(math.log, ratios)) / len(ratios))


def tell(what: str, cases: list[dict[str, float]]) -> None:
    """One line of results."""
    pools = [{word: e for word, e in case.items() if word != AUTO} for case in cases]
    best = [min(pool.values()) for pool in pools]
    over_best = [case[AUTO] / least for case, least in zip(cases, best, strict=True)]
    over_plain = [case[AUTO] / case[PLAIN] for case in cases]
    alone = {
        word: geometric([pool[word] / least for pool, least in zip(pools, best, strict=True)])
        for word in set.intersection(*map(set, pools))
    }
    word = min(alone, key=alone.__getitem__)
    above = sum(ratio > 1.1 for ratio in over_plain)
    print(
        f"{what:22s} {len(cases):4d} cases  best {geometric(over_best):.3f}  "
        f"plain {geometric(over_plain):.3f}, at most {max(over_plain):.2f}, {above} above 1.1  "
        f"one model {alone[word]:.3f} ({word})",
        flush=True,
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--seeds", type=int, default=1, help="how many")
    parser.add_argument("--first", type=int, default=0, help="the first of them")
    parser.add_argument("--factors", type=int, nargs="+", default=[2, 3, 5, 8])
    parser.add_argument("--out", type=Path)
    asked = parser.parse_args()
    found = read(asked.out)
    for factors in asked.factors:
        for seed in range(asked.first, asked.first + asked.seeds):
            for name in FUNCTIONS:
                for noise in NOISE:
                    case = name, noise, factors, seed
                    if case not in found:
                        found[case] = errors_of(*case)
                        if asked.out:
                            with asked.out.open("a", encoding="utf-8", newline="") as lines:
                                csv.writer(lines).writerows([*case, w, e] for w, e in found[case].items())
    for factors in sorted({case[2] for case in found}):
        tell(f"{factors} factors", [errors for case, errors in found.items() if case[2] == factors])
    for noise in NOISE:
        tell(f"noise {noise:g}", [errors for case, errors in found.items() if case[1] == noise])
    for name in FUNCTIONS:
        tell(name, [errors for case, errors in found.items() if case[0] == name])
    tell("all", list(found.values()))


if __name__ == "__main__":
    main()
