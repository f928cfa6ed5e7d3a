"""A study of a mixture is planned from its file: by each family, compared, grown, and refused in words."""

import numpy as np
import pytest

from rsmkit.cli import main

STUDY = """
[simulator]
run = "blend:yield_of"

[factors]
a = {{ low = 10, high = 60 }}
b = {{ low = 0, high = 70 }}
c = {{ low = 5, high = 90 }}
heat_c = {{ low = 20, high = 80 }}

[mixture]
components = ["a", "b", "c"]
total = 100

[responses]
y = {{}}

[design]
{design}
subject_to = ["a + 0.5*heat_c <= 70"]
"""


def planned(folder, design, *words):
    folder.mkdir(exist_ok=True)
    (folder / "blend.py").write_text("def yield_of(a, b, c, heat_c):\n    return {'y': a * b + c}\n")
    (folder / "study.toml").write_text(STUDY.format(design=design))
    with pytest.raises(SystemExit) as end:
        main(["plan", str(folder), *words])
    return end.value.code


def points(folder):
    table = np.genfromtxt(folder / "design.csv", delimiter=",", names=True, dtype=None, encoding="utf-8")
    return np.stack([table[name] for name in ("a", "b", "c", "heat_c")], axis=1)


@pytest.mark.parametrize(
    "design",
    [
        'kind = "extreme-vertices"\ncentroids = "all"',
        'kind = "optimal"\nruns = 14\nstarts = 2',
        'kind = "optimal"\nruns = 14\nstarts = 2\ncriterion = "I"\nreplicates = true',
        'kind = "maximin"\nruns = 16',
        'kind = "extreme-vertices"\naugment_to = 30\nstarts = 2',
    ],
)
def test_every_kind_keeps_the_total_and_the_limits(design, tmp_path, capsys):
    assert planned(tmp_path, design) == 0
    found = points(tmp_path)
    assert np.abs(found[:, :3].sum(axis=1) - 100.0).max() <= 1e-10
    assert (found[:, 0] + 0.5 * found[:, 3] <= 70.0 + 1e-9).all()
    assert (found >= [10, 0, 5, 20]).all()
    assert (found <= [60, 70, 90, 80]).all()
    printed = capsys.readouterr().out
    assert "on a + b + c == 100; efficiency G" in printed
    assert "a, b, c are pseudo-components here: 0 at 10, 0, 5, and they add up to 1" in printed


def test_designs_of_a_mixture_are_compared(tmp_path, capsys):
    assert planned(tmp_path / "one", 'kind = "sobol"\nruns = 12') == 0
    assert (
        planned(
            tmp_path / "two", 'kind = "optimal"\nruns = 14\nstarts = 2', "--compare", str(tmp_path / "one")
        )
        == 0
    )
    assert "average prediction variance" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("design", "words"),
    [
        ('kind = "ccd"', "cannot keep 'a + b + c == 100'; take 'simplex-lattice'"),
        ('kind = "simplex-lattice"', "'simplex-lattice' is for a simplex"),
        ('kind = "optimal"\nruns = 4', "4 runs cannot estimate the 10 coefficients"),
        (
            'kind = "optimal"\nruns = 14\nregion = "ball"',
            "a ball about the centre is for factors that vary freely",
        ),
    ],
)
def test_what_cannot_be_planned_is_refused_in_words(design, words, tmp_path, capsys):
    assert planned(tmp_path, design) != 0
    assert words in " ".join(capsys.readouterr().err.split())
