"""What nodes and the driver of an array of jobs read in each other's files."""

import shutil

import pytest

from rsmkit.errors import RsmkitError
from rsmkit.runs.backends.queues import array_jobs
from rsmkit.runs.backends.queues.array_jobs import open_waves, remove_recorded, write_wave
from rsmkit.runs.one_run.execute import Task
from rsmkit.runs.one_run.simulator import Simulator
from rsmkit.runs.options import SimulatorOptions


@pytest.fixture
def simulator(tmp_path):
    """Never run here."""
    return Simulator(SimulatorOptions(run="s:f"), tmp_path)


def test_what_cannot_be_loaded_on_a_node_is_said_by_the_driver(tmp_path):
    simulator = Simulator(SimulatorOptions(run="no_such_module:f"), tmp_path)
    wave = write_wave(tmp_path / "queue", "slurm", simulator, ("y",), [[Task("0" * 16, {"a": 0.0})]], 1)
    wave.task_file(1).open()
    file = wave.task_file(1)
    file.open()
    file.fail("module no_such_module cannot be imported")
    told = wave.task_file(1)
    assert list(told.read_on()) == []
    assert told.error == "module no_such_module cannot be imported"


def test_damaged_waves_are_none_of_ours(tmp_path, simulator):
    task = Task("0" * 16, {"a": 0.0, "b": 0.0})
    wave = write_wave(tmp_path / "queue", "slurm", simulator, ("y",), [[task]], 1)
    assert [found.name for found in open_waves(tmp_path / "queue", simulator)] == [wave.name]
    (wave.path / "wave.json").write_text('{"system": 5}')
    assert list(open_waves(tmp_path / "queue", simulator)) == []
    (tmp_path / "link").symlink_to(tmp_path / "queue")
    with pytest.raises(RsmkitError, match="link"):
        list(open_waves(tmp_path / "link", simulator))


class Death(BaseException):
    """Of a driver."""


def die(*_, **__):
    raise Death


@pytest.mark.parametrize("doing", ["making", "removing"])
def test_a_driver_that_dies_over_a_folder_leaves_it_to_its_next_one(tmp_path, simulator, doing):
    home, other = tmp_path / "queue", Simulator(SimulatorOptions(run="s:f"), tmp_path / "other")
    other.folder.mkdir()
    task = Task("0" * 16, {"a": 0.0})
    place, word = (array_jobs, "write_json") if doing == "making" else (shutil, "rmtree")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(place, word, die)
        with pytest.raises(Death):
            write_wave(home, "slurm", simulator, ("y",), [[task]], 1).remove()
    assert len(list(home.iterdir())) == 1
    remove_recorded(home, other, {})
    assert len(list(home.iterdir())) == 1
    remove_recorded(home, simulator, {})
    assert list(home.iterdir()) == []


def test_what_a_hostile_task_file_holds_is_passed_over(tmp_path, simulator):
    wave = write_wave(tmp_path / "queue", "slurm", simulator, ("y",), [[]], 1)
    path = wave.path / "1.jsonl"
    path.write_text('[]\n{"run": 5}\n{"run": {"schema": 1}}\nnonsense\n{"begun": ["x"]}\n17\n')
    assert list(wave.task_file(1).read_on()) == []
