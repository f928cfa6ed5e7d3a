"""Capability of a response: how its distribution lies between the limits of its specification.

Montgomery, *Introduction to Statistical Quality Control*, 7th ed., chapter 8.
"""

from __future__ import annotations

from dataclasses import dataclass

from rsmkit.errors import RsmkitError
from rsmkit.io.arguments import checked
from rsmkit.io.shown import Shown

__all__ = ["Capability", "capability"]


@dataclass(frozen=True)
class Capability(Shown):
    """Capability indices.

    Parameters
    ----------
    cp : float or None
        Width of the specification in six standard deviations; None where it has one limit.
    cpk : float or None
        Distance of the mean from the nearer limit in three standard deviations; None without spread.
    """

    cp: float | None
    cpk: float | None


@checked
def capability(mean: float, sd: float, *, low: float | None = None, high: float | None = None) -> Capability:
    """Find the capability indices Cp and Cpk of a mean and a standard deviation.

    Parameters
    ----------
    mean, sd : float
        Of the response, its own units.
    low, high : float, optional
        Limits of the specification, one at least.

    Examples
    --------
    Bursting strength of glass containers, at least 200 psi (Montgomery, example 8.1):

    >>> round(capability(264.06, 32.02, low=200.0).cpk, 2)
    0.67
    """
    if low is None and high is None:
        raise RsmkitError("capability: give low, high or both")
    if not sd >= 0:
        raise RsmkitError(f"capability: sd must not be negative, got {sd:g}")
    if sd == 0:
        return Capability(None, None)
    sides = [] if low is None else [(mean - low) / (3.0 * sd)]
    sides += [] if high is None else [(high - mean) / (3.0 * sd)]
    cp = None if low is None or high is None else (high - low) / (6.0 * sd)
    return Capability(cp, min(sides))
