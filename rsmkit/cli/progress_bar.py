"""The progress of an evaluation on the terminal: a bar where there is one, lines elsewhere."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from rsmkit.cli.session import Session

if TYPE_CHECKING:
    from rsmkit.runs.record.run import Run
    from rsmkit.runs.record.run_progress import Progress, RunEvent, Watcher

__all__ = ["duration", "progress", "working"]

TELL_EVERY_S = 60.0
"""How often a log, which nobody watches, is told how far it is."""
STOPPING = " Stopping: running runs are finished first and kept. Press Ctrl-C again to drop them."


@contextmanager
def progress(session: Session) -> Iterator[Watcher]:
    """Watch an evaluation; messages and the bar go to standard error."""
    if session.quiet:
        yield lambda event: None
        return
    if not session.errors.is_terminal:
        lines = _Lines(session)
        try:
            yield lines
        finally:
            lines.end()
        return
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

    columns = (
        TextColumn(" {task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[state]}"),
    )
    with Progress(*columns, console=session.errors, transient=True) as bar:
        task: Any = None

        def watch(event: RunEvent) -> None:
            nonlocal task
            if task is None:
                task = bar.add_task("simulator runs", total=event.progress.todo, state="")
            bar.update(
                task, total=event.progress.todo, completed=event.progress.ended, state=_state(event.progress)
            )
            if event.kind == "failed" and event.run is not None:
                bar.console.print(f" {event.run.status} {_describe(event.run)}", style="red", markup=False)
            if event.kind == "stopping":
                bar.console.print(STOPPING)

        yield watch


@contextmanager
def working(session: Session, what: str) -> Iterator[Callable[[str], None]]:
    """Say what goes on while long free work is done: with a clock, or in a log once a minute.

    What it gives is to be told of every step: it then says that one.
    """
    if session.quiet:
        yield lambda step: None
        return
    if session.errors.is_terminal:
        from rich.markup import escape
        from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

        columns = (SpinnerColumn(), TextColumn(" {task.description}"), TimeElapsedColumn())
        with Progress(*columns, console=session.errors, transient=True) as bar:
            task = bar.add_task(escape(what), total=None)
            yield lambda step: bar.update(task, description=escape(step))
        return
    done, now = threading.Event(), [what]

    def tell() -> None:
        began = time.monotonic()
        while not done.wait(TELL_EVERY_S):
            session.errors.print(f" {now[0]}: {duration(time.monotonic() - began)} so far", markup=False)

    def turn(step: str) -> None:
        now[0] = step

    clock = threading.Thread(target=tell, daemon=True)
    clock.start()
    try:
        yield turn
    finally:
        done.set()
        clock.join()


def duration(seconds: float) -> str:
    """Write a time span as people say it."""
    if seconds < 0.1:
        return f"{1000 * seconds:.0f} ms"
    if seconds < 60:
        return f"{seconds:.1f} s"
    if seconds < 3600:
        return f"{seconds / 60:.1f} min"
    return f"{seconds / 3600:.1f} h"


def _state(state: Progress) -> str:
    parts = [f"{state.failed} failed"] if state.failed else []
    if state.median_seconds is not None:
        parts.append(f"{duration(state.median_seconds)}/run")
    left = state.remaining_seconds()
    if left is not None and state.ended < state.todo:
        parts.append(f"about {duration(left)} left")
    return "  ".join(parts)


class _Lines:
    """A line a minute, and one for each failure; the first and the last run are told.

    A search of the simulator evaluates many small batches: runs are counted over all of them.
    """

    def __init__(self, session: Session) -> None:
        self.session = session
        self.told = -math.inf
        self.before = self.ended = 0
        self.untold = ""

    def __call__(self, event: RunEvent) -> None:
        state, now = event.progress, time.monotonic()
        if event.kind == "planned":
            self.before, self.ended = self.before + self.ended, 0
        elif event.kind == "stopping":
            self.session.errors.print(STOPPING)
        elif event.run is not None:
            self.ended = state.ended
            count = f"{self.before + state.ended}/{self.before + state.todo}"
            self.untold = f" {count} {event.run.status} {_describe(event.run)}"
            if not event.run.done or now - self.told >= TELL_EVERY_S:
                self.end()
                self.told = now

    def end(self) -> None:
        """Tell the last run."""
        if self.untold:
            self.session.errors.print(self.untold, markup=False)
            self.untold = ""


def _describe(run: Run) -> str:
    values = ", ".join(
        f"{name} {value:.6g}" if isinstance(value, float) else f"{name} {value}"
        for name, value in run.factors.items()
    )
    return f"{duration(run.seconds)} ({values})" + (f": {run.error}" if run.error else "")
