"""Tables of mixtures: what is refused and noticed, and that files hold what was fitted."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import rsmkit as rk
from rsmkit.errors import FitError, RsmkitError
from rsmkit.surfaces.choose import choose_surface
from rsmkit.surfaces.fitted_response import surface_from_json
from rsmkit.surfaces.models.reduction.reduced import reduce_surface
from rsmkit.surfaces.options import SurfaceOptions

BLENDS = np.array(
    [[1, 0, 0], [0, 1, 0], [0, 0, 1], [0.5, 0.5, 0], [0.5, 0, 0.5], [0, 0.5, 0.5],
     [0.2, 0.2, 0.6], [0.2, 0.6, 0.2], [0.6, 0.2, 0.2], [0.2, 0.2, 0.6]]
)  # fmt: skip
NOISE = np.array([0.3, -0.2, 0.1, 0.0, -0.1, 0.2, -0.3, 0.1, 0.0, 0.2])


def table(path: Path, amounts: np.ndarray, y: np.ndarray, **more: np.ndarray) -> Path:
    names = ["a", "b", "c"][: amounts.shape[1]]
    columns = np.column_stack([amounts, *more.values(), y])
    lines = [",".join([*names, *more, "y"]), *(",".join(f"{x:.12g}" for x in row) for row in columns)]
    path.write_text("\n".join(lines))
    return path


def truth(x: np.ndarray) -> np.ndarray:
    return x @ [3.0, 5.0, 9.0] + 12 * x[:, 0] * x[:, 1] + NOISE[: len(x)]


@pytest.fixture
def percent(tmp_path: Path) -> Path:
    return table(tmp_path / "percent.csv", 100 * BLENDS, truth(BLENDS))


def test_percents_are_proportions_of_a_hundred(percent: Path, tmp_path: Path) -> None:
    """Coefficients of proportions are the same; those of amounts smaller by 100 per component."""
    whole = rk.fit_table(percent, [], ["y"], mixture=["a", "b", "c"]).report()["responses"]["y"]
    parts = table(tmp_path / "parts.csv", BLENDS, truth(BLENDS))
    shares = rk.fit_table(parts, [], ["y"], mixture=["a", "b", "c"]).report()["responses"]["y"]
    assert whole["mixture"]["total"] == 100.0
    for ours, theirs in zip(whole["terms"], shares["terms"], strict=True):
        assert ours["estimate"] == pytest.approx(theirs["estimate"], rel=1e-10)
    natural = {row["name"]: row["estimate"] for row in whole["terms_natural"]}
    estimates = {row["name"]: row["estimate"] for row in whole["terms"]}
    assert natural["a"] == pytest.approx(estimates["a"] / 100)
    assert natural["a*b"] == pytest.approx(estimates["a*b"] / 100**2)


def test_a_sum_that_nobody_named_is_said(percent: Path) -> None:
    notes = rk.fit_table(percent, ["a", "b"], ["y"]).notes
    assert not any("mixture" in note for note in notes)
    with pytest.raises(FitError, match=r"a \+ b \+ c is 100 in every run: a mixture.*--mixture a,b,c"):
        rk.fit_table(percent, ["a", "b", "c"], ["y"])
    notes = rk.fit_table(percent, ["a", "b", "c"], ["y"], terms=["0", "FO"]).notes
    assert any("--mixture a,b,c" in note for note in notes)


def test_rows_that_do_not_add_up_are_named(tmp_path: Path) -> None:
    amounts = BLENDS.copy()
    amounts[3, 2] = 0.1
    wrong = table(tmp_path / "wrong.csv", amounts, truth(BLENDS))
    with pytest.raises(RsmkitError, match=r"a \+ b \+ c is 1 in most rows, but not in row 4 \(1.1\)"):
        rk.fit_table(wrong, [], ["y"], mixture=["a", "b", "c"])
    assert rk.fit_table(wrong, [], ["y"], mixture=["a", "b", "c"], exclude=[4]).report()


def test_digits_that_are_not_printed_are_no_mistake(tmp_path: Path) -> None:
    amounts = np.round(np.vstack([BLENDS, np.full((1, 3), 1 / 3)]), 3)
    fit = rk.fit_table(
        table(tmp_path / "t.csv", amounts, np.append(truth(BLENDS), 7.0)), [], ["y"], mixture=["a", "b", "c"]
    )
    assert any("digits that are not printed, in rows 11 (0.999)" in note for note in fit.notes)
    y = fit.surfaces["y"].data.y
    columns = np.column_stack([amounts, amounts[:, [0]] * amounts[:, [1, 2]], amounts[:, 1] * amounts[:, 2]])
    left = y - columns @ np.linalg.lstsq(columns, y, rcond=None)[0]
    report = fit.report()["responses"]["y"]
    assert report["r2"] == pytest.approx(1 - left @ left / ((y - y.mean()) ** 2).sum(), rel=1e-10)


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ({"mixture": ["a"]}, "two or more"),
        ({"mixture": ["a", "b", "c"], "blocks": "day"}, "--random day"),
        ({"mixture": ["a", "b", "c"], "coding": {"a": (0.5, 0.5)}}, "no coding"),
        ({"mixture": ["a", "b", "c"], "categorical": ["b"]}, "no names"),
        ({"mixture": ["a", "b", "c"], "terms": ["a^2"]}, "squares"),
        ({"mixture": ["a", "b", "c"], "order": 4}, "order 1 to 3"),
        ({"mixture": ["a", "b", "c"], "model": "quadratic"}, "scheffe-quadratic"),
        ({"mixture": ["a", "b", "c"], "model": "scheffe-linear", "terms": ["a*b"]}, "not both"),
        ({"model": "scheffe-linear"}, "--mixture a,b,c"),
        ({"mixture": ["a", "b", "c"], "means": ["a"]}, "mean"),
        ({"mixture": ["a", "b", "c"], "together": ["FO"]}, "linear blending"),
    ],
)
def test_what_means_nothing_is_refused(percent: Path, asked: dict[str, object], message: str) -> None:
    factors = [] if "mixture" in asked else ["a", "b"]
    with pytest.raises(RsmkitError, match=message):
        rk.fit_table(percent, factors, ["y"], **asked).report()  # type: ignore[arg-type]


def test_a_component_that_never_varies_is_named(tmp_path: Path) -> None:
    amounts = np.column_stack([0.9 * BLENDS[:, :2] + 0.45 * BLENDS[:, 2:], np.full(len(BLENDS), 0.1)])
    with pytest.raises(RsmkitError, match=r"component c is 0\.1 in every run.*leave it out"):
        rk.fit_table(table(tmp_path / "t.csv", amounts, NOISE), [], ["y"], mixture=["a", "b", "c"])


def test_a_term_that_cannot_be_estimated_is_named(tmp_path: Path) -> None:
    edges = BLENDS[:6]
    with pytest.raises(FitError, match=r"a\*b\*c \(does not vary\).*--model scheffe-quadratic"):
        rk.fit_table(
            table(tmp_path / "t.csv", np.vstack([edges, edges]), np.append(truth(edges), truth(edges) + 0.1)),
            [],
            ["y"],
            mixture=["a", "b", "c"],
            model="scheffe-special-cubic",
        )


def test_linear_blending_is_never_left_out(percent: Path) -> None:
    fit = rk.fit_table(percent, [], ["y"], mixture=["a", "b", "c"], model="scheffe-special-cubic")
    for method in ("aicc", "backward", "forward", "all"):
        kept = reduce_surface(fit.surfaces["y"].surface, method).surface  # type: ignore[arg-type]
        assert set(kept.names) >= {"a", "b", "c"}
        assert "a*b" in kept.names


@pytest.mark.parametrize("model", ["scheffe-quadratic", "scheffe-special-cubic"])
def test_files_hold_the_same_surface(percent: Path, model: str) -> None:
    surface = rk.fit_table(percent, [], ["y"], mixture=["a", "b", "c"], model=model).surfaces["y"]
    again = surface_from_json(json.loads(json.dumps(surface.to_json())))
    x = surface.data.points
    assert (again.predict(x) == surface.predict(x)).all()
    assert again.space == surface.space
    assert again.report() == surface.report()


def test_auto_compares_blending_models_and_stretches_no_component() -> None:
    space = rk.Space(a=(0, 1), b=(0, 1), c=(0, 1)).mixture("a", "b", "c")
    x = np.vstack([BLENDS, BLENDS[::-1] * 0.6 + BLENDS * 0.4])
    y = truth(x[:10]), x[10:] @ [3.0, 5.0, 9.0] + 12 * x[10:, 0] * x[10:, 1] + NOISE[::-1]
    options = SurfaceOptions(model="auto")
    choice = choose_surface(space, x, np.concatenate(y), options=options, deterministic=False)
    rows = {row.model: row for row in choice.table}
    assert np.isfinite([rows[word].rmse_loo for word in ("polynomial", "reduced", "special cubic")]).all()
    assert "keep to a sum" in rows["stretched"].remark
    assert np.isnan(rows["stretched"].rmse_loo)


@pytest.fixture
def process(tmp_path: Path) -> Path:
    """Twenty blends at two temperatures, on four days."""
    amounts, z = np.vstack([BLENDS, BLENDS]), np.repeat([20.0, 80.0], 10)
    y = np.concatenate([truth(BLENDS), truth(BLENDS)[::-1][np.argsort(np.arange(10)[::-1])] + 0.4])
    day = np.tile([1.0, 2.0, 3.0, 4.0], 5)
    return table(tmp_path / "process.csv", amounts, y + 0.3 * day, z=z, day=day)


def test_two_values_of_a_process_factor_have_no_square(process: Path) -> None:
    fit = rk.fit_table(process, ["z"], ["y"], mixture=["a", "b", "c"])
    assert "z^2" not in fit.surfaces["y"].names
    assert any("z takes too few values" in note for note in fit.notes)


def test_random_groups_are_tested_about_the_mean_blend(process: Path) -> None:
    report = rk.fit_table(process, ["z"], ["y"], mixture=["a", "b", "c"], random=["day"]).report()
    found = report["responses"]["y"]
    tests = {row["term"]: row for row in found["anova_terms"]}
    assert tests["linear blending"]["df"] == 2
    assert found["mixture"]["total"] == 1.0
    assert "trade off" in found["ascent"]["reason"]


def test_counts_of_blends_are_tested_against_one_rate(tmp_path: Path) -> None:
    """Linear blending against a constant rate: R's ``anova(glm(y ~ 1), glm(y ~ -1 + a + b + c))``."""
    counts = np.array([4, 9, 15, 7, 9, 12, 13, 8, 5, 10.0])
    path = table(tmp_path / "counts.csv", BLENDS, counts)
    report = rk.fit_table(path, [], ["y"], mixture=["a", "b", "c"], order=1, distribution="poisson").report()
    found = report["responses"]["y"]
    rate = counts.mean()
    null = 2 * float((counts * np.log(counts / rate)).sum())
    assert found["null_deviance"] == pytest.approx(null, rel=1e-10)
    row = found["anova_terms"][0]
    assert (row["term"], row["df"]) == ("linear blending", 2)
    assert row["chi2"] == pytest.approx(null - found["deviance"], rel=1e-10)


def test_means_of_process_factors_are_those_of_the_average_blend(process: Path) -> None:
    fit = rk.fit_table(process, ["z"], ["y"], mixture=["a", "b", "c"], means=["z"])
    levels = fit.report()["responses"]["y"]["means"]["z"]["levels"]
    middle = np.append(BLENDS.mean(axis=0), 0.0)
    for level, z in zip(levels, (20.0, 80.0), strict=True):
        middle[3] = z
        assert level["mean"] == pytest.approx(fit.surfaces["y"].predict(middle[None])[0], rel=1e-10)


def test_many_printed_digits_do_not_make_a_sum_wrong(tmp_path: Path) -> None:
    """Ten significant digits of small and large amounts have different last places."""
    amounts = np.random.default_rng(4).dirichlet(np.ones(3), 20)
    path = tmp_path / "digits.csv"
    rows = [",".join([*(f"{x:.10g}" for x in row), f"{row[0]:.6g}"]) for row in amounts]
    path.write_text("\n".join(["a,b,c,y", *rows]))
    assert not rk.fit_table(path, [], ["y"], mixture=["a", "b", "c"]).notes


def test_columns_without_a_common_total_are_no_mixture(tmp_path: Path) -> None:
    amounts = BLENDS * np.linspace(0.5, 2.0, 10)[:, None]
    with pytest.raises(RsmkitError, match=r"is no constant, from 0\.5 to 2"):
        rk.fit_table(table(tmp_path / "t.csv", amounts, NOISE), [], ["y"], mixture=["a", "b", "c"])


def test_the_text_has_each_equation_that_differs(percent: Path, tmp_path: Path) -> None:
    text = rk.fit_table(percent, [], ["y"], mixture=["a", "b", "c"]).summary()
    assert "  proportions: y = " in text
    assert "  amounts:     y = " in text
    parts = table(tmp_path / "parts.csv", 0.7 * BLENDS + 0.1, truth(BLENDS))
    text = rk.fit_table(parts, [], ["y"], mixture=["a", "b", "c"]).summary()
    assert "  pseudo:      y = " in text
    assert "amounts:" not in text


def test_one_row_is_no_mixture(tmp_path: Path) -> None:
    (tmp_path / "one.csv").write_text("a,b,c,y\n0.2,0.3,0.5,3\n")
    with pytest.raises(RsmkitError, match=r"one run tells nothing .* add at least 2 runs with other prop"):
        rk.fit_table(tmp_path / "one.csv", [], ["y"], mixture=["a", "b", "c"])
