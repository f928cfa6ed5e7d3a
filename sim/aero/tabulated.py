"""Loads interpolated in a table that is filled by the laws themselves, cell by cell, as flights pass.

Of a perfect gas the loads on one vehicle depend on Mach number, incidence, Knudsen number (Reynolds number is
Mach number over it) and, weakly, temperature: through the wall's share of the total temperature, the law of
Sutherland, and the real gas behind a strong shock. Forces are tabulated as coefficients, those across the
axis over the sine of the incidence, and heat over the stream's flux of total enthalpy, so that all are
smooth. What lies outside the table, or finds it full, is computed by the laws.
"""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np

from sim.aero.aerodynamics import (
    CA,
    CA_BASE,
    CA_FRICTION,
    CM_NOSE,
    CMQ,
    CN,
    CN_FRICTION,
    ROLL_DAMPING,
    STAGNATION_HEAT_FLUX,
    SURFACE_HEAT_INFLOW,
    SURFACE_HEAT_RATE,
    XCP_M,
    YAW_DAMPING,
    Floats,
    loads_address,
)
from sim.aero.aeromodel import AeroModel
from sim.aero.gas import GAMMA, GAS_CONSTANT, HEAT_CAPACITY, viscosity
from sim.aero.tables.axes import Ruling
from sim.aero.tables.table import ENTRIES, LoadsTable, new_table
from sim.aero.thin_air.rarefied import knudsen_number
from sim.core.compiled import MACHINE_CODE, compiled, inlined, kernel
from sim.core.machine_code import Reference, call

__all__ = ["ready", "tabulated", "tabulated_address", "tabulated_loads_at"]

_MACH, _KNUDSEN, _TEMPERATURE, _INCIDENCE = range(4)
_USED, _CELL = 0, 1
_KNOT, _WHOLE_CELL = 1, 2  # what is known: the values at a knot, those that the cell behind it depends on
_SMALL_ANGLE = 1e-4  # as in the loads: closer to 0 and 180 deg the forces across the axis are linear


def tabulated(model: AeroModel) -> AeroModel:
    """The same vehicle and methods with an empty table, which flights fill."""
    return model._replace(table=new_table())


def ready(model: AeroModel) -> AeroModel:
    """Tell a table where the laws are that fill it: at another place in every process."""
    return model._replace(table=model.table._replace(laws=loads_address(model)))


def tabulated_address(model: AeroModel) -> int:
    """Address of the machine code of :func:`tabulated_loads_at` for models of this kind."""
    numbers: Any = numba
    number, pointer = numbers.float64, numbers.types.CPointer
    kinds = (pointer(numbers.typeof(model)), *[number] * 6, pointer(number[::1]))
    return MACHINE_CODE.entry(tabulated_loads_at, *kinds, _nrt=False)


@compiled
def _sine(alpha_rad: float) -> float:
    return math.sin(min(max(alpha_rad, _SMALL_ANGLE), math.pi - _SMALL_ANGLE))


@compiled
def _enthalpy_flux(density_kg_m3: float, speed_m_s: float, temperature_K: float) -> float:
    """Total enthalpy that the stream carries, W/m2."""
    return density_kg_m3 * speed_m_s * (HEAT_CAPACITY * temperature_K + 0.5 * speed_m_s * speed_m_s)


@inlined
def _cell(rules: Ruling, axis: int, guess: int, value: float) -> int:
    """Interval of an axis that holds a value, looked for from a neighbour; -1 outside."""
    knots, cells = rules.knots[axis], rules.cells[axis]
    if not knots[0] <= value <= knots[cells]:
        return -1
    i = max(guess, 0)
    while value < knots[i]:
        i -= 1
    while i < cells - 1 and value >= knots[i + 1]:
        i += 1
    return i


@inlined
def _weights(rules: Ruling, axis: int, cell: int, value: float) -> tuple[float, float, float, float]:
    """Shares of the four knots that a cell depends on."""
    knots, c = rules.knots[axis], rules.weights[axis, cell]
    t = (value - knots[cell]) / (knots[cell + 1] - knots[cell])
    return (
        c[0, 0] + t * (c[0, 1] + t * (c[0, 2] + t * c[0, 3])),
        c[1, 0] + t * (c[1, 1] + t * (c[1, 2] + t * c[1, 3])),
        c[2, 0] + t * (c[2, 1] + t * (c[2, 2] + t * c[2, 3])),
        c[3, 0] + t * (c[3, 1] + t * (c[3, 2] + t * c[3, 3])),
    )


@kernel
def _fill(
    at: Reference[AeroModel], table: LoadsTable, i: int, j: int, k: int, m: int, out: Reference[Floats]
) -> None:
    """Evaluate the laws at one knot."""
    model, load = at[0], out[0]
    knots = table.ruling.knots
    mach, temperature, alpha = knots[_MACH, i], knots[_TEMPERATURE, k], knots[_INCIDENCE, m]
    speed = mach * math.sqrt(GAMMA * GAS_CONSTANT * temperature)
    free_path = math.exp(knots[_KNUDSEN, j]) * model.knudsen_length_m
    density = viscosity(temperature) / free_path * math.sqrt(0.5 * math.pi / (GAS_CONSTANT * temperature))
    pressure = density * GAS_CONSTANT * temperature
    # the last knot is pi but for rounding, where the sine has lost its digits
    call(
        table.laws,
        (
            at,
            speed,
            mach,
            min(max(alpha, _SMALL_ANGLE), math.pi - _SMALL_ANGLE),
            pressure,
            density,
            temperature,
            out,
        ),
    )
    sine, flux = _sine(alpha), _enthalpy_flux(density, speed, temperature)
    column = table.column_of[i, j, k]
    start = ENTRIES * (column * table.known.shape[1] + m)
    row = table.values[start : start + ENTRIES]
    row[0], row[1], row[2] = load[CA], load[CA_FRICTION], load[CA_BASE]
    row[3], row[4], row[5] = load[CN] / sine, load[CN_FRICTION] / sine, load[CM_NOSE] / sine
    row[6] = load[STAGNATION_HEAT_FLUX] / flux
    row[7], row[8] = load[SURFACE_HEAT_RATE] / flux, load[SURFACE_HEAT_INFLOW] / flux
    row[9] = load[CMQ]
    table.known[column, m] |= _KNOT


@kernel
def _enter(table: LoadsTable, i: int, j: int, k: int) -> bool:
    """Make the columns around a cell (i, j, k) the present corners; False when there is no room for them."""
    memory, rules = table.memory, table.ruling
    if memory[_CELL] == i and memory[_CELL + 1] == j and memory[_CELL + 2] == k:
        return True
    memory[_CELL] = -1
    first_i, first_j, first_k = rules.first[_MACH, i], rules.first[_KNUDSEN, j], rules.first[_TEMPERATURE, k]
    corner = 0
    for a in range(first_i, first_i + 4):
        for b in range(first_j, first_j + 4):
            for c in range(first_k, first_k + 4):
                if table.column_of[a, b, c] < 0:
                    if memory[_USED] == table.known.shape[0]:
                        return False
                    table.column_of[a, b, c] = memory[_USED]
                    memory[_USED] += 1
                table.corners[corner] = ENTRIES * table.known.shape[1] * table.column_of[a, b, c]
                corner += 1
    memory[_CELL], memory[_CELL + 1], memory[_CELL + 2] = i, j, k
    return True


@kernel
def _complete(
    at: Reference[AeroModel], table: LoadsTable, i: int, j: int, k: int, m: int, out: Reference[Floats]
) -> None:
    """See to it that all knots are filled that a cell depends on."""
    rules, own = table.ruling, table.column_of[i, j, k]
    if table.known[own, m] & _WHOLE_CELL:
        return
    first_i, first_j, first_k = rules.first[_MACH, i], rules.first[_KNUDSEN, j], rules.first[_TEMPERATURE, k]
    first_m = rules.first[_INCIDENCE, m]
    for a in range(first_i, first_i + 4):
        for b in range(first_j, first_j + 4):
            for c in range(first_k, first_k + 4):
                for d in range(first_m, first_m + 4):
                    if not table.known[table.column_of[a, b, c], d] & _KNOT:
                        _fill(at, table, a, b, c, d, out)
    table.known[own, m] |= _WHOLE_CELL


@kernel
def _interpolate(
    table: LoadsTable, mach: float, knudsen: float, temperature: float, alpha: float, cell: int
) -> None:
    """Fill the first ``ENTRIES`` sums from the corners of the present cell."""
    rules, memory, sums = table.ruling, table.memory, table.sums
    values, corners, width = table.values, table.corners, 4 * ENTRIES
    over_mach = _weights(rules, _MACH, memory[_CELL], mach)
    over_knudsen = _weights(rules, _KNUDSEN, memory[_CELL + 1], knudsen)
    over_temperature = _weights(rules, _TEMPERATURE, memory[_CELL + 2], temperature)
    for q in range(width):
        sums[q] = 0.0
    start = np.uintp(ENTRIES * rules.first[_INCIDENCE, cell])
    corner = 0
    for a in range(4):
        for b in range(4):
            share = over_mach[a] * over_knudsen[b]
            w0, w1 = share * over_temperature[0], share * over_temperature[1]
            w2, w3 = share * over_temperature[2], share * over_temperature[3]
            c0, c1, c2, c3 = corners[corner], corners[corner + 1], corners[corner + 2], corners[corner + 3]
            corner += 4
            for q in range(width):  # unsigned, and four at once: so the processor does several in a stroke
                at = start + np.uintp(q)
                sums[q] += (
                    w0 * values[c0 + at] + w1 * values[c1 + at] + w2 * values[c2 + at] + w3 * values[c3 + at]
                )
    w0, w1, w2, w3 = _weights(rules, _INCIDENCE, cell, alpha)
    for q in range(ENTRIES):
        sums[q] = (
            w0 * sums[q] + w1 * sums[ENTRIES + q] + w2 * sums[2 * ENTRIES + q] + w3 * sums[3 * ENTRIES + q]
        )


@kernel
def tabulated_loads_at(
    at: Reference[AeroModel],
    speed_m_s: float,
    mach: float,
    alpha_rad: float,
    p_Pa: float,
    rho_kg_m3: float,
    T_K: float,
    place: Reference[Floats],
) -> None:
    """Fill the array in its `place` as :func:`sim.aero.aerodynamics.loads_at` does."""
    model, out = at[0], place[0]
    table = model.table
    rules, memory, sums = table.ruling, table.memory, table.sums
    knudsen = math.log(knudsen_number(p_Pa, rho_kg_m3, T_K, model.knudsen_length_m))
    i = _cell(rules, _MACH, memory[_CELL], mach)
    j = _cell(rules, _KNUDSEN, memory[_CELL + 1], knudsen)
    k = _cell(rules, _TEMPERATURE, memory[_CELL + 2], T_K)
    last = rules.cells[_INCIDENCE]
    m = _cell(rules, _INCIDENCE, memory[_CELL + 3], min(alpha_rad, rules.knots[_INCIDENCE, last]))
    if min(i, j, k, m) < 0 or not _enter(table, i, j, k):
        call(table.laws, (at, speed_m_s, mach, alpha_rad, p_Pa, rho_kg_m3, T_K, place))
        return
    memory[_CELL + 3] = m
    _complete(at, table, i, j, k, m, place)
    _interpolate(table, mach, knudsen, T_K, alpha_rad, m)
    sine, flux = math.sin(alpha_rad), _enthalpy_flux(rho_kg_m3, speed_m_s, T_K)
    out[CA], out[CA_FRICTION], out[CA_BASE] = sums[0], sums[1], sums[2]
    out[CN], out[CN_FRICTION], out[CM_NOSE] = sine * sums[3], sine * sums[4], sine * sums[5]
    out[XCP_M] = -sums[5] / sums[3] * model.reference_length_m
    out[STAGNATION_HEAT_FLUX] = flux * sums[6]
    out[SURFACE_HEAT_RATE], out[SURFACE_HEAT_INFLOW] = flux * sums[7], flux * sums[8]
    out[CMQ] = out[YAW_DAMPING] = sums[9]
    out[ROLL_DAMPING] = 0.0
