"""One search over a single factor and its verdict, for tests of verdicts."""

import numpy as np

from rsmkit.language.space import Space
from rsmkit.optimum.optimum import Candidate, Optimum
from rsmkit.optimum.problem import build_problem
from rsmkit.verification.judge import judge_optimum

SPACE = Space(x=(0.0, 10.0))


class Flat:
    """A surface that predicts one value with one half width."""

    def __init__(self, value, half_width=1.0):
        self.value, self.half_width = value, half_width

    def predict(self, X, *, interval, kind="prediction"):
        mean = np.full(len(X), self.value)
        return mean, mean - self.half_width, mean + self.half_width


def optimum(*labels, minimize=("f",), subject_to=()):
    candidates = tuple(Candidate(np.array([4.0]), (10.0,) * len(minimize), {}, (), label) for label in labels)
    front = candidates if len(labels) > 1 else ()
    return Optimum("scalar", SPACE, minimize, subject_to, {}, 1, 1080, candidates[0], {}, front)


def problem(minimize="f", subject_to=()):
    return build_problem(SPACE, minimize, lambda p: {}, responses=["f", "g"], subject_to=subject_to)


def confirm(actual, *, design=(12.0, 11.0, 15.0), half_width=1.0, subject_to=(), options=None, own=True):
    about = problem(subject_to=subject_to)
    points = np.linspace(0, 10, len(design))[:, None]
    runs = about.evaluation(points, {"f": np.array(design), "g": np.zeros(len(design))})
    return judge_optimum(
        about,
        optimum("optimum"),
        [{"f": actual, "g": 0.0}],
        surfaces={"f": Flat(10.0), "g": Flat(0.0)},
        objective_surfaces={"f": Flat(10.0, half_width)} if own else None,
        design=runs,
        options=options,
    )
