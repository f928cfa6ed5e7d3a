"""Mixtures, equalities and categories in study files, and what would break a sum."""

import numpy as np
import pytest

from rsmkit.errors import RsmkitError, StudyError
from rsmkit.stages.looks.check import check_study
from rsmkit.study.file import load_study
from rsmkit.study.folder import open_study
from rsmkit.variation.sensitivity.morris import morris

HEAD = """
[simulator]
run = "blend:cost"
deterministic = false
[responses]
y = {}
[factors]
a = { low = 0, high = 1 }
b = { low = 0, high = 1 }
c = { low = 0, high = 1 }
n = { low = 1, high = 5, integer = true }
cell = { levels = ["L1", "L2"] }
"""
MIXTURE = '[mixture]\ncomponents = ["a", "b", "c"]\n'


def study(tmp_path, text):
    (tmp_path / "study.toml").write_text(text)
    return load_study(tmp_path)


def test_a_study_has_its_sums_in_its_space(tmp_path):
    found = study(
        tmp_path,
        HEAD
        + MIXTURE
        + '[design]\nsubject_to = ["a == 0.5*b", "not (cell == \'L2\' and n >= 3)", "c <= 0.5"]',
    )
    assert [e.text for e in found.space.equalities] == ["a + b + c == 1", "a - 0.5*b == 0"]
    assert [m.components for m in found.space.mixtures] == [("a", "b", "c")]
    assert [c.text for c in found.design_constraints()] == ["not (cell == 'L2' and n >= 3)", "c <= 0.5"]


def test_several_mixtures(tmp_path):
    text = HEAD + '[[mixture]]\ncomponents = ["a", "b"]\ntotal = 0.5\n[[mixture]]\ncomponents = ["c", "d"]'
    found = study(tmp_path, text.replace("n = {", "d = { low = 0, high = 1 }\nn = {"))
    assert [(m.components, m.total) for m in found.space.mixtures] == [(("a", "b"), 0.5), (("c", "d"), 1.0)]


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("a = { low = 0,", "a = { low = 1.5,", "factors.a: low .1.5. must be less than high"),
        ('"c"]', '"n"]', "mixture: 'a . b . n == 1': n is integer, and only continuous"),
        ('"c"]', '"x"]', "mixture: .*x is no factor"),
        ('["a", "b", "c"]', '["a"]', "mixture: name at least two components"),
        (
            '["a", "b", "c"]',
            '["a", "b", "c"]\ntotal = 4',
            "mixture: .* leave nothing: their sum 3 is below the total 4",
        ),
        (
            "[mixture]",
            '[uncertainty.a]\nlaw = "normal"\nsd = 0.1\n[mixture]',
            "uncertainty.a: a takes part in",
        ),
        (
            "[mixture]",
            '[[search]]\nminimize = "y"\n[search.robust.noise.b]\nmean = 0.3\nspread = 0.1\n[mixture]',
            "robust.noise.b: b takes part in",
        ),
        (
            "a = { low = 0, high = 1 }",
            'a = { low = 0, high = 1, change = "hard" }',
            "factors.a.change: a takes",
        ),
        ("[mixture]", '[design]\nsubject_to = ["a + cell == 1"]\n[mixture]', "cell is categorical"),
        ("[mixture]", '[design]\nsubject_to = ["a + b == 1.5"]\n[mixture]', "subject_to: .* leave no point"),
        ("[mixture]", '[[search]]\nminimize = "y"\nsubject_to = ["y == 2"]\n[mixture]', "in factors only"),
        ("[mixture]", '[[search]]\nminimize = "y"\nsubject_to = ["a == 2"]\n[mixture]', "leave nothing"),
    ],
)
def test_what_would_break_a_sum_is_refused(tmp_path, old, new, words):
    with pytest.raises(StudyError, match=words):
        study(tmp_path, (HEAD + MIXTURE).replace(old, new, 1))


def test_a_check_runs_a_blend(tmp_path):
    (tmp_path / "blend.py").write_text("def cost(a, b, c, n, cell):\n    return {'y': a + b + c}\n")
    study(tmp_path, HEAD + MIXTURE)
    assert check_study(open_study(tmp_path)).run.value("y") == pytest.approx(1.0, abs=1e-15)


def test_paths_that_leave_a_sum_are_refused(tmp_path):
    with pytest.raises(RsmkitError, match=r"a step of one factor leaves 'a \+ b \+ c == 1'"):
        morris(study(tmp_path, HEAD + MIXTURE).space)


def test_sums_are_part_of_what_an_artefact_was_made_from(tmp_path):
    from rsmkit.study.records import plan_record

    plain = plan_record(study(tmp_path, HEAD))
    assert "mixture" not in plain
    assert plan_record(study(tmp_path, HEAD + MIXTURE))["mixture"] == [{"components": ["a", "b", "c"]}]
    assert np.isfinite(load_study(tmp_path).space.affine.inner).all()
