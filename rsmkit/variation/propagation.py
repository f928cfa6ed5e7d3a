"""Laws through surfaces: what each response does in service about one design."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.special import ndtri

from rsmkit.errors import RsmkitError, one_of
from rsmkit.language.joint_law import JointLaw, Laws, box_law, check_law
from rsmkit.language.space import Floats
from rsmkit.surfaces.kinds import posterior_of
from rsmkit.surfaces.models.surface import Surface
from rsmkit.surfaces.posterior import Posterior
from rsmkit.variation.conformity.capability import capability
from rsmkit.variation.conformity.conformance import ALL, Cloud, Fraction, fractions, make_cloud
from rsmkit.variation.conformity.design_space import design_space
from rsmkit.variation.findings_of_laws import (
    Cause,
    FactorShare,
    OutOfSpecification,
    ResponseUncertainty,
    Uncertainty,
)
from rsmkit.variation.options import PropagationOptions, Specification
from rsmkit.variation.sensitivity.decomposition import Decomposition, Quantity, decompose

__all__ = ["QUANTILES", "Question", "posteriors_of", "propagate"]

QUANTILES = (0.01, 0.05, 0.25, 0.5, 0.75, 0.95, 0.99)


@dataclass(frozen=True, eq=False)
class Question:
    """What is asked of the surfaces.

    Parameters
    ----------
    surfaces : mapping of str to Surface
        By response.
    laws : Laws
        Of factors.
    point : array, shape (k,)
        The design, natural units.
    name : str
        What the design is called.
    specifications : mapping of str to Specification
        By response.
    deterministic : bool
        Whether runs repeat without noise.
    options : PropagationOptions
    """

    surfaces: Mapping[str, Surface]
    laws: Laws
    point: Floats
    name: str
    specifications: Mapping[str, Specification]
    deterministic: bool
    options: PropagationOptions

    def law(self) -> tuple[JointLaw, list[str]]:
        """The laws about the design, checked, and what to know about them.

        Raises
        ------
        RsmkitError
            Naming the factor whose law cannot be.
        """
        joint = self.laws.at(self.point)
        notes = [check_law(joint.space, name, law) for name, law in joint.laws.items()]
        return joint, [note for note in notes if note]


def posteriors_of(question: Question) -> dict[str, Posterior]:
    """Draw surfaces of every response, each from random numbers of its own."""
    options = question.options
    streams = np.random.SeedSequence(options.seed).spawn(len(question.surfaces))
    return {
        name: posterior_of(
            surface, options.draws, np.random.default_rng(stream), deterministic=question.deterministic
        )
        for (name, surface), stream in zip(question.surfaces.items(), streams, strict=True)
    }


def propagate(question: Question) -> Uncertainty:
    """Carry the laws through all surfaces.

    Raises
    ------
    RsmkitError
        For a law that cannot be, or a specification of no response.
    """
    for name in question.specifications:
        one_of("specifications: response", name, tuple(question.surfaces))
    law, notes = question.law()
    posteriors = posteriors_of(question)
    options, specifications = question.options, question.specifications
    notes += [
        f"the surface of {name} has as many terms as runs: what it leaves open is not known"
        for name, own in posteriors.items()
        if not own.known
    ]
    cloud = make_cloud(posteriors, law, options.seed)
    out = {}
    if specifications:
        out = fractions(posteriors, law, specifications, seed=options.seed, cloud=cloud)
    responses = {
        name: _response(question, name, posteriors[name], law, cloud, out.get(name)) for name in posteriors
    }
    found = Uncertainty(
        question.name,
        law.space.values(question.point),
        {name: own.text for name, own in law.laws.items()},
        options.confidence,
        responses,
        None if not out else OutOfSpecification(out[ALL].value, *out[ALL].interval(options.confidence)),
        notes=tuple(notes),
    )
    pair = _mapped(question, responses)
    if not specifications or pair is None:
        return found
    mapped = design_space(posteriors, question.laws, specifications, question.point, pair, seed=options.seed)
    return replace(found, design_space=mapped)


def _mapped(question: Question, responses: Mapping[str, ResponseUncertainty]) -> tuple[str, str] | None:
    """The two factors of the map: those asked for, else those that matter most to what is specified."""
    space = question.laws.space
    numeric = [factor.name for factor in space if factor.domain.is_numeric]
    if question.options.map:
        for name in question.options.map:
            if name not in numeric:
                raise RsmkitError(
                    f"propagation.map: {name} is no numeric factor (factors: {', '.join(numeric)})"
                )
        return question.options.map[0], question.options.map[1]
    weights = {
        name: sum(
            responses[response].sobol_box[name].total
            for response in question.specifications
            if name in responses[response].sobol_box
        )
        for name in numeric
    }
    most = sorted(numeric, key=lambda name: -weights[name])[:2]
    return (most[0], most[1]) if len(most) > 1 else None


def _response(
    question: Question,
    name: str,
    posterior: Posterior,
    law: JointLaw,
    cloud: Cloud,
    out: Fraction | None,
) -> ResponseUncertainty:
    options, confidence = question.options, question.options.confidence
    served = decompose(posterior, law, samples=options.samples, seed=options.seed)
    over_box = decompose(posterior, box_law(law.space), samples=options.samples, seed=options.seed)
    mean, sd = served.mean, _root(served.variance, posterior)
    together, together_in_box = _pairs(served, confidence), _pairs(over_box, confidence)
    quantiles, intervals = _quantiles(cloud, name, posterior.noise_sd, confidence, options.seed)
    specification = question.specifications.get(name)
    capabilities: dict[str, Any] = {}
    if specification is not None and out is not None:
        limits = {"low": specification.low, "high": specification.high}
        overall = math.hypot(sd.value, float(np.std(mean.draws)))
        found = capability(mean.value, sd.value, **limits)
        low, high = out.interval(confidence)
        capabilities = {
            "out_of_specification": out.value,
            "out_low": low,
            "out_high": high,
            "dpm": 1e6 * out.value,
            "cp": found.cp,
            "cpk": found.cpk,
            "ppk": capability(mean.value, overall, **limits).cpk,
        }
    return ResponseUncertainty(
        mean.value,
        sd.value,
        *mean.interval(confidence),
        *sd.interval(confidence, 0.0),
        posterior.noise_sd,
        quantiles,
        intervals,
        _shares(served, confidence),
        _shares(over_box, confidence),
        {pair: value for pair, (value, _, _) in together.items()},
        _causes(served, law, sd.value),
        served.exact,
        specification,
        **capabilities,
        pair_intervals={pair: (low, high) for pair, (_, low, high) in together.items()},
        pairs_box={pair: value for pair, (value, _, _) in together_in_box.items()},
        pair_intervals_box={pair: (low, high) for pair, (_, low, high) in together_in_box.items()},
    )


def _root(variance: Quantity, posterior: Posterior) -> Quantity:
    """Standard deviation with the noise of a run."""
    noises = posterior.noise_sd if posterior.noise_draws is None else posterior.noise_draws
    sd = math.sqrt(max(variance.value, 0.0) + posterior.noise_sd**2)
    return Quantity(
        sd,
        np.sqrt(np.maximum(variance.draws, 0.0) + np.square(noises)),
        variance.error / (2.0 * sd) if sd > 0 else 0.0,
    )


def _shares(found: Decomposition, confidence: float) -> dict[str, FactorShare]:
    shares = {}
    for name, first, total in zip(found.names, found.first, found.total, strict=True):
        alone, whole = first / found.variance, total / found.variance
        shares[name] = FactorShare(
            alone.value,
            whole.value,
            *whole.interval(confidence, 0.0, max(1.0, whole.value)),
            *alone.interval(confidence, 0.0, max(1.0, alone.value)),
        )
    return shares


def _pairs(found: Decomposition, confidence: float) -> dict[str, tuple[float, float, float]]:
    """Share that exactly two factors cause together, by their names, and its interval."""
    if not found.variance.value > 0:
        return {}
    shares = {}
    for (i, j), part in found.pairs.items():
        share = part / found.variance
        ends = share.interval(confidence, 0.0, max(1.0, share.value))
        shares[f"{found.names[i]}*{found.names[j]}"] = (share.value, *ends)
    return shares


def _causes(found: Decomposition, law: JointLaw, sd: float) -> dict[str, Cause]:
    """What each law does; `sd` is that of the response with the noise of a run."""
    causes = {}
    for j, (name, own) in enumerate(law.laws.items()):
        part = max(found.total[j].value, 0.0)
        slope = found.widening[j] / (2.0 * sd * own.sd) if sd > 0 else 0.0
        causes[name] = Cause(math.sqrt(part), math.sqrt(max(sd * sd - part, 0.0)), float(slope))
    return causes


def _quantiles(
    cloud: Cloud, name: str, noise_sd: float, confidence: float, seed: int
) -> tuple[dict[str, float], dict[str, tuple[float, float]]]:
    values, draws = cloud.values[name], cloud.draws[name]
    if noise_sd > 0:
        order = np.random.default_rng(seed + 3).permutation(len(values))
        noise = noise_sd * ndtri((order + 0.5) / len(values))
        values, draws = values + noise, draws + noise
    tail = 0.5 * (1.0 - confidence)
    own = np.quantile(values, QUANTILES)
    ends = np.quantile(np.quantile(draws, QUANTILES, axis=1), [tail, 1.0 - tail], axis=1).T
    keys = [f"{p:g}" for p in QUANTILES]
    pairs = [(min(low, q), max(high, q)) for q, (low, high) in zip(own.tolist(), ends.tolist(), strict=True)]
    return dict(zip(keys, own.tolist(), strict=True)), dict(zip(keys, pairs, strict=True))
