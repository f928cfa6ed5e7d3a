"""Workers of a dask cluster, wherever it runs."""

from __future__ import annotations

import os
import signal
from collections.abc import Sequence
from concurrent.futures import CancelledError, Future
from contextlib import suppress
from time import monotonic
from typing import Any

from rsmkit.errors import RsmkitError
from rsmkit.runs.execute import Outcome, Task, run_tasks
from rsmkit.runs.pools import WorkerDiedError
from rsmkit.runs.simulator import Simulator

__all__ = ["DaskPool"]

CONNECT_S = 15.0
CHECK_EVERY_S = 5.0
WITHOUT_WORKERS_S = 60.0


class DaskPool:
    """Runs on a dask cluster that already stands.

    When a worker dies, dask repeats its runs on others by itself; it gives up a run that was there
    when several workers died. The study's folder must be visible to the workers under the same path.

    Parameters
    ----------
    scheduler : str
        Address, ``tcp://host:8786``.
    jobs : int, optional
        Runs under way at the same time; by default one for each thread of the cluster.
    """

    patience_s = 15.0
    busy_patience_s = 60.0  # when runs wait for one another on the cluster

    def __init__(self, scheduler: str, jobs: int | None = None) -> None:
        try:
            from distributed import Client
        except ImportError:
            raise RsmkitError(
                "the dask backend needs the package distributed. Install it: pip install 'rsmkit[dask]'"
            ) from None
        connect: Any = Client  # untyped
        self._scheduler = scheduler
        try:
            self._client: Any = connect(scheduler, timeout=CONNECT_S, set_as_default=False)
        except (OSError, ValueError) as error:
            raise RsmkitError(f"no dask scheduler answers at {scheduler}: {error}") from None
        threads = sum(self._client.nthreads().values())
        self.jobs = jobs or max(threads, 1)
        if self.jobs > threads:
            self.patience_s = self.busy_patience_s
        self._pairs: dict[Future[list[Outcome]], Any] = {}
        self._checked = self._workers_seen = monotonic()

    def submit(
        self, simulator: Simulator, tasks: Sequence[Task], names: tuple[str, ...]
    ) -> Future[list[Outcome]]:
        """Hand a batch of runs to the scheduler."""
        future: Future[list[Outcome]] = Future()
        theirs = self._client.submit(run_tasks, simulator, tasks, names, pure=False)
        self._pairs[future] = theirs
        theirs.add_done_callback(lambda done: self._settle(future, done))
        return future

    def output(self) -> str:
        """Nothing: what dask workers print goes to their own logs."""
        return ""

    def check(self) -> None:
        """Make sure, now and then, that the scheduler answers and has workers.

        Raises
        ------
        RsmkitError
            If it does not answer, or has had no worker for a minute.
        """
        now = monotonic()
        if now - self._checked < CHECK_EVERY_S:
            return
        self._checked = now
        try:
            workers = self._client.nthreads()
        except Exception as error:
            raise self._lost(error) from None
        if workers:
            self._workers_seen = now
        elif now - self._workers_seen > WITHOUT_WORKERS_S:
            raise RsmkitError(
                f"the dask cluster at {self._scheduler} has no workers any more. Start some; nothing "
                "recorded is lost, and the same command goes on."
            )

    def is_running(self, future: Future[list[Outcome]]) -> bool:
        """Whether a worker has the batch already."""
        return bool(self._holders(self._pairs[future]))

    def abandon(self, future: Future[list[Outcome]]) -> bool:
        """Kill the worker that holds the batch: its nanny starts another, dask repeats what else it did."""
        theirs = self._pairs.pop(future)
        holders = self._holders(theirs)
        theirs.cancel(force=True)
        with suppress(Exception):  # a worker without a nanny cannot be replaced: it goes on in vain
            self._client.run(_kill_worker, workers=holders, nanny=True, wait=False)
        return True

    def close(self, *, kill: bool) -> None:
        """Leave the cluster; runs still under way there are cancelled."""
        for theirs in self._pairs.values():
            with suppress(Exception):
                theirs.cancel(force=True)
        self._client.close()

    def _settle(self, future: Future[list[Outcome]], theirs: Any) -> None:
        from distributed import KilledWorker

        if self._pairs.pop(future, None) is None:
            return  # abandoned
        try:
            future.set_result(theirs.result())
        except KilledWorker:
            future.set_exception(WorkerDiedError("and so did every dask worker it was tried on"))
        except (CancelledError, OSError) as error:
            future.set_exception(self._lost(error))
        except ImportError as error:
            future.set_exception(RsmkitError(f"the dask workers cannot import what they need: {error}"))
        except Exception as error:
            future.set_exception(error)

    def _holders(self, theirs: Any) -> list[str]:
        return [worker for worker, keys in self._client.processing().items() if theirs.key in keys]

    def _lost(self, error: BaseException) -> RsmkitError:
        return RsmkitError(
            f"the dask scheduler at {self._scheduler} was lost ({type(error).__name__}). "
            "Nothing recorded is lost; the same command goes on."
        )


def _kill_worker(dask_worker: Any) -> None:
    """Called in a nanny, which is asked because a worker deep in compiled code answers nobody."""
    os.kill(dask_worker.pid, signal.SIGKILL)
