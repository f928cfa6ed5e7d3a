"""Driving the real command line in a child process."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from rsmkit.stages.new import create_study

COMMAND = [sys.executable, "-m", "rsmkit"]


class CommandLine:
    """Runs ``rsmkit`` in a folder and keeps what it said."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.environment = {**os.environ, "NO_COLOR": "1", "COLUMNS": "160", "OMP_NUM_THREADS": "1"}

    def __call__(self, *arguments: str, expect: int = 0, **options) -> subprocess.CompletedProcess[str]:
        done = subprocess.run(
            [*COMMAND, *arguments],
            cwd=self.folder,
            env=self.environment,
            capture_output=True,
            text=True,
            timeout=300,
            **options,
        )
        assert done.returncode == expect, f"exit {done.returncode}\n{done.stdout}\n{done.stderr}"
        assert "Traceback" not in done.stdout + done.stderr
        return done

    def json(self, *arguments: str, expect: int = 0) -> dict:
        """Run with ``--json``; stdout must be exactly one document."""
        return json.loads(self(*arguments, "--json", expect=expect).stdout)

    def start(self, *arguments: str) -> subprocess.Popen:
        """Start without waiting, in a process group of its own."""
        return subprocess.Popen(
            [*COMMAND, *arguments],
            cwd=self.folder,
            env=self.environment,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )


@pytest.fixture
def rsmkit(tmp_path):
    return CommandLine(tmp_path)


@pytest.fixture
def study(rsmkit):
    """A fresh copy of the example study; its folder."""
    create_study(rsmkit.folder / "study")
    return rsmkit.folder / "study"


@pytest.fixture(scope="session")
def finished_once(tmp_path_factory):
    """The example study, run once for the whole session."""
    folder = tmp_path_factory.mktemp("finished")
    command = CommandLine(folder)
    command("new", "study")
    document = command.json("run", "study")
    return folder / "study", document


@pytest.fixture
def finished(rsmkit, finished_once):
    """A copy of the finished example study, free to be changed; its folder."""
    return Path(shutil.copytree(finished_once[0], rsmkit.folder / "study"))
