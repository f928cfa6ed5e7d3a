"""How long a job may take where the user does not say: by what runs took so far."""

from __future__ import annotations

import math
from bisect import insort

__all__ = ["PastRuns"]

FEWEST = 5
"""Runs that must have ended before anything is taken from them."""
QUANTILE = 0.99
MARGIN = 2.0
"""Times the quantile that one run may take."""
START_S = 600.0
"""For a job to begin, and for its simulator to be loaded and warm."""


class PastRuns:
    """Durations of runs that ended well."""

    def __init__(self) -> None:
        self._seconds: list[float] = []

    def add(self, seconds: float) -> None:
        """Note one."""
        insort(self._seconds, seconds)

    def job_time(self, rounds: int, timeout_s: float | None = None, doubled: int = 0) -> str:
        """Time limit of a job, HH:MM:SS; empty while too few runs have ended.

        Parameters
        ----------
        rounds : int
            Runs that one worker makes one after the other.
        timeout_s : float, optional
            Time limit of a run.
        doubled : int
            How often such a job's time was over already: each time a run may take twice as long.
        """
        if len(self._seconds) < FEWEST:
            return ""
        quantile = self._seconds[math.ceil(QUANTILE * len(self._seconds)) - 1]
        run_s = min(MARGIN * quantile * 2.0**doubled, timeout_s or math.inf)
        minutes = math.ceil((START_S + rounds * run_s) / 60.0)
        return f"{minutes // 60:02d}:{minutes % 60:02d}:00"
