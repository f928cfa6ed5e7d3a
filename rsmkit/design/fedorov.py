"""Exchange of whole points over a list of candidates, for regions that no coordinate line describes.

Fedorov's exchange (Theory of Optimal Experiments, 1972) in the row-wise form of Cook & Nachtsheim (1980): in
turn every free row is replaced by the candidate that is best for the criterion, found for all candidates at
once from the rank-two update formulas of :mod:`rsmkit.design.exchange`. Under nonlinear constraints the
points then move on, along the coordinate lines and along the edge of the region.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rsmkit.design.criteria import lattice
from rsmkit.design.encoding import Integers, Model, State, model_rows
from rsmkit.design.region import Region
from rsmkit.space import Floats

__all__ = ["candidate_points", "move_freely", "search_candidates"]

PASSES = 30
BISECTIONS = 20
STEPS = np.array([0.3, 0.6, 0.9, 0.99, 1.0])
"""Parts of the way to the edge of the region that are tried along each coordinate."""
CANDIDATES = 1500


class _Exchange:
    """The points, the inverse information matrix and its product with all candidates, kept up to date."""

    def __init__(
        self, model: Model, state: State, candidates: Floats, numeric: NDArray[np.bool_], distance: float
    ) -> None:
        self.model, self.state, self.candidates = model, state, candidates
        self.numeric, self.distance = numeric, distance
        self.precision = state.precision if len(state.precision) else np.eye(len(state.points))
        self.linear = len(state.weights) > 0
        self.listed = _Trials(model_rows(model, candidates))
        self.refresh()

    def refresh(self) -> None:
        """Start afresh from the points; a little prior information leads out of a singular design."""
        if self.distance > 0.0:
            self.crowded = np.stack([self._close(self.candidates, x) for x in self.state.points], axis=1)
        self.state.rows[:] = model_rows(self.model, self.state.points)
        information = self.state.prior + self.state.rows.T @ self.precision @ self.state.rows
        self.value = self._invert(information)
        if self.value == -np.inf:
            self._invert(information + 1e-4 * len(self.state.points) * np.eye(len(information)))

    def _invert(self, information: Floats) -> float:
        scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
        spectrum, vectors = np.linalg.eigh(information / np.outer(scale, scale))
        if spectrum[0] < 1e-11:
            return -np.inf
        self.V = (vectors / spectrum) @ vectors.T / np.outer(scale, scale)
        self.A = self.V @ self.state.weights @ self.V if self.linear else self.V
        self.listed.refresh(self.V, self.A, self.linear)
        if self.linear:
            return -float((self.V * self.state.weights).sum())
        return float(np.log(spectrum).sum() + 2.0 * np.log(scale).sum())

    def allowed(self, i: int) -> NDArray[np.bool_] | None:
        """Which candidates keep their distance from all rows but the i-th; None for all."""
        if self.distance <= 0.0:
            return None
        return np.asarray(self.crowded.sum(axis=1) == self.crowded[:, i])

    def choose(self, i: int) -> None:
        """Put the best allowed candidate in row i if it beats what is there."""
        self._replace(i, self.candidates, self.listed, self.allowed(i))

    def move(self, i: int, points: Floats) -> None:
        """Put the best of some other points in row i if it beats what is there."""
        trials = _Trials(model_rows(self.model, points))
        trials.refresh(self.V, self.A, self.linear)
        allowed = None
        if self.distance > 0.0:
            others = np.delete(self.state.points, i, axis=0)
            allowed = ~np.any([self._close(points, x) for x in others], axis=0)
        self._replace(i, points, trials, allowed)

    def _close(self, points: Floats, x: Floats) -> NDArray[np.bool_]:
        """Which points are closer to x than allowed; another category counts two."""
        gap = points - x
        gap[:, ~self.numeric] = 2.0 * (gap[:, ~self.numeric] != 0.0)
        return np.asarray((gap**2).sum(axis=1) < self.distance**2 * (1.0 - 1e-9))

    def _replace(self, i: int, points: Floats, trials: _Trials, allowed: NDArray[np.bool_] | None) -> None:
        V, A, old, pii = self.V, self.A, self.state.rows[i], self.precision[i, i]
        g = self.precision[i] @ self.state.rows
        Vg = V @ g
        gg = float(g @ Vg)
        dd = trials.own - 2.0 * (trials.V @ old) + float(old @ V @ old)
        gd = trials.V @ g - float(old @ Vg)
        ratio = (1.0 + gd) ** 2 + (pii - gg) * dd
        gain = ratio - 1.0
        if self.linear:
            Ag = A @ g
            ddA = trials.own_A - 2.0 * (trials.A @ old) + float(old @ A @ old)
            gdA = trials.A @ g - float(old @ Ag)
            change = (gg - pii) * ddA - 2.0 * (1.0 + gd) * gdA + dd * float(g @ Ag)
            usable = ratio > 1e-10
            total = float((V * self.state.weights).sum())
            gain = np.where(usable, -change / np.where(usable, ratio, 1.0) / total, -np.inf)
        if allowed is not None:
            gain = np.where(allowed, gain, -np.inf)
        best = int(gain.argmax())
        if not gain[best] > 1e-9:
            return
        K = np.array([[pii - gg, 1.0 + gd[best]], [1.0 + gd[best], -dd[best]]]) / ratio[best]
        Z = np.stack([V @ (trials.rows[best] - old), Vg], axis=1)
        self.V = V - Z @ K @ Z.T
        if self.linear:
            self.A = self.V @ self.state.weights @ self.V
        self.listed.update(Z, K)
        if self.linear:
            self.listed.refresh(self.V, self.A, True)
        self.state.points[i], self.state.rows[i] = points[best], trials.rows[best]
        if self.distance > 0.0:
            self.crowded[:, i] = self._close(self.candidates, points[best])


class _Trials:
    """Model rows c that could be put in, with the products c'V, c'Vc, c'A, c'Ac."""

    def __init__(self, rows: Floats) -> None:
        self.rows = rows

    def refresh(self, V: Floats, A: Floats, linear: bool) -> None:
        self.V = self.rows @ V
        self.own = (self.V * self.rows).sum(axis=1)
        if linear:
            self.A = self.rows @ A
            self.own_A = (self.A * self.rows).sum(axis=1)

    def update(self, Z: Floats, K: Floats) -> None:
        """V has become V - Z K Z'."""
        along = self.rows @ Z
        self.V -= (along @ K) @ Z.T
        self.own -= ((along @ K) * along).sum(axis=1)


def search_candidates(
    model: Model,
    region: Region,
    candidates: Floats,
    state: State,
    free: Integers,
    seed: int,
    kicks: int,
    kick_rows: int,
    distance: float,
) -> float:
    """One start over a list of candidates; the counterpart of :func:`rsmkit.design.exchange.search`.

    Parameters
    ----------
    candidates : array, shape (N, k)
        Coded points; the only ones allowed when the region is a list, places to begin from otherwise.
    state : State
        ``state.points`` is changed in place and ends as the best design found.

    Returns
    -------
    float
        The criterion, larger is better; -inf if singular.
    """
    rng = np.random.default_rng(seed)
    work = _Exchange(model, state, candidates, region.space.numeric, distance)
    best, best_points = -np.inf, state.points.copy()
    for trial in range(kicks + 1):
        for i in rng.permutation(free)[: int(rng.integers(1, kick_rows + 1)) if trial else 0]:
            allowed = work.allowed(int(i))
            places = np.arange(len(candidates)) if allowed is None else np.flatnonzero(allowed)
            if len(places):
                state.points[i] = candidates[rng.choice(places)]
        _climb(work, region, free, None)
        if work.value > best + 1e-9 * abs(best) or trial == 0:
            best, best_points = work.value, state.points.copy()
        else:
            state.points[:] = best_points
    state.points[:] = best_points
    return best


def move_freely(
    model: Model, region: Region, candidates: Floats, state: State, free: Integers, distance: float
) -> float:
    """Let the points of a good design leave the candidates for better places of a continuous region."""
    work = _Exchange(model, state, candidates, region.space.numeric, distance)
    _climb(work, region, free, np.random.default_rng(0))
    return work.value


def _climb(work: _Exchange, region: Region, free: Integers, rng: np.random.Generator | None) -> None:
    """Pass over the free rows until little is gained; with a generator, also move off the candidates."""
    work.refresh()
    for _ in range(PASSES):
        before = work.value
        for i in map(int, free):
            work.choose(i)
            if rng is not None:
                work.move(i, _steps(region, work.state.points[i], region.inner_point, rng))
        work.refresh()
        scale = abs(work.value) if work.linear else len(work.V)
        if work.value - before < (1e-4 if rng is None else 1e-5) * scale:
            break


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


def candidate_points(region: Region, seed: int) -> Floats:
    """Allowed points to choose from: the list itself, or lattice, edge and inside of the region."""
    if region.candidates is not None:
        return region.candidates
    inside = region.sample(CANDIDATES // 2, seed)
    rng = np.random.default_rng([seed, 1])
    target = inside.copy()
    for j, levels in enumerate(region.levels):  # towards a random corner in a random part of the coordinates
        moved = rng.random(len(target)) < (0.5 if not len(levels) else 0.0)
        target[moved, j] = np.where(rng.random(moved.sum()) < 0.5, region.lows[j], region.highs[j])
    corners = lattice(region, CANDIDATES)
    return np.unique(np.vstack([inside, _edge(region, inside, target), corners]), axis=0)
