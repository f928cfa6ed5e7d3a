"""A table of the loads on one vehicle, filled by the laws where flights pass."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.aero.tables.axes import AXES, Ruling, ruling

__all__ = ["CORNERS", "ENTRIES", "NO_TABLE", "LoadsTable", "new_table"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

ENTRIES = 10
"""Numbers kept at every knot."""
CORNERS = 64
"""Columns that a cell depends on, four along each of three axes."""
_COLUMNS = 16_384  # over Mach, Knudsen number and temperature; a flight passes some thousand


class LoadsTable(NamedTuple):
    """Loads at knots of Mach number, Knudsen number, temperature and incidence.

    Attributes
    ----------
    ruling : Ruling
        The axes.
    column_of : (Mach, Knudsen number, temperature) array
        Which column of values belongs to these knots; -1 for none so far.
    values : (columns * incidences * ENTRIES,) array
        The loads, those of an incidence side by side. Memory is taken up where there are numbers only.
    known : (columns, incidences) array
        Whether a knot has its numbers, and whether all have that the cell behind it depends on: two bits.
    memory : (5,) array
        Columns in use, and the cell that was asked for last, to look for the next from there.
    corners : (CORNERS,) array
        Where the columns that this cell depends on start, counted over all of `values`.
    sums : (4 * ENTRIES,) array
        Work space.
    laws : int
        Address of the machine code that fills it; 0 until a flight.
    """

    ruling: Ruling
    column_of: NDArray[np.int32]
    values: Floats
    known: NDArray[np.uint8]
    memory: Integers
    corners: NDArray[np.uintp]
    sums: Floats
    laws: int

    @property
    def exists(self) -> bool:
        """Whether loads are tabulated at all."""
        return self.column_of.size > 0

    def __reduce__(self) -> tuple[Callable[[], LoadsTable], tuple[()]]:
        """Of a table a copy, as another process gets one, is empty: to fill it costs less than to send it."""
        return (new_table if self.exists else no_table), ()


def _table(rules: Ruling, shape: tuple[int, int, int], columns: int, incidences: int) -> LoadsTable:
    return LoadsTable(
        ruling=rules,
        column_of=np.full(shape, -1, dtype=np.int32),
        values=np.zeros(columns * incidences * ENTRIES),
        known=np.zeros((columns, incidences), dtype=np.uint8),
        memory=np.array([0, -1, -1, -1, -1]),
        corners=np.zeros(CORNERS, dtype=np.uintp),
        sums=np.zeros(4 * ENTRIES),
        laws=0,
    )


def new_table() -> LoadsTable:
    """Make an empty table over :data:`sim.aero.tables.axes.AXES`."""
    sizes = [axis.knots.size for axis in AXES]
    return _table(ruling(AXES), (sizes[0], sizes[1], sizes[2]), _COLUMNS, sizes[3])


def no_table() -> LoadsTable:
    """Make what a model holds whose loads are not tabulated."""
    return _table(ruling(()), (0, 0, 0), 0, 0)


NO_TABLE = no_table()
"""What a model holds whose loads are not tabulated."""
