"""What a stretch buys, and whether its statistics keep their promises.

Size of the nominal 5 % test of a coefficient whose true value is zero, coverage of the 95 % interval of the
mean, and hold-out errors of plain and stretched surfaces on standard functions (4,096 fresh points).

Usage: OMP_NUM_THREADS=1 python benchmarks/surfaces_stretching.py [replicates]
"""

import sys

import numpy as np
from scipy.special import fdtrc
from scipy.stats import qmc

from rsmkit import Space, SurfaceOptions, choose_surface, full_terms
from rsmkit.surfaces.estimation.coordinates import Coordinates
from rsmkit.surfaces.estimation.fit_data import checked_data
from rsmkit.surfaces.estimation.least_squares import two_sided_p
from rsmkit.surfaces.estimation.score_test import score_statistic
from rsmkit.surfaces.estimation.stretch import Stretch
from rsmkit.surfaces.models.polynomial import fit_polynomial
from rsmkit.surfaces.models.stretch_search import StretchSearch
from rsmkit.surfaces.models.stretched import stretched_at

SPACE = Space(a=(0.0, 1.0), b=(0.0, 1.0), c=(0.0, 1.0))
TERMS = full_terms(3, 2)
FUNCTIONS = {
    "reciprocal": lambda u: (
        1 / ((0.1 + 0.9 * u[:, 0]) * (0.1 + 0.9 * u[:, 1])) ** 0.8 + 0.5 / (0.1 + 0.9 * u[:, 2])
    ),
    "exponential": lambda u: np.exp(2 * u[:, 0]) + np.exp(1.5 * u[:, 1]) * u[:, 2],
    "radius": lambda u: (0.15 + 0.15 * u[:, 2]) ** -0.5 * (1 + np.sin(0.2 + 0.5 * u[:, 0])) + u[:, 1] ** 3,
    "banana": lambda u: (
        100 * (4 * u[:, 1] - 2 - (4 * u[:, 0] - 2) ** 2) ** 2 + (3 - 4 * u[:, 0]) ** 2 + u[:, 2]
    ),
}


def filled(n, seed=0):
    """Corners, centre, and Sobol points."""
    cube = (np.arange(8)[:, None] >> np.arange(3)) & 1
    return np.vstack([cube, np.full((1, 3), 0.5), qmc.Sobol(3, seed=seed).random(64)[: n - 9]])


def size_and_coverage(replicates):
    points = filled(50)
    ends = [(0.0, 1.0)] * 3
    beta = np.array([5, 3, 2, 3, 0.5, 0, 1.5, 2, 1, 0.0])
    true = Coordinates(
        (0.0,) * 3,
        (1.0,) * 3,
        tuple(Stretch("exp", (a,), *e) for a, e in zip((1.5, -1.0, 1.0), ends, strict=True)),
    )
    start = tuple(Stretch("exp", (0.0,), *end) for end in ends)
    clean, fresh = TERMS.matrix(true.forward(points)) @ beta, filled(50, seed=5)
    expected = TERMS.matrix(true.forward(fresh)) @ beta
    print("share of replicates in which a test at 5 % rejects: a*c, c^2, truly zero, and a^2, truly 2")
    print(
        "noise/spread   score a*c   score c^2   Wald c^2   conditional c^2   coverage of the mean   score a^2"
    )
    for noise in (0.05, 0.2, 0.5):
        rows = []
        for seed in range(replicates):
            y = clean + noise * np.random.default_rng(seed).normal(size=len(clean))
            plain = fit_polynomial(SPACE, "y", checked_data(SPACE, points, y), TERMS)
            members, _ = StretchSearch(plain, seed=seed).best(start)
            coordinates = Coordinates((0.0,) * 3, (1.0,) * 3, members)
            joint = stretched_at(SPACE, "y", plain.data, TERMS, coordinates, 0.0, 0.0)
            naive = fit_polynomial(SPACE, "y", plain.data, TERMS, coordinates).fit
            p = two_sided_p(naive.coefficients / naive.std_errors, naive.df)
            _, low, high = joint.predict(fresh, interval=0.95, kind="mean")
            covered = np.mean((low <= expected) & (expected <= high))
            score = [fdtrc(1, joint.fit.df, score_statistic(joint, [c])) for c in (5, 9, 7)]
            wald = two_sided_p(joint.coefficients / joint.std_errors, joint.fit.df)[9]
            rows.append(
                [score[0] < 0.05, score[1] < 0.05, wald < 0.05, p[9] < 0.05, covered, score[2] < 0.05]
            )
        means = np.mean(rows, axis=0)
        print(f"{noise / clean.std():12.3f}" + "".join(f"{m:12.3f}" for m in means))


def gains():
    points, fresh = filled(50), qmc.Sobol(3, seed=99).random(4096)
    print("hold-out error in percent of the spread:   polynomial    chosen by auto")
    for name, function in FUNCTIONS.items():
        truth = function(fresh)
        choice = choose_surface(SPACE, points, function(points), options=SurfaceOptions(model="auto"))
        errors = [
            100 * np.sqrt(np.mean((s.predict(fresh) - truth) ** 2)) / truth.std()
            for s in (choice.polynomial, choice.surface)
        ]
        print(
            f"{name:42s}{errors[0]:11.2f}{errors[1]:18.2f}   {choice.sentence.split(',')[0].split(': ')[1]}"
        )


if __name__ == "__main__":
    gains()
    size_and_coverage(int(sys.argv[1]) if len(sys.argv) > 1 else 100)
