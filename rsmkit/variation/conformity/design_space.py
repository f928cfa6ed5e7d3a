"""Where specifications are kept: the *design space* of ICH Q8, and the largest box inside it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from rsmkit.language.joint_law import Laws
from rsmkit.language.space import Floats
from rsmkit.surfaces.posterior import Posterior
from rsmkit.variation.conformity.conformance import Limits, probability_outside
from rsmkit.variation.conformity.operating_box import operating_box
from rsmkit.variation.findings_of_laws import DesignSpace
from rsmkit.variation.sensitivity.sampled_indices import law_points

__all__ = ["LEVEL", "design_space", "largest_box"]

NODES = 21
"""Along each of the two factors."""
SAMPLES = 256
"""Points of the laws about each node."""
FEWER = 64
"""The same where there are many more nodes."""
LEVEL = 0.95
DRAWS = 100


def design_space(
    posteriors: Mapping[str, Posterior],
    laws: Laws,
    specifications: Mapping[str, Limits],
    point: Floats,
    factors: tuple[str, str],
    *,
    seed: int,
    level: float = LEVEL,
) -> DesignSpace:
    """Map the probability that every specification is kept, laws and surfaces considered, over two factors.

    Parameters
    ----------
    posteriors : mapping of str to Posterior
        By response.
    laws : Laws
        About every node in turn.
    specifications : mapping of str to limits
        By response.
    point : array, shape (k,)
        Where the other factors stay.
    factors : pair of str
    seed : int
    level : float
        Probability that the box keeps.
    """
    space = laws.space
    columns = [space.names.index(name) for name in factors]
    axes = [space[name].domain.nodes(NODES) for name in factors]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    nodes = np.tile(point, (len(grid), 1))
    nodes[:, columns] = grid

    def kept(designs: Floats, samples: int = FEWER) -> Floats:
        return chances_kept(posteriors, laws, specifications, designs, samples, seed)

    probability = kept(nodes, SAMPLES).reshape(len(axes[0]), len(axes[1]))
    found = largest_box(probability >= level)
    box = None
    if found is not None:
        box = {
            name: (float(axis[low]), float(axis[high]))
            for name, axis, (low, high) in zip(factors, axes, found, strict=True)
        }
    return DesignSpace(
        factors,
        (tuple(axes[0].tolist()), tuple(axes[1].tolist())),
        tuple(map(tuple, np.round(probability, 6).tolist())),
        level,
        box,
        operating_box(kept, laws, point, level=level, seed=seed),
    )


def chances_kept(
    posteriors: Mapping[str, Posterior],
    laws: Laws,
    specifications: Mapping[str, Limits],
    nodes: Floats,
    samples: int,
    seed: int,
) -> Floats:
    """Probability that every specification is kept with the laws about each node, shape (n, k) to (n,)."""
    numbers = law_points(laws.at(nodes[0]), samples, seed + 41)[0]
    points = np.vstack([laws.at(node).of_uniform(numbers) for node in nodes])
    kept = np.ones(len(points))
    for name, limits in specifications.items():
        own = posteriors[name]
        # what the surface leaves open about a node is taken as the same at all points about it
        open_sd = own.draw(nodes)[:DRAWS].std(axis=0)
        spread = np.repeat(np.hypot(open_sd, own.noise_sd), samples)
        kept *= 1.0 - probability_outside(own.predict(points), limits, spread)
    return np.asarray(kept.reshape(len(nodes), samples).mean(axis=1))


def largest_box(good: NDArray[np.bool_]) -> tuple[tuple[int, int], tuple[int, int]] | None:
    """Largest rectangle of a table that holds nothing but true, by its first and last row and column.

    Rows and columns are counted in steps between nodes, so that a single node has no area; among equal ones
    the first is taken. None where nothing is true.
    """
    best, found = -1.0, None
    rows, columns = good.shape
    for top in range(rows):
        alive = np.ones(columns, bool)
        for bottom in range(top, rows):
            alive &= good[bottom]
            if not alive.any():
                break
            edges = np.flatnonzero(np.diff(np.r_[False, alive, False]))
            starts, ends = edges[::2], edges[1::2] - 1
            widest = int(np.argmax(ends - starts))
            area = (bottom - top + 0.5) * (ends[widest] - starts[widest] + 0.5)
            if area > best:
                best, found = area, ((top, bottom), (int(starts[widest]), int(ends[widest])))
    return found
