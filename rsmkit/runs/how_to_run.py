"""How runs are made: what a person can say about it on every command that makes some."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from rsmkit.errors import RsmkitError
from rsmkit.io.option_fields import doc
from rsmkit.runs.backends.options import DEFAULT_BACKEND
from rsmkit.runs.backends.registry import BACKENDS, backend_options, pool_maker

if TYPE_CHECKING:
    from rsmkit.runs.backends.pool import Pool
    from rsmkit.runs.one_run.simulator import Simulator
    from rsmkit.runs.record.run import Run

__all__ = ["EvaluateOptions", "HowToRun"]


@dataclass(frozen=True)
class EvaluateOptions:
    """The ``[evaluate]`` table: where runs are made unless a flag says otherwise; it changes no result."""

    backend: str = doc("where runs are made", DEFAULT_BACKEND, words=lambda: list(BACKENDS))
    jobs: int | None = doc("runs, or jobs in a queue, at the same time", None)
    options: dict[str, bool | int | float | str] = doc(
        "what the backend must know, by the names of its flags: queue = 'long'", factory=dict
    )

    def problems(self) -> list[tuple[str, str]]:
        """Report what is wrong beyond types."""
        try:
            options = backend_options(self.backend, **self.options)
        except RsmkitError as error:
            key = "options" if self.backend in BACKENDS else "backend"
            return [(key, str(error).removeprefix("backend "))]
        found = [("options", text) for _, text in options.problems()]
        return found + (
            [("jobs", f"must be at least 1, got {self.jobs}")]
            if self.jobs is not None and self.jobs < 1
            else []
        )

    def how(
        self, jobs: int | None = None, backend: str | None = None, options: Mapping[str, Any] | None = None
    ) -> HowToRun:
        """How runs are made where a person has said this much beyond the table."""
        own = self.options if backend in (None, self.backend) else {}
        return HowToRun(jobs or self.jobs, backend or self.backend, {**own, **(options or {})})


@dataclass(frozen=True)
class HowToRun:
    """How runs are made; none of it changes a result.

    Parameters
    ----------
    jobs : int, optional
        Runs made at the same time; by default one for each core this process may use, or for each thread of
        the cluster.
    backend : str
        Where: ``loky`` for processes on this computer, ``dask`` for a cluster, ``slurm`` and ``pbs`` for the
        queue of one; a word of :data:`rsmkit.runs.backends.registry.BACKENDS`.
    backend_options : mapping
        What that backend must know: ``{"scheduler": "tcp://host:8786"}`` for ``dask``.
    retry_failed : bool
        Make runs that failed before once more.
    only : tuple of int, optional
        Rows of the design to consider, from 1.
    limit : int, optional
        Make at most so many runs.
    max_failures : int, optional
        When so many runs have failed, finish what is under way and stop.

    Raises
    ------
    RsmkitError
        If there is no such backend, or it has no such option.
    """

    jobs: int | None = None
    backend: str = DEFAULT_BACKEND
    backend_options: Mapping[str, Any] = field(default_factory=dict)
    retry_failed: bool = False
    only: tuple[int, ...] | None = None
    limit: int | None = None
    max_failures: int | None = None

    def __post_init__(self) -> None:
        backend_options(self.backend, **self.backend_options)

    def pool_maker(self, simulator: Simulator, runs: int) -> Callable[[int | None], Pool]:
        """Give what makes a pool of so many jobs, for at most `runs` runs of a simulator.

        Raises
        ------
        RsmkitError
            If the backend cannot do with these options.
        """
        options = backend_options(self.backend, **self.backend_options)
        return pool_maker(self.backend, options, simulator, runs)

    def tidy(self, simulator: Simulator, recorded: Mapping[str, Run]) -> None:
        """Remove what a dead driver has left behind of runs that are all in the journal."""
        options = backend_options(self.backend, **self.backend_options)
        BACKENDS[self.backend].tidy(options, simulator, recorded)
