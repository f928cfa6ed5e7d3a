"""The contract of a kind of factor: what designs, searches, pages and tables rely on."""

from __future__ import annotations

import json

import numpy as np

from rsmkit.language.domains import FACTOR_KINDS, Floats, Value
from rsmkit.language.space import Factor

__all__ = ["check_factor_kind"]

ROUNDING = 5.0 * float(np.finfo(float).eps)
"""Largest error of coding and decoding, in parts of the largest bound, with u = eps / 2: the coded value is
off by at most 7 u (three operations on a number of 0..1, doubled, and one more), which moves the decoded
one by half the range at most times as much, so 7 u; decoding itself adds 3 u. The unit interval adds less."""


def check_factor_kind(factor: Factor) -> None:
    """Assert that a factor's kind keeps the contract: its answers agree with each other.

    Parameters
    ----------
    factor : Factor
        An example of the kind.

    Raises
    ------
    AssertionError
        Saying which part of the contract is broken.
    """
    assert FACTOR_KINDS.get(factor.kind) is type(factor.domain), f"{factor.kind} is not in the register"
    values = _spread(factor)
    _check_levels(factor)
    _check_units(factor, values)
    _check_allowed(factor, values)
    _check_reading(factor, values)
    _check_neighbours(factor)
    _check_narrowed(factor, values)


def _spread(factor: Factor) -> Floats:
    """Allowed coordinates from end to end."""
    values = factor.domain.from_unit(np.linspace(0.0, 1.0, 200))
    assert (values[0], values[-1]) == (factor.low, factor.high), (
        "the unit interval misses an end of the range"
    )
    assert (np.diff(values) >= 0.0).all(), "the unit interval runs backwards"
    return values


def _check_levels(factor: Factor) -> None:
    domain = factor.domain
    allowed = domain.allowed
    assert len(allowed) == domain.level_count, "level_count does not count the allowed values"
    assert domain.is_continuous == (domain.level_count == 0), (
        "a continuous factor has levels, or none has none"
    )
    assert domain.categories == (0 if domain.is_numeric else domain.level_count), "categories are miscounted"
    assert (np.diff(allowed) > 0.0).all(), "allowed values do not ascend"
    for part in (0.02, 0.98):  # just inside both ends of every level's share
        unit = (np.arange(domain.level_count) + part) / max(1, domain.level_count)
        assert (domain.from_unit(unit) == allowed).all(), "levels have no equal shares of the unit interval"
    indicators = domain.indicators(allowed)
    assert indicators.shape == (domain.level_count, domain.categories), "indicators have another shape"
    assert domain.is_numeric or (indicators == np.eye(domain.categories)).all(), "indicators mix categories"


def _check_units(factor: Factor, values: Floats) -> None:
    domain = factor.domain
    size = max(abs(factor.low), abs(factor.high))
    assert (np.abs(domain.decode(domain.encode(values)) - values) <= ROUNDING * size).all(), (
        "decode does not undo encode"
    )
    assert (np.abs(domain.from_unit(domain.to_unit(values)) - values) <= ROUNDING * size).all(), (
        "from_unit does not undo to_unit"
    )
    ends = np.array([factor.low, factor.high])
    expected = [-1.0, 1.0] if domain.is_numeric else ends.tolist()
    assert domain.encode(ends).tolist() == expected, "the ends are not coded exactly"
    assert (domain.decode(domain.encode(ends)) == ends).all(), "the ends are not decoded exactly"


def _check_allowed(factor: Factor, values: Floats) -> None:
    """Whatever gives allowed coordinates gives such as snapping leaves alone."""
    domain = factor.domain
    anywhere = np.linspace(factor.low, factor.high, 101)
    given = {
        "allowed": domain.allowed,
        "from_unit": values,
        "nodes": domain.nodes(8),
        "snap": domain.snap(anywhere),
    }
    for name, x in given.items():
        assert (domain.snap(x) == x).all(), f"{name} gives values that are not allowed"
        assert ((x >= factor.low) & (x <= factor.high)).all(), f"{name} leaves the range"
    grid = domain.nodes(8)
    assert (np.diff(grid) > 0.0).all(), "nodes do not ascend"
    assert len(grid) <= max(8, len(factor.levels)), "there are more nodes than asked for"
    curve = domain.curve(5)
    assert domain.is_numeric or (curve == domain.allowed).all(), "a curve leaves out categories"
    assert (curve[0], curve[-1]) == (factor.low, factor.high), "a curve does not reach from end to end"
    coded = domain.coded_levels(len(factor.levels) or 3)
    assert (coded[[0, -1]] == domain.encode(curve[[0, -1]])).all(), "a factorial does not reach the ends"


def _check_reading(factor: Factor, values: Floats) -> None:
    """Simulator's arguments, JSON and cells of a table give back the same float."""
    domain = factor.domain
    for x in np.unique(values).tolist():
        value = domain.write(x)
        cell = domain.cell(x)
        assert isinstance(cell, str), f"the cell {cell!r} is not a text"
        for written in (value, json.loads(json.dumps(value)), cell):
            assert _read(factor, written) == x, f"{written!r} is not read as {x!r}"
    try:
        domain.read("no such value")
    except ValueError:
        pass
    else:
        raise AssertionError("nonsense is read without complaint")


def _read(factor: Factor, written: Value) -> float:
    try:
        return factor.domain.read(written)
    except ValueError as error:
        raise AssertionError(f"what was written is not read: {error}") from None


def _check_neighbours(factor: Factor) -> None:
    count = factor.domain.level_count
    for index in range(count):
        found = factor.domain.neighbours(index)
        assert set(found) <= set(range(count)) - {index}, f"level {index} has neighbours {found}"
        assert found, f"level {index} has no neighbour"
        for other in found:
            assert index in factor.domain.neighbours(other), f"{other} is a neighbour of {index}, not so back"


def _check_narrowed(factor: Factor, values: Floats) -> None:
    for x in (values[0], values[len(values) // 2], values[-1]):
        part = factor.narrowed(float(x), 0.1)
        assert part.kind == factor.kind, f"{factor.kind} becomes {part.kind} when narrowed"
        assert factor.low <= part.low <= x <= part.high <= factor.high, f"narrowed about {x:g} to {part!r}"
        inside = part.domain.from_unit(np.linspace(0.0, 1.0, 101))
        assert (factor.domain.snap(inside) == inside).all(), "narrowing makes new values"
        whole = factor.narrowed(float(x), 1.5)
        assert whole == factor, f"narrowed to more than the range about {x:g} to {whole!r}"
