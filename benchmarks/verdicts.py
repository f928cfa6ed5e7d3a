"""Are verdicts right? Small studies whose truth is known, taken through the stages.

    python benchmarks/verdicts.py [words of studies ...]

The truth of a verified point comes from the simulator without its noise. A point *deserves* CONFIRMED when
the true objective is within the tolerance of the prediction, every constraint holds, and no feasible design
run is truly better; two standard errors of the mean of the runs are allowed for, and a design run counts as
feasible that is so by two standard deviations of one. It *is the optimum*
when it satisfies every constraint and is within the tolerance of the least value that a search on the
simulator without noise finds anywhere. Counted are points, so a front counts several times.
"""

from __future__ import annotations

import logging
import sys
import tempfile
import zlib
from collections import defaultdict
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from textwrap import indent

import numpy as np
from verdict_studies import STUDIES, SmallStudy

from rsmkit.language.space import Floats
from rsmkit.optimum.problem import Evaluation, Problem, least_margins
from rsmkit.optimum.search import search_problem
from rsmkit.runs.how_to_run import HowToRun
from rsmkit.stages.evaluate import evaluate_design
from rsmkit.stages.fit import fit_study
from rsmkit.stages.planning.plan import plan_design
from rsmkit.stages.verify import verify_study
from rsmkit.study.folder import StudyFolder, open_study
from rsmkit.study.posing import noise_means, pose, search_options
from rsmkit.verification.verification import Confirmation

TOLERANCE = 0.02


@dataclass(frozen=True)
class Judged:
    """One verified point: what was said, and what is true."""

    family: str
    study: str
    verdict: str
    sentence: str
    deserved: bool
    optimum: bool
    inside: bool | None


def run_source(study: SmallStudy) -> str:
    """The simulator's module."""
    names = study.responses.split()
    noise = "".join(
        f"    {name} += noise*{sd!r}*draw()\n" for name, sd in zip(names, study.noise, strict=False)
    )
    return (
        "import math as m, random\n"
        "def run(*, noise=1.0, seed=0, **factors):\n"
        "    draw = random.Random(seed).gauss if noise else (lambda a=0, b=0: 0.0)\n"
        "    return _run(noise, lambda: draw(0.0, 1.0), **factors)\n"
        f"def _run(noise, draw, {', '.join(_factor_names(study))}):\n"
        f"{indent(study.body, '    ')}\n{noise}"
        f"    return {{{', '.join(f'{name!r}: {name}' for name in names)}}}\n"
    )


def _factor_names(study: SmallStudy) -> list[str]:
    return [line.split("=")[0].strip() for line in study.factors.splitlines()]


def study_file(study: SmallStudy, module: str, seed: int) -> str:
    """The study file; `seed` becomes a setting, so that every repetition has noise of its own."""
    noisy = "deterministic = false\nseed = 'seed'\n" if study.noise else ""
    responses = "".join(f"{name} = {{}}\n" for name in study.responses.split())
    design = "" if "[design]" in study.more else "[design]\nstar = 'faced'\n"
    more = study.more.replace("center = 4", "center = 4\nstar = 'faced'")
    return (
        f"[simulator]\nrun = '{module}:run'\n{noisy}[factors]\n{study.factors}\n"
        f"[responses]\n{responses}{design}{more}\n[[search]]\nname = 's'\n{study.search}\n"
    )


def fitted_study(study: SmallStudy, seed: int, place: str, how: HowToRun) -> StudyFolder:
    """Write a study and its simulator into a folder, and take it to its surfaces."""
    module = f"{Path(place).name}_{zlib.crc32(study.name.encode())}_{seed}"
    source = run_source(study).replace("Random(seed)", f"Random(seed + 7919*{seed})")
    (Path(place) / f"{module}.py").write_text(source)
    (Path(place) / "study.toml").write_text(study_file(study, module, seed))
    folder = open_study(place)
    plan_design(folder)
    evaluate_design(folder, how)
    fit_study(folder)
    return folder


def judged(study: SmallStudy, seed: int) -> list[Judged]:
    """Take one study through the stages and compare what is said with what is true."""
    with tempfile.TemporaryDirectory() as place:
        how = HowToRun(jobs=1)
        folder = fitted_study(study, seed, place, how)
        found = verify_study(folder, how).verification.searches[0]
        problem = pose(folder.study, "s", evaluator(folder, folder.simulator.load()))
        design = problem.evaluate(folder.fitted().runs.points)
        least = _least(folder, problem)
        return [_compare(study, folder, problem, design, least, point) for point in found.points]


def evaluator(
    folder: StudyFolder, run: Callable[..., dict[str, float]]
) -> Callable[[Floats], Mapping[str, Floats]]:
    responses, space = folder.study.responses, folder.study.space

    def evaluate(points: Floats) -> dict[str, Floats]:
        rows = []
        for point in points:
            try:
                rows.append(run(noise=0.0, **space.values(point)))
            except ValueError:
                rows.append(dict.fromkeys(responses, np.nan))
        return {name: np.array([row[name] for row in rows]) for name in responses}

    return evaluate


def _least(folder: StudyFolder, problem: Problem) -> float | None:
    """Least feasible objective anywhere, without noise; None for fronts and where nothing is feasible."""
    if len(problem.objectives) > 1 or noise_means(folder.study, "s"):
        return None
    found = search_problem(problem, search_options(folder.study, "s"))
    return None if found.missed else found.best.objectives[0]


def _compare(
    study: SmallStudy,
    folder: StudyFolder,
    problem: Problem,
    design: Evaluation,
    least: float | None,
    point: Confirmation,
) -> Judged:
    x = folder.study.space.point(point.factors)[None]
    truth = problem.evaluate(x)
    of_one = _noise(study, problem, truth)
    error, error_of_margins = (two / np.sqrt(max(point.replicates, 1)) for two in of_one)
    predicted = np.array([c.predicted for c in point.objectives.values()])
    spread = np.median(design.objectives, axis=0) - design.objectives.min(axis=0)
    scale = np.maximum(np.abs(truth.objectives[0]), spread)
    close = bool((np.abs(truth.objectives[0] - predicted) <= TOLERANCE * scale + error).all())
    values = {**problem.cheap_values(x), **truth.responses}
    sizes = [max(float(np.abs(t(values)).max()) for t in c.margin.terms()) for c in problem.constraints]
    room = np.maximum(-least_margins(design), TOLERANCE * np.array(sizes)) + error_of_margins
    feasible = bool((truth.margins[0] >= -room).all())
    allowed = (design.margins >= least_margins(design) + of_one[1]).all(axis=1) & folder.study.space.contains(
        design.points
    )
    rivals = design.objectives[allowed]
    room_up = rivals + 1e-6 * scale + error
    better = (rivals <= truth.objectives[0]).all(axis=1) & (room_up < truth.objectives[0]).any(axis=1)
    known = bool(np.isfinite(truth.objectives).all())
    worthless = "desirability" in study.search and bool(truth.objectives[0, 0] >= 0.0)
    right = known and feasible and not worthless
    there = least is not None and right and truth.objectives[0, 0] <= least + TOLERANCE * scale[0] + error[0]
    insides = [c.inside for c in point.objectives.values() if c.inside is not None]
    return Judged(
        study.family,
        study.name,
        point.verdict,
        point.sentence,
        right and close and not better.any(),
        bool(there),
        all(insides) if insides else None,
    )


def _noise(study: SmallStudy, problem: Problem, truth: Evaluation) -> tuple[Floats, Floats]:
    """Two standard deviations of one run, of the objectives and of the margins: both ways, the larger."""
    squares = [np.zeros(truth.objectives.shape[1]), np.zeros(truth.margins.shape[1])]
    for name, sd in zip(study.responses.split(), study.noise, strict=False):
        moved = [
            problem.evaluation(truth.points, {**truth.responses, name: truth.responses[name] + shift})
            for shift in (2.0 * sd, -2.0 * sd)
        ]
        squares[0] += np.max([np.abs(m.objectives - truth.objectives)[0] for m in moved], axis=0) ** 2
        squares[1] += np.max([np.abs(m.margins - truth.margins)[0] for m in moved], axis=0) ** 2
    return np.sqrt(squares[0]), np.sqrt(squares[1])


def main() -> None:
    """Run all studies, or those whose name or family holds one of the words, and print the table."""
    logging.getLogger("rsmkit").setLevel(logging.ERROR)
    words = sys.argv[1:]
    results: list[Judged] = []
    for study in STUDIES:
        if words and not any(word in f"{study.family} {study.name}" for word in words):
            continue
        for seed in study.seeds:
            for item in judged(study, seed):
                results.append(item)
                said = item.verdict == "CONFIRMED"
                mark = "  " if said == item.deserved else "!!" if said else " ?"
                print(
                    f"{mark} {item.family}, {item.study}: {item.verdict}: {item.sentence[:150]}", flush=True
                )
    families = defaultdict(list)
    for item in results:
        families[item.family].append(item)
    heads = ("points", "CONFIRMED", "these right", "deserved", "these said", "the optimum", "these said")
    print(f"\n| | {' | '.join(heads)} |")
    print("|---|---|---|---|---|---|---|---|")
    for name, items in [*families.items(), ("all", results)]:
        said = [item for item in items if item.verdict == "CONFIRMED"]
        deserved = [item for item in items if item.deserved]
        reached = [item for item in items if item.optimum]
        sure = [sum(item.verdict == "CONFIRMED" for item in some) for some in (deserved, reached)]
        right = sum(item.deserved for item in said)
        row = (len(items), len(said), right, len(deserved), sure[0], len(reached), sure[1])
        print(f"| {name} | {' | '.join(map(str, row))} |")
    inside = [item.inside for item in results if item.inside is not None]
    print(f"\nIntervals of objectives that hold the run: {sum(inside)} of {len(inside)}")


if __name__ == "__main__":
    main()
