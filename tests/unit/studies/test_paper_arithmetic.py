"""What the paper's own printed numbers say about each other (data: studies/reentry/printed.py)."""

import importlib.util
import math
from decimal import ROUND_DOWN, Decimal
from itertools import permutations
from pathlib import Path

import pytest

_SOURCE = Path(__file__).parents[3] / "studies" / "reentry" / "printed.py"
_SPEC = importlib.util.spec_from_file_location("printed", _SOURCE)
printed = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(printed)


def weighted_sum(weights, row):
    return sum(Decimal(str(w)) * Decimal(value) for w, value in zip(weights, row[:3], strict=True))


def dominated_pairs(rows):
    """Pairs (i, j), counted from 1, where row i is nowhere larger than row j."""
    values = [tuple(Decimal(v) for v in row[:3]) for row in rows]
    return [
        (i + 1, j + 1)
        for i, j in permutations(range(len(values)), 2)
        if all(a <= b for a, b in zip(values[i], values[j], strict=True))
    ]


def test_calculated_value_of_table_9_is_the_ga_row_of_table_7_with_other_weights():
    row = printed.PARETO[printed.GA_ROW]
    value = weighted_sum(printed.WEIGHTS_TABLE_9, row)
    assert value.quantize(Decimal("0.001")) == Decimal(printed.CALCULATED_VALUE)


def test_no_other_order_of_the_weights_gives_it():
    row = printed.PARETO[printed.GA_ROW]
    fitting = [
        order
        for order in permutations((0.1, 0.2, 0.7))
        if abs(weighted_sum(order, row) - Decimal(printed.CALCULATED_VALUE)) < Decimal("0.001")
    ]
    assert fitting == [printed.WEIGHTS_TABLE_9]


def test_weights_of_table_1_give_about_twice_that_value():
    row = printed.PARETO[printed.GA_ROW]
    value = weighted_sum(printed.WEIGHTS_TABLE_1, row)
    assert float(value) == pytest.approx(1.038037e12, rel=5e-7)
    assert float(Decimal(printed.REAL_VALUE) / value) == pytest.approx(0.545, abs=5e-4)


def test_difference_of_table_9_is_relative_to_the_real_value():
    calculated, real = Decimal(printed.CALCULATED_VALUE), Decimal(printed.REAL_VALUE)
    assert round(float(100 * (real - calculated) / real), 4) == printed.VALUE_DIFFERENCE_PCT
    assert round(float(100 * (real - calculated) / calculated), 2) == 8.19


def test_first_objective_carries_the_printed_sum():
    row = printed.PARETO[printed.GA_ROW]
    shares = {
        name: float(Decimal(str(weights[0])) * Decimal(row[0]) / weighted_sum(weights, row))
        for name, weights in (("1", printed.WEIGHTS_TABLE_1), ("9", printed.WEIGHTS_TABLE_9))
    }
    assert shares["1"] == pytest.approx(0.995, abs=5e-4)
    assert shares["9"] == pytest.approx(0.988, abs=5e-4)


def test_table_7_is_not_a_pareto_set():
    assert dominated_pairs(printed.PARETO) == [(1, 2), (1, 3), (1, 4), (2, 3)]


def test_table_7_would_be_one_with_the_third_objective_maximised():
    turned = [(f1, f2, str(-Decimal(f3))) for f1, f2, f3, *_ in printed.PARETO]
    assert dominated_pairs(turned) == []


def test_first_row_of_table_7_beats_the_ga_optimum():
    values = [weighted_sum(printed.WEIGHTS_TABLE_1, row) for row in printed.PARETO]
    gain = [100 * (1 - float(value / values[printed.GA_ROW])) for value in values]
    assert gain[0] == pytest.approx(10.8, abs=0.05)
    assert gain[3] == pytest.approx(3.8, abs=0.1)


def test_swapped_columns_of_table_7_lie_within_the_bounds_of_table_1():
    (low_1, high_1), (low_2, high_2), (low_r, high_r) = printed.BOUNDS.values()
    for *_, theta_c1, theta_c2, radius in printed.PARETO:
        assert low_1 <= math.degrees(theta_c1) <= high_1
        assert low_2 <= math.degrees(theta_c2) <= high_2
        assert low_r <= radius <= high_r
        assert not low_1 <= math.degrees(radius) <= high_1  # as printed, the radius stands under thetac1


def test_swapped_ga_row_of_table_7_is_that_of_table_8():
    assert printed.PARETO[printed.GA_ROW][3:] == tuple(round(value, 4) for value in printed.GA_OPTIMUM)


def test_differences_of_table_8_are_relative_to_the_ga():
    """The printed RSM values have four digits; the printed differences must lie within their rounding."""
    table = zip(printed.GA_OPTIMUM, printed.RSM_OPTIMUM, printed.OPTIMUM_DIFFERENCE_PCT, strict=True)
    for ga, rsm, difference in table:
        half_a_digit = 100 * 0.5e-4 / ga
        assert abs(100 * abs(rsm - ga) / ga - difference) <= half_a_digit


def test_differences_of_table_8_are_not_relative_to_the_rsm_optimum():
    """Solved for the unrounded RSM value, that formula gives numbers that round to other digits."""
    solved = [
        ga / (1 + math.copysign(d, ga - rsm) / 100)
        for ga, rsm, d in zip(
            printed.GA_OPTIMUM, printed.RSM_OPTIMUM, printed.OPTIMUM_DIFFERENCE_PCT, strict=True
        )
    ]
    assert [round(value, 4) for value in solved][:2] == [0.1597, 0.1880]
    assert printed.RSM_OPTIMUM[:2] == (0.1596, 0.1879)


@pytest.mark.parametrize("name", ["CA", "CN", "Cm"])
def test_differences_of_tables_4_to_6_are_truncated_not_rounded(name):
    for *_, cfd, subroutine, difference in printed.AERODYNAMICS[name]:
        cfd, subroutine, difference = (Decimal(str(value)) for value in (cfd, subroutine, difference))
        exact = 100 * (subroutine - cfd) / cfd if cfd else Decimal(0)
        assert exact.quantize(difference, rounding=ROUND_DOWN) == difference


def test_largest_difference_of_table_4_is_not_the_23_per_cent_of_the_text():
    assert max(abs(row[-1]) for row in printed.AERODYNAMICS["CA"]) == 24.37
