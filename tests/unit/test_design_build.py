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
