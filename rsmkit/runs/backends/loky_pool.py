"""Worker processes on this computer."""

from __future__ import annotations

import os
import re
import shutil
import signal
import tempfile
import threading
from collections.abc import Iterator, Sequence
from concurrent.futures import BrokenExecutor, Future
from contextlib import contextmanager, suppress
from functools import partial
from multiprocessing import resource_tracker
from pathlib import Path
from queue import Empty
from time import monotonic
from weakref import WeakKeyDictionary

from rsmkit.errors import RsmkitError
from rsmkit.runs.one_run.execute import LOADING_S, WARM_UP_S, Outcome, Task, run_tasks
from rsmkit.runs.one_run.interrupts import STOP_SIGNALS
from rsmkit.runs.one_run.simulator import Simulator
from rsmkit.runs.one_run.worker import start_worker

__all__ = ["LokyPool", "death_cause"]

# Results must not depend on how many threads a linear-algebra library takes, nor cores be claimed twice.
_ONE_THREAD = dict.fromkeys(
    (
        "OMP_NUM_THREADS",
        "OPENBLAS_NUM_THREADS",
        "MKL_NUM_THREADS",
        "BLIS_NUM_THREADS",
        "VECLIB_MAXIMUM_THREADS",
        "NUMEXPR_NUM_THREADS",
        "NUMBA_NUM_THREADS",
    ),
    "1",
)

FAREWELL_S = 5.0
STOPPED_S = 10.0


class LokyPool:
    """Processes on this computer, from the loky executor that joblib brings.

    A pool of one worker keeps what is printed in a file, so that it survives a crash.

    Parameters
    ----------
    jobs : int
        Number of worker processes.
    commands : bool
        The runs are external programs, which a worker must have time to end before it dies.
    """

    def __init__(self, jobs: int, *, commands: bool = False) -> None:
        from joblib.externals.loky import ProcessPoolExecutor

        self.jobs = jobs
        self._capture: Path | None = None
        self._notes: Path | None = None
        self._handed: WeakKeyDictionary[Future[list[Outcome]], tuple[str, float]] = WeakKeyDictionary()
        with suppress(OSError):  # without them the time that workers need to load counts as well
            self._notes = Path(tempfile.mkdtemp(prefix="rsmkit-"))
        _start_trackers()
        try:
            if jobs == 1:
                handle, name = tempfile.mkstemp(prefix="rsmkit-", suffix=".txt")
                os.close(handle)
                self._capture = Path(name)
            self._executor = ProcessPoolExecutor(
                jobs,
                initializer=start_worker,
                initargs=(os.getpid(), str(self._capture or ""), str(self._notes or ""), not commands),
                env=_ONE_THREAD,
            )
        except (OSError, NotImplementedError) as error:
            raise RsmkitError(f"worker processes cannot be set up on this computer: {error}") from None

    def submit(
        self, simulator: Simulator, tasks: Sequence[Task], names: tuple[str, ...]
    ) -> Future[list[Outcome]]:
        """Hand a batch of runs to the next free worker."""
        try:
            with _signals_held_back():
                future: Future[list[Outcome]] = self._executor.submit(run_tasks, simulator, tasks, names)
                self._handed[future] = (tasks[0].key, monotonic())
                return future
        except BrokenExecutor:
            raise
        except Exception as error:  # loky stumbles on its way out when it cannot open a pipe
            reason = getattr(error, "strerror", None) or getattr(error.__context__, "strerror", None) or error
            raise RsmkitError(f"worker processes cannot be started: {reason}. Try fewer jobs.") from None

    def output(self) -> str:
        """Give what the only worker's last run printed."""
        if self._capture is None:
            return ""
        return self._capture.read_text(encoding="utf-8", errors="replace")

    def check(self) -> None:
        """Nothing: a pool that breaks says so through its futures."""

    @property
    def patience_s(self) -> float:
        """Time that a worker has to end itself; one that reads what a program has left needs more."""
        stopped = any(_is_stopped(worker.pid) for worker in tuple(self._executor._processes.values()))
        return STOPPED_S if stopped else LOADING_S + STOPPED_S

    def age_s(self, future: Future[list[Outcome]]) -> float:
        """Time since a worker began a batch; before, since it should have loaded and warmed its simulator."""
        key, handed = self._handed[future]
        waited = monotonic() - handed
        if self._notes is None:
            return waited
        began = [when for noted, when in _read_notes(self._notes) if noted == key and when >= handed]
        return monotonic() - max(began) if began else waited - LOADING_S - WARM_UP_S

    def abandon(self, future: Future[list[Outcome]]) -> bool:
        """Nothing: loky ends all workers or none."""
        return False

    def close(self, *, kill: bool) -> None:
        """Let the workers go, or kill them; also those that cannot end for what a simulator left behind."""
        workers = list((self._executor._processes or {}).values())
        with suppress(Empty):
            while kill:  # loky stumbles over what was submitted and not yet sent when it kills
                self._executor._work_ids.get_nowait()
        shutdown = partial(self._executor.shutdown, wait=True, kill_workers=kill)
        closing = threading.Thread(target=shutdown, daemon=True)
        closing.start()
        closing.join(FAREWELL_S)
        if closing.is_alive():
            for worker in workers:
                with suppress(ProcessLookupError):
                    os.kill(worker.pid, signal.SIGKILL)
            closing.join()
        if self._capture is not None:
            self._capture.unlink(missing_ok=True)
        if self._notes is not None:
            shutil.rmtree(self._notes, ignore_errors=True)


def _read_notes(folder: Path) -> Iterator[tuple[str, float]]:
    """What each worker began last, and when by the clock that all processes share."""
    for path in folder.iterdir():
        with suppress(OSError, ValueError):  # being written at this moment
            key, when = path.read_text().split()
            yield key, float(when)


def _start_trackers() -> None:
    """Start the processes that clean up after the workers, without the driver's output.

    They live as long as anything that a simulator left running, and would keep a pipe that the driver writes
    to open as long. Starting them later, between two workers, would lift the signal mask that protects these.
    """
    from joblib.externals.loky.backend import resource_tracker as loky_tracker

    nothing = os.open(os.devnull, os.O_RDWR)
    kept = [os.dup(number) for number in (1, 2)]
    try:
        for number in (1, 2):
            os.dup2(nothing, number)
        resource_tracker.ensure_running()
        loky_tracker.ensure_running()
    finally:
        for number, handle in zip((1, 2), kept, strict=True):
            os.dup2(handle, number)
        for handle in (nothing, *kept):
            os.close(handle)


def death_cause(error: BaseException) -> str:
    """Name what ended a worker process, from loky's message: ``SIGSEGV``, ``exit code 3``."""
    found = re.search(r"exit codes of the workers are \{(.*?)\}", str(error))
    names = re.findall(r"(SIG\w+)\(-\d+\)", found[1]) if found else []
    codes = re.findall(r"[A-Z]+\((\d+)\)", found[1]) if found else []
    return names[0] if names else f"exit code {codes[0]}" if codes else "unknown cause"


def _is_stopped(pid: int) -> bool:
    """Whether a process was stopped from outside (``SIGSTOP``), where ``/proc`` can tell."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "T"
    except OSError:
        return False


@contextmanager
def _signals_held_back() -> Iterator[None]:
    """Keep Ctrl-C from processes as they start: they inherit the mask and lift it once they ignore it."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, STOP_SIGNALS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
