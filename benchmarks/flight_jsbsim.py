"""The same entry flown by JSBSim from tables of our coefficients, at several steps, against this simulator.

    python benchmarks/flight_jsbsim.py          (needs: pip install jsbsim)

JSBSim interpolates CA, CN and Cm over Mach number and angle of attack (of one altitude); this simulator
computes pressure, friction and heat flux on the surface at every right-hand side. Best of three runs.
"""

import tempfile
import time
from pathlib import Path

import jsbsim
import numpy as np

from sim import fly, us1976
from sim.aero.aerodynamics import CA, CM_NOSE, CMQ, CN, N_LOADS, loads

DESIGN = (7.5, 12.5, 0.225)
MACHS = np.concatenate([[0.1, 0.5, 0.8, 1.0, 1.2], np.arange(1.5, 6.1, 0.25), np.arange(7.0, 18.1, 1.0)])
ALPHAS = np.concatenate([[-45, -40, -35, -30, -25], np.arange(-20, 20.1, 2.0), [25, 30, 35, 40, 45]])
FOOT = 0.3048


def coefficient_tables(flown, altitude_m=25_000.0):
    """CA, CN (signed), Cm about the centre of gravity (signed) over angle and Mach; damping per q D/V."""
    air, body, out = us1976()(altitude_m), flown.flight.body, np.empty(N_LOADS)
    tables = np.empty((3, ALPHAS.size, MACHS.size))
    for j, mach in enumerate(MACHS):
        for i, alpha in enumerate(np.radians(ALPHAS)):
            speed = mach * float(air.speed_of_sound_m_s)
            pressure, density, temperature = (
                float(value) for value in (air.pressure_Pa, air.density_kg_m3, air.temperature_K)
            )
            loads(flown.flight.surface, speed, mach, abs(alpha), pressure, density, temperature, out)
            moment = out[CM_NOSE] + out[CN] * body.cg_m / body.reference_length_m
            tables[:, i, j] = out[CA], np.sign(alpha) * out[CN], np.sign(alpha) * moment
    return tables, out[CMQ]


def table_xml(values, angle):
    head = " ".join(f"{mach:g}" for mach in MACHS)
    rows = "\n".join(
        f"{a:g} " + " ".join(f"{v:.7g}" for v in row) for a, row in zip(ALPHAS, values, strict=True)
    )
    return f"""<table><independentVar lookup="row">aero/{angle}-deg</independentVar>
<independentVar lookup="column">velocities/mach</independentVar><tableData>
{head}
{rows}
</tableData></table>"""


def product(*factors):
    parts = "".join(
        f if f.startswith("<") else f"<property>{f}</property>" if "/" in f else f"<value>{f}</value>"
        for f in factors
    )
    return f"<function><product>{parts}</product></function>"


def aircraft_xml(flown):
    body = flown.flight.body
    (axial, normal, pitch), damping = coefficient_tables(flown)
    force, length = ("aero/qbar-psf", "metrics/Sw-sqft"), "metrics/cbarw-ft"

    def rate(name):
        return product(
            *force, length, length, f"velocities/{name}-aero-rad_sec", "inverse/v", f"{damping:.7g}"
        )

    cg = f"<x>{body.cg_m}</x><y>0</y><z>0</z>"
    return f"""<?xml version="1.0"?>
<fdm_config name="entry" version="2.0" release="ALPHA">
<metrics><wingarea unit="M2">{body.reference_area_m2}</wingarea>
<wingspan unit="M">{body.reference_length_m}</wingspan><chord unit="M">{body.reference_length_m}</chord>
<location name="AERORP" unit="M">{cg}</location></metrics>
<mass_balance><ixx unit="KG*M2">{body.ixx_kg_m2}</ixx><iyy unit="KG*M2">{body.iyy_kg_m2}</iyy>
<izz unit="KG*M2">{body.izz_kg_m2}</izz><emptywt unit="KG">{body.mass_kg}</emptywt>
<location name="CG" unit="M">{cg}</location></mass_balance>
<ground_reactions/>
<aerodynamics>
<function name="inverse/v"><quotient><value>1.0</value>
<sum><value>0.1</value><property>velocities/vt-fps</property></sum></quotient></function>
<axis name="X">{product(*force, "-1.0", table_xml(axial, "alpha"))}</axis>
<axis name="Y">{product(*force, "-1.0", table_xml(normal, "beta"))}</axis>
<axis name="Z">{product(*force, "-1.0", table_xml(normal, "alpha"))}</axis>
<axis name="PITCH">{product(*force, length, table_xml(pitch, "alpha"))}{rate("q")}</axis>
<axis name="YAW">{product(*force, length, "-1.0", table_xml(pitch, "beta"))}{rate("r")}</axis>
</aerodynamics></fdm_config>"""


def jsbsim_flight(root, step):
    """Processor seconds, time of flight, impact speed."""
    simulator = jsbsim.FGFDMExec(str(root))
    simulator.set_debug_level(0)
    simulator.load_model("entry")
    simulator.set_dt(step)
    start = {"h-sl-ft": 82_000 / FOOT, "vt-fps": 4300 / FOOT, "psi-true-deg": 15.0}
    start |= {"alpha-deg": 30.0, "gamma-deg": -15.0}
    for name, value in start.items():
        simulator[f"ic/{name}"] = value
    simulator.run_ic()
    begin = time.process_time()
    while simulator["position/h-sl-ft"] > 0.0 and simulator.get_sim_time() < 300.0:
        simulator.run()
    seconds = time.process_time() - begin
    return seconds, simulator.get_sim_time(), simulator["velocities/vt-fps"] * FOOT


def main():
    same = {"earth": "wgs84", "atmosphere": "us1976"}  # what JSBSim has
    flown = fly(*DESIGN, **same)
    print(f"{'':>28} {'CPU s':>8} {'flight s':>9} {'impact m/s':>11}")
    for rtol in (1e-6, 1e-7):
        times = []
        for _ in range(3):
            begin = time.process_time()
            flown = fly(*DESIGN, rtol=rtol, **same)
            times.append(time.process_time() - begin)
        ends = f"{flown.path.time_s[-1]:9.2f} {flown.final('speed_m_s'):11.1f}"
        print(f"{f'this simulator, rtol {rtol:.0e}':>28} {min(times):8.3f} {ends}")
    with tempfile.TemporaryDirectory() as folder:
        aircraft = Path(folder) / "aircraft" / "entry"
        aircraft.mkdir(parents=True)
        (aircraft / "entry.xml").write_text(aircraft_xml(flown))
        for step in (0.001, 0.002, 0.005, 0.01):
            runs = [jsbsim_flight(Path(folder), step) for _ in range(3)]
            seconds, duration, speed = min(runs)
            print(f"{f'JSBSim, step {1e3 * step:g} ms':>28} {seconds:8.3f} {duration:9.2f} {speed:11.1f}")


if __name__ == "__main__":
    main()
