"""Which design a study gets that names none."""

import pytest

from rsmkit.study.file import load_study

HEAD = (
    'name = "any"\n[simulator]\nrun = "sim:f"\n[responses]\ny = {}\n[[search]]\nname = "s"\nminimize = "y"\n'
)


def design(folder, factors, rest=""):
    ranges = "".join(f"x{i} = {{ low = 0, high = 1 }}\n" for i in range(factors))
    (folder / "study.toml").write_text(HEAD + "[factors]\n" + ranges + rest)
    return load_study(folder).file.design


@pytest.mark.parametrize("factors", [2, 3, 6])
def test_a_small_composite_design_stays(tmp_path, factors):
    assert design(tmp_path, factors).kind == "ccd"


@pytest.mark.parametrize(
    ("factors", "rest", "runs"),
    [
        (1, "", 6),  # twice the three terms
        (7, "", 50),  # of 36 terms; the cube alone would have 128
        (10, "", 72),  # 66 terms and a tenth
        (10, "[surface]\norder = 1\n", 22),
        (3, 'c = { levels = ["u", "v", "w"] }\nd = { levels = ["p", "q", "r"] }\n', 50),  # 9 x 17 otherwise
        (3, '[design]\nsubject_to = ["x0 + x1 <= 1"]\n', 20),
        (3, '[mixture]\ncomponents = ["x0", "x1", "x2"]\n', 12),  # 6 terms of Scheffe
        (3, '[design]\nsubject_to = ["x0 + 2*x1 == 1"]\n', 12),
    ],
)
def test_otherwise_points_are_optimal(tmp_path, factors, rest, runs):
    chosen = design(tmp_path, factors, rest)
    assert (chosen.kind, chosen.planned_runs) == ("optimal", runs)


def test_few_combinations_of_categories_are_all_run(tmp_path):
    two = 'c = { levels = ["u", "v", "w"] }\nd = { levels = ["p", "q"] }\n'
    assert design(tmp_path, 0, two).kind == "factorial"


def test_the_number_of_runs_asked_for_is_kept(tmp_path):
    chosen = design(tmp_path, 8, "[design]\naugment_to = 60\nseed = 7\n")
    assert (chosen.kind, chosen.planned_runs, chosen.seed) == ("optimal", 60, 7)


@pytest.mark.parametrize("keys", ['kind = "ccd"', 'star = "faced"', "center = 1", "augment_to = 300"])
def test_what_was_chosen_is_obeyed(tmp_path, keys):
    assert design(tmp_path, 8, f"[design]\n{keys}\n").kind == "ccd"
