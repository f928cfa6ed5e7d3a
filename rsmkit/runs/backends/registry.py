"""The register of evaluation backends: a new one is a file beside this one, and a row here.

What loops over it: ``--backend`` and the flags of the command line, ``rk.evaluate``, the commands' reference,
the contract test. This module must cost nothing to import, so a row imports its pool when one is wanted.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

from rsmkit.errors import RsmkitError, one_of
from rsmkit.runs.backends.options import (
    BackendOptions,
    DaskOptions,
    LokyOptions,
    PbsOptions,
    QueueOptions,
    SlurmOptions,
)

if TYPE_CHECKING:
    from rsmkit.runs.backends.pool import Pool
    from rsmkit.runs.one_run.simulator import Simulator
    from rsmkit.runs.record.run import Run

__all__ = ["BACKENDS", "Backend", "backend_options", "pool_maker"]


@dataclass(frozen=True)
class Backend:
    """One place where runs are made.

    Parameters
    ----------
    word : str
        What ``--backend`` and ``rk.evaluate`` call it.
    where : str
        The place, for people: "this computer".
    options : type
        What it must know: a frozen dataclass derived from
        :class:`rsmkit.runs.backends.options.BackendOptions`.
    make_pool : callable
        ``make_pool(options, simulator, jobs, runs)`` gives a :class:`rsmkit.runs.backends.pool.Pool` that
        makes `jobs` runs at the same time, as many as it can when that is None. There are at most `runs` to
        make: more workers than that are of no use.
    tidy : callable
        ``tidy(options, simulator, recorded)`` removes what a dead driver has left behind, where nothing is to
        be made; `recorded` are the runs of the journal by key.
    """

    word: str
    where: str
    options: type[BackendOptions]
    make_pool: Callable[[Any, Simulator, int | None, int], Pool]
    tidy: Callable[[Any, Simulator, Mapping[str, Run]], None] = lambda options, simulator, recorded: None


def _processes(options: LokyOptions, simulator: Simulator, jobs: int | None, runs: int) -> Pool:
    from rsmkit.runs.backends.loky_pool import LokyPool, usable_cores

    return LokyPool(min(jobs or usable_cores(), runs), commands=bool(simulator.options.command))


def _cluster(options: DaskOptions, simulator: Simulator, jobs: int | None, runs: int) -> Pool:
    from rsmkit.runs.backends.dask_pool import DaskPool

    return DaskPool(options.scheduler, jobs, options.wait_s)


def _queue(word: str) -> Callable[[QueueOptions, Simulator, int | None, int], Pool]:
    def make(options: QueueOptions, simulator: Simulator, jobs: int | None, runs: int) -> Pool:
        from rsmkit.runs.backends.queues.queue_pool import QueuePool
        from rsmkit.runs.backends.queues.systems import SYSTEMS

        return QueuePool(SYSTEMS[word], options, simulator, min(jobs or QUEUED, runs))

    return make


def _tidy_queue(options: QueueOptions, simulator: Simulator, recorded: Mapping[str, Run]) -> None:
    from rsmkit.runs.backends.queues.array_jobs import remove_recorded
    from rsmkit.runs.backends.queues.queue_pool import meeting_place

    remove_recorded(meeting_place(options, simulator), simulator, recorded)


QUEUED = 100
"""Jobs in a queue at the same time, unless it is said how many."""

BACKENDS = {
    row.word: row
    for row in (
        Backend("loky", "this computer", LokyOptions, _processes),
        Backend("dask", "a dask cluster", DaskOptions, _cluster),
        Backend("slurm", "jobs of Slurm", SlurmOptions, _queue("slurm"), _tidy_queue),
        Backend("pbs", "jobs of PBS", PbsOptions, _queue("pbs"), _tidy_queue),
    )
}
"""Every backend, by its word; the first is the default."""


def backend_options(word: str, **keys: Any) -> BackendOptions:
    """The options of a backend.

    Parameters
    ----------
    word : str
        A word of the register.
    **keys
        The fields of its options.

    Raises
    ------
    RsmkitError
        If there is no such backend, or it has no such option.

    Examples
    --------
    >>> backend_options("dask", scheduler="tcp://host:8786")
    DaskOptions(scheduler='tcp://host:8786', wait_s=0.0)
    """
    kind = BACKENDS[one_of("backend", word, BACKENDS)].options
    known = [item.name for item in fields(kind)]
    for key in keys:
        takers = [row.word for row in BACKENDS.values() if key in {item.name for item in fields(row.options)}]
        if takers and word not in takers:
            raise RsmkitError(
                f"{key} has no effect on the {word} backend; leave it out, or take the {' or '.join(takers)} "
                "backend"
            )
        if not known:
            raise RsmkitError(f"the {word} backend has no options; got {key!r:.60}")
        one_of(f"an option of the {word} backend", key, known)
    return kind(**keys)


def pool_maker(
    word: str, options: BackendOptions, simulator: Simulator, runs: int
) -> Callable[[int | None], Pool]:
    """Give what makes a pool of the given number of jobs, for at most `runs` runs of a simulator.

    Raises
    ------
    RsmkitError
        If the options are not sound.
    """
    row = BACKENDS[word]
    for _, text in options.problems():
        raise RsmkitError(f"the {word} backend {text}")
    return lambda jobs: row.make_pool(options, simulator, jobs, runs)
