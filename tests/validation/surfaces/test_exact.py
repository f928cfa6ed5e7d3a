"""Coefficients of columns far from zero against least squares in rational arithmetic."""

from fractions import Fraction

import numpy as np
import pytest

from rsmkit.language.space import Space
from rsmkit.language.terms import full_terms
from rsmkit.surfaces.estimation.fit_data import checked_data
from rsmkit.surfaces.models.stretched import fit_stretched
from rsmkit.surfaces.statistics.equations.equations import natural_polynomial
from rsmkit.surfaces.tables.table_fit import fit_table

CORNERS = [(-1, -1), (1, -1), (-1, 1), (1, 1), (0, 0), (0, 0), (1.4, 0), (-1.4, 0), (0, 1.4), (0, -1.4)]
NOISE = [0.31, -0.12, 0.05, -0.44, 0.27, 0.11, -0.32, 0.08, -0.21, 0.27]


def exact_least_squares(columns, y):
    """Solve the normal equations by Gauss-Jordan elimination of fractions."""
    columns, y = [[Fraction(x) for x in column] for column in columns], [Fraction(x) for x in y]
    rows = [
        [
            *(sum(a * b for a, b in zip(u, v, strict=True)) for v in columns),
            sum(a * b for a, b in zip(u, y, strict=True)),
        ]
        for u in columns
    ]
    for j, pivot in enumerate(rows):
        rows[j] = pivot = [x / pivot[j] for x in pivot]
        for i, row in enumerate(rows):
            if i != j:
                rows[i] = [x - row[j] * p for x, p in zip(row, pivot, strict=True)]
    return [float(row[-1]) for row in rows]


@pytest.mark.parametrize("offset", [0.0, 1e4, 1e6])
def test_two_factors_far_from_zero(tmp_path, offset):
    points = [(offset + 10 * a, offset + 10 * b) for a, b in CORNERS]
    y = [50 + a - 2 * b + a * b - a * a + e for (a, b), e in zip(CORNERS, NOISE, strict=True)]
    path = tmp_path / "runs.csv"
    path.write_text(
        "\n".join(["a,b,y", *(f"{a!r},{b!r},{v!r}" for (a, b), v in zip(points, y, strict=True))])
    )
    a, b = zip(*([Fraction(x) for x in point] for point in points), strict=True)
    columns = [
        [1] * 10, a, b, [u * v for u, v in zip(a, b, strict=True)], [u * u for u in a], [v * v for v in b]
    ]  # fmt: skip
    found = natural_polynomial(fit_table(path, ["a", "b"], ["y"]).surfaces["y"].surface).coefficients
    np.testing.assert_allclose(found, exact_least_squares(columns, y), rtol=1e-10)


def test_polynomial_of_degree_five_in_years(tmp_path):
    years = range(1947, 1963)
    y = [0.3 * (year - 1950) ** 2 + NOISE[year % 10] for year in years]
    path = tmp_path / "years.csv"
    path.write_text("\n".join(["year,y", *(f"{x},{v!r}" for x, v in zip(years, y, strict=True))]))
    expected = exact_least_squares([[x**power for x in years] for power in range(6)], y)
    surface = fit_table(path, ["year"], ["y"], order=5).surfaces["y"].surface
    found = natural_polynomial(surface).coefficients
    np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_coefficients_in_a_stretch_are_the_nearest_doubles():
    """The stretched coordinates count as exact; every power and product of them is a fraction."""
    space = Space(a=(0.0, 1.0), b=(-2.0, 3.0))
    points = np.random.default_rng(4).random((30, 2)) * [1.0, 5.0] + [0.0, -2.0]
    y = np.exp(2.5 * points[:, 0]) + points.prod(axis=1) + np.sin(9 * points).sum(axis=1)
    surface = fit_stretched(space, "y", checked_data(space, points, y, None, None), full_terms(space), "exp")
    a, b = ([Fraction(x) for x in column] for column in surface.coordinates.forward(points).T.tolist())
    columns = [
        [1] * 30, a, b, [u * v for u, v in zip(a, b, strict=True)], [u * u for u in a], [v * v for v in b]
    ]  # fmt: skip
    assert surface.coefficients[:6].tolist() == exact_least_squares(columns, y.tolist())
