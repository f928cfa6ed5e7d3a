"""One command's session: where output goes, how errors end, what is logged."""

from __future__ import annotations

import errno
import io
import json
import logging
import os
import sys
import tempfile
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rsmkit.errors import EXIT_INTERRUPTED, EXIT_UNEXPECTED, EXIT_USAGE, RsmkitError
from rsmkit.io.files.regular_files import open_regular

if TYPE_CHECKING:
    from rich.console import Console

__all__ = ["Session"]

LOG_NAME = "rsmkit.log"
_NO_ROOM = (errno.ENOSPC, errno.EDQUOT)
WIDTH_OF_FILES = 120


class Session:
    """Console, JSON document and exit code of one command.

    Parameters
    ----------
    as_json : bool
        Print one JSON document on standard output; everything for people goes to standard error.
    quiet : bool
        Print nothing for people but errors.
    color : bool
        Colours allowed (they are used on a terminal only, and never when ``NO_COLOR`` is set).
    """

    def __init__(self, *, as_json: bool, quiet: bool, color: bool) -> None:
        from rich.console import Console

        _open_streams()
        plain: dict[str, Any] = {
            "highlight": False,
            "no_color": None if color else True,
            "soft_wrap": True,
            "force_jupyter": False,  # a command that a notebook calls writes text as it does elsewhere
        }
        self.errors: Console = Console(stderr=True, **plain)
        self.people: Console = Console(stderr=as_json, quiet=quiet, **plain)
        if not self.people.is_terminal and "COLUMNS" not in os.environ:
            self.people.width = WIDTH_OF_FILES
        self.as_json = as_json
        self.quiet = quiet
        self.next_commands = True
        self.exit_code = 0
        self.document: dict[str, Any] = {}
        logging.getLogger("rsmkit").addHandler(logging.NullHandler())
        self._log: Path | None = None

    def log_to(self, folder: Path) -> None:
        """Keep a debug log in the study's folder, when it can be written."""
        log = logging.getLogger("rsmkit")
        try:
            handler = _LogFile(folder / LOG_NAME, encoding="utf-8", delay=False)
        except OSError:
            return
        handler.setFormatter(logging.Formatter("%(asctime)s %(process)d %(levelname)s %(name)s: %(message)s"))
        for old in list(log.handlers):
            log.removeHandler(old)
            old.close()
        log.addHandler(handler)
        log.setLevel(logging.DEBUG)
        log.propagate = False
        self._log = folder / LOG_NAME
        log.info("rsmkit %s", " ".join(sys.argv[1:]))

    @contextmanager
    def guard(self) -> Iterator[None]:
        """Turn whatever happens inside into a message, a JSON document and an exit code."""
        try:
            yield
        except RsmkitError as error:
            self._fail(str(error), error.exit_code)
            logging.getLogger("rsmkit").error("%s", error)
        except KeyboardInterrupt:
            self._fail(
                "interrupted; every finished run is kept. Type the same command to go on.", EXIT_INTERRUPTED
            )
        except BrokenPipeError:
            self._nobody_reads()
        except Exception as error:
            if isinstance(error, OSError) and error.errno in _NO_ROOM:
                self._fail(f"{error.strerror}: free the disk, then type the same command.", EXIT_USAGE)
                return
            details = traceback.format_exc()
            logging.getLogger("rsmkit").error("%s", details)
            where = f"The full story is in {self._log or _keep(details)}."
            self._fail(
                f"unexpected {type(error).__name__}: {error}. This is a defect in rsmkit. {where}",
                EXIT_UNEXPECTED,
            )

    def _nobody_reads(self) -> None:
        """Let what is still to be written go nowhere, lest the interpreter fails when it ends."""
        self.exit_code = EXIT_UNEXPECTED
        nowhere = os.open(os.devnull, os.O_WRONLY)
        for number in (1, 2):
            os.dup2(nowhere, number)
        os.close(nowhere)

    def _fail(self, message: str, code: int) -> None:
        self.exit_code = code
        self.document["error"] = {"message": message, "exit_code": code}
        for line in message.splitlines():
            self.errors.print(f"[bold red]error:[/] {_escape(line)}")

    def finish(self) -> None:
        """Print the JSON document, when there is one to print, and leave with the exit code."""
        if self.as_json:
            narrow = not (sys.stdout.encoding or "").lower().startswith("utf")
            text = json.dumps(self.document, indent=1, ensure_ascii=narrow, allow_nan=False)
            sys.stdout.write(text + "\n")
        try:
            sys.stdout.flush()
        except BrokenPipeError:
            self._nobody_reads()
        sys.exit(self.exit_code)


class _LogFile(logging.FileHandler):
    """A log that is a file of the study's folder and nothing else."""

    def _open(self) -> io.TextIOWrapper:
        handle = open_regular(Path(self.baseFilename), os.O_WRONLY | os.O_APPEND | os.O_CREAT)
        if os.fstat(handle).st_nlink > 1:
            os.close(handle)
            raise OSError(errno.EMLINK, "it is another name of another file")
        return open(handle, "a", encoding=self.encoding)


def _open_streams() -> None:
    """Let streams print anything; closed ones go to the null device, lest a file gets their number."""
    for number, name, mode in ((0, "stdin", "r"), (1, "stdout", "w"), (2, "stderr", "w")):
        if getattr(sys, name) is None:
            handle = os.open(os.devnull, os.O_RDWR)
            if handle == number:
                os.set_inheritable(number, True)
            else:
                os.dup2(handle, number)
                os.close(handle)
            setattr(sys, name, os.fdopen(number, mode, closefd=False))
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            # a terminal of few characters must not end a command
            stream.reconfigure(errors="backslashreplace")


def _keep(details: str) -> str:
    """Save a traceback where it can be found when the study's folder cannot be written."""
    with tempfile.NamedTemporaryFile("w", prefix="rsmkit-", suffix=".log", delete=False) as stream:
        stream.write(details)
    return stream.name


def _escape(text: str) -> str:
    from rich.markup import escape

    return escape(text)
