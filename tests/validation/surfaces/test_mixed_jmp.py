"""What JMP prints of variances, and of tests with the observed information, in published examples."""

from __future__ import annotations

import numpy as np
import pytest

import rsmkit as rk
from rsmkit.language.terms import Terms

# Montgomery, Design and Analysis of Experiments, 8th ed. (2013), table 3.17: strength by loom.
LOOMS = np.array([[98, 97, 99, 96], [91, 90, 93, 92], [96, 95, 97, 95], [95, 96, 99, 98]], float)


@pytest.fixture(scope="module")
def looms() -> dict:
    space = rk.Space([rk.Factor("one", -1.0, 1.0)])
    groups = {"loom": np.repeat(["1", "2", "3", "4"], 4).tolist()}
    found = rk.fit_surface(
        space, np.linspace(-1, 1, 16)[:, None], LOOMS.ravel(), terms=Terms(((0,),), (0,)), random=groups,
        deterministic=False,
    )  # fmt: skip
    return found.report()


def test_standard_errors_of_variances(looms: dict) -> None:
    """The book's figure from JMP (chapter 3): within the digits that it prints.

    The restricted likelihood is at its greatest to 1e-8 of a variance, so only the printed digits count.
    """
    loom, residual = looms["variance_components"]
    assert loom["std_error"] == pytest.approx(6.0715247, abs=5e-6)
    assert loom["wald_low"] == pytest.approx(-4.941636, abs=5e-6)
    assert loom["wald_high"] == pytest.approx(18.858303, abs=5e-6)
    assert residual["std_error"] == pytest.approx(0.7739707, abs=5e-7)
    assert (loom["share"], residual["share"]) == pytest.approx((0.78588, 0.21412), abs=5e-6)
    assert np.array(looms["variance_covariance"]) == pytest.approx(
        np.array([[36.863412, -0.149758], [-0.149758, 0.5990307]]), abs=5e-6
    )


def test_share_explained_with_the_groups(looms: dict) -> None:
    assert looms["r2_in_groups"] == pytest.approx(0.793521, abs=5e-7)
    assert looms["r2_in_groups_adjusted"] == pytest.approx(0.793521, abs=5e-7)


def unbalanced(degrees: str) -> dict:
    """A split plot with a lost run, made up."""
    rng = np.random.default_rng(5)
    space = rk.Space(a=(-1.0, 1.0), b=(-1.0, 1.0))
    plots = np.repeat(np.arange(6), 4)[:-1]
    points = np.column_stack([np.where(plots % 2, 1.0, -1.0), np.tile([-1.0, 1.0, -1.0, 1.0], 6)[:-1]])
    y = points @ [1.0, 2.0] + rng.normal(size=6)[plots] + 0.5 * rng.normal(size=23)
    return rk.fit_surface(
        space, points, y, order=1, random={"plot": plots.astype(str).tolist()}, degrees=degrees,
        deterministic=False,
    ).report()  # fmt: skip


def test_the_observed_information_is_a_choice() -> None:
    """The variances are the same; their standard errors, and what follows from them, are not."""
    expected, observed = unbalanced("kenward-roger"), unbalanced("kenward-roger-observed")
    for one, other in zip(expected["variance_components"], observed["variance_components"], strict=True):
        assert one["variance"] == pytest.approx(other["variance"], rel=1e-12)
        assert 1e-6 < abs(one["std_error"] / other["std_error"] - 1.0) < 0.2
    assert expected["terms"][1]["df"] != observed["terms"][1]["df"]
    assert observed["degrees_of_freedom"] == "kenward-roger-observed"
