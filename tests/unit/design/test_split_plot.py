"""Optimal designs in whole plots: their criterion, their plots, refusals."""

import itertools

import numpy as np
import pytest

from rsmkit.design.build import build_design
from rsmkit.design.design import Design
from rsmkit.design.families.registry import design_options
from rsmkit.design.optimal.split_plot import check_plots, plot_sizes, split_plot_design
from rsmkit.design.quality.assessment import assess
from rsmkit.design.region import box
from rsmkit.errors import RsmkitError
from rsmkit.language.scheffe import scheffe_terms
from rsmkit.language.space import Factor, Space
from rsmkit.language.terms import full_terms

SPACE = Space([Factor("oven", 150.0, 200.0), Factor("t", 1.0, 5.0)])


def log_det(design, terms, ratio):
    x = terms.matrix(design.coded)
    same = np.equal.outer(design.blocks, design.blocks)
    return np.linalg.slogdet(x.T @ np.linalg.solve(np.eye(len(x)) + ratio * same, x))[1]


@pytest.mark.parametrize("ratio", [0.3, 1.0, 10.0])
def test_the_best_of_all_designs_on_a_grid_is_found(ratio):
    """Three plots of two runs, first order: all designs on corners, one by one."""
    terms = full_terms(SPACE, 1)
    design = split_plot_design(SPACE, [2, 2, 2], ["oven"], terms=terms, ratio=ratio)
    best = -np.inf
    for ovens in itertools.product([-1.0, 1.0], repeat=3):
        for times in itertools.product([-1.0, 1.0], repeat=6):
            points = SPACE.decode(np.column_stack([np.repeat(ovens, 2), times]))
            best = max(best, log_det(Design(SPACE, points, ("",) * 6, (1, 1, 2, 2, 3, 3)), terms, ratio))
    assert design.found.value == pytest.approx(best, rel=1e-9)
    assert log_det(design, terms, ratio) == pytest.approx(best, rel=1e-9)


def test_plots_keep_hard_factors_and_sizes():
    sizes = (5, 4, 4, 3)
    design = split_plot_design(SPACE, sizes, ["oven"], terms=full_terms(SPACE, 2), seed=4)
    counts = sorted(design.blocks.count(block) for block in set(design.blocks))
    assert counts == sorted(sizes)
    assert list(design.blocks) == sorted(design.blocks)
    for block in set(design.blocks):
        rows = np.array(design.blocks) == block
        assert np.ptp(design.points[rows, 0]) == 0
        assert len(np.unique(design.points[rows, 1])) > 1
    again = split_plot_design(SPACE, sizes, ["oven"], terms=full_terms(SPACE, 2), seed=4)
    assert np.array_equal(design.points, again.points)


@pytest.mark.parametrize("criterion", ["A", "I", "bayesian-D"])
def test_other_criteria_are_those_of_the_information(criterion):
    terms = full_terms(SPACE, 2)
    design = split_plot_design(SPACE, [3] * 5, ["oven"], terms=terms, criterion=criterion)
    x = terms.matrix(design.coded)
    spread = np.linalg.inv(x.T @ np.linalg.solve(design.covariance, x))
    if criterion == "A":
        assert np.trace(spread) == pytest.approx(design.found.value, rel=1e-9)
    quality = assess(design, terms=terms, region=box(SPACE), deterministic=False)
    if criterion == "I":
        assert quality.average_variance == pytest.approx(design.found.value, rel=1e-9)
        other = split_plot_design(SPACE, [3] * 5, ["oven"], terms=terms)
        assert quality.average_variance <= assess(other, terms=terms, deterministic=False).average_variance
    errors = np.sqrt(np.diag(spread))
    assert list(quality.standard_errors.values()) == pytest.approx(errors.tolist(), rel=1e-9)


def test_constraints_hold_for_every_run():
    linear = split_plot_design(
        SPACE, [3] * 4, ["oven"], terms=1, region=box(SPACE, constraints=[lambda x: 4.0 - 0.02 * x[:, 0]])
    )
    assert (linear.points[:, 0] <= 200).all()

    def curved(x):
        c = SPACE.encode(x)
        return 1.2 - c[:, 0] ** 2 - c[:, 1] ** 2

    region = box(SPACE, constraints=[curved])
    design = split_plot_design(SPACE, [3] * 4, ["oven"], terms=1, region=region, starts=3)
    assert (curved(design.points) >= -1e-9).all()


def test_given_plots_are_kept_and_new_ones_added():
    first = split_plot_design(SPACE, [3, 3, 3], ["oven"], terms=1)
    more = split_plot_design(SPACE, [3, 3, 3, 3, 2], ["oven"], terms=2, given=first)
    assert np.array_equal(more.points[:9], first.points)
    assert more.blocks[:9] == first.blocks
    assert set(more.kinds) == {"optimal", "augmented"}
    assert len(set(more.blocks)) == 5


@pytest.mark.parametrize(
    ("request_", "message"),
    [
        ({"plots": [6, 6]}, "at least 4 plots"),
        ({"plots": [2, 1, 1]}, "4 runs cannot estimate the 6 coefficients"),
        ({"hard": []}, "no factor is hard"),
        ({"hard": ["ofen"]}, "hard-to-change factor must be"),
        ({"criterion": "G"}, "criterion G is not offered"),
        ({"ratio": 0.0}, "must be positive"),
        ({"plots": [4, 4, 0]}, "at least one run"),
    ],
)
def test_what_cannot_be_is_refused(request_, message):
    whole = {"plots": [4, 4, 4], "hard": ["oven"], "terms": 2} | request_
    with pytest.raises(RsmkitError, match=message):
        split_plot_design(SPACE, **whole)


def test_sizes_of_plots():
    assert plot_sizes(14, 4) == (4, 4, 3, 3)
    with pytest.raises(RsmkitError, match="5 plots cannot hold 4 runs"):
        plot_sizes(4, 5)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"kind": "ccd"}, "sets oven anew for every run"),
        ({"kind": "maximin", "runs": 12, "whole_plots": 4}, "points spread by 'maximin'"),
        ({"kind": "optimal", "runs": 12}, "whole_plots is missing"),
        ({"kind": "optimal", "whole_plots": 4}, "design.runs is missing"),
        ({"kind": "optimal", "runs": 12, "whole_plots": (4, 4)}, r"4 \+ 4 = 8 runs"),
        ({"kind": "optimal", "runs": 12, "whole_plots": 4, "min_distance": 0.3}, "min_distance: does not go"),
    ],
)
def test_options_that_do_not_go_with_plots_are_refused(options, message):
    with pytest.raises(RsmkitError, match=message):
        build_design(SPACE, design_options(**options), order=1, hard=["oven"])


def test_whole_plots_without_a_hard_factor_are_refused():
    with pytest.raises(RsmkitError, match="no factor has change = 'hard'"):
        build_design(SPACE, design_options("optimal", runs=12, whole_plots=3), order=1)


def test_own_points_need_plots_in_which_hard_factors_stay(tmp_path):
    (tmp_path / "own.csv").write_text("oven,t,block\n150,1,1\n150,5,1\n200,1,2\n160,5,2\n")
    with pytest.raises(RsmkitError, match="whole plot 2: oven is hard to change, but takes 2 values"):
        build_design(SPACE, design_options("file", file="own.csv"), order=1, hard=["oven"], folder=tmp_path)
    (tmp_path / "own.csv").write_text("oven,t\n150,1\n150,5\n")
    with pytest.raises(RsmkitError, match="needs a column block"):
        build_design(SPACE, design_options("file", file="own.csv"), order=1, hard=["oven"], folder=tmp_path)


# ---------------------------------------------------------------------- mixtures


@pytest.fixture(scope="module")
def blends():
    return Space(
        [Factor("a", 0.0, 1.0), Factor("b", 0.0, 1.0), Factor("c", 0.0, 1.0), Factor("z", -1.0, 1.0)]
    ).mixture("a", "b", "c")


def test_a_hard_process_factor_beside_a_mixture(blends):
    """Each plot holds the three pure blends, at either end of z twice.

    With ``V^-1 = I - 11'/4`` in a plot M is twice the block 4 (I - J/4), whose determinant is 16.
    """
    terms = scheffe_terms(blends, ["a", "b", "c"], 1, "crossed")
    design = split_plot_design(blends, (3,) * 4, ["z"], terms=terms, starts=3)
    assert design.found.value == pytest.approx(2.0 * np.log(16.0), abs=1e-9)
    assert np.abs(design.points[:, :3].sum(axis=1) - 1.0).max() <= 1e-12
    check_plots(design, ["z"])


def test_a_hard_mixture_beside_an_easy_process_factor(blends):
    """Each plot is a pure blend, run twice at either end of z.

    Of four runs ``1'V^-1 1`` is 4/5 and ``z'V^-1 z`` is 4, so M has three of each on its diagonal.
    """
    terms = scheffe_terms(blends, ["a", "b", "c"], 1, "crossed")
    design = split_plot_design(blends, (4,) * 3, ["a", "b", "c"], terms=terms, starts=3)
    assert design.found.value == pytest.approx(3.0 * np.log(0.8 * 4.0), abs=1e-9)
    check_plots(design, ["a", "b", "c"])


def test_limits_of_a_mixture_hold_in_plots():
    space = Space(
        [Factor("a", 0.2, 0.7), Factor("b", 0.1, 0.6), Factor("c", 0.1, 0.5), Factor("z", 0.0, 10.0)]
    ).mixture("a", "b", "c")
    terms = scheffe_terms(space, ["a", "b", "c"], 2, "combined")
    region = box(space, constraints=[lambda x: x[:, 1] - 0.5 * x[:, 2]])
    design = split_plot_design(space, (4,) * 5, ["z"], terms=terms, region=region, starts=1)
    assert region.contains(design.coded).all()
    assert np.abs(design.points[:, :3].sum(axis=1) - 1.0).max() <= 1e-12
    check_plots(design, ["z"])


@pytest.mark.parametrize(
    ("hard", "plots", "message"),
    [
        (["a"], 6, "ties factors that are hard to change with b, c, which is not: either all"),
        (["a", "b", "c"], 5, "5 whole plots cannot estimate the 6 coefficients that are the same for all"),
    ],
)
def test_what_plots_of_a_mixture_cannot_be_is_refused(blends, hard, plots, message):
    terms = scheffe_terms(blends, ["a", "b", "c"], 2, "combined")
    with pytest.raises(RsmkitError, match=message):
        split_plot_design(blends, (4,) * plots, hard, terms=terms)
