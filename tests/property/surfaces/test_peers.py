"""A table of finished runs, fitted through the command's own route, against statsmodels and numpy."""

import csv
import io
from itertools import combinations

import numpy as np
import pytest
import statsmodels.api as sm
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rsmkit.surfaces.tables.table_fit import fit_table

UNCHECKED = [HealthCheck.function_scoped_fixture, HealthCheck.too_slow]


@st.composite
def experiments(draw):
    """Composite designs with replicated centre, stray runs, blocks, weights, and any coding."""
    k = draw(st.integers(1, 4))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    cube = 2.0 * ((np.arange(2**k)[:, None] >> np.arange(k)) & 1) - 1.0
    stars = draw(st.floats(1.0, 2.0)) * np.vstack([np.eye(k), -np.eye(k)])
    stray = rng.uniform(-1.5, 1.5, (draw(st.integers(1, 8)), k))
    coded = np.vstack([cube, stars, np.zeros((draw(st.integers(1, 5)), k)), stray])
    center = rng.uniform(-100, 100, k)
    half = 10.0 ** rng.uniform(-2, 2, k)
    n = len(coded)
    blocks = rng.permutation(np.arange(n) % draw(st.integers(1, 3))) if draw(st.booleans()) else None
    weights = rng.uniform(0.5, 3, n) if draw(st.booleans()) else None
    y = 50 + rng.normal(size=k) @ coded.T + (coded**2) @ rng.normal(size=k) + rng.normal(size=n)
    return coded, center, half, y, blocks, weights


def write(path, coded, center, half, y, blocks, weights):
    """Natural units, every digit."""
    names = [f"f.{j}" for j in range(coded.shape[1])]
    columns = [*(center + half * coded).T.tolist(), y.tolist()]
    head = [*names, "y"]
    for name, values in (("day", blocks), ("w", weights)):
        if values is not None:
            head.append(name)
            columns.append(values.tolist())
    text = io.StringIO()
    csv.writer(text).writerows([head, *zip(*columns, strict=True)])
    path.write_text(text.getvalue(), encoding="utf-8")
    return names


def sums_by_group(x, y, weights, groups):
    """Sequential sums of squares by fitting again and again."""
    root = np.sqrt(weights)
    found, kept, before = {}, [], None
    for group in dict.fromkeys(groups):
        kept += [i for i, g in enumerate(groups) if g == group]
        matrix = x[:, kept] * root[:, None]
        rest = y * root - matrix @ np.linalg.lstsq(matrix, y * root, rcond=None)[0]
        if before is not None:
            found[group] = before - rest @ rest
        before = rest @ rest
    return found


@pytest.mark.slow
@settings(max_examples=40, suppress_health_check=UNCHECKED)
@given(experiments())
def test_everything_the_report_promises(tmp_path, experiment):
    coded, center, half, y, blocks, weights = experiment
    names = write(tmp_path / "runs.csv", *experiment)
    k, w = coded.shape[1], np.ones(len(y)) if weights is None else weights
    days = [] if blocks is None else sorted(set(blocks.tolist()))[1:]
    report = fit_table(
        tmp_path / "runs.csv",
        names,
        ["y"],
        coding={name: (c, h) for name, c, h in zip(names, center, half, strict=True)},
        blocks=None if blocks is None else "day",
        weights=None if weights is None else "w",
    ).report()["responses"]["y"]

    pairs = list(combinations(range(k), 2))
    columns = [np.ones(len(y)), *((blocks == day).astype(float) for day in days), *coded.T]
    columns += [*(coded[:, i] * coded[:, j] for i, j in pairs), *(coded**2).T]
    labels = ["1", *(f"block[{day}]" for day in days), *names]
    labels += [*(f"{names[i]}*{names[j]}" for i, j in pairs), *(f"{name}^2" for name in names)]
    groups = ["1", *["block"] * len(days), *["FO"] * k, *["TWI"] * len(pairs), *["PQ"] * k]
    x = np.column_stack(columns)
    peer = sm.WLS(y, x, weights=w).fit(method="qr")

    terms = {term["name"]: term for term in report["terms"]}
    assert list(terms) == labels
    scale = np.abs(peer.params).max()
    for i, label in enumerate(labels):
        assert terms[label]["estimate"] == pytest.approx(peer.params[i], rel=1e-8, abs=1e-9 * scale)
        if peer.df_resid:
            assert terms[label]["std_error"] == pytest.approx(peer.bse[i], rel=1e-7)
            assert terms[label]["p"] == pytest.approx(peer.pvalues[i], rel=1e-6, abs=1e-12)
    assert report["df"] == peer.df_resid
    assert report["r2"] == pytest.approx(peer.rsquared, rel=1e-8)
    if not peer.df_resid:
        return
    assert report["sigma"] == pytest.approx(np.sqrt(peer.scale), rel=1e-8)
    assert report["r2_adjusted"] == pytest.approx(peer.rsquared_adj, rel=1e-8)
    left_out = [
        y[i] - x[i] @ sm.WLS(np.delete(y, i), np.delete(x, i, 0), weights=np.delete(w, i)).fit().params
        for i in range(len(y))
    ]
    if np.isfinite(report["press"] or np.nan) and np.max(report["diagnostics"]["leverage"]) < 1 - 1e-6:
        assert report["press"] == pytest.approx(np.square(left_out).sum(), rel=1e-6)
    for group, squares in sums_by_group(x, y, w, groups).items():
        assert report["anova"][group]["ss"] == pytest.approx(squares, rel=1e-6, abs=1e-9 * scale**2)
    curvature = np.diag(peer.params[-k:])
    for (i, j), value in zip(pairs, peer.params[-k - len(pairs) : -k], strict=True):
        curvature[i, j] = curvature[j, i] = value / 2
    eigenvalues = np.linalg.eigvalsh(curvature)[::-1]
    np.testing.assert_allclose(report["eigenvalues"], eigenvalues, rtol=1e-7, atol=1e-8 * scale)
    slope = peer.params[1 + len(days) : 1 + len(days) + k]
    if np.abs(eigenvalues).min() > 1e-3 * np.abs(eigenvalues).max():
        point = np.linalg.solve(curvature, -0.5 * slope)
        np.testing.assert_allclose(
            list(report["stationary_point"]["coded"].values()), point, rtol=1e-5, atol=1e-8
        )
        np.testing.assert_allclose(
            list(report["stationary_point"]["natural"].values()),
            center + half * point,
            rtol=1e-5,
            atol=1e-8 * np.abs(half).max(),
        )


@pytest.mark.slow
@settings(max_examples=40, suppress_health_check=UNCHECKED)
@given(st.integers(0, 2**32 - 1), st.integers(2, 3), st.booleans(), st.booleans())
def test_lack_of_fit_against_a_model_of_cells_and_blocks(tmp_path, seed, k, with_blocks, with_weights):
    """Pure error is what is left by one mean per point and one shift per block."""
    rng = np.random.default_rng(seed)
    points = rng.integers(-1, 2, (14 + 4 * k, k)).astype(float)
    points = np.vstack([points, points[:6]])
    n = len(points)
    blocks = rng.integers(1, 4, n) if with_blocks else None
    weights = rng.uniform(0.5, 3, n) if with_weights else None
    y = points.sum(axis=1) + rng.normal(size=n)
    names = write(tmp_path / "runs.csv", points, np.zeros(k), np.ones(k), y, blocks, weights)
    report = fit_table(
        tmp_path / "runs.csv",
        names,
        ["y"],
        order=1,
        blocks="day" if with_blocks else None,
        weights="w" if with_weights else None,
    ).report()["responses"]["y"]
    cells = np.unique(points, axis=0, return_inverse=True)[1].reshape(-1)
    model = np.eye(cells.max() + 1)[cells]
    if with_blocks:
        model = np.column_stack([model, *((blocks == day).astype(float) for day in np.unique(blocks)[1:])])
    root = np.ones(n) if weights is None else np.sqrt(weights)
    weighted = model * root[:, None]
    rest = y * root - weighted @ np.linalg.lstsq(weighted, y * root, rcond=None)[0]
    pure_df = n - np.linalg.matrix_rank(weighted)
    lack_df = report["df"] - pure_df
    found = report["lack_of_fit"]
    if pure_df == 0 or lack_df == 0:
        assert "reason" in found
        return
    squares = report["anova"]["residual"]["ss"] - rest @ rest
    assert found["df"] == [lack_df, pure_df]
    assert found["F"] == pytest.approx(squares / lack_df / (rest @ rest / pure_df), rel=1e-7)
