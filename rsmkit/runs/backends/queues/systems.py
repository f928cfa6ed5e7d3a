"""The commands of batch systems: submit an array, ask how its tasks fare, take them back."""

from __future__ import annotations

import json
import re
import shlex
import subprocess
from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, Literal

from rsmkit.errors import RsmkitError
from rsmkit.runs.backends.options import QueueOptions

__all__ = ["SYSTEMS", "BatchSystem", "JobState", "Pbs", "SilentError", "Slurm"]

ANSWER_S = 60.0
Fate = Literal["waiting", "running", "done", "lost", "cancelled", "overtime", "memory", "failed"]
"""How a task of an array fares; ``lost`` with its node or to a job of higher rank: nobody's fault."""


class SilentError(Exception):
    """The system does not answer at the moment, or takes no job now; later it may."""


@dataclass(frozen=True)
class JobState:
    """How one task of an array fares: what it means here, the system's own word, and on which node."""

    fate: Fate
    word: str
    node: str = ""


class BatchSystem(ABC):
    """One batch system; ``word`` is what ``--backend`` calls it."""

    word: ClassVar[str]
    index: ClassVar[str]
    """Environment variable with the number of a task in its array."""
    least: ClassVar[int] = 1
    """Tasks that an array must have."""
    passing: ClassVar[str]
    """What a refusal says that need not be one the next time, as a pattern."""

    @abstractmethod
    def submission(self, options: QueueOptions, name: str, count: int, script: Path) -> list[str]:
        """The words of the command that submits an array of tasks 1 to `count`."""

    @abstractmethod
    def states(self, jobs: Iterable[str]) -> dict[tuple[str, int], JobState]:
        """How the tasks of jobs fare, by job and number; those that the system has forgotten are left out."""

    @abstractmethod
    def find(self, name: str) -> str:
        """The number of the job of a name; empty when there is none."""

    @abstractmethod
    def cancel(self, jobs: Sequence[str]) -> None:
        """Take jobs back, those that run as well."""

    def submit(self, options: QueueOptions, name: str, count: int, script: Path) -> str:
        """Submit an array of tasks 1 to `count`; give its number.

        Raises
        ------
        RsmkitError
            With what the system says, when it refuses.
        SilentError
            When it may take the job later.
        """
        words = self.submission(options, name, max(count, self.least), script)
        code, told, said = _ask(words)
        if code == 0:
            return told.strip().partition(";")[0]
        if re.search(self.passing, said, re.IGNORECASE):
            raise SilentError(said)
        raise RsmkitError(f"{words[0]} refuses the job: {said or f'exit code {code}'}")


class Slurm(BatchSystem):
    """Slurm: ``sbatch``, ``squeue``, ``sacct``, ``scancel``."""

    word = "slurm"
    index = "SLURM_ARRAY_TASK_ID"
    passing = "timed out|unable to contact|temporarily|try again|QOSMaxSubmit|AssocMaxSubmit|job limit"

    def submission(self, options: QueueOptions, name: str, count: int, script: Path) -> list[str]:
        """``sbatch``."""
        log = script.parent / "%a.log"
        given = {
            "--partition": options.queue,
            "--account": options.account,
            "--time": options.time,
            "--mem": options.memory,
        }
        return [
            *("sbatch", "--parsable", "--requeue", "--open-mode=append", f"--job-name={name}"),
            *(f"--array=1-{count}", f"--output={log}", f"--error={log}"),
            *(f"--cpus-per-task={options.cpus}",),
            *(f"{key}={value}" for key, value in given.items() if value),
            *shlex.split(options.extra),
            str(script),
        ]

    def states(self, jobs: Iterable[str]) -> dict[tuple[str, int], JobState]:
        """``squeue``, and ``sacct`` for what that has forgotten."""
        asked = list(jobs)
        found: dict[tuple[str, int], JobState] = {}
        words = ["squeue", "--noheader", "--array", "--states=all", "--format=%F|%K|%T|%N"]
        code, told, said = _ask([*words, f"--jobs={','.join(asked)}"])
        if code and "invalid job id" not in said.lower():
            raise SilentError(said)
        for line in told.splitlines():
            job, index, state, node = [*line.strip().split("|"), "", "", ""][:4]
            if index.isdigit():
                found[job, int(index)] = _slurm_state(state, node)
        forgotten = sorted(set(asked) - {job for job, _ in found})
        if forgotten:
            words = ["sacct", "--noheader", "--parsable2", "--allocations", "--array"]
            columns = ["--format=JobID,State,NodeList", f"--jobs={','.join(forgotten)}"]
            code, told, _ = _ask([*words, *columns])
            for line in told.splitlines() if not code else ():  # a cluster need not keep accounts
                name, state, node = [*line.strip().split("|"), "", ""][:3]
                job, _, index = name.partition("_")
                if index.isdigit():
                    found[job, int(index)] = _slurm_state(state, node)
        return found

    def find(self, name: str) -> str:
        """``squeue --name``."""
        code, told, said = _ask(["squeue", "--noheader", "--states=all", "--format=%F", f"--name={name}"])
        if code:
            raise SilentError(said)
        return next(iter(told.split()), "")

    def cancel(self, jobs: Sequence[str]) -> None:
        """``scancel``."""
        _ask(["scancel", *jobs])


def _slurm_state(text: str, node: str) -> JobState:
    word = text.split()[0] if text.split() else ""  # CANCELLED by 1000
    return JobState(_SLURM.get(word, "running"), text.strip(), node)


_SLURM: dict[str, Fate] = {
    **dict.fromkeys(("PENDING", "CONFIGURING", "REQUEUED", "REQUEUE_HOLD", "REQUEUE_FED"), "waiting"),
    **dict.fromkeys(("SUSPENDED", "SPECIAL_EXIT", "RESV_DEL_HOLD", "STOPPED"), "waiting"),
    **dict.fromkeys(("NODE_FAIL", "PREEMPTED", "BOOT_FAIL", "REVOKED"), "lost"),
    **dict.fromkeys(("TIMEOUT", "DEADLINE"), "overtime"),
    "COMPLETED": "done",
    "CANCELLED": "cancelled",
    "OUT_OF_MEMORY": "memory",
    "FAILED": "failed",
}


class Pbs(BatchSystem):
    """PBS Professional and OpenPBS: ``qsub``, ``qstat``, ``qdel``."""

    word = "pbs"
    index = "PBS_ARRAY_INDEX"
    least = 2  # it has no arrays of one
    passing = "cannot connect|timed out|try again|would exceed|limit"

    def submission(self, options: QueueOptions, name: str, count: int, script: Path) -> list[str]:
        """``qsub``."""
        memory = f":mem={options.memory}" if options.memory else ""
        given = {"-q": options.queue, "-A": options.account}
        return [
            *("qsub", "-V", "-r", "y", "-N", name, "-J", f"1-{count}", "-j", "oe"),
            *("-o", f"{script.parent}/^array_index^.log", "-l", f"select=1:ncpus={options.cpus}{memory}"),
            *(("-l", f"walltime={options.time}") if options.time else ()),
            *(word for key, value in given.items() if value for word in (key, value)),
            *shlex.split(options.extra),
            str(script),
        ]

    def states(self, jobs: Iterable[str]) -> dict[tuple[str, int], JobState]:
        """``qstat -x -t``: with the tasks of arrays, those that have ended as well."""
        found = {}
        for job, told in self._listed([*jobs]).items():
            number = re.fullmatch(r"(\d+)\[(\d+)\](.*)", job)
            if number:
                node = str(told.get("exec_host", "")).partition("/")[0]
                found[f"{number[1]}[]{number[3]}", int(number[2])] = _pbs_state(told, node)
        return found

    def find(self, name: str) -> str:
        """``qstat``, by name."""
        listed = self._listed([])
        found = (job for job, told in listed.items() if told.get("Job_Name") == name and "[]" in job)
        return next(found, "")

    def cancel(self, jobs: Sequence[str]) -> None:
        """``qdel``."""
        _ask(["qdel", *jobs])

    def _listed(self, jobs: Sequence[str]) -> dict[str, dict[str, object]]:
        code, told, said = _ask(["qstat", "-x", "-t", "-f", "-F", "json", *jobs])
        with suppress(ValueError, AttributeError):
            listed = json.loads(told).get("Jobs", {})
            return {job: told for job, told in listed.items() if isinstance(told, dict)}
        if code and "unknown job" not in said.lower():
            raise SilentError(said)
        return {}


def _pbs_state(told: dict[str, object], node: str) -> JobState:
    letter, code = str(told.get("job_state", "")), told.get("Exit_status")
    if letter not in ("F", "X"):
        return JobState("waiting" if letter in ("Q", "H", "W", "T", "S", "B") else "running", letter, node)
    text = f"exit status {code}" if code is not None else "ended"
    if not isinstance(code, int):
        return JobState("cancelled" if "deleted" in str(told.get("comment", "")) else "failed", text, node)
    return JobState(_PBS.get(code, "failed"), text, node)


_PBS: dict[int, Fate] = {
    0: "done",
    -29: "overtime",
    -27: "memory",
    -11: "lost",
    -10: "lost",
    271: "cancelled",
}
"""Exit statuses that PBS sets itself (its administrator's guide, "Job Exit Status Codes"); 271 is SIGTERM."""

SYSTEMS: dict[str, BatchSystem] = {system.word: system for system in (Slurm(), Pbs())}
"""Every batch system, by its word."""


def _ask(words: Sequence[str]) -> tuple[int, str, str]:
    """Call a command of the system; its exit code, what it printed, and what it said on stderr in a line."""
    try:
        done = subprocess.run(
            words, stdin=subprocess.DEVNULL, capture_output=True, timeout=ANSWER_S, check=False
        )
    except subprocess.TimeoutExpired:
        raise SilentError(f"{words[0]} timed out after {ANSWER_S:g} s") from None
    except OSError as error:
        raise RsmkitError(
            f"{words[0]} cannot be called ({error.strerror}): rsmkit must run where jobs are submitted"
        ) from None
    said = " ".join(done.stderr.decode(errors="replace").split())
    return done.returncode, done.stdout.decode(errors="replace"), said[:400]
