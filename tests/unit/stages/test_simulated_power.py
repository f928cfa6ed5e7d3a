"""Power by simulation, against closed forms and enumerations."""

import itertools
import json

import numpy as np
import pytest
from scipy.special import xlogy
from scipy.stats import binom, chi2, nct, t

import rsmkit as rk
from rsmkit.cli import main
from rsmkit.language.terms import parse_terms
from rsmkit.stages.planning.simulated_power import simulate_power

SPACE = rk.Space(a=(-1.0, 1.0), b=(-1.0, 1.0))
CORNERS = np.array(list(itertools.product([-1.0, 1.0], repeat=2)))
LATTICE = rk.Design(SPACE, np.tile(CORNERS, (2, 1)), ("given",) * 8)


def agrees(share, truth, experiments):
    """Whether a share of so many is within 4 standard errors of its expectation: missed once in 16,000."""
    return abs(share - truth) <= 4.0 * (truth * (1.0 - truth) / experiments) ** 0.5


def test_independent_runs_have_the_power_of_the_noncentral_t():
    found = simulate_power(LATTICE, order=1, experiments=300)
    truth = rk.power_of_terms(LATTICE, order=1)
    assert set(found.power) == {"a", "b"}
    for name in found.power:
        assert agrees(found.power[name], truth[name], 300)
        assert found.low[name] < found.power[name] < found.high[name]


def test_a_hard_factor_is_found_by_its_plots_alone():
    # balanced plots of two runs: the hard factor is tested on the means of 8 plots, 6 degrees of freedom
    # within the estimate of a positive plot variance, which a ratio of 9 nearly always has
    points = np.array([[w, s] for w in (-1.0, 1.0) * 4 for s in (-1.0, 1.0)])
    blocks = tuple(np.repeat(range(1, 9), 2).tolist())
    design = rk.Design(SPACE, points, ("given",) * 16, blocks, block_ratio=9.0)
    terms = parse_terms(SPACE, ["FO"])
    found = simulate_power(design, terms=terms, effects={"a": 4.0}, experiments=60)

    def truth(effect, sd, runs, df):
        limit, shift = t.ppf(0.975, df), effect * runs**0.5 / sd
        return nct.sf(limit, df, shift) + nct.cdf(-limit, df, shift)

    assert agrees(found.power["a"], truth(4.0, (9.0 + 0.5) ** 0.5, 8, 6), 60)
    # of a term that does nothing it is the size of the test
    assert agrees(found.power["b"], 0.05, 60)


def test_yes_and_no_have_the_power_that_all_outcomes_add_up_to():
    space = rk.Space(a=(-1.0, 1.0))
    design = rk.Design(space, np.array([[-1.0], [1.0]]), ("given",) * 2)
    trials, effect = 12, 0.8
    p = 1.0 / (1.0 + np.exp([effect, -effect]))
    y = np.arange(trials + 1.0)

    def likelihood(successes, size):
        return xlogy(successes, successes / size) + xlogy(size - successes, 1.0 - successes / size)

    # every pair of counts; a likelihood ratio has a limit also where one of them is 0 or 12, where the
    # penalised test is taken, which may judge these few otherwise: they are left out of both
    ratio = 2.0 * (
        likelihood(y, trials)[:, None] + likelihood(y, trials) - likelihood(y[:, None] + y, 2 * trials)
    )
    chance = binom.pmf(y, trials, p[0])[:, None] * binom.pmf(y, trials, p[1])
    edge = (y == 0) | (y == trials)
    inner = ~(edge[:, None] | edge)
    truth = float((chance * (ratio > chi2.ppf(0.95, 1)))[inner].sum())
    slack = float(chance[~inner].sum())
    found = simulate_power(
        design, order=1, effects={"a": effect}, distribution="binomial", size=trials, experiments=300
    )
    error = 4.0 * (0.25 / 300) ** 0.5
    assert truth - error <= found.power["a"] <= truth + slack + error
    assert slack < 0.15


def test_counts_find_more_with_more_exposure():
    shares = [
        simulate_power(
            LATTICE, order=1, distribution="poisson", size=size, signal_to_noise=1.0, experiments=30
        ).power["a"]
        for size in (0.5, 20.0)
    ]
    assert shares[0] < 0.6 < 0.95 < shares[1]


def test_what_cannot_be_simulated_is_refused():
    for given, words in (
        ({"effects": {"c": 1.0}}, "'c'"),
        ({"experiments": 5}, "at least 10"),
        ({"distribution": "binomial", "baseline": 1.5}, "between 0 and 1"),
        ({"distribution": "binomial", "size": 2.5}, "whole number"),
        ({"distribution": "poisson", "baseline": -1.0}, "above 0"),
    ):
        with pytest.raises(rk.RsmkitError, match=words):
            simulate_power(LATTICE, order=1, **given)
    with pytest.raises(rk.RsmkitError, match=r"a\^2"):
        simulate_power(LATTICE, order=2)


STUDY = """
[factors]
w = { low = -1.0, high = 1.0 }
s = { low = 0.0, high = 5.0 }
[responses]
dead = { distribution = "binomial", trials = 30 }
y = {}
[design]
kind = "factorial"
[surface]
order = 1
"""


def test_the_plan_of_a_study_says_how_often_terms_are_found(tmp_path, capsys):
    (tmp_path / "study.toml").write_text(STUDY)
    with pytest.raises(SystemExit) as ended:
        main(["plan", str(tmp_path), "--power", "20", "--baseline", "0.3", "--json"])
    assert ended.value.code == 0
    found = json.loads(capsys.readouterr().out)["simulated_power"]
    assert set(found) == {"dead", "normal"}
    # thirty trials in each of four corners: a change of the logit by two is hardly missed
    assert found["dead"]["power"]["w"] > 0.8
    with pytest.raises(SystemExit) as ended:
        main(["plan", str(tmp_path), "--size", "20"])
    assert ended.value.code == 2
    assert "--power" in capsys.readouterr().err
