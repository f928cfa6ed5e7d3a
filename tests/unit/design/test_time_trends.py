"""Trends over the order of runs, and budgets of runs."""

import numpy as np
import pytest

from rsmkit.design.families.two_level.factorial import full_factorial
from rsmkit.design.quality.allocation import allocate_runs
from rsmkit.design.quality.time_trends import run_order_trends
from rsmkit.errors import RsmkitError
from rsmkit.language.space import Factor, Space
from rsmkit.language.terms import full_terms


def test_time_counts_of_a_standard_order_are_powers_of_two():
    """A 2^3 in standard order has time counts 4, 8 and 16, and none for products (sums by hand)."""
    space = Space([Factor(name, -1.0, 1.0) for name in "abc"])
    found = run_order_trends(full_factorial(space), terms=full_terms(space, 3).subset(
        [e for e in full_terms(space, 3).exponents if max(e) < 2]
    ), degree=2)  # fmt: skip
    counts = dict(zip(found.names, found.time_count, strict=True))
    assert [counts[n] for n in ("a", "b", "c")] == [4.0, 8.0, 16.0]
    assert [counts[n] for n in ("a*b", "a*c", "b*c", "a*b*c")] == pytest.approx([0.0] * 4, abs=1e-12)
    # the linear trend has length sqrt(42), every column sqrt(8)
    assert found.of_group("FO")[:, 0] == pytest.approx(np.array([4, 8, 16]) / np.sqrt(8 * 42), rel=1e-12)
    assert found.level_changes == {"a": 7, "b": 3, "c": 1}
    with pytest.raises(RsmkitError, match="1 to 7"):
        run_order_trends(full_factorial(space), order=1, degree=8)


def test_a_budget_goes_where_the_noise_is():
    """Twelve runs, one setting nine times as variable: three and nine, variance 1/3 + 1."""
    splits = allocate_runs(12, variances=(1.0, 9.0))
    assert [s.runs for s in splits] == [(n, 12 - n) for n in range(1, 12)]
    best = max(splits, key=lambda split: split.efficiency)
    assert (best.runs, best.efficiency) == ((3, 9), 100.0)
    assert best.variance == pytest.approx(4 / 3, rel=1e-12)
    assert splits[0].variance == pytest.approx(1 + 9 / 11, rel=1e-12)


def test_a_dear_setting_gets_fewer_runs():
    assert allocate_runs(0.3, costs=(0.1, 0.1))[-1].runs == (2, 1)
    assert [s.runs for s in allocate_runs(7, costs=(2, 1))] == [(1, 5), (2, 3), (3, 1)]
    for wrong in (
        {"budget": 1.5},
        {"budget": 3, "costs": (0.0, 1.0)},
        {"budget": 9, "variances": (1, float("nan"))},
    ):
        with pytest.raises(RsmkitError, match="allocation"):
            allocate_runs(**wrong)
