"""What one wave of a refinement runs, and what was hoped for."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from rsmkit.language.space import Floats

__all__ = ["Plan", "Turns"]


@dataclass
class Plan:
    """Points of a wave, why each, and what was promised.

    Parameters
    ----------
    points : list of array, shape (k,)
        In units of the cube.
    kinds : list of str
        One of each point.
    model : str
        The best one around the centre.
    promised, better : float
        Gain on the centre, and on the best run.
    risked : float
        Gain on the best run where runs may as well fail; nan while none has failed.
    feasible : bool
        Whether the model knows a feasible point.
    expected, boldly : float
        Expected improvement anywhere; that with standard deviations taken larger.
    """

    points: list[Floats] = field(default_factory=list)
    kinds: list[str] = field(default_factory=list)
    model: str = "no model"
    promised: float = math.nan
    better: float = math.nan
    risked: float = math.nan
    feasible: bool = False
    expected: float = math.inf
    boldly: float = math.inf


@dataclass
class Turns:
    """Which kinds of run a wave holds; of waves of one run, whose turn it is.

    Parameters
    ----------
    local_failed : bool
        Whether the last wave tried a model around the best run and gained nothing.
    wide_next : bool
        Whose turn it is of two.
    """

    local_failed: bool = False
    wide_next: bool = False

    def kinds(
        self, count: int, local: int, *, wide: bool, quiet: bool, hopeful: bool, secondary: bool
    ) -> list[str]:
        """Share out a wave.

        Parameters
        ----------
        count : int
            Runs.
        local : int
            Proposals of models around the centre.
        wide : bool
            Whether there is a wide proposal.
        quiet : bool
            Whether the models around the best run promise nothing.
        hopeful : bool
            Whether anything is expected elsewhere.
        secondary : bool
            Whether the region is not around the best run.
        """
        if count < 1:
            return []
        if count == 1:
            return [self._one(local, wide=wide, quiet=quiet)]
        explored = max(1, count // 4) if hopeful else 0
        if quiet:
            explored = count - 1
        if secondary:
            explored = max(explored, count // 2)
        kinds = ["wide"] if wide and count > explored + 1 else []
        kept = min(local, count - explored - len(kinds))
        return ["local"] * kept + kinds + ["global"] * explored

    def _one(self, local: int, *, wide: bool, quiet: bool) -> str:
        if not local:
            return "wide" if wide else "global"
        if self.local_failed:
            self.local_failed = False
            self.wide_next = not self.wide_next
            return "wide" if wide and self.wide_next else "global"
        if quiet:
            self.wide_next = not self.wide_next
            return "global" if self.wide_next else "local"
        return "local"
