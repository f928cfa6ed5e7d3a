"""The expensive results of this study, flown once and kept as small tables in ``flights/``.

    python studies/reentry/fly.py            # all of it: about 5,000 flights
    python studies/reentry/fly.py holdout    # or one or more of its parts

flies them again, a tenth of a second each on a quiet core; do so after any change of the simulator or of
``study.toml``. The notebook reads the tables and flies a few rows again to see that they still belong to the
simulator at hand.

- ``holdout.csv``: flights all over the box that no surface has seen
- ``designs.csv``: central composite designs with their stars in three places, with 17 and 50 runs
- ``ga-*.json``: the direct genetic algorithm, every individual a flight, 24 x 45 of them, for three scalar
  objectives
- ``front.csv``: NSGA-II on F1, F2, F3, likewise
- ``printed-optimum.json``: the surfaces' optimum in the second reading (``printed_optimum/study.toml``)
"""

from __future__ import annotations

import json
import math
import shutil
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from joblib import Parallel, delayed
from scipy.stats import qmc

from rsmkit import (
    Problem,
    SearchOptions,
    Study,
    StudyFolder,
    build_problem,
    evaluate_design,
    fit_study,
    load_study,
    plan_design,
    search_problem,
    verify_study,
)
from rsmkit.design.build import build_design
from rsmkit.io.files.atomic_files import write_text
from rsmkit.language.space import Floats
from rsmkit.optimum.local.local_search import LocalSearch
from rsmkit.optimum.local.polish import polish
from rsmkit.optimum.optimum import Candidate
from rsmkit.optimum.problem import Archive
from rsmkit.optimum.search import candidate_at
from rsmkit.study.user_functions import cheap_functions
from sim import evaluate

STUDY = Path(__file__).parent
TABLES = STUDY / "flights"
SECOND = STUDY / "printed_optimum" / "study.toml"
RESPONSES = ("axial_integral", "heat_integral", "margin_inverse")
STABILITY = "mean_static_margin"  # the study's constraint
STARS = ("circumscribed", "inscribed", "faced")
RUNS = (17, 50)
HOLDOUT = 128
DIGITS = 10  # kept of every number; the flights themselves are integrated to 7


def main() -> None:
    for part in sys.argv[1:] or PARTS:
        make(part)


def make(part: str) -> None:
    """Fly one part and write its table."""
    started = time.perf_counter()
    TABLES.mkdir(exist_ok=True)
    PARTS[part](load_study(STUDY))
    print(f"{part}: {time.perf_counter() - started:.0f} s", flush=True)


def fly_holdout(study: Study) -> None:
    points = study.space.decode(2.0 * qmc.Sobol(len(study.space), seed=7).random(HOLDOUT) - 1.0)
    _write("holdout.csv", _table(study, points))


def fly_designs(study: Study) -> None:
    _write("designs.csv", pd.concat([_design(study, star, runs) for star in STARS for runs in RUNS]))


def fly_table_1(study: Study) -> None:
    _direct_ga(study, "table1", str(study.searches[0].minimize))


def fly_table_9(study: Study) -> None:
    _direct_ga(study, "table9", str(study.searches[1].minimize))


def fly_normalised(study: Study) -> None:
    middle = _fly(study, study.space.decode(np.zeros((1, len(study.space)))))[0].tolist()
    text = normalised_objective(dict(zip(RESPONSES, middle, strict=True)))
    _direct_ga(study, "normalised", text)


def fly_front(study: Study) -> None:
    found = search_problem(
        direct_problem(study, RESPONSES),
        SearchOptions(minimize=RESPONSES, name="front", polish=False, seed=1),
    )
    rows = [{**study.space.values(c.point), **c.responses, "label": c.label} for c in found.front]
    _write("front.csv", pd.DataFrame(rows))


def fly_printed(study: Study) -> None:
    """The surfaces' optimum in the second reading, whose true one is the printed optimum."""
    with tempfile.TemporaryDirectory() as name:
        shutil.copy(SECOND, name)
        second = load_study(name)
        folder = StudyFolder(second)
        plan_design(folder)
        evaluate_design(folder)
        fit_study(folder)
        (check,) = verify_study(folder).verification.searches
    objective = check.objective
    place = {"predicted": objective.predicted, "actual": objective.actual or math.nan}
    factors = {name: _round(float(value)) for name, value in check.factors.items()}
    record = {"factors": factors, **{name: _round(value) for name, value in place.items()}}
    write_text(TABLES / "printed-optimum.json", json.dumps(record) + "\n")


PARTS = {
    "holdout": fly_holdout,
    "designs": fly_designs,
    "table1": fly_table_1,
    "table9": fly_table_9,
    "normalised": fly_normalised,
    "front": fly_front,
    "printed": fly_printed,
}


def normalised_objective(baseline: dict[str, float]) -> str:
    """The weights of Table 1 on responses over those of the mid-box design: 20 %, 70 % and 10 % there."""
    weights = dict(zip(RESPONSES, (0.2, 0.7, 0.1), strict=True))
    return " + ".join(f"{weights[name]}*{name}/{baseline[name]:.6g}" for name in RESPONSES)


def load_ga(name: str) -> dict[str, Any]:
    """What the direct genetic algorithm found for ``table1``, ``table9`` or ``normalised``."""
    return dict(json.loads((TABLES / f"ga-{name}.json").read_text(encoding="utf-8")))


def load_printed() -> dict[str, Any]:
    """The surfaces' optimum in the second reading: place, predicted and actual objective."""
    return dict(json.loads((TABLES / "printed-optimum.json").read_text(encoding="utf-8")))


def load_simulations() -> dict[str, Any]:
    """Flights to the true optimum over many seeds, from ``benchmarks/search_reentry.py``."""
    return dict(json.loads((TABLES / "simulations.json").read_text(encoding="utf-8")))


def load_table(name: str) -> pd.DataFrame:
    """One of ``front``, ``designs``, ``holdout``."""
    return pd.read_csv(TABLES / f"{name}.csv")


def direct_problem(study: Study, minimize: str | tuple[str, ...]) -> Problem:
    """The study's optimisation problem with the simulator in place of the surfaces."""
    return build_problem(
        study.space,
        minimize,
        lambda points: dict(zip((*RESPONSES, STABILITY), _fly(study, points, STABILITY).T, strict=True)),
        responses=(*RESPONSES, STABILITY),
        subject_to=study.searches[0].subject_to,
        functions=cheap_functions(study),
    )


def _direct_ga(study: Study, name: str, text: str) -> None:
    """The paper's scalar search: 24 x 45 flights, then a gradient search (its fmincon) from the best."""
    problem = direct_problem(study, text)
    found = search_problem(problem, SearchOptions(minimize=text, name=name, polish=False, seed=1))
    archive = Archive(problem)
    archive.evaluate(found.point[None])
    polished = candidate_at(polish(archive, LocalSearch(starts=1, step=0.005)), 0)
    record = {
        "minimize": text,
        "seed": found.seed,
        "genetic": _place(study, found.best, found.evaluations),
        "polished": _place(study, polished, found.evaluations + archive.count),
        "history": {key: [_round(v) for v in column] for key, column in found.history.items()},
    }
    write_text(TABLES / f"ga-{name}.json", json.dumps(record) + "\n")


def _design(study: Study, star: Any, runs: int) -> pd.DataFrame:
    options = replace(study.file.design, star=star, augment_to=runs)
    design = build_design(study.space, options)
    table = _table(study, design.points)
    table.insert(0, "kind", design.kinds)
    table.insert(0, "runs", runs)
    table.insert(0, "star", star)
    return table


def _table(study: Study, points: Floats) -> pd.DataFrame:
    return pd.DataFrame(np.hstack([points, _fly(study, points)]), columns=[*study.space.names, *RESPONSES])


def _fly(study: Study, points: Floats, *more: str) -> Floats:
    """F1, F2, F3 and `more` responses at natural points, a column each; every core flies."""
    settings = study.file.simulator.settings if study.file.simulator else {}
    flown = Parallel(n_jobs=-1)(
        delayed(evaluate)(**study.space.values(point), **settings) for point in points
    )
    return np.array([[responses[name] for name in (*RESPONSES, *more)] for responses in flown])


def _place(study: Study, candidate: Candidate, flights: int) -> dict[str, Any]:
    return {
        "factors": {name: _round(float(v)) for name, v in study.space.values(candidate.point).items()},
        "responses": {name: _round(value) for name, value in candidate.responses.items()},
        "objective": _round(candidate.objectives[0]),
        "flights": flights,
    }


def _round(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")


def _write(name: str, table: pd.DataFrame) -> None:
    write_text(TABLES / name, table.to_csv(index=False, float_format=f"%.{DIGITS}g", lineterminator="\n"))


if __name__ == "__main__":
    main()
