"""The paper's three objectives and their weighted sum (its Table 1 and Table 9), and other measures for them.

    F1 = scale * integral of CA dt          to be small: little drag along the flight
    F2 = integral of the heat flux dt       to be small
    F3 = scale / integral of |st| dt        to be small: a large static margin
    objective = w1 F1 + w2 F2 + w3 F3

The paper writes sums over the samples of its integration, ``10e6*Sum(Cx)``, ``Sum(flux)`` and
``10e6*(1/Sum(abs(st)))``, which depend on the step; here they are integrals over time unless the sums are
asked for. ``10e6`` is 1e7. Table 1 prints the weights 0.2, 0.7, 0.1; the first number of Table 9 is
reproduced to its last digit by 0.1, 0.7, 0.2 from Table 7.

The paper's measures hold for a vehicle that flies nose first. One that turns over has CA < 0, so F1 rewards
it, and F3 takes its large negative margin for a large one: search under ``mean_static_margin >= 0``, or take
other measures from the registers below.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sim.core.errors import InputError
from sim.flight.dynamics import (
    ABS_MARGIN_INTEGRAL,
    AXIAL_INTEGRAL,
    DRAG_INTEGRAL,
    MARGIN_INTEGRAL,
    STAGNATION_HEAT,
    STAGNATION_INFLOW,
    SURFACE_HEAT,
    SURFACE_INFLOW,
)
from sim.flight.history import History

__all__ = [
    "AXIAL_MEASURES",
    "HEAT_MEASURES",
    "MARGIN_MEASURES",
    "WEIGHTS",
    "Objectives",
    "Totals",
    "objectives",
    "totals",
    "weighted",
]

WEIGHTS = {"table1": (0.2, 0.7, 0.1), "table9": (0.1, 0.7, 0.2)}


@dataclass(frozen=True)
class Totals:
    """A flight's accumulated responses: integrals over time, or (paper) sums over equally spaced samples.

    Units are those of the integrals; sums lack the factor s. An *inflow* leaves out what a wall hotter than
    the air around it gives back; the heat without that word is the balance of both.
    """

    axial_s: float
    stagnation_heat_J_m2: float
    surface_heat_J: float
    margin_s: float
    absolute_margin_s: float
    drag_s: float
    stagnation_heat_inflow_J_m2: float
    surface_heat_inflow_J: float


@dataclass(frozen=True)
class Objectives:
    """F1, F2, F3 of the paper."""

    axial: float
    heat: float
    margin_inverse: float


def _inverse_of_absolute(total: Totals, scale: float) -> float:
    if total.absolute_margin_s == 0.0:
        raise InputError(
            "the static margin is zero all along the flight: F3 = 1 / integral of |st| is undefined"
        )
    return scale / total.absolute_margin_s


Measure = Callable[[Totals, float], float]

AXIAL_MEASURES: dict[str, Measure] = {
    "axial_force": lambda total, scale: scale * total.axial_s,
    "drag": lambda total, scale: scale * total.drag_s,
}
"""F1, ``scale`` times s: the integral of CA (the paper's; negative base first) or of CD (never negative)."""
HEAT_MEASURES: dict[str, Callable[[Totals], float]] = {
    "stagnation": lambda total: total.stagnation_heat_J_m2,
    "stagnation_inflow": lambda total: total.stagnation_heat_inflow_J_m2,
    "surface": lambda total: total.surface_heat_inflow_J,
    "surface_balance": lambda total: total.surface_heat_J,
}
"""F2: at the stagnation point in J/m2, the balance (the paper's sum of the flux) or the inflow; over the
surface in J, the inflow or the balance."""
MARGIN_MEASURES: dict[str, Measure] = {
    "inverse_absolute": _inverse_of_absolute,
    "negated": lambda total, scale: -scale * total.margin_s,
}
"""F3, ``scale`` times 1/s or s: the reciprocal of the integral of |st| (the paper's; an unstable vehicle
looks as good as a stable one), or the integral of st with its sign turned (smooth; negative when stable)."""


def totals(history: History, *, sum_interval_s: float | None = None) -> Totals:
    """Accumulate the responses of a flight.

    Parameters
    ----------
    history : History
    sum_interval_s : float, optional
        When given, add up samples this far apart instead of integrating.
    """
    if sum_interval_s is None:
        state = history.path.states[-1]
        indices = (
            AXIAL_INTEGRAL,
            STAGNATION_HEAT,
            SURFACE_HEAT,
            MARGIN_INTEGRAL,
            ABS_MARGIN_INTEGRAL,
            DRAG_INTEGRAL,
            STAGNATION_INFLOW,
            SURFACE_INFLOW,
        )
        return Totals(*(float(state[i]) for i in indices))
    end = float(history.path.time_s[-1])
    if not sum_interval_s > 1e-6 * end:
        raise InputError(
            f"sum_interval_s must be positive (a millionth of the flight or more), not {sum_interval_s}"
        )
    samples = history.at(np.arange(0.0, end, sum_interval_s))
    margin, flux = samples["static_margin"], samples["stagnation_heat_flux_W_m2"]
    return Totals(
        float(samples["CA"].sum()),
        float(flux.sum()),
        float(samples["surface_heat_rate_W"].sum()),
        float(np.where(samples["total_alpha_deg"] > 90.0, -np.abs(margin), margin).sum()),
        float(np.abs(margin).sum()),
        float(samples["CD"].sum()),
        float(np.maximum(flux, 0.0).sum()),
        float(samples["surface_heat_inflow_W"].sum()),
    )


def objectives(
    total: Totals,
    *,
    heat: str = "stagnation",
    scale: float = 1e7,
    axial: str = "axial_force",
    margin: str = "inverse_absolute",
) -> Objectives:
    """F1, F2, F3 from the accumulated responses, by the words of the three registers above.

    Raises
    ------
    InputError
        When the static margin is zero all along the flight and F3 is its reciprocal.
    """
    return Objectives(
        AXIAL_MEASURES[axial](total, scale),
        HEAT_MEASURES[heat](total),
        MARGIN_MEASURES[margin](total, scale),
    )


def weighted(values: Objectives, weights: tuple[float, float, float]) -> float:
    """The paper's scalar objective."""
    return weights[0] * values.axial + weights[1] * values.heat + weights[2] * values.margin_inverse
