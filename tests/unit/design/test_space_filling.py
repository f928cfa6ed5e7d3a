"""Space-filling designs."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.distance import pdist
from scipy.stats import qmc

from rsmkit.design.build import build_design
from rsmkit.design.families.composite import ccd
from rsmkit.design.families.registry import design_options
from rsmkit.design.families.space_filling import fill, halton, latin_hypercube, sobol
from rsmkit.design.region import box
from rsmkit.errors import RsmkitError
from rsmkit.language.space import Space

SPACE = Space(a=(0.0, 1.0), b=(0.0, 1.0), c=(0.0, 1.0))


@pytest.mark.parametrize("spread", ["maximin", "discrepancy", "correlation"])
def test_latin_hypercube_has_one_point_in_every_slice(spread):
    design = latin_hypercube(SPACE, 20, spread=spread, centered=False, seed=3)
    for column in design.points.T:
        assert sorted((column * 20).astype(int)) == list(range(20))


def test_each_spread_does_what_it_says():
    plain = [latin_hypercube(SPACE, 20, spread="discrepancy", seed=s) for s in range(3)]
    random = [
        qmc.LatinHypercube(3, rng=np.random.default_rng(s), scramble=False).random(20) for s in range(3)
    ]
    best_random = min(qmc.discrepancy(x) for x in random)
    assert all(qmc.discrepancy(d.points) < best_random for d in plain)
    far = latin_hypercube(SPACE, 20, spread="maximin")
    assert pdist(far.points).min() > 1.3 * max(pdist(x).min() for x in random)
    flat = latin_hypercube(SPACE, 20, spread="correlation")
    assert np.abs(np.corrcoef(flat.points, rowvar=False) - np.eye(3)).max() < 0.01


def test_known_maximin_latin_hypercube():
    """The 5-run design in two factors: squared distance 5 in units of a slice (van Dam et al. 2007)."""
    best = max(pdist(latin_hypercube(Space(a=(0, 1), b=(0, 1)), 5, seed=s).points).min() for s in range(8))
    assert (5 * best) ** 2 == pytest.approx(5.0)


def test_sequences_are_those_of_scipy():
    assert np.array_equal(
        sobol(SPACE, 16, seed=4).points, qmc.Sobol(3, rng=np.random.default_rng(4)).random(16)
    )
    assert np.array_equal(
        halton(SPACE, 9, seed=4).points, qmc.Halton(3, rng=np.random.default_rng(4)).random(9)
    )


def test_levels_are_used_equally_often():
    mixed = Space(n=[1.0, 2.0, 5.0], tool=["A", "B", "C"], count=[0.0, 1.0])
    points = latin_hypercube(mixed, 18).points
    assert [int((points[:, 1] == level).sum()) for level in range(3)] == [6, 6, 6]
    assert [int((points[:, 0] == value).sum()) for value in (1.0, 2.0, 5.0)] == [6, 6, 6]


def test_filling_keeps_the_given_points_and_stays_away_from_them():
    start = ccd(SPACE, star="faced", center=1)
    design = fill(start, 30)
    assert design.points[:15].tobytes() == start.points.tobytes()
    assert design.kinds[15:] == ("space-filling",) * 15
    assert pdist(design.coded).min() > 0.5
    assert SPACE.contains(design.points).all()
    assert fill(start, 30).points.tobytes() == design.points.tobytes()


def test_filling_respects_constraints():
    def margin(points):
        return 0.25 - ((points - 0.5) ** 2).sum(axis=1)

    start = ccd(SPACE, star="inscribed", center=1)
    design = fill(start, 30, region=box(SPACE, constraints=[margin]))
    assert (margin(design.points[15:]) >= -1e-9).all()


def test_fewer_runs_than_given_are_refused():
    with pytest.raises(RsmkitError, match="15 runs already"):
        fill(ccd(SPACE, center=1), 10)
    with pytest.raises(RsmkitError, match="at least 2 runs"):
        latin_hypercube(SPACE, 1)


LEVELS = Space(a=["p", "q", "r"], b=[1.0, 2.0, 3.0, 5.0])


@pytest.mark.parametrize("kind", ["latin-hypercube", "sobol", "halton", "maximin"])
@pytest.mark.parametrize("runs", [5, 12, 15, 24])
@pytest.mark.parametrize("constraint", [None, lambda x: x[:, 0] + x[:, 1] - 1.5])
def test_no_point_is_repeated_while_another_is_free(kind, runs, constraint):
    """Of the 12 points the constraint forbids one, (p, 1)."""
    constraints = [] if constraint is None else [constraint]
    design = build_design(LEVELS, design_options(kind, runs=runs), constraints=constraints)
    total = 12 - len(constraints)
    _, times = np.unique(design.points, axis=0, return_counts=True)
    whole, rest = divmod(runs, total)
    assert len(design) == runs
    assert sorted(times) == [whole] * ((total - rest) * (whole > 0)) + [whole + 1] * rest


@pytest.mark.parametrize("family", [latin_hypercube, sobol, halton])
def test_levels_are_equally_frequent(family):
    for seed in range(5):
        for column in family(LEVELS, 10, seed=seed).points.T:
            assert np.ptp(np.unique(column, return_counts=True)[1]) <= 1


def test_sequences_in_a_space_too_large_to_list():
    wide = Space(**{f"x{j}": [float(v) for v in range(9)] for j in range(6)})
    assert sobol(wide, 200).distinct == halton(wide, 200).distinct == 200
