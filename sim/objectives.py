"""The paper's three objectives and their weighted sum (its Table 1 and Table 9).

    F1 = scale * integral of CA dt          to be small: little drag along the flight
    F2 = integral of the heat flux dt       to be small
    F3 = scale / integral of |st| dt        to be small: a large static margin
    objective = w1 F1 + w2 F2 + w3 F3

The paper writes sums over the samples of its integration, ``10e6*Sum(Cx)``, ``Sum(flux)`` and
``10e6*(1/Sum(abs(st)))``, which depend on the step; here they are integrals over time unless the sums are
asked for. ``10e6`` is 1e7. Table 1 prints the weights 0.2, 0.7, 0.1; the first number of Table 9 is
reproduced to its last digit by 0.1, 0.7, 0.2 from Table 7.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from sim.core.errors import InputError
from sim.flight.dynamics import (
    ABS_MARGIN_INTEGRAL,
    AXIAL_INTEGRAL,
    MARGIN_INTEGRAL,
    STAGNATION_HEAT,
    SURFACE_HEAT,
)
from sim.flight.history import History

__all__ = ["WEIGHTS", "Objectives", "Totals", "objectives", "totals", "weighted"]

WEIGHTS = {"table1": (0.2, 0.7, 0.1), "table9": (0.1, 0.7, 0.2)}


@dataclass(frozen=True)
class Totals:
    """A flight's accumulated responses: integrals over time, or (paper) sums over equally spaced samples.

    Units are those of the integrals; sums lack the factor s.
    """

    axial_s: float
    stagnation_heat_J_m2: float
    surface_heat_J: float
    margin_s: float
    absolute_margin_s: float


@dataclass(frozen=True)
class Objectives:
    """F1, F2, F3 of the paper."""

    axial: float
    heat: float
    margin_inverse: float


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
        indices = (AXIAL_INTEGRAL, STAGNATION_HEAT, SURFACE_HEAT, MARGIN_INTEGRAL, ABS_MARGIN_INTEGRAL)
        return Totals(*(float(state[i]) for i in indices))
    end = float(history.path.time_s[-1])
    if not sum_interval_s > 1e-6 * end:
        raise InputError(
            f"sum_interval_s must be positive (a millionth of the flight or more), not {sum_interval_s}"
        )
    samples = history.at(np.arange(0.0, end, sum_interval_s))
    margin = samples["static_margin"]
    return Totals(
        float(samples["CA"].sum()),
        float(samples["stagnation_heat_flux_W_m2"].sum()),
        float(samples["surface_heat_rate_W"].sum()),
        float(margin.sum()),
        float(np.abs(margin).sum()),
    )


def objectives(total: Totals, *, heat: Literal["stagnation", "surface"], scale: float) -> Objectives:
    """F1, F2, F3 from the accumulated responses."""
    if total.absolute_margin_s == 0.0:
        raise InputError(
            "the static margin is zero all along the flight: F3 = 1 / integral of |st| is undefined"
        )
    chosen = total.stagnation_heat_J_m2 if heat == "stagnation" else total.surface_heat_J
    return Objectives(scale * total.axial_s, chosen, scale / total.absolute_margin_s)


def weighted(values: Objectives, weights: tuple[float, float, float]) -> float:
    """The paper's scalar objective."""
    return weights[0] * values.axial + weights[1] * values.heat + weights[2] * values.margin_inverse
