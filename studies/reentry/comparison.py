"""Tables 7 to 9 of the paper with our numbers beside them, and what the comparison leads to."""

from __future__ import annotations

import math
import shutil
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import fly
import numpy as np
import pandas as pd
import printed
from conditions import frame, percent

from rsmkit import (
    Confirmation,
    Optimum,
    SearchOptions,
    Space,
    Study,
    StudyFolder,
    Surface,
    SurfaceOptions,
    build_problem,
    choose_surface,
    evaluate_design,
    fit_study,
    load_study,
    nondominated,
    parse_expression,
    plan_design,
    refine_study,
    search_problem,
    verify_study,
)
from rsmkit.language.space import Floats
from rsmkit.stages.fit import FitResult, surface_problem
from rsmkit.stages.planning.plan import PlanResult
from rsmkit.verification.refinement.refinement import Refinement
from sim import History, evaluate, reentry

OBJECTIVES = ("table1", "table9", "normalised")
FACTORS = tuple(printed.BOUNDS)
SYMBOLS = ("thetac1", "thetac2", "Rn")
SURFACES = {
    "second order": SurfaceOptions(),
    "second order, stretched": SurfaceOptions(model="stretched"),
    "third order": SurfaceOptions(order=3),
    "Gaussian process": SurfaceOptions(model="gaussian process"),
}


@dataclass(frozen=True, eq=False)
class Reproduction:
    """The study run from plan to verification, and the flights kept in ``flights/``."""

    study: Study
    plan: PlanResult
    fit: FitResult
    checks: dict[str, Confirmation]
    refinements: dict[str, Refinement]

    @cached_property
    def ga(self) -> dict[str, dict[str, Any]]:
        """The direct genetic algorithm by objective."""
        return {name: fly.load_ga(name) for name in OBJECTIVES}

    @cached_property
    def front(self) -> pd.DataFrame:
        """Pareto front of F1, F2, F3 found by NSGA-II on the simulator."""
        return fly.load_table("front")

    @property
    def space(self) -> Space:
        """The three design variables."""
        return self.study.space

    @cached_property
    def optima(self) -> dict[str, Optimum]:
        """Optima on the surfaces by objective."""
        return {optimum.name: optimum for optimum in self.fit.optima}

    def predict(self, name: str, points: Floats) -> Floats:
        """Objective of a search on the surfaces, at natural points (n, 3)."""
        return surface_problem(self.study, self.fit.surfaces, name).evaluate(points).objectives[:, 0]

    @cached_property
    def settings(self) -> dict[str, Any]:
        """What every flight receives besides its design."""
        return dict(self.study.file.simulator.settings if self.study.file.simulator else {})

    def fly(self, factors: dict[str, Any]) -> dict[str, float]:
        """Responses of one design."""
        return evaluate(**factors, **self.settings)

    def value(self, name: str, factors: dict[str, Any]) -> float:
        """Objective of a search at one design, flown."""
        flown = {response: np.array([value]) for response, value in self.fly(factors).items()}
        return float(parse_expression(self.ga[name]["minimize"])(flown)[0])

    def history(self, factors: dict[str, Any]) -> History:
        """The whole flight of one design."""
        return reentry.fly(**factors, **self.settings)


def reproduce(source: Path = fly.STUDY) -> Reproduction:
    """Run the four stages in a folder of their own, with the normalised objective added to the searches."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        shutil.copy(source / "study.toml", folder)
        text = fly.load_ga("normalised")["minimize"]
        with (folder / "study.toml").open("a", encoding="utf-8") as file:
            file.write(
                f'\n[[search]]\nname = "normalised"\nminimize = "{text}"\n'
                'subject_to = ["tangency_margin_m >= 0"]\nseed = 1\n'
            )
        study = load_study(folder)
        verify = replace(study.file.verify, searches=OBJECTIVES)
        study = replace(study, file=replace(study.file, verify=verify))
        kept = StudyFolder(study)
        plan = plan_design(kept)
        evaluate_design(kept)
        fit = fit_study(kept)
        checks = {check.name: check for check in verify_study(kept).verification.searches}
        refinements = refine_study(kept).refinements
    return Reproduction(study, plan, fit, checks, refinements)


def surface_quality(done: Reproduction) -> pd.DataFrame:
    """Root mean square error over unseen flights, in per cent of the range of each response."""
    unseen = fly.load_table("holdout")
    rows = []
    for label in SURFACES:
        errors = []
        for name, surface in surfaces(done, label).items():
            truth = unseen[name].to_numpy()
            error = surface.predict(unseen[list(FACTORS)]) - truth
            errors.append(100 * float(np.sqrt((error**2).mean()) / np.ptp(truth)))
        rows.append((label, *errors))
    return frame(rows, ("surface", "F1 %", "F2 %", "F3 %"))


@cache
def surfaces(done: Reproduction, label: str) -> dict[str, Surface]:
    """One kind of surface for every response, on the flights of the study's own design."""
    points = done.fit.runs.points
    flown = {name: done.fit.runs.y(name) for name in fly.RESPONSES}
    return _fit(done, points, flown, SURFACES[label])


def terms(weights: tuple[float, float, float], responses: Floats) -> Floats:
    """Share of each weighted term in the sum, per cent."""
    parts = np.array(weights) * responses
    return np.asarray(100 * parts / parts.sum())


def shares(done: Reproduction) -> pd.DataFrame:
    """How much of each objective its three terms carry, in the paper and at our optima."""
    row = np.array([float(value) for value in printed.PARETO[printed.GA_ROW][:3]])
    middle = done.ga["normalised"]["minimize"]
    rows = []
    for name, weights in (("table1", printed.WEIGHTS_TABLE_1), ("table9", printed.WEIGHTS_TABLE_9)):
        rows.append((name, "printed GA optimum", *terms(weights, row)))
        rows.append((name, "our direct GA optimum", *terms(weights, _responses(done.ga[name]["polished"]))))
    baseline = np.array([float(part.split("/")[1]) for part in middle.split(" + ")])
    scaled = _responses(done.ga["normalised"]["polished"]) / baseline
    rows.append(("normalised", "mid-box design", *terms(printed.WEIGHTS_TABLE_1, np.ones(3))))
    rows.append(("normalised", "our direct GA optimum", *terms(printed.WEIGHTS_TABLE_1, scaled)))
    return frame(rows, ("objective", "at", "F1 %", "F2 %", "F3 %"))


def optimum_differences(done: Reproduction) -> pd.DataFrame:
    """Table 8: optimum of the direct GA against that of the surfaces, in each variable.

    ``Diff%`` is the paper's, 100 |RSM - GA| / GA of the angle in radians; degrees give the same.
    """
    rows = [
        _places("printed", printed.GA_OPTIMUM, printed.RSM_OPTIMUM, printed.OPTIMUM_DIFFERENCE_PCT),
        *(
            _places(name, _radians(done.ga[name]["polished"]["factors"]), _radians(done.optima[name].factors))
            for name in OBJECTIVES
        ),
    ]
    return pd.concat(rows, ignore_index=True)


def objective_differences(done: Reproduction) -> pd.DataFrame:
    """Table 9: objective predicted by the surfaces at their optimum, flown there, and at the GA's optimum."""
    calculated, real = float(printed.CALCULATED_VALUE), float(printed.REAL_VALUE)
    rows: list[tuple[Any, ...]] = [
        ("printed", calculated, real, printed.VALUE_DIFFERENCE_PCT, math.nan, math.nan, math.nan, math.nan),
        (
            "printed, as we read it",
            math.nan,
            real,
            math.nan,
            calculated,
            percent(real, calculated),
            math.nan,
            math.nan,
        ),
    ]
    for name in OBJECTIVES:
        objective, best = done.checks[name].objective, done.ga[name]["polished"]
        rows.append(
            (
                name,
                objective.predicted,
                objective.actual,
                objective.error_pct,
                best["objective"],
                percent(objective.actual, best["objective"]),
                len(done.fit.runs) + 1,
                best["flights"],
            )
        )
    columns = (
        "objective",
        "calculated",
        "real (RSM)",
        "Diff%",
        "real (GA)",
        "RSM worse than GA %",
        "RSM flights",
        "GA flights",
    )
    return frame(rows, columns)


@cache
def pareto_rows(done: Reproduction) -> pd.DataFrame:
    """Table 7: the printed rows, columns put right, what our simulator says there, and our front."""
    rows = []
    for number, (f1, f2, f3, *place) in enumerate(printed.PARETO, start=1):
        label = f"printed {number}" + (" (GA)" if number == printed.GA_ROW + 1 else "")
        rows.append((label, float(f1), float(f2), float(f3), *place))
    for number, (_, _, _, *place) in enumerate(printed.PARETO, start=1):
        flown = done.fly(degrees(place))
        rows.append((f"printed {number}, flown here", *(flown[r] for r in fly.RESPONSES), *place))
    best = done.ga["table1"]["polished"]
    rows.append(("our GA", *_responses(best), *_radians(best["factors"])))
    for _, row in done.front[done.front["label"].notna()].iterrows():
        label = "our front: " + row["label"].replace("_integral", "").replace("margin_inverse", "margin")
        rows.append((label, *(row[r] for r in fly.RESPONSES), *_radians(row)))
    return frame(rows, ("point", "F1", "F2", "F3", *(f"{s} (rad)" for s in SYMBOLS[:2]), "Rn (m)"))


def front_around(done: Reproduction) -> dict[str, int]:
    """Where the GA's optimum stands: how many points of the front dominate it, or are dominated by it."""
    front = done.front[list(fly.RESPONSES)].to_numpy()
    best = _responses(done.ga["table1"]["polished"])
    return {
        "points": len(front),
        "dominate": int((front <= best).all(axis=1).sum()),
        "dominated": int((front >= best).all(axis=1).sum()),
        "on_joint_front": int(len(front) in nondominated(np.vstack([front, best]))),
    }


@cache
def star_points(done: Reproduction) -> pd.DataFrame:
    """Cost of where the star points lie: second-order surfaces of six designs."""
    rows = []
    for (star, runs), design in fly.load_table("designs").groupby(["star", "runs"], sort=False):
        rows.append((star, runs, *_trial(done, design, SurfaceOptions())))
    return frame(rows, ("stars", "runs", *TRIAL))


@cache
def models(done: Reproduction) -> pd.DataFrame:
    """Tables 8 and 9 with other surfaces than the study's, on the same flights."""
    rows: list[tuple[Any, ...]] = [
        ("printed", "not said", *printed.OPTIMUM_DIFFERENCE_PCT, 8.194, printed.VALUE_DIFFERENCE_PCT, "")
    ]
    for name in OBJECTIVES:
        best = done.ga[name]["polished"]
        for label in SURFACES:
            found = _optimum(done, surfaces(done, label), name)
            real = done.value(name, found.factors)
            shifts = [abs(percent(found.factors[key], best["factors"][key])) for key in FACTORS]
            worse, off = percent(real, best["objective"]), abs(percent(found.best.objectives[0], real))
            met = (max(shifts) <= 1.0 or worse <= 0.1) and off <= 1.0
            rows.append((name, label, *shifts, worse, off, "yes" if met else "no"))
    columns = ("objective", "surface", *(f"{s} Diff%" for s in SYMBOLS), "RSM worse than GA %")
    return frame(rows, (*columns, "Table 9's Diff%", "both within the bar"))


TRIAL = ("rms error %", "largest error %", "Table 9's Diff%", "RSM worse than GA %")


def _trial(done: Reproduction, design: pd.DataFrame, options: SurfaceOptions) -> tuple[float, ...]:
    """Error over unseen flights in per cent of their range, and at the optimum; Table 1's objective."""
    unseen, weights = fly.load_table("holdout"), np.array(printed.WEIGHTS_TABLE_1)
    points = design[list(FACTORS)].to_numpy()
    fitted = _fit(done, points, {name: design[name].to_numpy() for name in fly.RESPONSES}, options)
    truth = unseen[list(fly.RESPONSES)].to_numpy() @ weights
    predicted = [fitted[name].predict(unseen[list(FACTORS)]) for name in fly.RESPONSES]
    error = 100 * (weights @ np.array(predicted) - truth) / np.ptp(truth)
    found = _optimum(done, fitted, "table1")
    real = done.value("table1", found.factors)
    return (
        float(np.sqrt((error**2).mean())),
        float(np.abs(error).max()),
        abs(percent(found.best.objectives[0], real)),
        percent(real, done.ga["table1"]["polished"]["objective"]),
    )


def _fit(
    done: Reproduction, points: Floats, flown: Mapping[str, Floats], options: SurfaceOptions
) -> dict[str, Surface]:
    return {
        name: choose_surface(done.space, points, y, response=name, options=options).surface
        for name, y in flown.items()
    }


def simulations() -> pd.DataFrame:
    """Flights to within 0.1 % of the true optimum, over the seeds of ``benchmarks/search_reentry.py``."""
    rows = []
    table = pd.DataFrame(fly.load_simulations()["searches"])
    for (name, method), found in table.groupby(["objective", "method"], sort=False):
        reached = found.dropna(subset="flights_to_target")
        flights = reached["flights_to_target"]
        rows.append(
            (
                name,
                method,
                f"{len(reached)} of {len(found)}",
                float(flights.median()),
                float(flights.max()),
                float(reached["waves_to_target"].median()),
            )
        )
    columns = (
        "objective",
        "method",
        "seeds there",
        "flights, median",
        "flights, most",
        "waves of 16, median",
    )
    return frame(rows, columns)


def true_optima() -> pd.DataFrame:
    """What the exhaustive search of ``benchmarks/search_reentry.py`` found."""
    rows = [
        (
            name,
            *_radians(found["factors"]),
            f"{found['objective']:.9g}",
            f"{found['grid_best']:.9g}",
            found["flights"],
        )
        for name, found in fly.load_simulations()["optima"].items()
    ]
    places = [f"{s} (rad)" for s in SYMBOLS[:2]]
    return frame(rows, ("objective", *places, "Rn (m)", "true optimum", "best of the grid", "flights"))


def refinements(done: Reproduction) -> pd.DataFrame:
    """What a few flights more around the surfaces' optimum bring (``rsmkit verify --refine``)."""
    rows = []
    for name, found in done.refinements.items():
        reached, best = float(found.best.objectives[0, 0]), done.ga[name]["polished"]
        within = [start for start, value in _progress(found) if value <= 1.001 * best["objective"]]
        rows.append(
            (
                name,
                *_radians(dict(zip(FACTORS, found.best.points[0], strict=True))),
                percent(reached, best["objective"]),
                within[0] if within else math.nan,
                found.start_runs + found.runs,
                _ga_flights(done.ga[name]),
                best["flights"],
            )
        )
    columns = (
        "objective",
        "thetac1 (rad)",
        "thetac2 (rad)",
        "Rn (m)",
        "worse than GA %",
        "flights to 0.1 %",
        "flights in all",
        "GA flights to 0.1 %",
        "GA flights in all",
    )
    return frame(rows, columns)


def _ga_flights(found: dict[str, Any]) -> float:
    """Flights of the genetic algorithm until it was within 0.1 %; nan when only the polish got there."""
    history, best = found["history"], 1.001 * found["polished"]["objective"]
    reached = [n for n, value in zip(history["evaluations"], history["best"], strict=True) if value <= best]
    return float(reached[0]) if reached else math.nan


def _progress(found: Refinement) -> list[tuple[int, float]]:
    """Flights spent and best objective so far, before the refinement and after every wave."""
    gains = [0.0 if math.isnan(wave.gain) else wave.gain for wave in found.waves]
    flights, best = found.start_runs, float(found.best.objectives[0, 0]) + sum(gains)
    steps = [(flights, best)]
    for wave in found.waves:
        flights += len(wave.points)
        steps.append((flights, wave.best))
    return steps


def degrees(place: Any) -> dict[str, float]:
    """A printed place (rad, rad, m) as the simulator takes it."""
    theta_c1, theta_c2, radius = place
    values = (math.degrees(theta_c1), math.degrees(theta_c2), radius)
    return dict(zip(FACTORS, values, strict=True))


def drift(done: Reproduction, rows: int = 3) -> float:
    """Largest relative difference between kept flights and the same flights flown now."""
    kept = fly.load_table("holdout").head(rows)
    worst = 0.0
    for _, row in kept.iterrows():
        now = done.fly({name: float(row[name]) for name in FACTORS})
        worst = max(worst, *(abs(now[name] / row[name] - 1) for name in fly.RESPONSES))
    return worst


def _optimum(done: Reproduction, surfaces: Mapping[str, Surface], name: str) -> Optimum:
    text = done.ga[name]["minimize"]
    problem = build_problem(
        done.space,
        text,
        lambda points: {name: surface.predict(points) for name, surface in surfaces.items()},
        responses=fly.RESPONSES,
    )
    return search_problem(problem, SearchOptions(minimize=text, preset="fast"))


def _places(
    label: str, ga: tuple[float, ...], rsm: tuple[float, ...], difference: tuple[float, ...] | None = None
) -> pd.DataFrame:
    ranges = [math.radians(5.0), math.radians(5.0), 0.15]
    rows = []
    for j, symbol in enumerate(("thetac1 (rad)", "thetac2 (rad)", "Rn (m)")):
        pct = difference[j] if difference else abs(percent(rsm[j], ga[j]))
        rows.append((label, symbol, ga[j], rsm[j], pct, 100 * abs(rsm[j] - ga[j]) / ranges[j]))
    return frame(rows, ("objective", "variable", "GA", "RSM", "Diff%", "% of its range"))


def _responses(place: dict[str, Any]) -> Floats:
    return np.array([place["responses"][name] for name in fly.RESPONSES])


def _radians(factors: Any) -> tuple[float, float, float]:
    theta_c1, theta_c2, radius = (float(factors[name]) for name in FACTORS)
    return math.radians(theta_c1), math.radians(theta_c2), radius
