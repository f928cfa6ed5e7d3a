"""Models with a term but not everything it contains: exactly the terms that were asked for."""

import json
from itertools import product

import numpy as np
import pytest
from command_line import runner

from rsmkit.cli.commands import main
from rsmkit.language.space import Space
from rsmkit.language.terms import Terms, parse_terms
from rsmkit.surfaces.polynomial_fit import fit_surface
from rsmkit.surfaces.statistics.optima.canonical import stationary_statistic

SPACE = Space(a=(-1.0, 1.0), b=(-1.0, 1.0))
GRID = np.array(list(product([-1.0, 0.0, 1.0], repeat=2)))
NOISE = np.array([0.1, -0.2, 0.1, 0.0, 0.3, -0.3, -0.1, 0.2, -0.1])


def test_words_add_margins_unless_they_say_exact():
    assert parse_terms(SPACE, ["a*b", "a^2"]).names(SPACE) == ("1", "a", "b", "a*b", "a^2")
    assert parse_terms(SPACE, ["a*b", "exact", "a^2"]).names(SPACE) == ("1", "a*b", "a^2")
    assert parse_terms(SPACE, ["0", "exact", "a*b"]).names(SPACE) == ("a*b",)
    named = Space(exact=(0.0, 1.0), b=(0.0, 1.0))
    assert parse_terms(named, ["exact*b"]).names(named) == ("1", "exact", "b", "exact*b")


@pytest.mark.parametrize("exponents", [((1, 1),), ((0, 0), (1, 1)), ((0, 0), (1, 0), (1, 1), (2, 0))])
def test_report_and_summary_of_a_model_without_margins(exponents):
    """With the interaction alone the gradient b (x2, x1) knows one direction only, at the centre none."""
    y = 1.0 + 2.0 * GRID.prod(axis=1) + NOISE
    fitted = fit_surface(SPACE, GRID, y, terms=Terms(exponents, (0, 0)), deterministic=False)
    json.dumps(fitted.report(), allow_nan=False)
    assert "a*b" in fitted.summary()


def test_the_stationary_point_of_an_interaction_alone():
    """Elsewhere the statistic is t^2 / 2: all that is uncertain is the coefficient."""
    y = 1.0 + 2.0 * GRID.prod(axis=1) + NOISE
    fitted = fit_surface(SPACE, GRID, y, terms=Terms(((0, 0), (1, 1)), (0, 0)), deterministic=False)
    t = fitted.t_values[1]
    at = stationary_statistic(fitted.surface, [[0.0, 0.0], [0.5, 0.2], [0.0, 1.0]])
    np.testing.assert_allclose(at, [0.0, t**2 / 2, t**2 / 2], rtol=1e-10)
    assert fitted.report()["stationary_point"]["coded"] == {"a": 0.0, "b": 0.0}


def test_exact_terms_on_the_command_line(tmp_path):
    """Coefficients worked out by hand: a*b and the constant are orthogonal on the 3^2 grid."""
    y = 1.0 + 2.0 * GRID.prod(axis=1) + NOISE
    table = tmp_path / "runs.csv"
    rows = "\n".join(f"{a},{b},{value!r}" for (a, b), value in zip(GRID, y.tolist(), strict=True))
    table.write_text(f"a,b,y\n{rows}\n", encoding="utf-8")
    words = ["fit", "--data", str(table), "--factors", "a,b", "--response", "y", "--exact-terms", "--json"]
    result = runner().invoke(main, [*words, "--terms", "a*b"])
    assert result.exit_code == 0, result.output
    terms = json.loads(result.stdout)["responses"]["y"]["terms"]
    assert [term["name"] for term in terms] == ["1", "a*b"]
    expected = [y.mean(), (GRID.prod(axis=1) @ y) / 4]
    assert [term["estimate"] for term in terms] == pytest.approx(expected, rel=1e-12)
    refused = runner().invoke(main, words)
    assert refused.exit_code == 2
    assert "needs --terms" in refused.stderr
