"""Reader for the output tables that GRAM users have; the model itself is not open.

Columns are found by their headings, so the layouts of Earth-GRAM "special" files (``Hgtkm DensMean ...``),
of the GRAM suite's comma-separated tables (``Height_km, Density_kgm3, ...``), of plain averages (``H,m T P
rho a``) and of a bare profile (``altitude_m,density_kg_m3``) all read the same way. Several runs may follow
each other in one file.
"""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from sim.air.altitude_table import table_atmosphere
from sim.air.atmosphere import Atmosphere, Floats, Interpolation
from sim.air.wind import CALM, Wind, table_wind
from sim.core.errors import InputError

__all__ = ["GramRun", "read_gram"]

# Quantity: headings (lower case) of its mean, and of its perturbed value; factor to SI.
_HEADINGS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "height_km": (("hgtkm", "height_km", "heightkm", "hgt_km", "z_km", "altitude_km"), ()),
    "height_m": (("h,m", "height_m", "h_m", "altitude_m"), ()),
    "density": (
        ("densmean", "density_kgm3", "density_kg_m3", "rho", "rho_kgm3", "density"),
        ("denspert", "perturbeddensity_kgm3"),
    ),
    "pressure": (("presmean", "pressure_pa", "p", "p_pa"), ("prespert", "perturbedpressure_pa")),
    "temperature": (("tmean", "temperature_k", "t", "t_k"), ("tpert", "perturbedtemperature_k")),
    "east": (("ewmean", "ewwind_ms"), ("ewpert", "perturbedewwind_ms")),
    "north": (("nsmean", "nswind_ms"), ("nspert", "perturbednswind_ms")),
    "up": (("verticalwind_ms",), ("wpert", "perturbedverticalwind_ms")),
    "density_deviation": (("sdden%", "densitystandarddeviation_pct"), ()),
}


@dataclass(frozen=True)
class GramRun:
    """One profile of a GRAM table.

    Attributes
    ----------
    atmosphere : Atmosphere
    wind : Wind
        Calm when the table has no wind columns.
    density_deviation_pct : (n,) array or None
        Standard deviation of the density at `altitude_m`, when tabulated.
    altitude_m : (n,) array
        Ascending heights of the rows.
    """

    atmosphere: Atmosphere
    wind: Wind
    altitude_m: Floats
    density_deviation_pct: Floats | None


def read_gram(
    path: str | os.PathLike[str], *, perturbed: bool = False, interpolation: Interpolation = "smooth"
) -> list[GramRun]:
    """Read every run of a GRAM output table.

    Parameters
    ----------
    path : path
        Text table with one line of headings.
    perturbed : bool
        Take the perturbed columns instead of the mean ones.
    interpolation : {"smooth", "log-linear"}
        Of the air between the rows, see :func:`sim.air.altitude_table.table_atmosphere`.

    Returns
    -------
    list of GramRun
        In the order of the file. Outside its rows an atmosphere is refused, never extrapolated.

    Raises
    ------
    InputError
        If headings or numbers are missing.
    """
    source = Path(path)
    headings, values = _table(source)
    columns = _columns(source, headings, perturbed)
    height = (
        values[:, columns["height_km"]] * 1e3 if "height_km" in columns else values[:, columns["height_m"]]
    )
    return [
        _run(f"{source.name} run {number}", height[rows], values[rows], columns, interpolation)
        for number, rows in enumerate(_runs(height), start=1)
    ]


def _table(source: Path) -> tuple[list[str], Floats]:
    try:
        lines = [line.strip() for line in source.read_text(encoding="utf-8", errors="replace").splitlines()]
    except OSError as error:
        raise InputError(f"cannot read the GRAM table {source}: {error.strerror}") from None
    lines = [line for line in lines if line]
    if not lines:
        raise InputError(f"{source}: the GRAM table is empty")
    headings = [heading for heading in _words(lines[0].lstrip("#% ")) if heading]
    rows = []
    for number, line in enumerate(lines[1:], start=2):
        if line.startswith(("#", "%")):
            continue
        words = _words(line)
        if [word.lower() for word in words] == [heading.lower() for heading in headings]:
            continue  # the headings again, before another run
        try:
            rows.append([float(word) for word in words[: len(headings)]])
        except ValueError:
            raise InputError(f"{source}, line {number}: not a row of numbers: {line[:60]}") from None
        if len(rows[-1]) != len(headings):
            raise InputError(
                f"{source}, line {number}: {len(rows[-1])} numbers under {len(headings)} headings"
            )
    if not rows:
        raise InputError(f"{source}: the GRAM table has headings but no rows")
    return headings, np.array(rows)


def _words(line: str) -> list[str]:
    if ", " in line or ("," in line and not re.search(r"\s", line)):  # not the comma of "H,m T P rho"
        return [word.strip() for word in line.split(",")]
    return line.split()


def _columns(source: Path, headings: list[str], perturbed: bool) -> dict[str, int]:
    """Column number of every quantity the table has."""
    lower = [heading.lower() for heading in headings]
    found = {}
    for quantity, (mean, disturbed) in _HEADINGS.items():
        for name in (disturbed + mean) if perturbed else mean:
            if name in lower:
                found[quantity] = lower.index(name)
                break
    if perturbed and not set(_HEADINGS["density"][1]) & set(lower):
        raise InputError(f"{source} has no perturbed density; read it with perturbed=False")
    if "density" not in found or not {"height_km", "height_m"} & set(found):
        raise InputError(
            f"{source}: no height and density among the headings {', '.join(headings)}; known are "
            f"{', '.join(name for mean, more in _HEADINGS.values() for name in mean + more)}"
        )
    return found


def _runs(height: Floats) -> list[slice]:
    """Rows of each run: a new one starts where the height turns back or stands still."""
    if height.size < 2:
        return [slice(0, height.size)]
    direction = np.sign(height[1] - height[0])
    breaks = [0, *(np.flatnonzero(np.sign(np.diff(height)) != direction) + 1).tolist(), height.size]
    return [slice(a, b) for a, b in pairwise(breaks)]


def _run(
    name: str, height: Floats, values: Floats, columns: dict[str, int], interpolation: Interpolation
) -> GramRun:
    order = np.argsort(height)

    def column(quantity: str) -> Floats | None:
        return values[order, columns[quantity]] if quantity in columns else None

    density, east, north = column("density"), column("east"), column("north")
    assert density is not None
    atmosphere = table_atmosphere(
        height[order],
        density,
        pressure_Pa=column("pressure"),
        temperature_K=column("temperature"),
        interpolation=interpolation,
        name=name,
    )
    wind = CALM
    if east is not None and north is not None:
        up = column("up")
        wind = table_wind(height[order], north, east, None if up is None else -up)
    return GramRun(atmosphere, wind, height[order], column("density_deviation"))
