"""Laws, how they are joined, and which are refused."""

import numpy as np
import pytest

import rsmkit as rk
from rsmkit.language.joint_law import Laws, check_correlation, check_law
from rsmkit.language.laws import Lognormal, Normal, Sample, Triangular, Truncated, Uniform

# mean and standard deviation: uniform and triangular by hand, truncated from scipy 1.15,
# truncnorm(-1, 2).mean(), .std() and truncnorm(5, 8).mean()
LAWS = [
    (Normal(1.0, 2.0), 1.0, 2.0),
    (Uniform(0.0, 3.0), 1.5, 3.0 / 12**0.5),
    (Triangular(0.0, 1.0, 3.0), 4.0 / 3.0, (7.0 / 18.0) ** 0.5),
    (Triangular(0.0, 0.0, 3.0), 1.0, 0.5**0.5),
    (Lognormal(2.0, 1.5), 2.0, 1.5),
    (Truncated(0.0, 1.0, -1.0, 2.0), 0.22963717909132902, 0.7209455868590459),
    (Truncated(0.0, 1.0, 5.0, 8.0), 5.186503960756556, None),
    (Sample(np.array([1.0, 2.0, 2.0, 5.0])), 2.5, 1.5),
]


@pytest.mark.parametrize(("law", "mean", "sd"), LAWS, ids=lambda value: getattr(value, "text", ""))
def test_mean_deviation_quantiles_and_nodes_agree(law, mean, sd):
    u = (np.arange(100_000) + 0.5) / 100_000
    values, (x, weight) = law.quantile(u), law.rule()
    assert law.mean == pytest.approx(mean, rel=1e-12)
    assert weight @ x == pytest.approx(mean, rel=1e-12)
    assert values.mean() == pytest.approx(mean, rel=1e-4)  # the midpoint rule misses what lies in the tails
    assert (np.diff(values) >= 0).all()
    if sd is not None:
        assert law.sd == pytest.approx(sd, rel=1e-12)
        assert weight @ (x - mean) ** 2 == pytest.approx(sd**2, rel=1e-11)
        assert values.std() == pytest.approx(sd, rel=1e-3)


@pytest.mark.parametrize(
    ("law", "words"),
    [
        ({"law": "normal", "sd": -0.2}, "uncertainty.a: sd must be positive, got -0.2"),
        ({"law": "normal"}, "uncertainty.a: sd or sd_pct must be given"),
        ({"law": "normal", "sd": 0.1, "sd_pct": 1.0}, "uncertainty.a: sd or sd_pct must be given"),
        ({"law": "gaussian", "sd": 1.0}, "uncertainty.a: law must be one of normal, uniform"),
        ({"law": "uniform", "sd": 1.0}, "uncertainty.a: sd has no effect on law = 'uniform'"),
        ({"law": "uniform", "low": 0.6, "high": 0.4}, r"uncertainty.a: low \(0.6\) must be less than high"),
        ({"law": "uniform", "low": 0.4}, "uncertainty.a: half_width"),
        ({"law": "triangular", "low": 0.4, "high": 0.6, "mode": 0.7}, "uncertainty.a: the mode"),
        (
            {"law": "lognormal", "mean": -1.0, "sd": 0.1},
            "uncertainty.a: a lognormal law needs a positive mean",
        ),
        ({"law": "sample"}, "uncertainty.a: file must name"),
        ({"law": "sample", "file": "nowhere.csv"}, r"uncertainty.a: .*nowhere.csv: cannot be read"),
        ([0.5, 0.5], "uncertainty.a: a sample needs values that differ"),
        ([0.5, float("nan")], "uncertainty.a: a sample needs finite numbers"),
        ([0.5], "uncertainty.a: a sample needs a list of at least two numbers"),
        (["wide", 0.5], "uncertainty.a: must be numbers"),
        (0.3, "uncertainty.a: must be a table"),
        ({"law": "normal", "sd": 0.5}, "uncertainty.a: reaches from -1.04.*beyond the bounds 0 to 1"),
        ({"law": "uniform", "low": 0.0, "high": 1.5}, "uncertainty.a: reaches .* beyond the bounds"),
        ({"law": "normal", "mean": 7.0, "sd": 0.1}, "uncertainty.a: reaches .* beyond the bounds"),
    ],
)
def test_a_bad_law_is_refused_by_name(line, law, words):
    with pytest.raises(rk.RsmkitError, match=words):
        rk.uncertainty(line, {"a": law})


def test_a_law_needs_a_factor_and_a_number(line):
    with pytest.raises(rk.RsmkitError, match="factor must be a, b or tool; got 'c'"):
        rk.uncertainty(line, {"c": {"sd": 0.1}})
    with pytest.raises(rk.RsmkitError, match=r"uncertainty.tool: a categorical factor"):
        rk.uncertainty(line, {"tool": {"sd": 0.1}})
    with pytest.raises(rk.RsmkitError, match="at least one factor needs a law"):
        rk.uncertainty(line, {})


@pytest.fixture(scope="module")
def line():
    space = rk.Space(a=(0.0, 1.0), b=(0.0, 1.0), tool=["x", "y"])
    points = np.array([[a, b, t] for a in (0, 0.5, 1) for b in (0, 1) for t in (0, 1)])
    return {"y": rk.fit_surface(space, points, points @ [1.0, 2.0, 3.0], order=1)}


@pytest.mark.parametrize(
    ("matrix", "words"),
    [
        ([[1.0, 0.5]], "must be 2 by 2"),
        ([[1.0, 0.5], [0.4, 1.0]], "not symmetric between a and b"),
        ([[2.0, 0.5], [0.5, 1.0]], "the diagonal must be 1, but not so at a"),
        ([[1.0, 1.5], [1.5, 1.0]], "1.5 between a and b does not lie between -1 and 1"),
    ],
)
def test_a_matrix_that_is_no_correlation_is_refused(matrix, words):
    with pytest.raises(rk.RsmkitError, match=words):
        check_correlation(np.array(matrix), ["a", "b"])


def test_correlations_that_contradict_each_other_are_refused():
    matrix = np.array([[1.0, 0.9, -0.9], [0.9, 1.0, 0.9], [-0.9, 0.9, 1.0]])
    with pytest.raises(rk.RsmkitError, match="not positive definite"):
        check_correlation(matrix, ["a", "b", "c"])


def test_laws_move_with_the_design_unless_they_name_a_place():
    from pathlib import Path

    from rsmkit.variation.options import LawOptions

    space = rk.Space(a=(0.0, 10.0), b=(0.0, 10.0))
    laws = Laws(
        space,
        {
            "a": LawOptions("normal", sd_pct=10.0).maker("a", Path()),
            "b": LawOptions("uniform", low=2.0, high=3.0).maker("b", Path()),
        },
    )
    first, second = laws.at(np.array([2.0, 5.0])), laws.at(np.array([5.0, 9.0]))
    assert [law.laws["a"].mean for law in (first, second)] == [2.0, 5.0]
    assert [law.laws["a"].sd for law in (first, second)] == pytest.approx([0.2, 0.5])
    assert second.laws["b"].mean == 2.5


def test_a_law_at_a_bound_is_allowed_with_a_note():
    space = rk.Space(a=(30.0, 60.0))
    assert "outside its bounds 30 to 60 in 50 % of cases" in check_law(space, "a", Normal(30.0, 0.2))
    assert check_law(space, "a", Normal(45.0, 0.2)) == ""


def test_correlated_draws_have_the_correlation():
    space = rk.Space(a=(-9.0, 9.0), b=(-9.0, 9.0))
    matrix = np.array([[1.0, -0.6], [-0.6, 1.0]])
    joint = Laws(space, {"a": lambda v: Normal(v, 1.0), "b": lambda v: Normal(v, 2.0)}, matrix).at(
        np.zeros(2)
    )
    x = joint.draw(20_000, np.random.default_rng(1))
    # the standard error of a correlation is (1 - r^2) / sqrt(n) = 0.0045
    assert np.corrcoef(x.T)[0, 1] == pytest.approx(-0.6, abs=0.0136)
