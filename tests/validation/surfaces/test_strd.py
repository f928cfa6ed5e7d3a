"""NIST Statistical Reference Datasets, against the certified values and against rational arithmetic.

Certified values belong to the decimal numbers of the data files, the program gets the doubles nearest to
them. Both problems are solved exactly here, so that every tolerance is that of the program's own arithmetic,
with ``U`` its unit roundoff, on any processor:

coefficients
    ``2 U``: refined with 32 digits until they no longer change, then rounded once.
residual sum of squares
    ``R U``: each residual is rounded once and squared, n of them are added in pairs (n <= 82, seven levels).
    The coefficients it is computed from are rounded, which is of second order at the minimum.
standard errors
    ``p K U`` with K the condition number of the scaled columns in working coordinates: Householder's
    triangle R is that of columns that differ by a small multiple of U (Higham, *Accuracy and Stability of
    Numerical Algorithms*, 2nd ed., theorem 19.4), and the rows of its inverse change by K times that.
"""

import csv
import math
from collections import defaultdict
from fractions import Fraction

import numpy as np
import pytest
from surfaces_data import DATA

from rsmkit.language.space import Space
from rsmkit.surfaces.polynomial_fit import fit_surface
from rsmkit.surfaces.tables.table_fit import fit_table

U = 2.0**-53
R = 12
# digits in common with the certified values that docs/surfaces.md promises: coefficients, standard errors
DIGITS = {
    "Norris": (14.0, 14.0),
    "Pontius": (13.5, 13.8),
    "NoInt1": (15, 15),
    "NoInt2": (15, 15),
    "Filip": (14.3, 11.7),
    "Longley": (14.7, 13.1),
    "Wampler1": (15, None),  # an exact fit: certified standard errors are zero
    "Wampler2": (13.2, None),
    "Wampler3": (15, 13.8),
    "Wampler4": (15, 13.8),
    "Wampler5": (15, 13.8),
}
ORDERS = {"Filip": 10, "Pontius": 2, **{f"Wampler{i}": 5 for i in range(1, 6)}}


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


def fitted(name, columns="coded"):
    """The columns as they are, or coded by their ranges with natural units beside."""
    path = DATA / f"strd_{name}.csv"
    with path.open(encoding="utf-8") as file:
        factors = [key for key in file.readline().strip().split(",") if key != "y"]
    terms = ["0", "FO"] if name.startswith("NoInt") else []
    order = ORDERS.get(name, 1)
    return fit_table(path, factors, ["y"], order=order, terms=terms, columns=columns).surfaces["y"]


def exact_solution(name, number):
    """Coefficients, diagonal of the inverse of X'X, residual and total sum of squares, as fractions."""
    with (DATA / f"strd_{name}.csv").open(encoding="utf-8") as file:
        table = [{key: number(text) for key, text in row.items()} for row in csv.DictReader(file)]
    y = [row.pop("y") for row in table]
    first = 1 if name.startswith("NoInt") else 0
    degrees = range(1, ORDERS.get(name, 1) + 1)
    rows = [[Fraction(1)][first:] + [x**j for x in row.values() for j in degrees] for row in table]
    moments = [[sum(r[i] * r[j] for r in rows) for j in range(len(rows[0]))] for i in range(len(rows[0]))]
    inverse = inverted(moments)
    right = [sum(r[i] * v for r, v in zip(rows, y, strict=True)) for i in range(len(moments))]
    beta = [sum(a * b for a, b in zip(line, right, strict=True)) for line in inverse]
    rss = sum(
        (v - sum(c * q for c, q in zip(beta, r, strict=True))) ** 2 for r, v in zip(rows, y, strict=True)
    )
    mean = 0 if first else sum(y) / len(y)
    return beta, [inverse[i][i] for i in range(len(beta))], rss, sum((v - mean) ** 2 for v in y)


def standard_errors(solution, runs):
    beta, diagonal, rss, _ = solution
    return [math.sqrt(d * rss / (runs - len(beta))) for d in diagonal]


@pytest.mark.parametrize("name", DIGITS)
def test_the_exact_solution_of_the_decimal_data_is_the_certified_one(name):
    truth, runs = certified()[name], len(fitted(name).data)
    beta, _, rss, _ = solution = exact_solution(name, Fraction)
    published = [[v for (q, _), v in truth.items() if q == quantity] for quantity in ("coef", "se", "rss")]
    for found, values in zip((beta, standard_errors(solution, runs), [rss]), published, strict=True):
        np.testing.assert_allclose(np.array(found, float), values, rtol=4 * U)


@pytest.mark.parametrize("name", DIGITS)
def test_the_fit_is_the_exact_solution_for_the_doubles(name):
    surface = fitted(name)
    fit = surface.fit
    beta, _, rss, tss = solution = exact_solution(name, lambda text: Fraction(float(text)))
    np.testing.assert_allclose(surface.coefficients, np.array(beta, float), rtol=2 * U)
    if DIGITS[name][1] is None:  # all that is left of the residuals is the rounding of the coefficients
        assert fit.sigma <= U * np.abs(fit.coefficients).sum() * math.sqrt(fit.n / fit.df)
        return
    condition = np.linalg.cond(surface.matrix / np.linalg.norm(surface.matrix, axis=0))
    np.testing.assert_allclose(
        surface.std_errors, standard_errors(solution, fit.n), rtol=fit.p * condition * U + R * U
    )
    assert fit.rss == pytest.approx(float(rss), rel=R * U)
    assert fit.sigma == pytest.approx(math.sqrt(rss / fit.df), rel=R * U)
    assert fit.r2 == pytest.approx(float(1 - rss / tss), abs=2 * R * U)


@pytest.mark.parametrize("columns", [None, "coded"])
@pytest.mark.parametrize("name", DIGITS)
def test_certified_values(name, columns):
    """Where these digits are few, rounding the data to doubles takes the others."""
    truth, report = certified()[name], fitted(name, columns).report()
    found = {term["name"]: term for term in report["terms_natural"]}
    for (quantity, term), value in truth.items():
        if quantity == "coef":
            assert agreeing_digits(found[term]["estimate"], value) >= DIGITS[name][0] - 0.05, term
        elif quantity == "se" and DIGITS[name][1] is not None:
            assert agreeing_digits(found[term]["std_error"], value) >= DIGITS[name][1] - 0.05, term


def test_degree_ten_far_from_zero_against_rational_arithmetic():
    """The difficulty of the Filip data set (condition number 1e15) with the exact solution computed here."""
    rng = np.random.default_rng(1)
    x = np.round(np.linspace(-8.8, -3.1, 82) + rng.normal(0, 0.03, 82), 9)
    y = np.round(0.8 + 0.05 * np.sin(2 * x) + rng.normal(0, 0.003, 82), 4)
    rows = [[Fraction(v) ** j for j in range(11)] for v in x.tolist()]
    target = [Fraction(v) for v in y.tolist()]
    moments = [[sum(r[i] * r[j] for r in rows) for j in range(11)] for i in range(11)]
    right = [sum(r[i] * v for r, v in zip(rows, target, strict=True)) for i in range(11)]
    inverse = inverted(moments)
    exact = [sum(a * b for a, b in zip(line, right, strict=True)) for line in inverse]
    rss = float(
        sum(
            (v - sum(c * q for c, q in zip(exact, r, strict=True))) ** 2
            for r, v in zip(rows, target, strict=True)
        )
    )
    surface = fit_surface(Space(x=(-1.0, 1.0)), x[:, None], y, order=10)
    np.testing.assert_allclose(surface.coefficients, np.array(exact, float), rtol=2 * U)
    assert surface.fit.rss == pytest.approx(rss, rel=R * U)
    condition = np.linalg.cond(surface.matrix / np.linalg.norm(surface.matrix, axis=0))
    first = math.sqrt(float(inverse[0][0]) * rss / 71)
    assert surface.std_errors[0] == pytest.approx(first, rel=11 * condition * U)


def inverted(matrix):
    """Inverse by Gauss-Jordan elimination in rational numbers."""
    size = len(matrix)
    work = [[*row, *(Fraction(int(i == j)) for j in range(size))] for i, row in enumerate(matrix)]
    for i in range(size):
        work[i] = [value / work[i][i] for value in work[i]]
        for r in range(size):
            if r != i:
                ratio = work[r][i]
                work[r] = [a - ratio * b for a, b in zip(work[r], work[i], strict=True)]
    return [row[size:] for row in work]
