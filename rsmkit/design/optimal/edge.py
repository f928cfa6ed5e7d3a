"""Regions with curved edges: points to choose from, and the last moves of a design off them."""

from __future__ import annotations

import numpy as np

from rsmkit.design.moves import moves
from rsmkit.design.optimal.criteria import lattice
from rsmkit.design.optimal.encoding import Integers, Model, State, model_rows
from rsmkit.design.region import Region
from rsmkit.language.space import Floats

__all__ = ["candidate_points", "move_freely"]

PASSES = 30
TOLERANCE = 1e-5
"""Relative gain of a pass over all points below which they have settled."""
BISECTIONS = 20
STEPS = np.array([0.3, 0.6, 0.9, 0.99, 1.0])
"""Parts of the way to the edge of the region that are tried along each coordinate."""
CANDIDATES = 1500


def candidate_points(region: Region, seed: int) -> Floats:
    """Allowed points to choose from: the list itself, or lattice, edge and inside of the region."""
    if region.candidates is not None:
        return region.candidates
    inside = region.sample(CANDIDATES // 2, seed)
    if region.flat:
        return np.unique(np.vstack([inside, region.nodes(2 * CANDIDATES, seed)]), axis=0)
    rng = np.random.default_rng([seed, 1])
    target = inside.copy()
    for j, levels in enumerate(region.levels):  # towards a random corner in a random part of the coordinates
        moved = rng.random(len(target)) < (0.5 if not len(levels) else 0.0)
        target[moved, j] = np.where(rng.random(moved.sum()) < 0.5, region.lows[j], region.highs[j])
    corners = lattice(region, CANDIDATES)
    return np.unique(np.vstack([inside, _edge(region, inside, target), corners]), axis=0)


def move_freely(
    model: Model,
    region: Region,
    state: State,
    free: Integers,
    distance: float,
    tolerance: float = TOLERANCE,
) -> Floats:
    """Let the points of a good design leave the candidates for better places of a continuous region.

    In turn each free point goes to the best of some places near it, along the coordinate lines and along the
    edge of the region, judged by the formulas of :mod:`rsmkit.design.optimal.exchange`. It ends when a pass
    gains less than `tolerance`, relative to the criterion.

    Returns
    -------
    array, shape (n, k)
    """
    rng = np.random.default_rng(0)
    points = state.points.copy()
    precision = state.precision if len(state.precision) else np.eye(len(points))
    linear = len(state.weights) > 0
    for _ in range(PASSES):
        gained = 0.0
        for i in map(int, free):
            trials = (
                moves(region, points[i], np.concatenate([STEPS, 10.0 ** rng.uniform(-4.0, -0.5, 5)]))
                if region.flat
                else _steps(region, points[i], region.inner_point, rng)
            )
            if distance > 0.0:
                gaps = trials[:, None, :] - np.delete(points, i, axis=0)
                gaps[:, :, model.categorical] = 2.0 * (gaps[:, :, model.categorical] != 0.0)
                trials = trials[((gaps**2).sum(axis=2) >= distance**2 * (1.0 - 1e-9)).all(axis=1)]
            if len(trials) == 0:
                continue
            rows = model_rows(model, points)
            V = np.linalg.inv(state.prior + rows.T @ precision @ rows)
            g, pii, d = precision[i] @ rows, precision[i, i], model_rows(model, trials) - rows[i]
            dV, Vg = d @ V, V @ g
            gg, gd, dd = float(g @ Vg), d @ Vg, (dV * d).sum(axis=1)
            ratio = (1.0 + gd) ** 2 + (pii - gg) * dd
            gain = np.log(np.maximum(ratio, 1e-300)) / len(V)
            if linear:
                A = V @ state.weights @ V
                Ag = A @ g
                change = (gg - pii) * ((d @ A) * d).sum(axis=1) - 2.0 * (1.0 + gd) * (d @ Ag) + dd * (g @ Ag)
                gain = -change / np.maximum(ratio, 1e-10) / float((V * state.weights).sum())
            best = int(gain.argmax())
            if gain[best] > 1e-9:
                points[i] = trials[best]
                gained += float(gain[best])
        if gained < tolerance:
            break
    return points


def _steps(region: Region, x: Floats, inside: Floats, rng: np.random.Generator) -> Floats:
    """Points near x: along the coordinate lines out to the edge, and along the edge to either side."""
    k = len(x)
    lines = np.array([j for j, levels in enumerate(region.levels) if not len(levels)], dtype=int)
    moved = [x + np.zeros((1, k))]
    for j, levels in enumerate(region.levels):
        others = np.tile(x, (len(levels), 1))
        others[:, j] = levels
        moved.append(others)
    if len(lines):
        far = np.tile(x, (2 * len(lines), 1))
        far[np.arange(len(lines)), lines] = region.lows[lines]
        far[np.arange(len(lines), 2 * len(lines)), lines] = region.highs[lines]
        edge = _edge(region, np.tile(x, (len(far), 1)), far)
        moved.append((x + STEPS[:, None, None] * (edge - x)).reshape(-1, k))
        count = 10 + 4 * len(lines)
        aside = np.tile(x, (count, 1))
        aside[:, lines] += rng.normal(size=(count, len(lines))) * 10.0 ** rng.uniform(-3, -0.3, (count, 1))
        start = aside.copy()
        start[:, lines] = inside[lines]
        beyond = np.clip(start + 2.0 * (aside - start), region.lows, region.highs)
        moved += [aside, _edge(region, start, beyond)]
    points = np.vstack(moved)
    return points[region.contains(points)]


def _edge(region: Region, inside: Floats, outside: Floats) -> Floats:
    """Where the segments from allowed points leave the region; their ends when they do not."""
    low, high = np.zeros(len(inside)), np.ones(len(inside))
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        allowed = region.contains(inside + middle[:, None] * (outside - inside), 0.0)
        low, high = np.where(allowed, middle, low), np.where(allowed, high, middle)
    whole = region.contains(outside, 0.0)
    return inside + np.where(whole, 1.0, low)[:, None] * (outside - inside)
