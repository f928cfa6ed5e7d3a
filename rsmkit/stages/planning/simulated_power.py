"""Power of a planned design by simulation: where runs share random groups, or are counts.

Experiments are simulated from effects that are known, fitted as the real ones will be, and it is counted how
often the test of each term finds it. For independent runs with normal errors
:func:`rsmkit.design.quality.power.power_of_terms` has it in closed form.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.special import betaincinv, chdtrc

from rsmkit.design.design import Design
from rsmkit.design.quality.power import check_test
from rsmkit.errors import FitError, RsmkitError, one_of
from rsmkit.io.arguments import checked
from rsmkit.io.shown import Shown
from rsmkit.language.space import Floats
from rsmkit.language.space_terms import space_terms
from rsmkit.language.terms import Terms
from rsmkit.stages.planning.plan import model_terms
from rsmkit.stages.planning.plot_outlook import in_groups
from rsmkit.study.folder import StudyFolder
from rsmkit.surfaces.estimation.counts.scoring import DISTRIBUTIONS, DistributionName
from rsmkit.surfaces.estimation.fit_data import FitData, checked_data
from rsmkit.surfaces.models.glm import GlmSurface, fit_glm, no_estimate
from rsmkit.surfaces.models.mixed import fit_mixed
from rsmkit.surfaces.models.polynomial import PolynomialSurface, fit_polynomial

__all__ = ["SimulatedPower", "power_of_study", "simulate_power"]

GROUPS = "plot"
BASELINES = {"binomial": 0.5, "poisson": 1.0}
CONFIDENCE = 0.95


@dataclass(frozen=True)
class SimulatedPower(Shown):
    """How often experiments of a design find each term.

    Parameters
    ----------
    effects : dict of str to float
        Coefficient of each term, in coded units (of the logit or the logarithm, of counts).
    power : dict of str to float
        Share of the experiments whose test finds it; of a term whose effect is zero, the size of the test.
    low, high : dict of str to float
        Its 95 % interval, for there are only so many experiments (Clopper and Pearson 1934).
    experiments : int
        How many were simulated of each term.
    without : int
        Of these, experiments whose model could not be fitted; they find nothing.
    """

    effects: dict[str, float]
    power: dict[str, float]
    low: dict[str, float]
    high: dict[str, float]
    experiments: int
    without: int


@checked
def simulate_power(
    design: Design,
    *,
    order: int = 2,
    terms: Terms | None = None,
    effects: Mapping[str, float] | None = None,
    signal_to_noise: float = 2.0,
    distribution: DistributionName | None = None,
    baseline: float | None = None,
    size: float = 1.0,
    significance: float = 0.05,
    experiments: int = 400,
    seed: int = 1,
) -> SimulatedPower:
    """Find how often a design finds each term, by simulated experiments.

    Parameters
    ----------
    design : Design
        Its blocks are whole plots where it has a ``block_ratio``, the variance of a plot over that of a run;
        else their effects are fixed.
    order, terms
        The model.
    effects : mapping of str to float, optional
        Coefficients by the names of the terms, coded units, in standard deviations of a run; of counts, in
        the scale of the link. All act together, and those left out are zero. Without any, each term by
        itself changes the response by `signal_to_noise` from low to high, or from the first category to its
        own.
    signal_to_noise : float
        See `effects`; of counts the change of the logit, or of the logarithm of the rate.
    distribution : {"binomial", "poisson"}, optional
        Runs are counts: tests are those of likelihood ratios, of Firth's penalised ones where runs are
        separated. Else errors are normal; with whole plots tests are those of Kenward and Roger.
    baseline : float, optional
        Probability (0.5), or rate per unit of exposure (1), where all terms are zero.
    size : float
        Trials, or exposure, of each run.
    significance : float
        Size of the tests.
    experiments, seed : int
        How many experiments, of each term where each acts by itself, and their random numbers.

    Raises
    ------
    RsmkitError
        For effects of no term, or a baseline that is no probability.
    FitError
        When the design cannot tell the terms apart, naming them.
    """
    check_test(signal_to_noise, significance)
    if experiments < 10:
        raise RsmkitError(f"power: at least 10 experiments are needed to tell a share, got {experiments}")
    model = (space_terms(design.space, order) if terms is None else terms).with_contrasts("treatment")
    plan = _Plan(design, model, distribution, _start(distribution, baseline, size), size, significance)
    rng = np.random.default_rng(seed)
    if effects is not None:
        for name in effects:
            one_of("power: effects: term", name, plan.testable)
        sizes = {name: float(effects.get(name, 0.0)) for name in plan.testable}
        found, without = plan.share(sizes, list(plan.testable), experiments, rng)
    else:
        sizes = plan.alone(signal_to_noise)
        found, without = {}, 0
        # normal errors: the test of a term does not depend on the others, so that all may act together
        together = [[*sizes]] if distribution is None else [[name] for name in sizes]
        for names in together:
            acting = {name: sizes[name] if name in names else 0.0 for name in sizes}
            hits, lost = plan.share(acting, names, experiments, rng)
            found, without = found | hits, without + lost
    ends = {name: _interval(hits, experiments) for name, hits in found.items()}
    return SimulatedPower(
        sizes,
        {name: hits / experiments for name, hits in found.items()},
        {name: low for name, (low, _) in ends.items()},
        {name: high for name, (_, high) in ends.items()},
        experiments,
        without,
    )


def power_of_study(
    folder: StudyFolder, experiments: int, *, baseline: float | None = None, size: float | None = None
) -> dict[str, SimulatedPower]:
    """Simulate experiments of the design of a study, as its responses are.

    One entry for each response that is a count, and one, ``normal``, for all others. Trials or exposure that
    the study gives as numbers are taken where `size` is left out; else each run is one trial, or one unit.
    """
    study = folder.study
    design, terms = in_groups(study, folder.plan().design), model_terms(study)
    found = {}
    if len(study.counts) < len(study.responses):
        found["normal"] = simulate_power(design, terms=terms, experiments=experiments)
    for name, own in study.counts.items():
        given = own.trials if own.distribution == "binomial" else own.exposure
        number = given if isinstance(given, int | float) else 1.0
        found[name] = simulate_power(
            design,
            terms=terms,
            distribution=own.distribution,
            baseline=baseline,
            size=float(number if size is None else size),
            experiments=experiments,
        )
    return found


def _start(distribution: DistributionName | None, baseline: float | None, size: float) -> float:
    """Linear predictor where all terms are zero."""
    if distribution is None:
        return 0.0
    if not (size > 0 and math.isfinite(size)) or (distribution == "binomial" and size != int(size)):
        what = "trials are a whole number above 0" if distribution == "binomial" else "exposure is above 0"
        raise RsmkitError(f"power: {what}, got {size:g}")
    mean = BASELINES[distribution] if baseline is None else baseline
    if distribution == "binomial":
        if not 0.0 < mean < 1.0:
            raise RsmkitError(f"power: the baseline probability lies between 0 and 1, got {mean:g}")
        return math.log(mean / (1.0 - mean))
    if not 0.0 < mean < math.inf:
        raise RsmkitError(f"power: the baseline rate is above 0, got {mean:g}")
    return math.log(mean)


class _Plan:
    """A design with its model, from which experiments are drawn and fitted."""

    def __init__(
        self,
        design: Design,
        terms: Terms,
        distribution: DistributionName | None,
        start: float,
        size: float,
        significance: float,
    ) -> None:
        if distribution and design.blocks:
            raise RsmkitError(
                "power: counts have no blocks or random groups here; leave the distribution out"
            )
        self.design, self.terms, self.distribution = design, terms, distribution
        self.start, self.size, self.significance = start, size, significance
        self.matrix = terms.matrix(design.coded)
        self.names = terms.names(design.space)
        blends = [e for e in terms.exponents if sum(e) == 1 and any(e[j] for j in terms.components)]
        idle = {(0,) * terms.k, *blends}
        owners = [terms.exponents[i] for i in terms.column_terms]
        self.testable = tuple(
            name for name, owner in zip(self.names, owners, strict=True) if owner not in idle
        )
        """Without the constant, and the linear blending that stands for it."""
        self.constant = np.array([self.start if owner in idle else 0.0 for owner in owners])
        labels = [str(block) for block in design.blocks]
        self.grouped = bool(design.blocks) and design.block_ratio is not None
        self.random = {GROUPS: labels} if self.grouped else None
        self.blocks = labels if design.blocks and not self.grouped else None
        fit_polynomial(
            design.space, "y", self._data(self.matrix[:, 0]), terms
        )  # refuses what is not told apart

    def alone(self, signal: float) -> dict[str, float]:
        """Coefficient of each term that makes the response change by the signal."""
        if self.terms.components:
            spans = np.ptp(self.matrix, axis=0)
            return {
                name: signal / span
                for name, span in zip(self.names, spans.tolist(), strict=True)
                if name in self.testable
            }
        categories = [
            sum(1 for e, count in zip(self.terms.exponents[i], self.terms.levels, strict=True) if e and count)
            for i in self.terms.column_terms
        ]
        sizes = {name: 0.5 * signal * 2.0**count for name, count in zip(self.names, categories, strict=True)}
        return {name: sizes[name] for name in self.testable}

    def share(
        self, effects: Mapping[str, float], tested: list[str], experiments: int, rng: np.random.Generator
    ) -> tuple[dict[str, int], int]:
        """How many experiments find each of the tested terms, and how many could not be fitted."""
        beta = self.constant + np.array([effects.get(name, 0.0) for name in self.names])
        eta = self.matrix @ beta
        hits, without = dict.fromkeys(tested, 0), 0
        for _ in range(experiments):
            try:
                p = self._p_values(self._drawn(eta, rng), tested)
            except FitError:
                without += 1
                continue
            for name in tested:
                hits[name] += bool(p[name] < self.significance)
        return hits, without

    def _drawn(self, eta: Floats, rng: np.random.Generator) -> Floats:
        if self.distribution:
            mean = DISTRIBUTIONS[self.distribution].mean(eta)
            if self.distribution == "binomial":
                return np.asarray(rng.binomial(int(self.size), mean), float)
            return np.asarray(rng.poisson(self.size * mean), float)
        y = eta + rng.standard_normal(len(eta))
        if self.grouped:
            assert self.design.block_ratio is not None
            blocks = np.unique(self.design.blocks, return_inverse=True)[1]
            y = y + math.sqrt(self.design.block_ratio) * rng.standard_normal(blocks.max() + 1)[blocks]
        return np.asarray(y)

    def _data(self, y: Floats) -> FitData:
        return checked_data(self.design.space, self.design.points, y, blocks=self.blocks, random=self.random)

    def _p_values(self, y: Floats, tested: list[str]) -> dict[str, float]:
        plain = fit_polynomial(self.design.space, "y", self._data(y), self.terms)
        if self.distribution:
            return self._of_counts(plain, tested)
        surface = fit_mixed(plain) if self.grouped else plain
        known = dict(zip(surface.names, surface.p_values.tolist(), strict=True))
        return {name: known[name] for name in tested}

    def _of_counts(self, plain: PolynomialSurface, tested: list[str]) -> dict[str, float]:
        """Likelihood-ratio tests."""
        assert self.distribution is not None
        sizes = np.full(len(plain.data), float(self.size))
        separated = bool(no_estimate(plain, self.distribution, sizes))
        surface: GlmSurface = fit_glm(plain, self.distribution, sizes, bias_reduced=separated)
        columns = list(range(len(surface.names)))
        full = surface.least_deviance(surface.matrix)
        found = {}
        for name in tested:
            rest = [j for j in columns if surface.names[j] != name]
            found[name] = float(chdtrc(1, max(surface.deviance_of(rest) - full, 0.0)))
        return found


def _interval(hits: int, experiments: int) -> tuple[float, float]:
    """Interval of a proportion."""
    tail = 0.5 * (1.0 - CONFIDENCE)
    low = 0.0 if hits == 0 else float(betaincinv(hits, experiments - hits + 1, tail))
    high = 1.0 if hits == experiments else float(betaincinv(hits + 1, experiments - hits, 1.0 - tail))
    return low, high
