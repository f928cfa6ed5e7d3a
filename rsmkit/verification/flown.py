"""What the simulator said of one point: its runs, or why there are none."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rsmkit.language.space import Floats
from rsmkit.runs.record.run_table import Runs

__all__ = ["NOISY_REPLICATES", "Flown", "flown_at"]

NOISY_REPLICATES = 4
"""Runs of an optimum whose runs differ: their mean has half the noise of one."""


@dataclass(frozen=True)
class Flown:
    """What the simulator said of one point.

    Parameters
    ----------
    runs : tuple of mapping
        Responses of each run that succeeded; several are replicates.
    error : str
        Why the others failed, if any did.
    """

    runs: tuple[Mapping[str, float], ...]
    error: str = ""


def flown_at(runs: Runs, point: Floats) -> Flown:
    """All runs of one point, shape (k,); a run that several rows share counts once."""
    rows = np.flatnonzero((runs.points == point).all(axis=1))
    made = {run.key: run for row in rows if (run := runs.runs[row]) is not None}
    good = [run for run in made.values() if run.answers(runs.responses)]
    bad = [f"{run.status}: {run.error}" for run in made.values() if not run.answers(runs.responses)]
    values = tuple({name: run.value(name) for name in runs.responses} for run in good)
    return Flown(values, bad[0] if bad else "")
