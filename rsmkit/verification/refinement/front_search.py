"""Several objectives: each wave runs the points that add most to the hypervolume of the true front.

Models of every objective and constraint predict a front; of its points those are run, one after the other,
that would enlarge most what the runs dominate, each taken to turn out as predicted while the next is chosen;
every fourth point is chosen by what it may be worth, one standard deviation better than predicted.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from rsmkit.errors import RsmkitError
from rsmkit.language.space import Floats
from rsmkit.optimum.pareto_front import REFERENCE, hypervolume, knee, nondominated
from rsmkit.optimum.problem import Evaluation, Problem, joined, least_margins
from rsmkit.verification.options import RefineOptions
from rsmkit.verification.refinement.filling import far_from_all
from rsmkit.verification.refinement.models.cube import Cube
from rsmkit.verification.refinement.models.failures import Failures, fit_failures
from rsmkit.verification.refinement.models.quantities import Knowledge
from rsmkit.verification.refinement.noise import repeated_sd
from rsmkit.verification.refinement.refinement import Result, Wave
from rsmkit.verification.refinement.standing import allowed_runs, missed_by

__all__ = ["FrontSearch", "hypervolume_gains"]

PARENTS, CHILDREN, GENERATIONS = 120, 160, 30
FIRST_CAUTION, MOST_CAUTION = 0.5, 4.0
"""Standard deviations by which predicted margins must be satisfied."""
FIRST_DOUBT, MOST_DOUBT = 0.5, 2.0
"""Standard deviations by which predicted objectives are taken to be worse, after promises that failed."""
HOPEFUL = 4
"""One in so many points is chosen by what it may be worth."""
SAMPLES = 4096
"""Points by which volumes in three and more dimensions are measured."""
ENOUGH = 10.0
"""A wave that promises less than so many gain tolerances, as a part of the volume, is quiet."""
ALIVE = 0.3
NEAR = 1e-3


@dataclass
class _Plan:
    unit: list[Floats] = field(default_factory=list)
    kinds: list[str] = field(default_factory=list)
    promised: float = math.nan
    model: str = "no model"
    ideal: Floats | None = None
    nadir: Floats | None = None


class FrontSearch:
    """The state of a refinement of a front: ask for points, tell what they gave.

    Parameters
    ----------
    problem : Problem
        On the true simulator, several objectives.
    start : Evaluation
        Runs already known.
    options : RefineOptions
        Noise, tolerance, seed.
    """

    def __init__(self, problem: Problem, start: Evaluation, options: RefineOptions) -> None:
        if not len(start):
            raise RsmkitError("refinement needs runs to begin with. Run: rsmkit evaluate")
        self.problem, self.options = problem, options
        self.cube = Cube(problem.space)
        self.noise_sd = repeated_sd(start) if options.noise_sd is None else options.noise_sd
        self.known = start
        self.knowledge: Knowledge | None = None
        self.caution = FIRST_CAUTION
        self.doubt = FIRST_DOUBT
        self.number = 0
        self._quiet = 0
        self._plan = _Plan()

    # ------------------------------------------------------------------ what is known

    @property
    def alive(self) -> NDArray[np.bool_]:
        """Which runs succeeded, shape (n,)."""
        return self.known.succeeded

    @property
    def allowed(self) -> NDArray[np.bool_]:
        """Which runs succeeded, lie inside the bounds and satisfy every constraint."""
        return allowed_runs(self.problem, self.known)

    @property
    def front(self) -> NDArray[np.intp]:
        """Rows of the runs that no other dominates, by the first objective; empty while none is feasible."""
        rows = np.flatnonzero(self.allowed)
        if not len(rows):
            return rows
        rows = rows[nondominated(self.known.objectives[rows])]
        return rows[np.lexsort(self.known.objectives[rows].T[::-1])]

    @property
    def feasible(self) -> bool:
        """Whether any run satisfies every constraint."""
        return bool(len(self.front))

    @property
    def finished(self) -> str:
        """Why there is nothing more to do; empty while there is."""
        return "the models promised no larger front in 2 waves in a row" if self._quiet >= 2 else ""

    # ------------------------------------------------------------------ a wave

    def ask(self, count: int) -> Floats:
        """Propose up to `count` points, natural units, shape (q, k)."""
        self.number += 1
        self._plan = plan = _Plan()
        seed = self.options.seed + 1000 * self.number
        if self.alive.sum() >= max(4, len(self.cube) + 2):
            if self.knowledge is None:
                self.knowledge = Knowledge(self.problem, self.known, noisy=self.noise_sd > 0)
            self.knowledge.learn(self.known.rows(self.alive))
            self._choose(plan, count, seed)
        unit = self.cube.unit(self.known.points)
        failures = fit_failures(unit, self.alive, self.cube.categorical)
        taken = np.vstack([unit, *[point[None] for point in plan.unit]])
        box = self.cube.whole(np.zeros(len(self.cube)))
        for point in far_from_all(
            self.cube, self.problem, box, taken, failures, count - len(plan.unit), seed
        ):
            plan.unit.append(point)
            plan.kinds.append("filling")
        return self.cube.natural(np.array(plan.unit)) if plan.unit else np.empty((0, len(self.cube)))

    def tell(self, runs: Evaluation) -> Wave:
        """Learn from the runs asked for."""
        plan = self._plan
        before = self.known
        ideal, nadir = self._scale()
        self.known = joined(self.known, runs)
        volumes = [
            self._volume(self.known.rows(np.arange(len(before) + i + 1)), ideal, nadir)
            for i in range(len(runs))
        ]
        start = self._volume(before, ideal, nadir)
        held = self.allowed[len(before) :]
        if self.problem.constraints and plan.kinds and plan.kinds[0] != "filling":
            share = float(held.mean())
            if share < 0.5:
                self.caution = min(MOST_CAUTION, 2.0 * self.caution)
            elif share > 0.75:
                self.caution /= 1.5
        if plan.ideal is not None and plan.nadir is not None:
            scale = plan.ideal, plan.nadir
            self._learn_doubt(self._volume(self.known, *scale) - self._volume(before, *scale))
        tolerance = ENOUGH * self.options.gain_tolerance * max(start, 1e-300)
        small = volumes[-1] - start <= tolerance and plan.promised <= tolerance
        self._quiet = self._quiet + 1 if self.feasible and small else 0
        found = f"{len(self.front)} points of the front" if self.feasible else "no feasible run yet"
        return Wave(
            self.number,
            runs.points,
            np.array(volumes),
            1.0,
            plan.model,
            plan.promised,
            volumes[-1] - start,
            volumes[-1],
            found,
            plan.promised,
            tuple(plan.kinds),
        )

    @property
    def result(self) -> Result:
        """What has been found: the true front, and its knee."""
        rows = self.front
        if not len(rows):
            row = int(missed_by(self.known).argmin())
            return Result(self.known.rows([row]), self.known, feasible=False)
        front = self.known.rows(rows)
        best = front.rows([knee(front.objectives)])
        return Result(best, self.known, feasible=True, front=front)

    # ------------------------------------------------------------------ inside

    def _learn_doubt(self, gain: float) -> None:
        """Believe the models less after a wave that gave little of what they promised, more after others."""
        if not self._plan.promised > 0:
            return
        if gain < 0.3 * self._plan.promised or gain > 0.7 * self._plan.promised:
            self.doubt = FIRST_DOUBT

    def _choose(self, plan: _Plan, count: int, seed: int) -> None:
        assert self.knowledge is not None
        unit = self.cube.unit(self.known.points)
        failures = fit_failures(unit, self.alive, self.cube.categorical)
        candidates, mean, sd, chance = self._predicted_front(failures, seed)
        distance = self.cube.apart(candidates, unit).min(axis=1)
        fresh = distance > NEAR
        candidates, mean, sd, chance = candidates[fresh], mean[fresh], sd[fresh], chance[fresh]
        if not len(candidates):
            return
        rows = self.front
        true = self.known.objectives[rows]
        everything = np.vstack([true, mean]) if len(true) else mean
        best = everything[nondominated(everything)]
        ideal, nadir = best.min(axis=0), best.max(axis=0)
        span = np.where(nadir > ideal, nadir - ideal, 1.0)
        reached = (true - ideal) / span
        plan.model = ", ".join(dict.fromkeys(q.global_models()[0].name for q in self.knowledge.objectives))
        usable = np.ones(len(candidates), bool)
        promised = 0.0
        for number in range(count):
            hopeful = (self.number * count + number) % HOPEFUL == HOPEFUL - 1
            value = mean + (self.doubt - hopeful) * sd
            gains = hypervolume_gains((value - ideal) / span, reached) * chance
            gains[~usable] = -1.0
            row = int(gains.argmax())
            if not gains[row] > 0:
                break
            promised += float(hypervolume_gains((mean[[row]] - ideal) / span, reached)[0])
            plan.unit.append(candidates[row])
            plan.kinds.append("front")
            reached = np.vstack([reached, (mean[[row]] - ideal) / span])
            usable &= self.cube.apart(candidates, candidates[[row]])[:, 0] > NEAR
        plan.promised, plan.ideal, plan.nadir = promised, ideal, ideal + span

    def _predicted_front(self, failures: Failures | None, seed: int) -> tuple[Floats, Floats, Floats, Floats]:
        """Evolve the front that the models predict: points, means, standard deviations, chance to succeed."""
        rng = np.random.default_rng(seed)
        whole = self.cube.whole(np.zeros(len(self.cube)))
        pool = self.cube.sample(whole, 4 * PARENTS, seed, categories=True)
        ends = self.front if self.feasible else np.flatnonzero(self.alive)[:PARENTS]
        pool = np.vstack([self.cube.snapped(self.cube.unit(self.known.points[ends])), pool])
        mean, missed = self._predict(pool, failures)
        for generation in range(GENERATIONS):
            keep = self._survivors(pool, mean, missed)
            pool, mean, missed = pool[keep], mean[keep], missed[keep]
            children = self._children(pool, 0.15 * 0.85**generation, rng)
            more, worse = self._predict(children, failures)
            pool, mean, missed = np.vstack([pool, children]), np.vstack([mean, more]), np.r_[missed, worse]
        keep = self._survivors(pool, mean, missed)
        pool, mean = pool[keep], mean[keep]
        assert self.knowledge is not None
        sd = np.column_stack([quantity.normal(pool)[1] for quantity in self.knowledge.objectives])
        chance = np.ones(len(pool)) if failures is None else np.exp(failures.log_chance(pool))
        return pool, mean, sd, chance

    def _predict(self, unit: Floats, failures: Failures | None) -> tuple[Floats, Floats]:
        """Means of the objectives (q, m), and by how much constraints are missed (q,)."""
        assert self.knowledge is not None
        mean = np.column_stack([quantity.normal(unit)[0] for quantity in self.knowledge.objectives])
        missed = np.zeros(len(unit))
        for margin in self.knowledge.margins:
            middle, sd = margin.normal(unit)
            missed += np.maximum(0.0, self.caution * sd - middle)
        cheap = np.nan_to_num(self.problem.cheap_margins(self.cube.natural(unit)), nan=-1e9)
        missed += np.maximum(0.0, -cheap).sum(axis=1)
        if failures is not None:
            missed += np.maximum(0.0, ALIVE - failures.latent(unit))
        missed[~np.isfinite(mean).all(axis=1)] = np.inf
        return np.nan_to_num(mean, nan=1e300, posinf=1e300, neginf=-1e300), missed

    def _survivors(self, pool: Floats, mean: Floats, missed: Floats) -> NDArray[np.intp]:
        """The feasible points that none dominates, thinned; or those that miss least."""
        rows = np.flatnonzero(missed <= 0)
        if len(rows) < 10:
            order: NDArray[np.intp] = np.argsort(missed, kind="stable")
            return np.asarray(order[:PARENTS])
        rows = rows[nondominated(mean[rows])]
        if len(rows) <= PARENTS:
            return rows
        span = np.ptp(mean[rows], axis=0)
        scaled = (mean[rows] - mean[rows].min(axis=0)) / np.where(span > 0, span, 1.0)
        chosen = list(dict.fromkeys(scaled.argmin(axis=0).tolist()))
        near = np.abs(scaled[:, None] - scaled[chosen]).max(axis=2).min(axis=1)
        while len(chosen) < PARENTS:
            chosen.append(int(near.argmax()))
            near = np.minimum(near, np.abs(scaled - scaled[chosen[-1]]).max(axis=1))
        return np.asarray(rows[np.array(chosen)])

    def _children(self, parents: Floats, step: float, rng: np.random.Generator) -> Floats:
        k = len(self.cube)
        a, b, c = (parents[rng.integers(len(parents), size=CHILDREN)] for _ in range(3))
        made = a + 0.7 * rng.random((CHILDREN, 1)) * np.where(self.cube.categorical, 0.0, b - c)
        moves = rng.random((CHILDREN, k)) < 1.5 / k
        made += np.where(moves & ~self.cube.categorical, step * rng.standard_normal((CHILDREN, k)), 0.0)
        to_bound = (
            (rng.random((CHILDREN, 1)) < 0.3) & (rng.random((CHILDREN, k)) < 0.15) & ~self.cube.categorical
        )
        made = np.where(to_bound, np.round(np.clip(made, 0.0, 1.0)), made)
        for j in np.flatnonzero(self.cube.categorical):
            redrawn = self.cube.space.factors[j].domain.from_unit(rng.random(CHILDREN))
            made[:, j] = np.where(rng.random(CHILDREN) < 0.2, redrawn, made[:, j])
        return self.cube.snapped(made)

    def _scale(self) -> tuple[Floats, Floats]:
        rows = self.front if self.feasible else np.flatnonzero(self.alive)
        values = self.known.objectives[rows]
        if not len(values):
            m = len(self.problem.objectives)
            return np.zeros(m), np.ones(m)
        ideal, nadir = values.min(axis=0), values.max(axis=0)
        return ideal, np.where(nadir > ideal, nadir, ideal + 1.0)

    def _volume(self, known: Evaluation, ideal: Floats, nadir: Floats) -> float:
        with np.errstate(invalid="ignore"):
            good = (
                known.succeeded
                & (known.margins >= least_margins(self.known)).all(axis=1)
                & self.problem.space.contains(known.points)
            )
        return hypervolume(known.objectives[good], ideal, nadir) if good.any() else 0.0


def hypervolume_gains(values: Floats, front: Floats) -> Floats:
    """By how much each of `values`, shape (q, m), enlarges what `front`, shape (n, m), dominates below 1.1.

    Exact for two objectives; otherwise by quasi-random points. In normalised objectives.
    """
    m = values.shape[1]
    front = front[(front < REFERENCE).all(axis=1)] if len(front) else np.empty((0, m))
    if m == 2:
        front = front[nondominated(front)] if len(front) else front
        front = front[np.argsort(front[:, 0])]
        edges = np.r_[-np.inf, front[:, 0], REFERENCE]
        heights = np.r_[REFERENCE, front[:, 1]]
        width = np.maximum(0.0, edges[1:] - np.maximum(edges[:-1], values[:, [0]]))
        return np.asarray((width * np.maximum(0.0, heights - values[:, [1]])).sum(axis=1))
    low = np.minimum(0.0, np.vstack([values, front]).min(axis=0))
    from scipy.stats import qmc  # takes half a second to import

    points = low + qmc.Sobol(m, rng=11).random(SAMPLES) * (REFERENCE - low)
    free = np.ones(SAMPLES, bool)
    for point in front:
        free &= ~(points >= point).all(axis=1)
    points = points[free]
    volume = float(np.prod(REFERENCE - low)) / SAMPLES
    return volume * np.array([float((points >= value).all(axis=1).sum()) for value in values])
