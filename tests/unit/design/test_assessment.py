"""Figures of designs whose values are known in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from rsmkit.design.design import Design
from rsmkit.design.families.composite import ccd
from rsmkit.design.quality.assessment import assess, refuse_singular
from rsmkit.design.region import box
from rsmkit.errors import RsmkitError
from rsmkit.language.space import Space


def space(k: int) -> Space:
    return Space(**{f"x{j + 1}": (-1.0, 1.0) for j in range(k)})


def cube(k: int) -> Design:
    corners = np.stack(np.meshgrid(*[[-1.0, 1.0]] * k, indexing="ij"), axis=-1).reshape(-1, k)
    return Design(space(k), corners, ("factorial",) * len(corners))


def test_two_level_factorial_is_perfect_for_a_first_order_model():
    quality = assess(cube(3), order=1)
    assert quality.rank == quality.p == 4
    for figure in (quality.d_efficiency, quality.a_efficiency, quality.g_efficiency):
        assert figure == pytest.approx(100.0, rel=1e-12)
    assert quality.condition_number == pytest.approx(1.0, rel=1e-12)
    assert list(quality.vif.values()) == pytest.approx([1.0] * 3)
    assert quality.leverages == pytest.approx([0.5] * 8)
    assert quality.standard_errors["x1"] == pytest.approx(8**-0.5)
    # 1/8 + 3 * (1/8) * E x^2, with E x^2 = 1/3
    assert quality.average_variance == pytest.approx(0.25, rel=1e-12)
    assert quality.largest_variance == pytest.approx(0.5, rel=1e-12)


def test_three_level_factorial_in_two_factors():
    """det X'X = 5184 for the 3^2 design and the full quadratic; Atkinson & Donev (1992)."""
    grid = np.stack(np.meshgrid([-1.0, 0, 1], [-1.0, 0, 1], indexing="ij"), axis=-1).reshape(-1, 2)
    quality = assess(Design(space(2), grid, ("factorial",) * 9))
    assert quality.d_efficiency == pytest.approx(100 * 5184 ** (1 / 6) / 9, rel=1e-12)
    assert sum(quality.leverages) == pytest.approx(6)
    assert quality.average_variance == pytest.approx(0.45, rel=1e-12)


def test_aliased_terms_are_named_and_refused():
    quality = assess(cube(2), order=2)
    assert (quality.rank, quality.aliased) == (4, ("x1^2", "x2^2"))
    assert quality.d_efficiency is None
    with pytest.raises(RsmkitError, match=r"rank 4 of 6.*x1\^2, x2\^2"):
        refuse_singular(quality)


def test_aliases_are_spelled_out():
    """2^(3-1) with C = AB: I = ABC, so every interaction is a main effect."""
    half = cube(3).select([1, 2, 4, 7])
    quality = assess(half, order=2)
    assert quality.alias_of["x1*x2"] == "x3"
    assert quality.alias_of["x1^2"] == "1"
    with pytest.raises(RsmkitError, match=r"x1\*x2 = x3"):
        refuse_singular(quality)


def test_figures_over_the_region():
    quality = assess(cube(3), order=1)
    # tr W = 1 + 3/3, average variance 1/4, n = 8
    assert quality.i_efficiency == pytest.approx(100.0, rel=1e-12)
    assert len(quality.variance_fractions) == 11
    assert quality.variance_profile["x1"] == pytest.approx([(1 + x * x) / 8 for x in np.linspace(-1, 1, 11)])
    assert quality.correlations == {}
    three = assess(Design(space(1), np.array([[-1.0], [0.0], [0.5], [1.0]]), ("given",) * 4))
    x = np.array([-1.0, 0.0, 0.5, 1.0])
    assert three.correlations == pytest.approx({"x1, x1^2": np.corrcoef(x, x * x)[0, 1]})


def test_a_sound_design_is_not_refused():
    refuse_singular(assess(ccd(space(2))))


def test_warnings_teach():
    quality = assess(ccd(space(3)))
    text = "\n".join(quality.warnings)
    assert "6 axial points lie outside the bounds (up to 1.682 coded" in text
    assert "17 runs, 15 distinct" in text
    assert "outside" not in "".join(assess(ccd(space(3), star="inscribed")).warnings)
    assert "distinct" not in "".join(assess(ccd(space(3)), deterministic=False).warnings)


def test_too_few_runs_are_counted_without_replicates():
    design = Design(space(1), np.array([[-1.0], [1.0], [1.0], [1.0]]), ("given",) * 4)
    assert any("the model has 3 coefficients, the design 2 distinct" in w for w in assess(design).warnings)


def test_saturated_design_is_pointed_out():
    design = Design(space(1), np.array([[-1.0], [0.0], [1.0]]), ("given",) * 3)
    assert any(w.startswith("saturated") for w in assess(design).warnings)


def test_close_points_inflate_the_variance():
    design = Design(space(1), np.array([[0.9], [0.95], [1.0], [0.92]]), ("given",) * 4)
    quality = assess(design)
    assert any("variance inflation" in w for w in quality.warnings)


def test_figures_are_plain_json():
    import json

    data = assess(ccd(space(2))).to_json()
    assert json.loads(json.dumps(data, allow_nan=False)) == data


def test_categorical_factors():
    design = Design(
        Space(x=(0.0, 2.0), tool=["A", "B", "C"]),
        np.array([[x, t] for x in (0.0, 2.0) for t in range(3)]),
        ("given",) * 6,
    )
    quality = assess(design, order=1)
    assert quality.rank == 4
    # balanced one-way layout: var(mean of A) = 1/2, differences of level means 1/2 + 1/2
    assert quality.standard_errors["tool[B]"] == pytest.approx(1.0)


def test_standard_errors_over_the_region():
    """On a box twice as wide the effect of a factor is twice as large, of its square four times."""
    design = ccd(space(2))
    near, far = assess(design), assess(design, region=box(space(2), 2.0))
    assert near.region_standard_errors == near.standard_errors == far.standard_errors
    wide = [far.region_standard_errors[name] / far.standard_errors[name] for name in far.standard_errors]
    assert list(far.standard_errors) == ["1", "x1", "x2", "x1*x2", "x1^2", "x2^2"]
    assert wide == pytest.approx([1, 2, 2, 4, 4, 4], rel=1e-14)
