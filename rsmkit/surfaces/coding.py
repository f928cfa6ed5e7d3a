"""Coded units of a table: how they are written, and whether its columns hold them already."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from rsmkit.errors import RsmkitError
from rsmkit.io.arguments import checked
from rsmkit.io.csv_tables import split_line
from rsmkit.language.space import Floats

__all__ = ["holds_coded_values", "parse_coding"]

LARGEST_CODED = 5.0
"""Largest size of a coded value in a design, for stars of nine factors."""
USUAL = (1.0, 2.5)
"""Coded values of a design reach so far to either side."""


@checked
def parse_coding(text: str) -> dict[str, tuple[float, float]]:
    """Read ``x1=85:5,x2=175:5``: center and half range of each factor.

    Raises
    ------
    RsmkitError
        With the part that does not read so.
    """
    coding: dict[str, tuple[float, float]] = {}
    for part in filter(None, (p.strip() for p in split_line(text))):
        name, _, numbers = part.rpartition("=")
        center, _, half = numbers.partition(":")
        try:
            pair = (float(center), float(half))
        except ValueError:
            raise RsmkitError(
                f"coding '{part}': write it as factor=center:half_range, e.g. x1=85:5"
            ) from None
        if not (abs(pair[0]) < 1e70 and 1e-70 < pair[1] < 1e70):
            raise RsmkitError(f"coding '{part}': needs a finite center and a half range above zero")
        if name.strip() in coding:
            raise RsmkitError(f"coding '{part}': {name.strip()} has a coding already")
        coding[name.strip()] = pair
    return coding


def holds_coded_values(columns: Mapping[str, Floats], coding: Mapping[str, tuple[float, float]]) -> bool:
    """Whether columns hold coded values although a coding is given to compute them.

    Only where natural values would make a strange design (far from the centre, or far too narrow or wide)
    and coded values a much more usual one; all columns are judged together.
    """
    coded = [columns[name] for name in coding]
    natural = [(columns[name] - center) / half for name, (center, half) in coding.items()]
    if not coded or max(np.abs(values).max() for values in coded) > LARGEST_CODED:
        return False
    return 1.0 <= sum(map(_strangeness, natural)) > 2.0 * sum(map(_strangeness, coded))


def _strangeness(values: Floats) -> float:
    """How far the middle of a column lies from the centre, and how unusual its reach (a logarithm)."""
    low, high = float(values.min()), float(values.max())
    half = 0.5 * (high - low)
    unusual = max(0.0, math.log(USUAL[0] / half), math.log(half / USUAL[1])) if half else 0.0
    return abs(0.5 * (high + low)) + unusual
