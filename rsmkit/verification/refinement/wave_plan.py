"""What one wave of a refinement runs, and what was hoped for."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from rsmkit.language.space import Floats

__all__ = ["Plan"]


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
