"""In which order a design is run by hand (``run-order.json``): drawn once, and kept."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rsmkit.errors import DamagedError, RsmkitError
from rsmkit.io.files.atomic_files import read_text
from rsmkit.io.files.digests import digest
from rsmkit.io.json_codec import from_json, read_json, to_json, write_json
from rsmkit.runs.sheets.run_order import randomised_order
from rsmkit.study.folder import DESIGN_FILE, StudyFolder

__all__ = ["ORDER_FILE", "RunOrder", "run_order"]

ORDER_FILE = "run-order.json"
REDO_ORDER = "Delete it, and the order is drawn again by: rsmkit sheet FILE.csv"


@dataclass(frozen=True)
class RunOrder:
    """In which order a design is run by hand.

    Parameters
    ----------
    seed : int or None
        It was drawn with; None for the order of the design.
    rows : tuple of int
        The design's rows, from 0, the first to be made first.
    """

    seed: int | None
    rows: tuple[int, ...]


def run_order(folder: StudyFolder, seed: int | None = None, *, standard: bool = False) -> RunOrder:
    """Give the order that was drawn for the design, or draw one; runs made already keep the first places.

    Parameters
    ----------
    folder : StudyFolder
    seed : int, optional
        Draw it anew with this seed; by default that of the design.
    standard : bool
        Take the order of the design instead.

    Raises
    ------
    RsmkitError
        If another order is asked for when there are results.
    """
    design, path = folder.plan().design, folder.path / ORDER_FILE
    kept = _kept(folder, path)
    if kept is not None and seed is None and not standard:
        return kept
    made = np.flatnonzero(~folder.design_runs().runs.missing).tolist()
    wanted = None if standard else folder.study.file.design.seed if seed is None else seed
    if kept is not None and wanted == kept.seed:
        return kept
    if kept is not None and made:
        raise RsmkitError(
            f"{len(made)} runs have results, so the order stays as it was drawn; write the sheet "
            "without --seed and --standard-order"
        )
    if wanted is None:
        rows = tuple(range(len(design)))
    else:
        plots = "whole_plots" if folder.study.hard else "blocks"
        rows = randomised_order(len(design), wanted, first=made, **{plots: design.blocks})
    order = RunOrder(wanted, rows)
    write_json(path, {"schema": 1, "design": _name(folder), "order": to_json(order)})
    return order


def _kept(folder: StudyFolder, path: Path) -> RunOrder | None:
    """The order on the disk, if it is one of the present design."""
    if not path.is_file():
        return None
    record = read_json(path, REDO_ORDER)
    if record.get("design") not in (_name(folder), _name_once(folder)):
        return None
    order = from_json(RunOrder, record.get("order"), path, REDO_ORDER, at="order")
    if sorted(order.rows) != list(range(len(folder.plan().design))):
        raise DamagedError(path, ["it does not name each run once"], REDO_ORDER)
    return order


def _name(folder: StudyFolder) -> str:
    design = folder.plan().design
    return digest([design.points.tolist(), list(design.blocks)])


def _name_once(folder: StudyFolder) -> str:
    """How the first files that kept an order name the design: by the text of its file."""
    return digest(read_text(folder.path / DESIGN_FILE, REDO_ORDER))
