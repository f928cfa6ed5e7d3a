"""Workers of a dask cluster, wherever it runs."""

from __future__ import annotations

import math
import sys
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import CancelledError, Future
from contextlib import suppress
from functools import partial
from time import monotonic
from typing import Any
from weakref import WeakKeyDictionary

from rsmkit.errors import RsmkitError
from rsmkit.runs.backends.pool import Pool, WorkerDiedError
from rsmkit.runs.one_run.execute import Outcome, Task
from rsmkit.runs.one_run.simulator import Simulator

__all__ = ["DaskPool"]

CONNECT_S = 15.0
CHECK_EVERY_S = 5.0
SILENCE_S = 60.0
ANSWER_S = 5.0
WITHOUT_WORKERS_S = 60.0
FIRST_WORKER_S = 86_400.0
"""Workers may have to wait in a queue themselves."""
AHEAD = 8
"""Batches beyond its threads, by which a cluster that begins without workers sees how many are wanted."""
FAREWELL_S = 5.0

# What happens to the cluster is said once, by an error of ours; dask would add tracebacks of its own.
_QUIET = {"logging": {"distributed": "critical", "distributed.client": "critical"}}


class DaskPool(Pool):
    """Runs on a dask cluster that already stands.

    When a worker dies, dask repeats its runs on others by itself; it gives up a run that was there
    when several workers died. The study's folder must be visible to the workers under the same path.

    Parameters
    ----------
    scheduler : str
        Address, ``tcp://host:8786``.
    jobs : int, optional
        Runs under way at the same time; by default one for each thread of the cluster, however many it has.
    wait_s : float
        How long to wait for workers; by default a day for the first, a minute once there were some.
    """

    patience_s = 15.0
    busy_patience_s = 60.0  # when runs wait for one another on the cluster

    def __init__(self, scheduler: str, jobs: int | None = None, wait_s: float = 0.0) -> None:
        try:
            import dask

            if "distributed" not in sys.modules:  # otherwise its messages are set up already
                dask.config.set(_QUIET)
            from distributed import Client
        except ImportError:
            raise RsmkitError(
                "the dask backend needs the package distributed. Install it: pip install 'rsmkit[dask]'"
            ) from None
        connect: Any = Client  # untyped
        self._scheduler = scheduler
        try:
            joined = _asked(lambda: connect(scheduler, timeout=CONNECT_S, set_as_default=False))
            self._client: Any = joined.result(CONNECT_S)
            threads = sum(_asked(self._client.nthreads).result(CONNECT_S).values())
        except (OSError, ValueError) as error:
            reason = str(error) or f"waited {CONNECT_S:g} s"
            raise RsmkitError(f"no dask scheduler answers at {scheduler}: {reason}") from None
        self.jobs = jobs or max(threads, 1)
        self.grows = jobs is None
        self.ahead = AHEAD if self.grows and not threads else 0
        self._wait_s, self._seen_any = wait_s, threads > 0
        if self.jobs + self.ahead > threads:
            self.patience_s = self.busy_patience_s
        self._pairs: dict[Future[list[Outcome]], Any] = {}
        self._keys: WeakKeyDictionary[Future[list[Outcome]], str] = WeakKeyDictionary()
        self._asked_at = self._workers_seen = monotonic()
        self._answer: Future[dict[str, int]] | None = None

    def submit(
        self, simulator: Simulator, tasks: Sequence[Task], names: tuple[str, ...]
    ) -> Future[list[Outcome]]:
        """Hand a batch of runs to the scheduler."""
        from distributed.protocol.pickle import dumps

        future: Future[list[Outcome]] = Future()
        try:
            theirs = self._client.submit(_run_there, dumps((simulator, tasks, names)), pure=False)
        except Exception as error:  # the client has given up
            raise self._lost(error) from None
        self._pairs[future], self._keys[future] = theirs, tasks[0].key
        theirs.add_done_callback(lambda done: self._settle(future, done))
        return future

    def check(self) -> None:
        """Make sure, now and then, that the scheduler answers and has workers, and see how many.

        Raises
        ------
        RsmkitError
            If it has not answered for a minute, or has had no worker for longer than is waited.
        """
        now = monotonic()
        if self._answer is None:
            if now - self._asked_at >= CHECK_EVERY_S:
                self._asked_at, self._answer = now, _asked(self._client.nthreads)
            return
        if not self._answer.done():
            if now - self._asked_at > SILENCE_S:
                raise self._lost(f"no answer for {SILENCE_S:g} s")
            return
        answer, self._answer = self._answer, None
        if error := answer.exception():
            raise self._lost(error)
        threads = answer.result()
        if threads:
            self._workers_seen, self._seen_any = now, True
            self.jobs = max(sum(threads.values()), 1) if self.grows else self.jobs
            return
        patience = WITHOUT_WORKERS_S if self._seen_any else FIRST_WORKER_S
        if now - self._workers_seen > (self._wait_s or patience):
            has_none = "has no workers any more" if self._seen_any else "has got no workers"
            raise RsmkitError(
                f"the dask cluster at {self._scheduler} {has_none}. Start some; nothing "
                "recorded is lost, and the same command goes on."
            )

    def age_s(self, future: Future[list[Outcome]]) -> float:
        """Time since a worker began a batch, by its own account; one that does not answer is deep in it."""
        theirs = self._pairs.get(future)  # gone when it has just ended
        holders = self._holders(theirs) if theirs is not None else []
        if not holders:
            return 0.0
        question = partial(self._client.run, _age_there, self._keys[future], workers=holders)
        try:
            ages = _asked(question).result(ANSWER_S).values()
        except Exception:
            return math.inf
        return max((age for age in ages if age is not None), default=0.0)

    def abandon(self, future: Future[list[Outcome]]) -> bool:
        """Kill the worker that holds the batch: its nanny starts another, dask repeats what else it did."""
        theirs = self._pairs.pop(future, None)
        if theirs is None:  # it has just ended
            return True
        holders = self._holders(theirs)
        theirs.cancel(force=True)
        # A worker without a nanny cannot be replaced: it goes on in vain.
        _asked(lambda: self._client.run(_kill_worker, workers=holders, nanny=True, wait=False))
        return True

    def close(self, *, kill: bool) -> None:
        """Leave the cluster, also one that is silent; runs still under way there are cancelled."""
        pairs, self._pairs = self._pairs, {}
        for theirs in tuple(pairs.values()):
            with suppress(Exception):
                theirs.cancel(force=True)
        with suppress(Exception):
            _asked(self._client.close).result(FAREWELL_S)

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
        try:
            held = _asked(self._client.processing).result(SILENCE_S)
        except Exception as error:
            raise self._lost(error) from None
        return [worker for worker, keys in held.items() if theirs.key in keys]

    def _lost(self, reason: BaseException | str) -> RsmkitError:
        why = reason if isinstance(reason, str) else type(reason).__name__
        return RsmkitError(
            f"the dask scheduler at {self._scheduler} was lost ({why}). "
            "Nothing recorded is lost; the same command goes on."
        )


def _asked(question: Callable[[], Any]) -> Future[Any]:
    """Ask in a thread of its own: a scheduler that is silent would hold up whoever asks for ever."""
    answer: Future[Any] = Future()

    def ask() -> None:
        try:
            answer.set_result(question())
        except BaseException as error:
            answer.set_exception(error)

    threading.Thread(target=ask, daemon=True).start()
    return answer


def _by_value(function: Callable[..., Any]) -> Callable[..., Any]:
    """Have a function sent as it is, not by its name.

    A process that has to import it first does so in its event loop, and answers nobody meanwhile.
    """
    function.__module__ = "__main__"
    return function


@_by_value
def _run_there(batch: bytes) -> Any:
    """Make runs, in a thread of a worker, where whatever they need is imported as well."""
    from distributed.protocol.pickle import loads

    from rsmkit.runs.one_run.execute import run_tasks

    return run_tasks(*loads(batch))


@_by_value
def _age_there(key: str) -> float | None:
    """Seconds since a worker began a batch; None while it has not, or is still importing what runs need."""
    import sys

    ask = getattr(sys.modules.get("rsmkit.runs.one_run.worker"), "seconds_under_way", None)
    return ask(key) if ask else None


@_by_value
async def _kill_worker(dask_worker: Any) -> None:
    """Called in a nanny, which is asked because a worker deep in compiled code answers nobody.

    A coroutine, as dask has what nobody waits for.
    """
    import os
    import signal

    os.kill(dask_worker.pid, signal.SIGKILL)
