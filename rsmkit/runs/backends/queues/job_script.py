"""The script of a job: ours, or the user's own with our command in it."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path

from rsmkit.errors import RsmkitError
from rsmkit.io.files.regular_files import inside, read_regular
from rsmkit.runs.backends.options import QueueOptions

__all__ = ["COMMAND", "job_script", "read_template"]

COMMAND = "{command}"
"""Where the runs are made, in a template."""
LARGEST_BYTES = 100_000


def read_template(options: QueueOptions, folder: Path) -> str:
    """Read the user's own script; empty where there is none.

    Raises
    ------
    RsmkitError
        If it cannot be read, or has not one place for the command.
    """
    if not options.template:
        return ""
    path = inside(folder, options.template, "template")
    try:
        text = read_regular(path, LARGEST_BYTES).decode()
    except OSError as error:
        raise RsmkitError(f"template: {path} cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise RsmkitError(f"template: {path} is no text in UTF-8") from None
    if text.count(COMMAND) != 1:
        raise RsmkitError(
            f"template: {path} must have {COMMAND} once, where the runs are made; it has it "
            f"{text.count(COMMAND)} times"
        )
    return text


def job_script(options: QueueOptions, index: str, wave: Path, template: str = "") -> str:
    """What a node is given to do.

    Parameters
    ----------
    options : QueueOptions
    index : str
        Environment variable with the number of a task in its array.
    wave : path
        Folder of the array.
    template : str
        As :func:`read_template` gives it.
    """
    single = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMEXPR_NUM_THREADS")
    words = shlex.join([options.python or sys.executable, "-m", "rsmkit.runs.array_task", str(wave)])
    command = f'env {" ".join(f"{name}=1" for name in single)} {words} "${index}"'
    if template:
        return template.replace(COMMAND, command)
    return "\n".join(["#!/bin/sh", options.setup, f"exec {command}", ""])
