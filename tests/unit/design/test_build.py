from __future__ import annotations

import numpy as np
import pytest

from rsmkit.design.build import build_design
from rsmkit.design.families.registry import design_options
from rsmkit.design.quality.assessment import assess
from rsmkit.errors import RsmkitError
from rsmkit.language.space import Space
from rsmkit.language.terms import parse_terms

SPACE = Space(a=(5.0, 10.0), b=(10.0, 15.0), c=(0.25, 0.5))


def gaps(points: np.ndarray) -> np.ndarray:
    distances = np.linalg.norm(points[:, None, :] - points[None, :, :], axis=2)
    return distances + np.eye(len(points)) * 9.0


def test_fifty_points_of_the_study():
    design = build_design(SPACE, design_options(augment_to=50, starts=20))
    assert len(design) == 50
    assert [design.kinds.count(k) for k in ("factorial", "center", "axial", "augmented")] == [8, 3, 6, 33]
    assert gaps(design.coded)[17:].min() >= 0.2 - 1e-9
    assert SPACE.contains(design.points[17:]).all()
    assert not SPACE.contains(design.points[np.array(design.kinds) == "axial"]).any()
    assert assess(design).rank == 10


def test_same_seed_same_design():
    options = design_options(augment_to=24, seed=5)
    first = build_design(SPACE, options)
    assert first.points.tobytes() == build_design(SPACE, options).points.tobytes()
    other = build_design(SPACE, design_options(augment_to=24, seed=6))
    assert first.points.tobytes() != other.points.tobytes()


def test_added_points_may_use_the_room_of_the_star():
    design = build_design(SPACE, design_options(augment_to=40, region="stars", starts=20))
    assert np.abs(design.coded[17:]).max() == pytest.approx(8**0.25)


def test_replicates_are_an_option():
    design = build_design(SPACE, design_options(augment_to=50, replicates=True))
    assert design.distinct < 48


def test_linear_constraints_hold_for_every_point():
    def margin(points):
        return 20.0 - points[:, 0] - points[:, 1]

    design = build_design(SPACE, design_options(star="faced", augment_to=30, starts=10), constraints=[margin])
    assert (margin(design.points) >= -1e-9).all()
    assert design.kinds.count("factorial") == 6  # the two corners with a + b = 25 are left out
    assert np.isclose(margin(design.points), 0.0).any()
    assert assess(design).rank == 10


def test_impossible_wishes_are_explained():
    with pytest.raises(RsmkitError, match="17 runs already, 10 in all"):
        build_design(SPACE, design_options(augment_to=10))
    with pytest.raises(RsmkitError, match="no point of the starting design"):
        build_design(SPACE, design_options(), constraints=[lambda points: -np.ones(len(points))])
    with pytest.raises(RsmkitError, match=r"design\.kind must be ccd.*; got 'ccx', did you mean 'ccd'\?"):
        design_options(kind="ccx")
    with pytest.raises(RsmkitError, match=r"design\.runs is missing"):
        build_design(SPACE, design_options(kind="sobol"))
    assert [key for key, _ in design_options(kind="factorial", levels=1).problems()] == ["levels"]
    assert design_options(kind="my.points:make").problems() == []


@pytest.mark.parametrize(
    ("options", "key", "said"),
    [
        (
            design_options(kind="optimal", runs=14, augment_to=20),
            "augment_to",
            "is 20, but runs is 14: each is",
        ),
        (design_options(kind="maximin", runs=14, augment_to=20), "augment_to", "leave one of them out"),
        (design_options(kind="maximin", runs=14, criterion="I"), "criterion", "goes with kind = 'optimal'"),
        (
            design_options(kind="maximin", runs=14, starts=3),
            "starts",
            "no effect on points spread by 'maximin'",
        ),
        (design_options(augment_to=20, criterion="maximin", blocks=(17, 3)), "blocks", "spread by 'maximin'"),
        (
            design_options(augment_to=20, replicates=True, min_distance=0.1),
            "replicates",
            "contradicts min_distance",
        ),
        (design_options(min_distance=0.1), "min_distance", "no effect without augment_to"),
        (design_options(criterion="maximin"), "criterion", "no effect without augment_to"),
    ],
)
def test_contradicting_options_are_named(options, key, said):
    ((found, message),) = options.problems()
    assert found == key
    assert said in message


@pytest.mark.parametrize(
    "options",
    [
        design_options(kind="optimal", runs=14, augment_to=14),
        design_options(kind="optimal", augment_to=14, criterion="A", starts=3),
        design_options(kind="maximin", runs=14, criterion="maximin"),
        design_options(augment_to=20, replicates=True, min_distance=0.0, starts=2),
    ],
)
def test_options_that_agree_are_accepted(options):
    assert options.problems() == []


@pytest.mark.parametrize(
    ("options", "runs"),
    [
        (design_options(kind="box-behnken", center=1), 13),
        (design_options(kind="factorial", levels=3, center=0), 27),
        (design_options(kind="fractional-factorial", generators=("C=AB",), center=0), 4),
        (design_options(kind="plackett-burman", center=0), 4),
        (design_options(kind="definitive-screening", center=1), 7),
        (design_options(kind="latin-hypercube", runs=12), 12),
        (design_options(kind="sobol", runs=8), 8),
        (design_options(kind="halton", runs=9), 9),
        (design_options(kind="maximin", runs=10), 10),
        (design_options(kind="optimal", runs=14, criterion="I"), 14),
        (design_options(kind="latin-hypercube", runs=12, augment_to=16, criterion="maximin"), 16),
    ],
    ids=lambda value: getattr(value, "kind", ""),
)
def test_every_family_can_be_asked_for(options, runs):
    design = build_design(SPACE, options)
    assert len(design) == design.distinct == runs
    assert SPACE.contains(design.points).all()


def test_own_points_from_a_file_and_from_a_function(tmp_path):
    (tmp_path / "mine.csv").write_text("a,b,c\n5,10,0.25\n6,11,0.3\n")
    assert len(build_design(SPACE, design_options(kind="file", file="mine.csv"), folder=tmp_path)) == 2
    (tmp_path / "my_points.py").write_text(
        "def make(space, runs, rng):\n    return space.decode(rng.uniform(-1, 1, (runs, 3)))\n"
    )
    design = build_design(SPACE, design_options(kind="my_points:make", runs=6), folder=tmp_path)
    assert design.kinds == ("given",) * 6
    with pytest.raises(RsmkitError, match="cannot be loaded"):
        build_design(SPACE, design_options(kind="my_points:other", runs=6), folder=tmp_path)


def test_categorical_and_discrete_factors_in_an_optimal_design():
    mixed = Space(x=(0.0, 1.0), size=[1.0, 2.0, 4.0], tool=["A", "B", "C"])
    design = build_design(mixed, design_options(kind="optimal", runs=18))
    assert assess(design).rank == 12  # 1, 2 + 2 linear, 1 + 2 + 2 mixed, 2 squares
    assert set(design.points[:, 1]) == {1.0, 2.0, 4.0}
    assert {int(level) for level in design.points[:, 2]} == {0, 1, 2}


def test_nonlinear_constraints_hold_for_every_added_point():
    def margin(points):
        coded = SPACE.encode(points)
        return 1.5 - (coded**2).sum(axis=1)

    design = build_design(SPACE, design_options(kind="optimal", runs=14, starts=4), constraints=[margin])
    assert (margin(design.points) >= -1e-8).all()
    assert np.abs(margin(design.points)).min() < 1e-6
    assert assess(design).rank == 10


def test_the_price_of_distance_is_told():
    options = design_options(augment_to=40, starts=3)
    apart = build_design(SPACE, options)
    assert any("kept 0.2 apart" in warning for warning in assess(apart).warnings)
    together = build_design(SPACE, design_options(augment_to=40, starts=3, replicates=True))
    assert not any("apart" in warning for warning in assess(together).warnings)
    assert "of them repeat others" in repr(together)


def test_blocks_of_the_study_file():
    first = build_design(SPACE, design_options(kind="optimal", runs=12, blocks=(6, 6), starts=3), order=1)
    assert first.blocks == (1,) * 6 + (2,) * 6
    assert assess(first, order=1).rank == 4
    with pytest.raises(RsmkitError, match=r"6 \+ 5 = 11 runs, the design has 12"):
        build_design(SPACE, design_options(kind="optimal", runs=12, blocks=(6, 5)))
    later = build_design(SPACE, design_options(alpha="orthogonal", blocked=True, augment_to=24, starts=2))
    assert later.blocks[-1] == 3
    random = design_options(kind="optimal", runs=12, blocks=(4, 4, 4), block_variance=1.0, starts=2)
    assert build_design(SPACE, random).blocks == (1,) * 4 + (2,) * 4 + (3,) * 4
    with pytest.raises(RsmkitError, match="name the blocks too"):
        build_design(SPACE, design_options(kind="optimal", runs=12, block_variance=1.0))


def test_a_given_covariance_is_read(tmp_path):
    plots = np.repeat(np.arange(6), 2)
    sigma = np.eye(12) + 2.0 * (plots[:, None] == plots[None, :])
    np.savetxt(tmp_path / "sigma.csv", sigma, delimiter=",")
    options = design_options(kind="optimal", runs=12, covariance="sigma.csv", starts=2)
    design = build_design(SPACE, options, folder=tmp_path)
    same = design_options(kind="optimal", runs=12, blocks=(2,) * 6, block_variance=2.0, starts=2)
    np.testing.assert_array_equal(design.points, build_design(SPACE, same).points)
    with pytest.raises(RsmkitError, match="not a table of numbers"):
        build_design(SPACE, design_options(kind="optimal", runs=12, covariance="none.csv"), folder=tmp_path)


def test_points_from_a_list_and_in_a_ball(tmp_path):
    rng = np.random.default_rng(0)
    listed = SPACE.decode(rng.uniform(-1, 1, (60, 3)))
    lines = ["a,b,c", *(",".join(map(repr, map(float, row))) for row in listed)]
    (tmp_path / "list.csv").write_text("\n".join(lines) + "\n")
    for kind in ("optimal", "maximin"):
        options = design_options(kind=kind, runs=14, candidates="list.csv", min_distance=0.0, starts=3)
        design = build_design(SPACE, options, folder=tmp_path)
        assert {tuple(np.round(x, 9)) for x in design.points} <= {tuple(np.round(x, 9)) for x in listed}
    with pytest.raises(RsmkitError, match="60 points that are not in the design yet, 61"):
        build_design(SPACE, design_options(kind="maximin", runs=61, candidates="list.csv"), folder=tmp_path)
    ball = build_design(SPACE, design_options(kind="optimal", runs=14, region="ball", radius=1.0, starts=3))
    assert np.linalg.norm(ball.coded, axis=1).max() <= 1.0 + 1e-9


@pytest.mark.parametrize("kind", ["sobol", "halton", "latin-hypercube", "maximin", "optimal"])
def test_every_filling_has_its_runs_under_constraints(kind):
    mixed = Space(a=(0.0, 1.0), b=[0.0, 0.25, 0.5, 1.0], tool=["A", "B"])

    def margin(points):
        return 1.2 - points[:, 0] ** 2 - points[:, 1] - 0.2 * points[:, 2]

    design = build_design(mixed, design_options(kind=kind, runs=18, starts=2), constraints=[margin])
    assert len(design) == 18
    assert (margin(design.points) >= -1e-8).all()
    assert set(design.points[:, 1]) <= {0.0, 0.25, 0.5, 1.0}


@pytest.mark.slow
def test_large_models_on_mixed_factors_under_constraints():
    """These factors have more coefficients than many quick starts can agree on: the search cools."""
    mixed = Space(
        a=(0.0, 1.0), b=(0.0, 1.0), c=(0.0, 1.0), d=(0.0, 1.0), size=[1.0, 2.0, 4.0], tool=["A", "B", "C"]
    )

    def margin(points):
        return 1.5 - points[:, 0] - points[:, 1]

    options = design_options(kind="optimal", runs=44, blocks=(22, 22), starts=2)
    design, again = (build_design(mixed, options, constraints=[margin]) for _ in range(2))
    assert design.points.tobytes() == again.points.tobytes()
    assert (margin(design.points) >= -1e-9).all()
    assert gaps(mixed.encode(design.points)).min() >= 0.2 - 1e-9
    assert set(design.points[:, 4]) == {1.0, 2.0, 4.0}
    assert set(design.points[:, 5]) == {0.0, 1.0, 2.0}
    quality = assess(design)
    assert quality.rank == 33  # 1, 5 + 2 linear, 10 + 10 mixed, 5 squares
    assert quality.d_bound_efficiency > 70.0


def test_the_model_may_be_given():
    terms = parse_terms(SPACE, ["FO", "a^2"])
    design = build_design(SPACE, design_options(kind="optimal", runs=6, starts=3), terms=terms)
    assert assess(design, terms=terms).rank == 5


@pytest.mark.parametrize(
    ("options", "record"),
    [
        (design_options(), {}),
        (
            design_options(augment_to=50, center=1, star="faced", generators=("E=ABCD",), seed=3),
            {"star": "faced", "center": 1, "generators": ["E=ABCD"], "augment_to": 50, "seed": 3},
        ),
        (
            design_options("sobol", subject_to=("a <= 1",), runs=8),
            {"kind": "sobol", "runs": 8, "subject_to": ["a <= 1"]},
        ),
        (
            design_options("my:points", candidates="some.csv", runs=5),
            {"kind": "my:points", "runs": 5, "candidates": "some.csv"},
        ),
        (
            design_options("factorial", levels={"a": 3}, center=0, reduction=2),
            {"kind": "factorial", "center": 0, "levels": {"a": 3}, "reduction": 2},
        ),
    ],
)
def test_the_record_of_a_plan_stays_as_it_was(options, record):
    """Designs are up to date while this is the same: defaults and the default kind are not in it."""
    assert list(options.record.items()) == list(record.items())
