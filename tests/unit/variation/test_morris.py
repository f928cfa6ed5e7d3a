"""Morris screening."""

import json

import numpy as np
import pytest
from click.testing import CliRunner
from served_study import STUDY

import rsmkit as rk
from rsmkit.cli import main

SPACE = rk.Space(a=(0.0, 10.0), b=(-1.0, 1.0), c=(0.0, 1.0))


def test_each_step_changes_one_factor_by_two_thirds_of_its_range():
    paths = rk.morris(SPACE, paths=6, seed=3)
    assert paths.points.shape == (24, 3)
    assert SPACE.contains(paths.points).all()
    steps = np.diff(paths.points.reshape(6, 4, 3), axis=1)
    assert ((steps != 0).sum(axis=2) == 1).all()
    sizes = np.abs(steps).max(axis=1) / (SPACE.highs - SPACE.lows)
    assert sizes == pytest.approx(2.0 / 3.0)


def test_effects_of_a_line_a_parabola_and_nothing():
    paths = rk.morris(SPACE, paths=40, seed=1)
    a, b, _ = paths.points.T
    found = rk.elementary_effects(paths, 3.0 * a + b**2)
    # over the whole range a line of slope 3 gains 30
    assert (found["a"].mean, found["a"].mean_size) == (pytest.approx(30.0), pytest.approx(30.0))
    assert found["a"].sd == pytest.approx(0.0, abs=1e-9)
    # b^2 over levels -1, -1/3, 1/3, 1 and steps of 4/3: (1/9 - 1) or (1 - 1/9) over 2/3 of the range
    assert found["b"].mean_size == pytest.approx(4.0 / 3.0)
    assert abs(found["b"].mean) < 4.0 / 3.0 * 3.0 / 40**0.5
    assert found["b"].sd > 1.0
    assert found["c"].mean_size == 0.0


def test_failed_runs_cost_their_steps():
    paths = rk.morris(SPACE, paths=5)
    values = paths.points[:, 0].copy()
    values[1] = np.nan
    found = rk.elementary_effects(paths, values)
    assert sum(own.count for own in found.values()) == 15 - 2
    with pytest.raises(rk.RsmkitError, match="fewer than two steps of a succeeded"):
        rk.elementary_effects(paths, np.full(20, np.nan))
    with pytest.raises(rk.RsmkitError, match="paths must be at least 2"):
        rk.morris(SPACE, paths=1)


def test_the_command_screens_without_a_design(tmp_path):
    (tmp_path / "study.toml").write_text(STUDY)
    done = CliRunner().invoke(main, ["screen", str(tmp_path), "--paths", "3", "-j", "1"])
    assert done.exit_code == 0, done.output
    document = json.loads((tmp_path / "screening.json").read_text())
    effects = document["responses"]["mass_kg"]
    assert effects["width_mm"]["mean_size"] > effects["height_mm"]["mean_size"] > 0.0
    assert len((tmp_path / "runs.jsonl").read_text().splitlines()) <= 10  # 9 runs and the head of the journal
