"""Adaptive Runge-Kutta of order 5(4), compiled as one loop: step control, dense output, ground event, guards.

Dormand & Prince, J. Comput. Appl. Math. 6 (1980) 19-26; PI step control and the dense output of order 4 after
Hairer, Norsett & Wanner, Solving Ordinary Differential Equations I (2nd ed.), II.4-II.6.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from sim.aero.aerodynamics import N_LOADS
from sim.air.atmosphere import Floats
from sim.core.compiled import kernel
from sim.core.machine_code import Reference, reference
from sim.flight.dynamics import CONDITIONS, CONTROLLED, STATES, Flight, Scratch, derivatives_at, new_scratch
from sim.flight.earth import altitude

__all__ = ["Control", "Path", "advance", "integrate", "interpolate"]

REACHED_END, REACHED_GROUND, LEFT_RANGE, STEP_UNDERFLOW, TOO_MANY_STEPS, _STORE_FULL = range(6)

_SAFETY, _SHRINK, _GROW = 0.85, 0.2, 5.0
_PI_BETA = 0.04
_ERROR_EXPONENT = 0.2 - 0.75 * _PI_BETA


class Control(NamedTuple):
    """How to integrate: tolerances per state, step bounds and where to stop.

    A controlled state y_i is held to atol_i + rtol_i |y_i| per step. `ground_m` is the altitude at which a
    descending flight ends (-inf for none), `floor_m` and `ceiling_m` those beyond which it is given up.
    """

    rtol: Floats
    atol: Floats
    end_time_s: float
    ground_m: float
    floor_m: float
    ceiling_m: float
    first_step_s: float
    largest_step_s: float
    most_steps: int


class Path(NamedTuple):
    """The integrated flight: accepted steps with what dense output needs.

    Attributes
    ----------
    status : int
        How it ended.
    time_s : (n + 1,) array
    states : (n + 1, STATES) array
    dense : (n, 4, STATES) array
        Coefficients of the interpolant on each step.
    conditions : (n + 1, CONDITIONS) array
    loads : (n + 1, N_LOADS) array
        Place, air, incidence and aerodynamic loads of the states, as the right-hand side found them.
    evaluations, rejected : int
        Right-hand sides computed, steps repeated.
    """

    status: int
    time_s: Floats
    states: Floats
    dense: Floats
    conditions: Floats
    loads: Floats
    evaluations: int
    rejected: int


@kernel
def _stages(
    flight: Reference[Flight], h: float, y: Floats, k: Floats, trial: Floats, scratch: Scratch
) -> None:
    """One step of Dormand-Prince from `y` with `k[0]` known: fills `k[1:7]` and the new state `trial`."""
    n = y.size
    for i in range(n):
        trial[i] = y[i] + h * 0.2 * k[0, i]
    derivatives_at(flight, trial, k[1], scratch)
    for i in range(n):
        trial[i] = y[i] + h * (3.0 / 40.0 * k[0, i] + 9.0 / 40.0 * k[1, i])
    derivatives_at(flight, trial, k[2], scratch)
    for i in range(n):
        trial[i] = y[i] + h * (44.0 / 45.0 * k[0, i] - 56.0 / 15.0 * k[1, i] + 32.0 / 9.0 * k[2, i])
    derivatives_at(flight, trial, k[3], scratch)
    for i in range(n):
        trial[i] = y[i] + h * (
            19372.0 / 6561.0 * k[0, i]
            - 25360.0 / 2187.0 * k[1, i]
            + 64448.0 / 6561.0 * k[2, i]
            - 212.0 / 729.0 * k[3, i]
        )
    derivatives_at(flight, trial, k[4], scratch)
    for i in range(n):
        trial[i] = y[i] + h * (
            9017.0 / 3168.0 * k[0, i]
            - 355.0 / 33.0 * k[1, i]
            + 46732.0 / 5247.0 * k[2, i]
            + 49.0 / 176.0 * k[3, i]
            - 5103.0 / 18656.0 * k[4, i]
        )
    derivatives_at(flight, trial, k[5], scratch)
    for i in range(n):
        trial[i] = y[i] + h * (
            35.0 / 384.0 * k[0, i]
            + 500.0 / 1113.0 * k[2, i]
            + 125.0 / 192.0 * k[3, i]
            - 2187.0 / 6784.0 * k[4, i]
            + 11.0 / 84.0 * k[5, i]
        )
    derivatives_at(flight, trial, k[6], scratch)


@kernel
def _error(h: float, y: Floats, trial: Floats, k: Floats, control: Control) -> float:
    """Root-mean-square of the embedded error estimate over the tolerances; at most 1 for a good step."""
    total = 0.0
    for i in range(CONTROLLED):
        estimate = h * (
            71.0 / 57600.0 * k[0, i]
            - 71.0 / 16695.0 * k[2, i]
            + 71.0 / 1920.0 * k[3, i]
            - 17253.0 / 339200.0 * k[4, i]
            + 22.0 / 525.0 * k[5, i]
            - 1.0 / 40.0 * k[6, i]
        )
        scale = control.atol[i] + control.rtol[i] * max(abs(y[i]), abs(trial[i]))
        total += (estimate / scale) ** 2
    return math.sqrt(total / CONTROLLED)


@kernel
def _dense_coefficients(h: float, y: Floats, trial: Floats, k: Floats, dense: Floats) -> None:
    for i in range(y.size):
        rise = trial[i] - y[i]
        bend = h * k[0, i] - rise
        dense[0, i] = rise
        dense[1, i] = bend
        dense[2, i] = rise - h * k[6, i] - bend
        dense[3, i] = h * (
            -12715105075.0 / 11282082432.0 * k[0, i]
            + 87487479700.0 / 32700410799.0 * k[2, i]
            - 10690763975.0 / 1880347072.0 * k[3, i]
            + 701980252875.0 / 199316789632.0 * k[4, i]
            - 1453857185.0 / 822651844.0 * k[5, i]
            + 69997945.0 / 29380423.0 * k[6, i]
        )


@kernel
def interpolate(start: Floats, dense: Floats, fraction: float, out: Floats) -> None:
    """State at a fraction (0 to 1) of a step, from its first state and dense coefficients."""
    rest = 1.0 - fraction
    for i in range(start.size):
        out[i] = start[i] + fraction * (
            dense[0, i] + rest * (dense[1, i] + fraction * (dense[2, i] + rest * dense[3, i]))
        )


@kernel
def _step_to_ground(
    flight: Reference[Flight],
    h: float,
    y: Floats,
    k: Floats,
    trial: Floats,
    dense: Floats,
    ground_m: float,
    scratch: Scratch,
) -> float:
    """Shorten a step that ends below the ground so that it ends on it; returns its length.

    The dense output brackets the crossing (bisection); two Newton corrections with true Runge-Kutta steps
    then put the end state on the ground with the accuracy of the integrator.
    """
    earth = flight[0].earth
    low, high = 0.0, 1.0
    for _ in range(50):
        middle = 0.5 * (low + high)
        interpolate(y, dense, middle, trial)
        if altitude(earth, trial[0], trial[1], trial[2]) > ground_m:
            low = middle
        else:
            high = middle
    length = high * h
    for _ in range(2):
        _stages(flight, length, y, k, trial, scratch)
        height = altitude(earth, trial[0], trial[1], trial[2]) - ground_m
        later = altitude(
            earth, trial[0] + 1e-3 * trial[3], trial[1] + 1e-3 * trial[4], trial[2] + 1e-3 * trial[5]
        )
        rate = (later - height - ground_m) / 1e-3
        if abs(rate) > 1e-9 and abs(height / rate) < 0.1 * h:
            length -= height / rate
    _stages(flight, length, y, k, trial, scratch)
    _dense_coefficients(length, y, trial, k, dense)
    return length


@kernel
def _copy(source: Floats, target: Floats) -> None:
    """Element by element: array assignment would compile the wording of its error messages, for seconds."""
    for i in range(source.size):
        target[i] = source[i]


def integrate(flight: Flight, start: Floats, control: Control) -> Path:
    """Fly from the state `start` at t = 0 until the ground, the end time or a guard."""
    progress = np.zeros(_PROGRESS)
    progress[[_NEXT_STEP, _PREVIOUS_ERROR]] = control.first_step_s, 1e-4
    store = _new_store(512)
    store.states[0] = start
    work = _Work(np.empty((7, STATES)), np.empty(STATES), np.empty(STATES), new_scratch())
    # Machine code returns a mere number, and no later than when the store is full. To build tuples or arrays
    # on the way back runs Python code, where a Ctrl-C that came during the flight crashes the interpreter.
    while (status := advance(flight, control, store, work, progress)) == _STORE_FULL:
        store = _enlarged(store)
    n = int(progress[_STEPS])
    rows, steps = slice(n + 1), slice(n)
    return Path(
        status,
        store.time_s[rows],
        store.states[rows],
        store.dense[steps],
        store.conditions[rows],
        store.loads[rows],
        int(progress[_EVALUATIONS]),
        int(progress[_REJECTED]),
    )


class _Store(NamedTuple):
    """Room for the accepted steps; the fields are those of the :class:`Path`."""

    time_s: Floats
    states: Floats
    dense: Floats
    conditions: Floats
    loads: Floats


class _Work(NamedTuple):
    """Work space of the integrator: derivatives at the stages, this state and the next, and the model's."""

    k: Floats
    y: Floats
    trial: Floats
    scratch: Scratch


def _new_store(steps: int) -> _Store:
    return _Store(
        np.zeros(steps + 1),
        np.empty((steps + 1, STATES)),
        np.empty((steps, 4, STATES)),
        np.empty((steps + 1, CONDITIONS)),
        np.empty((steps + 1, N_LOADS)),
    )


def _enlarged(full: _Store) -> _Store:
    """Twice the room, with what the full store holds."""
    larger = _new_store(2 * len(full.dense))
    for source, target in zip(full, larger, strict=True):
        target[: len(source)] = source
    return larger


# What has to survive while the store is enlarged.
_PROGRESS = 7
_TIME, _NEXT_STEP, _PREVIOUS_ERROR, _REPEATED, _STEPS, _REJECTED, _EVALUATIONS = range(_PROGRESS)


@kernel
def advance(flight: Flight, control: Control, store: _Store, work: _Work, progress: Floats) -> int:
    """Go on from row `progress[_STEPS]` of the store; returns how the flight ended, or that it is full.

    `work.k[0]` holds the derivative at that row, but at the start, where it is evaluated first.
    """
    at = reference(flight)
    k, y, trial, scratch = work.k, work.y, work.trial, work.scratch
    n, rejected, evaluations = int(progress[_STEPS]), int(progress[_REJECTED]), int(progress[_EVALUATIONS])
    t, h, previous_error = progress[_TIME], progress[_NEXT_STEP], progress[_PREVIOUS_ERROR]
    repeated = progress[_REPEATED] > 0.0
    _copy(store.states[n], y)
    if evaluations == 0:
        derivatives_at(at, y, k[0], scratch)
        evaluations = 1
        _copy(scratch.conditions, store.conditions[0])
        _copy(scratch.loads, store.loads[0])
    status = REACHED_END

    while t < control.end_time_s:
        if n == store.dense.shape[0]:
            status = _STORE_FULL
            break
        if n + rejected >= control.most_steps:
            status = TOO_MANY_STEPS
            break
        h = min(h, control.largest_step_s)
        last = t + 1.0000001 * h >= control.end_time_s
        if last:
            h = control.end_time_s - t
        if h < 1e-10 + 4e-16 * t and not last:
            status = STEP_UNDERFLOW
            break
        _stages(at, h, y, k, trial, scratch)
        evaluations += 6
        error = _error(h, y, trial, k, control)
        if not error <= 1.0:  # also catches NaN
            rejected += 1
            repeated = True
            if math.isfinite(error):
                h *= max(_SHRINK, _SAFETY * error ** (-_ERROR_EXPONENT))
            else:
                h *= _SHRINK
            continue

        dense = store.dense[n]
        _dense_coefficients(h, y, trial, k, dense)
        height = altitude(flight.earth, trial[0], trial[1], trial[2])
        landed = height <= control.ground_m
        if landed:
            h = _step_to_ground(at, h, y, k, trial, dense, control.ground_m, scratch)
            evaluations += 18
        factor = error**_ERROR_EXPONENT / (_SAFETY * previous_error**_PI_BETA)
        factor = min(max(factor, 1.0 / _GROW), 1.0 / _SHRINK)
        if repeated:
            factor = max(factor, 1.0)
        previous_error = max(error, 1e-4)
        repeated = False
        t = control.end_time_s if last and not landed else t + h
        h /= factor
        n += 1
        _copy(trial, y)
        _copy(k[6], k[0])
        store.time_s[n] = t
        _copy(y, store.states[n])
        _copy(scratch.conditions, store.conditions[n])  # the last stage of a step is its end
        _copy(scratch.loads, store.loads[n])
        if landed:
            status = REACHED_GROUND
            break
        if not control.floor_m <= height <= control.ceiling_m:
            status = LEFT_RANGE
            break
    progress[_TIME], progress[_NEXT_STEP], progress[_PREVIOUS_ERROR] = t, h, previous_error
    progress[_REPEATED] = 1.0 if repeated else 0.0
    progress[_STEPS], progress[_REJECTED], progress[_EVALUATIONS] = n, rejected, evaluations
    return status
