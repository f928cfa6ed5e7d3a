"""Making runs: one after the other or many in one call, each ending in a record, whatever happens to it."""

from __future__ import annotations

import threading
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from typing import Any, NamedTuple

from rsmkit.errors import readable
from rsmkit.runs.one_run.command import CommandError, check_command, run_command
from rsmkit.runs.one_run.pristine import HOST, time
from rsmkit.runs.one_run.simulator import (
    Output,
    OutputError,
    Simulator,
    SimulatorError,
    describe,
    read_output,
)
from rsmkit.runs.one_run.time_limits import TimeLimit, time_limit
from rsmkit.runs.one_run.worker import clean_slate, end_copy, hard_limit, recent_output, turn_deaf, under_way
from rsmkit.runs.record.run import Run, Status, Value, recordable, run_seed

__all__ = ["LOADING_S", "WARM_UP_S", "Outcome", "Task", "given_up", "hard_limit_s", "run_tasks"]

GRACE_S = 2.0
LOADING_S = 120.0
WARM_UP_S = 600.0

_loaded: dict[tuple[str, str, str], Callable[..., Any]] = {}
_loading = threading.Lock()


class Task(NamedTuple):
    """A run to be made."""

    key: str
    factors: dict[str, Value]
    replicate: int = 0
    attempt: int = 1


class Outcome(NamedTuple):
    """A run that was made, with the details that do not belong in the journal.

    ``together`` says that it was made in one call with others, by a vectorised simulator.
    """

    run: Run
    traceback: str = ""
    output: str = ""
    together: bool = False


def run_tasks(simulator: Simulator, tasks: Sequence[Task], names: tuple[str, ...]) -> list[Outcome]:
    """Make the runs in order; each gets an outcome, whatever the simulator does to it.

    Parameters
    ----------
    simulator : Simulator
        What to run.
    tasks : sequence of Task
        The runs.
    names : tuple of str
        Responses asked for.

    Raises
    ------
    SimulatorError
        If the simulator cannot be loaded or warmed up, which no single run is to blame for.
    """
    call = _ready(simulator)
    turn_deaf()
    with under_way(tasks[0].key):
        if simulator.options.command:
            return [_sendable(_run_task(call, simulator, task, names)) for task in tasks]
        with hard_limit(hard_limit_s(simulator, len(tasks))):
            together = _run_together(call, simulator, tasks, names) if len(tasks) > 1 else None
            made = together or [_run_task(call, simulator, task, names) for task in tasks]
            return [_sendable(outcome) for outcome in made]


def _sendable(outcome: Outcome) -> Outcome:
    """Give an outcome as the journal will have it: plain values, whatever the simulator has replaced."""
    trace, output = (text if type(text) is str else "" for text in (outcome.traceback, outcome.output))
    return Outcome(recordable(outcome.run), trace, output, outcome.together)


def _ready(simulator: Simulator) -> Callable[..., Any]:
    """Load and warm up a simulator, once in each worker and before any clock of a run."""
    place = (simulator.identity, str(simulator.folder), repr(simulator.options.settings))
    with _loading:
        if place not in _loaded:
            if simulator.options.command:
                check_command(simulator)
                call: Callable[..., Any] = run_command
            else:
                with time_limit(LOADING_S):
                    call = simulator.load()
                with time_limit(WARM_UP_S):
                    simulator.warm_up()
                end_copy()
            _loaded[place] = call
        return _loaded[place]


def hard_limit_s(simulator: Simulator, count: int) -> float | None:
    """Time after which a process that makes `count` runs is ended, in seconds; None without a limit."""
    limit = simulator.options.timeout_s
    return None if limit is None else count * limit + GRACE_S


def _run_task(call: Callable[..., Any], simulator: Simulator, task: Task, names: tuple[str, ...]) -> Outcome:
    output = Output({}, {})
    status: Status = "done"
    error = trace = ""
    clock = Clock()
    clean_slate()
    try:
        output = read_output(_call(call, simulator, task), names)
    except TimeLimit as reason:
        status, error = "timeout", f"stopped after timeout_s = {simulator.options.timeout_s:g} s"
        trace = _trace(reason)
    except CommandError as reason:
        status, error = reason.status, _one_line(str(reason))
    except OutputError as reason:
        status, error, output = "failed", _one_line(str(reason)), Output({}, reason.extras)
    except SimulatorError:
        raise
    except BaseException as reason:
        status, error, trace = "failed", _one_line(describe(reason)), _trace(reason)
    end_copy()
    run = _record(simulator, task, clock.started, clock.seconds(), output, status, error)
    return Outcome(run) if status == "done" else Outcome(run, trace, recent_output())


def _call(call: Callable[..., Any], simulator: Simulator, task: Task) -> object:
    options = simulator.options
    seed = run_seed(task.key)
    if options.command:
        return call(simulator, task.key, {**task.factors, "replicate": task.replicate, "seed": seed})
    own = {options.seed: seed} if options.seed else {}
    with time_limit(options.timeout_s), _not_ours():
        if not options.vectorized:
            return call(**task.factors, **options.settings, **own)
        returned = call(**_columns(simulator, [task]), **options.settings)
    (row,) = _rows(returned, 1)
    return row


@contextmanager
def _not_ours() -> Iterator[None]:
    """Tell errors of a simulator that uses rsmkit itself from those that rsmkit raises about it."""
    try:
        yield
    except (CommandError, OutputError, SimulatorError) as error:
        raise RuntimeError(describe(error)) from error


def _run_together(
    call: Callable[..., Any], simulator: Simulator, tasks: Sequence[Task], names: tuple[str, ...]
) -> list[Outcome] | None:
    """Make all runs in one call of a vectorised simulator; None if anything about it is not as it should be.

    The runs are then made one by one, in arrays of length 1, so that only the guilty are blamed.
    """
    options = simulator.options
    if not options.vectorized:
        return None
    clock = Clock()
    clean_slate()
    try:
        with time_limit(None if options.timeout_s is None else options.timeout_s * len(tasks)):
            returned = call(**_columns(simulator, tasks), **options.settings)
        outputs = [read_output(row, names) for row in _rows(returned, len(tasks))]
    except BaseException:
        end_copy()
        return None
    end_copy()
    seconds = clock.seconds() / len(tasks)
    return [
        Outcome(_record(simulator, task, clock.started, seconds, output), together=True)
        for task, output in zip(tasks, outputs, strict=True)
    ]


def _columns(simulator: Simulator, tasks: Sequence[Task]) -> dict[str, Any]:
    """One array for each factor, and for the seeds if they are asked for."""
    import numpy as np

    columns = {name: np.array([task.factors[name] for task in tasks]) for name in tasks[0].factors}
    if simulator.options.seed:
        columns[simulator.options.seed] = np.array([run_seed(task.key) for task in tasks])
    return columns


def _rows(returned: object, count: int) -> list[object]:
    """Turn the arrays of a vectorised simulator into one mapping for each run."""
    if not isinstance(returned, Mapping):
        return [returned] * count
    for name, values in returned.items():
        if not hasattr(values, "__len__") or isinstance(values, str) or len(values) != count:
            raise OutputError(f"returned {name} = {values!r:.60}, which is not an array of length {count}")
    return [{name: values[index] for name, values in returned.items()} for index in range(count)]


class Clock:
    """When a run began: by the calendar for people, and by a clock that never jumps for its duration."""

    def __init__(self) -> None:
        self.started = datetime.now(UTC).isoformat(timespec="seconds")
        self._begin = time.perf_counter()

    def seconds(self) -> float:
        """Time since then."""
        return float(time.perf_counter() - self._begin)


def _record(
    simulator: Simulator,
    task: Task,
    started: str,
    seconds: float,
    output: Output,
    status: Status = "done",
    error: str = "",
    host: str = HOST,
) -> Run:
    return Run(
        key=task.key,
        simulator=simulator.identity,
        settings=simulator.options.settings,
        factors=task.factors,
        replicate=task.replicate,
        status=status,
        responses=output.responses,
        extras=output.extras,
        seconds=round(seconds, 6),
        attempt=task.attempt,
        error=error,
        host=host,
        started=started,
    )


def given_up(
    simulator: Simulator, task: Task, status: Status, error: str, seconds: float, printed: str = ""
) -> Outcome:
    """Give the outcome of a run that did not come back by itself."""
    output = Output({}, {})
    return Outcome(_record(simulator, task, "", seconds, output, status, error, host=""), output=printed)


def _one_line(text: str) -> str:
    return readable(" ".join(text.split()))


def _trace(error: BaseException) -> str:
    """Format the traceback from the simulator's first frame on."""
    inner = error.__traceback__
    while inner and inner.tb_frame.f_code.co_filename == __file__:
        inner = inner.tb_next
    try:
        return "".join(traceback.format_exception(type(error), error, inner))
    except BaseException:
        return type(error).__name__
