"""What a design can do, before a single run is spent: efficiencies, conditioning, aliasing, warnings."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from rsmkit.design.design import Design
from rsmkit.design.optimal.bound import log_det_bound
from rsmkit.design.optimal.criteria import variance_points
from rsmkit.design.optimal.encoding import encode_model, moments
from rsmkit.design.quality.aliasing import term_correlations
from rsmkit.design.quality.extremes import extreme_variances
from rsmkit.design.quality.plot_figures import PlotFigures
from rsmkit.design.quality.power import power_of_terms
from rsmkit.design.quality.variance import design_space_fraction, variance_profile
from rsmkit.design.region import Region, box
from rsmkit.errors import RsmkitError
from rsmkit.io.arguments import checked
from rsmkit.io.json_codec import Document
from rsmkit.language.space import Floats
from rsmkit.language.space_terms import space_terms
from rsmkit.language.terms import Terms

__all__ = ["Quality", "assess", "refuse_singular"]

LARGE_VIF = 10.0
LARGE_LEVERAGE = 0.99
MOST_SHOWN = 10
WORTH_TELLING = 97.0


@dataclass(frozen=True, kw_only=True)
class Quality(Document):
    """Figures of a design for one model, in coded units, error variance 1.

    What has a default is not in the files of early versions.

    Parameters
    ----------
    runs, distinct, p : int
        Runs, different points, columns of the model matrix.
    rank : int
        Rank of the model matrix; everything below is None when it is smaller than `p`.
    aliased : tuple of str
        Terms that cannot be told from those before them.
    alias_of : dict
        For each of these the combination of earlier terms that it equals at every run, as ``"1 + x1"``.
    d_efficiency : float
        ``100 det(X'X)^(1/p) / n``, against an orthogonal design on the corners of the bounds.
    d_bound_efficiency : float
        ``100 (det(X'X) / det*)^(1/p)`` with det* an upper bound for any design of as many runs that keeps the
        given points: what is left to gain; None for runs in random groups. A design with points outside the
        bounds is compared on the box that holds them.
    a_efficiency : float
        ``100 p / (n tr inv(X'X))``, against the same.
    g_efficiency : float
        ``100 p / (n max d)``, with d the prediction variance, against the smallest possible maximum.
    i_efficiency : float
        ``100 tr(W) / (n tr(W inv(X'X)))``, with W the average of f f' over the region, against the same as D.
    average_variance : float
        Prediction variance averaged over the region (what I-optimal designs minimise).
    largest_variance : float
        Largest prediction variance in the region (what G-optimal designs minimise).
    variance_fractions : tuple of float
        Prediction variance not exceeded in 0, 10, 20, ..., 100 % of the region: its minimum, quantiles of
        a sample, its maximum.
    variance_profile : dict
        For every factor the prediction variance at values from its low to its high bound (every level of a
        categorical one), the others at their centre.
    correlations : dict
        The largest correlations of terms over the runs, by ``"x1^2, x2^2"``; ten at most, above 0.1.
    condition_number : float
        Of the model matrix with columns scaled to unit length.
    vif : dict
        Variance inflation factor of every term but the constant.
    leverages : tuple of float
        Diagonal of the hat matrix, one per run.
    standard_errors : dict
        Standard error of every coefficient for unit error standard deviation.
    region_standard_errors : dict
        The same with every factor coded by the half-width of the region instead of that of the bounds: how
        well the effects over the region are known.
    power : dict
        Power of each term's t test at a signal-to-noise ratio of 2, and of the F test of each term of several
        categories (see :func:`rsmkit.design.quality.power.power_of_terms`); empty when no run is left for the
        error.
    plots : tuple of PlotFigures
        For designs in whole plots or random blocks: figures for several ratios of the variance of a plot to
        that of a run.
    denominator_df : dict
        Likewise: degrees of freedom that each coefficient's test will have, None for none.
    starts, hits : int or None
        For a searched design: random starts made, and how many of them found the best value.
    unseen : float or None
        Likewise: chance that another start would end at a value that none has ended at.
    warnings : tuple of str
        What to know before spending runs.
    """

    runs: int
    distinct: int
    p: int
    rank: int
    aliased: tuple[str, ...]
    alias_of: dict[str, str] = field(default_factory=dict)
    d_efficiency: float | None
    d_bound_efficiency: float | None = None
    a_efficiency: float | None
    g_efficiency: float | None
    i_efficiency: float | None = None
    average_variance: float | None
    largest_variance: float | None
    variance_fractions: tuple[float, ...] = ()
    variance_profile: dict[str, tuple[float, ...]] = field(default_factory=dict)
    correlations: dict[str, float] = field(default_factory=dict)
    condition_number: float | None
    vif: dict[str, float]
    leverages: tuple[float, ...]
    standard_errors: dict[str, float]
    region_standard_errors: dict[str, float] = field(default_factory=dict)
    power: dict[str, float | None] = field(default_factory=dict)
    plots: tuple[PlotFigures, ...] = ()
    denominator_df: dict[str, float | None] = field(default_factory=dict)
    starts: int | None = None
    hits: int | None = None
    unseen: float | None = None
    warnings: tuple[str, ...]


@checked
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
        Where predictions are wanted and other designs might put their points; the bounds by default.
    deterministic : bool
        Whether equal points give equal responses, so that replicates are run once.
    """
    terms = space_terms(design.space, order) if terms is None else terms
    region = box(design.space) if region is None else region
    names = terms.names(design.space)
    X = terms.matrix(design.coded)
    covariance = design.covariance
    effects = len(set(design.blocks)) - 1 if design.blocks and covariance is None else 0
    if covariance is not None:  # runs as if they were independent, with variance one
        X = np.linalg.solve(np.linalg.cholesky(covariance), X)
    if effects:  # what the blocks explain is not available to the model
        indicators = (np.array(design.blocks)[:, None] == np.unique(design.blocks)).astype(float)
        centred = (indicators - indicators.mean(axis=0))[:, 1:]
        X = X - centred @ np.linalg.lstsq(centred, X, rcond=None)[0]
    lengths = np.sqrt((X**2).sum(axis=0))
    scaled = X / np.where(lengths > 0, lengths, 1.0)
    alias_of = _aliases(scaled, lengths, names)
    rank = terms.p - len(alias_of)
    warnings = _warnings(design, terms, rank, alias_of, deterministic)
    found = design.found
    common: dict[str, Any] = {
        "runs": len(design),
        "distinct": design.distinct,
        "p": terms.p,
        "rank": rank,
        "aliased": tuple(alias_of),
        "alias_of": alias_of,
        "correlations": _largest_correlations(design, terms),
        "starts": found.starts if found else None,
        "hits": found.hits if found else None,
        "unseen": found.unseen if found else None,
    }
    if alias_of:
        nothing: dict[str, Any] = {item.name: None for item in fields(Quality)} | {
            "vif": {}, "leverages": (), "standard_errors": {},
            "region_standard_errors": {}, "power": {},
            "variance_fractions": (), "variance_profile": {}, "plots": (), "denominator_df": {},
        }  # fmt: skip
        return Quality(**(nothing | common | {"warnings": tuple(warnings)}))
    Q, R = np.linalg.qr(scaled)
    inverse = np.linalg.inv(R) / lengths[:, None]
    spread = inverse @ inverse.T
    errors = np.sqrt(np.diag(spread))
    log_det = 2.0 * (np.log(np.abs(np.diag(R))) + np.log(lengths)).sum()
    leverages = (Q**2).sum(axis=1)
    n, p = X.shape
    probes = np.vstack([variance_points(region), design.coded[region.contains(design.coded)]])
    smallest, largest = extreme_variances(terms, spread, region, probes)
    average_of = moments(encode_model(terms), region)
    average = float((spread * average_of).sum())
    vif = _vif(X, spread, names, bool(terms.components))
    bound_efficiency = None
    if covariance is None:  # the bound is one for independent runs
        bound_efficiency = float(100.0 * np.exp((log_det - _bound(design, terms, region)) / p))
        warnings += _price_of_distance(design, bound_efficiency, deterministic)
    warnings += _statistical_warnings(vif, leverages)
    _, variances = design_space_fraction(design, terms=terms, region=region)
    fractions = np.quantile(variances, np.linspace(0.0, 1.0, 11))
    fractions[[0, -1]] = min(smallest, fractions[0]), max(largest, fractions[-1])
    return Quality(
        **common,
        d_efficiency=float(100.0 * np.exp(log_det / p) / n),
        d_bound_efficiency=bound_efficiency,
        a_efficiency=float(100.0 * p / (n * np.trace(spread))),
        g_efficiency=100.0 * p / (n * largest),
        i_efficiency=100.0 * float(np.trace(average_of)) / (n * average),
        average_variance=average,
        largest_variance=largest,
        variance_fractions=tuple(fractions.tolist()),
        variance_profile={
            profile.factor: tuple(profile.variances.tolist())
            for profile in variance_profile(design, terms=terms, steps=11)
        },
        condition_number=float(np.linalg.cond(scaled)),
        vif=vif,
        leverages=tuple(leverages.tolist()),
        standard_errors=dict(zip(names, errors.tolist(), strict=True)),
        region_standard_errors=dict(zip(names, (errors * _reach(terms, region)).tolist(), strict=True)),
        power=dict(power_of_terms(design, terms=terms)) if n > p + effects and covariance is None else {},
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
            f"the terms before them: {', '.join(quality.aliased)} (at every run "
            f"{_equations(quality.alias_of)}). Add runs (design.augment_to), give the factors more levels, "
            "or choose a smaller model (surface.order, surface.terms)"
        )


def _aliases(scaled: Floats, lengths: Floats, names: tuple[str, ...]) -> dict[str, str]:
    """Columns that are combinations of earlier ones, and the combination (Gram-Schmidt, twice)."""
    basis, kept, lost = np.empty((0, len(scaled))), list[int](), dict[str, str]()
    for index, column in enumerate(scaled.T):
        rest = column - basis.T @ (basis @ column)
        rest -= basis.T @ (basis @ rest)
        length = np.linalg.norm(rest)
        if length >= 1e-8:
            basis = np.vstack([basis, rest / length])
            kept.append(index)
            continue
        shares = np.linalg.lstsq(scaled[:, kept], column, rcond=None)[0] * lengths[index] / lengths[kept]
        lost[names[index]] = _combination(shares, [names[i] for i in kept])
    return lost


def _combination(shares: Floats, names: list[str]) -> str:
    parts = []
    for share, name in zip(shares, names, strict=True):
        if abs(share) > 1e-6:
            size = "" if abs(abs(share) - 1.0) < 1e-6 else f"{abs(share):.3g} "
            parts.append(("- " if share < 0 else "+ ") + size + name)
    text = " ".join(parts).removeprefix("+ ")
    return (text.replace("- ", "-", 1) if text.startswith("- ") else text) or "0"


def _equations(alias_of: dict[str, str]) -> str:
    shown = [f"{name} = {combination}" for name, combination in alias_of.items()]
    return ", ".join(shown[:MOST_SHOWN]) + (
        f" and {len(shown) - MOST_SHOWN} more" if len(shown) > MOST_SHOWN else ""
    )


def _largest_correlations(design: Design, terms: Terms) -> dict[str, float]:
    matrix, names = term_correlations(design, terms=terms)
    rows, columns = np.triu_indices(len(names), 1)
    order = np.argsort(-np.abs(matrix[rows, columns]), kind="stable")[:MOST_SHOWN]
    pairs = {f"{names[rows[i]]}, {names[columns[i]]}": float(matrix[rows[i], columns[i]]) for i in order}
    return {pair: value for pair, value in pairs.items() if abs(value) > 0.1}


def _reach(terms: Terms, region: Region) -> Floats:
    """Each column where every numeric factor is half the width of the region, shape (p,)."""
    coded = region.space.numeric & ~region.space.components  # components are what they are in any region
    half = np.where(coded, 0.5 * (region.highs - region.lows), 1.0)
    powers = np.array([terms.exponents[t] for t in terms.column_terms], dtype=float)
    return np.asarray(np.where(region.space.numeric, half**powers, 1.0).prod(axis=1))


def _price_of_distance(design: Design, bound_efficiency: float, deterministic: bool) -> list[str]:
    found = design.found
    if found is None or found.criterion != "D" or found.distance <= 0.0 or bound_efficiency > WORTH_TELLING:
        return []
    repeated = (
        "tell nothing new about a deterministic simulator"
        if deterministic
        else "also tell how much runs differ by chance"
    )
    return [
        f"added points are kept {found.distance:g} apart (min_distance): {bound_efficiency:.1f} % of the "
        f"D-efficiency that is possible with repeated points, which {repeated}; a smaller min_distance "
        "costs less, replicates = true nothing"
    ]


def _vif(X: Floats, covariance: Floats, names: tuple[str, ...], mixed: bool) -> dict[str, float]:
    """Against orthogonal columns; about the mean where there is a constant, about zero in mixtures."""
    spread = ((X - (0.0 if mixed else X.mean(axis=0))) ** 2).sum(axis=0)
    factors = np.diag(covariance) * spread
    return {name: float(v) for name, v in zip(names, factors, strict=True) if name != "1"}


def _bound(design: Design, terms: Terms, region: Region) -> float:
    """Upper bound of log det X'X for designs with the same given points and as many runs."""
    free = np.array([kind in ("augmented", "space-filling") for kind in design.kinds])
    if not free.any():
        free[:] = True
    points, numeric = design.coded[free], design.space.numeric
    if not (region.irregular or region.constraints):
        reach = float(np.abs(points[:, numeric]).max()) if numeric.any() else 1.0
        region = box(design.space, max(1.0, reach))
    return log_det_bound(terms, region, len(design), design.coded[~free], points)


def _warnings(
    design: Design, terms: Terms, rank: int, alias_of: dict[str, str], deterministic: bool
) -> list[str]:
    found = []
    outside = ~design.space.contains(design.points)
    if outside.any():
        kinds = sorted({design.kinds[i] for i in np.flatnonzero(outside)})
        reach = np.abs(design.coded[:, design.space.numeric]).max()
        found.append(
            f"{outside.sum()} {' and '.join(kinds)} points lie outside the bounds (up to {reach:.4g} coded, "
            "the bounds are at 1): runs must be possible there; star = 'inscribed' or 'faced' keeps "
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
    if alias_of:
        found.append(f"singular: rank {rank} of {terms.p}; at every run {_equations(alias_of)}")
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
