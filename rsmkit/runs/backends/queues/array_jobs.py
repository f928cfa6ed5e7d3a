"""Where a driver and its jobs meet: a folder for each array job, whoever of them is alive.

The driver writes ``wave.json`` once; each task of the array appends what it has begun and what has ended to
a file of its own, and waits until that is on the disk. Nothing of it needs the driver: the next one reads on.
"""

from __future__ import annotations

import hashlib
import json
import os
import secrets
import shutil
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rsmkit.errors import RsmkitError
from rsmkit.io.files.atomic_files import write_text
from rsmkit.io.files.regular_files import open_regular, read_regular
from rsmkit.io.files.system_calls import read_at
from rsmkit.io.json_codec import from_json, read_json, to_json, write_json
from rsmkit.runs.one_run.execute import Outcome, Task
from rsmkit.runs.one_run.simulator import Simulator
from rsmkit.runs.options import SimulatorOptions
from rsmkit.runs.record.run import Run, Value, run_from_json, run_to_json

__all__ = ["Slice", "TaskFile", "WaveFolder", "open_waves", "remove_recorded", "write_wave"]

WAVE_FILE = "wave.json"
JOB_FILE = "job.txt"
STOPPED_FILE = "stopped"
LOG_BYTES = 4_000
"""Of a job's output that are looked at."""


@dataclass(frozen=True)
class TaskForm:
    """A run to be made, as it is written."""

    key: str
    factors: dict[str, Value]
    replicate: int
    attempt: int


@dataclass(frozen=True)
class WaveForm:
    """What the tasks of one array job must know."""

    system: str
    folder: str
    simulator: SimulatorOptions
    names: tuple[str, ...]
    jobs: int
    slices: tuple[tuple[TaskForm, ...], ...]
    guessed: bool = False
    """Whether the time of its jobs was taken from past runs."""


@dataclass(frozen=True)
class WaveFolder:
    """One array job on the disk."""

    path: Path
    form: WaveForm

    @property
    def name(self) -> str:
        """What the job is called, by which it is found though nobody noted its number."""
        return self.path.name

    @property
    def simulator(self) -> Simulator:
        """What the job runs."""
        return Simulator(self.form.simulator, Path(self.form.folder))

    def tasks(self, index: int) -> list[Task]:
        """Runs of one task of the array, from 1."""
        return [
            Task(item.key, dict(item.factors), item.replicate, item.attempt)
            for item in self.form.slices[index - 1]
        ]

    def task_file(self, index: int) -> TaskFile:
        """What one task of the array has written."""
        return TaskFile(self.path / f"{index}.jsonl")

    @property
    def job(self) -> str:
        """The system's number of the job; empty where it was not noted."""
        with suppress(OSError, UnicodeDecodeError):
            return read_regular(self.path / JOB_FILE, 200).decode().strip()
        return ""

    def note_job(self, job: str) -> None:
        """Note the number that the system gave."""
        write_text(self.path / JOB_FILE, job)

    @property
    def stopped(self) -> bool:
        """Whether the driver has taken its jobs back."""
        return (self.path / STOPPED_FILE).exists()

    def note_stopped(self) -> None:
        """Note that its jobs were taken back: what they have finished counts, the rest is to be made."""
        write_text(self.path / STOPPED_FILE, "")

    def last_words(self, index: int) -> str:
        """The last line that a job printed."""
        with suppress(OSError):
            handle = open_regular(self.path / f"{index}.log")
            with open(handle, "rb") as stream:
                stream.seek(max(0, os.fstat(handle).st_size - LOG_BYTES))
                lines = stream.read(LOG_BYTES).decode(errors="replace").split("\n")
            return next((line.strip()[:200] for line in reversed(lines) if line.strip()), "")
        return ""

    def remove(self) -> None:
        """Remove all of it, once it is in the journal: first its name, by which jobs could still write."""
        aside = _aside(self.path.parent, self.form.folder, self.name)
        with suppress(OSError):
            self.path.rename(aside)
        shutil.rmtree(aside, ignore_errors=True)


class TaskFile:
    """What one task of an array has begun and what has ended, a line each."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._position = 0
        self.begun: set[str] = set()
        """Runs that were handed to a worker since the task was opened last."""
        self.error = ""
        """What ended the task though no run is to blame."""

    def read_on(self) -> Iterator[Outcome]:
        """Give what has ended since the last look."""
        try:
            handle = open_regular(self.path)
        except OSError:
            return
        with open(handle, "rb") as stream:
            stream.seek(self._position)
            for line in stream:
                if not line.endswith(b"\n"):  # still being written, or torn by a crash
                    return
                self._position += len(line)
                with suppress(ValueError, KeyError, TypeError, AttributeError):
                    outcome = self._line(json.loads(line))
                    if outcome:
                        yield outcome

    def _line(self, data: dict[str, Any]) -> Outcome | None:
        if "opened" in data:
            self.begun, self.error = set(), ""
        elif "begun" in data:
            self.begun.add(str(data["begun"]))
        elif "error" in data:
            self.error = str(data["error"])
        else:
            run = run_from_json(json.dumps(data["run"]))
            return Outcome(run, str(data["traceback"]), str(data["output"]), bool(data["together"]))
        return None

    def open(self) -> None:
        """Open it for writing, for a new beginning; a line that a crash has torn is ended."""
        self._handle = open_regular(self.path, os.O_RDWR | os.O_CREAT | os.O_APPEND)
        size = os.fstat(self._handle).st_size
        if size and read_at(self._handle, 1, size - 1) != b"\n":
            os.write(self._handle, b"\n")
        self._write([{"opened": True}])

    def begin(self, task: Task) -> None:
        """Note that a run begins."""
        self._write([{"begun": task.key}])

    def end(self, outcomes: Iterable[Outcome]) -> None:
        """Note runs that have ended, and wait until that is on the disk."""
        self._write(
            {
                "run": json.loads(run_to_json(outcome.run)),
                "traceback": outcome.traceback,
                "output": outcome.output,
                "together": outcome.together,
            }
            for outcome in outcomes
        )
        os.fsync(self._handle)

    def fail(self, text: str) -> None:
        """Note what ends the task though no run is to blame."""
        self._write([{"error": text}])
        os.fsync(self._handle)

    def _write(self, lines: Iterable[dict[str, Any]]) -> None:
        data = "".join(f"{json.dumps(line)}\n" for line in lines).encode()
        while data:
            data = data[os.write(self._handle, data) :]


@dataclass
class Slice:
    """The runs of one task of an array, and what the driver knows of it."""

    wave: WaveFolder
    index: int
    tasks: dict[tuple[str, int], Task]
    file: TaskFile
    ended_at: float | None = None
    left: dict[tuple[str, int], Task] = field(init=False)
    """Runs of which nothing has come back."""

    def __post_init__(self) -> None:
        self.left = dict(self.tasks)

    @classmethod
    def of(cls, wave: WaveFolder, index: int) -> Slice:
        """Make the slice of one task of an array."""
        tasks = {(task.key, task.attempt): task for task in wave.tasks(index)}
        return cls(wave, index, tasks, wave.task_file(index))


def write_wave(
    home: Path,
    system: str,
    simulator: Simulator,
    names: tuple[str, ...],
    slices: Iterable[Iterable[Task]],
    jobs: int,
    *,
    guessed: bool = False,
) -> WaveFolder:
    """Make the folder of one array job; `jobs` runs are made at the same time in each of its tasks.

    `guessed` notes that the time of the jobs was taken from past runs.

    Raises
    ------
    RsmkitError
        If it cannot be written.
    """
    path = home / f"rsmkit-{secrets.token_hex(4)}"
    forms = tuple(tuple(TaskForm(*task) for task in tasks) for tasks in slices)
    form = WaveForm(system, _owner(simulator), simulator.options, names, jobs, forms, guessed)
    aside = _aside(home, form.folder, path.name)
    try:
        aside.mkdir(parents=True)
        write_json(aside / WAVE_FILE, to_json(form))
        aside.rename(path)
    except OSError as error:
        raise RsmkitError(f"{path}: cannot be made: {error.strerror}") from None
    return WaveFolder(path, form)


def _owner(simulator: Simulator) -> str:
    return str(simulator.folder.resolve())


def _aside(home: Path, owner: str, name: str) -> Path:
    """Where a folder is made and removed, so that what has its own name is whole, whenever a driver dies."""
    return home / f".{_mark(owner)}-{name}"


def _mark(owner: str) -> str:
    return hashlib.sha256(owner.encode()).hexdigest()[:8]


def _remove_unfinished(home: Path, simulator: Simulator) -> None:
    """Remove what a driver of this simulator was making or removing when it died."""
    for path in home.glob(f".{_mark(_owner(simulator))}-*"):
        if not path.is_symlink():
            shutil.rmtree(path, ignore_errors=True)


def open_waves(home: Path, simulator: Simulator) -> Iterator[WaveFolder]:
    """Read what earlier drivers have left; what cannot be read is none of ours."""
    if home.is_symlink() or home.parent.is_symlink():
        raise RsmkitError(
            f"{home}: lies behind a link, and links are not followed; put a folder in its place"
        )
    _remove_unfinished(home, simulator)
    for path in sorted(home.glob("rsmkit-*")):
        with suppress(RsmkitError):
            yield read_wave(path)


def remove_recorded(home: Path, simulator: Simulator, recorded: Mapping[str, Run]) -> None:
    """Remove what is in the journal as a whole: a driver may die between recording it and removing it."""
    with suppress(RsmkitError):
        for wave in open_waves(home, simulator):
            runs = {task.key: task.attempt for tasks in wave.form.slices for task in tasks}
            if all(key in recorded and recorded[key].attempt >= attempt for key, attempt in runs.items()):
                wave.remove()


def read_wave(path: Path) -> WaveFolder:
    """Read one.

    Raises
    ------
    RsmkitError
        If it is damaged.
    """
    document = read_json(path / WAVE_FILE, "Start the evaluation again.")
    return WaveFolder(path, from_json(WaveForm, document, path / WAVE_FILE, "Start the evaluation again."))
