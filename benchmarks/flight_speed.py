"""What one re-entry flight costs, where the time goes, and how that compares.

    python benchmarks/flight_speed.py

Processor seconds, best of five, all in one run; the ratios are what matters. SciPy integrates the same
compiled right-hand side.
"""

import subprocess
import sys
import time

import numpy as np
from numba import njit
from scipy.integrate import solve_ivp

from sim import Integration, evaluate, fly
from sim.aero.aerodynamics import N_LOADS, loads
from sim.flight.dynamics import (
    AIRSPEED,
    ALPHA,
    DENSITY,
    MACH,
    PRESSURE,
    STATES,
    TEMPERATURE,
    derivatives,
    new_scratch,
)
from sim.flight.earth import altitude

DESIGN = (7.5, 12.5, 0.225)
GENETIC_RUNS = 24 * 45


def best(call, repeat=5):
    """Least processor time of a call, and what it returned last."""
    times = []
    for _ in range(repeat):
        start = time.process_time()
        result = call()
        times.append(time.process_time() - start)
    return min(times), result


def own_flights():
    for rtol in (1e-6, 1e-7, 1e-8):
        seconds, flown = best(lambda rtol=rtol: fly(*DESIGN, rtol=rtol))
        yield f"this simulator, rtol {rtol:.0e}", seconds, flown.path.evaluations, flown


def presets():
    """Seconds of one flight at rtol 1e-6 by preset and quadrature, in turns."""
    kinds = [(preset, None) for preset in ("paper", "literal", "physics", "best")]
    kinds += [("paper", "fitted"), ("best", "even")]
    seconds = dict.fromkeys(kinds, np.inf)
    for _ in range(5):
        for preset, quadrature in kinds:
            used, _flown = best(
                lambda p=preset, q=quadrature: fly(*DESIGN, preset=p, quadrature=q, rtol=1e-6), 1
            )
            seconds[preset, quadrature] = min(seconds[preset, quadrature], used)
    return seconds


def scipy_flight(flown, method, rtol):
    """Same equations and tolerances through solve_ivp."""
    flight, scratch = flown.flight, new_scratch()
    control = Integration(rtol=rtol).control(0.0, 1e6)
    slope = np.empty(STATES)

    def rate(t, y):
        derivatives(flight, y, slope, scratch)
        return slope.copy()

    def ground(t, y):
        return altitude(flight.earth, y[0], y[1], y[2])

    ground.terminal = True
    start = flown.path.states[0]
    return solve_ivp(rate, (0.0, 1e3), start, method, rtol=rtol, atol=control.atol, events=ground)


@njit
def repeated_loads(surface, conditions, times):
    out = np.empty(N_LOADS)
    for _ in range(times):
        for c in conditions:
            loads(surface, c[AIRSPEED], c[MACH], c[ALPHA], c[PRESSURE], c[DENSITY], c[TEMPERATURE], out)
    return out


def share_of_loads(flown, seconds):
    """Part of a flight spent on the surface: the loads alone, repeated at the flight's own conditions."""
    conditions = np.ascontiguousarray(flown.path.conditions[::10])
    repeated_loads(flown.flight.surface, conditions, 1)
    each = best(lambda: repeated_loads(flown.flight.surface, conditions, 3))[0] / (3 * len(conditions))
    return flown.path.evaluations * each / seconds


def process_seconds(code):
    """Wall and processor time of a fresh Python process that runs this code."""
    start = time.perf_counter()
    script = f"{code}\nimport time; print(time.process_time())"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    return time.perf_counter() - start, float(done.stdout.split()[-1])


def genetic_search(workers):
    """Wall time of the paper's 24 x 45 direct simulations, from a tenth of them."""
    from joblib import Parallel, delayed

    random = np.random.default_rng(1)
    designs = random.uniform((5.0, 10.0, 0.15), (10.0, 15.0, 0.30), (GENETIC_RUNS // 10, 3))
    with Parallel(n_jobs=workers, batch_size=4) as pool:
        pool(delayed(evaluate)(*design) for design in designs[: 4 * workers])  # start the workers
        start = time.perf_counter()
        pool(delayed(evaluate)(*design) for design in designs)
        return 10 * (time.perf_counter() - start)


def main():
    evaluate(*DESIGN)  # compile or load
    print(f"{'one flight':>36} {'CPU s':>8} {'RHS':>8} {'us/RHS':>8}")
    for label, seconds, evaluations, _flown in own_flights():
        flown = _flown
        print(f"{label:>36} {seconds:8.3f} {evaluations:8d} {1e6 * seconds / evaluations:8.2f}")
    print(f"{'of which the surface (rtol 1e-8)':>36} {100 * share_of_loads(flown, seconds):7.0f}%")
    by_preset = presets()
    for (preset, quadrature), used in by_preset.items():
        label = f"{preset}, {quadrature or 'its own quadrature'}, rtol 1e-6"
        print(f"{label:>36} {used:8.3f} {used / by_preset['paper', None]:7.2f} times paper")
    for method, rtol in (("RK45", 1e-6), ("DOP853", 1e-7)):
        seconds, solution = best(lambda m=method, r=rtol: scipy_flight(flown, m, r), 2)
        evaluations = solution.nfev
        label = f"SciPy {method}, rtol {rtol:.0e}"
        print(f"{label:>36} {seconds:8.3f} {evaluations:8d} {1e6 * seconds / evaluations:8.2f}")
    seconds, _ = best(lambda: evaluate(*DESIGN))
    print(f"{'evaluate (responses and peaks)':>36} {seconds:8.3f}")

    wall, cpu = process_seconds("import sim.reentry")
    print(f"\nfresh process: import {wall:.2f} s wall, {cpu:.2f} s CPU", end="; ")
    wall, cpu = process_seconds(f"from sim.reentry import evaluate; evaluate{DESIGN}")
    print(f"import and one run {wall:.2f} s wall, {cpu:.2f} s CPU")

    one, two = genetic_search(1), genetic_search(2)
    print(f"{GENETIC_RUNS} flights: {one:.0f} s on one worker, {two:.0f} s on two", end=", ")
    print(f"parallel efficiency {one / two / 2:.2f}")


if __name__ == "__main__":
    main()
