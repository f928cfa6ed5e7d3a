"""What runs of the past mean to a study of today: the same call of the same simulator is the same run.

A simulator receives factors and settings as keywords and cannot tell one from the other. So a run at a value
that was a setting is a run at that value of the factor which it has become, and the other way round.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rsmkit.errors import RsmkitError
from rsmkit.language.space import Factor, Floats, Space
from rsmkit.runs.record.run import Run, canonical, key_maker

__all__ = ["Caller", "Meaning", "known_runs"]

ROUNDING = 1e-12
"""Relative; coded to natural units and back costs some 1e-16."""


@dataclass(frozen=True)
class Caller:
    """How a study calls its simulator.

    Parameters
    ----------
    identity : str
        The simulator, as keys and the journal have it.
    settings : mapping
        Arguments that are the same in every run.
    defaults : mapping
        What the simulator takes for an argument that it is not given.
    space : Space
        The other arguments.
    """

    identity: str
    settings: Mapping[str, Any]
    defaults: Mapping[str, Any]
    space: Space


class Meaning:
    """Tells which runs are runs of a study, and where they lie in its space.

    Parameters
    ----------
    caller : Caller
        The study of today.
    """

    def __init__(self, caller: Caller) -> None:
        self.caller = caller
        self._fixed: dict[str, Any] = canonical({**caller.defaults, **caller.settings})
        for name in caller.space.names:
            self._fixed.pop(name, None)
        # Most runs share their settings (one object) and the names of their factors.
        self._readers: dict[tuple[str, int, tuple[str, ...]], _Reader] = {}
        self._held: list[Mapping[str, Any]] = []  # an id is only good while its object lives

    def reader(self, run: Run) -> _Reader:
        """What runs with the same simulator, settings and names of factors have in common."""
        kind = run.simulator, id(run.settings), tuple(run.factors)
        if kind not in self._readers:
            self._held.append(run.settings)
            self._readers[kind] = self._read(run)
        return self._readers[kind]

    def is_own(self, run: Run) -> bool:
        """Whether the run has the key that this study gives it."""
        return self.reader(run).own

    def point(self, run: Run) -> Floats | str:
        """Where a run lies, natural units, shape (k,); in words why it is none of this study's runs."""
        reader = self.reader(run)
        if reader.reason:
            return reader.reason
        given = {**reader.given, **run.factors}
        for name, value in reader.fixed.items():
            if not _is_same(canonical(given[name]), value):
                return f"made at another {name} than {value!s:.60}"
        point = np.empty(len(self.caller.space))
        for j, factor in enumerate(self.caller.space):
            found = _coordinate(factor, given[factor.name])
            if found is None:
                return f"made at a {factor.name} that it cannot take any more"
            point[j] = found
        return point

    def _read(self, run: Run) -> _Reader:
        caller = self.caller
        given = {**caller.defaults, **run.settings}
        if run.simulator != caller.identity:
            return _Reader(f"made by {run.simulator:.80} (now {caller.identity:.80})")
        names = {*given, *run.factors}
        missing = [name for name in (*caller.space.names, *self._fixed) if name not in names]
        if missing:
            return _Reader(f"made without {missing[0]:.60}, so that nothing says its value")
        unknown = [name for name in names if name not in caller.space.names and name not in self._fixed]
        if unknown:
            return _Reader(f"made with {min(unknown):.60}, which the study has no more")
        own = set(run.factors) == set(caller.space.names)
        own = own and canonical(run.settings) == canonical(caller.settings)
        return _Reader("", own, given, self._fixed)


@dataclass(frozen=True)
class _Reader:
    """How runs of one kind read: not at all for a reason, or from these arguments beside their factors."""

    reason: str
    own: bool = False
    given: Mapping[str, Any] = field(default_factory=dict)
    fixed: Mapping[str, Any] = field(default_factory=dict)


def known_runs(caller: Caller, journaled: Mapping[str, Run]) -> Mapping[str, Run]:
    """Runs by the key they have in this study, those that were called otherwise when they were made included.

    Parameters
    ----------
    caller : Caller
        The study of today.
    journaled : mapping of str to Run
        What the journal has.
    """
    meaning = Meaning(caller)
    key: Callable[[Mapping[str, Any], int], str] | None = None
    others: dict[str, Run] = {}
    for run in journaled.values():
        reader = meaning.reader(run)
        if reader.own or reader.reason:
            continue
        point = meaning.point(run)
        if isinstance(point, str):
            continue
        key = key or key_maker(caller.identity, caller.settings)
        name = key(caller.space.values(point), run.replicate)
        if run.done or (name not in journaled and name not in others):
            others[name] = run
    others = {name: run for name, run in others.items() if name not in journaled or not journaled[name].done}
    return {**journaled, **others} if others else journaled


def _is_same(one: Any, other: Any) -> bool:
    """Whether two arguments are the same; a centre that was computed differs from one that was typed."""
    if isinstance(one, float) and isinstance(other, float):
        return math.isclose(one, other, rel_tol=ROUNDING)
    return bool(one == other)


def _coordinate(factor: Factor, value: Any) -> float | None:
    """The coordinate at which the factor has exactly this value; None where there is none."""
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        return None
    try:
        found = factor.coordinate(value)
        return found if canonical(factor.value(found)) == canonical(value) else None
    except (RsmkitError, ValueError, OverflowError):
        return None
