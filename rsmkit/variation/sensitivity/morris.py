"""Morris screening: which factors matter at all, from few runs of the simulator and before any surface.

Morris, *Technometrics* 33 (1991) 161; the mean of the absolute effects is by Campolongo, Cariboni and
Saltelli, *Environmental Modelling & Software* 22 (2007) 1509.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rsmkit.errors import RsmkitError
from rsmkit.io.arguments import checked
from rsmkit.io.shown import Shown
from rsmkit.language.space import Floats, Space

__all__ = ["ElementaryEffects", "Trajectories", "elementary_effects", "morris"]

LEVELS = 4
"""Of each factor on its unit interval; a step is two of the three gaps between them."""
STEP = LEVELS / (2.0 * (LEVELS - 1.0))


@dataclass(frozen=True, eq=False)
class Trajectories(Shown):
    """Paths through the box of which each step changes one factor.

    Parameters
    ----------
    space : Space
    points : array, shape (paths * (k + 1), k)
        Natural units, path by path.
    order : array of int, shape (paths, k)
        Which factor each step changes.
    signs : array, shape (paths, k)
        Whether that step goes up or down.
    """

    space: Space
    points: Floats
    order: Floats
    signs: Floats


@dataclass(frozen=True)
class ElementaryEffects(Shown):
    """Effects of one factor on one response, in units of the response for the whole range of the factor.

    Parameters
    ----------
    mean : float
        Of the effects; near zero beside `mean_size` where the effect changes sign.
    mean_size : float
        Mean of their absolute values (mu*): how much the factor matters.
    error : float
        Standard error of `mean_size`.
    sd : float
        Standard deviation of the effects (sigma): how much the factor interacts or bends.
    count : int
        Steps whose both ends succeeded.
    """

    mean: float
    mean_size: float
    error: float
    sd: float
    count: int


@checked
def morris(space: Space, *, paths: int = 10, seed: int = 1) -> Trajectories:
    """Make random paths through the box for Morris screening; they take ``paths * (k + 1)`` runs.

    Parameters
    ----------
    space : Space
        Factors of any kind; a step of a category goes to another one.
    paths : int
        Effects of each factor.
    seed : int

    Raises
    ------
    RsmkitError
        With fewer than two paths, whose scatter nobody could see.
    """
    if space.equalities:
        raise RsmkitError(
            f"morris: a step of one factor leaves '{space.equalities[0].text}'; screen the factors outside "
            "the sum, with its factors fixed, or fit a surface to a design on the sum"
        )
    if paths < 2:
        raise RsmkitError(f"morris: paths must be at least 2, got {paths}")
    rng, k = np.random.default_rng(seed), len(space)
    order = np.array([rng.permutation(k) for _ in range(paths)])
    points, signs = [], np.empty((paths, k))
    for row in range(paths):
        # a factor starts in the lower half and steps up, or in the upper half and steps down
        up = rng.integers(0, 2, k).astype(bool)
        half = rng.integers(0, LEVELS // 2, k) / (LEVELS - 1.0)
        unit = np.where(up, half, 1.0 - half)
        points.append(unit.copy())
        for step, j in enumerate(order[row]):
            signs[row, step] = 1.0 if up[j] else -1.0
            unit[j] += signs[row, step] * STEP
            points.append(unit.copy())
    units = np.clip(np.array(points), 0.0, 1.0)
    columns = [factor.domain.from_unit(units[:, j]) for j, factor in enumerate(space)]
    return Trajectories(space, np.column_stack(columns), order, signs)


@checked
def elementary_effects(paths: Trajectories, values: Floats) -> dict[str, ElementaryEffects]:
    """Find what each factor does from the responses along the paths.

    Parameters
    ----------
    paths : Trajectories
        From :func:`morris`.
    values : array, shape (n,)
        A response at ``paths.points``; nan where a run failed.

    Returns
    -------
    dict of str to ElementaryEffects
        By factor.
    """
    y = np.asarray(values, float)
    count, k = paths.order.shape
    if y.shape != (len(paths.points),):
        raise RsmkitError(f"elementary_effects: values need shape ({len(paths.points)},), got {y.shape}")
    steps = np.diff(y.reshape(count, k + 1), axis=1) / (paths.signs * STEP)
    found = {}
    for j, name in enumerate(paths.space.names):
        effects = steps[paths.order == j]
        effects = effects[np.isfinite(effects)]
        if len(effects) < 2:
            raise RsmkitError(f"screening: fewer than two steps of {name} succeeded")
        sizes = np.abs(effects)
        found[name] = ElementaryEffects(
            float(effects.mean()),
            float(sizes.mean()),
            float(sizes.std(ddof=1) / np.sqrt(len(sizes))),
            float(effects.std(ddof=1)),
            len(effects),
        )
    return found
