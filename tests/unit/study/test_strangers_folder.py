"""A folder that a stranger has packed is safe to look at: no link is followed, no pipe is waited for."""

import json
import os
import re
import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner

from rsmkit.cli.commands import main
from rsmkit.errors import RsmkitError
from rsmkit.io.files.regular_files import inside, open_regular, read_regular
from rsmkit.stages.new import create_study

SECRET = "the secret of this computer\n"
LOOKS = (["status"], ["explore", "--no-open"], ["evaluate", "--dry-run"])


def say(*command):
    done = CliRunner().invoke(main, [str(word) for word in command])
    assert done.exception is None or isinstance(done.exception, SystemExit), done.exception
    assert "defect" not in done.output, done.output
    return done


@pytest.fixture(scope="module")
def finished_once(tmp_path_factory):
    folder = tmp_path_factory.mktemp("finished") / "study"
    create_study(folder)
    assert say("run", folder, "-j", "1", "-q").exit_code == 0
    return folder


@pytest.fixture
def folder(finished_once, tmp_path):
    (tmp_path / "secret.txt").write_text(SECRET)
    return Path(shutil.copytree(finished_once, tmp_path / "study"))


def harmless(folder):
    assert (folder.parent / "secret.txt").read_text() == SECRET
    for path in folder.rglob("*"):
        if path.is_file() and not path.is_symlink():
            assert SECRET.strip().encode() not in path.read_bytes(), path


NAMES = [
    "study.toml",
    "design.csv",
    "plan.json",
    "runs.jsonl",
    "runs.jsonl.lock",
    "model.json",
    "optimum.json",
    "verification.json",
    "refinement.json",
    "rsmkit.log",
]


@pytest.mark.parametrize("name", NAMES)
def test_no_link_is_followed_under_any_of_our_names(folder, name):
    (folder / name).unlink(missing_ok=True)
    (folder / name).symlink_to("../secret.txt")
    for command in LOOKS:
        assert SECRET.strip() not in say(*command, folder).output
    (folder.parent / "sheet.csv").write_text("width_mm,height_mm,mass_kg,sag_mm,stress_MPa\n40,100,1,2,3\n")
    say("record", folder.parent / "sheet.csv", folder)
    harmless(folder)


@pytest.mark.parametrize("name", NAMES)
def test_no_pipe_is_waited_for_under_any_of_our_names(folder, name):
    (folder / name).unlink(missing_ok=True)
    os.mkfifo(folder / name)
    for command in LOOKS:
        say(*command, folder)


@pytest.mark.parametrize("name", ["rsmkit.log", "runs.jsonl.lock"])
def test_what_is_written_never_goes_to_another_file_by_a_second_name(folder, name):
    (folder / name).unlink(missing_ok=True)
    os.link(folder.parent / "secret.txt", folder / name)
    if name == "rsmkit.log":
        say("status", folder)
        assert (folder.parent / "secret.txt").read_text() == SECRET
        return
    by_hand = re.sub(r"(?ms)^\[simulator\].*?(?=^\[factors)", "", (folder / "study.toml").read_text())
    (folder / "study.toml").write_text(by_hand)
    (folder.parent / "sheet.csv").write_text("width_mm,height_mm,mass_kg,sag_mm,stress_MPa\n40,100,1,2,3\n")
    said = say("record", folder.parent / "sheet.csv", folder)
    assert said.exit_code == 2
    assert "another name of another file" in said.output
    assert (folder.parent / "secret.txt").read_text() == SECRET


KEYS = {
    "design.file": ("[design]", "[design]\nfile = '{}'"),
    "explorer.scene": ("[verify]", "[explorer]\nscene = '{}'\n[verify]"),
    "simulator.inputs": (
        'run           = "simulator:cantilever"',
        "command = 'cat in'\ninputs = {{in = '{}'}}",
    ),
}


@pytest.mark.parametrize("key", KEYS)
@pytest.mark.parametrize(
    "name", ["../secret.txt", "link.txt", "linked/secret.txt", "{absolute}", "pipe", "/dev/zero"]
)
def test_nothing_outside_the_folder_is_read_for_a_study(folder, key, name):
    (folder / "link.txt").symlink_to("../secret.txt")
    (folder / "linked").symlink_to("..")
    os.mkfifo(folder / "pipe")
    old, new = KEYS[key]
    name = name.replace("{absolute}", str(folder.parent / "secret.txt"))
    text = (folder / "study.toml").read_text()
    if key == "design.file":
        text = (
            text.replace('kind       = "ccd"', "").replace("star       =", "# ").replace("center     =", "# ")
        )
        text = text.replace("augment_to =", "# ").replace("[design]", "[design]\nkind = 'file'")
    (folder / "study.toml").write_text(text.replace(old, new.format(name), 1))
    for command in (["plan"], ["explore", "--no-open"], ["check"]):
        said = say(*command, folder).output
        assert SECRET.strip() not in said
    harmless(folder)
    (folder / "pipe").unlink()


def test_the_folder_of_details_may_be_no_link(folder):
    elsewhere = folder.parent / "elsewhere"
    elsewhere.mkdir()
    (folder / "runs").symlink_to("../elsewhere")
    (folder / "simulator.py").write_text("def cantilever(**all):\n    raise ValueError('no')\n")
    (folder / "runs.jsonl").unlink()
    say("evaluate", folder, "-j", "1", "--limit", "1")
    assert list(elsewhere.iterdir()) == []


def test_only_regular_files_are_opened(tmp_path):
    (tmp_path / "file").write_text("whole")
    (tmp_path / "link").symlink_to("file")
    os.mkfifo(tmp_path / "pipe")
    assert read_regular(tmp_path / "file") == b"whole"
    for name, words in {"link": "links are not followed", "pipe": "not a file", ".": "a folder"}.items():
        with pytest.raises(OSError, match=words):
            open_regular(tmp_path / name)
    with pytest.raises(OSError, match="at most 0"):
        read_regular(tmp_path / "file", 4)
    with pytest.raises(RsmkitError, match="lies outside the study's folder"):
        inside(tmp_path / "study", "../file", "design.file")


@pytest.mark.parametrize(
    ("name", "damage"),
    [
        ("optimum.json", lambda text: text.replace('"lightest"', '"\\ud800"', 1)),
        ("plan.json", lambda text: text.replace('"runs": 14', '"runs": "many"', 1)),
        ("verification.json", lambda text: text.replace('"sentence": "', '"sentence": "\\udfff', 1)),
        ("model.json", lambda text: text.replace('"response": "mass_kg"', '"response": "\\udc00"', 1)),
    ],
)
def test_half_a_character_or_a_text_for_a_number_is_one_message(folder, name, damage):
    text = (folder / name).read_text()
    assert damage(text) != text
    (folder / name).write_text(damage(text))
    for command in LOOKS:
        say(*command, folder)
    assert "damaged" in "".join(say(*command, folder).output for command in (["status"], ["verify"]))


def test_any_number_of_the_plan_may_be_a_text(folder):
    plan = json.loads((folder / "plan.json").read_text())
    for key in plan["quality"]:
        (folder / "plan.json").write_text(json.dumps(plan | {"quality": plan["quality"] | {key: "text"}}))
        say("status", folder)
    for key in plan:
        (folder / "plan.json").write_text(json.dumps(plan | {key: "text"}))
        say("status", folder)
