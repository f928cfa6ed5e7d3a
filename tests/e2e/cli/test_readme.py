"""What the README shows works as it is shown."""

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from rsmkit.stages.new import create_study
from rsmkit.study.file import load_study

README = (Path(__file__).parents[3] / "README.md").read_text()


def blocks(language):
    return re.findall(rf"```{language}\n(.*?)```", README, re.DOTALL)


@pytest.mark.slow
@pytest.mark.e2e
@pytest.mark.parametrize("code", blocks("python"), ids=lambda code: code.splitlines()[0])
def test_python_examples_run(code, tmp_path):
    create_study(tmp_path)
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def without_noise(text):
    """Leave out durations, and numbers that are nothing but rounding."""
    return re.sub(r"in [\d.]+ s|[\d.]+ m?s each|\S+e-\d\d|[\d.]+ % of the time", "-", text).rstrip()


@pytest.mark.slow
@pytest.mark.e2e
def test_the_four_stages_say_what_is_shown(rsmkit):
    rsmkit("new", "my-study")
    shown = [block.split("\n", 1) for block in blocks("text")]
    assert [command.split()[2] for command, _ in shown] == ["plan", "evaluate", "fit", "verify"]
    for command, text in shown:
        assert without_noise(rsmkit(*command.split()[2:]).stdout) == without_noise(text)


def test_the_study_file_shown_is_in_order(tmp_path):
    (shown,) = blocks("toml")
    create_study(tmp_path)
    (tmp_path / "study.toml").write_text(shown)
    study = load_study(tmp_path)
    assert list(study.responses) == list(tomllib.loads(shown)["responses"])
