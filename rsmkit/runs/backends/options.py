"""The options of each backend, which cost nothing to import: the command line makes its flags from them.

A field's type is what its flag takes, ``doc`` is its line of help and ``metavar`` the word for its value.
"""

from __future__ import annotations

import re
import shlex
from dataclasses import dataclass, field
from typing import Any

__all__ = [
    "DEFAULT_BACKEND",
    "BackendOptions",
    "DaskOptions",
    "LokyOptions",
    "PbsOptions",
    "QueueOptions",
    "SlurmOptions",
    "flag",
]

DEFAULT_BACKEND = "loky"


def flag(text: str, metavar: str, default: Any) -> Any:
    """Make a dataclass field that carries the help of its own flag."""
    return field(default=default, metadata={"doc": text, "metavar": metavar})


@dataclass(frozen=True)
class BackendOptions:
    """What a backend must know beyond the number of jobs: nothing, unless it says otherwise."""

    def problems(self) -> list[tuple[str, str]]:
        """Report what is wrong beyond types, as predicates of "the ... backend"."""
        return []


@dataclass(frozen=True)
class LokyOptions(BackendOptions):
    """Processes on this computer need no options."""


@dataclass(frozen=True)
class DaskOptions(BackendOptions):
    """A dask cluster that already stands."""

    scheduler: str = flag("scheduler of the dask cluster", "ADDRESS", "")
    wait_s: float = flag(
        "how long to wait for dask workers (default: a day for the first, a minute when all are gone)",
        "SECONDS",
        0.0,
    )

    def problems(self) -> list[tuple[str, str]]:
        """Report a missing address."""
        if not self.scheduler:
            return [("scheduler", "needs the address of a scheduler, such as tcp://host:8786")]
        return [("wait_s", "needs wait_s of at least 0")] if not self.wait_s >= 0.0 else []


@dataclass(frozen=True)
class QueueOptions(BackendOptions):
    """What a job of a batch system asks for; what is left out is the system's own choice."""

    queue: str = flag("partition or queue that jobs go to", "NAME", "")
    account: str = flag("account that jobs are charged to", "NAME", "")
    time: str = flag("longest time of a job, HH:MM:SS (default: by what runs took so far)", "TIME", "")
    memory: str = flag("memory of a job, such as 4G", "SIZE", "")
    cpus: int = flag("runs made at the same time in each job", "N", 1)
    extra: str = flag("further words for sbatch or qsub", "WORDS", "")
    setup: str = flag("line of shell before a job begins, such as 'module load python'", "LINE", "")
    template: str = flag("job script of your own, with {command} where the runs are made", "FILE", "")
    python: str = flag("interpreter on the nodes (default: this one)", "PATH", "")
    job_folder: str = flag("where jobs and this computer meet (default: runs/queue of the study)", "PATH", "")

    def problems(self) -> list[tuple[str, str]]:
        """Report what no system would take."""
        found = []
        if self.time and not re.fullmatch(r"(\d+-)?\d+(:\d+){0,2}", self.time):
            found.append(("time", f"needs a time such as 12:00:00, got '{self.time:.40}'"))
        if self.memory and not re.fullmatch(r"\d+([kKmMgGtT][bB]?)?", self.memory):
            found.append(("memory", f"needs a memory such as 4G, got '{self.memory:.40}'"))
        if self.template and self.setup:
            found.append(("setup", "needs no setup beside a template, where such lines can stand"))
        if self.cpus < 1:
            found.append(("cpus", f"needs cpus of at least 1, got {self.cpus}"))
        try:
            shlex.split(self.extra)
        except ValueError as error:
            found.append(("extra", f"cannot split extra into words: {error}"))
        return found


@dataclass(frozen=True)
class SlurmOptions(QueueOptions):
    """Jobs of Slurm."""


@dataclass(frozen=True)
class PbsOptions(QueueOptions):
    """Jobs of PBS Professional or OpenPBS."""
