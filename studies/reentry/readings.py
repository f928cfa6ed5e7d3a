"""On what the place of the optimum rests: a second reading of the paper, and what its Table 7 allows."""

from __future__ import annotations

import math
import tomllib
from functools import cache
from typing import Any

import conditions
import fly
import numpy as np
import pandas as pd
import printed
from conditions import frame

from rsmkit import parse_expression
from sim import evaluate, reference_vehicle

STEP = 0.01  # of the width of the box, for differences of the objective
FACTORS = ("theta_c1_deg", "theta_c2_deg", "nose_radius_m")


@cache
def second_reading() -> dict[str, Any]:
    """The study file of the second reading."""
    return tomllib.loads(fly.SECOND.read_text(encoding="utf-8"))


def places() -> pd.DataFrame:
    """The printed optimum under both readings: how far the minimum of our objective is from it.

    Three designs to either side of the printed one in each variable give slope and curvature; the distance to
    the minimum is the one over the other, in per cent of the width of the box.
    """
    first = tomllib.loads((fly.STUDY / "study.toml").read_text(encoding="utf-8"))
    rows = []
    for label, file in (
        ("as fitted to Tables 4-6", first),
        ("as the printed optimum asks", second_reading()),
    ):
        settings = file["simulator"]["settings"]
        text = file["search"][0]["minimize"]
        slope, bend, middle = _differences(settings, text)
        rms = _tables_rms(settings)
        rows.append(
            (
                label,
                f"{settings['length_1_m']:g} m",
                f"{settings['mass_kg']:g} kg",
                text,
                rms,
                *(100.0 * slope / middle),
                " / ".join(_distance(s, b) for s, b in zip(slope, bend, strict=True)),
            )
        )
    symbols = ("thetac1", "thetac2", "Rn")
    slopes = tuple(f"slope {symbol} %" for symbol in symbols)
    return frame(
        rows, ("reading", "L1", "mass", "objective", "Tables 4-6 rms %", *slopes, "minimum lies at, %")
    )


def _distance(slope: float, bend: float) -> str:
    """Way to the minimum of a parabola, in per cent of the width of the box."""
    way = -100.0 * slope / bend
    return f"{way:+.1f}" if bend > 0.0 and abs(way) < 100.0 else "beyond"


def elasticities() -> pd.DataFrame:
    """Powers of the design variables that a smooth simulator would need to print Table 7's four rows.

    ln F = a + b1 ln thetac1 + b2 ln thetac2 + b3 ln Rn through the four rows, exactly.
    """
    rows = np.array([[float(cell) for cell in row] for row in printed.PARETO])
    powers = np.linalg.solve(np.column_stack([np.ones(4), np.log(rows[:, 3:])]), np.log(rows[:, :3]))[1:].T
    ours = _elasticities(
        tomllib.loads((fly.STUDY / "study.toml").read_text(encoding="utf-8"))["simulator"]["settings"]
    )
    return frame(
        [
            (f"F{i + 1}, {source}", *row)
            for i in range(3)
            for source, row in (("Table 7", powers[i]), ("flown at the printed optimum", ours[i]))
        ],
        ("response", "thetac1", "thetac2", "Rn"),
    )


def surfaces() -> pd.DataFrame:
    """Tables 8 and 9 in the second reading: the surfaces' optimum against the printed one, its true one."""
    kept = fly.load_printed()
    rsm = [kept["factors"][name] for name in FACTORS]
    rsm = [math.radians(rsm[0]), math.radians(rsm[1]), rsm[2]]
    symbols = ("thetac1 (rad)", "thetac2 (rad)", "Rn (m)")
    rows: list[tuple[Any, ...]] = [
        (symbol, ga, theirs, difference, ours, 100.0 * abs(ours - ga) / ga)
        for symbol, ga, theirs, difference, ours in zip(
            symbols, printed.GA_OPTIMUM, printed.RSM_OPTIMUM, printed.OPTIMUM_DIFFERENCE_PCT, rsm, strict=True
        )
    ]
    second = second_reading()
    _, _, best = _differences(second["simulator"]["settings"], second["search"][0]["minimize"])
    off = 100.0 * abs(kept["predicted"] / kept["actual"] - 1.0)
    worse = 100.0 * (kept["actual"] / best - 1.0)
    rows.append(("calculated from real, %", math.nan, math.nan, printed.VALUE_DIFFERENCE_PCT, math.nan, off))
    rows.append(("RSM optimum worse than the GA's, %", math.nan, math.nan, 8.194, math.nan, worse))
    return frame(rows, ("", "printed GA", "printed RSM", "printed Diff%", "our RSM", "our Diff%"))


def printed_point() -> np.ndarray[Any, Any]:
    """The printed optimum in degrees and metres."""
    theta_c1, theta_c2, radius = printed.GA_OPTIMUM
    return np.array([math.degrees(theta_c1), math.degrees(theta_c2), radius])


def _flown(point: np.ndarray[Any, Any], settings: dict[str, Any]) -> dict[str, float]:
    return evaluate(**dict(zip(FACTORS, point.tolist(), strict=True)), **settings)


def _differences(settings: dict[str, Any], text: str) -> tuple[Any, Any, float]:
    """Slope and curvature per width of the box at the printed optimum, and the objective there."""
    objective = parse_expression(text)

    def value(point: np.ndarray[Any, Any]) -> float:
        return float(objective({name: np.array([v]) for name, v in _flown(point, settings).items()})[0])

    centre, widths = printed_point(), np.array([high - low for low, high in printed.BOUNDS.values()])
    middle = value(centre)
    after, before = (
        np.array([value(centre + sign * STEP * step) for step in np.diag(widths)]) for sign in (1, -1)
    )
    return (after - before) / (2 * STEP), (after - 2 * middle + before) / STEP**2, middle


def _elasticities(settings: dict[str, Any]) -> np.ndarray[Any, Any]:
    """Logarithmic derivatives of F1, F2, F3 (rows) at the printed optimum."""
    centre = printed_point()
    found = []
    for step in np.diag(STEP * centre):
        after, before = _flown(centre + step, settings), _flown(centre - step, settings)
        found.append([math.log(after[name] / before[name]) for name in fly.RESPONSES])
    return np.array(found).T / (2 * STEP)


def _tables_rms(settings: dict[str, Any]) -> float:
    """Root-mean-square difference from the 16 entries of Tables 4-6 that are not zero, per cent."""
    names = ("length_1_m", "length_2_m", "length_3_m")
    vehicle = reference_vehicle(*printed_point().tolist(), **{name: settings[name] for name in names})
    errors = [
        conditions.coefficient(name, row, "paper", vehicle) / row[4] - 1.0
        for name, table in printed.AERODYNAMICS.items()
        for row in table
        if row[4]
    ]
    return 100.0 * math.sqrt(float(np.mean(np.square(errors))))
