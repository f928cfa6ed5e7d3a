"""Choosing terms of runs in random groups and of counts, against R 4's lme4, lmerTest and step."""

import numpy as np
import pytest

import rsmkit as rk
from rsmkit.cli import main
from rsmkit.language.terms import parse_terms
from rsmkit.surfaces.estimation.counts.scoring import Counts
from rsmkit.surfaces.models.reduction.reduced import OPTIMISTIC_HERE, reduce_surface
from rsmkit.surfaces.models.reduction.refitted_terms import refitted

SPACE = rk.Space(w=(-1.0, 1.0), s=(-1.0, 1.0), t=(-1.0, 1.0))
PLOT = np.repeat(np.arange(8), 4)
POINTS = np.column_stack(
    [
        np.array([-1, 1, 0, 1, -1, 0, 1, -1.0])[PLOT],
        np.tile([-1, 1, -1, 1.0], 8),
        np.tile([-1, -1, 1, 1.0], 8),
    ]
)
Y = [
    4.14,
    8.48,
    4.91,
    5.9,
    1.44,
    5.77,
    0.89,
    5.96,
    4.34,
    6.83,
    4.67,
    6.86,
    4.04,
    9.7,
    4.4,
    8.27,
    1.63,
    3.54,
    3.11,
    2.97,
    3.07,
    6.94,
    2.62,
    6.04,
    2.89,
    7.28,
    2.34,
    7.35,
    0.04,
    4.14,
    1.35,
    2.25,
]
B = [7, 3, 6, 2, 8, 7, 11, 7, 9, 5, 10, 6, 10, 7, 10, 9, 8, 2, 9, 1, 8, 6, 8, 8, 10, 7, 11, 6, 7, 2, 5, 3]
TERMS = ["FO", "TWI", "w^2"]
KEPT = ("1", "w", "s", "t", "w*s", "s*t")


@pytest.fixture(scope="module")
def mixed():
    return rk.fit_surface(
        SPACE,
        POINTS,
        np.array(Y, float),
        terms=parse_terms(SPACE, TERMS),
        random={"plot": [str(i) for i in PLOT]},
        deterministic=False,
    ).surface


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    path = tmp_path_factory.mktemp("table") / "runs.csv"
    rows = (
        f"{p},{w:g},{s:g},{t:g},{y},{b},12" for p, (w, s, t), y, b in zip(PLOT, POINTS, Y, B, strict=True)
    )
    path.write_text("\n".join(["plot,w,s,t,y,b,n", *rows]))
    return path


def test_criteria_of_mixed_models_are_those_of_the_full_likelihood(mixed):
    # AIC(lmer(y ~ ... + (1|plot), REML = FALSE)); the deviance is flat about its minimum, so that a variance
    # found to 1e-5 leaves 1e-8 of it
    chooser = refitted(mixed, "aic")
    without = {name: chooser.steps.exponents.index(e) for name, e in [("wt", (1, 0, 1)), ("w2", (2, 0, 0))]}
    every = chooser.everything
    assert chooser.criterion(every) == pytest.approx(102.420863854, abs=1e-6)
    assert chooser.criterion(every - {without["wt"]}) == pytest.approx(100.441622377, abs=1e-6)
    least = every - set(without.values())
    assert chooser.criterion(least) == pytest.approx(99.1034879751, abs=1e-6)
    assert refitted(mixed, "bic").criterion(least) == pytest.approx(110.829375197, abs=1e-6)


def test_backward_tests_of_a_mixed_model_are_those_of_kenward_and_roger(mixed):
    # lmerTest::step(lmer(...), reduce.random = FALSE, ddf = "Kenward-Roger", alpha.fixed = 0.1)
    found = reduce_surface(mixed, "backward")
    assert found.steps == ("left out w*t (p = 0.899)", "left out w^2 (p = 0.54)")
    assert found.surface.names == KEPT
    assert found.surface.form == "mixed"
    assert OPTIMISTIC_HERE in found.surface.note


@pytest.mark.parametrize("method", ["aicc", "aic", "bic", "forward", "all"])
def test_every_way_keeps_the_hierarchy_of_a_mixed_model(mixed, method):
    found = reduce_surface(mixed, method)
    assert found.surface.names == KEPT
    assert found.dropped == ("w*t", "w^2")
    # the page, the search and files take it as any other
    again = type(found.surface).from_json(found.surface.to_json())
    assert again.predict(POINTS) == pytest.approx(found.surface.predict(POINTS), rel=1e-12)


def test_a_term_that_no_test_can_judge_stays():
    # two plots: w takes the only degree of freedom between them
    plot = np.repeat([0, 1], 8)
    rng = np.random.default_rng(1)
    points = np.column_stack([2.0 * plot - 1.0, np.tile([-1, 1.0], 8)])
    space = rk.Space(w=(-1.0, 1.0), s=(-1.0, 1.0))
    full = rk.fit_surface(
        space,
        points,
        rng.normal(size=16),
        order=1,
        random={"plot": [str(i) for i in plot]},
        deterministic=False,
    ).surface
    found = reduce_surface(full, "backward", alpha=1e-9)
    assert found.surface.names == ("1", "w")
    assert "w" not in reduce_surface(full, "forward", alpha=0.999).surface.names


def test_steps_of_counts_are_those_of_r(table):
    # step(glm(b ~ (w + s + t)^2 + I(w^2) + offset(log(n)), poisson))
    full = rk.fit_table(table, ["w", "s", "t"], ["b"], terms=TERMS, distribution="poisson", exposure="n")
    found = reduce_surface(full.surfaces["b"].surface, "aic")
    assert found.surface.names == ("1", "w", "s", "w*s")
    assert found.surface.deviance == pytest.approx(8.365, abs=5e-4)
    chooser = refitted(full.surfaces["b"].surface, "aic")
    kept = frozenset(chooser.steps.exponents.index(e) for e in found.surface.terms.exponents)
    gain = chooser.criterion(chooser.everything) - chooser.criterion(kept)
    assert gain == pytest.approx(139.605130811 - 133.608030879, abs=1e-8)


def test_a_table_is_reduced_on_request(table, capsys):
    asked = ["fit", "--data", str(table), "--factors", "w,s,t", "--terms", "FO,TWI,w^2", "--reduction"]
    for more, told in (
        (["backward", "--response", "y", "--random", "plot"], "y: left out w*t, w^2 (backward)"),
        (["aic", "--response", "b", "--distribution", "binomial", "--trials", "n"], "b: left out"),
    ):
        with pytest.raises(SystemExit) as ended:
            main([*asked, *more])
        assert ended.value.code == 0
        assert told in capsys.readouterr().out


def test_counts_of_a_study_are_reduced_where_it_asks_for_it():
    options = rk.SurfaceOptions(model="reduced", terms=("FO", "TWI", "w^2"), reduction="aic")
    choice = rk.choose_surface(
        SPACE,
        POINTS,
        np.array(B, float),
        response="b",
        options=options,
        counts=Counts("poisson", np.full(32, 12.0)),
    )
    assert choice.surface.surface.names == ("1", "w", "s", "w*s")
    assert choice.sentence == "b: poisson, as it is a count, without t, w*t, s*t, w^2."


def test_runs_in_groups_are_reduced_where_a_study_asks_for_it(mixed):
    options = rk.SurfaceOptions(model="reduced", terms=("FO", "TWI", "w^2"), reduction="backward")
    choice = rk.choose_surface(
        SPACE,
        POINTS,
        np.array(Y, float),
        options=options,
        random={"plot": [str(i) for i in PLOT]},
        deterministic=False,
    )
    assert choice.surface.surface.names == KEPT
    assert "without w*t, w^2" in choice.sentence
