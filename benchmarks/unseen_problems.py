"""Problems for ``search_unseen.py``: several optima, constraints, failures, levels, categories, composites.

Standard test functions and engineering problems of the literature under their usual names, each with the
least value known (closed form where there is one, otherwise differential evolution from two seeds that agreed
to 1e-9) and the number of runs to begin with. All are minimised; what is fitted are the responses.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rsmkit import Space
from rsmkit.language.space import Factor, Floats

PI = np.pi
Responses = dict[str, Floats]


@dataclass(frozen=True)
class Case:
    """One problem."""

    space: Space
    simulator: Callable[[Floats], Responses]
    start: int
    best: float
    minimize: str = "f"
    subject_to: tuple[str, ...] = ()
    responses: tuple[str, ...] = ("f",)


def box(*bounds: tuple[float, float]) -> Space:
    return Space(**{f"x{i}": (float(low), float(high)) for i, (low, high) in enumerate(bounds, 1)})


def alone(function: Callable[[Floats], Floats]) -> Callable[[Floats], Responses]:
    return lambda x: {"f": function(x)}


def branin(x: Floats) -> Floats:
    a, b = x[:, 0], x[:, 1]
    return (b - 5.1 / (4 * PI**2) * a**2 + 5 / PI * a - 6) ** 2 + 10 * (1 - 1 / (8 * PI)) * np.cos(a) + 10


def camel(x: Floats) -> Floats:
    a, b = x.T
    return (4 - 2.1 * a**2 + a**4 / 3) * a**2 + a * b + (4 * b**2 - 4) * b**2


def goldstein_log(x: Floats) -> Floats:
    a, b = x.T
    left = 1 + (a + b + 1) ** 2 * (19 - 14 * a + 3 * a**2 - 14 * b + 6 * a * b + 3 * b**2)
    right = 30 + (2 * a - 3 * b) ** 2 * (18 - 32 * a + 12 * a**2 + 48 * b - 36 * a * b + 27 * b**2)
    return np.log(left * right)


H_A = np.array(
    [
        [10, 3, 17, 3.5, 1.7, 8],
        [0.05, 10, 17, 0.1, 8, 14],
        [3, 3.5, 1.7, 10, 17, 8],
        [17, 8, 0.05, 10, 0.1, 14],
    ]
)
H_P = 1e-4 * np.array(
    [
        [1312, 1696, 5569, 124, 8283, 5886],
        [2329, 4135, 8307, 3736, 1004, 9991],
        [2348, 1451, 3522, 2883, 3047, 6650],
        [4047, 8828, 8732, 5743, 1091, 381],
    ]
)


def hartmann(x: Floats) -> Floats:
    return -(np.array([1, 1.2, 3, 3.2]) * np.exp(-(H_A * (x[:, None] - H_P) ** 2).sum(axis=2))).sum(axis=1)


def rosenbrock(x: Floats) -> Floats:
    return (100 * (x[:, 1:] - x[:, :-1] ** 2) ** 2 + (1 - x[:, :-1]) ** 2).sum(axis=1)


def bowl(x: Floats) -> Floats:
    i = np.arange(1, 13)
    middle = 0.3 + 0.4 * np.sin(i) ** 2
    square = ((0.3 + i / 12) * (x - middle) ** 2).sum(axis=1)
    return square + 0.15 * (x[:, :-1] * x[:, 1:]).sum(axis=1) + 0.2 * np.exp(x[:, 0] + x[:, 5])


def levy(x: Floats) -> Floats:
    w = 1 + (x - 1) / 4
    middle = ((w[:, :-1] - 1) ** 2 * (1 + 10 * np.sin(PI * w[:, :-1] + 1) ** 2)).sum(axis=1)
    return np.sin(PI * w[:, 0]) ** 2 + middle + (w[:, -1] - 1) ** 2 * (1 + np.sin(2 * PI * w[:, -1]) ** 2)


def styblinski(x: Floats) -> Floats:
    return 0.5 * (x**4 - 16 * x**2 + 5 * x).sum(axis=1)


def ackley(x: Floats) -> Floats:
    wide = -20 * np.exp(-0.2 * np.sqrt((x**2).mean(axis=1)))
    return wide - np.exp(np.cos(2 * PI * x).mean(axis=1)) + 20 + np.e


def griewank(x: Floats) -> Floats:
    return 1 + (x**2).sum(axis=1) / 4000 - np.prod(np.cos(x / np.sqrt(np.arange(1, x.shape[1] + 1))), axis=1)


def gramacy(x: Floats) -> Responses:
    a, b = x.T
    return {
        "f": a + b,
        "c1": 1.5 - a - 2 * b - 0.5 * np.sin(2 * PI * (a**2 - 2 * b)),
        "c2": a**2 + b**2 - 1.5,
    }


def townsend(x: Floats) -> Responses:
    a, b = x.T
    t = np.arctan2(a, b)
    edge = 2 * np.cos(t) - 0.5 * np.cos(2 * t) - 0.25 * np.cos(3 * t) - 0.125 * np.cos(4 * t)
    return {
        "f": -(np.cos((a - 0.1) * b) ** 2) - a * np.sin(3 * a + b),
        "g": a**2 + b**2 - edge**2 - (2 * np.sin(t)) ** 2,
    }


def gardner(x: Floats) -> Responses:
    a, b = x.T
    return {"f": np.cos(2 * a) * np.cos(b) + np.sin(a), "g": np.cos(a + b) + 0.5}


def welded_beam(x: Floats) -> Responses:
    h, l, t, b = x.T
    load, length, young, shear = 6000.0, 14.0, 30e6, 12e6
    first = load / (np.sqrt(2) * h * l)
    arm = np.sqrt(l**2 / 4 + ((h + t) / 2) ** 2)
    polar = 2 * np.sqrt(2) * h * l * (l**2 / 12 + ((h + t) / 2) ** 2)
    second = load * (length + l / 2) * arm / polar
    slender = 1 - t / (2 * length) * np.sqrt(young / (4 * shear))
    return {
        "cost": 1.10471 * h**2 * l + 0.04811 * t * b * (14 + l),
        "tau": np.sqrt(first**2 + first * second * l / arm + second**2),
        "sigma": 6 * load * length / (b * t**2),
        "delta": 4 * load * length**3 / (young * t**3 * b),
        "buckling": 4.013 * young * np.sqrt(t**2 * b**6 / 36) / length**2 * slender,
    }


def spring(x: Floats) -> Responses:
    d, coil, turns = x.T
    bend = (4 * coil**2 - d * coil) / (12566 * (coil * d**3 - d**4))
    return {
        "w": (turns + 2) * coil * d**2,
        "g1": 1 - coil**3 * turns / (71785 * d**4),
        "g2": bend + 1 / (5108 * d**2) - 1,
        "g3": 1 - 140.45 * d / (coil**2 * turns),
    }


def branin_failing(x: Floats) -> Responses:
    fails = ((x[:, 0] - 3.5) ** 2 + (x[:, 1] - 3) ** 2 < 4) | (x[:, 0] > 8)
    return {"f": np.where(fails, np.nan, branin(x))}


def failing(x: Floats) -> Responses:
    f = ((x - 0.62) ** 2 * np.array([1, 2, 3, 1.5, 2.5])).sum(axis=1) + 0.3 * np.sin(3 * x[:, 0] * x[:, 1])
    return {"f": np.where(x.sum(axis=1) > 2.7, np.nan, f)}


def three_branins(x: Floats) -> Floats:
    c = x[:, 2]
    moved = np.column_stack([x[:, 0] + 1.5 * (c == 1) - 2 * (c == 2), x[:, 1] - 1.0 * (c == 2)])
    return branin(moved) + np.array([6.0, 0.0, 3.0])[c.astype(int)] + 0.5 * x[:, 1] * (c == 1)


def mixed(x: Floats) -> Floats:
    a, b, n, m = x.T
    smooth = (a - 0.3 * n / 4) ** 2 + (b - 0.55) ** 2 * (1 + m)
    return smooth + 0.1 * (n - 3) ** 2 + 0.3 * (m - 2.3) ** 2 + 0.2 * a * b * n


def pressure_vessel(x: Floats) -> Responses:
    shell, head, r, l = x.T
    cost = 0.6224 * shell * r * l + 1.7781 * head * r**2 + 3.1661 * shell**2 * l + 19.84 * shell**2 * r
    return {"cost": cost, "volume": PI * r**2 * l + 4 / 3 * PI * r**3}


def speed_reducer(x: Floats) -> Responses:
    b, m, z, l1, l2, d1, d2 = x.T
    gears = 0.7854 * b * m**2 * (3.3333 * z**2 + 14.9334 * z - 43.0934)
    shafts = 7.4777 * (d1**3 + d2**3) - 1.508 * b * (d1**2 + d2**2) + 0.7854 * (l1 * d1**2 + l2 * d2**2)
    return {
        "w": gears + shafts,
        "g1": 27 / (b * m**2 * z),
        "g2": 397.5 / (b * m**2 * z**2),
        "g3": 1.93 * l1**3 / (m * z * d1**4),
        "g4": 1.93 * l2**3 / (m * z * d2**4),
        "g5": np.sqrt((745 * l1 / (m * z)) ** 2 + 16.9e6) / (110 * d1**3),
        "g6": np.sqrt((745 * l2 / (m * z)) ** 2 + 157.5e6) / (85 * d2**3),
        "g7": m * z / 40,
        "g8": 5 * m / b,
        "g9": b / (12 * m),
        "g10": (1.5 * d1 + 1.9) / l1,
        "g11": (1.1 * d2 + 1.9) / l2,
    }


def wing_weight(x: Floats) -> Floats:
    area, fuel, aspect, sweep, q, taper, thick, load, gross, paint = x.T
    cos = np.cos(np.radians(sweep))
    wing = 0.036 * area**0.758 * fuel**0.0035 * (aspect / cos**2) ** 0.6 * q**0.006 * taper**0.04
    return wing * (100 * thick / cos) ** -0.3 * (load * gross) ** 0.49 + area * paint


def three_bars(x: Floats) -> Responses:
    a, b = x.T
    root = np.sqrt(2)
    shared = root * a**2 + 2 * a * b
    return {
        "v": (2 * root * a + b) * 100,
        "s1": 2 * (root * a + b) / shared,
        "s2": 2 * b / shared,
        "s3": 2 / (root * b + a),
    }


def reactor(x: Floats) -> Responses:
    a, b, c = x.T
    return {
        "y1": 60 + 15 * a - 10 * a**2 + 8 * b * c - 6 * b**2 + 3 * np.sin(2 * c),
        "y2": 20 + 8 * np.exp(0.6 * a) - 5 * b + 4 * c**2,
    }


SIXTEENTHS = tuple(0.0625 * i for i in range(1, 33))
CASES = {
    "branin": Case(box((-5, 10), (0, 15)), alone(branin), 14, 0.39788735772973816),
    "camel": Case(box((-3, 3), (-2, 2)), alone(camel), 14, -1.031628453489877),
    "goldstein_log": Case(box((-2, 2), (-2, 2)), alone(goldstein_log), 14, float(np.log(3))),
    "hartmann6": Case(box(*[(0, 1)] * 6), alone(hartmann), 42, -3.322368011391339),
    "rosenbrock5": Case(box(*[(-2, 2)] * 5), alone(rosenbrock), 36, 0.0),
    "bowl12": Case(box(*[(0, 1)] * 12), alone(bowl), 40, 0.6605934179704708),
    "levy4": Case(box(*[(-5, 5)] * 4), alone(levy), 30, 0.0),
    "styblinski4": Case(box(*[(-5, 5)] * 4), alone(styblinski), 30, -156.6646628150857),
    "ackley3": Case(box(*[(-2, 3)] * 3), alone(ackley), 20, 0.0),
    "griewank3": Case(box(*[(-5, 6)] * 3), alone(griewank), 20, 0.0),
    "gramacy": Case(
        box((0, 1), (0, 1)), gramacy, 14, 0.5997880515365337, "f", ("c1 <= 0", "c2 <= 0"), ("f", "c1", "c2")
    ),
    "townsend": Case(
        box((-2.25, 2.25), (-2.5, 1.75)), townsend, 14, -2.0239883647416472, "f", ("g <= 0",), ("f", "g")
    ),
    "gardner": Case(box((0, 6), (0, 6)), gardner, 14, -1.8887513616915566, "f", ("g <= 0",), ("f", "g")),
    "welded_beam": Case(
        Space(h=(0.125, 2.0), l=(0.5, 8.0), t=(2.0, 10.0), b=(0.125, 2.0)),
        welded_beam,
        30,
        1.7248522821557093,
        "cost",
        ("tau <= 13600", "sigma <= 30000", "delta <= 0.25", "buckling >= 6000", "h <= b"),
        ("cost", "tau", "sigma", "delta", "buckling"),
    ),
    "spring": Case(
        Space(d=(0.05, 0.2), coil=(0.25, 1.3), turns=(2.0, 15.0)),
        spring,
        20,
        0.012665232757508253,
        "w",
        ("g1 <= 0", "g2 <= 0", "g3 <= 0", "(coil + d)/1.5 <= 1"),
        ("w", "g1", "g2", "g3"),
    ),
    "branin_failing": Case(box((-5, 10), (0, 15)), branin_failing, 14, 0.39788735772973816),
    "failing5": Case(box(*[(0, 1)] * 5), failing, 36, 0.24768190549377178),
    "three_branins": Case(
        Space([Factor("x1", -5, 10), Factor("x2", 0, 15), Factor("c", levels=("a", "b", "c"))]),
        alone(three_branins),
        24,
        1.4650741555613096,
    ),
    "mixed4": Case(
        Space(
            [
                Factor("a", 0, 1),
                Factor("b", 0, 1),
                Factor("n", 1, 8, integer=True),
                Factor("m", levels=(0.5, 1.0, 2.0, 3.0, 4.5)),
            ]
        ),
        alone(mixed),
        30,
        0.07391365979381444,
    ),
    "pressure_vessel": Case(
        Space(
            [
                Factor("shell", levels=SIXTEENTHS),
                Factor("head", levels=SIXTEENTHS),
                Factor("r", 10, 60),
                Factor("l", 10, 200),
            ]
        ),
        pressure_vessel,
        30,
        6059.714328127592,
        "cost",
        ("0.0193*r <= shell", "0.00954*r <= head", "volume >= 1296000"),
        ("cost", "volume"),
    ),
    "speed_reducer": Case(
        Space(
            [
                Factor("b", 2.6, 3.6),
                Factor("m", 0.7, 0.8),
                Factor("z", 17, 28, integer=True),
                Factor("l1", 7.3, 8.3),
                Factor("l2", 7.3, 8.3),
                Factor("d1", 2.9, 3.9),
                Factor("d2", 5.0, 5.5),
            ]
        ),
        speed_reducer,
        44,
        2994.471065709123,
        "w",
        tuple(f"g{i} <= 1" for i in range(1, 12)),
        ("w", *[f"g{i}" for i in range(1, 12)]),
    ),
    "wing_weight": Case(
        box(
            (150, 200),
            (220, 300),
            (6, 10),
            (-10, 10),
            (16, 45),
            (0.5, 1),
            (0.08, 0.18),
            (2.5, 6),
            (1700, 2500),
            (0.025, 0.08),
        ),
        alone(wing_weight),
        66,
        123.2536717009832,
    ),
    "three_bars": Case(
        box((0.1, 1), (0.1, 1)),
        three_bars,
        14,
        263.89584329260333,
        "v",
        ("s1 <= 2", "s2 <= 2", "s3 <= 2"),
        ("v", "s1", "s2", "s3"),
    ),
    "target": Case(
        box(*[(-1.5, 1.5)] * 3),
        reactor,
        20,
        2.4142448252515583,
        "abs(y1 - 62)/10 + max(y2 - 25, 0) + 0.1*y2",
        (),
        ("y1", "y2"),
    ),
}
