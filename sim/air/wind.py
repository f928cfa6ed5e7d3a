"""Winds over altitude: none, steady, sheared, or tabulated. Components say where the air moves *to*."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from sim.air.atmosphere import Floats, interval, piecewise_cubic
from sim.core.checks import float_array, is_number
from sim.core.compiled import kernel
from sim.core.errors import InputError

__all__ = ["CALM", "Wind", "sheared_wind", "steady_wind", "table_wind"]


class Wind(NamedTuple):
    """Wind as the compiled integrator reads it: cubics (m, 3, 4) of north, east and down between `breaks_m`.

    The number of breaks is one more than that of cubics; beyond the ends the end cubics are continued.
    """

    breaks_m: Floats
    cubics: Floats


CALM = Wind(np.empty(0), np.empty((0, 3, 4)))


def steady_wind(north_m_s: float = 0.0, east_m_s: float = 0.0, down_m_s: float = 0.0) -> Wind:
    """Same wind at every altitude; `east_m_s` > 0 blows from the west."""
    return sheared_wind((north_m_s, east_m_s, down_m_s), (0.0, 0.0, 0.0))


def sheared_wind(
    ground_ned_m_s: tuple[float, float, float], gradient_ned_1_s: tuple[float, float, float]
) -> Wind:
    """Wind that changes linearly with altitude: `ground` plus `gradient` times altitude."""
    for components in (ground_ned_m_s, gradient_ned_1_s):
        if len(components) != 3 or not all(is_number(component) for component in components):
            raise InputError(f"a wind has three finite components (north, east, down), not {components!r}")
    cubics = np.zeros((1, 3, 4))
    cubics[0, :, 0] = ground_ned_m_s
    cubics[0, :, 1] = gradient_ned_1_s
    return Wind(np.array([0.0, 1.0e6]), cubics)


def table_wind(
    altitude_m: Sequence[float] | Floats,
    north_m_s: Sequence[float] | Floats,
    east_m_s: Sequence[float] | Floats,
    down_m_s: Sequence[float] | Floats | None = None,
) -> Wind:
    """Wind from a table over altitude, by monotone C1 cubics; constant beyond its ends.

    Raises
    ------
    InputError
        If the columns differ in length or altitude does not increase.
    """
    z = float_array("altitude_m", altitude_m)
    down = np.zeros_like(z) if down_m_s is None else down_m_s
    columns = [float_array("wind", column) for column in (north_m_s, east_m_s, down)]
    if z.ndim != 1 or z.size < 2 or any(column.shape != z.shape for column in columns):
        raise InputError("a wind table needs columns of equal length, two rows or more")
    if not np.all(np.diff(z) > 0) or not all(np.all(np.isfinite(column)) for column in columns):
        raise InputError("a wind table needs increasing altitudes and finite components")
    inner = np.stack([piecewise_cubic(z, column, "smooth") for column in columns], axis=1)
    cubics = np.zeros((z.size + 1, 3, 4))  # one more interval, of constant wind, at each end
    cubics[1:-1] = inner
    for component, column in enumerate(columns):
        cubics[[0, -1], component, 0] = column[0], column[-1]
    return Wind(np.concatenate([[z[0] - 1.0], z, [z[-1] + 1.0]]), cubics)


@kernel
def wind_ned(wind: Wind, altitude_m: float) -> tuple[float, float, float]:
    """North, east and down components (m/s) at an altitude."""
    if wind.breaks_m.size == 0:
        return 0.0, 0.0, 0.0
    i = interval(wind.breaks_m, altitude_m)
    c = wind.cubics[i]
    x = altitude_m - wind.breaks_m[i]
    return (
        c[0, 0] + x * (c[0, 1] + x * (c[0, 2] + x * c[0, 3])),
        c[1, 0] + x * (c[1, 1] + x * (c[1, 2] + x * c[1, 3])),
        c[2, 0] + x * (c[2, 1] + x * (c[2, 2] + x * c[2, 3])),
    )
