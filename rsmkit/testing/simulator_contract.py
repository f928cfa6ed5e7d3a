"""The contract of a simulator: keywords in, finite numbers out, the same again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from rsmkit.runs.agenda import make_task
from rsmkit.runs.backends.loky_pool import LokyPool
from rsmkit.runs.evaluation import check_once
from rsmkit.runs.one_run.execute import Outcome
from rsmkit.runs.one_run.simulator import Simulator
from rsmkit.runs.options import SimulatorOptions
from rsmkit.runs.record.run import Run, Value

__all__ = ["check_simulator"]


def check_simulator(
    simulator: str | SimulatorOptions,
    factors: Mapping[str, Value] | Sequence[Mapping[str, Value]],
    *,
    responses: Sequence[str] = (),
    folder: str | Path = ".",
    rtol: float = 0.0,
) -> Run:
    """Assert that a simulator keeps the contract: keywords in, finite numbers out, the same again.

    The simulator is run at the first point in a fresh process, as a study would run it: it must be found by
    name there, and what it returns must come back. If it is said to be deterministic, all points are then run
    in two more processes, in order and in reverse, which shows whether one run leaves something behind for
    the next. A vectorised simulator is also given all points at once, and must return what it returns for
    each alone.

    Parameters
    ----------
    simulator : str or SimulatorOptions
        ``'module:function'``, or the whole table a study would have.
    factors : mapping, or sequence of mappings
        Points, by factor name; several different ones make a sharper check.
    responses : sequence of str
        Numbers it must return; by default all finite numbers it does return.
    folder : path
        Where its module or its files are, if they are not installed.
    rtol : float
        Relative difference allowed between equal runs; array code may round differently in a batch.

    Returns
    -------
    Run
        The run at the first point.

    Raises
    ------
    AssertionError
        Saying which part of the contract is broken, and where.
    SimulatorError
        If it cannot be loaded at all.
    """
    options = SimulatorOptions(run=simulator) if isinstance(simulator, str) else simulator
    problems = [f"{key} {text}" for key, text in options.problems()]
    assert not problems, f"not a simulator: {'; '.join(problems)}"
    points = [dict(factors)] if isinstance(factors, Mapping) else [dict(point) for point in factors]
    assert points, "no point to run it at"
    made = Simulator(options, Path(folder))
    first = check_once(made, points[0], responses=responses)
    _assert_done(first)
    if options.deterministic:
        forwards = _in_one_process(made, points, responses, size=1)
        backwards = _in_one_process(made, points[::-1], responses, size=1)[::-1]
        _assert_same([first], forwards[:1], rtol, "not deterministic", "in another process")
        _assert_same(forwards, backwards, rtol, "not deterministic", "in another order")
        if options.vectorized:
            n = len(points)
            together = _in_one_process(made, points, responses, size=n)
            assert n == 1 or all(outcome.together for outcome in together), f"fails with arrays of length {n}"
            reverse = _in_one_process(made, points[::-1], responses, size=n)[::-1]
            _assert_same(forwards, together, rtol, "batches differ from single calls", "in one batch")
            _assert_same(together, reverse, rtol, "batches depend on their order", "in reverse")
    return first.run


def _in_one_process(
    simulator: Simulator, points: Sequence[dict[str, Value]], responses: Sequence[str], *, size: int
) -> list[Outcome]:
    """Make the runs one after the other in a fresh worker, in batches of `size`."""
    tasks = [make_task(simulator, point) for point in points]
    pool = LokyPool(1, commands=bool(simulator.options.command))
    try:
        batches = [
            pool.submit(simulator, tasks[start : start + size], tuple(responses)).result()
            for start in range(0, len(tasks), size)
        ]
    finally:
        pool.close(kill=False)
    outcomes = [outcome for batch in batches for outcome in batch]
    for outcome in outcomes:
        _assert_done(outcome)
    return outcomes


def _assert_done(outcome: Outcome) -> None:
    run = outcome.run
    assert run.done, (
        f"the run {run.status} at {dict(run.factors)}: {run.error}\n{outcome.traceback}{outcome.output}"
    )
    assert run.responses, f"the run returned no number at {dict(run.factors)}"


def _assert_same(
    some: Sequence[Outcome], others: Sequence[Outcome], rtol: float, what: str, where: str
) -> None:
    for one, other in zip(some, others, strict=True):
        a, b = dict(one.run.responses), dict(other.run.responses)
        same = a.keys() == b.keys() and all(
            abs(a[name] - b[name]) <= rtol * max(abs(a[name]), abs(b[name])) for name in a
        )
        assert same, (
            f"{what}: {a} alone, {b} {where}, at {dict(one.run.factors)}; say deterministic = false, fix its "
            "seed, or keep nothing from one run to the next"
        )
