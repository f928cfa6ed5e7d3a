"""NIST Statistical Reference Datasets: digits in common with the certified (exact) values."""

import csv
from collections import defaultdict
from fractions import Fraction

import numpy as np
import pytest
from surfaces_data import DATA

from rsmkit.language.space import Space
from rsmkit.surfaces.models.polynomial_fit import fit_surface
from rsmkit.surfaces.table_fit import fit_table

# digits that must agree: coefficients, standard errors and other statistics
DIGITS = {
    "Norris": (12, 12),
    "Pontius": (12, 12),
    "NoInt1": (14, 14),
    "NoInt2": (14, 14),
    "Filip": (10, 14),  # condition number 1e15
    "Wampler1": (12, 8),  # an exact fit: certified standard errors are zero
    "Wampler2": (12, 12),
    "Wampler3": (13, 14),
    "Wampler4": (13, 14),
    "Wampler5": (11, 13),
    "Longley": (12, 12),
}
ORDERS = {"Filip": 10, "Pontius": 2}


def certified():
    found = defaultdict(dict)
    with open(DATA / "strd_certified.csv", newline="") as file:
        for row in csv.DictReader(file):
            term = "x" if row["term"] == "x^1" else row["term"]
            found[row["dataset"]][row["quantity"], term] = float(row["value_20_digits"])
    return found


def agreeing_digits(found, expected):
    if found == expected:
        return 17.0
    return -np.log10(abs(found - expected) / abs(expected) if expected else abs(found))


@pytest.mark.parametrize("name", DIGITS)
def test_certified_values(name):
    truth = certified()[name]
    path = DATA / f"strd_{name}.csv"
    with path.open(encoding="utf-8") as file:
        factors = [key for key in file.readline().strip().split(",") if key != "y"]
    order = 5 if name.startswith("Wampler") else ORDERS.get(name, 1)
    terms = ["0", "FO"] if name.startswith("NoInt") else []
    surface = fit_table(path, factors, ["y"], order=order, terms=terms).surfaces["y"]
    fit, index = surface.fit, {key: i for i, key in enumerate(surface.names)}
    single = {"sigma": fit.sigma, "rss": fit.rss, "r2": fit.r2}
    for (quantity, term), value in truth.items():
        if quantity == "coef":
            assert agreeing_digits(surface.coefficients[index[term]], value) > DIGITS[name][0], term
        elif quantity == "se":
            assert agreeing_digits(surface.std_errors[index[term]], value) > DIGITS[name][1], term
        elif quantity in single:
            assert agreeing_digits(single[quantity], value) > DIGITS[name][1], quantity


def test_degree_ten_far_from_zero_against_rational_arithmetic():
    """The difficulty of the Filip data set (condition number 1e15) with the exact solution computed here."""
    rng = np.random.default_rng(1)
    x = np.round(np.linspace(-8.8, -3.1, 82) + rng.normal(0, 0.03, 82), 9)
    y = np.round(0.8 + 0.05 * np.sin(2 * x) + rng.normal(0, 0.003, 82), 4)
    rows = [[Fraction(v) ** j for j in range(11)] for v in x.tolist()]
    target = [Fraction(v) for v in y.tolist()]
    moments = [[sum(r[i] * r[j] for r in rows) for j in range(11)] for i in range(11)]
    right = [sum(r[i] * v for r, v in zip(rows, target, strict=True)) for i in range(11)]
    exact = solve_exactly(moments, right)
    rss = float(
        sum(
            (v - sum(c * q for c, q in zip(exact, r, strict=True))) ** 2
            for r, v in zip(rows, target, strict=True)
        )
    )
    surface = fit_surface(Space(x=(-1.0, 1.0)), x[:, None], y, order=10)
    np.testing.assert_allclose(surface.coefficients, [float(v) for v in exact], rtol=1e-9)
    assert surface.fit.rss == pytest.approx(rss, rel=1e-12)
    first = solve_exactly(moments, [Fraction(int(i == 0)) for i in range(11)])[0]
    assert surface.std_errors[0] == pytest.approx(np.sqrt(float(first) * rss / 71), rel=1e-11)


def solve_exactly(matrix, right):
    """Gauss-Jordan elimination in rational numbers."""
    work = [[*row, value] for row, value in zip(matrix, right, strict=True)]
    for i in range(len(work)):
        for r in range(len(work)):
            if r != i:
                ratio = work[r][i] / work[i][i]
                work[r] = [a - ratio * b for a, b in zip(work[r], work[i], strict=True)]
    return [work[i][-1] / work[i][i] for i in range(len(work))]
