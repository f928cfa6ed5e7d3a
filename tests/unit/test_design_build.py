from __future__ import annotations

import numpy as np
import pytest

from rsmkit.design.build import build_design
from rsmkit.design.options import DesignOptions
from rsmkit.errors import RsmkitError
from rsmkit.space import Space

SPACE = Space(a=(5.0, 10.0), b=(10.0, 15.0), c=(0.25, 0.5))


def gaps(points: np.ndarray) -> np.ndarray:
    distances = np.linalg.norm(points[:, None, :] - points[None, :, :], axis=2)
    return distances + np.eye(len(points)) * 9.0


def test_fifty_points_of_the_study():
    design = build_design(SPACE, DesignOptions(augment_to=50))
    assert len(design) == 50
    assert [design.kinds.count(k) for k in ("factorial", "center", "axial", "augmented")] == [8, 3, 6, 33]
    assert gaps(design.coded)[17:].min() >= 0.2 - 1e-9
    assert SPACE.contains(design.points[17:]).all()
    assert not SPACE.contains(design.points[np.array(design.kinds) == "axial"]).any()
    assert design.quality().rank == 10


def test_same_seed_same_design_for_any_number_of_workers():
    options = DesignOptions(augment_to=24, seed=5)
    first = build_design(SPACE, options, workers=1)
    assert first.points.tobytes() == build_design(SPACE, options, workers=3).points.tobytes()
    other = build_design(SPACE, DesignOptions(augment_to=24, seed=6))
    assert first.points.tobytes() != other.points.tobytes()


def test_added_points_may_use_the_room_of_the_star():
    design = build_design(SPACE, DesignOptions(augment_to=40, region="stars"))
    assert np.abs(design.coded[17:]).max() == pytest.approx(8**0.25)


def test_replicates_are_an_option():
    design = build_design(SPACE, DesignOptions(augment_to=50, replicates=True))
    assert design.distinct < 48


def test_linear_constraints_hold_for_every_point():
    def margin(points):
        return 20.0 - points[:, 0] - points[:, 1]

    design = build_design(SPACE, DesignOptions(star="faced", augment_to=30), constraints=[margin])
    assert (margin(design.points) >= -1e-9).all()
    assert design.kinds.count("factorial") == 6  # the two corners with a + b = 25 are left out
    assert np.isclose(margin(design.points), 0.0).any()
    assert design.quality().rank == 10


def test_impossible_wishes_are_explained():
    with pytest.raises(RsmkitError, match="17 runs already, 10 in all"):
        build_design(SPACE, DesignOptions(augment_to=10))
    with pytest.raises(RsmkitError, match="no point of the starting design"):
        build_design(SPACE, DesignOptions(), constraints=[lambda points: -np.ones(len(points))])
    with pytest.raises(RsmkitError, match=r"design\.kind: 'ccx'"):
        build_design(SPACE, DesignOptions(kind="ccx"))
    with pytest.raises(RsmkitError, match=r"design\.runs is missing"):
        build_design(SPACE, DesignOptions(kind="sobol"))
    assert [key for key, _ in DesignOptions(kind="ccx", levels=1).problems()] == ["kind", "levels"]
    assert DesignOptions(kind="my.points:make").problems() == []


@pytest.mark.parametrize(
    ("options", "runs"),
    [
        (DesignOptions(kind="box-behnken", center=1), 13),
        (DesignOptions(kind="factorial", levels=3, center=0), 27),
        (DesignOptions(kind="fractional-factorial", generators=("C=AB",), center=0), 4),
        (DesignOptions(kind="plackett-burman", center=0), 4),
        (DesignOptions(kind="definitive-screening", center=1), 7),
        (DesignOptions(kind="latin-hypercube", runs=12), 12),
        (DesignOptions(kind="sobol", runs=8), 8),
        (DesignOptions(kind="halton", runs=9), 9),
        (DesignOptions(kind="maximin", runs=10), 10),
        (DesignOptions(kind="optimal", runs=14, criterion="I"), 14),
        (DesignOptions(kind="latin-hypercube", runs=12, augment_to=16, criterion="maximin"), 16),
    ],
    ids=lambda value: getattr(value, "kind", ""),
)
def test_every_family_can_be_asked_for(options, runs):
    design = build_design(SPACE, options)
    assert len(design) == design.distinct == runs
    assert SPACE.contains(design.points).all()


def test_own_points_from_a_file_and_from_a_function(tmp_path):
    (tmp_path / "mine.csv").write_text("a,b,c\n5,10,0.25\n6,11,0.3\n")
    assert len(build_design(SPACE, DesignOptions(kind="file", file="mine.csv"), folder=tmp_path)) == 2
    (tmp_path / "my_points.py").write_text(
        "def make(space, runs, rng):\n    return space.decode(rng.uniform(-1, 1, (runs, 3)))\n"
    )
    design = build_design(SPACE, DesignOptions(kind="my_points:make", runs=6), folder=tmp_path)
    assert design.kinds == ("given",) * 6
    with pytest.raises(RsmkitError, match="cannot be loaded"):
        build_design(SPACE, DesignOptions(kind="my_points:other", runs=6), folder=tmp_path)


def test_categorical_and_discrete_factors_in_an_optimal_design():
    mixed = Space(x=(0.0, 1.0), size=[1.0, 2.0, 4.0], tool=["A", "B", "C"])
    design = build_design(mixed, DesignOptions(kind="optimal", runs=18))
    assert design.quality().rank == 12  # 1, 2 + 2 linear, 1 + 2 + 2 mixed, 2 squares
    assert set(design.points[:, 1]) == {1.0, 2.0, 4.0}
    assert {int(level) for level in design.points[:, 2]} == {0, 1, 2}


def test_nonlinear_constraints_hold_for_every_added_point():
    def margin(points):
        coded = SPACE.encode(points)
        return 1.5 - (coded**2).sum(axis=1)

    design = build_design(SPACE, DesignOptions(kind="optimal", runs=14), constraints=[margin])
    assert (margin(design.points) >= -1e-8).all()
    assert np.abs(margin(design.points)).min() < 1e-6
    assert design.quality().rank == 10
