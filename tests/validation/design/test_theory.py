"""Bounds, variance and aliasing against theory and published tables."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import f as f_distribution
from scipy.stats import ncf

from rsmkit.design.design import Design
from rsmkit.design.families.box_behnken import box_behnken
from rsmkit.design.families.composite import ccd
from rsmkit.design.families.two_level.factorial import fractional_factorial, full_factorial
from rsmkit.design.optimal.bound import log_det_bound
from rsmkit.design.optimal.optimal_design import augment, optimal_design
from rsmkit.design.quality.aliasing import alias_matrix, power_of_terms, term_correlations
from rsmkit.design.quality.assessment import assess
from rsmkit.design.quality.design_comparison import compare_designs, plot_design_space_fraction
from rsmkit.design.quality.variance import design_space_fraction, variance_profile
from rsmkit.design.region import ball, box, candidate_list
from rsmkit.errors import RsmkitError
from rsmkit.language.space import Factor, Space
from rsmkit.language.terms import full_terms

DATA = Path(__file__).parents[2] / "data/design"


def space(k: int) -> Space:
    return Space(Factor(f"x{j + 1}", -1.0, 1.0) for j in range(k))


def continuous_designs() -> list[tuple[int, float]]:
    with open(DATA / "continuous_d_optimal_cube.csv", newline="") as stream:
        return [(int(row["k"]), float(row["log_det_M"])) for row in csv.DictReader(stream)]


@pytest.mark.parametrize(("k", "log_det"), continuous_designs())
def test_bound_of_the_full_quadratic_on_the_cube(k, log_det):
    p = (k + 1) * (k + 2) // 2
    assert log_det_bound(full_terms(k), box(space(k)), 1) == pytest.approx(log_det, abs=1e-10)
    wide = log_det_bound(full_terms(k), box(space(k), 2.0), 7)
    degrees = sum(sum(e) for e in full_terms(k).exponents)
    assert wide == pytest.approx(log_det + p * np.log(7) + 2 * degrees * np.log(2), abs=1e-9)


def test_bound_by_iteration_agrees_with_the_closed_form():
    """A list of the 27 lattice points has the same best continuous design as the cube."""
    points = full_factorial(space(3), 3).points
    bound = log_det_bound(full_terms(3), candidate_list(space(3), points), 1)
    assert bound == pytest.approx(-7.45539590884032, abs=2e-3)
    assert bound >= -7.45539590884032


def test_bound_on_a_ball_is_the_continuous_design_on_sphere_and_centre():
    """Kiefer (1961): mass 1/p at the centre, the rest uniform on the sphere, whose moments are known."""
    k, square = 2, 2.0
    second, fourth, mixed = 5 / 6 * square / 2, 5 / 6 * square**2 * 3 / 8, 5 / 6 * square**2 / 8
    log_det = np.log(second**k * mixed * (fourth - mixed) * (fourth + mixed - k * second**2))
    bound = log_det_bound(full_terms(2), ball(space(2)), 1)
    assert bound == pytest.approx(log_det, abs=2e-3)
    assert bound >= log_det - 1e-6
    design = optimal_design(space(2), 12, region=ball(space(2)))
    quality = assess(design, region=ball(space(2)))
    assert 97.0 < quality.d_bound_efficiency <= 100.0


def test_bound_holds_for_augmentation():
    start = ccd(space(3))
    bound = log_det_bound(full_terms(3), box(space(3)), 50, start.coded)
    best_known = 34.42673550520148
    assert best_known <= bound <= best_known + 10 * 0.005


def test_quality_reports_the_bound_and_the_hits():
    quality = assess(augment(ccd(space(3)), 50))
    assert 99.5 <= quality.d_bound_efficiency <= 100.0
    assert quality.starts >= quality.hits >= 1


def test_ball_optimal_designs_lie_on_the_sphere_and_in_the_centre():
    """Kiefer (1961): the best second-order design on a ball has mass on the sphere and the centre only."""
    design = optimal_design(space(2), 12, region=ball(space(2)))
    lengths = np.linalg.norm(design.coded, axis=1)
    inside = lengths < 1e-2
    np.testing.assert_allclose(lengths[~inside], np.sqrt(2), rtol=1e-5)
    assert inside.sum() == 2  # mass 1/p = 1/6 at the centre


def test_g_optimal_design_of_the_quadratic_in_one_factor():
    """Guest (1958): runs at -1, 0, 1 in equal numbers; the largest variance is p / n."""
    design = optimal_design(space(1), 6, criterion="G", starts=5)
    assert sorted(design.coded.ravel()) == pytest.approx([-1, -1, 0, 0, 1, 1], abs=1e-6)
    assert assess(design).g_efficiency == pytest.approx(100.0, rel=1e-6)


def test_g_criterion_lowers_the_largest_variance():
    best = {c: assess(optimal_design(space(2), 8, criterion=c, starts=5)).g_efficiency for c in ("D", "G")}
    assert best["D"] < 70.0
    assert best["G"] > 87.0  # Borkowski (2003), J. Probab. Stat. Sci. 1, 65-88, table of G-optimal designs


def test_a_optimal_design_beats_the_d_optimal_one_on_its_own_ground():
    def trace(design):
        X = full_terms(2).matrix(design.coded)
        return np.trace(np.linalg.inv(X.T @ X))

    assert trace(optimal_design(space(2), 8, criterion="A")) < trace(optimal_design(space(2), 8))


def test_bayesian_d_looks_beyond_the_model():
    """With six runs for a first-order model, D needs only corners; the Bayesian design leaves them."""
    plain = optimal_design(space(2), 6, terms=1)
    guarded = optimal_design(space(2), 6, terms=1, criterion="bayesian-D")
    second_order = full_terms(2).matrix(guarded.coded)
    assert set(np.abs(plain.coded).ravel()) == {1.0}
    assert np.linalg.matrix_rank(second_order) > np.linalg.matrix_rank(full_terms(2).matrix(plain.coded))


def test_blocked_design_balances_its_blocks():
    """First order in two blocks of four: the best design puts a half fraction in each block."""
    design = optimal_design(space(3), 8, terms=1, blocks=[1, 1, 1, 1, 2, 2, 2, 2])
    x = design.coded
    np.testing.assert_allclose(x.T @ x, 8 * np.eye(3), atol=1e-8)
    np.testing.assert_allclose(x[:4].sum(axis=0), 0.0, atol=1e-8)


def test_split_plot_covariance_reaches_the_generalised_least_squares_optimum():
    """Orthogonal within and between plots: det of X' inv(S) X for whole plots of two, variance ratio one."""
    plots = np.repeat(np.arange(4), 2)
    covariance = np.eye(8) + (plots[:, None] == plots[None, :])
    design = optimal_design(space(2), 8, terms=1, covariance=covariance)
    X = full_terms(2, 1).matrix(design.coded)
    # contrasts within plots have weight 1, between plots 1/3; both factors fit within plots: 8/3 * 8 * 8
    assert np.linalg.det(X.T @ np.linalg.inv(covariance) @ X) == pytest.approx(8 / 3 * 64, rel=1e-8)


def test_alias_matrix_of_a_half_fraction():
    """D = ABC: each main effect is aliased with one three-factor interaction, coefficient 1 (Montgomery)."""
    design = fractional_factorial(space(4), ["D=ABC"])
    third = full_terms(4, 3)
    matrix, rows, columns = alias_matrix(design, order=1, potential=third)
    assert matrix[rows.index("x1"), columns.index("x2*x3*x4")] == pytest.approx(1.0)
    assert matrix[rows.index("x1"), columns.index("x2*x3")] == pytest.approx(0.0, abs=1e-14)


def test_correlations_of_an_orthogonal_design():
    matrix, names = term_correlations(full_factorial(space(3), 2), order=1)
    assert names == ("x1", "x2", "x3")
    np.testing.assert_allclose(matrix, np.eye(3), atol=1e-14)


def test_power_of_a_two_level_factorial():
    """By the F test with noncentrality n * coefficient^2, 1 and 4 degrees of freedom."""
    power = power_of_terms(full_factorial(space(3), 2), order=1, signal_to_noise=2.0)
    expected = ncf.sf(f_distribution.isf(0.05, 1, 4), 1, 4, 8.0)
    assert power["x2"] == pytest.approx(expected, rel=1e-6)
    with pytest.raises(RsmkitError, match="add runs"):
        power_of_terms(
            full_factorial(space(2), 2), terms=full_terms(2, 2).subset([(0, 0), (1, 0), (0, 1), (1, 1)])
        )


def test_variance_profile_of_a_first_order_design():
    """(1 + x1^2) / 8 along x1 through the centre of a 2^3 factorial."""
    profile, *_ = variance_profile(full_factorial(Space(x1=(0, 4), x2=(0, 1), x3=(0, 1)), 2), order=1)
    coded = profile.values / 2 - 1
    np.testing.assert_allclose(profile.variances, (1 + coded**2) / 8, rtol=1e-12)


def test_fraction_of_design_space_agrees_with_the_average_variance():
    design = ccd(space(2), star="faced")
    fractions, variances = design_space_fraction(design)
    assert (np.diff(variances) >= 0).all()
    assert (fractions[0], fractions[-1]) == (pytest.approx(0.0, abs=1e-4), pytest.approx(1.0, abs=1e-4))
    assert variances.mean() == pytest.approx(assess(design).average_variance, rel=1e-3)


def test_the_ends_of_the_variance_are_those_of_the_region_not_of_a_sample():
    """Three points and a parabola: 1 - 1.5 x^2 + 1.5 x^4 by Lagrange's polynomials, 0.625 at x^2 = 1/2."""
    line = Design(space(1), np.array([[-1.0], [0.0], [1.0]]), ("given",) * 3)
    fractions = assess(line).variance_fractions
    assert (fractions[0], fractions[-1]) == pytest.approx((0.625, 1.0), rel=1e-12)
    # on part of the line only, under a constraint that is not linear
    half = box(space(1), constraints=[lambda x: 0.25 - x[:, 0] ** 2])
    assert assess(line, region=half).variance_fractions[-1] == pytest.approx(1.0, rel=1e-9)
    assert assess(line, region=half).variance_fractions[0] == pytest.approx(1 - 0.375 + 0.09375, rel=1e-9)


def test_box_behnken_is_worst_in_the_corners():
    """In exact fractions 119/32 with five factors and three centre points, at every corner of the box."""
    quality = assess(box_behnken(space(5), center=3))
    assert quality.variance_fractions[-1] == quality.largest_variance == pytest.approx(119 / 32, rel=1e-12)


def test_two_designs_side_by_side():
    designs = {"faced": ccd(space(2), star="faced"), "D-optimal": optimal_design(space(2), 11)}
    table = dict(compare_designs(designs).rows)
    assert table["runs"] == (11, 11)
    assert table["D-efficiency, %"][1] > table["D-efficiency, %"][0]
    figure = plot_design_space_fraction(designs)
    assert [line.get_label() for line in figure.axes[0].lines] == ["faced", "D-optimal"]
    with pytest.raises(RsmkitError, match="same factors"):
        compare_designs({"a": ccd(space(2)), "b": ccd(space(3))})


@pytest.mark.slow
def test_ten_factors_under_a_nonlinear_constraint():
    def margin(points):
        return 4.0 - (points**2).sum(axis=1)

    design = optimal_design(space(10), 70, region=box(space(10), constraints=[margin]), starts=1)
    assert (margin(design.points) >= -1e-8).all()
    assert assess(design).rank == 66
