"""Laws through surfaces: moments, causes, conformance, against closed forms."""

import numpy as np
import pytest
from scipy.special import ndtr
from scipy.stats import qmc

import rsmkit as rk

NORMAL = {"a": {"law": "normal", "sd": 0.5}, "b": {"law": "normal", "sd": 2.0}}


def test_moments_and_causes_of_a_quadratic(quadratic):
    found = rk.uncertainty(quadratic, NORMAL, at={"a": 1.0, "b": 1.0, "c": 0.5}, draws=50).responses["y"]
    # about (1, 1): 6 + 5 a - 0 b + a b + a^2 with a, b centred; gradient (5, 0), a^2 and a b
    va, vb = 0.25, 4.0
    alone, both = 25.0 * va + 2.0 * va**2, va * vb
    assert found.mean == pytest.approx(6.0 + va, rel=1e-10)
    assert found.sd**2 == pytest.approx(alone + both, rel=1e-10)
    assert found.sobol["a"].first == pytest.approx(alone / (alone + both), rel=1e-10)
    assert found.sobol["a"].total == pytest.approx(1.0, rel=1e-10)
    assert found.sobol["b"].first == pytest.approx(0.0, abs=1e-10)
    assert found.pairs["a*b"] == found.sobol["b"].total == pytest.approx(both / (alone + both), rel=1e-10)
    assert found.causes["b"].sd_without == pytest.approx(alone**0.5, rel=1e-10)
    # d sqrt(V) / d sd_b = (d V / d vb) sd_b / sqrt(V), and d V / d vb = va
    assert found.causes["b"].tightening == pytest.approx(va * 2.0 / found.sd, rel=1e-10)
    assert found.causes["a"].tightening == pytest.approx((25.0 + 4.0 * va + vb) * 0.5 / found.sd, rel=1e-10)
    assert found.exact
    # no error to speak of, so nothing is left open
    assert found.sobol["a"].low == pytest.approx(found.sobol["a"].high, abs=1e-6)
    assert found.mean_high - found.mean_low < 1e-9


def test_correlated_normal_factors_have_closed_moments(quadratic):
    found = rk.uncertainty(
        quadratic,
        NORMAL,
        at={"a": 1.0, "b": 1.0, "c": 0.5},
        correlation=[[1.0, 0.6], [0.6, 1.0]],
        draws=20,
        samples=256,
    ).responses["y"]
    cov = 0.6 * 0.5 * 2.0
    hessian, covariance = np.array([[2.0, 1.0], [1.0, 0.0]]), np.array([[0.25, cov], [cov, 4.0]])
    curved = hessian @ covariance
    assert found.mean == pytest.approx(6.0 + 0.5 * np.trace(curved), rel=1e-10)
    assert found.sd**2 == pytest.approx(25.0 * 0.25 + 0.5 * np.trace(curved @ curved), rel=1e-10)


@pytest.mark.parametrize(("limit", "points"), [(4.0, 1 << 13), (6.5, 1 << 17), (7.6, 1 << 20)])
def test_normal_tails(quadratic, limit, points):
    # z = b is normal about 1 with sd 2; so many points know a probability p to sqrt(p / points), at worst
    found = rk.uncertainty(
        quadratic, NORMAL, at={"a": 0.0, "b": 1.0, "c": 0.5}, specifications={"z": {"high": limit}}, draws=20
    ).responses["z"]
    truth = float(ndtr(-(limit - 1.0) / 2.0))
    assert found.out_of_specification == pytest.approx(truth, abs=3.0 * (truth / points) ** 0.5)
    assert found.out_low <= truth <= found.out_high
    assert found.dpm == 1e6 * found.out_of_specification
    assert found.cpk == pytest.approx((limit - 1.0) / 6.0, rel=1e-9)
    assert found.quantiles["0.95"] == pytest.approx(1.0 + 2.0 * 1.6448536, abs=0.01)


def test_noise_is_part_of_what_a_laboratory_response_does():
    rng = np.random.default_rng(4)
    space = rk.Space(a=(-1.0, 1.0))
    x = np.repeat(np.linspace(-1.0, 1.0, 11), 20)[:, None]
    y = 2.0 * x[:, 0] + 0.5 * rng.standard_normal(len(x))
    surfaces = {"y": rk.fit_surface(space, x, y, order=1)}
    law, limits = {"a": {"law": "normal", "sd": 0.1}}, {"y": {"high": 1.0}}
    noisy = rk.uncertainty(surfaces, law, specifications=limits, deterministic=False).responses["y"]
    sigma, slope = surfaces["y"].fit.sigma, surfaces["y"].gradient([[0.0]])[0, 0]
    assert noisy.noise_sd == sigma
    assert noisy.sd == pytest.approx(np.hypot(0.1 * slope, sigma), rel=1e-9)
    middle = surfaces["y"].predict([[0.0]])[0]
    assert noisy.out_of_specification == pytest.approx(ndtr((middle - 1.0) / noisy.sd), rel=0.01)
    assert noisy.quantiles["0.05"] == pytest.approx(middle - 1.645 * noisy.sd, rel=0.02)
    assert rk.uncertainty(surfaces, law, specifications=limits).responses["y"].noise_sd == 0.0


def test_a_poor_surface_looks_poor():
    rng = np.random.default_rng(5)
    space = rk.Space(a=(-1.0, 1.0), b=(-1.0, 1.0))
    x = 2.0 * rng.random((12, 2)) - 1.0
    y = np.sin(5.0 * x[:, 0]) * np.cos(4.0 * x[:, 1])
    found = rk.uncertainty(
        {"y": rk.fit_surface(space, x, y, order=2)},
        {"a": {"law": "normal", "sd": 0.1}},
        specifications={"y": {"high": 0.3}},
    ).responses["y"]
    assert found.out_low < 0.05
    assert found.out_high > 0.95


def test_all_specifications_and_the_largest_box(quadratic):
    limits = {"y": {"low": -30.0, "high": 30.0}, "z": {"high": 4.0}}
    found = rk.uncertainty(
        quadratic, NORMAL, at={"a": 1.0, "b": 1.0, "c": 0.5}, specifications=limits, draws=20
    )
    alone = [found.responses[name].out_of_specification for name in limits]
    # b far above 4 does not push y out, so the two exclude each other nearly always
    assert max(alone) <= found.out_of_specification.fraction <= sum(alone) + 1e-12
    space = found.design_space
    assert space.factors == ("b", "a")  # b matters to both
    probability = np.array(space.probability)
    assert probability.shape == (21, 21)
    low, high = space.box["b"]
    assert high <= 4.0 - 1.645 * 2.0 + 0.2  # z keeps to 95 % up to there, and a node is one unit wide
    rows = (np.array(space.axes[0]) >= low) & (np.array(space.axes[0]) <= high)
    columns = (np.array(space.axes[1]) >= space.box["a"][0]) & (np.array(space.axes[1]) <= space.box["a"][1])
    assert (probability[np.ix_(rows, columns)] >= 0.95).all()


def test_a_box_of_all_factors_in_which_specifications_are_kept():
    space = rk.Space(a=(0.0, 1.0), b=(0.0, 1.0), c=(0.0, 1.0))
    x = qmc.Sobol(3, rng=np.random.default_rng(1)).random(16)
    surfaces = {"y": rk.fit_surface(space, x, x.sum(axis=1), order=1)}
    limits, law = {"y": {"high": 1.5}}, {"a": {"sd": 1e-6}}
    found = rk.uncertainty(surfaces, law, at=dict.fromkeys("abc", 0.2), specifications=limits, draws=20)
    box = found.design_space.operating_box
    assert list(box) == ["a", "b", "c"]
    assert all(low <= 0.2 <= high for low, high in box.values())
    # the worst corner keeps to a + b + c <= 1.5 (but for the law's 1.6 millionths); at best 0.5^3 of the
    # space is inside, at equal sides, and sides of 0.8 to 1.25 of these leave four fifths of it at least
    assert sum(high for _, high in box.values()) <= 1.5 + 1e-5
    assert np.prod([high - low for low, high in box.values()]) >= 0.8 * 0.125
    assert "while all factors stay in a from" in found.summary()
    surfaces = {"y": rk.fit_surface(space, x, 9.0 + x.sum(axis=1), order=1)}
    nowhere = rk.uncertainty(surfaces, law, specifications=limits, draws=20)
    assert nowhere.design_space.operating_box is None


def test_the_same_seed_gives_the_same_document(quadratic):
    limits = {"z": {"high": 5.0}}
    first, second = (
        rk.uncertainty(quadratic, NORMAL, specifications=limits, draws=20, seed=seed) for seed in (3, 3)
    )
    assert first.to_json() == second.to_json()
    assert rk.Uncertainty.from_json(first.to_json()).to_json() == first.to_json()
    assert "z: mean" in first.summary()
    assert "<table>" in first._repr_html_()


def test_what_cannot_be_is_refused(quadratic):
    with pytest.raises(rk.RsmkitError, match=r"specifications: response must be y or z; got 'q'"):
        rk.uncertainty(quadratic, NORMAL, specifications={"q": {"high": 1}})
    with pytest.raises(rk.RsmkitError, match=r"specifications.y: must have low, high or both"):
        rk.uncertainty(quadratic, NORMAL, specifications={"y": {}})
    with pytest.raises(rk.RsmkitError, match=r"specifications.y: low"):
        rk.uncertainty(quadratic, NORMAL, specifications={"y": {"low": 2, "high": 1}})
    with pytest.raises(rk.RsmkitError, match=r"propagation.map: q is no numeric factor"):
        rk.uncertainty(quadratic, NORMAL, specifications={"y": {"low": 0}}, map=["a", "q"])
    with pytest.raises(rk.RsmkitError, match=r"specifications.y: must be a table"):
        rk.uncertainty(quadratic, NORMAL, specifications={"y": 3})
    with pytest.raises(rk.RsmkitError, match="correlation: must be numbers"):
        rk.uncertainty(quadratic, NORMAL, correlation=[[1, 0.3], [0.3]])
    with pytest.raises(rk.RsmkitError, match="at: b must be a finite number, got nan"):
        rk.uncertainty(quadratic, NORMAL, at={"a": 1.0, "b": float("nan"), "c": 0.5})
    with pytest.raises(rk.RsmkitError, match="samples must be a power of 2"):
        rk.uncertainty(quadratic, NORMAL, samples=1000)


def test_a_textbook_capability():
    # Montgomery, Introduction to Statistical Quality Control, 7th ed., example 8.1 (glass containers) and
    # section 8.3 (piston rings, mean 74.001, sd 0.0099, 74.00 +- 0.05)
    assert rk.capability(264.06, 32.02, low=200.0).cpk == pytest.approx(0.67, abs=0.005)
    rings = rk.capability(74.001, 0.0099, low=73.95, high=74.05)
    assert rings.cp == pytest.approx(1.68, abs=0.005)
    assert rings.cpk == pytest.approx(1.65, abs=0.005)


def test_what_two_factors_cause_together_over_the_box(quadratic):
    own = rk.uncertainty(quadratic, NORMAL, at={"a": 1.0, "b": 1.0, "c": 0.5}, draws=20).responses["y"]
    # uniform on (-10, 10): variance 100/3 of a and b, of a^2 E a^4 - (E a^2)^2 = 2000 - 10000/9
    both, alone = (100.0 / 3.0) ** 2, 5.0 * 100.0 / 3.0 + 2000.0 - 10000.0 / 9.0
    assert own.pairs_box["a*b"] == pytest.approx(both / (both + alone), rel=1e-10)
    assert own.pairs_box["a*c"] == pytest.approx(0.0, abs=1e-10)
    assert set(own.pairs_box) == set(own.pair_intervals_box)
    assert own.pair_intervals["a*b"] == pytest.approx((own.pairs["a*b"],) * 2, abs=1e-6)


def test_pairs_of_a_process_and_their_intervals():
    space = rk.Space(a=(-1.0, 1.0), b=(-1.0, 1.0), c=(-1.0, 1.0))
    points = qmc.scale(qmc.Sobol(3, rng=np.random.default_rng(2)).random(32), -1.0, 1.0)
    a, b, c = points.T
    options = rk.SurfaceOptions(model="gaussian process")
    surface = rk.choose_surface(space, points, a + 2.0 * a * b + 0.3 * c, options=options).surface
    own = rk.uncertainty(
        {"y": surface}, {"a": {"law": "uniform", "half_width": 1.0}}, draws=40, samples=1024
    ).responses["y"]
    # uniform on (-1, 1): variances 1/3, 4/9 and 0.03
    truth = (4.0 / 9.0) / (1.0 / 3.0 + 4.0 / 9.0 + 0.03)
    low, high = own.pair_intervals_box["a*b"]
    assert low <= truth <= high
    assert high - low < 0.1
    assert own.pairs_box["a*c"] < 0.02 > own.pairs_box["b*c"]
    assert not own.pairs
