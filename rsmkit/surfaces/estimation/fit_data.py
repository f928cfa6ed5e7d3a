"""The runs a surface is fitted to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rsmkit.errors import FitError
from rsmkit.io.json_codec import left_out_if_none
from rsmkit.io.strict_types import Shape
from rsmkit.language.space import Floats, Space

__all__ = ["FitData", "cells", "checked_data", "collapse_duplicates"]

LARGEST = 1e140
"""Responses up to this size have sums of squares."""


@dataclass(frozen=True, eq=False)
class FitData:
    """Observed values of one response.

    Parameters
    ----------
    points : array, shape (n, k)
        Natural units.
    y : array, shape (n,)
    weights : array, shape (n,), optional
        Inversely proportional to the variance of each run.
    blocks : tuple of str, optional
        Label of the block each run belongs to.
    duplicates : int
        How many exact repetitions of a deterministic run were left out.
    random : dict of str to tuple of str, optional
        Groups that are a sample of all groups (plots, days): per kind the label of each run's group.
    order : tuple of int, optional
        When each run was made: its place among all runs, from 1. Without it that of the data.
    """

    points: Annotated[Floats, Shape("runs", "factors")]
    y: Annotated[Floats, Shape("runs")]
    weights: Annotated[Floats, Shape("runs")] | None = None
    blocks: tuple[str, ...] | None = None
    duplicates: int = 0
    random: dict[str, tuple[str, ...]] | None = left_out_if_none()
    order: tuple[int, ...] | None = left_out_if_none()

    def __len__(self) -> int:
        return len(self.y)

    @property
    def block_names(self) -> tuple[str, ...]:
        """Distinct blocks, in numerical order when they are numbers; empty without blocks."""
        names = set(self.blocks or ())
        try:
            return tuple(sorted(names, key=float))
        except ValueError:
            return tuple(sorted(names))

    @property
    def in_time(self) -> NDArray[np.intp]:
        """The runs, from 0, the one that was made first before the others; shape (n,)."""
        return np.argsort(np.arange(len(self)) if self.order is None else self.order, kind="stable")

    def block_columns(self) -> Floats:
        """Indicator columns of every block after the first, shape (n, blocks - 1)."""
        labels = np.array(self.blocks or ())
        columns = [(labels == name).astype(float) for name in self.block_names[1:]]
        return np.column_stack(columns) if columns else np.empty((len(self), 0))

    def without(self, run: int) -> FitData:
        """All runs but one."""
        return self.rows(np.delete(np.arange(len(self)), run))

    def rows(self, keep: NDArray[np.intp]) -> FitData:
        """Only the given runs, in the given order."""
        return FitData(
            self.points[keep],
            self.y[keep],
            None if self.weights is None else self.weights[keep],
            None if self.blocks is None else tuple(self.blocks[i] for i in keep),
            self.duplicates,
            None
            if self.random is None
            else {name: tuple(labels[i] for i in keep) for name, labels in self.random.items()},
            None if self.order is None else tuple(self.order[i] for i in keep),
        )

    def checked(self, space: Space) -> FitData:
        """The same runs, found to be runs of these factors.

        Raises
        ------
        FitError
            Naming the first run that is not usable.
        """
        return checked_data(
            space, self.points, self.y, self.weights, self.blocks, self.duplicates, self.random, self.order
        )


def checked_data(
    space: Space,
    points: ArrayLike,
    y: ArrayLike,
    weights: ArrayLike | None = None,
    blocks: Sequence[str] | None = None,
    duplicates: int = 0,
    random: Mapping[str, Sequence[str]] | None = None,
    order: Sequence[int] | None = None,
) -> FitData:
    """Check shapes and values.

    Raises
    ------
    FitError
        Naming the first run that is not usable.
    """
    x = np.asarray(points, float)
    values = np.asarray(y, float)
    if x.ndim != 2 or x.shape[1] != len(space) or values.shape != (len(x),):
        raise FitError(
            f"a fit needs points of shape (n, {len(space)}) and n responses; got {x.shape} and {values.shape}"
        )
    for name, array in (("factor", x.sum(axis=1)), ("response", values)):
        bad = np.nonzero(~np.isfinite(array))[0]
        if bad.size:
            raise FitError(
                f"run {bad[0] + 1}: the {name} value is not a finite number; leave failed runs out"
            )
    if np.abs(values).max(initial=0.0) > LARGEST:
        raise FitError(f"response values beyond {LARGEST:g} cannot be squared; give them in a larger unit")
    w = None
    if weights is not None:
        w = np.asarray(weights, float)
        if w.shape != values.shape or not (np.isfinite(w) & (w > 0)).all():
            raise FitError(
                "weights must be positive finite numbers, one per run; leave runs without weight out"
            )
    if blocks is not None and len(blocks) != len(values):
        raise FitError(f"{len(blocks)} block labels for {len(values)} runs; give one per run")
    for name, labels in (random or {}).items():
        if len(labels) != len(values):
            raise FitError(f"random {name}: {len(labels)} labels for {len(values)} runs; give one per run")
    if order is not None and len(order) != len(values):
        raise FitError(f"{len(order)} places in the order of {len(values)} runs; give one per run")
    groups = {name: tuple(map(str, labels)) for name, labels in (random or {}).items()}
    return FitData(
        x,
        values,
        w,
        None if blocks is None else tuple(map(str, blocks)),
        duplicates,
        groups or None,
        None if order is None else tuple(map(int, order)),
    )


def cells(points: Floats, within: float = 0.0) -> NDArray[np.intp]:
    """Group runs whose factor values differ by rounding only; shape (n,), numbered from 0.

    With `within`, runs are grouped whose values differ by up to this share of the range of each factor.
    """
    levels = np.column_stack([_levels(column, within) for column in points.T])
    return np.unique(levels, axis=0, return_inverse=True)[1].reshape(len(points))


def _levels(column: Floats, within: float) -> NDArray[np.intp]:
    """Number the different values of a column in increasing order, shape (n,)."""
    order = np.argsort(column)
    ordered = column[order]
    apart = 1e-12 * np.ptp(column) + 1e-14 * np.abs(column).max()
    new = np.diff(ordered) > apart
    if within:
        first = ordered[0]
        for i, value in enumerate(ordered[1:].tolist()):
            new[i] = value - first > within * np.ptp(column) + apart
            first = value if new[i] else first
    levels = np.empty(len(column), np.intp)
    levels[order] = np.concatenate([[0], new.cumsum()])
    return levels


def collapse_duplicates(data: FitData) -> FitData:
    """Keep one of every set of identical runs of a deterministic simulator.

    Repeating such a run adds no information, and counting it would make every standard error too small. If
    any repetition differs from its twin the responses are noisy after all, and everything is kept.
    """
    if data.random:  # groups differ, so the runs do
        return data
    index = cells(data.points)
    _, first = np.unique(index, return_index=True)
    if len(first) == len(data) or (data.y != data.y[first][index]).any():
        return data
    return replace(data.rows(np.sort(first)), duplicates=len(data) - len(first))
