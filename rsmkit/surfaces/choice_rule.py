"""Which of several models is taken, by their errors at runs that they have not seen.

The best of many is partly the luckiest, most of all with few noisy runs. So a model has to be worth what it
assumes, in two ways. What is no polynomial of the terms asked for must predict clearly better than these do.
And of models that the best one does not beat by more than chance the one with the fewest parameters is taken
(as by the one-standard-error rule of Breiman, Friedman, Olshen & Stone, *Classification and Regression
Trees*, 1984, section 3.4.3). How large "clearly" and "chance" are was measured; docs/surfaces.md has it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from rsmkit.language.space import Floats
from rsmkit.surfaces.kind_rows import ModelFit

__all__ = ["winner"]

SIMPLE = ("polynomial", "reduced")
"""Kinds that the others must beat clearly."""
CLEARLY = 0.8
"""Root mean square error of the others, as a part of that of the better of these, up to which they do."""
CHANCE = 0.5
"""Standard errors of the difference that may be chance."""
EXACT = 1e-5
"""Error, as a part of the spread of the response, below which any is as good as none."""


def winner(
    found: Mapping[str, ModelFit], eligible: Sequence[str], spread: float, weights: Floats | float = 1.0
) -> str:
    """Choose one of the kinds.

    Parameters
    ----------
    found : mapping of str to ModelFit
        In the order of the register, which decides between equals.
    eligible : sequence of str
        Those that may be taken.
    spread : float
        Standard deviation of the response.
    weights : array, shape (n,), optional
        Of the runs, one on average.
    """
    losses = {word: _losses(found[word], EXACT * spread, weights) for word in found if word in eligible}
    mean = {word: float(np.mean(loss)) for word, loss in losses.items()}
    simple = [word for word in SIMPLE if word in mean]
    bar = CLEARLY**2 * min((mean[word] for word in simple), default=math.inf)
    running = [word for word in mean if word in simple or mean[word] <= bar]
    best = min(running, key=mean.__getitem__)

    def alike(word: str) -> bool:
        if word == best or mean[word] == mean[best]:
            return True
        if len(losses[word]) != len(losses[best]) or not math.isfinite(mean[word]):
            return False
        more = losses[word] - losses[best]
        return bool(more.mean() <= CHANCE * more.std(ddof=1) / math.sqrt(len(more)))

    return min((word for word in running if alike(word)), key=lambda word: _parameters(found[word]))


def _losses(fit: ModelFit, least: float, weights: Floats | float) -> Floats:
    """Squared errors of the runs, or their sum alone where a kind does not tell more."""
    if fit.errors is None:
        return np.array([fit.press])
    return np.asarray(weights * np.maximum(fit.errors**2, least**2))


def _parameters(fit: ModelFit) -> float:
    """How many parameters a model has that an estimate is given for; no end of them in a process."""
    surface = getattr(fit.surface, "inner", fit.surface)
    estimated = getattr(surface, "fit", None)
    if estimated is None:
        return math.inf
    return float(estimated.p) + (surface is not fit.surface)  # the power that was chosen
