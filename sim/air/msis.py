"""NRLMSISE-00 / NRLMSIS 2 atmospheres through the optional package pymsis (``pip install rsmkit[msis]``)."""

from __future__ import annotations

from datetime import datetime

import numpy as np

from sim.air.altitude_table import table_atmosphere
from sim.air.atmosphere import Atmosphere
from sim.core.checks import check_numbers
from sim.core.errors import InputError

__all__ = ["msis"]

_BOLTZMANN = 1.380649e-23
_STEP_M = 1000.0
_VERSIONS = (0, 2.0, 2.1)


def msis(
    when: datetime | str,
    latitude_deg: float,
    longitude_deg: float,
    *,
    f107: float | None = None,
    f107a: float | None = None,
    ap: float | None = None,
    version: float = 2.1,
    highest_m: float = 200_000.0,
) -> Atmosphere:
    """Profile of NRLMSIS at one place and time, tabulated every kilometre from the ground up.

    Parameters
    ----------
    when : datetime or ISO text
        Universal time.
    latitude_deg, longitude_deg : float
    f107, f107a, ap : float
        Solar flux of the day before, its 81-day mean, daily geomagnetic index. All three are required:
        without them pymsis would fetch files from the network, and the same call could give another answer
        tomorrow.
    version : float
        0 (NRLMSISE-00), 2.0 or 2.1.
    highest_m : float
        Top of the table.

    Raises
    ------
    InputError
        If an index is missing or pymsis is not installed.
    """
    if f107 is None or f107a is None or ap is None:
        raise InputError(
            "NRLMSIS needs its space-weather indices: give f107, f107a and ap (for example 150, 150, 4)"
        )
    check_numbers(
        latitude_deg=latitude_deg,
        longitude_deg=longitude_deg,
        f107=f107,
        f107a=f107a,
        ap=ap,
        highest_m=highest_m,
    )
    if not (0 < f107 <= 1000 and 0 < f107a <= 1000 and 0 <= ap <= 400):
        raise InputError(f"no space weather has f107 {f107:g}, f107a {f107a:g}, ap {ap:g}")
    if version not in _VERSIONS:
        raise InputError(f"version must be one of {_VERSIONS}, not {version!r}")
    if not 2 * _STEP_M <= highest_m <= 1e6:
        raise InputError(f"highest_m must lie between 2 and 1000 km, not {highest_m:g} m")
    try:
        moment = np.datetime64(when)
    except ValueError:
        raise InputError(f"when must be a date and time, not {when!r}") from None
    try:
        import pymsis
    except ImportError:
        raise InputError("NRLMSIS needs the package pymsis: pip install 'rsmkit[msis]'") from None
    z = np.arange(0.0, highest_m + 0.5 * _STEP_M, _STEP_M)
    result = pymsis.calculate(
        moment,
        longitude_deg,
        latitude_deg,
        z / 1e3,
        [f107],
        [f107a],
        [[ap] * 7],
        version=version,
    )
    values = np.asarray(result, dtype=float).reshape(z.size, -1)
    temperature = values[:, pymsis.Variable.TEMPERATURE]
    species = values[:, [v for v in pymsis.Variable if v.name not in ("MASS_DENSITY", "TEMPERATURE")]]
    pressure = np.nansum(species, axis=1) * _BOLTZMANN * temperature
    return table_atmosphere(
        z,
        values[:, pymsis.Variable.MASS_DENSITY],
        pressure_Pa=pressure,
        temperature_K=temperature,
        name=f"NRLMSIS {version:g}",
    )
