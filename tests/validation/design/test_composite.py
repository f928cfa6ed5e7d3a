"""Central composite designs against R's rsm package and the theory of Box & Hunter (1957)."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from rsmkit.design.families.composite import ccd
from rsmkit.errors import RsmkitError
from rsmkit.language.space import Space
from rsmkit.language.terms import full_terms

CATALOGUE = Path(__file__).parents[2] / "data/design/catalogue.csv"


def space(k: int) -> Space:
    return Space(**{f"x{j + 1}": (0.0, 10.0) for j in range(k)})


def catalogue() -> list[dict[str, str]]:
    with open(CATALOGUE, newline="") as stream:
        return [row for row in csv.DictReader(stream) if row["design"] == "ccd"]


@pytest.mark.parametrize("row", catalogue(), ids=lambda r: f"{r['k']}-{r['alpha_rule']}-{r['n']}")
def test_star_distance_and_runs(row):
    k, center, center_axial = int(row["k"]), int(row["n0_cube"]), int(row["n0_star"])
    star = "faced" if row["alpha_rule"] == "faces" else "circumscribed"
    alpha = "rotatable" if star == "faced" else row["alpha_rule"]
    design = ccd(space(k), star=star, alpha=alpha, center=center, center_axial=center_axial)
    assert len(design) == int(row["n"])
    tips = design.coded[np.array(design.kinds) == "axial"]
    np.testing.assert_allclose(np.abs(tips).max(axis=1), float(row["alpha"]), rtol=1e-13)


def test_seventeen_runs_of_the_circumscribed_design():
    design = ccd(Space(a=(5, 10), b=(10, 15), c=(0.15, 0.30)))
    assert len(design) == 17
    assert design.distinct == 15
    assert [design.kinds.count(kind) for kind in ("factorial", "axial", "center")] == [8, 6, 3]
    np.testing.assert_allclose(design.points[:, 0].min(), 7.5 - 2.5 * 8**0.25, rtol=1e-15)


def test_inscribed_design_has_its_star_on_the_bounds():
    design = ccd(space(3), star="inscribed")
    kinds = np.array(design.kinds)
    assert np.abs(design.coded[kinds == "axial"]).max() == 1.0
    np.testing.assert_allclose(np.abs(design.coded[kinds == "factorial"]), 8**-0.25, rtol=1e-14)


def test_rotatable_variance_depends_on_the_distance_only():
    design = ccd(space(4), center=2)
    terms = full_terms(4)
    X = terms.matrix(design.coded)
    directions = np.random.default_rng(0).normal(size=(50, 4))
    sphere = 1.3 * directions / np.linalg.norm(directions, axis=1)[:, None]
    rows = terms.matrix(sphere)
    variance = np.einsum("ij,jk,ik->i", rows, np.linalg.inv(X.T @ X), rows)
    np.testing.assert_allclose(variance, variance[0], rtol=1e-12)


def test_uncorrelated_squares():
    design = ccd(space(3), alpha="uncorrelated", center=6)
    X = full_terms(3).matrix(design.coded)
    covariance = np.linalg.inv(X.T @ X)[7:, 7:]  # the squares come last
    np.testing.assert_allclose(covariance - np.diag(np.diag(covariance)), 0.0, atol=1e-14)


def test_given_distance():
    tips = ccd(space(2), alpha=1.2345, center=0).coded[4:]
    np.testing.assert_allclose(tips, [[-1.2345, 0], [1.2345, 0], [0, -1.2345], [0, 1.2345]], atol=1e-14)


def test_impossible_designs_are_refused():
    with pytest.raises(RsmkitError, match="at least two numeric factors"):
        ccd(space(1))
    with pytest.raises(RsmkitError, match="two numeric factors, got 1"):
        ccd(Space(a=(0, 1), gas=["air", "CO2"]))
    with pytest.raises(RsmkitError, match="alpha must be positive"):
        ccd(space(2), alpha=-1.0)
    with pytest.raises(RsmkitError, match="use an optimal design"):
        ccd(space(13))
