"""What the README shows works as it is shown."""

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from rsmkit.stages.new import create_study
from rsmkit.study import load_study

README = (Path(__file__).parents[2] / "README.md").read_text()


def blocks(language):
    return re.findall(rf"```{language}\n(.*?)```", README, re.DOTALL)


@pytest.mark.slow
@pytest.mark.e2e
@pytest.mark.parametrize("code", blocks("python"), ids=lambda code: code.splitlines()[0])
def test_python_examples_run(code, tmp_path):
    create_study(tmp_path)
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_the_study_file_shown_is_in_order(tmp_path):
    (shown,) = blocks("toml")
    create_study(tmp_path)
    (tmp_path / "study.toml").write_text(shown)
    study = load_study(tmp_path)
    assert list(study.responses) == list(tomllib.loads(shown)["responses"])
