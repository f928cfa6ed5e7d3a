"""An atmosphere from rows of density, pressure and temperature against altitude."""

from __future__ import annotations

from collections.abc import Sequence
from typing import get_args

import numpy as np

from sim.air.atmosphere import GAS_CONSTANT_AIR, Atmosphere, Floats, Interpolation, table_model
from sim.air.standards import us1962
from sim.core.checks import float_array
from sim.core.errors import InputError

__all__ = ["table_atmosphere"]


def table_atmosphere(
    altitude_m: Sequence[float] | Floats,
    density_kg_m3: Sequence[float] | Floats,
    *,
    pressure_Pa: Sequence[float] | Floats | None = None,
    temperature_K: Sequence[float] | Floats | None = None,
    interpolation: Interpolation = "smooth",
    name: str = "table",
) -> Atmosphere:
    """Atmosphere from a table of density against geometric altitude.

    Parameters
    ----------
    altitude_m, density_kg_m3 : (n,) arrays, n >= 2
        Altitudes strictly increasing or strictly decreasing; densities positive.
    pressure_Pa, temperature_K : (n,) arrays, optional
        The missing one follows from the perfect-gas law; with neither, temperature is that of the
        U.S. Standard Atmosphere 1962 at the same altitude.
    interpolation : {"smooth", "log-linear"}
        Of ln rho, ln p and T between the rows: monotone C1 cubics (Fritsch-Carlson), or straight lines, which
        make the density exponential in between, as published entries mostly take it.
    name : str
        Used in messages.

    Raises
    ------
    InputError
        If the table is not monotone in altitude, too short, or holds non-positive or missing values.
    """
    if interpolation not in get_args(Interpolation):
        raise InputError(
            f"atmosphere '{name}': interpolation must be one of {', '.join(get_args(Interpolation))}, "
            f"not {interpolation!r}"
        )
    z, density = float_array("altitude_m", altitude_m), float_array("density_kg_m3", density_kg_m3)
    if not z.ndim == 1 or z.size < 2 or density.shape != z.shape:
        raise InputError(
            f"atmosphere '{name}': the columns must be one-dimensional, equally long, two rows or more"
        )
    if not np.all(np.isfinite(z)):
        raise InputError(f"atmosphere '{name}': every row needs an altitude")
    if pressure_Pa is None and temperature_K is None:
        standard = us1962()
        if z.min() < standard.model.lowest_m or z.max() > standard.model.highest_m:
            raise InputError(
                f"atmosphere '{name}': give temperature_K or pressure_Pa with it; the standard's temperature "
                f"covers {standard.model.lowest_m:g} to {standard.model.highest_m:g} m"
            )
        temperature = standard(z).temperature_K
    elif temperature_K is None:
        temperature = float_array("pressure_Pa", pressure_Pa) / (density * GAS_CONSTANT_AIR)
    else:
        temperature = float_array("temperature_K", temperature_K)
    if pressure_Pa is None:
        pressure = density * GAS_CONSTANT_AIR * temperature
    else:
        pressure = float_array("pressure_Pa", pressure_Pa)
    if {pressure.shape, temperature.shape} != {z.shape}:
        raise InputError(
            f"atmosphere '{name}': the columns must be one-dimensional, equally long, two rows or more"
        )
    if z[0] > z[-1]:
        z, density, pressure, temperature = z[::-1], density[::-1], pressure[::-1], temperature[::-1]
    if not np.all(np.diff(z) > 0):
        raise InputError(f"atmosphere '{name}': altitudes must increase (or decrease) from row to row")
    values = np.stack([density, pressure, temperature])
    if not np.all(np.isfinite(values)) or np.any(values <= 0):
        raise InputError(
            f"atmosphere '{name}': densities, pressures and temperatures must be positive numbers"
        )
    return Atmosphere(name, table_model(z, np.log(density), np.log(pressure), temperature, interpolation))
