"""rsmkit from Python: the four stages as four functions, without a study file.

>>> import rsmkit as rk  # doctest: +SKIP
>>> space = rk.Space(theta_c1_deg=(5, 10), theta_c2_deg=(10, 15), nose_radius_m=(0.15, 0.30))
>>> design = rk.augment(rk.ccd(space, center=1), 50)
>>> runs = rk.evaluate("sim.reentry:evaluate", design, responses=["axial_integral", "heat_integral"])
>>> surfaces = rk.fit(runs)
>>> best = rk.search(surfaces, "0.2*axial_integral + 0.7*heat_integral")
>>> rk.verify(best, "sim.reentry:evaluate", surfaces, runs).verdict
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rsmkit.design.table import Design
from rsmkit.errors import RsmkitError
from rsmkit.optimum.optimum import Optimum
from rsmkit.optimum.options import SearchOptions
from rsmkit.optimum.problem import Function, Problem, build_problem
from rsmkit.optimum.search import search as run_search
from rsmkit.runs.evaluate import evaluate_points
from rsmkit.runs.journal import Journal
from rsmkit.runs.options import SimulatorOptions
from rsmkit.runs.progress import Watcher
from rsmkit.runs.simulator import Simulator
from rsmkit.runs.table import Runs
from rsmkit.space import Floats
from rsmkit.surfaces.fit import fit_surface
from rsmkit.surfaces.surface import Surface
from rsmkit.verification.options import VerifyOptions
from rsmkit.verification.verification import Confirmation
from rsmkit.verification.verify import verify as judge

__all__ = ["evaluate", "fit", "search", "verify"]


def evaluate(
    simulator: str | Callable[..., Any],
    design: Design,
    *,
    responses: Sequence[str] = (),
    settings: Mapping[str, Any] | None = None,
    deterministic: bool = True,
    timeout_s: float | None = None,
    save: str | Path = "runs.jsonl",
    jobs: int | None = None,
    on_event: Watcher | None = None,
) -> Runs:
    """Run the simulator at every point of a design that has no finished run in `save` yet.

    Parameters
    ----------
    simulator : str or callable
        ``"module:function"``, or a function that can be imported by its name (not one typed into a notebook).
        It receives the factors and `settings` as keywords and returns a mapping of names to numbers.
    design : Design
        What to run.
    responses : sequence of str, optional
        Numbers every run must return; all that the simulator returns when left out.
    settings : mapping, optional
        Constants passed to every run; part of a run's identity.
    deterministic : bool
        Same input, same output: repeated points share one run.
    timeout_s : float, optional
        A run longer than this is stopped and recorded as timed out.
    save : path
        The journal of runs; calling again with the same file goes on where the last call stopped.
    jobs : int, optional
        Parallel runs; all cores by default.
    on_event : callable, optional
        Told of every run that starts and ends.

    Returns
    -------
    Runs
        One row per design point; failed runs are in it, with their reasons.
    """
    options = SimulatorOptions(
        run=_name_of(simulator),
        deterministic=deterministic,
        timeout_s=timeout_s,
        settings=dict(settings or {}),
    )
    return evaluate_points(
        Simulator(options, Path.cwd()),
        design.points,
        design.space,
        Journal(save),
        responses=responses,
        jobs=jobs,
        on_event=on_event,
    )


def fit(runs: Runs, responses: Sequence[str] | None = None, *, order: int = 2) -> dict[str, Surface]:
    """Fit one response surface per response to the runs that succeeded.

    Parameters
    ----------
    runs : Runs
        From :func:`evaluate`.
    responses : sequence of str, optional
        Which numbers to model; those the runs were asked for by default.
    order : int
        1 linear, 2 full second order, 3 full third order.
    """
    good = runs.finished()
    return {
        name: fit_surface(good.space, good.points, good.y(name), response=name, order=order)
        for name in responses or good.responses
    }


def search(
    surfaces: Mapping[str, Surface],
    minimize: str | Sequence[str],
    *,
    subject_to: Sequence[str] = (),
    functions: Mapping[str, Function] | None = None,
    seed: int = 1,
    **options: Any,
) -> Optimum:
    """Search the surfaces for the optimum of an expression, or for the Pareto front of several.

    Parameters
    ----------
    surfaces : mapping of str to Surface
        From :func:`fit`.
    minimize : str or sequence of str
        Expression(s) of responses, factors and `functions`.
    subject_to : sequence of str
        Constraints such as ``"dp_kpa <= 40"``.
    functions : mapping, optional
        Cheap named quantities: natural points, shape (n, k), to values, shape (n,).
    seed : int
        The same seed gives the same optimum.
    **options
        Further fields of :class:`rsmkit.optimum.options.SearchOptions`.
    """
    texts = minimize if isinstance(minimize, str) else tuple(minimize)
    chosen = SearchOptions(minimize=texts, subject_to=tuple(subject_to), seed=seed, **options)
    problems = [f"{key}: {message}" for key, message in chosen.problems()]
    if problems:
        raise RsmkitError("; ".join(problems))
    return run_search(_problem(surfaces, texts, chosen.subject_to, functions), chosen)


def verify(
    optimum: Optimum,
    simulator: str | Callable[..., Any],
    surfaces: Mapping[str, Surface],
    runs: Runs,
    *,
    functions: Mapping[str, Function] | None = None,
    settings: Mapping[str, Any] | None = None,
    tolerance_pct: float = 2.0,
    confidence: float = 0.95,
    save: str | Path = "runs.jsonl",
) -> Confirmation:
    """Run the simulator at the optimum and compare it with what the surfaces promised.

    Parameters are those of :func:`evaluate` and :func:`search`; `runs` are those the surfaces were fitted to.
    """
    points = np.array([candidate.point for candidate in optimum.candidates])
    flown = evaluate(
        simulator,
        Design(optimum.space, points, ("given",) * len(points)),
        responses=tuple(surfaces),
        settings=settings,
        save=save,
    )
    for failed in flown.failures():
        raise RsmkitError(f"the simulator failed at the optimum {dict(failed.factors)}: {failed.error}")
    problem = _problem(surfaces, optimum.minimize, optimum.subject_to, functions)
    good = runs.finished()
    return judge(
        problem,
        optimum,
        [run.responses for run in flown.runs if run is not None],
        surfaces=surfaces,
        objective_surfaces={text: surfaces[text] for text in optimum.minimize if text in surfaces},
        design=problem.evaluation(good.points, {name: good.y(name) for name in surfaces}),
        options=VerifyOptions(tolerance_pct=tolerance_pct, confidence=confidence),
    )


def _problem(
    surfaces: Mapping[str, Surface],
    minimize: str | Sequence[str],
    subject_to: Sequence[str],
    functions: Mapping[str, Function] | None,
) -> Problem:
    def predict(points: Floats) -> dict[str, Floats]:
        return {name: surface.predict(points) for name, surface in surfaces.items()}

    space = next(iter(surfaces.values())).space
    return build_problem(
        space, minimize, predict, responses=tuple(surfaces), subject_to=subject_to, functions=functions
    )


def _name_of(simulator: str | Callable[..., Any]) -> str:
    if isinstance(simulator, str):
        return simulator
    module, name = getattr(simulator, "__module__", ""), getattr(simulator, "__qualname__", "")
    if module in ("", "__main__") or not all(part.isidentifier() for part in name.split(".")):
        raise RsmkitError(
            "workers find the simulator by its name, so it must be a function of an importable module: "
            "put it into a .py file and import it from there"
        )
    return f"{module}:{name}"
