"""What an evaluation has to do: the run each point needs, compared with what the journal already has."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rsmkit.errors import RsmkitError
from rsmkit.language.space import Floats, Space
from rsmkit.runs.how_to_run import HowToRun
from rsmkit.runs.one_run.execute import Task
from rsmkit.runs.one_run.simulator import Simulator
from rsmkit.runs.record.journal import Journal
from rsmkit.runs.record.meaning import Caller, known_runs
from rsmkit.runs.record.row_states import RowStates
from rsmkit.runs.record.run import Run, Value, key_maker, run_key
from rsmkit.runs.record.run_table import Runs

__all__ = ["Agenda", "caller_of", "make_agenda", "make_task", "read_runs", "rest_of_agenda"]


@dataclass(frozen=True)
class Agenda:
    """The runs of a set of points, made and to be made.

    Parameters
    ----------
    points : array, shape (n, k)
        Natural units; each point as often as it has replicates.
    rows : tuple of Task
        The run each of them needs; points that share a run have the same key.
    recorded : dict
        Runs of these that the journal already has.
    todo : tuple of Task
        Runs to make.
    others : tuple of int and int
        Further rows, and different runs they need, that have theirs and are not listed here.
    """

    points: Floats
    rows: tuple[Task, ...]
    recorded: dict[str, Run]
    todo: tuple[Task, ...]
    others: tuple[int, int] = (0, 0)

    @property
    def planned(self) -> int:
        """Number of rows."""
        return len(self.rows) + self.others[0]

    @property
    def distinct(self) -> int:
        """Number of different runs the points need."""
        return len({task.key for task in self.rows}) + self.others[1]

    @property
    def known(self) -> int:
        """How many of these the journal already has."""
        return len(self.recorded) + self.others[1]

    @property
    def keys(self) -> list[str]:
        """The run each row needs."""
        return [task.key for task in self.rows]

    def table(self, space: Space, responses: Sequence[str]) -> Runs:
        """Put the recorded runs beside their points."""
        runs = tuple(self.recorded.get(task.key) for task in self.rows)
        return Runs(space, self.points, runs, tuple(responses))


def make_agenda(
    simulator: Simulator,
    points: ArrayLike,
    space: Space,
    journal: Journal,
    how: HowToRun | None = None,
    *,
    responses: Sequence[str] = (),
) -> Agenda:
    """Compare points with the journal; nothing is run and nothing is written.

    This is a dry run of :func:`~rsmkit.runs.evaluation.evaluate_points`, which takes the same parameters.

    Raises
    ------
    RsmkitError
        If the points do not fit the space, ``how.only`` names points that are not there, or the journal is
        damaged.
    """
    how = how or HowToRun()
    x = np.array(points, float)
    if x.ndim != 2 or x.shape[1] != len(space) or not np.isfinite(x).all():
        raise RsmkitError(f"points must be finite numbers of shape (n, {len(space)}), got shape {x.shape}")
    wanted = range(1, len(x) + 1) if how.only is None else set(how.only)
    wrong = sorted(row for row in wanted if not 1 <= row <= len(x))
    if wrong:
        raise RsmkitError(f"the design has runs 1 to {len(x)}; there is no run {', '.join(map(str, wrong))}")
    replicates = 1 if simulator.options.deterministic else simulator.options.replicates
    chosen = np.repeat([row in wanted for row in range(1, len(x) + 1)], replicates)
    x = np.repeat(x, replicates, axis=0)
    rows = _tasks(simulator, x, space)
    journaled = known_runs(caller_of(simulator, space), journal.load())
    recorded = {task.key: journaled[task.key] for task in rows if task.key in journaled}
    todo: dict[str, Task] = {}
    for task, is_chosen in zip(rows, chosen, strict=True):
        old = recorded.get(task.key)
        if is_chosen and old is None:
            todo[task.key] = task
        elif is_chosen and old is not None and not old.answers(responses) and (old.done or how.retry_failed):
            # done, but made before this response was asked for: that is no failure
            todo[task.key] = task._replace(attempt=old.attempt + 1)
    return Agenda(x, rows, recorded, tuple(todo.values())[: how.limit])


def rest_of_agenda(
    simulator: Simulator, points: ArrayLike, space: Space, states: RowStates, how: HowToRun | None = None
) -> Agenda | None:
    """Give the agenda of a large design of which it is known how far each row has come; no run is read.

    None where the runs that are there matter to it as well.
    """
    how = how or HowToRun()
    if how.only is not None or how.retry_failed:
        return None
    rows = states.missing[: how.limit]
    x = np.array(points, float)[rows]
    tasks = _tasks(simulator, x, space)
    if [int(task.key, 16) for task in tasks] != states.keys[rows].tolist():
        return None
    return Agenda(x, tasks, {}, tasks, (len(states.keys) - len(rows), len(states.firsts) - len(rows)))


def read_runs(
    simulator: Simulator, points: ArrayLike, space: Space, journal: Journal, *, responses: Sequence[str] = ()
) -> Runs:
    """Look up the runs of points in the journal; nothing is run and nothing is written."""
    return make_agenda(simulator, points, space, journal).table(space, responses)


def caller_of(simulator: Simulator, space: Space) -> Caller:
    """How a simulator is called over a space."""
    options = simulator.options
    return Caller(simulator.identity, options.settings, options.defaults, space)


def make_task(simulator: Simulator, factors: dict[str, Value], replicate: int = 0) -> Task:
    """Give the run of one point, with its key."""
    key = run_key(simulator.identity, simulator.options.settings, factors, replicate)
    return Task(key, factors, replicate)


def row_keys(simulator: Simulator, points: Floats, space: Space) -> NDArray[np.uint64]:
    """The keys of the runs that points of a deterministic simulator need, as numbers, shape (n,)."""
    key = key_maker(simulator.identity, simulator.options.settings)
    numbers = (int(key(space.values(point), 0), 16) for point in points)
    return np.fromiter(numbers, np.uint64, len(points))


def _tasks(simulator: Simulator, x: Floats, space: Space) -> tuple[Task, ...]:
    """Give the run each point needs: repeated points share one, or are replicates of a noisy simulator."""
    key = key_maker(simulator.identity, simulator.options.settings)
    seen: Counter[tuple[float, ...]] = Counter()
    tasks = []
    for point in x:
        replicate = 0
        if not simulator.options.deterministic:
            place = tuple(point.tolist())
            replicate = seen[place]
            seen[place] += 1
        factors = space.values(point)
        tasks.append(Task(key(factors, replicate), factors, replicate))
    return tuple(tasks)
