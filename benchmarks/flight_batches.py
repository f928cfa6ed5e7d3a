"""What a flight through tables costs and is off by, against the same flight by the laws.

    python benchmarks/flight_batches.py

Processor seconds, best of five, all in one run; the ratios are what matters.
"""

import time

import numpy as np

from sim import (
    PRESETS,
    Environment,
    InitialState,
    Integration,
    MethodSettings,
    dispersed,
    fly_body,
    fly_many,
    reference_vehicle,
    surface_body,
    tabulated,
    us1976,
)

START = InitialState.entry(82_000.0, 4300.0, -15.0, heading_deg=15.0, alpha_deg=30.0)
QUICK = Integration(rtol=1e-6)
FLIGHTS = 60


def best(call, repeat=5):
    """Least processor time of a call."""
    times = []
    for _ in range(repeat):
        start = time.process_time()
        call()
        times.append(time.process_time() - start)
    return min(times)


def one_flight(preset):
    laws = surface_body(reference_vehicle(7.5, 12.5, 0.225), MethodSettings(preset=preset))
    fly_body(laws, START, None, QUICK)
    fly_body(tabulated(laws), START, None, QUICK)  # compiled
    table = tabulated(laws)
    first = best(lambda: fly_body(table, START, None, QUICK), 1)
    slow, quick = (best(lambda body=body: fly_body(body, START, None, QUICK)) for body in (laws, table))
    print(
        f"{preset:10s} by the laws {slow:.4f} s, through tables {quick:.4f} s: {slow / quick:.1f} times; "
        f"the first flight, which fills them, {first / slow:.1f} flights"
    )


def monte_carlo():
    body = surface_body(reference_vehicle(7.5, 12.5, 0.225))
    airs = [dispersed(us1976(), seed) for seed in range(FLIGHTS)]
    days = [Environment(atmosphere=air.atmosphere, wind=air.wind) for air in airs]
    start = time.process_time()
    quick = fly_many(body, START, days, QUICK, checks=0)
    middle = time.process_time()
    laws = fly_many(body, START, days, QUICK, tables=False)
    end = time.process_time()
    print(
        f"{FLIGHTS} dispersed days: {end - middle:.1f} s by the laws, {middle - start:.1f} s through tables"
    )
    for name, true in laws.values.items():
        off = np.abs(quick[name] - true).max()
        scale = np.abs(true).max() or 1.0
        print(f"  {name:30s} largest difference {off / scale:8.1e} of the largest, spread {true.std():.3g}")


if __name__ == "__main__":
    for preset in PRESETS:
        one_flight(preset)
    monte_carlo()
