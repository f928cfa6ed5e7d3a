"""Study files and artefacts as disks, editors and attackers leave them: a clear refusal, or they work.

``RSMKIT_MUTATIONS`` sets how many files of each kind are tried (10,000 for the full test, see
docs/reliability.md).
"""

import json
import os
import random
import shutil
import signal
import tomllib
from functools import partial
from pathlib import Path

import pytest
from mutations import mutate_bytes, mutate_document, toml_text

from rsmkit.errors import RsmkitError
from rsmkit.stages.looks.status import study_status
from rsmkit.stages.new import create_study
from rsmkit.stages.planning.plan import plan_design
from rsmkit.study.file import load_study
from rsmkit.study.folder import StudyFolder, open_study

MUTATIONS = int(os.environ.get("RSMKIT_MUTATIONS", "150"))
LIMIT_S = 240  # only against hanging: far beyond what any of them takes, on a busy machine too
STUDIES = Path(__file__).parents[3] / "studies"
EVERYTHING = b"""
name = "all tables"
[simulator]
run = "simulator:beam"
timeout_s = 5.0
deterministic = false
replicates = 2
seed = "seed"
[simulator.settings]
load = 3
names = ["a", "b"]
[factors]
a = { low = 0, high = 1 }
n = { low = 1, high = 5, integer = true }
c = { levels = ["x", "y"] }
d = { levels = [1.0, 2.0, 4.0] }
[responses]
y = { label = "y", unit = "m" }
z = {}
[functions]
f = "simulator:beam"
[design]
kind = "optimal"
runs = 30
subject_to = ["a + n <= 5"]
[surface]
model = "auto"
terms = ["FO", "a^2"]
stretch_factors = { a = "power" }
[[search]]
name = "one"
minimize = "y+z*a"
subject_to = ["1 <= y <= 2"]
population = 20
[[search]]
name = "two"
desirability = { y = { goal = "minimize", low = 0, high = 1 } }
[verify]
searches = ["one"]
[verify.refine]
batch = 2
[explorer]
scene = "scene.js"
"""


def refusal(work, folder):
    """What a person is told about a damaged file; nothing, if it is read. Anything else is a failure."""
    before = tree(folder.parent)
    previous = signal.signal(signal.SIGALRM, _too_long)
    signal.alarm(LIMIT_S)
    try:
        work()
        return None
    except RsmkitError as error:
        return str(error)
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, previous)
        assert tree(folder.parent) == before


def _too_long(number, frame):
    raise TimeoutError("it hangs")


def tree(folder):
    return sorted(str(path) for path in folder.rglob("*"))


def check_words(refusals, least):
    """Refusals are short, printable, and name the file."""
    assert len(refusals) > least
    for file, text in refusals:
        assert file in text or "rsmkit plan" in text, (file, text)
        for line in text.split("\n"):
            assert line.isprintable(), text
            assert len(line) < 1000, text


@pytest.mark.slow
def test_no_mutated_study_file_gets_past_the_message_for_people(tmp_path):
    folder = tmp_path / "study"
    create_study(folder)
    sources = [(STUDIES / name / "study.toml").read_bytes() for name in ("laboratory", "external_command")]
    sources += [(folder / "study.toml").read_bytes(), EVERYTHING]
    rng = random.Random(20260101)
    refusals = []
    for _ in range(MUTATIONS):
        source = rng.choice(sources)
        if rng.random() < 0.4:
            data = mutate_bytes(source, rng)
        else:
            data = toml_text(mutate_document(tomllib.loads(source.decode()), rng)).encode(errors="replace")
        (folder / "study.toml").write_bytes(data)
        said = refusal(lambda: load_study(folder), folder)
        if said:
            refusals.append(("study.toml", said))
    check_words(refusals, MUTATIONS // 3)


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """A study with all its artefacts; its folder."""
    from click.testing import CliRunner

    from rsmkit.cli.commands import main

    folder = tmp_path_factory.mktemp("hostile") / "study"
    create_study(folder)
    text = (folder / "study.toml").read_text(encoding="utf-8")
    (folder / "study.toml").write_text(text, encoding="utf-8")
    done = CliRunner().invoke(main, ["run", "-q", "-j", "1", str(folder)])
    assert done.exit_code == 0, done.output
    return folder


READERS = {
    "design.csv": StudyFolder.plan,
    "plan.json": StudyFolder.plan,
    "runs.jsonl": StudyFolder.fit_runs,
    "model.json": StudyFolder.fitted,
    "optimum.json": StudyFolder.fitted,
    "verification.json": StudyFolder.verification,
}


@pytest.mark.slow
@pytest.mark.parametrize("file", READERS)
def test_no_mutated_artefact_gets_past_the_message_for_people(finished, tmp_path, file):
    folder = Path(shutil.copytree(finished, tmp_path / "study"))
    study = load_study(folder)
    whole = (folder / file).read_bytes()
    rng = random.Random(20260101)
    refusals = []
    for index in range(MUTATIONS):
        if file.endswith(".json") and rng.random() < 0.7:
            document = json.loads(whole)
            kept = {
                key: document.pop(key)
                for key in ("made_from", "design")
                if rng.random() < 0.9 and key in document
            }
            data = json.dumps({**kept, **mutate_document(document, rng)}).encode()
        else:
            data = mutate_bytes(whole, rng)
        (folder / file).write_bytes(data)
        said = refusal(lambda: READERS[file](StudyFolder(study)), folder)
        if said:
            refusals.append((file.partition(".")[0], said))
        if index % 10 == 0:
            refusal(lambda: study_status(StudyFolder(study)), folder)
    check_words(refusals, MUTATIONS // 10)


@pytest.mark.slow
def test_no_mutated_table_of_points_gets_past_the_message_for_people(tmp_path):
    folder = tmp_path / "study"
    folder.mkdir()
    (folder / "study.toml").write_text(
        "[factors]\na = {low = 0, high = 1}\nc = {levels = ['x', 'y']}\n[responses]\ny = {}\n"
        "[design]\nkind = 'file'\nfile = 'points.csv'\n[surface]\norder = 1\n"
    )
    whole = b"a,c,note\n" + b"".join(b"%.3f,%s,ok\n" % (i / 9, b"xy"[i % 2 : i % 2 + 1]) for i in range(10))
    rng = random.Random(20260101)
    refusals = []
    for _ in range(MUTATIONS // 3):
        (folder / "points.csv").write_bytes(mutate_bytes(whole, rng))
        (folder / "design.csv").touch()
        (folder / "plan.json").touch()
        said = refusal(partial(plan_design, open_study(folder), force=True), folder)
        if said:
            refusals.append(("", said))
    check_words(refusals, MUTATIONS // 10)
