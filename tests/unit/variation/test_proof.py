"""Runs under the laws: unbiased whatever the surface, sure where it is good."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import ndtr

import rsmkit as rk
from rsmkit.language.joint_law import JointLaw
from rsmkit.language.laws import Normal
from rsmkit.surfaces.kinds import posterior_of
from rsmkit.variation.conformity.proof import Trial, _combined, _one_wave, _people, _Told, _Waves, prove
from rsmkit.variation.options import Specification

SPACE = rk.Space(a=(-5.0, 5.0), b=(-5.0, 5.0))
LAW = JointLaw(SPACE, np.zeros(2), {"a": Normal(0.0, 1.0), "b": Normal(0.0, 1.0)})


def trial(function, limit, runs, seed=1):
    rng = np.random.default_rng(seed)
    points = 10.0 * rng.random((14, 2)) - 5.0
    surface = rk.fit_surface(SPACE, points, function(points), response="y", order=2)
    posterior = posterior_of(surface, 100, rng)
    x = LAW.draw(1 << 16, rng)
    values = surface.predict(x)
    controls = {"y": (values.mean(), values.var())}
    return Trial(LAW, {"y": posterior}, [0, 1], controls, {"y": Specification(high=limit)}, runs, seed=seed)


def curved(x):
    return x[:, 0] + 0.3 * x[:, 1] ** 2 + 0.2 * np.sin(2.0 * x[:, 0])


def test_a_rare_failure_is_found_with_few_runs():
    # P(a + 0.3 b^2 + 0.2 sin 2a > t): integrated over b by Gauss and Hermite, the inverse in a by bisection
    limit = 4.5
    b, weight = np.polynomial.hermite_e.hermegauss(60)
    low, high = np.full(60, -30.0), np.full(60, 30.0)
    for _ in range(80):
        middle = 0.5 * (low + high)
        above = middle + 0.2 * np.sin(2.0 * middle) > limit - 0.3 * b**2
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    truth = float(weight / weight.sum() @ ndtr(-low))
    assert 5e-4 < truth < 5e-3
    proof = prove(trial(curved, limit, 100), lambda x: {"y": curved(x)})
    found = proof.responses["y"].outside
    assert found.low <= truth <= found.high
    assert found.high < 1.5 * truth
    assert found.gain > 100.0  # plain runs would be this many times more
    assert proof.runs == 100
    assert proof.outside.value == pytest.approx(found.value, rel=1e-9)


def test_intervals_know_that_waves_share_their_population():
    # The surface is exact, so that runs add nothing: what is not known comes from the sample of the law.
    # Half of its n = 2^18 points are wide by s^2 = 1 + 3.7^2 / 2, so that their density is q, and the
    # variance of a share is the integral of phi^2 / q over n.
    plane, limit = (lambda x: (x[:, 0] + x[:, 1]) / 2.0**0.5), 3.7
    found = prove(trial(plane, limit, 100), lambda x: {"y": plane(x)}).responses["y"].outside
    s = (1.0 + 3.7**2 / 2.0) ** 0.5
    u, v = np.meshgrid(np.linspace(limit, 20.0, 1631), np.linspace(-20.0, 20.0, 2001))
    phi, wide = (np.exp(-0.5 * (u**2 + v**2) / w**2) / (2.0 * np.pi * w**2) for w in (1.0, s))
    q, cell = 0.5 * (phi + wide), 0.01 * 0.02
    variance = cell * (phi**2 / q).sum() / (1 << 18)
    # a tenth of the points carry most of it: known to 1 / sqrt(1,200), its root to half of that
    assert found.error == pytest.approx(variance**0.5, rel=0.05)
    assert found.low <= ndtr(-limit) <= found.high


def test_mean_and_deviation_of_what_no_quadratic_describes():
    proof = prove(trial(curved, 50.0, 60), lambda x: {"y": curved(x)}).responses["y"]
    # E sin 2a = 0; E (a + 0.2 sin 2a)^2 = 1 + 0.4 E a sin 2a + 0.04 E sin^2 2a, E a sin 2a = 2 e^-2,
    # E sin^2 2a = (1 - e^-8) / 2; variance of 0.3 b^2: 0.18
    sd = np.sqrt(1.0 + 0.8 * np.exp(-2.0) + 0.02 * (1.0 - np.exp(-8.0)) + 0.18)
    # one seed: within four standard errors
    assert proof.mean.value == pytest.approx(0.3, abs=4.0 * proof.mean.error)
    assert proof.sd.value == pytest.approx(sd, abs=4.0 * proof.sd.error)
    assert proof.mean.gain > 3.0
    assert proof.quantiles["0.5"] == pytest.approx(0.25, abs=0.25)


def test_a_surface_that_lies_too_high_still_tells_the_spread():
    def plane(x):
        return x[:, 0] + x[:, 1]

    proof = prove(trial(plane, 50.0, 40), lambda x: {"y": plane(x) - 3.0}).responses["y"]
    # what is left is the mean square of the 2^16 points that the control was taken from
    assert proof.sd.value == pytest.approx(np.sqrt(2.0), rel=4.0 / np.sqrt(2.0 * 65_536))
    assert proof.sd.gain > 1e6


@pytest.mark.parametrize(("sign", "is_as_expected"), [(1.0, True), (-1.0, False)])
def test_a_wave_is_no_surer_than_it_was_expected_to_be_nor_than_it_turned_out(sign, is_as_expected):
    plan, waves = trial(curved, 1.0, 20), _Waves(np.empty((0, 2)), np.empty(0), {"y": np.empty(0)})
    surface = plan.posteriors["y"].predict
    _one_wave(plan, _people(plan, waves, 0), 0, waves, 0, 20, lambda x: {"y": sign * surface(x)})
    (told,) = waves.estimates["y"]
    assert 0.0 < told.ahead <= told.seen
    assert (told.ahead == told.seen) == is_as_expected


def test_more_runs_go_on_where_fewer_ended():
    asked = []

    def fly(x):
        asked.append(x)
        return {"y": curved(x)}

    prove(trial(curved, 3.0, 30), fly)
    short = np.vstack(asked)
    asked.clear()
    prove(trial(curved, 3.0, 50), fly)
    assert len(short) == 30
    assert (np.vstack(asked)[:30] == short).all()


def test_runs_that_fail_are_counted_and_left_out():
    def fly(x):
        return {"y": np.where(x[:, 0] > 1.0, np.nan, curved(x))}

    proof = prove(trial(curved, 50.0, 40), fly)
    assert proof.runs == 40
    assert 0 < proof.failed < 20
    assert np.isfinite(proof.responses["y"].mean.value)
    nothing = prove(trial(curved, 50.0, 20), lambda x: {"y": np.full(len(x), np.nan)})
    assert nothing.failed == 20
    assert nothing.responses == {}


def test_an_exact_surface_leaves_nothing_to_find():
    proof = prove(trial(lambda x: x[:, 0] + x[:, 1], 2.0, 20), lambda x: {"y": x[:, 0] + x[:, 1]})
    found = proof.responses["y"].outside
    truth = float(ndtr(-(2.0**0.5)))
    assert found.low <= truth <= found.high
    assert found.high - found.low < 0.01 * truth + 4.0 * (truth / (1 << 17)) ** 0.5


def test_waves_count_by_how_well_they_were_expected_to_do():
    """Expected variances 1 and 4 are weights 0.8 and 0.2; what came out, 4 and 9, widens the interval."""
    waves = [_Told(0.1, 1e-6, 4e-6, 0, 0.0), _Told(0.4, 4e-6, 9e-6, 0, 0.0)]
    runs_alone = 0.8**2 * 4e-6 + 0.2**2 * 9e-6
    for second in (0, 1):  # from the population of the first wave, or from one of its own
        found = _combined([waves[0], replace(waves[1], population=second)], 2.0, 100)
        assert found.value == pytest.approx(0.8 * 0.1 + 0.2 * 0.4)
        assert found.error == pytest.approx(np.sqrt(runs_alone))
    # a population that both share adds its variance once
    shared = _combined([replace(told, sampled=5e-6) for told in waves], 2.0, 100)
    assert shared.error == pytest.approx(np.sqrt(runs_alone + 5e-6))
