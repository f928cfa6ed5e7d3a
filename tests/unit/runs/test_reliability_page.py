"""The documentation of the runs says what the code says."""

import doctest
import importlib.util
import re
import tomllib
from dataclasses import dataclass
from pathlib import Path

from rsmkit.io.toml_tables import read_tables
from rsmkit.runs.options import SimulatorOptions

ROOT = Path(__file__).parents[3]


def reliability():
    spec = importlib.util.spec_from_file_location(
        "runs_reliability", ROOT / "benchmarks" / "runs_reliability.py"
    )
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_table_of_faults_is_current():
    assert reliability().table() in (ROOT / "docs" / "reliability.md").read_text()


def test_every_fault_has_its_test():
    for fault, _, _, test in reliability().FAULTS:
        file, _, name = test.partition("::")
        assert f"def {name.partition('[')[0]}" in (ROOT / file).read_text(), fault


def test_the_examples_for_simulators_run():
    page = ROOT / "docs" / "simulators.md"
    results = doctest.testfile(str(page), module_relative=False)
    assert results.attempted > 0
    assert results.failed == 0


def test_the_study_files_shown_are_in_order():
    shown = re.findall(r"```toml\n(.*?)```", (ROOT / "docs" / "simulators.md").read_text(), re.DOTALL)
    assert len(shown) == 2
    for text in shown:
        parts, problems = read_tables(tomllib.loads(text), Shown)
        assert problems == []
        assert parts["simulator"].timeout_s is not None


@dataclass(frozen=True)
class Shown:
    simulator: SimulatorOptions
