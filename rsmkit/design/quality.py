"""What a design can do, before a single run is spent: efficiencies, conditioning, aliasing, warnings."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from rsmkit.design.aliasing import power_of_terms
from rsmkit.design.bound import log_det_bound
from rsmkit.design.criteria import variance_points
from rsmkit.design.encoding import encode_model, moments
from rsmkit.design.region import Region, box
from rsmkit.design.table import Design
from rsmkit.errors import RsmkitError
from rsmkit.space import Floats
from rsmkit.terms import Terms, full_terms

__all__ = ["Quality", "assess", "refuse_singular"]

LARGE_VIF = 10.0
LARGE_LEVERAGE = 0.99


@dataclass(frozen=True)
class Quality:
    """Figures of a design for one model, in coded units, error variance 1.

    Parameters
    ----------
    runs, distinct, p : int
        Runs, different points, columns of the model matrix.
    rank : int
        Rank of the model matrix; everything below is None when it is smaller than `p`.
    aliased : tuple of str
        Terms that cannot be told from those before them.
    d_efficiency : float
        ``100 det(X'X)^(1/p) / n``, against an orthogonal design on the corners of the bounds.
    d_bound_efficiency : float
        ``100 (det(X'X) / det*)^(1/p)`` with det* an upper bound for any design of as many runs that keeps the
        given points: what is left to gain. A design with points outside the bounds is compared on the box
        that holds them.
    a_efficiency : float
        ``100 p / (n tr inv(X'X))``, against the same.
    g_efficiency : float
        ``100 p / (n max d)``, with d the prediction variance, against the smallest possible maximum.
    average_variance : float
        Prediction variance averaged over the bounds (what I-optimal designs minimise).
    largest_variance : float
        Largest prediction variance within the bounds (what G-optimal designs minimise).
    condition_number : float
        Of the model matrix with columns scaled to unit length.
    vif : dict
        Variance inflation factor of every term but the constant.
    leverages : tuple of float
        Diagonal of the hat matrix, one per run.
    standard_errors : dict
        Standard error of every coefficient for unit error standard deviation.
    power : dict
        Power of each term's t test at a signal-to-noise ratio of 2; empty when no run is left for the error.
    starts, hits : int or None
        For a searched design: random starts made, and how many of them found the best value.
    warnings : tuple of str
        What to know before spending runs.
    """

    runs: int
    distinct: int
    p: int
    rank: int
    aliased: tuple[str, ...]
    d_efficiency: float | None
    d_bound_efficiency: float | None
    a_efficiency: float | None
    g_efficiency: float | None
    average_variance: float | None
    largest_variance: float | None
    condition_number: float | None
    vif: dict[str, float]
    leverages: tuple[float, ...]
    standard_errors: dict[str, float]
    power: dict[str, float]
    starts: int | None
    hits: int | None
    warnings: tuple[str, ...]

    def to_json(self) -> dict[str, Any]:
        """The figures as plain JSON types."""
        return {key: list(v) if isinstance(v, tuple) else v for key, v in asdict(self).items()}


def assess(
    design: Design,
    *,
    order: int = 2,
    terms: Terms | None = None,
    region: Region | None = None,
    deterministic: bool = True,
) -> Quality:
    """Work out what a design can estimate.

    Parameters
    ----------
    design : Design
    order : int
        The model, unless `terms` gives it.
    terms : Terms, optional
    region : Region, optional
        Where predictions are wanted; the bounds by default.
    deterministic : bool
        Whether equal points give equal responses, so that replicates are run once.
    """
    terms = full_terms(design.space, order) if terms is None else terms
    region = box(design.space) if region is None else region
    names = terms.names(design.space)
    X = terms.matrix(design.coded)
    effects = len(set(design.blocks)) - 1 if design.blocks else 0
    if effects:  # what the blocks explain is not available to the model
        indicators = (np.array(design.blocks)[:, None] == np.unique(design.blocks)).astype(float)
        centred = (indicators - indicators.mean(axis=0))[:, 1:]
        X = X - centred @ np.linalg.lstsq(centred, X, rcond=None)[0]
    lengths = np.sqrt((X**2).sum(axis=0))
    scaled = X / np.where(lengths > 0, lengths, 1.0)
    aliased = _aliased(scaled, names)
    rank = terms.p - len(aliased)
    warnings = _warnings(design, terms, rank, aliased, deterministic)
    if aliased:
        return Quality(
            len(design), design.distinct, terms.p, rank, aliased,
            None, None, None, None, None, None, None, {}, (), {}, {}, None, None, tuple(warnings),
        )  # fmt: skip
    Q, R = np.linalg.qr(scaled)
    inverse = np.linalg.inv(R) / lengths[:, None]
    covariance = inverse @ inverse.T
    log_det = 2.0 * (np.log(np.abs(np.diag(R))) + np.log(lengths)).sum()
    leverages = (Q**2).sum(axis=1)
    n, p = X.shape
    probes = np.vstack([variance_points(region), design.coded[region.contains(design.coded)]])
    largest = float(((terms.matrix(probes) @ inverse) ** 2).sum(axis=1).max())
    vif = _vif(X, covariance, names)
    warnings += _statistical_warnings(vif, leverages)
    return Quality(
        runs=n,
        distinct=design.distinct,
        p=p,
        rank=p,
        aliased=(),
        d_efficiency=float(100.0 * np.exp(log_det / p) / n),
        d_bound_efficiency=float(100.0 * np.exp((log_det - _bound(design, terms)) / p)),
        a_efficiency=float(100.0 * p / (n * np.trace(covariance))),
        g_efficiency=100.0 * p / (n * largest),
        average_variance=float((covariance * moments(encode_model(terms), region)).sum()),
        largest_variance=largest,
        condition_number=float(np.linalg.cond(scaled)),
        vif=vif,
        leverages=tuple(leverages.tolist()),
        standard_errors=dict(zip(names, np.sqrt(np.diag(covariance)).tolist(), strict=True)),
        power=power_of_terms(design, terms=terms) if n > p + effects else {},
        starts=design.found.starts if design.found else None,
        hits=design.found.hits if design.found else None,
        warnings=tuple(warnings),
    )


def refuse_singular(quality: Quality) -> None:
    """Raise when the design cannot estimate its model.

    Raises
    ------
    RsmkitError
        With the terms that are aliased named.
    """
    if quality.aliased:
        raise RsmkitError(
            f"the design cannot estimate the model: rank {quality.rank} of {quality.p}. Not estimable beside "
            f"the terms before them: {', '.join(quality.aliased)}. Add runs (design.augment_to), give the "
            "factors more levels, or choose a smaller model"
        )


def _aliased(scaled: Floats, names: tuple[str, ...]) -> tuple[str, ...]:
    """Columns that are linear combinations of earlier ones (Gram-Schmidt, twice for stability)."""
    basis = np.empty((0, len(scaled)))
    lost = []
    for name, column in zip(names, scaled.T, strict=True):
        rest = column - basis.T @ (basis @ column)
        rest -= basis.T @ (basis @ rest)
        length = np.linalg.norm(rest)
        if length < 1e-8:
            lost.append(name)
        else:
            basis = np.vstack([basis, rest / length])
    return tuple(lost)


def _vif(X: Floats, covariance: Floats, names: tuple[str, ...]) -> dict[str, float]:
    spread = ((X - X.mean(axis=0)) ** 2).sum(axis=0)
    factors = np.diag(covariance) * spread
    return {name: float(v) for name, v in zip(names, factors, strict=True) if name != "1"}


def _bound(design: Design, terms: Terms) -> float:
    """Upper bound of log det X'X for designs with the same given points and as many runs."""
    free = np.array([kind == "augmented" for kind in design.kinds])
    if not free.any():
        free[:] = True
    numeric = design.space.numeric
    reach = max(1.0, float(np.abs(design.coded[free][:, numeric]).max())) if numeric.any() else 1.0
    return log_det_bound(terms, box(design.space, reach), len(design), design.coded[~free])


def _warnings(
    design: Design, terms: Terms, rank: int, aliased: tuple[str, ...], deterministic: bool
) -> list[str]:
    found = []
    outside = ~design.space.contains(design.points)
    if outside.any():
        kinds = sorted({design.kinds[i] for i in np.flatnonzero(outside)})
        reach = np.abs(design.coded[:, design.space.numeric]).max()
        found.append(
            f"{outside.sum()} {' and '.join(kinds)} points lie outside the bounds (up to {reach:.4g} coded, "
            "the bounds are at 1): the simulator must be valid there; star = 'inscribed' or 'faced' keeps "
            "every point inside"
        )
    repeats = len(design) - design.distinct
    if deterministic and repeats:
        found.append(
            f"{len(design)} runs, {design.distinct} distinct: replicates share one run, for a deterministic "
            "simulator they tell nothing new"
        )
    useful = design.distinct if deterministic else len(design)
    if useful < terms.p:
        found.append(
            f"too few runs: the model has {terms.p} coefficients, the design {useful} "
            f"{'distinct ' if deterministic else ''}points"
        )
    elif useful == terms.p:
        found.append(
            f"saturated: as many {'distinct ' if deterministic else ''}points as coefficients ({terms.p}); "
            "nothing is left to judge the fit by, a few more runs are well spent"
        )
    if aliased:
        found.append(f"singular: rank {rank} of {terms.p}; not estimable: {', '.join(aliased)}")
    return found


def _statistical_warnings(vif: dict[str, float], leverages: Floats) -> list[str]:
    found = []
    large = {name: value for name, value in vif.items() if value > LARGE_VIF}
    if large:
        worst = max(large, key=lambda name: large[name])
        found.append(
            f"{len(large)} terms have a variance inflation factor above {LARGE_VIF:g} (largest {worst}: "
            f"{large[worst]:.3g}): their coefficients cannot be told apart well"
        )
    alone = np.flatnonzero(leverages > LARGE_LEVERAGE)
    if len(alone) and len(leverages) > leverages.sum() + 0.5:
        runs = ", ".join(str(i + 1) for i in alone[:8])
        found.append(
            f"the fit passes (nearly) through run{'s' if len(alone) > 1 else ''} {runs}"
            f"{' and others' if len(alone) > 8 else ''} (leverage above {LARGE_LEVERAGE:g}): an error there "
            "would go unnoticed"
        )
    return found
