"""Worker processes on this computer."""

from __future__ import annotations

import os
import re
import shutil
import tempfile
import threading
import warnings
from collections.abc import Iterator, Sequence
from concurrent.futures import BrokenExecutor, Future
from contextlib import ExitStack, suppress
from functools import partial
from importlib.metadata import version
from multiprocessing import resource_tracker
from pathlib import Path
from time import monotonic
from typing import Any
from weakref import WeakKeyDictionary

from rsmkit.errors import RsmkitError
from rsmkit.io.files.system_calls import KILL, masked
from rsmkit.runs.backends.pool import Pool
from rsmkit.runs.one_run.execute import LOADING_S, WARM_UP_S, Outcome, Task, run_tasks
from rsmkit.runs.one_run.interrupts import STOP_SIGNALS
from rsmkit.runs.one_run.output_limit import drop_beginning, last_bytes
from rsmkit.runs.one_run.simulator import Simulator
from rsmkit.runs.one_run.worker import OUTPUT_KEPT_BYTES, PRINTED, start_worker

__all__ = ["LokyPool", "usable_cores", "workers_of"]

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

TIDY_S = 0.1
FAREWELL_S = 5.0
STOPPED_S = 10.0


class LokyPool(Pool):
    """Processes on this computer, from loky's executor.

    A pool of one worker keeps what is printed in a file, so that it survives a crash.

    Parameters
    ----------
    jobs : int
        Number of worker processes.
    commands : bool
        The runs are external programs, which a worker must have time to end before it dies.
    """

    def __init__(self, jobs: int, *, commands: bool = False) -> None:
        from loky import ProcessPoolExecutor

        self.jobs = jobs
        self._tidied = monotonic()
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
            self._executor: Any = ProcessPoolExecutor(
                jobs,
                initializer=start_worker,
                initargs=(os.getpid(), str(self._capture or ""), str(self._notes or ""), not commands),
                env=_ONE_THREAD,
            )
        except (OSError, NotImplementedError) as error:
            raise RsmkitError(f"worker processes cannot be set up on this computer: {error}") from None
        workers_of(self._executor)
        # loky replaces a worker whose memory keeps growing, which is as it should be.
        self._quiet = ExitStack()
        self._quiet.enter_context(warnings.catch_warnings())
        warnings.filterwarnings("ignore", "A worker (stopped while some jobs|was restarted)", UserWarning)

    def submit(
        self, simulator: Simulator, tasks: Sequence[Task], names: tuple[str, ...]
    ) -> Future[list[Outcome]]:
        """Hand a batch of runs to the next free worker."""
        try:
            with masked(STOP_SIGNALS):  # inherited at the start, and lifted by a process once it is deaf
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
        with suppress(OSError), open(self._capture, "rb") as stream:
            return last_bytes(stream.fileno(), OUTPUT_KEPT_BYTES).decode(errors="replace")
        return ""

    def check(self) -> None:
        """Keep what workers print short; they cannot while their simulator lets no other thread work."""
        if monotonic() - self._tidied < TIDY_S:
            return
        self._tidied = monotonic()
        printed = [self._capture] if self._capture else []
        printed += list(self._notes.glob(f"*{PRINTED}")) if self._notes else []
        for path in printed:
            with suppress(OSError), open(path, "r+b") as stream:
                drop_beginning(stream.fileno())

    @property
    def patience_s(self) -> float:
        """Time that a worker has to end itself; one that reads what a program has left needs more."""
        stopped = any(_is_stopped(pid) for pid in workers_of(self._executor))
        return STOPPED_S if stopped else LOADING_S + STOPPED_S

    def age_s(self, future: Future[list[Outcome]]) -> float:
        """Time since a worker began a batch; before, since it should have loaded and warmed its simulator."""
        key, handed = self._handed[future]
        waited = monotonic() - handed
        if self._notes is None:
            return waited
        began = [when for noted, when in _read_notes(self._notes) if noted == key and when >= handed]
        return monotonic() - max(began) if began else waited - LOADING_S - WARM_UP_S

    def death_cause(self, error: BaseException) -> str:
        """Name what ended a worker, from loky's message."""
        found = re.search(r"exit codes of the workers are \{(.*?)\}", str(error))
        names = re.findall(r"(SIG\w+)\(-\d+\)", found[1]) if found else []
        codes = re.findall(r"[A-Z]+\((\d+)\)", found[1]) if found else []
        return names[0] if names else f"exit code {codes[0]}" if codes else "unknown cause"

    def close(self, *, kill: bool) -> None:
        """Let the workers go, or kill them; also those that cannot end for what a simulator left behind."""
        workers = workers_of(self._executor)  # now, as loky forgets them when it kills
        shutdown = partial(self._executor.shutdown, wait=True, kill_workers=kill)
        closing = threading.Thread(target=shutdown, daemon=True)
        closing.start()
        closing.join(FAREWELL_S)
        if closing.is_alive():
            for pid in workers:
                with suppress(ProcessLookupError):
                    os.kill(pid, KILL)
            closing.join()
        self._quiet.close()
        if self._capture is not None:
            self._capture.unlink(missing_ok=True)
        if self._notes is not None:
            shutil.rmtree(self._notes, ignore_errors=True)


def usable_cores() -> int:
    """Cores this process may use, containers and affinity considered."""
    from loky import cpu_count

    return int(cpu_count())


def workers_of(executor: Any) -> list[int]:
    """Process identifiers of an executor's workers.

    loky has no public way to ask for them, and they are needed to tell a worker that was stopped from one
    that is deep in its work, and to end one that will not end by itself. This is the only private part of
    loky that is used here; every new pool asks at once, before any run depends on the answer.

    Raises
    ------
    RsmkitError
        If this version of loky does not say.
    """
    processes = getattr(executor, "_processes", None)
    if not isinstance(processes, dict):
        raise RsmkitError(
            f"loky {version('loky')} does not show its worker processes as rsmkit needs it. Install the "
            "version that constraints.txt names: pip install 'loky>=3.7,<3.8'"
        )
    return list(processes)


def _read_notes(folder: Path) -> Iterator[tuple[str, float]]:
    """What each worker began last, and when by the clock that all processes share."""
    for path in folder.iterdir():
        if path.suffix == PRINTED:
            continue
        with suppress(OSError, ValueError):  # being written at this moment
            key, when = path.read_text().split()
            yield key, float(when)


def _start_trackers() -> None:
    """Start the processes that clean up after the workers, without the driver's output.

    They live as long as anything that a simulator left running, and would keep a pipe that the driver writes
    to open as long. Starting them later, between two workers, would lift the signal mask that protects these.
    """
    if os.name == "nt":
        return  # there it needs none
    from loky.backend import resource_tracker as loky_tracker

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


def _is_stopped(pid: int) -> bool:
    """Whether a process was stopped from outside (``SIGSTOP``), where ``/proc`` can tell."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "T"
    except OSError:
        return False
