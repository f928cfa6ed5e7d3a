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
from sim.core.compiled import inlined, kernel
from sim.core.machine_code import Reference, call, reference
from sim.flight.dynamics import CONDITIONS, CONTROLLED, STATES, Flight, Scratch, new_scratch
from sim.flight.earth import Earth, altitude

__all__ = ["Control", "Path", "advance", "evaluated", "integrate", "interpolate"]

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


# The method's table: stages, embedded error and dense output, each weighing the derivatives so far. Constants
# of the machine code; in loops over them the right-hand side is called from one place, and compiled fast.
_FIRST = 0.2
_STAGE = np.zeros((6, 6))
_STAGE[1, :2] = 3 / 40, 9 / 40
_STAGE[2, :3] = 44 / 45, -56 / 15, 32 / 9
_STAGE[3, :4] = 19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729
_STAGE[4, :5] = 9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656
_STAGE[5, :6] = 35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84
_ERROR = np.array([71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40])
_DENSE = np.array(
    [
        -12715105075 / 11282082432,
        0.0,
        87487479700 / 32700410799,
        -10690763975 / 1880347072,
        701980252875 / 199316789632,
        -1453857185 / 822651844,
        69997945 / 29380423,
    ]
)


@inlined
def _weighed(weights: Floats, k: Floats, i: int) -> float:
    """Weighted sum of the derivatives of state `i` at as many stages as there are weights."""
    total = float(weights[0] * k[0, i])
    for stage in range(1, weights.size):
        if weights[stage] != 0.0:
            total += weights[stage] * k[stage, i]
    return total


@kernel
def _stages(
    at: Reference[Flight], rates: int, h: float, y: Floats, k: Floats, trial: Floats, scratch: Scratch
) -> None:
    """One step of Dormand-Prince from `y` with `k[0]` known: fills `k[1:7]` and the new state `trial`."""
    place, work = reference(trial), reference(scratch)
    for stage in range(6):
        weights = _STAGE[stage, : stage + 1]
        for i in range(y.size):
            change = h * _weighed(weights, k, i) if stage > 0 else h * _FIRST * k[0, i]
            trial[i] = y[i] + change
        call(rates, (at, place, reference(k[stage + 1]), work))


@kernel
def _error(h: float, y: Floats, trial: Floats, k: Floats, control: Control) -> float:
    """Root-mean-square of the embedded error estimate over the tolerances; at most 1 for a good step."""
    total = 0.0
    for i in range(CONTROLLED):
        scale = control.atol[i] + control.rtol[i] * max(abs(y[i]), abs(trial[i]))
        total += (h * _weighed(_ERROR, k, i) / scale) ** 2
    return math.sqrt(total / CONTROLLED)


@kernel
def _dense_coefficients(h: float, y: Floats, trial: Floats, k: Floats, dense: Floats) -> None:
    for i in range(y.size):
        rise = trial[i] - y[i]
        bend = h * k[0, i] - rise
        dense[0, i] = rise
        dense[1, i] = bend
        dense[2, i] = rise - h * k[6, i] - bend
        dense[3, i] = h * _weighed(_DENSE, k, i)


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
    at: Reference[Flight],
    rates: int,
    earth: Earth,
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
        _stages(at, rates, length, y, k, trial, scratch)
        height = altitude(earth, trial[0], trial[1], trial[2]) - ground_m
        later = altitude(
            earth, trial[0] + 1e-3 * trial[3], trial[1] + 1e-3 * trial[4], trial[2] + 1e-3 * trial[5]
        )
        rate = (later - height - ground_m) / 1e-3
        if abs(rate) > 1e-9 and abs(height / rate) < 0.1 * h:
            length -= height / rate
    _stages(at, rates, length, y, k, trial, scratch)
    _dense_coefficients(length, y, trial, k, dense)
    return length


@kernel
def _copy(source: Floats, target: Floats) -> None:
    """Element by element: array assignment would compile the wording of its error messages, for seconds."""
    for i in range(source.size):
        target[i] = source[i]


@kernel
def _evaluate(at: Reference[Flight], rates: int, store: _Store, work: _Work) -> None:
    """Fill conditions and loads of the store with those of its states."""
    slope, place, scratch = reference(work.k[0]), reference(work.scratch), work.scratch
    for i in range(store.states.shape[0]):
        call(rates, (at, reference(store.states[i]), slope, place))
        _copy(scratch.conditions, store.conditions[i])
        _copy(scratch.loads, store.loads[i])


def evaluated(flight: Flight, states: Floats) -> tuple[Floats, Floats]:
    """Conditions (n, CONDITIONS) and loads (n, N_LOADS) of any states (n, STATES)."""
    n = states.shape[0]
    store = _Store(
        np.empty(n), states, np.empty((0, 4, STATES)), np.empty((n, CONDITIONS)), np.empty((n, N_LOADS))
    )
    progress = np.zeros(_PROGRESS)
    progress[_STEPS] = -1.0
    advance(flight, _NO_CONTROL, store, _new_work(), progress)
    return store.conditions, store.loads


def integrate(flight: Flight, start: Floats, control: Control) -> Path:
    """Fly from the state `start` at t = 0 until the ground, the end time or a guard."""
    progress = np.zeros(_PROGRESS)
    progress[[_NEXT_STEP, _PREVIOUS_ERROR]] = control.first_step_s, 1e-4
    store = _new_store(512)
    store.states[0] = start
    work = _new_work()
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


def _new_work() -> _Work:
    return _Work(np.empty((7, STATES)), np.empty(STATES), np.empty(STATES), new_scratch())


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


_NO_CONTROL = Control(np.empty(CONTROLLED), np.empty(CONTROLLED), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0)

# What has to survive while the store is enlarged.
_PROGRESS = 7
_TIME, _NEXT_STEP, _PREVIOUS_ERROR, _REPEATED, _STEPS, _REJECTED, _EVALUATIONS = range(_PROGRESS)


@kernel
def advance(flight: Flight, control: Control, store: _Store, work: _Work, progress: Floats) -> int:
    """Go on from row `progress[_STEPS]` of the store; returns how the flight ended, or that it is full.

    `work.k[0]` holds the derivative at that row, but at the start, where it is evaluated first. From row -1
    there is no flight: all rows of the store get the conditions and loads of their states. (A function of its
    own for that would be compiled to take the dozens of arrays of a flight from Python a second time.)
    """
    at = reference(flight)
    k, y, trial, scratch = work.k, work.y, work.trial, work.scratch
    if progress[_STEPS] < 0.0:
        _evaluate(at, flight.rates, store, work)
        return REACHED_END
    n, rejected, evaluations = int(progress[_STEPS]), int(progress[_REJECTED]), int(progress[_EVALUATIONS])
    t, h, previous_error = progress[_TIME], progress[_NEXT_STEP], progress[_PREVIOUS_ERROR]
    repeated = progress[_REPEATED] > 0.0
    _copy(store.states[n], y)
    if evaluations == 0:
        call(flight.rates, (at, reference(y), reference(k[0]), reference(scratch)))
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
        _stages(at, flight.rates, h, y, k, trial, scratch)
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
            h = _step_to_ground(
                at, flight.rates, flight.earth, h, y, k, trial, dense, control.ground_m, scratch
            )
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
