"""Runs made by hand, as the journal has them: how they are found, and those the design does not have."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from rsmkit.errors import RsmkitError
from rsmkit.language.space import Floats, Space, Value
from rsmkit.runs.agenda import make_task
from rsmkit.runs.one_run.simulator import Simulator
from rsmkit.runs.options import SimulatorOptions
from rsmkit.runs.record.journal import Journal
from rsmkit.runs.record.run import ACTUAL, EXCLUDED, KIND, Run
from rsmkit.runs.record.run_table import Runs

__all__ = [
    "ADDED",
    "BESIDE_THE_PLAN",
    "CONFIRMATION",
    "OPTIMUM",
    "UNPLANNED",
    "Correction",
    "added_runs",
    "corrections",
    "differences",
    "hand_key",
    "laboratory",
    "off_plan",
    "outside_words",
    "place_words",
    "planned_keys",
    "remarks",
    "value_words",
]

ADDED = "added"
"""Kind of a run that was not planned and counts all the same."""
UNPLANNED = "unplanned"
"""Kind of a run that was not planned and is only kept."""
CONFIRMATION = "confirmation"
"""Kind of a run that the surfaces are compared with, and not fitted to."""
OPTIMUM = "optimum"
"""Kind of a run at a predicted optimum."""
BESIDE_THE_PLAN = 1000
"""First replicate of runs at a planned point that are not the planned ones, which may become more."""


@dataclass(frozen=True)
class Correction:
    """A value that a later one has replaced; both stay in the journal.

    Parameters
    ----------
    run : str
        Which run, in words.
    name : str
        Of the response, the setting or the remark.
    old, new : str
    """

    run: str
    name: str
    old: str
    new: str

    @property
    def sentence(self) -> str:
        """The correction in words."""
        return f"{self.run}: {self.name} {self.old} was corrected to {self.new}"


def laboratory(folder: Path) -> Simulator:
    """Give the stand-in for a simulator by which runs made by hand are found in the journal."""
    return Simulator(SimulatorOptions(deterministic=False), folder)


def hand_key(factors: dict[str, Value], replicate: int) -> str:
    """Give the key of a run made by hand."""
    return make_task(laboratory(Path()), factors, replicate).key


def planned_keys(space: Space, points: Floats) -> list[str]:
    """Keys of the runs of points, shape (n, k); repeated points are replicates in their order."""
    seen: Counter[tuple[float, ...]] = Counter()
    keys = []
    for point in points:
        place = tuple(point.tolist())
        keys.append(hand_key(space.values(point), seen[place]))
        seen[place] += 1
    return keys


def off_plan(space: Space, known: Mapping[str, Run], keys: Collection[str]) -> list[Run]:
    """Runs made by hand that are none of the plan's, oldest first; only those of these factors."""
    found = []
    for key, run in known.items():
        if run.by_hand and key not in keys:
            try:
                space.point(run.factors)
            except RsmkitError:  # of an earlier set of factors or levels
                continue
            found.append(run)
    return found


def added_runs(planned: Runs, known: Mapping[str, Run]) -> Runs | None:
    """Runs of the journal outside the plan that count in fits; None where there is none."""
    keys = set(planned_keys(planned.space, planned.points))
    more = [run for run in off_plan(planned.space, known, keys) if run.extras.get(KIND) == ADDED]
    if not more:
        return None
    points = np.array([planned.space.point(run.factors) for run in more])
    return Runs(planned.space, points, tuple(more), planned.responses)


def differences(old: Run, new: Run, names: Iterable[str]) -> list[tuple[str, str, str]]:
    """What a later record of a run says differently: name, old text, new text."""
    found = []
    asked = tuple(dict.fromkeys((*names, *old.responses, *new.responses)))
    for name in asked:
        before, after = old.value(name), new.value(name)
        if before == before and before != after:
            found.append((name, value_words(before), value_words(after) if after == after else "withdrawn"))
    for name, value in old.extras.items():
        if name in asked or name == KIND:
            continue
        after_extra = new.extras.get(name)
        if value != after_extra:
            shown = "excluded" if name == EXCLUDED else name
            gone = {EXCLUDED: "no"}.get(name, "as planned" if name.endswith(ACTUAL) else "withdrawn")
            later = gone if after_extra is None else value_words(after_extra)
            found.append((shown, value_words(value), later))
    return found


def corrections(journal: Journal, runs: Mapping[str, Run], names: Sequence[str]) -> list[Correction]:
    """Every value of runs (by their name in words) that was corrected, oldest first."""
    found = []
    for label, run in runs.items():
        records = [*journal.earlier(run.key), run]
        for old, new in pairwise(records):
            found += [Correction(label, *item) for item in differences(old, new, names)]
    return found


def remarks(runs: Iterable[Run], names: Collection[str]) -> list[str]:
    """Names of what was noted beside the measurements of runs made by hand: comments, batches."""
    found = (name for run in runs if run.by_hand for name in run.extras)
    own = {KIND, EXCLUDED, *names}
    return [name for name in dict.fromkeys(found) if name not in own and not name.endswith(ACTUAL)]


def value_words(value: object) -> str:
    """A value as people write it."""
    return f"{value:.10g}" if isinstance(value, float) else str(value)


def outside_words(kind: str, factors: Mapping[str, Value], replicate: int) -> str:
    """Name a run that is none of the design's, each of several at a point by its own name."""
    what = "run at the optimum" if kind == OPTIMUM else f"{kind} run at"
    again = replicate % BESIDE_THE_PLAN
    return f"the {what} {place_words(factors)}" + (f" (repetition {again + 1})" if again else "")


def place_words(factors: Mapping[str, Value]) -> str:
    """Settings in words: ``T_C = 151, cat = Pd``."""
    return ", ".join(f"{name} = {value_words(value)}" for name, value in factors.items())
