"""Optimal designs against the best known ones (``tests/data/design/best_known.csv``)."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np
import pytest

from rsmkit.design.design import Design
from rsmkit.design.families.composite import ccd
from rsmkit.design.families.two_level.factorial import full_factorial
from rsmkit.design.optimal.optimal_design import augment, optimal_design
from rsmkit.design.region import box, candidate_list
from rsmkit.language.space import Space
from rsmkit.language.terms import full_terms, parse_terms

DATA = Path(__file__).parents[2] / "data/design"


def space(k: int) -> Space:
    return Space(**{f"x{j + 1}": (-1.0, 1.0) for j in range(k)})


def best_known(**wanted: str) -> dict[str, str]:
    with open(DATA / "best_known.csv", newline="") as stream:
        (row,) = [r for r in csv.DictReader(stream) if all(r[key] == v for key, v in wanted.items())]
    return row


def log_det(design: Design) -> float:
    """By numpy from the points alone, not from what the search says of itself."""
    X = full_terms(design.space).matrix(design.coded)
    return float(np.linalg.slogdet(X.T @ X)[1])


def average_variance(design: Design) -> float:
    """Exact average over the box through the moments of a uniform variable, 1/3 and 1/5."""
    terms = full_terms(design.space)
    X = terms.matrix(design.coded)
    sums = np.array(terms.exponents)[:, None, :] + np.array(terms.exponents)[None, :, :]
    moments = np.where(sums % 2 == 0, 1.0 / (sums + 1.0), 0.0).prod(axis=2)
    return float((np.linalg.inv(X.T @ X) * moments).sum())


def d_efficiency(design: Design, reference: float) -> float:
    return math.exp((log_det(design) - reference) / full_terms(design.space).p)


@pytest.mark.parametrize(("task", "half_width"), [("box1.6818", 8**0.25), ("box1.682", 1.682), ("box1", 1.0)])
def test_central_composite_design_augmented_to_fifty(task, half_width):
    alpha = 1.682 if task == "box1.682" else "rotatable"
    start = ccd(space(3), alpha=alpha)
    design = augment(start, 50, region=box(start.space, half_width))
    reference = float(best_known(task=f"augment_ccc17_to_50_{task}", criterion="D")["logdet_XtX"])
    assert d_efficiency(design, reference) >= 0.9999
    assert design.points[:17].tobytes() == start.points.tobytes()
    assert np.abs(design.coded[17:]).max() <= half_width + 1e-12


def test_faced_design_augmented_to_fifty():
    design = augment(ccd(space(3), star="faced"), 50)
    reference = float(best_known(task="augment_ccf17_to_50_box1", criterion="D")["logdet_XtX"])
    assert d_efficiency(design, reference) >= 0.9999


@pytest.mark.parametrize(
    ("k", "n", "least"),
    [
        (2, 6, 0.999),
        (2, 14, 0.999),
        (3, 11, 0.999),
        (3, 20, 0.999),
        (3, 30, 0.999),
        (4, 18, 0.9999),
        (4, 20, 0.999),
        pytest.param(5, 27, 0.997, marks=pytest.mark.slow),
        pytest.param(6, 36, 0.995, marks=pytest.mark.slow),
    ],
)
def test_d_optimal_from_scratch(k, n, least):
    reference = float(best_known(task="scratch", criterion="D", k=str(k), n=str(n))["logdet_XtX"])
    assert d_efficiency(optimal_design(space(k), n), reference) >= least


def test_six_runs_of_box_and_draper():
    """The 6-run D-optimal design for two factors (Box & Draper 1971): det / n^p = 5.74e-3."""
    design = optimal_design(space(2), 6)
    assert math.exp(log_det(design)) / 6**6 == pytest.approx(5.738538e-3, rel=1e-6)


def test_nine_runs_are_the_three_level_factorial():
    design = optimal_design(space(2), 9)
    points = sorted(map(tuple, design.coded))
    assert points == [(a, b) for a in (-1, 0, 1) for b in (-1, 0, 1)]


@pytest.mark.parametrize(("k", "n"), [(3, 17), pytest.param(5, 25, marks=pytest.mark.slow)])
def test_i_optimal_from_scratch(k, n):
    row = best_known(task="scratch", criterion="I", k=str(k), n=str(n))
    reference = float(row["I_avg_pred_var"])
    assert reference / average_variance(optimal_design(space(k), n, criterion="I")) >= 0.99


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_eight_factors_with_four_runs_to_spare(seed):
    """Random starts alone end at 85 to 91 % of the best continuous design, depending on the seed."""
    with open(DATA / "continuous_d_optimal_cube.csv", newline="") as stream:
        (bound,) = [float(row["log_det_M"]) for row in csv.DictReader(stream) if row["k"] == "8"]
    design = optimal_design(space(8), 49, seed=seed)
    assert d_efficiency(design, bound + 45 * math.log(49)) >= 0.917


@pytest.mark.slow
def test_ten_factors_hundred_runs():
    reference = float(best_known(task="scratch", criterion="I", k="10", n="100")["I_avg_pred_var"])
    assert reference / average_variance(optimal_design(space(10), 100, criterion="I")) >= 0.99
    # best log det known, computed with 3,000 starts of an independent program
    assert d_efficiency(optimal_design(space(10), 100), 264.884879) >= 0.995


def test_fifty_runs_in_three_factors():
    """Most starts end in another basin at 99.93 %; best of 20,000 starts of an independent program."""
    design = optimal_design(space(3), 50)
    assert d_efficiency(design, 31.644179) >= 0.9999
    assert design.found.hits < design.found.starts


@pytest.mark.parametrize(("k", "n", "reference"), [(3, 20, 22.278439004603754), (5, 28, 54.77266294315197)])
def test_exchange_over_the_three_level_list(k, n, reference):
    """Best three-level designs of an independent program, 2,000 and 15,000 starts."""
    levels = candidate_list(space(k), full_factorial(space(k), 3).points)
    design = optimal_design(space(k), n, region=levels)
    assert set(np.unique(design.coded)) <= {-1.0, 0.0, 1.0}
    assert d_efficiency(design, reference) == pytest.approx(1.0, abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(("n", "efficiency"), [(4, 82.918), (5, 80.576), (7, 91.167)])
def test_g_optimal_designs_in_one_factor(n, efficiency):
    """By differential evolution over all n points, the variance on 201 values (scipy, independent)."""
    design = optimal_design(space(1), n, criterion="G", starts=8)
    terms = full_terms(1)
    V = np.linalg.inv(terms.matrix(design.coded).T @ terms.matrix(design.coded))
    probes = terms.matrix(np.linspace(-1.0, 1.0, 2001)[:, None])
    largest = ((probes @ V) * probes).sum(axis=1).max()
    assert 300.0 / (n * largest) == pytest.approx(efficiency, abs=2e-3)


@pytest.mark.parametrize("criterion", ["D", "I", "G"])
@pytest.mark.parametrize("levels", [2, 3, 5])
def test_a_category_that_the_model_leaves_out_is_free(criterion, levels):
    """A line in x is best with half of the runs at each end, det X'X = n^2, whatever the category."""
    mixed = Space(cell=[f"L{i}" for i in range(levels)], x=(0.0, 1.0))
    design = optimal_design(mixed, 8, terms=parse_terms(mixed, ["x"]), criterion=criterion, starts=2)
    np.testing.assert_allclose(np.sort(design.coded[:, 1]), [-1.0] * 4 + [1.0] * 4, atol=1e-6)
    assert set(design.points[:, 0]) <= set(range(levels))
