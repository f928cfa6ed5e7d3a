"""Write the tables of the aerothermodynamics pages: of the validation, beside this script, and of the laws.

    python docs/validation/aero_tables.py            # every table
    python docs/validation/aero_tables.py presets    # one page

Each page holds its table between two marker lines; the text around it is written by hand.
"""

from __future__ import annotations

import csv
import math
import sys
import time
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np

from sim import (
    PRESETS,
    PRESSURE_LAWS,
    Air,
    BodyShape,
    Resolution,
    Wall,
    coefficients,
    methods,
    reference_vehicle,
    sphere_cone,
)
from sim.aero import aerodynamics as aero
from sim.aero import gas
from sim.aero.pressure_laws import inviscid
from sim.aero.wall import heating, viscous

HERE = Path(__file__).resolve().parent
LAWS_PAGE = HERE.parent / "aerothermodynamics.md"
DATA = HERE.parents[1] / "tests" / "data" / "aero"
OPTIMUM = (math.degrees(0.155727), math.degrees(0.191795), 0.20638)
AIR = {
    8.0: Air(35651.6, 0.525786, 236.2151),
    10.0: Air(26499.87, 0.4135102, 223.2521),
    30.0: Air(1197.03, 1.841017e-2, 226.509),
    60.0: Air(22.46063, 3.059188e-4, 255.772),
}
FLOWN = ("paper", "literal", "physics", "best")


def rows(name: str) -> list[dict[str, str]]:
    """Rows of a reference table."""
    with (DATA / f"{name}.csv").open() as file:
        return list(csv.DictReader(file))


def table(header: Iterable[str], body: Iterable[Iterable[str]]) -> str:
    """Markdown table."""
    lines = ["| " + " | ".join(header) + " |"]
    lines.append("|" + "---|" * (lines[0].count("|") - 1))
    lines += ["| " + " | ".join(cells) + " |" for cells in body]
    return "\n".join(lines)


def rms(errors: list[float]) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(errors))))


def worst(pairs: Iterable[tuple[float, float]]) -> str:
    """Largest relative deviation."""
    return f"{max(abs(ours / theirs - 1.0) for ours, theirs in pairs):.1e}"


def pressure() -> str:
    """Every row of the register of pressure laws."""

    def span(low: float, high: float) -> str:
        return f"from {low:g}" if math.isinf(high) else f"{low:g} to {high:g}"

    body = [
        (f"`{word}`", ", ".join(law.roles), law.cp, span(*law.mach), span(*law.angle_deg), law.source)
        for word, law in PRESSURE_LAWS.items()
    ]
    return table(("law", "serves as", "Cp", "Mach", "d, deg", "source"), body)


def laws() -> str:
    """Largest deviation of every law from its reference table."""
    g = 1.4
    body = []

    def add(law: str, reference: str, points: int, deviation: str, tolerance: str) -> None:
        body.append((law, reference, str(points), deviation, tolerance))

    shock = rows("gasdynamics_g1p4")
    mach = [float(row["M"]) for row in shock]
    for law, column, function in (
        ("pitot pressure", "p02_p1_pitot", gas.pitot_pressure_ratio),
        ("Cp_max", "Cpmax", gas.stagnation_pressure_coefficient),
        ("normal shock, M2", "M2", gas.normal_shock_mach),
        ("normal shock, p02/p01", "p02_p01", gas.normal_shock_total_pressure_ratio),
    ):
        pairs = [(function(m, g), float(row[column])) for m, row in zip(mach, shock, strict=True)]
        add(law, "NACA 1135", len(pairs), worst(pairs), "2e-8")
    pairs = [
        (math.degrees(gas.prandtl_meyer_angle(m, g)), float(r["nu_deg"]))
        for m, r in zip(mach, shock, strict=True)
    ]
    add("Prandtl-Meyer angle", "NACA 1135", len(pairs), worst(pairs), "2e-8")

    matches = [row for row in rows("kaufman_match") if row["exists"] == "True"]
    pairs = []
    for row in matches:
        gamma = float(row["gamma"])
        match = inviscid.kaufman_match(float(row["M"]), gamma, *inviscid.kaufman_limit(gamma))
        pairs += [(match[0], float(row["Mq"])), (math.degrees(match[2]), float(row["delta_q_deg"]))]
    add("Kaufman's matching point", "root by Brent's method", len(pairs), worst(pairs), "1e-8")

    cones = rows("taylor_maccoll")
    for law, column, function, tolerance in (
        ("tangent cone, Mark III", "Cp_tc_shabp_emp", inviscid.tangent_cone_habp3, "1e-7"),
        ("tangent cone, Edwards", "Cp_tc_edwards", inviscid.tangent_cone_edwards, "1e-7"),
        ("tangent cone, Hammitt-Murthy", "Cp_tc_HM", inviscid.tangent_cone_hammitt_murthy, "5e-5"),
    ):
        values = [function(math.sin(math.radians(float(r["cone_deg"]))), float(r["Mach"]), g) for r in cones]
        add(
            law,
            "the formula, evaluated elsewhere",
            len(cones),
            worst(zip(values, (float(r[column]) for r in cones), strict=True)),
            tolerance,
        )
        band = [
            v / float(r["Cp_TM"]) - 1.0
            for v, r in zip(values, cones, strict=True)
            if float(r["cone_deg"]) <= 20.0 and float(r["Mach"]) <= 20.0
        ]
        bound = {"Cp_tc_shabp_emp": "33 %", "Cp_tc_edwards": "3 %", "Cp_tc_HM": "1 %"}[column]
        add(
            "",
            "Taylor-Maccoll, 5-20 deg, M 3-20",
            len(band),
            f"{100 * min(band):+.1f} to {100 * max(band):+.1f} %",
            bound,
        )

    chi = rows("spalding_chi_incompressible")
    pairs = [(viscous.spalding_chi_law(float(r["cfFc"]))[0], float(r["Rx_FRx"])) for r in chi]
    add("Spalding-Chi, universal law", "numerical integration", len(pairs), worst(pairs), "1e-6")
    chi = rows("spalding_chi_compressible")
    factors = [viscous.spalding_chi_factors(float(r["Me"]), float(r["Tw_Te"]), 0.89) for r in chi]
    pairs = [(f[0], float(r["Fc"])) for f, r in zip(factors, chi, strict=True)]
    pairs += [(f[1], float(r["FRx"])) for f, r in zip(factors, chi, strict=True)]
    add("Spalding-Chi, F_c and F_Rx", "numerical integration", len(pairs), worst(pairs), "1e-6")
    pairs = [
        (viscous.spalding_chi_friction(1e7, float(r["Me"]), float(r["Tw_Te"]), 0.89), float(r["cf_Rx1e+07"]))
        for r in chi
    ]
    add("Spalding-Chi, explicit form at Re 1e7", "the universal law", len(pairs), worst(pairs), "1 %")

    friction = {"lam": [], "sc": [], "eck": []}
    for row in rows("cone_viscous_cases"):
        me, te, tw, re = (float(row[key]) for key in ("Me", "Te_K", "Tw_K", "Re_ex"))
        if row["mode"] == "lam":
            value = viscous.CONE_LAMINAR * viscous.laminar_friction(re, me, te, tw / te)
        elif row["mode"] == "sc":
            value = viscous.CONE_TURBULENT * viscous.spalding_chi_friction(
                re, me, tw / te, viscous.RECOVERY_TURBULENT
            )
        else:
            value = viscous.CONE_TURBULENT * viscous.turbulent_reference_friction(re, me, te, tw / te)
        friction[row["mode"]].append((value, float(row["cf_edge"])))
    for law, mode in (
        ("reference enthalpy, laminar", "lam"),
        ("Spalding-Chi on cones", "sc"),
        ("reference enthalpy, turbulent", "eck"),
    ):
        add(law, "8.92 and 10 deg cones, M 5-14, 8-60 km", len(friction[mode]), worst(friction[mode]), "1e-6")

    lees = []
    for row in rows("lees_distribution"):
        argument, m = float(row["arg"]), float(row["M"])
        if row["kind"] == "sphere":
            value = heating.lees_sphere(math.radians(argument), m, g)
        else:
            value = heating.lees_cone(argument, math.radians(float(row["theta_c_deg"])), m, g)
        lees.append((value, float(row["q_q0"])))
    add("Lees's distribution", "his integral, numerically", len(lees), worst(lees), "1e-6")

    cold = [row for row in rows("stagnation_heating") if float(row["Tw"]) == 300.0]
    for law, column, function, tolerance in (
        ("Sutton-Graves", "q_SG_wall", heating.sutton_graves, "1e-4"),
        ("Detra-Kemp-Riddell", "q_DKR", heating.detra_kemp_riddell, "1e-4"),
        ("Fay-Riddell, perfect gas", "q_FR_pg", heating.fay_riddell, "1e-3"),
        ("Fay-Riddell", "q_FR_eq", heating.fay_riddell, "2.5 %"),
    ):
        pairs = []
        for row in cold:
            speed, temperature = (
                float(row["V"]),
                (float(row["V"]) / float(row["M"])) ** 2 / (1.4 * gas.GAS_CONSTANT),
            )
            density = 0.2 * (float(row["q_SG_V3"]) / 1.7415e-4 / speed**3) ** 2
            pairs.append((function(density, speed, 0.2, temperature, 300.0), float(row[column])))
        reference = "with equilibrium air" if column == "q_FR_eq" else "the formula, evaluated elsewhere"
        add(law, reference, len(pairs), worst(pairs), tolerance)
    pairs = []
    for row in cold:
        density = 0.2 * (float(row["q_SG_V3"]) / 1.7415e-4 / float(row["V"]) ** 3) ** 2
        increment = gas.equilibrium_pressure_increment(float(row["V"]), density)
        pairs.append((float(row["Cpmax_pg"]) + increment, float(row["Cpmax_eq"])))
    add("Cp_max of equilibrium air", "equilibrium normal shocks", len(pairs), worst(pairs), "1e-3")
    return table(("law", "reference", "points", "largest deviation", "tolerance in the tests"), body)


def newtonian() -> str:
    """Sphere-cones at incidence against closed forms."""
    body = []
    for half_angle, bluntness in (("5", "0.1"), ("9", "0.3"), ("15", "0.4")):
        for row in rows("newtonian_spherecone"):
            if (row["theta_c_deg"], row["Rn_Rb"]) != (half_angle, bluntness):
                continue
            alpha = float(row["alpha_deg"])
            got = coefficients(
                sphere_cone(float(half_angle), float(bluntness), 1.0),
                10.0,
                alpha,
                "newtonian",
                stagnation_cp=2.0,
            )
            cells = [half_angle, bluntness, f"{alpha:g}"]
            for value, column in ((got.CA, "CA_K2"), (got.CN, "CN_K2"), (got.CM_nose, "Cm_nose_K2")):
                reference = float(row[column])
                cells += [f"{reference:.6f}", f"{abs(float(value) - reference):.0e}"]
            body.append(cells)
    header = ("cone, deg", "Rn/Rb", "alpha, deg", "CA", "error", "CN", "error", "Cm (nose)", "error")
    return table(header, body)


def presets() -> str:
    """The paper's Tables 4-6 with every preset, and the axial force of Euler solutions."""
    chosen = [name for name in FLOWN if name in PRESETS]
    vehicle = reference_vehicle(*OPTIMUM)
    conditions = [
        row for row in rows("reference_vehicle_fit") if row["preset"] == "P1" and row["edge"] == "NSE"
    ]
    errors: dict[tuple[str, str], list[float]] = {}
    body = []
    for symbol, attribute, sign in (("CA", "CA", 1.0), ("CN", "CN", 1.0), ("Cm", "CM_nose", -1.0)):
        for row in conditions:
            mach, alpha, altitude = float(row["M"]), float(row["alpha"]), float(row["alt_km"])
            cfd, subroutine = float(row[f"cfd_{symbol}"]), float(row[f"paper_{symbol}"])
            cells = [symbol, f"{mach:g}", f"{alpha:g}", f"{altitude:g}", f"{cfd:.4f}", f"{subroutine:.4f}"]
            for name in chosen:
                got = coefficients(
                    vehicle,
                    mach,
                    alpha,
                    name,
                    air=AIR[altitude],
                    wall=Wall(),
                    stagnation_cp="perfect_gas",
                    shadow_ramp=0.0,
                )
                value = sign * float(getattr(got, attribute))
                if subroutine == 0.0:
                    cells.append(f"{value:.4f}")
                    continue
                errors.setdefault((name, "subroutine"), []).append(value / subroutine - 1.0)
                errors.setdefault((name, "cfd"), []).append(value / cfd - 1.0)
                cells.append(
                    f"{value:.4f} ({100 * (value / subroutine - 1):+.1f}, {100 * (value / cfd - 1):+.1f})"
                )
            body.append(cells)
    for column, label in (("subroutine", "rms against Subroutine, %"), ("cfd", "rms against CFD, %")):
        body.append(
            ["", "", "", "", "", label, *(f"**{100 * rms(errors[name, column]):.1f}**" for name in chosen)]
        )
    return table(("", "M", "alpha", "km", "CFD", "Subroutine", *chosen), body)


def euler() -> str:
    """Forebody axial force at zero incidence, pressure only."""
    chosen = [name for name in FLOWN if name in PRESETS]
    errors: dict[str, list[float]] = {name: [] for name in chosen}
    body = []
    for row in rows("euler_alpha0_CA"):
        bluntness, mach, exact = float(row["Rn_Rb"]), float(row["M"]), float(row["CA_euler"])
        reference = row["body"] == "refSCCF"
        shape = reference_vehicle(*OPTIMUM).shape if reference else sphere_cone(9.0, bluntness, 1.0)
        cells = ["reference vehicle" if reference else f"9 deg, {bluntness:g}", f"{mach:g}", f"{exact:.4f}"]
        for name in chosen:
            got = coefficients(shape, mach, 0.0, name)
            deviation = 100 * (float(got.CA - got.CA_base) / exact - 1.0)
            if bluntness >= 0.3:
                errors[name].append(deviation)
            cells.append(f"{deviation:+.1f} %")
        body.append(cells)
    body.append(["rms, Rn/Rb >= 0.3", "", "", *(f"**{rms(errors[name]):.1f} %**" for name in chosen)])
    return table(("body", "M", "Euler CA", *chosen), body)


def best() -> str:
    """Forebody axial force of vehicles across the design box."""
    chosen = [name for name in FLOWN if name in PRESETS]
    errors: dict[tuple[str, bool], list[float]] = {}
    body = []
    for row in rows("euler_vehicles_CA"):
        design = tuple(float(row[key]) for key in ("theta_c1_deg", "theta_c2_deg", "nose_radius_m"))
        mach, exact = float(row["M"]), float(row["CA_euler"])
        fitted = mach in (5.0, 10.0)
        cells = [
            " / ".join(f"{value:g}" for value in design),
            f"{mach:g}",
            f"{exact:.4f}",
            "fit" if fitted else "held out",
        ]
        for name in chosen:
            got = coefficients(reference_vehicle(*design), mach, 0.0, name)
            deviation = 100 * (float(got.CA - got.CA_base) / exact - 1.0)
            errors.setdefault((name, fitted), []).append(deviation)
            cells.append(f"{deviation:+.1f}")
        body.append(cells)
    for fitted, label in ((True, "rms, fit"), (False, "rms, held out")):
        body.append([label, "", "", "", *(f"**{rms(errors[name, fitted]):.1f}**" for name in chosen)])
    return table(("theta_c1 / theta_c2 / Rn", "M", "Euler CA", "", *chosen), body)


def convergence() -> str:
    """Error and cost of the surface integrals against the number of quadrature points."""
    vehicle = reference_vehicle(8.0, 12.0, 0.2)
    conditions = [
        (m, a, km) for m in (4.0, 8.0, 14.0) for a in (0.5, 3.0, 8.0, 15.0, 30.0) for km in (10.0, 30.0, 60.0)
    ]

    def evaluate(resolution: Resolution) -> tuple[np.ndarray, float]:
        model = aero.prepare(vehicle, methods("paper", blend=(4.5, 5.5)), Wall(), resolution)
        out = np.zeros((len(conditions), aero.N_LOADS))
        best = math.inf
        for _ in range(5):
            clock = time.process_time()
            for _ in range(20):
                for row, (mach, alpha, km) in zip(out, conditions, strict=True):
                    air = AIR[km]
                    state = (air.pressure_Pa, air.density_kg_m3, air.temperature_K)
                    aero.loads(model, mach * air.sound_speed_m_s, mach, math.radians(alpha), *state, row)
            best = min(best, (time.process_time() - clock) / 20 / len(conditions))
        return out, best

    exact, _ = evaluate(Resolution(32, 32, 24, 24, 16, 24, 16))
    coarse = Resolution(1, 1, 1, 1, 1, 1, 1)
    _, overhead = evaluate(coarse)
    body = []
    for numbers in (
        (3, 4, 2, 2, 2, 2, 1),
        (4, 6, 3, 3, 3, 3, 2),
        (6, 8, 4, 4, 4, 4, 3),
        (8, 12, 6, 6, 6, 6, 4),
        (12, 16, 8, 10, 8, 10, 6),
        (16, 24, 12, 16, 12, 16, 10),
    ):
        resolution = Resolution(*numbers)
        got, seconds = evaluate(resolution)
        cells = [" / ".join(map(str, numbers)) + (" (default)" if resolution == Resolution() else "")]
        for index in (aero.CA, aero.CN, aero.XCP_M, aero.SURFACE_HEAT_RATE):
            error = np.abs(got[:, index] / exact[:, index] - 1.0)
            cells.append(f"{np.median(error):.0e} ({error.max():.0e})")
        cells.append(f"{1e6 * max(seconds - overhead, 0.0):.0f}")
        body.append(cells)
    header = (
        "points: nose / windward / leeward / nose, segment, windward, leeward of friction",
        "CA",
        "CN",
        "Xcp",
        "heat rate",
        "us more than one point each",
    )
    return table(header, body)


def blunt() -> str:
    """Drag of blunt bodies, published and by presets."""

    def cap(radius_m: float, rim_m: float) -> BodyShape:
        return BodyShape(radius_m, cap_angle_deg=math.degrees(math.acos(rim_m / radius_m)))

    bodies = {
        "Stardust": sphere_cone(60.0, 0.2286, 0.4064),
        "70 deg": sphere_cone(70.0, 0.6638, 1.3275),
        "Apollo": cap(4.694, 1.956),
        "Fire II": cap(0.9347, 0.336),
        "sphere": BodyShape(0.1),
    }
    body = []
    for row in rows("blunt_bodies_CD"):
        mach, speed, alpha = (float(row[name]) for name in ("M", "V", "alpha"))
        published, turned = float(row["CD"]), math.radians(alpha)
        warm = (speed / mach) ** 2 / (gas.GAMMA * gas.GAS_CONSTANT)
        air = Air(1e-3 * gas.GAS_CONSTANT * warm, 1e-3, warm) if speed else None
        cells = [row["body"], f"{mach:g}", f"{alpha:g}", f"{published:g}"]
        for name in ("newtonian", "physics", "best"):
            got = coefficients(bodies[row["body"]], mach, alpha, name, air=air)
            drag = float(got.CA) * math.cos(turned) + float(got.CN) * math.sin(turned)
            cells.append(f"{drag:.3f} ({100.0 * (drag / published - 1.0):+.1f})")
        body.append((*cells, row["bar_pct"]))
    header = ("body", "M", "alpha", "CD", "impact alone (%)", "physics (%)", "best (%)", "bar %")
    return table(header, body)


PAGES: dict[str, list[tuple[str, Callable[[], str]]]] = {
    "pressure": [("pressure", pressure)],
    "laws": [("laws", laws)],
    "newtonian": [("newtonian", newtonian)],
    "presets": [("presets", presets), ("euler", euler)],
    "best": [("best", best)],
    "blunt": [("blunt", blunt)],
    "convergence": [("convergence", convergence)],
}


def main() -> None:
    """Replace the tables of the pages named on the command line, or of all."""
    for page in sys.argv[1:] or PAGES:
        path = LAWS_PAGE if page == "pressure" else HERE / f"aero-{page}.md"
        text = path.read_text()
        for name, build in PAGES[page]:
            start, end = f"<!-- table {name} -->\n", f"<!-- end {name} -->"
            before, rest = text.split(start)
            text = before + start + "\n" + build() + "\n\n" + end + rest.split(end)[1]
        path.write_text(text)
        print(f"wrote {path.name}")


if __name__ == "__main__":
    main()
