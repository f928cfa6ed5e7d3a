"""What holds for every number of factors and runs."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from rsmkit.design.design import Design
from rsmkit.design.families.composite import ccd
from rsmkit.design.families.space_filling import latin_hypercube
from rsmkit.design.optimal.optimal_design import augment, optimal_design
from rsmkit.design.quality.assessment import assess
from rsmkit.design.region import ball, box
from rsmkit.language.space import Factor, Space
from rsmkit.language.terms import full_terms

FEW = settings(max_examples=8)


def space(k: int) -> Space:
    return Space(Factor(f"x{j + 1}", -1.0, 3.0 + j) for j in range(k))


@FEW
@given(
    k=st.integers(1, 3), extra=st.integers(0, 6), seed=st.integers(0, 99), criterion=st.sampled_from("DAI")
)
def test_optimal_designs_are_inside_sound_and_reproducible(k, extra, seed, criterion):
    runs = (k + 1) * (k + 2) // 2 + extra
    first, second = (
        optimal_design(space(k), runs, criterion=criterion, starts=2, seed=seed) for _ in range(2)
    )
    assert first.points.tobytes() == second.points.tobytes()
    assert space(k).contains(first.points).all()
    assert assess(first).rank == (k + 1) * (k + 2) // 2
    X = full_terms(k).matrix(first.coded)
    if criterion == "D":
        np.testing.assert_allclose(np.linalg.slogdet(X.T @ X)[1], first.found.value, atol=1e-5)


@FEW
@given(k=st.integers(2, 4), added=st.integers(1, 8), distance=st.floats(0.05, 0.3), seed=st.integers(0, 99))
def test_augmentation_keeps_its_distance_and_what_was_given(k, added, distance, seed):
    start = ccd(space(k), center=1)
    design = augment(start, len(start) + added, min_distance=distance, starts=2, seed=seed)
    assert design.points[: len(start)].tobytes() == start.points.tobytes()
    gaps = np.linalg.norm(design.coded[:, None, :] - design.coded[None, :, :], axis=2)
    gaps[np.diag_indices(len(design))] = np.inf
    assert gaps[len(start) :].min() >= distance * (1 - 1e-6)


@FEW
@given(k=st.integers(2, 5), center=st.integers(0, 4), alpha=st.floats(0.5, 3.0))
def test_composite_designs_are_balanced(k, center, alpha):
    coded = ccd(space(k), alpha=alpha, center=center).coded
    np.testing.assert_allclose(coded.sum(axis=0), 0.0, atol=1e-11)
    second = coded.T @ coded
    np.testing.assert_allclose(second, (2**k + 2 * alpha**2) * np.eye(k), atol=1e-10)


@FEW
@given(k=st.integers(1, 6), runs=st.integers(2, 15), seed=st.integers(0, 999))
def test_latin_hypercubes_are_latin(k, runs, seed):
    unit = (latin_hypercube(space(k), runs, seed=seed).coded + 1) / 2
    for column in unit.T:
        np.testing.assert_allclose(np.sort(column), (np.arange(runs) + 0.5) / runs, atol=1e-12)


@FEW
@given(k=st.integers(1, 5), seed=st.integers(0, 99), offset=st.floats(-0.5, 0.9))
def test_samples_lie_in_their_region(k, seed, offset):
    def margin(points):
        return offset - space(k).encode(points)[:, 0]

    region = box(space(k), constraints=[margin])
    assert region.nonlinear == ()
    assert region.contains(region.sample(20, seed)).all()
    round_ = ball(space(k))
    assert (np.linalg.norm(round_.sample(50, seed), axis=1) <= np.sqrt(k) * (1 + 1e-9)).all()


@FEW
@given(values=st.lists(st.tuples(*[st.floats(-1e150, 1e150)] * 2), min_size=1, max_size=8))
def test_tables_survive_a_file(tmp_path_factory, values):
    plane = Space(a=(0.0, 1.0), b=(-3.0, 7.0))
    design = Design(plane, np.array(values), ("given",) * len(values))
    path = tmp_path_factory.mktemp("table") / "design.csv"
    design.to_csv(path)
    assert np.array_equal(Design.from_csv(path, plane).points, design.points)
