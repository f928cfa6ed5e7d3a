"""Every row of the register of design families keeps its contract; a new row needs a line here."""

from dataclasses import dataclass

import numpy as np
import pytest

import rsmkit
from rsmkit.design.design import Design
from rsmkit.design.families.registry import FAMILIES, Family, word_of
from rsmkit.design.options import DesignOptions
from rsmkit.language.space import Factor, Space
from rsmkit.testing import check_design_family

PLAIN = Space(a=(5.0, 10.0), b=(10.0, 15.0), c=(0.25, 0.5))
A, N, D = Factor("a", 5.0, 10.0), Factor("n", 0, 12, integer=True), Factor("d", -1.0, 1.0)
SIZE, TOOL = Factor("size", levels=(1.0, 2.0, 5.0)), Factor("tool", levels=("A", "B"))
NUMERIC = Space([A, N, SIZE, D])
TWO_LEVELS = Space([A, N, TOOL, D])
MIXED = Space([A, N, SIZE, Factor("tool", levels=("A", "B", "C"))])
BLENDS = Space(a=(0.0, 1.0), b=(0.1, 1.0), c=(0.0, 1.0), tool=["A", "B", "C"]).mixture("a", "b", "c")
TIGHT = Space(a=(40, 60), b=(10, 50), c=(10, 50), d=(3, 8), heat=(20, 80)).mixture(*"abcd", total=100)

EXAMPLES = [
    ("ccd", {}, NUMERIC, 16 + 3 + 8),
    ("ccd", {"star": "inscribed", "blocked": True, "alpha": "orthogonal"}, PLAIN, 8 + 3 + 6),
    ("ccd", {"star": "faced", "center": 1, "augment_to": 20, "starts": 2}, PLAIN, 20),
    ("box-behnken", {}, NUMERIC, 24 + 3),
    ("factorial", {"levels": {"a": 3}}, MIXED, 3 * 2 * 3 * 3),
    ("fractional-factorial", {"runs": 8}, TWO_LEVELS, 8),
    ("fractional-factorial", {"generators": ("D=ABC",), "center": 2}, NUMERIC, None),
    ("plackett-burman", {"runs": 12}, TWO_LEVELS, 12),
    ("definitive-screening", {"center": 2}, TWO_LEVELS, 2 * 4 + 2),
    ("latin-hypercube", {"runs": 12}, MIXED, 12),
    ("sobol", {"runs": 13, "seed": 4}, MIXED, 13),
    ("halton", {"runs": 13}, MIXED, 13),
    ("maximin", {"runs": 13}, MIXED, 13),
    ("optimal", {"runs": 24, "starts": 2, "min_distance": 0.0}, MIXED, 24),
    ("simplex-lattice", {"degree": 3, "axial": True, "repeats": 2, "blocked": True}, BLENDS, 2 * 13 * 3),
    ("simplex-centroid", {"axial": True, "center": 2}, BLENDS, 10 * 3 + 2),
    ("extreme-vertices", {"centroids": "all"}, TIGHT, (8 + 12 + 6 + 1) * 3),
    ("optimal", {"runs": 24, "starts": 2, "replicates": True}, TIGHT, 24),
    ("maximin", {"runs": 9}, BLENDS, 9),
    ("sobol", {"runs": 9}, TIGHT, 9),
    ("file", {"file": "mine.csv"}, PLAIN, 3),
    ("own_points:make", {"runs": 6}, PLAIN, 6),
]


@pytest.mark.parametrize(("kind", "keys", "space", "runs"), EXAMPLES, ids=lambda value: str(value)[:40])
def test_every_family_keeps_the_contract(kind, keys, space, runs, tmp_path):
    (tmp_path / "mine.csv").write_text("a,b,c\n5,10,0.25\n6,11,0.3\n7,15,0.5\n")
    (tmp_path / "own_points.py").write_text(
        "def make(space, runs, rng):\n"
        "    inside = rng.uniform(-1, 1, (runs, len(space)))\n"
        "    return space.snap(space.decode(inside)).clip(space.lows, space.highs)\n"
    )
    check_design_family(kind, keys, space, runs=runs, folder=tmp_path)


def test_every_family_has_an_example():
    assert {word_of(kind) for kind, *_ in EXAMPLES} == set(FAMILIES)


def test_every_family_is_at_hand_in_python():
    for row in FAMILIES.values():
        if row.function is not None:
            assert getattr(rsmkit, row.function.__name__) is row.function
    assert [word for word, row in FAMILIES.items() if row.function is None] == ["file", "module:function"]


@dataclass(frozen=True)
class Loose(DesignOptions):
    """Options that a family might have by mistake."""

    more: int = 3


def check(monkeypatch, points, options=FAMILIES["sobol"].options, space=PLAIN, **keys):
    """Hold a family of such points to the contract."""

    def make(space, options, site):
        found = points(space)
        return Design(space, found, ("grid",) * len(found))

    monkeypatch.setitem(FAMILIES, "broken", Family("broken", options, make))
    check_design_family("broken", keys, space)


def test_points_outside_are_caught(monkeypatch):
    with pytest.raises(AssertionError, match="a grid point lies outside"):
        check(monkeypatch, lambda space: space.decode(np.full((4, 3), 1.5)))


def test_designs_that_differ_every_time_are_caught(monkeypatch):
    drawn = np.random.default_rng(0)
    with pytest.raises(AssertionError, match="the same options give another design"):
        check(monkeypatch, lambda space: space.decode(drawn.uniform(-1.0, 1.0, (4, 3))))


def test_a_wrong_number_of_runs_is_caught(monkeypatch):
    with pytest.raises(AssertionError, match="3 runs instead of 4"):
        check(monkeypatch, lambda space: space.decode(np.zeros((3, 3))), runs=4)


def test_values_that_a_factor_cannot_take_are_caught(monkeypatch):
    with pytest.raises(AssertionError, match="a point that its factors cannot take"):
        check(monkeypatch, lambda space: space.decode(np.full((4, len(space)), 0.123)), space=NUMERIC)


def test_undocumented_options_are_caught(monkeypatch):
    with pytest.raises(AssertionError, match="keys without a line in the reference: more"):
        check(monkeypatch, lambda space: space.decode(np.zeros((1, 3))), options=Loose)


def test_errors_that_are_not_meant_for_people_are_caught(monkeypatch):
    with pytest.raises(ZeroDivisionError):
        check(monkeypatch, lambda space: space.decode(np.zeros((len(space) // (len(space) - 1), 3)))[:1])
