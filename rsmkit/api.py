"""rsmkit from Python: the four stages as functions, without a study file.

The simulator here is the cantilever of ``rsmkit new``, which lies in the package itself:

>>> import rsmkit as rk
>>> simulator = "rsmkit.example.simulator:cantilever"
>>> settings = {"length_m": 1.5, "load_N": 4000.0}
>>> space = rk.Space(width_mm=(30, 60), height_mm=(90, 120))
>>> design = rk.augment(rk.ccd(space, star="inscribed", center=1), 14, min_distance=0.2)
>>> runs = rk.evaluate(simulator, design, settings=settings, jobs=1)
>>> surfaces = rk.fit(runs)
>>> best = rk.search(surfaces, "mass_kg", subject_to=["sag_mm <= 10", "stress_MPa <= 150"])
>>> proof = rk.verify(best, simulator, surfaces, runs, settings=settings)
>>> proof.verdict
'CONFIRMED'
>>> rk.explorer(runs, surfaces, [best], [proof]).name
'explorer.html'
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from rsmkit.design.design import Design
from rsmkit.errors import FitError, RsmkitError
from rsmkit.io.arguments import checked
from rsmkit.io.toml_tables import read_options
from rsmkit.language.space import Floats
from rsmkit.optimum.optimum import Optimum
from rsmkit.optimum.options import SearchOptions
from rsmkit.optimum.problem import Function, Problem, build_problem
from rsmkit.optimum.search import search_problem
from rsmkit.report.explorer.inline_page import ExplorerPage
from rsmkit.runs.backends.options import DEFAULT_BACKEND
from rsmkit.runs.evaluation import evaluate_points
from rsmkit.runs.how_to_run import HowToRun
from rsmkit.runs.one_run.simulator import Simulator
from rsmkit.runs.options import SimulatorOptions
from rsmkit.runs.record.journal import Journal
from rsmkit.runs.record.run_progress import Watcher
from rsmkit.runs.record.run_table import Runs
from rsmkit.surfaces.choose import choose_surface
from rsmkit.surfaces.fitted_response import Surfaces, with_statistics
from rsmkit.surfaces.models.surface import Surface
from rsmkit.surfaces.options import SurfaceOptions
from rsmkit.verification.flown import NOISY_REPLICATES, flown_at
from rsmkit.verification.judge import judge_optimum
from rsmkit.verification.options import RefineOptions, VerifyOptions
from rsmkit.verification.refinement.refinement import Refinement, Wave
from rsmkit.verification.refinement.waves import refine_problem
from rsmkit.verification.verification import Confirmation, SimulatorRuns, Verification

__all__ = ["evaluate", "explorer", "fit", "refine", "search", "verify"]


@checked
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
    backend: str = DEFAULT_BACKEND,
    backend_options: Mapping[str, Any] | None = None,
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
    backend : str
        Where the runs are made: ``"loky"`` for processes on this computer, ``"dask"`` for a cluster.
    backend_options : mapping, optional
        What that backend must know: ``{"scheduler": "tcp://host:8786"}`` for ``"dask"``.
    on_event : callable, optional
        Told of every run that starts and ends.

    Returns
    -------
    Runs
        One row per design point; failed runs are in it, with their reasons.

    Raises
    ------
    RsmkitError
        If the simulator cannot be loaded, or there is no such backend.
    """
    how = HowToRun(jobs, backend, backend_options or {})
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
        how,
        responses=responses,
        on_event=on_event,
    )


@checked
def fit(
    runs: Runs, responses: Sequence[str] | None = None, *, deterministic: bool = True, **options: Any
) -> Surfaces:
    """Fit one response surface per response to the runs that succeeded.

    Parameters
    ----------
    runs : Runs
        From :func:`evaluate`.
    responses : sequence of str, optional
        Which numbers to model; those the runs were asked for by default.
    deterministic : bool
        Whether repeated points that agree exactly count once.
    **options
        Fields of :class:`rsmkit.surfaces.options.SurfaceOptions`: ``model="auto"``, ``order=1``,
        ``terms=("FO", "TWI")``, ... A full second-order polynomial when there are none.

    Returns
    -------
    Surfaces
        A dict by response: ``predict``, ``gradient``, ``report``, ``summary``.

    Raises
    ------
    FitError
        If no run succeeded, or too few did.
    """
    good, chosen = runs.finished(), read_options(SurfaceOptions, options)
    if not len(good):
        failures = runs.failures()
        why = f"the first failed at {failures[0].described}" if failures else "none has been made"
        raise FitError(f"none of the {len(runs)} runs succeeded: {why}")
    return Surfaces(
        (
            name,
            choose_surface(
                good.space,
                good.points,
                good.y(name),
                response=name,
                options=chosen,
                deterministic=deterministic,
            ).surface,
        )
        for name in responses or good.responses
    )


@checked
def search(
    surfaces: Mapping[str, Surface],
    minimize: str | Sequence[str] = (),
    *,
    subject_to: str | Sequence[str] = (),
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
    subject_to : str or sequence of str
        Constraints such as ``"dp_kpa <= 40"``.
    functions : mapping, optional
        Cheap named quantities: natural points, shape (n, k), to values, shape (n,).
    seed : int
        The same seed gives the same optimum.
    **options
        Further fields of :class:`rsmkit.optimum.options.SearchOptions`: `preset`, `polish`, or instead of
        `minimize` a `desirability` of several responses.
    """
    texts = minimize if isinstance(minimize, str) else tuple(minimize)
    limits = (subject_to,) if isinstance(subject_to, str) else tuple(subject_to)
    chosen = read_options(SearchOptions, {"minimize": texts, "subject_to": limits, "seed": seed, **options})
    return search_problem(_problem(surfaces, chosen.objectives, chosen.subject_to, functions), chosen)


@checked
def verify(
    optimum: Optimum,
    simulator: str | Callable[..., Any],
    surfaces: Mapping[str, Surface],
    runs: Runs,
    *,
    functions: Mapping[str, Function] | None = None,
    settings: Mapping[str, Any] | None = None,
    deterministic: bool = True,
    replicates: int | None = None,
    tolerance_pct: float = 2.0,
    confidence: float = 0.95,
    save: str | Path = "runs.jsonl",
    jobs: int | None = None,
    backend: str = DEFAULT_BACKEND,
    backend_options: Mapping[str, Any] | None = None,
) -> Confirmation:
    """Run the simulator at the optimum and compare it with what the surfaces promised.

    Parameters are those of :func:`evaluate` and :func:`search`; `runs` are those that were fitted.
    Each point is run `replicates` times; when left out, once if `deterministic` and four times if not. A
    point at which the simulator fails gets the verdict ``FAILED``.
    """
    times = 1 if deterministic else replicates or NOISY_REPLICATES
    points = np.repeat([candidate.point for candidate in optimum.candidates], times, axis=0)
    flown = evaluate(
        simulator,
        Design(optimum.space, points, ("given",) * len(points)),
        responses=tuple(surfaces),
        settings=settings,
        deterministic=deterministic,
        save=save,
        jobs=jobs,
        backend=backend,
        backend_options=backend_options,
    )
    problem = _problem(surfaces, optimum.minimize, optimum.subject_to, functions)
    good = runs.finished()
    return judge_optimum(
        problem,
        optimum,
        [flown_at(flown, candidate.point) for candidate in optimum.candidates],
        surfaces=surfaces,
        objective_surfaces={text: surfaces[text] for text in optimum.minimize if text in surfaces},
        design=problem.evaluation(good.points, {name: good.y(name) for name in surfaces}),
        options=VerifyOptions(tolerance_pct=tolerance_pct, confidence=confidence),
    )


@checked
def refine(
    optimum: Optimum,
    simulator: str | Callable[..., Any],
    surfaces: Mapping[str, Surface],
    runs: Runs,
    *,
    functions: Mapping[str, Function] | None = None,
    settings: Mapping[str, Any] | None = None,
    save: str | Path = "runs.jsonl",
    jobs: int | None = None,
    backend: str = DEFAULT_BACKEND,
    backend_options: Mapping[str, Any] | None = None,
    on_wave: Callable[[Wave], None] | None = None,
    **options: Any,
) -> Refinement:
    """Go on with true runs from the optimum, or from the front, until nothing promises a better one.

    Parameters are those of :func:`verify`; `runs` may hold failed ones, which say where not to go.

    Parameters
    ----------
    on_wave : callable, optional
        Told of every wave.
    **options
        Fields of :class:`rsmkit.verification.options.RefineOptions`: ``batch=16``, ``max_runs=100``,
        ``noise_sd``, ``seed``. The batch is at least `jobs`.

    Returns
    -------
    Refinement
        ``found.best``, ``found.waves``, ``found.reason``.
    """
    chosen = read_options(RefineOptions, options)
    if jobs is not None and "batch" not in options:
        chosen = replace(chosen, batch=max(jobs, chosen.batch))
    names = tuple(surfaces)

    def fly(points: Floats) -> dict[str, Floats]:
        flown = evaluate(
            simulator,
            Design(optimum.space, points, ("given",) * len(points)),
            responses=names,
            settings=settings,
            save=save,
            jobs=jobs,
            backend=backend,
            backend_options=backend_options,
        )
        return _responses(flown, names)

    posed = _problem(surfaces, optimum.minimize, optimum.subject_to, functions)
    problem = replace(posed, evaluator=fly)
    points = np.array([candidate.point for candidate in optimum.candidates])
    first = fly(points)
    start = problem.evaluation(
        np.vstack([runs.points, points]),
        {name: np.r_[column, first[name]] for name, column in _responses(runs, names).items()},
    )
    return refine_problem(problem, start, chosen, on_wave=on_wave)


@checked
def explorer(
    runs: Runs,
    surfaces: Mapping[str, Surface],
    optima: Sequence[Optimum] = (),
    confirmations: Sequence[Confirmation] = (),
    *,
    path: str | Path = "explorer.html",
    title: str = "Study",
    functions: Mapping[str, Function] | None = None,
) -> ExplorerPage:
    """Write the explorer: one offline page with profiler, contours, diagnostics and searches.

    As the last line of a cell, a notebook shows the page itself.

    Parameters
    ----------
    runs : Runs
        Those the surfaces were fitted to.
    surfaces : mapping of str to Surface
        From :func:`fit`.
    optima : sequence of Optimum
        From :func:`search`.
    confirmations : sequence of Confirmation
        From :func:`verify`; the page begins with their verdicts.
    path : path
        The page.
    title : str
        Its title.
    functions : mapping, optional
        As for :func:`search`.

    Returns
    -------
    ExplorerPage
        The path of the page.
    """
    from rsmkit.report.explorer.explorer_page import write_explorer
    from rsmkit.report.findings import Findings

    good, target = runs.finished(), ExplorerPage(path)
    spent = SimulatorRuns(len(good), sum(item.simulator_runs.verification for item in confirmations))
    write_explorer(
        target,
        Findings(
            study_name=title,
            runs=good,
            surfaces={name: with_statistics(surface) for name, surface in surfaces.items()},
            optima=optima,
            verification=Verification(tuple(confirmations), spent) if confirmations else None,
            functions=dict(functions or {}),
            failed=len(runs.failures()),
        ),
    )
    return target


def _responses(runs: Runs, names: Sequence[str]) -> dict[str, Floats]:
    """Responses of all runs, nan where one failed."""
    if not runs.done.any():
        return dict.fromkeys(names, np.full(len(runs), np.nan))
    return {name: runs.y(name) for name in names}


def _problem(
    surfaces: Mapping[str, Surface],
    minimize: str | Sequence[str],
    subject_to: Sequence[str],
    functions: Mapping[str, Function] | None,
) -> Problem:
    def predict(points: Floats) -> dict[str, Floats]:
        return {name: surface.predict(points) for name, surface in surfaces.items()}

    if not surfaces:
        raise RsmkitError("there is no surface to search; fit some first")
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
            "put it into a .py file and import it from there. In a notebook, begin its cell with the line "
            "%%writefile name.py and give 'name:function'"
        )
    return f"{module}:{name}"
