"""``rsmkit new``: a small commented study that runs as it is."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from rsmkit.errors import RsmkitError
from rsmkit.io.arguments import checked
from rsmkit.io.files.atomic_files import write_text

__all__ = ["create_study"]

TEMPLATE = ("study.toml", "simulator.py")


@checked
def create_study(folder: Path) -> list[Path]:
    """Write the example study into `folder`, which is made if needed; existing files are never replaced.

    Returns
    -------
    list of Path
        The files written.

    Raises
    ------
    RsmkitError
        If one of the files exists, or the folder cannot be made.
    """
    taken = [folder / name for name in TEMPLATE if (folder / name).exists()]
    if taken:
        raise RsmkitError(f"{taken[0]} exists already; choose another folder, nothing was written")
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RsmkitError(f"{folder}: cannot make this folder: {error.strerror}") from None
    source = files("rsmkit.example")
    for name in TEMPLATE:
        write_text(folder / name, (source / name).read_text(encoding="utf-8"))
    return [folder / name for name in TEMPLATE]
