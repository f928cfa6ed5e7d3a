"""Runs in random groups against lme4, lmerTest and pbkrtest of R, on published split plots and their like.

R's optimiser stops when the ratio of standard deviations moves by less than 1e-10 of its scale or the
deviance by its rounding, about 1e-14 of a number near 100: in the ratio, in which the deviance has curvature
of order one, that is 1e-6. Everything compared here depends smoothly on the ratio.
"""

import csv
import re
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from rsmkit.language.space import Factor, Space
from rsmkit.language.terms import parse_terms
from rsmkit.surfaces.polynomial_fit import fit_surface
from rsmkit.surfaces.statistics.terms.means import estimated_means
from rsmkit.surfaces.statistics.terms.mixed_tests import mixed_term_tests

DATA = Path(__file__).parents[2] / "data" / "surfaces" / "mixed"
SAME = 3e-6


@dataclass(frozen=True)
class Case:
    file: str
    response: str
    numbers: tuple[str, ...]
    categories: tuple[str, ...]
    random: tuple[str, ...]
    lost: tuple[int, ...] = ()
    terms: tuple[str, ...] = ("FO", "TWI")
    weights: str = ""


OATS = ("oats.csv", "yield")
LOST = (3, 17, 18, 40, 61)
SPRAYS = ("sprays.csv", "decrease", (), ("treatment",), ("row", "column"))
CASES = {
    "corrosion": Case("corrosion.csv", "Resistance", (), ("Temperature", "Coating"), ("Heat",)),
    "unbalanced": Case("unbalanced.csv", "y", ("A", "B"), (), ("plot",)),
    "oats": Case(*OATS, (), ("variety", "nitro"), ("block", "plot")),
    "oats with runs lost": Case(*OATS, ("nitro",), ("variety",), ("block", "plot"), LOST),
    "machines with runs lost": Case(
        "machines.csv",
        "score",
        (),
        ("machine",),
        ("worker", "cell"),
        (2, 3, 6, 16, 17, 30, 31, 32, 50),
        ("FO",),
    ),
    "sprays": Case(*SPRAYS, terms=("FO",)),
    "sprays with runs lost": Case(*SPRAYS, (1, 2, 9, 33, 34, 35), ("FO",)),
    "beets": Case("beets.csv", "yield", (), ("sow", "harvest"), ("block", "plot")),
    "unbalanced weighted": Case("unbalanced.csv", "y", ("A", "B"), (), ("plot",), weights="w"),
}


IN_CATEGORIES = Case(*OATS, (), ("variety", "nitro"), ("block", "plot"), LOST)


def fitted(name, degrees="kenward-roger"):
    case = CASES.get(name, IN_CATEGORIES)
    with (DATA / case.file).open() as lines:
        rows = [row for i, row in enumerate(csv.DictReader(lines), start=1) if i not in case.lost]
    factors = [Factor(n, -1.0, 1.0) for n in case.numbers]
    factors += [Factor(n, levels=tuple(sorted({row[n] for row in rows}))) for n in case.categories]
    space = Space(factors)
    points = space.points(
        [{f.name: row[f.name] if f.levels else float(row[f.name]) for f in space} for row in rows]
    )
    return fit_surface(
        space,
        points,
        [float(row[case.response]) for row in rows],
        terms=parse_terms(space, case.terms),
        weights=[float(row[case.weights]) for row in rows] if case.weights else None,
        random={kind: [row[kind] for row in rows] for kind in case.random},
        degrees=degrees,
        deterministic=False,
    ).surface


@cache
def truth():
    found = {}
    with (DATA / "r_mixed.csv").open() as lines:
        for row in csv.DictReader(lines):
            found.setdefault((row["case"], row["kind"]), {})[row["name"]] = float(row["value"])
    return found


def of_r(case, kind):
    """Numbers of R by our names, without the constant's own and whatever the order within a product."""
    return {key(name): value for name, value in truth()[case, kind].items()}


def key(name):
    plain = re.sub(r"[\[\]]", "", name).replace("(Intercept)", "1")
    return "*".join(sorted(plain.split("*")))


def agree(mine, theirs, scale=1.0):
    assert mine.keys() == theirs.keys()
    for name, value in theirs.items():
        assert mine[name] == pytest.approx(value, rel=SAME, abs=SAME * scale * 1e-3), name


@pytest.mark.parametrize("case", CASES)
def test_estimates_as_in_r(case):
    surface = fitted(case)
    names = [key(name) for name in surface.names]
    variances = dict(zip((n.lower() for n in surface.mixed.names), surface.mixed.variances, strict=True))
    agree(variances, truth()[case, "variance"], surface.mixed.variances[-1])
    size = float(np.abs(surface.data.y).mean())
    agree(dict(zip(names, surface.coefficients, strict=True)), of_r(case, "estimate"), size)
    agree(dict(zip(names, surface.std_errors, strict=True)), of_r(case, "std_error"), size)
    agree({"REML": surface.deviance}, truth()[case, "deviance"])
    for group, effects in zip(surface.mixed.groups, surface.mixed.effects, strict=True):
        agree(dict(zip(group.levels, effects, strict=True)), truth()[case, f"blup {group.name}"], size)


@pytest.mark.parametrize("case", [name for name in CASES if "weighted" not in name])
def test_inference_of_kenward_and_roger_as_in_r(case):
    """Without weights, which pbkrtest leaves out of the covariance of the runs."""
    surface = fitted(case)
    names = [key(name) for name in surface.names]
    agree(dict(zip(names, surface.adjusted_std_errors, strict=True)), of_r(case, "std_error_adjusted"))
    agree(dict(zip(names, surface.degrees_of_freedom, strict=True)), of_r(case, "t_df"))
    tests = {key(test.term): test.type3 for test in mixed_term_tests(surface)}
    for kind, value in (("df", "numerator_df"), ("denominator_df", "denominator_df"), ("F", "f")):
        agree({name: getattr(test, value) for name, test in tests.items()}, of_r(case, kind))
    # p falls off as a power of F of half the degrees of freedom, which multiplies the error of F
    for name, p in of_r(case, "p").items():
        assert tests[name].p == pytest.approx(p, rel=50 * SAME)
    joint = surface.test(np.eye(surface.fit.p)[1:])
    agree({"F": joint.f, "df": joint.denominator_df}, of_r(case, "joint"))


@pytest.mark.parametrize("case", [name for name in CASES if name != "beets"])
def test_satterthwaite_as_in_r(case):
    """R differentiates the deviance by differences, good to 1e-4; on the boundary it does so along it."""
    surface = fitted(case, "satterthwaite")
    names = [key(name) for name in surface.names]
    for name, df in of_r(case, "satterthwaite_df").items():
        assert surface.degrees_of_freedom[names.index(name)] == pytest.approx(df, rel=1e-4)


def test_means_and_their_differences_as_in_emmeans():
    """``pairs(emmeans(m, "variety"))`` with runs lost, nitrogen as a category; nine digits printed."""
    report = estimated_means(fitted("oats in categories"), "variety").report()
    (golden, *_), (first, _, last) = report["levels"], report["differences"]
    printed = {"mean": 105.72541, "std_error": 7.909802, "low": 87.95072, "high": 123.50010}
    assert {key: golden[key] for key in printed} == pytest.approx(printed, abs=6e-6)
    assert first["difference"] == pytest.approx(-4.066254, abs=6e-7)
    assert first["std_error"] == pytest.approx(7.437304, abs=6e-7)
    assert (first["p"], last["p"]) == pytest.approx((0.8505, 0.2626), abs=6e-5)
