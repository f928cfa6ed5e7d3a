"""What every static figure shares: making axes when none are given, and one look."""

from __future__ import annotations

from textwrap import fill
from typing import TYPE_CHECKING, Any

from rsmkit.language.space import Factor

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis

__all__ = ["BAND", "DATA", "MODEL", "NOW", "axes_grid", "name_levels", "one_axes", "wrapped"]

MODEL, DATA, NOW, BAND = "#1f6feb", "#24292f", "#d1242f", "#9ec5fe"
"""Colours of model lines, runs, what is chosen, and intervals."""


def one_axes(ax: Axes | None, projection: str | None = None) -> Axes:
    """Give `ax`, or new axes on a figure of their own."""
    if ax is not None:
        return ax
    import matplotlib.pyplot as plt

    figure = plt.figure(figsize=(5.6, 4.2), layout="constrained")
    ax = figure.add_subplot(projection=projection)
    if projection is None:
        ax.grid(alpha=0.25)
    return ax


def axes_grid(ax: Any, rows: int, columns: int, **sharing: Any) -> Any:
    """Give an array of axes of shape (rows, columns): `ax` reshaped, or new ones."""
    import numpy as np

    if ax is not None:
        return np.asarray(ax, object).reshape(rows, columns)
    import matplotlib.pyplot as plt

    size = (max(2.3 * columns, 4.0) + 1.2, max(1.9 * rows, 2.6) + 0.4)
    return plt.subplots(rows, columns, figsize=size, layout="constrained", squeeze=False, **sharing)[1]


def name_levels(axis: Axis, factor: Factor) -> None:
    """Mark an axis with the levels of a categorical factor; other factors keep their numbers."""
    if not factor.domain.is_numeric:
        room = max(6, 30 // len(factor.levels))  # letters beside each other below a panel
        axis.set_ticks(range(len(factor.levels)), [wrapped(str(level), room) for level in factor.levels])
        axis.set_tick_params(labelsize=8)


def wrapped(text: str, width: int = 18) -> str:
    """Break a long label into lines."""
    return fill(text, width)
