"""Simulations to the true optimum of the re-entry vehicle: refinement against the direct genetic algorithm.

Every method is judged by the number of different flights until one lies within 0.1 % of the best objective
that any method found with any seed. Run: python benchmarks/search_reentry.py [seeds]
"""

from __future__ import annotations

import sys

import numpy as np

from rsmkit.design.build import build_design
from rsmkit.design.options import DesignOptions
from rsmkit.optimum.cache import CachedEvaluator
from rsmkit.optimum.options import SearchOptions
from rsmkit.optimum.problem import build_problem
from rsmkit.space import Space
from rsmkit.verification.comparison import runs_to_reach, search_directly, summarise_runs
from rsmkit.verification.options import RefineOptions
from rsmkit.verification.refine import refine
from sim.reentry import evaluate, tangency_margin_m

SPACE = Space(theta_c1_deg=(5.0, 10.0), theta_c2_deg=(10.0, 15.0), nose_radius_m=(0.15, 0.30))
SETTINGS = {
    "speed_m_s": 4300.0,
    "altitude_m": 82000.0,
    "theta_deg": -15.0,
    "nu_deg": 15.0,
    "alpha_deg": 30.0,
    "preset": "paper",
    "blend": [4.5, 5.5],
    "length_1_m": 1.60,
    "length_2_m": 0.40,
    "length_3_m": 0.70,
    "mass_kg": 1000.0,
    "cg_fraction": 0.55,
}
RESPONSES = ("axial_integral", "heat_integral", "margin_inverse")
OBJECTIVE = "0.2*axial_integral + 0.7*heat_integral + 0.1*margin_inverse"


def flights(points):
    runs = [evaluate(**SPACE.values(point), **SETTINGS) for point in points]
    return {name: np.array([run[name] for run in runs]) for name in RESPONSES}


def margin(points):
    return np.array([tangency_margin_m(**SPACE.values(point)) for point in points])


def problem(evaluator):
    return build_problem(
        SPACE,
        OBJECTIVE,
        evaluator,
        responses=RESPONSES,
        subject_to=["tangency_margin_m >= 0"],
        functions={"tangency_margin_m": margin},
    )


def refined(design, seed, batch):
    """True objectives in the order they were flown (inf outside the bounds), waves on 16 processors."""
    cached = CachedEvaluator(flights, SPACE)
    about = problem(cached)
    refine(about, about.evaluate(design), RefineOptions(batch=batch, max_runs=120 - len(design), seed=seed))
    history = about.evaluation(*cached.history())
    inside = SPACE.contains(history.points) & (history.margins >= 0).all(axis=1)
    return np.where(inside, history.objectives[:, 0], np.inf), cached.waves(16)


def main():
    seeds = list(range(1, 1 + int(sys.argv[1] if len(sys.argv) > 1 else 10)))
    fifty = build_design(SPACE, DesignOptions(center=1, augment_to=50)).points
    faced = build_design(SPACE, DesignOptions(star="inscribed", center=1)).points
    methods = {
        "50 points + refinement, 4 at a time": {s: refined(fifty, s, 4) for s in seeds},
        "CCD inside the bounds + refinement, 4 at a time": {s: refined(faced, s, 4) for s in seeds},
        "CCD inside the bounds + refinement, 1 at a time": {s: refined(faced, s, 1) for s in seeds},
    }
    for preset in ("fast", "paper") if len(seeds) > 3 else ("fast",):
        direct = search_directly(problem(flights), SearchOptions(OBJECTIVE, preset=preset), seeds)
        methods[f"direct GA, preset {preset}"] = {d.seed: (d.objectives, d.waves(16)) for d in direct}
    best = min(objectives.min() for runs in methods.values() for objectives, _ in runs.values())
    target = best + 1e-3 * abs(best)
    print(f"best objective {best:.10g}, target {target:.10g}, {len(seeds)} seeds")
    print("| method | success | median flights to 0.1 % | 90th percentile | flights in all | waves of 16 |")
    print("|---|---|---|---|---|---|")
    for name, runs in methods.items():
        found = summarise_runs(
            {seed: runs_to_reach(objectives, target) for seed, (objectives, _) in runs.items()}
        )
        total = np.median([len(objectives) for objectives, _ in runs.values()])
        waves = np.median([waves for _, waves in runs.values()])
        print(
            f"| {name} | {found['successes']}/{found['seeds']} | {found['median']} | {found['p90']} "
            f"| {total:.0f} | {waves:.0f} |"
        )


if __name__ == "__main__":
    main()
