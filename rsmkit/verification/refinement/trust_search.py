"""One objective: each wave fits models, tries the best of them around the best run, and explores.

A wave holds up to four kinds of run. *Local*: the minimisers of the models with the smallest leave-one-out
errors in the region. *Global*: where the expected improvement is greatest anywhere. *Wide*: the minimiser of
the global models over the whole box, which finds corners of several constraints that the expected improvement
avoids. *Filling*: far from other runs, while the region holds too few.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rsmkit.errors import RsmkitError
from rsmkit.language.space import Floats
from rsmkit.optimum.problem import Evaluation, Problem, joined, least_margins
from rsmkit.verification.options import RefineOptions
from rsmkit.verification.refinement.certainty import largest_gap, noise_hides, spread_out, worth_having
from rsmkit.verification.refinement.filling import far_from_all
from rsmkit.verification.refinement.global_step import Doubt, GlobalStep
from rsmkit.verification.refinement.models.cube import Cube
from rsmkit.verification.refinement.models.failures import Failures, fit_failures, fit_failures_near
from rsmkit.verification.refinement.models.learner import Ranked
from rsmkit.verification.refinement.models.quantities import Knowledge
from rsmkit.verification.refinement.noise import first_of_each, repeated_sd
from rsmkit.verification.refinement.refinement import Result, Wave
from rsmkit.verification.refinement.standing import allowed_runs, merits
from rsmkit.verification.refinement.subproblem import Proposal, Subproblem, limits_of
from rsmkit.verification.refinement.trust_region import SMALLEST, Basins, Region
from rsmkit.verification.refinement.wave_plan import Plan, Turns

__all__ = ["TrustSearch"]

FEW = 4
LOCAL = 3
"""Models whose minimisers are run."""
ALIVE = (0.3, -0.3, 1.0)
"""Least latent value of success at each: short of the boundary of failing, beyond it, well inside."""
NEAR = 2e-3
"""Points nearer than this, in half-widths, are the same."""
CAUTION = 0.1
"""Part of a constraint model's error that the first proposal stays away, times `beta`."""
MOST_CAUTION = 3.0
HARDLY = 0.1
"""Part of the tolerance below which an expected improvement is not worth a run."""
BOLD = 3.0
"""Standard deviations are taken to be so much larger when nothing is expected otherwise: a likelihood is sure
of its lengths before the runs are."""
BOLD_SHARE = 10.0
"""Tolerances that may then be expected when a search is called finished."""
QUIET_WAVES = 2
ROUNDING = 1e-12
"""Relative gain that no simulator can show."""
QUIET_NOISE = 0.25
"""Gains below so many standard deviations of the noise are none."""


class TrustSearch:
    """The state of a refinement: ask for points, tell what they gave.

    Parameters
    ----------
    problem : Problem
        On the true simulator, one objective.
    start : Evaluation
        Runs already known.
    options : RefineOptions
        Budget (in points), noise, tolerance, seed.
    tolerance_pct : float
        Of the objective or its spread: a gain below that is not worth going on for.
    """

    def __init__(
        self, problem: Problem, start: Evaluation, options: RefineOptions, tolerance_pct: float = 2.0
    ) -> None:
        if not len(start):
            raise RsmkitError("refinement needs runs to begin with. Run: rsmkit evaluate")
        self.problem, self.options, self.tolerance_pct = problem, options, tolerance_pct
        self.cube = Cube(problem.space)
        self.noise_sd = repeated_sd(start) if options.noise_sd is None else options.noise_sd
        self.known = start if self.noise_sd > 0 else start.rows(first_of_each(start))
        self._first = int(self.known.succeeded.sum())
        self._start, self._learnt, self._run_sd = len(self.known), 0, self.noise_sd
        self._doubt: Doubt | None = None
        self.knowledge: Knowledge | None = None
        self.region = Region()
        self.basins = Basins(self.cube)
        self.beta = 0.0
        self.number = 0
        self._turns = Turns()
        self._quiet: list[int] = []
        self._basin_quiet = 0
        self._hopeless = 0
        self._plan = Plan()
        self._center = self._entered = 0
        self._settle_on_best()

    # ------------------------------------------------------------------ what is known

    @property
    def alive(self) -> NDArray[np.bool_]:
        """Which runs succeeded, shape (n,)."""
        return self.known.succeeded

    @property
    def best(self) -> int:
        """Row of the best run; infeasible ones rank behind feasible ones, by violation."""
        return int(self.merit.argmin())

    @property
    def feasible(self) -> bool:
        """Whether the best run satisfies every constraint."""
        return bool(self.allowed[self.best])

    @property
    def tolerance(self) -> float:
        """A gain below this is none: a part of what the first runs span."""
        values = self.known.objectives[self.alive, 0]
        if not len(values):
            return 0.0
        share = self.options.gain_tolerance * self._spread
        return max(share, QUIET_NOISE * self.noise_sd, ROUNDING * float(np.median(np.abs(values))))

    @property
    def _spread(self) -> float:
        """Of the objective over the first runs, median less least: later ones crowd about the optimum."""
        first = self.known.objectives[self.alive, 0][: max(self._first, FEW)]
        return float(np.median(first) - first.min())

    @property
    def worth(self) -> float:
        """What a run would have to gain to be worth going on for."""
        return worth_having(float(self.merit[self.best]), self._spread, self.tolerance_pct)

    @property
    def finished(self) -> str:
        """Why there is nothing more to do; empty while there is."""
        if len(self._quiet) < QUIET_WAVES or sum(self._quiet) < max(4, len(self.cube)) or not self._doubt:
            return ""
        if self._doubt.gain <= self.worth:
            return f"nothing promised a further gain, here or elsewhere, in {len(self._quiet)} waves in a row"
        left = self.options.max_runs + self._start - len(self.known)
        if noise_hides(self._doubt.gain, self.worth, self._run_sd, int(self.alive.sum()), left):
            return (
                "what may still be gained is less than the noise of one run, and the budget could not tell it"
            )
        return ""

    @property
    def center(self) -> Floats:
        """Of the region, shape (k,)."""
        return np.asarray(self.unit[self._center])

    @property
    def result(self) -> Result:
        """What has been found."""
        gain = smoothed = error = None
        if self.feasible and self.alive.sum() >= max(4, len(self.cube) + 2):
            gain = max(self._doubted().gain, self.tolerance)
            if self.noise_sd > 0:
                assert self.knowledge is not None
                mean, sd = self.knowledge.objectives[0].normal(self.unit[[self.best]])
                smoothed, error = float(mean[0]), float(sd[0])
        gap = largest_gap(self.cube, self.problem, self.unit)
        best = self.known.rows([self.best])
        return Result(best, self.known, self.feasible, gain, None, smoothed, error, self._run_sd, gap)

    def _doubted(self) -> Doubt:
        """What may still be gained, and where."""
        self._learn()
        return replace(self._global_step(), boldness=BOLD).doubt(self._near(), self._seed(300))

    # ------------------------------------------------------------------ a wave

    def ask(self, count: int) -> Floats:
        """Propose up to `count` points, natural units, shape (q, k); none when nothing is left to run."""
        self.number += 1
        self._plan = plan = Plan()
        if self.alive.sum() < max(4, len(self.cube) + 2):
            # a handful of runs near an optimum are looked around, anything else is spread
            self._fill(plan, count, everywhere=len(self.known) >= FEW or not self.alive.any())
            return self._natural(plan)
        self._learn()
        local = self._local_proposals(plan)
        step = self._global_step()
        first = step.maximise(self._near(), self._seed(100))
        plan.expected = plan.boldly = math.exp(min(first[1], 700.0)) if self.feasible else math.inf
        if plan.expected < HARDLY * self.tolerance:
            step = replace(step, boldness=BOLD)
            first = step.maximise(self._near(), self._seed(100))
            plan.boldly = math.exp(min(first[1], 700.0))
        wide = self._wide_proposal(local)
        doubtful = self._doubtful(count)
        quiet = self.feasible and self.region.half_width < 1 and not plan.promised > self.tolerance
        for kind in self._turns.kinds(
            count - len(doubtful),
            len(local),
            wide=wide is not None,
            quiet=quiet,
            hopeful=plan.boldly > HARDLY * self.tolerance or not self.feasible,
            secondary=self.region.secondary,
        ):
            if kind == "local" and local:
                self._add(plan, local.pop(0).unit, "local")
            elif kind == "wide" and wide is not None:
                self._add(plan, wide.unit, "wide")
            elif kind == "global":
                self._add_global(plan, step, first)
        for point in doubtful:
            self._add(plan, point, "doubtful")
        enough = self._inside() >= len(self.cube) + 2
        if count > 1 and enough:
            for _ in range(count - len(plan.points)):
                self._add_global(plan, step, first)
        if count > 1 or not plan.points:
            self._fill(plan, count, everywhere=enough)
        return self._natural(plan)

    def tell(self, runs: Evaluation) -> Wave:
        """Learn from the runs asked for, and move the region."""
        plan, region = self._plan, self.region
        old_best, merit = self.best, float(self.merit[self.best])
        old_row = self._center
        was_feasible = self.feasible
        self.known = joined(self.known, runs)
        self._judge_runs(plan, runs)
        self._settle_on_best(keep=old_row)
        new = self.best
        gain = merit - float(self.merit[new])
        noise = 0.5 * self.noise_sd
        gained = gain > noise and new != old_best
        center_gain = self.region.gain(self.cube, self.unit, self.merit, old_row, noise)
        self._turns.local_failed = "local" in plan.kinds and not gained
        calm = self.feasible and plan.feasible and not gain > self.tolerance and not plan.risked > self.worth
        settled = calm and not plan.risked > self.tolerance
        here = settled and region.half_width < 1 and not plan.promised > self.tolerance
        calm = calm and not plan.better > self.tolerance and plan.boldly <= BOLD_SHARE * self.tolerance
        anywhere = settled and calm
        self._quiet = [*self._quiet, len(runs)] if anywhere else []
        action = self._move(plan, old_row, center_gain, gained, here, len(runs))
        self._doubt = self._doubted() if calm else None
        return Wave(
            self.number,
            runs.points,
            runs.objectives[:, 0],
            region.half_width,
            plan.model,
            plan.promised,
            gain if self.feasible and was_feasible else max(gain, 0.0),
            float(self.merit[new] if self.noise_sd > 0 and self.feasible else self.known.objectives[new, 0]),
            action,
            plan.expected,
            tuple(plan.kinds),
        )

    # ------------------------------------------------------------------ proposals

    def _learn(self) -> None:
        if self._learnt == len(self.known):
            return
        self._learnt = len(self.known)
        if self.knowledge is None:
            self.knowledge = Knowledge(self.problem, self.known, noisy=self.noise_sd > 0)
        self.knowledge.learn(self.known.rows(self.alive))
        whole = self.knowledge.objectives[0].whole
        if whole and self.options.noise_sd is None:  # few repeated points may lie together by luck
            self._run_sd = max(self.noise_sd, whole.noise_sd)
        self.failures: Failures | None = fit_failures(self.unit, self.alive, self.cube.categorical)
        self._rank()
        if self._center != self.best and not self.region.secondary:
            self._center = self.best

    def _local_proposals(self, plan: Plan) -> list[Proposal]:
        assert self.knowledge is not None
        objective, margins = self.knowledge.objectives[0], self.knowledge.margins
        exact = objective.exact and all(margin.exact for margin in margins)
        center, width = self.center, self.region.half_width
        ranked = objective.ranked(center, width)
        others = [margin.ranked(center, width) for margin in margins]
        box = self.cube.whole(center) if exact else self.cube.around(center, width)
        failures = self.failures and self._failures_near(width)
        here = failures.latent(center[None])[0] if failures and self.alive[self._center] else np.inf
        found: list[Proposal] = []
        for t, candidate in enumerate(ranked[:LOCAL]):
            limits = limits_of(others, t, CAUTION * self.beta if t == 0 else 0.0, self.unit[self.alive])
            alive = min(ALIVE[t], float(here))
            problem = Subproblem(self.cube, self.problem, candidate.model, limits, failures, alive)
            proposal = problem.minimise(box, center, self._seed(t))
            promised = float(candidate.model.mean(center[None])[0]) - proposal.value
            if t == 0:
                plan.model = candidate.model.name
                plan.feasible = proposal.feasible
                if proposal.feasible and self.allowed[self._center]:
                    plan.promised = promised
                    plan.better = float(self.merit[self.best]) - proposal.value
            elif failures and proposal.feasible and ALIVE[t] < ALIVE[0]:
                plan.risked = float(self.merit[self.best]) - proposal.value
            found.append(proposal)
            if exact and not failures:
                break
        return self._distinct(found)

    def _failures_near(self, width: float) -> Failures | None:
        """Where runs fail around the centre, or what is known of that everywhere."""
        distance = self.cube.apart(self.unit, self.center[None])[:, 0]
        return (
            fit_failures_near(self.unit, self.alive, self.cube.categorical, distance, width) or self.failures
        )

    def _wide_proposal(self, local: list[Proposal]) -> Proposal | None:
        if self.number < 2 or self.knowledge is None:
            return None
        objective, margins = self.knowledge.objectives[0], self.knowledge.margins
        model = objective.global_models()[0]
        likeliest = [[Ranked(margin.global_models()[0], 0.0)] for margin in margins]
        limits = limits_of(likeliest, 0, 0.0, self.unit[self.alive])
        found = Subproblem(self.cube, self.problem, model, limits, self.failures).minimise(
            self.cube.whole(self.center), self.center, self._seed(50)
        )
        better = found.value < float(self.merit[self.best]) - self.tolerance
        if self.feasible and not (found.feasible and better):
            return None
        others = np.array([self.unit[self.best], *(proposal.unit for proposal in local)])
        if self.cube.apart(found.unit[None], others).min() < 0.02 or self._repeats(found.unit, 1e-6):
            return None
        return found

    def _global_step(self) -> GlobalStep:
        assert self.knowledge is not None
        return GlobalStep(
            self.cube,
            self.problem,
            self.knowledge.objectives[0],
            self.knowledge.margins,
            self.failures,
            float(self.merit[self.best]) if self.feasible else None,
            self.unit,
        )

    def _near(self) -> Floats:
        """The best few runs."""
        best = np.argsort(self.merit, kind="stable")[:5]
        return self.unit[best[np.isfinite(self.merit[best])]]

    def _fill(self, plan: Plan, count: int, *, everywhere: bool) -> None:
        """Add points far from all others, where runs should succeed."""
        box = self.cube.around(self.center, 1.0 if everywhere else min(self.region.half_width, 0.25))
        failures = fit_failures(self.unit, self.alive, self.cube.categorical)
        taken = np.vstack([self.unit, *[point[None] for point in plan.points]])
        for point in far_from_all(
            self.cube,
            self.problem,
            box,
            taken,
            failures,
            count - len(plan.points),
            self._seed(200),
            categories=everywhere,
        ):
            self._add(plan, point, "filling")

    def _doubtful(self, count: int) -> list[Floats]:
        """Half a wave where a gain worth having cannot be excluded although none is expected."""
        if self._doubt is None or self._doubt.gain <= self.worth or (count == 1 and self.number % 2):
            return []
        return spread_out(self.cube, self._doubt.points, max(1, count // 2))

    def _add_global(self, plan: Plan, step: GlobalStep, first: tuple[Floats, float]) -> None:
        """Add where most is expected; where nothing is, a point far from others, lest the models be wrong."""
        point, score = first
        if plan.points:
            believing = step.believing(np.array(plan.points))
            point, score = believing.maximise(self._near(), self._seed(100 + len(plan.points)))
        if self.feasible and math.exp(min(score, 700.0)) < HARDLY * self.tolerance:
            self._fill(plan, len(plan.points) + 1, everywhere=True)
        else:
            self._add(plan, point, "global")

    def _add(self, plan: Plan, unit: Floats, kind: str) -> None:
        unit = self.cube.snapped(unit[None])[0]
        others = np.array(plan.points) if plan.points else np.empty((0, len(unit)))
        if self._repeats(unit, 1e-9) or (len(others) and self.cube.apart(unit[None], others).min() < 1e-6):
            return
        plan.points.append(unit)
        plan.kinds.append(kind)

    def _distinct(self, proposals: list[Proposal]) -> list[Proposal]:
        """Without those that repeat a run or each other."""
        kept: list[Proposal] = []
        limit = NEAR * self.region.half_width
        for proposal in proposals:
            near = any(self.cube.apart(proposal.unit[None], one.unit[None])[0, 0] < limit for one in kept)
            if not near and not self._repeats(proposal.unit, limit):
                kept.append(proposal)
        return kept

    def _repeats(self, unit: Floats, limit: float) -> bool:
        if self.noise_sd > 0:  # a run near another one says something new
            limit = 1e-9
        return bool(self.cube.apart(unit[None], self.unit).min() <= limit)

    # ------------------------------------------------------------------ learning from runs

    def _judge_runs(self, plan: Plan, runs: Evaluation) -> None:
        """Stay further from constraints after a proposal that missed one, nearer after one that did not."""
        margins = runs.margins[0]
        if plan.kinds[0] == "local" and plan.feasible and len(margins) and np.isfinite(margins).all():
            held = (margins >= least_margins(self.known)).all()
            self.beta = max(0.0, self.beta - 0.5) if held else min(MOST_CAUTION, self.beta + 1.0)

    def _settle_on_best(self, keep: int | None = None) -> None:
        self.unit = self.cube.unit(self.known.points)
        self._rank()
        self._center = self.best if keep is None else keep

    def _rank(self) -> None:
        values = self.known.objectives[:, 0].copy()
        if self.noise_sd > 0 and self.knowledge is not None:
            values[self.alive] = self._smoothed(self.alive, values[self.alive])
        self.allowed = allowed_runs(self.problem, self.known)
        self.merit = merits(self.problem, self.known, values)

    def _smoothed(self, alive: NDArray[np.bool_], values: Floats) -> Floats:
        """Objective at the runs without their noise: the lowest value is mostly a lucky one."""
        assert self.knowledge is not None
        mean, _ = self.knowledge.objectives[0].normal(self.unit[alive])
        return np.asarray(np.where(np.isfinite(mean), mean, values))

    def _move(
        self, plan: Plan, old_row: int, center_gain: float, gained: bool, quiet: bool, batch: int
    ) -> str:
        """Follow a gain, close a basin that promises nothing, or resize."""
        region, old_center = self.region, self.unit[old_row]
        self._basin_quiet = self._basin_quiet + 1 if quiet else 0
        if gained:
            self._hopeless = 0
            self._center = self.best
            self.region = Region(region.half_width)
        elif region.secondary:
            if center_gain > 0:
                near = self.cube.apart(self.unit, old_center[None])[:, 0] <= 1.05 * region.half_width
                self._center = int(np.where(near, self.merit, np.inf).argmin())
            hoped = 2.0 * max(plan.promised, 0.0) if math.isfinite(plan.promised) else 0.0
            beyond = float(self.merit[self._center]) - hoped > float(self.merit[self.best])
            self._hopeless = self._hopeless + 1 if beyond else 0
        if self._closing:
            return self._leave()
        step = min(float(self.cube.apart(self.center[None], old_center[None])[0, 0]), 2.0)
        jumped = gained and step > 1.05 * region.half_width
        self.region, action = self.region.after(
            step=step,
            gain=1.0 if jumped else center_gain,
            promised=plan.promised,
            enough=self._inside() >= 2 * len(self.cube) + 2,
            tried=gained or "local" in plan.kinds,
            batch=batch,
        )
        return action

    @property
    def _closing(self) -> bool:
        """Whether nothing is left in the region, or it has come down into a basin that was left before."""
        width = self.region.half_width
        known = self.region.secondary and not self.basins.open_rows(self.center[None])[0]
        quiet = self._basin_quiet >= (1 if width < 1e-3 else 2) or self._hopeless >= 2
        return width < 1 and bool(quiet or known)

    def _leave(self) -> str:
        """Close the basin, and where the region came from; look around the best run that belongs to none."""
        self.basins.close(self.center)
        if self.region.secondary:
            self.basins.close(self.unit[self._entered])
        self._basin_quiet = self._hopeless = 0
        rows = np.where(self.basins.open_rows(self.unit) & self.allowed, self.merit, np.inf)
        if not np.isfinite(rows).any():
            self._center, self.region = (
                self.best,
                Region(max(SMALLEST, self.region.half_width), secondary=False),
            )
            return "nothing more to gain here, nor around any other run"
        self._center = self._entered = int(rows.argmin())
        self.region = Region(0.125, secondary=self._center != self.best)
        return "nothing more to gain here; now around the best run elsewhere"

    # ------------------------------------------------------------------ small things

    def _inside(self) -> int:
        distance = self.cube.apart(self.unit[self.alive], self.center[None])[:, 0]
        return int((distance <= 1.25 * self.region.half_width).sum())

    def _natural(self, plan: Plan) -> Floats:
        return self.cube.natural(np.reshape(plan.points, (-1, len(self.cube))))

    def _seed(self, number: int) -> int:
        return self.options.seed + 1000 * self.number + number
