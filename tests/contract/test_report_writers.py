"""Every row of the register of reports keeps its contract; so does a toy, which every stage then writes."""

from dataclasses import replace

import pytest
from click.testing import CliRunner
from toy_report import ROW

from rsmkit.cli import main
from rsmkit.report.writers import WRITERS, Writer
from rsmkit.testing import check_report_writer


@pytest.mark.parametrize("word", WRITERS)
def test_every_writer_keeps_the_contract(word, tmp_path):
    assert WRITERS[word].word == word
    check_report_writer(WRITERS[word], tmp_path)


def test_the_toy_keeps_it(tmp_path):
    check_report_writer(ROW, tmp_path)


def _nothing(findings, path):
    pass


def _beside(findings, path):
    ROW.write(findings, path)
    path.with_suffix(".bak").write_text("")


@pytest.mark.parametrize(
    ("broken", "words"),
    [
        (replace(ROW, write=_nothing), "wrote nothing"),
        (replace(ROW, write=_beside), "left toy.bak"),
        (replace(ROW, file="../toy.txt"), "not the name of a file"),
        (Writer("two words", "", "toy.txt", ROW.write), "one word"),
    ],
)
def test_a_writer_that_breaks_it_is_found(broken, words, tmp_path):
    with pytest.raises(AssertionError, match=words):
        check_report_writer(broken, tmp_path)


def test_the_toy_is_written_by_a_whole_study(tmp_path, monkeypatch):
    monkeypatch.setitem(WRITERS, "toy", ROW)
    run = CliRunner()
    assert run.invoke(main, ["new", str(tmp_path / "study")]).exit_code == 0
    assert run.invoke(main, ["run", str(tmp_path / "study"), "-j", "1"]).exit_code == 0
    first, *responses = (tmp_path / "study" / "toy.txt").read_text().splitlines()
    assert first.split()[1:3] == ["runs", "of"]
    assert set(responses) >= {"mass_kg", "sag_mm"}
