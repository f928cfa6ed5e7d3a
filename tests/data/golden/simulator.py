"""Closed forms that stand in for simulators in the studies of ``tests/golden_scenarios.py``."""

import math
import os
import random
import time


def process(temp_C, time_h):
    """A chemical process: a ridge with curvature that no quadratic follows exactly."""
    t, h = (temp_C - 50) / 30, (time_h - 3) / 2
    return {
        "yield_pct": 80 - 6 * (t - 0.3) ** 2 - 4 * (h + 0.2) ** 2 + 2 * t * h + 1.5 * math.exp(0.8 * t * h),
        "cost_eur": 10 + 3 * t + 2 * h + 0.5 * t * t * h,
        "purity": 0.9 + 0.05 * math.tanh(t - h),
        "remark": "not asked for",
    }


def waste(temp_C, time_h):
    """A cheap function of the factors, of numbers or of arrays."""
    return 0.02 * temp_C * time_h


def beam(width_mm, ribs, gauge_mm, material, load_N):
    """A ribbed beam: one factor of each kind, and a setting."""
    density, modulus = {"steel": (7.85, 210.0), "aluminium": (2.70, 70.0), "titanium": (4.50, 110.0)}[
        material
    ]
    inertia = width_mm * (20 + gauge_mm) ** 3 / 12 * (1 + 0.15 * ribs)
    return {
        "mass_kg": density * width_mm * (gauge_mm + 0.8 * ribs) / 1000,
        "sag_mm": load_N * 3e3 / (modulus * inertia) * 100,
    }


def steep(x, y):
    """Positive, and steep in x: a transformed response or a stretched factor describes it better."""
    return {
        "load": math.exp(1.4 * x) * (1.5 + 0.4 * y + 0.3 * y * y) / (1.6 + 0.5 * x * y),
        "area": 2 + x + y,
    }


def troubled(x, y):
    """Raises, returns no number, or takes its process with it, each at a corner of the box."""
    if x > 0.9 and y > 0.9:
        raise ValueError("the mesh folds over")
    if x > 0.9 and y < -0.9:
        return {"load": math.nan, "area": 1.0}
    if x < -0.9 and y < -0.9:
        os._exit(3)
    return steep(x, y)


def slow(x, y):
    """Does not come back at one corner of the box."""
    if x < -0.9 and y < -0.9:
        time.sleep(300)
    return steep(x, y)


def noisy(x, y, seed):
    """The same point twice is not the same number twice."""
    return {"load": 3 + x - y + x * x + 0.1 * random.Random(seed).gauss(0, 1)}


def arrays(x, y):
    """Many runs in one call."""
    return {"load": 3 + x - y + x * x + 0.5 * y**3, "area": 2 + x + y}


def spiral(space, runs, rng):
    """A design of one's own."""
    turns = [(0.9 * i / runs, 2.4 * i + rng.random()) for i in range(runs)]
    coded = [[r * math.cos(a), r * math.sin(a)] for r, a in turns]
    return space.decode(coded)
