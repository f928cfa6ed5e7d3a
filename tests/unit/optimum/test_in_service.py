"""Searches over what responses do in service."""

import numpy as np
import pytest
from scipy.stats import chi2, multivariate_normal, norm
from served_study import BEAM

import rsmkit as rk
from rsmkit.language.joint_law import Laws
from rsmkit.language.laws import Normal
from rsmkit.optimum.service.in_service import service_names, service_problem
from rsmkit.stages.evaluate import evaluate_design
from rsmkit.stages.fit import fit_study
from rsmkit.stages.planning.plan import plan_design
from rsmkit.stages.refine import refine_study
from rsmkit.stages.verify import verify_study
from rsmkit.study.folder import open_study
from rsmkit.variation.options import Specification

SPACE = rk.Space(a=(-5.0, 5.0), b=(-5.0, 5.0))
LIMITS = {"y": Specification(high=3.0), "z": Specification(low=-2.0, high=8.0)}
RESPONSES = ("y", "z")


@pytest.fixture(scope="module")
def problem():
    def evaluate(x):
        return {"y": x[:, 0], "z": x[:, 1] ** 2}

    laws = Laws(SPACE, {"a": lambda v: Normal(v, 0.5), "b": lambda v: Normal(v, 1.0)})
    names = (*RESPONSES, *service_names(RESPONSES, tuple(LIMITS)))
    posed = rk.build_problem(
        SPACE, ["mean_y", "sd_z"], evaluate, responses=names, subject_to=["out_y <= 0.001"]
    )
    plain = rk.build_problem(SPACE, "y", evaluate, responses=RESPONSES)
    return service_problem(plain, laws, LIMITS, 4096, posed)


def test_statistics_of_a_normal_and_of_a_chi_square_response(problem):
    found = problem.evaluate(np.array([[1.0, 0.0], [2.0, 0.0]]))
    tails = norm.sf([4.0, 2.0])
    # skewness and deviation of 4096 points of a Sobol sequence are right to a thousandth
    assert found.objectives[:, 0] == pytest.approx([1.0, 2.0], abs=1e-3)
    assert found.objectives[:, 1] == pytest.approx([2.0**0.5] * 2, rel=0.02)
    assert found.responses["out_y"] == pytest.approx(tails, rel=0.05)
    assert found.margins[:, 0] == pytest.approx(0.001 - tails, abs=1e-3)
    assert found.responses["q95_y"][0] == pytest.approx(1.0 + 1.645 * 0.5, abs=0.01)
    # b^2 is a chi-square number with one degree of freedom, which Pearson's law has as a special case
    assert found.responses["out_z"][0] == pytest.approx(chi2.sf(8.0, 1), rel=0.05)
    assert found.responses["q99_z"][0] == pytest.approx(chi2.ppf(0.99, 1), rel=0.03)
    # independent: of 4096 points, so many that y and z are correlated by a hundredth at most
    both = 1.0 - (1.0 - found.responses["out_y"]) * (1.0 - found.responses["out_z"])
    assert found.responses["out_any"] == pytest.approx(both, rel=0.02)


def served_at(function, specifications, nodes, sd=1.0, noise=None):
    """What a response of one standard normal number does, by a function of it."""
    space = rk.Space(a=(-10.0, 10.0), b=(-1.0, 1.0))
    laws = Laws(space, {"a": lambda v: Normal(v, sd), "b": lambda v: Normal(v, 1.0)})
    limits = {name: Specification(**given) for name, given in specifications.items()}
    names = (*limits, *service_names(tuple(limits), tuple(limits)))
    posed = rk.build_problem(space, "a", function, responses=names)
    found = service_problem(posed, laws, limits, nodes, posed, noise).evaluate(np.zeros((1, 2)))
    return {name: float(value[0]) for name, value in found.responses.items()}


@pytest.mark.parametrize("nodes", [64, 16384])
@pytest.mark.parametrize("limit", [1.0, 3.0])
def test_specifications_that_fail_together_are_not_counted_twice(nodes, limit):
    def same(x):
        return {"y": x[:, 0], "z": -3.0 * x[:, 0]}

    found = served_at(same, {"y": {"high": limit}, "z": {"low": -3.0 * limit}}, nodes)
    # the formula at a correlation of 1 - 1e-12 is good to 1e-5
    assert found["out_any"] == pytest.approx(found["out_y"], rel=1e-4)
    # moments of the points are exact; where they are counted the kernel is in error by up to a twentieth
    assert found["out_y"] == pytest.approx(norm.sf(limit), rel=1e-9 if nodes == 64 and limit > 2 else 0.05)
    # never both: the probabilities add up
    other = served_at(same, {"y": {"high": limit}, "z": {"high": 3.0 * limit}}, nodes)
    assert other["out_any"] == pytest.approx(other["out_y"] + other["out_z"], rel=0.01)


def test_two_tails_of_correlated_responses():
    # one minus the bivariate normal probability of both below 2 with correlation 0.6
    truth = 1.0 - multivariate_normal.cdf([2.0, 2.0], cov=[[1.0, 0.6], [0.6, 1.0]])
    found = served_at(
        lambda x: {"y": x[:, 0], "z": 0.6 * x[:, 0] + 0.8 * x[:, 1]},
        {"y": {"high": 2.0}, "z": {"high": 2.0}},
        256,
    )
    assert found["out_any"] == pytest.approx(truth, rel=0.01)
    assert found["out_any"] < 0.96 * (found["out_y"] + found["out_z"])


def test_a_response_of_two_peaks_is_counted_where_points_are_enough():
    # an even mixture of two narrow peaks at -1 and 1, which no law by three moments has
    found = served_at(lambda x: {"y": np.sign(x[:, 0]) + 0.1 * x[:, 1]}, {"y": {"high": 1.2}}, 4096)
    assert found["out_y"] == pytest.approx(0.5 * norm.sf(2.0), rel=0.1)
    assert found["q95_y"] == pytest.approx(1.0 + 0.1 * norm.ppf(0.9), abs=0.01)
    assert found["q05_y"] == pytest.approx(-1.0 + 0.1 * norm.ppf(0.1), abs=0.01)


def test_the_tail_of_a_lognormal_response_with_many_points():
    limit = float(np.exp(0.5 * norm.ppf(0.999)))
    found = served_at(lambda x: {"y": np.exp(0.5 * x[:, 0])}, {"y": {"high": limit}}, 65536)
    # 65 points beyond, evenly laid
    assert found["out_y"] == pytest.approx(1e-3, rel=0.05)
    assert found["q999_y"] == pytest.approx(limit, rel=0.01)


@pytest.mark.parametrize("nodes", [64, 4096])
def test_the_noise_of_runs_is_part_of_what_they_do(nodes):
    found = served_at(lambda x: {"y": x[:, 0]}, {"y": {"high": 2.5}}, nodes, 0.6, {"y": 0.8})
    assert found["sd_y"] == pytest.approx(1.0, rel=0.01)
    assert found["out_y"] == pytest.approx(norm.sf(2.5), rel=0.1)
    assert found["q95_y"] == pytest.approx(norm.ppf(0.95), rel=0.02)


STUDY = (
    BEAM
    + """
[[search]]
name = "safe"
minimize = "mean_mass_kg + sd_mass_kg"
subject_to = ["out_sag_mm <= 1e-3"]
preset = "fast"
service = { nodes = 8 }
[uncertainty]
width_mm = { sd = 0.2 }
height_mm = { sd = 1.0 }
[specifications]
sag_mm = { high = 8 }
[surface]
model = "stretched"
[verify.refine]
max_runs = 8
"""
)


def test_a_search_in_service_is_verified_and_refined_on_the_simulator(tmp_path):
    (tmp_path / "study.toml").write_text(STUDY)
    folder = open_study(tmp_path)
    plan_design(folder)
    evaluate_design(folder)
    (optimum,) = fit_study(folder).optima
    # sag 3.09 deviations below its limit: the mean lies where a plain search would not stop
    assert optimum.best.responses["mean_sag_mm"] < 7.9
    assert optimum.best.responses["out_sag_mm"] == pytest.approx(1e-3, rel=0.01)
    (verified,) = verify_study(folder).verification.searches
    # the same nodes on both: what differs is what the surface misses, up to 5 % of the sag
    assert verified.responses["mean_sag_mm"].error_pct < 6.0
    assert verified.objective.error_pct < 0.01  # mass is a product, which the surface has exactly
    (refined,) = refine_study(folder).refinements.values()
    assert refined.runs % 8 == 0


def test_what_a_search_in_service_needs(tmp_path):
    (tmp_path / "study.toml").write_text(
        STUDY.replace("width_mm = { sd = 0.2 }\nheight_mm = { sd = 1.0 }", "")
    )
    with pytest.raises(rk.StudyError, match="service needs a factor with a law"):
        open_study(tmp_path)
    (tmp_path / "study.toml").write_text(STUDY.replace("out_sag_mm", "out_mass_kg"))
    with pytest.raises(rk.StudyError, match="out_mass_kg"):
        open_study(tmp_path)
    (tmp_path / "study.toml").write_text(STUDY.replace("nodes = 8", "nodes = 9"))
    with pytest.raises(rk.StudyError, match="power of 2"):
        open_study(tmp_path)
