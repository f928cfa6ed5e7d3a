"""The paper's entry flown by other programs, in one run: processor seconds and their ratio to our own.

    python benchmarks/flight_peers.py         (peers: pip install jsbsim rocketpy; missing ones are left out)

JSBSim interpolates tables of our coefficients over Mach number and incidence (``flight_jsbsim.py``). RocketPy
flies constant coefficients and slopes: its cost is that of its equations of motion. "SciPy and NumPy" is what
one would write by hand: the same motion over a round Earth, modified Newtonian pressure on a thousand flat
panels at every right-hand side, no friction, no heating. Least of three runs each.
"""

import importlib.util
import math
import tempfile
import time
import warnings
from pathlib import Path

import numpy as np
from flight_speed import scipy_flight
from scipy.integrate import solve_ivp

from sim import Air, coefficients, fly, reference_vehicle, us1962

DESIGN = (7.5, 12.5, 0.225)
GM, RADIUS = 3.986004418e14, 6_371_000.0
PANELS = (28, 36)  # along the body, around it


def least(flight, repeat=3):
    """Least processor time of some flights, and how the last one ended."""
    times = []
    for _ in range(repeat):
        begin = time.process_time()
        ended = flight()
        times.append(time.process_time() - begin)
    return min(times), *ended


def own(**settings):
    flown = fly(*DESIGN, **settings)
    return flown.path.time_s[-1], flown.final("speed_m_s")


def panels(vehicle):
    """Centres (n, 3), outward normals times areas (n, 3) of flat panels; x forward, from the nose tip."""
    x, r = vehicle.shape.outline(200)
    arc = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x), np.diff(r)))])
    cuts = np.linspace(0.0, arc[-1], PANELS[0] + 1)
    x, r = np.interp(cuts, arc, x), np.interp(cuts, arc, r)
    phi = (np.arange(PANELS[1]) + 0.5) * 2 * math.pi / PANELS[1]
    middle_x, middle_r = 0.5 * (x[1:] + x[:-1]), 0.5 * (r[1:] + r[:-1])
    width = middle_r * 2 * math.pi / PANELS[1]
    ones = np.ones_like(phi)
    centre = [np.outer(-middle_x, ones), np.outer(middle_r, np.cos(phi)), np.outer(middle_r, np.sin(phi))]
    normal = [
        np.outer(width * np.diff(r), ones),
        np.outer(width * np.diff(x), np.cos(phi)),
        np.outer(width * np.diff(x), np.sin(phi)),
    ]
    return np.stack(centre, -1).reshape(-1, 3), np.stack(normal, -1).reshape(-1, 3)


def numpy_flight(flown, rtol):
    """Six degrees of freedom by solve_ivp around NumPy arrays of panels."""
    vehicle = reference_vehicle(*DESIGN)
    centre, normal = panels(vehicle)
    area = np.linalg.norm(normal, axis=1)
    unit = normal / area[:, None]
    centre = centre + np.array([vehicle.cg_m, 0.0, 0.0])
    body = flown.flight.body
    inertia = np.array([body.ixx_kg_m2, body.iyy_kg_m2, body.izz_kg_m2])
    heights = np.arange(-500.0, 100e3, 250.0)
    air = us1962()(heights)
    logarithm, sound = np.log(air.density_kg_m3), air.speed_of_sound_m_s

    def rate(t, y):
        r, v, q, w = y[:3], y[3:6], y[6:10], y[10:13]
        distance = math.sqrt(r @ r)
        height = distance - RADIUS
        density = math.exp(np.interp(height, heights, logarithm))
        a, b, c, d = q / math.sqrt(q @ q)
        turn = np.array(
            [
                [1 - 2 * (c * c + d * d), 2 * (b * c + a * d), 2 * (b * d - a * c)],
                [2 * (b * c - a * d), 1 - 2 * (b * b + d * d), 2 * (c * d + a * b)],
                [2 * (b * d + a * c), 2 * (c * d - a * b), 1 - 2 * (b * b + c * c)],
            ]
        )
        u = turn @ v
        speed = math.sqrt(u @ u)
        mach = speed / np.interp(height, heights, sound)
        s = unit @ (u / speed)
        wake = -1.0 / max(mach, 1.5) ** 2
        s2 = s * s
        cp = np.where(s > 0.0, 1.83 * s2, wake * s2 / (s2 + 0.0025))
        force = -0.5 * density * speed * speed * (cp * area)[:, None] * unit
        total = force.sum(axis=0)
        moment = np.cross(centre, force).sum(axis=0)
        spin = 0.5 * np.array(
            [
                -b * w[0] - c * w[1] - d * w[2],
                a * w[0] - d * w[1] + c * w[2],
                d * w[0] + a * w[1] - b * w[2],
                -c * w[0] + b * w[1] + a * w[2],
            ]
        )
        return np.concatenate(
            [
                v,
                -GM / distance**3 * r + turn.T @ total / body.mass_kg,
                spin,
                (moment - np.cross(w, inertia * w)) / inertia,
            ]
        )

    def ground(t, y):
        return math.sqrt(y[:3] @ y[:3]) - RADIUS

    ground.terminal = True
    atol = np.repeat([1e-2, 1e-4, 1e-7, 1e-7], [3, 3, 4, 3]) * rtol / 1e-6
    start = flown.path.states[0, :13]
    done = solve_ivp(rate, (0.0, 300.0), start, "RK45", rtol=rtol, atol=atol, events=ground)
    return done.t[-1], np.linalg.norm(done.y[3:6, -1])


def _constant(value):
    """A number in the form RocketPy asks for."""
    return lambda alpha, beta, mach, reynolds, pitch_rate, yaw_rate, roll_rate: value


def rocketpy_flight(flown):
    """A function that flies RocketPy, LSODA at 1e-6, from linear coefficients of Mach 10 at 25 km."""
    from rocketpy import Environment, Flight, LinearGenericSurface, Rocket

    air = us1962()(25e3)
    stream = Air(*(float(x) for x in (air.pressure_Pa, air.density_kg_m3, air.temperature_K)))
    vehicle, body = reference_vehicle(*DESIGN), flown.flight.body
    at = coefficients(vehicle, 10.0, [0.0, 1.0], air=stream)
    normal = at.CN[1] / math.radians(1.0)
    pitch = (at.CM_nose[1] + at.CN[1] * body.cg_m / body.reference_length_m) / math.radians(1.0)
    lift, damping = normal - at.CA[0], 2.0 * at.Cmq[1]
    slopes = {"cD_0": at.CA[0], "cL_alpha": lift, "cQ_beta": -lift}
    slopes |= {"cm_alpha": pitch, "cn_beta": -pitch, "cm_q": damping, "cn_r": damping}
    constants = {name: _constant(float(value)) for name, value in slopes.items()}
    surface = LinearGenericSurface(body.reference_area_m2, body.reference_length_m, constants)
    inertia = (body.iyy_kg_m2, body.iyy_kg_m2, body.ixx_kg_m2)
    rocket = Rocket(body.reference_length_m / 2, body.mass_kg, inertia, 0.0, 0.0, 0.0)
    rocket.add_surfaces(surface, 0.0)
    environment = Environment(latitude=0.0, longitude=0.0, elevation=0.0)
    heights = np.arange(0.0, 90e3, 500.0)
    table = us1962()(heights)
    environment.set_atmospheric_model(
        "custom_atmosphere",
        pressure=np.stack([heights, table.pressure_Pa], axis=1).tolist(),
        temperature=np.stack([heights, table.temperature_K], axis=1).tolist(),
    )
    heading, climb, tilt = np.radians([15.0, -15.0, 90.0 - 15.0])  # the nose 15 deg above the horizon
    velocity = 4300.0 * np.array(
        [math.cos(climb) * math.sin(heading), math.cos(climb) * math.cos(heading), math.sin(climb)]
    )
    axis = math.sin(tilt / 2) * np.array([-math.cos(heading), math.sin(heading), 0.0])
    start = [0.0, 0.0, 0.0, 82e3, *velocity, math.cos(tilt / 2), *axis, 0.0, 0.0, 0.0]

    def flight():
        done = Flight(
            rocket=rocket,
            environment=environment,
            rail_length=1.0,
            initial_solution=start,
            max_time=300.0,
            rtol=1e-6,
        )
        end = done.solution[-1]
        return end[0], np.linalg.norm(end[4:7])

    return flight


def main():
    fly(*DESIGN)  # compile or load
    flown = fly(*DESIGN, rtol=1e-6)
    rows = [("this simulator, rtol 1e-6", *least(lambda: own(rtol=1e-6)))]
    base = rows[0][1]
    rows.append(("this simulator, rtol 1e-7", *least(lambda: own(rtol=1e-7))))

    def same_equations():
        done = scipy_flight(flown, "RK45", 1e-6)
        return done.t[-1], np.linalg.norm(done.y[3:6, -1])

    rows.append(("SciPy RK45 around our machine code", *least(same_equations)))
    rows.append(("SciPy RK45 and NumPy, 1008 panels", *least(lambda: numpy_flight(flown, 1e-6))))
    if importlib.util.find_spec("jsbsim"):
        from flight_jsbsim import aircraft_xml, jsbsim_flight

        same = fly(*DESIGN, earth="wgs84", atmosphere="us1976")
        with tempfile.TemporaryDirectory() as folder:
            aircraft = Path(folder) / "aircraft" / "entry"
            aircraft.mkdir(parents=True)
            (aircraft / "entry.xml").write_text(aircraft_xml(same))
            for step in (0.001, 0.002):
                runs = [jsbsim_flight(Path(folder), step) for _ in range(3)]
                rows.append((f"JSBSim, tables, step {1e3 * step:g} ms", *min(runs)))
    if importlib.util.find_spec("rocketpy"):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            rows.append(("RocketPy, LSODA 1e-6", *least(rocketpy_flight(flown))))
    print(f"{'':>36} {'CPU s':>8} {'ratio':>7} {'flight s':>9} {'impact m/s':>11}")
    for label, seconds, duration, speed in rows:
        print(f"{label:>36} {seconds:8.3f} {seconds / base:7.1f} {duration:9.2f} {speed:11.1f}")


if __name__ == "__main__":
    main()
