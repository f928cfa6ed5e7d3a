"""Error against cost of one re-entry flight, and how smooth its responses are in the design variables.

    python benchmarks/flight_accuracy.py

Errors are relative to the same flight at rtol 1e-11 (integration) or with four times the quadrature points
(surface). Noise: 21 designs a hair apart along each variable; what a polynomial of degree 4 leaves of the
response, relative to the response.
"""

import time

import numpy as np

from sim import evaluate, fly

DESIGN = {"theta_c1_deg": 7.3, "theta_c2_deg": 12.2, "nose_radius_m": 0.21}
RESPONSES = ("axial_integral", "heat_integral", "margin_inverse")
WIDTH = {"theta_c1_deg": 1e-2, "theta_c2_deg": 1e-2, "nose_radius_m": 3e-4}


def responses(design=DESIGN, **settings):
    result = evaluate(**design, **settings)
    return np.array([result[name] for name in RESPONSES])


def cpu_seconds(**settings):
    times = []
    for _ in range(5):
        start = time.process_time()
        fly(**DESIGN, **settings)
        times.append(time.process_time() - start)
    return min(times)


def row(label, error, seconds, evaluations):
    print(f"{label:>28} {seconds:8.3f} {evaluations:8d}  " + "  ".join(f"{value:9.1e}" for value in error))


def main():
    print(f"{'':>28} {'CPU s':>8} {'RHS':>8}  error of F1    of F2     of F3     of impact point (m)")
    exact = responses(rtol=1e-11)
    landing = fly(**DESIGN, rtol=1e-11).final("downrange_m")
    for rtol in (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9):
        error = np.abs(responses(rtol=rtol) / exact - 1.0)
        flown = fly(**DESIGN, rtol=rtol)
        miss = abs(flown.final("downrange_m") - landing)
        row(f"rtol {rtol:.0e}", [*error, miss], cpu_seconds(rtol=rtol), flown.path.evaluations)

    fine = {"nose_rings": 24, "windward": 32, "leeward": 16}
    fine |= {"friction_rings": 16, "friction_stations": 12, "friction_windward": 20, "friction_leeward": 12}
    exact = responses(**fine)
    landing = fly(**DESIGN, **fine).final("downrange_m")
    for label, chosen in {
        "half the points": {name: max(value // 8, 1) for name, value in fine.items()},
        "default points": {},
        "twice the points": {name: value // 2 for name, value in fine.items()},
    }.items():
        error = np.abs(responses(**chosen) / exact - 1.0)
        flown = fly(**DESIGN, **chosen)
        miss = abs(flown.final("downrange_m") - landing)
        row(label, [*error, miss], cpu_seconds(**chosen), flown.path.evaluations)

    print(f"\n{'noise (rms) along':>28} {'rtol':>8}          of F1      of F2      of F3")
    offsets = np.linspace(-1.0, 1.0, 21)
    for name, width in WIDTH.items():
        for rtol in (1e-6, 1e-7, 1e-8):
            values = np.array(
                [responses({**DESIGN, name: DESIGN[name] + width * u}, rtol=rtol) for u in offsets]
            )
            smooth = np.polynomial.polynomial.polyfit(offsets, values, 4)
            rest = values - np.polynomial.polynomial.polyval(offsets, smooth).T
            noise = np.sqrt(np.sum(rest**2, axis=0) / (len(offsets) - 5)) / np.abs(values.mean(axis=0))
            print(f"{name:>28} {rtol:8.0e}      " + "  ".join(f"{value:9.1e}" for value in noise))


if __name__ == "__main__":
    main()
