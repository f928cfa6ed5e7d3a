"""Which effects of an unreplicated two-level design are more than noise, judged by the effects themselves.

Lenth, *Technometrics* 31 (1989), 469-473: most effects are taken to be zero, so the small ones show the
noise. ``s0 = 1.5 median |c|``, the pseudo standard error ``PSE = 1.5 median {|c| : |c| < 2.5 s0}``, the
margin of error ``ME = t(0.975; m/3) PSE`` for one effect, the simultaneous margin ``SME`` for all m at once.
p-values by simulation, because the ratio ``c / PSE`` only resembles Student's t (Ye & Hamada, *J. Quality
Technology* 32 (2000), 57-66, tabulate its quantiles).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from scipy.special import ndtri, stdtr, stdtrit

from rsmkit.errors import RsmkitError
from rsmkit.io.arguments import checked
from rsmkit.io.shown import Shown
from rsmkit.language.space import Floats
from rsmkit.surfaces.estimation.fit_data import cells
from rsmkit.surfaces.estimation.least_squares import EXACT
from rsmkit.surfaces.models.polynomial import PolynomialSurface
from rsmkit.surfaces.reading import number
from rsmkit.surfaces.statistics.terms.term_tests import term_name
from rsmkit.surfaces.statistics.texts import columns_of, short
from rsmkit.surfaces.statistics.two_level.two_levels import TwoLevels, two_levels

__all__ = ["Screening", "screen_effects", "screening_report", "screening_words"]

CONFIDENCE = 0.95
FEWEST = 3
"""Effects of which a median means something."""
SIMULATED = 1_000_000
"""Effects drawn for the p-values: their standard error at 0.05 is below 0.0005."""
SEED = 1989
SPREAD = 1e-6
"""Relative differences of variances that are rounding."""


@dataclass(frozen=True)
class Screening(Shown):
    """Lenth's analysis.

    Parameters
    ----------
    names : tuple of str
    effects : array, shape (m,)
        Change of the response from the lower to the upper level.
    pse, me, sme : float
        Pseudo standard error, margin of error, simultaneous margin of error.
    p, p_simultaneous : array, shape (m,)
        Chance that one effect, or the largest of all, is as large where none is real; by simulation.
    """

    names: tuple[str, ...]
    effects: Floats
    pse: float
    me: float
    sme: float
    p: Floats
    p_simultaneous: Floats

    @property
    def half_normal(self) -> Floats:
        """Half-normal quantile of each effect: the abscissa of Daniel's plot (1959), shape (m,)."""
        rank = np.abs(self.effects).argsort(kind="stable").argsort()
        quantiles: Floats = ndtri(0.5 + 0.5 * (rank + 0.5) / len(rank))
        return quantiles


@checked
def screen_effects(surface: PolynomialSurface) -> Screening:
    """Judge the effects of a two-level design without a measure of noise from elsewhere (Lenth 1989).

    Parameters
    ----------
    surface : PolynomialSurface
        Fitted to runs at two levels of each factor, and perhaps at the centre.

    Raises
    ------
    RsmkitError
        Where the method does not apply, with the reason.
    """
    name, two = surface.response, two_levels(surface)
    terms = surface.terms
    if terms.order and max(max(e) for e in terms.exponents) > 1:
        raise RsmkitError(f"{name}: the model has powers, which two levels do not show")
    if not np.isfinite(two.points).all():
        raise RsmkitError(f"{name}: a category has more than two levels")
    kept = replace(terms, exponents=tuple(e for e in terms.exponents if any(e)))
    if len(kept) < FEWEST:
        raise RsmkitError(f"{name}: Lenth's method needs at least {FEWEST} effects, there are {len(kept)}")
    effects, variances = _effects(surface, two)
    if np.ptp(variances) > SPREAD * variances.max():
        raise RsmkitError(f"{name}: the effects are not equally precise, as Lenth's method wants them")
    pse = float(_pseudo_errors(effects[None])[0])
    pse = pse if pse > EXACT * np.abs(effects).max() else 0.0  # what rounding leaves is no error
    count, ratios = len(effects), np.full(len(effects), np.nan)
    ratios = np.abs(effects) / pse if pse > 0 else ratios
    one, all_at_once = _null_ratios(count)
    d = count / 3.0
    tail = 0.5 * (1.0 + CONFIDENCE ** (1.0 / count))
    return Screening(
        tuple(term_name(e, surface.space.names) for e in kept.exponents),
        effects,
        pse,
        float(stdtrit(d, 0.5 + 0.5 * CONFIDENCE)) * pse,
        float(stdtrit(d, tail)) * pse,
        _share_above(one, ratios),
        _share_above(all_at_once, ratios),
    )


def screening_report(surface: PolynomialSurface) -> dict[str, Any]:
    """Lenth's analysis as JSON values, or why there is none."""
    try:
        if not _unreplicated(surface):
            raise RsmkitError("runs are repeated, so t tests tell real effects from noise")
        found = screen_effects(surface)
    except RsmkitError as error:
        return {"reason": str(error).removeprefix(f"{surface.response}: ")}
    df = len(found.effects) / 3.0
    ratios = found.effects / found.pse if found.pse > 0 else np.full(len(found.effects), np.nan)
    by_t = 2.0 * stdtr(df, -np.abs(ratios))
    columns = (found.effects, ratios, found.p, found.p_simultaneous, by_t, found.half_normal)
    keys = ("effect", "t", "p", "p_simultaneous", "p_by_t", "half_normal")
    return {
        "pse": found.pse,
        "me": found.me,
        "sme": found.sme,
        "confidence": CONFIDENCE,
        "effects": [
            {"name": name, **{key: number(x) for key, x in zip(keys, values, strict=True)}}
            for name, *values in zip(found.names, *columns, strict=True)
        ],
    }


def screening_words(report: dict[str, Any], df: int) -> list[str]:
    """Lenth's analysis as lines of text, the largest effect first; nothing with much left to test by."""
    if "reason" in report or df >= len(report["effects"]):
        return []
    rows = sorted(report["effects"], key=lambda row: -abs(row["effect"]))
    keys = {
        "effect": "name",
        "size": "effect",
        "size/PSE": "t",
        "p": "p",
        "p (all at once)": "p_simultaneous",
    }
    margins = ", ".join(f"{key.upper()} {short(report[key])}" for key in ("pse", "me", "sme"))
    return [
        "",
        f"Unreplicated two-level design, judged by Lenth's method: {margins}",
        *columns_of(rows, keys),
    ]


def _unreplicated(surface: PolynomialSurface) -> bool:
    """Whether no run but those at the centre is repeated."""
    away = ~two_levels(surface).center
    return len(np.unique(cells(surface.data.points[away]))) == int(away.sum())


def _effects(surface: PolynomialSurface, two: TwoLevels) -> tuple[Floats, Floats]:
    """Effects between -1 and +1, and their variances for sigma = 1, shape (m,) each."""
    terms = surface.terms
    root = np.sqrt(surface.fit.weights)[:, None]
    columns = np.ones((len(two.points), 0))
    for exponents in terms.exponents:
        used = two.points[:, [j for j, power in enumerate(exponents) if power]]
        columns = np.hstack([columns, used.prod(axis=1, keepdims=True)])
    blocks = surface.data.block_columns()
    q, r = np.linalg.qr(np.hstack([blocks, columns]) * root)
    inverse = np.linalg.inv(r)
    places = blocks.shape[1] + np.flatnonzero([any(e) for e in terms.exponents])
    coefficients = (inverse @ (q.T @ (surface.fit.y[:, None] * root)))[places, 0]
    variances: Floats = np.einsum("ij,ij->i", inverse, inverse)[places]
    return 2.0 * coefficients, 4.0 * variances


def _pseudo_errors(effects: Floats) -> Floats:
    """Pseudo standard error of each row of effects, shape (rows,)."""
    sizes = np.sort(np.abs(effects), axis=1)
    rows, count = np.arange(len(sizes)), sizes.shape[1]
    median = 0.5 * (sizes[:, (count - 1) // 2] + sizes[:, count // 2])
    small = np.maximum((sizes < 3.75 * median[:, None]).sum(axis=1), 1)
    errors: Floats = 0.75 * (sizes[rows, (small - 1) // 2] + sizes[rows, small // 2])
    return errors


@lru_cache(maxsize=8)
def _null_ratios(count: int) -> tuple[Floats, Floats]:
    """Sorted ``|c| / PSE`` where no effect is real: of every effect, and the largest of each experiment."""
    random = np.random.default_rng(SEED)
    effects = random.standard_normal((max(SIMULATED // count, 2_000), count))
    ratios = np.abs(effects) / _pseudo_errors(effects)[:, None]
    return np.sort(ratios.ravel()), np.sort(ratios.max(axis=1))


def _share_above(drawn: Floats, ratios: Floats) -> Floats:
    """Share of the draws that are at least as large, never zero; nan stays nan."""
    above = len(drawn) - np.searchsorted(drawn, ratios, side="left")
    return np.where(np.isnan(ratios), np.nan, (above + 1.0) / (len(drawn) + 1.0))
