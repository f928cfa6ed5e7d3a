"""What commands share: output options, the STUDY argument, how runs are made."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import Field, fields, replace
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from rsmkit.io.tables.csv_tables import split_line
from rsmkit.runs.backends.options import DEFAULT_BACKEND
from rsmkit.runs.backends.registry import BACKENDS

if TYPE_CHECKING:
    from rsmkit.cli.session import Session
    from rsmkit.study.folder import StudyFolder

__all__ = [
    "Names",
    "Rows",
    "common",
    "force_option",
    "joined",
    "open_folder",
    "retry_option",
    "run_options",
    "study_argument",
]

MOST_ROWS = 1_000_000

force_option = click.option("--force", is_flag=True, help="Redo the stage even if it is up to date.")
retry_option = click.option("--retry-failed", is_flag=True, help="Run again what failed before.")


def common(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command the options that all share, and a session that catches what goes wrong."""

    @click.option("--json", "as_json", is_flag=True, help="One JSON document on stdout, messages on stderr.")
    @click.option("-q", "--quiet", is_flag=True, help="Only errors.")
    @click.option("--no-color", is_flag=True, help="No colours (also: NO_COLOR=1).")
    @wraps(command)
    def wrapped(as_json: bool, quiet: bool, no_color: bool, **options: Any) -> None:
        from rsmkit.cli.session import Session

        session = Session(as_json=as_json, quiet=quiet, color=not no_color)
        with session.guard():
            command(session, **options)
        session.finish()

    return wrapped


def study_argument(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command its STUDY argument, read and checked."""

    @click.argument("study", default=".", type=click.Path(path_type=Path))
    @wraps(command)
    def wrapped(session: Session, study: Path, **options: Any) -> None:
        command(session, open_folder(session, study), **options)

    return wrapped


def open_folder(session: Session, place: Path) -> StudyFolder:
    """Read and check the study at `place`, and keep the session's log beside it."""
    from rsmkit.study.folder import open_study

    folder = open_study(place)
    session.log_to(folder.path)
    return folder


def run_options(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command that makes simulator runs the options for how they are made."""
    *others, last = (row.where for row in BACKENDS.values())
    places = f"{', '.join(others)}, or {last}."

    @click.option("-j", "--jobs", type=click.IntRange(min=1), help="Parallel runs (default: all cores).")
    @click.option(
        "--backend",
        type=click.Choice(list(BACKENDS)),
        default=None,
        help=f"{places[0].upper()}{places[1:-1]} (default: what the study says, or {DEFAULT_BACKEND}).",
    )
    @_backend_flags
    @click.option("--max-failures", type=click.IntRange(min=1), help="Stop after so many failed runs.")
    @wraps(command)
    def wrapped(
        session: Session,
        folder: Any,
        jobs: int | None,
        backend: str | None,
        max_failures: int | None,
        retry_failed: bool = False,
        only: tuple[int, ...] | None = None,
        limit: int | None = None,
        **options: Any,
    ) -> None:
        given = {name: options.pop(name) for name in _backend_fields() if name in options}
        asked = {name: value for name, value in given.items() if value is not None}
        how = replace(
            folder.study.file.evaluate.how(jobs, backend, asked),
            retry_failed=retry_failed,
            only=only,
            limit=limit,
            max_failures=max_failures,
        )
        command(session, folder, how, **options)

    return wrapped


def _backend_fields() -> dict[str, Field[Any]]:
    """The options of all backends, by name."""
    return {item.name: item for row in BACKENDS.values() for item in fields(row.options)}


def _backend_flags(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command one flag for each option of a backend."""
    for name, item in reversed(_backend_fields().items()):
        text, default = item.metadata["doc"], item.default
        command = click.option(
            f"--{name.replace('_', '-')}",
            type=type(default),
            default=None,
            metavar=item.metadata["metavar"],
            help=f"{text[0].upper()}{text[1:]}.",
        )(command)
    return command


class Names(click.ParamType):  # type: ignore[type-arg]
    """Names separated by commas, in double quotes where they hold a comma: ``x1,"Temp, C"``."""

    name = "names"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[str, ...]:
        """Split the text."""
        return tuple(part.strip() for part in split_line(str(value)) if part.strip())


def joined(ctx: click.Context, param: click.Parameter, value: tuple[tuple[str, ...], ...]) -> tuple[str, ...]:
    """Make one list of the lists of an option that may be repeated."""
    return tuple(name for part in value for name in part)


class Rows(click.ParamType):  # type: ignore[type-arg]
    """Rows of the design: ``3,7-9``."""

    name = "rows"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[int, ...]:
        """Read the text, or refuse it."""
        rows: list[int] = []
        try:
            for part in str(value).split(","):
                first, _, last = part.partition("-")
                begin, end = int(first), min(int(last or first), MOST_ROWS)
                if end < begin:
                    raise ValueError("runs backwards")
                rows += range(begin, end + 1)
        except ValueError:
            self.fail(f"'{value}' is not a list of rows such as 3,7-9", param, ctx)
        return tuple(rows)
