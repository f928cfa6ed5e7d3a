"""Estimated means of the levels of factors, their differences, and contrasts (least-squares means).

A mean is the model's prediction at a level, averaged over a grid of the other factors: every category with
equal weight, numbers at their average over the runs, numbers of one or two values at these values with equal
weight, blocks with equal weight. This is the default grid of R's ``emmeans`` (Searle, Speed & Milliken, *The
American Statistician* 34 (1980), 216-221). Differences have Tukey's adjustment, with Kramer's for means of
unequal precision (Tukey 1953; Kramer, *Biometrics* 12 (1956), 307-310).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations, product
from typing import Any

import numpy as np
from scipy.special import stdtrit

from rsmkit.errors import RsmkitError, one_of
from rsmkit.io.arguments import checked
from rsmkit.io.shown import Shown
from rsmkit.io.tables.csv_tables import split_line
from rsmkit.language.space import Floats, Space
from rsmkit.surfaces.estimation.fit_data import FitData, cells
from rsmkit.surfaces.estimation.least_squares import two_sided_p
from rsmkit.surfaces.models.polynomial import PolynomialSurface
from rsmkit.surfaces.models.surface import check_confidence
from rsmkit.surfaces.reading import number
from rsmkit.surfaces.statistics.terms.studentized_range import range_tail

__all__ = ["Means", "contrast_of_means", "estimated_means", "parse_contrast"]

MOST_MEANS = 100
"""Means of which all pairs are compared."""
MOST_GRID = 20_000
"""Points of the grid over which a mean is an average."""


@dataclass(frozen=True, eq=False)
class Means(Shown):
    """Means of the levels of one factor, or of the combinations of levels of several.

    Parameters
    ----------
    factors : tuple of str
    levels : tuple of str
        Texts of the levels; of several factors joined by a comma.
    estimates, std_errors : array, shape (m,)
    rows : array, shape (m, p)
        The means as functions of the coefficients, in working coordinates.
    surface : PolynomialSurface
    families : tuple of int
        Means of the same number are compared with each other.
    """

    factors: tuple[str, ...]
    levels: tuple[str, ...]
    estimates: Floats
    std_errors: Floats
    rows: Floats
    surface: PolynomialSurface
    families: tuple[int, ...]

    def report(self, confidence: float = 0.95) -> dict[str, Any]:
        """Means with limits and all pairwise differences with Tukey's p, as JSON values."""
        degrees = [self.surface.judged(row)[2] for row in self.rows]
        half = np.array([_quantile(df, confidence) for df in degrees]) * self.std_errors
        columns = (self.estimates, self.std_errors, self.estimates - half, self.estimates + half)
        keys = ("mean", "std_error", "low", "high")
        return {
            "confidence": confidence,
            "levels": [
                {"level": level, **{k: number(v) for k, v in zip(keys, values, strict=True)}}
                for level, *values in zip(self.levels, *columns, strict=True)
            ],
            "differences": self._differences(),
        }

    def _differences(self) -> list[dict[str, Any]]:
        found = []
        for i, j in combinations(range(len(self.levels)), 2):
            count = self.families.count(self.families[i])
            if self.families[i] != self.families[j]:
                continue
            value, error, t, df = _estimate(self.surface, self.rows[i] - self.rows[j])
            p = range_tail(math.sqrt(2.0) * abs(t), count, df) if math.isfinite(t) and df > 0 else math.nan
            row = {"difference": value, "std_error": error, "t": t, "p": p}
            pair = f"{self.levels[i]} - {self.levels[j]}"
            found.append({"pair": pair, **{key: number(x) for key, x in row.items()}})
        return found


@checked
def estimated_means(surface: PolynomialSurface, factor: str) -> Means:
    """Means of the response at every level of a factor, averaged over the others as ``emmeans`` does.

    Parameters
    ----------
    surface : PolynomialSurface
        Polynomial, not stretched.
    factor : str
        Name of a factor; of several, joined by ``*``, for the means of every combination of their levels;
        ``tool|shift`` for these means with differences of tools within each shift alone. The levels of a
        number are its values in the runs.

    Returns
    -------
    Means
        ``.report()`` has limits and differences.

    Raises
    ------
    RsmkitError
        For a factor that is none, or with too many values.
    """
    space, data = surface.space, surface.data
    compared, bar, within = (factor, "", "") if factor in space.names else factor.partition("|")
    wanted = (*_factors(space, compared), *(_factors(space, within) if bar else ()))
    if len(set(wanted)) < len(wanted):
        raise RsmkitError(f"means of {factor}: a factor is named twice")
    components = {space.names[j] for j in surface.terms.components}
    if components & {*wanted}:
        raise RsmkitError(
            f"means of {factor}: a component of a mixture has no mean of its own, since the others give way; "
            "the report has the effects of components, and predictions of single blends"
        )
    values = [_levels(space, data, name) for name in wanted]
    if math.prod(map(len, values)) > MOST_MEANS:
        raise RsmkitError(
            f"means of {factor}: there are {math.prod(map(len, values))} of them, too many to compare; name "
            "categories, or numbers with few values"
        )
    others = [f.name for f in space if f.name not in wanted]
    grid = [
        [float(np.mean(data.points[:, space.names.index(name)]))]  # of a mixture the average blend
        if name in components
        else _grid(space, data, name)
        for name in others
    ]
    if math.prod(map(len, grid)) > MOST_GRID:
        raise RsmkitError(f"means of {factor}: the grid of the other factors is too large to average over")
    order = [space.names.index(name) for name in (*wanted, *others)]
    rows = []
    for level in product(*values):
        points = np.array([(*level, *rest) for rest in product(*grid)], float)[:, np.argsort(order)]
        rows.append(surface.rows(points).mean(axis=0))
    found = [_estimate(surface, row)[:3] for row in rows]
    texts = (
        ", ".join(_text(space, name, x) for name, x in zip(wanted, level, strict=True))
        for level in product(*values)
    )
    estimates, errors = (np.array([row[i] for row in found]) for i in (0, 1))
    inner = math.prod(map(len, values[len(_factors(space, compared)) :]))
    families = tuple(i % inner for i in range(len(rows)))
    return Means(wanted, tuple(texts), estimates, errors, np.array(rows), surface, families)


@checked
def contrast_of_means(means: Means, weights: Mapping[str, float], confidence: float = 0.95) -> dict[str, Any]:
    """Estimate a contrast: a weighted sum of means whose weights add to zero.

    Parameters
    ----------
    means : Means
    weights : mapping of str to float
        By level; levels that are not named weigh nothing.
    confidence : float

    Returns
    -------
    dict
        ``weights``, ``estimate``, ``std_error``, ``t``, ``p`` (of this contrast alone), ``low``, ``high``,
        ``ss`` (its sum of squares).

    Raises
    ------
    RsmkitError
        For a level that is none, or weights that do not add to zero.
    """
    what = "*".join(means.factors)
    weight = np.zeros(len(means.levels))
    for level, value in weights.items():
        weight[_place(means, level, f"contrast of {what}: level")] = value
    size = float(np.abs(weight).sum())
    if not 0.0 < size < math.inf or abs(weight.sum()) > 1e-9 * size:
        raise RsmkitError(
            f"contrast of {what}: weights should add to zero and not all be zero; these add to "
            f"{weight.sum():g}"
        )
    value, error, t, df = _estimate(means.surface, weight @ means.rows)
    half = _quantile(df, confidence) * error
    row = {
        "estimate": value,
        "std_error": error,
        "t": t,
        "p": float(two_sided_p(np.array([t]), df)[0]),
        "low": value - half,
        "high": value + half,
        "ss": t**2 * means.surface.fit.sigma**2,
    }
    return {
        "factor": what,
        "weights": dict(weights),
        "confidence": confidence,
        **{key: number(x) for key, x in row.items()},
    }


def parse_contrast(text: str) -> tuple[str, dict[str, float]]:
    """Read ``Age: young=1, middle=-0.5, old=-0.5``: the factor and the weight of each level.

    Raises
    ------
    RsmkitError
        With the part that does not read so.
    """
    factor, colon, rest = text.partition(":")
    weights: dict[str, float] = {}
    for part in filter(None, (p.strip() for p in split_line(rest.strip()))):
        level, _, value = part.rpartition("=")
        try:
            weights[level.strip()] = float(value)
        except ValueError:
            colon = ""
    if not colon or not weights or "" in weights or not factor.strip():
        raise RsmkitError(
            f"contrast '{text}': write it as factor: level=weight, ..., e.g. tool: A=1, B=-0.5, C=-0.5"
        )
    return factor.strip(), weights


def _place(means: Means, level: str, what: str) -> int:
    """Index of a level by its text; a number may be written in another way."""
    if level not in means.levels:
        numbers = {_number(text): i for i, text in enumerate(means.levels)}
        if (x := _number(level)) is not None and x in numbers:
            return numbers[x]
    return means.levels.index(one_of(what, level, means.levels))


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None


def _factors(space: Space, words: str) -> tuple[str, ...]:
    """Names of the factors; a name may hold a star itself."""
    if words.strip() in space.names:
        return (words.strip(),)
    return tuple(one_of("factor of means", word.strip(), space.names) for word in words.split("*"))


def _levels(space: Space, data: FitData, name: str) -> list[float]:
    """Coordinates of the levels: every category, or the values of a number in the runs."""
    if not space[name].domain.is_numeric:
        return list(map(float, range(len(space[name].levels))))
    column = data.points[:, [space.names.index(name)]]
    values = dict(zip(cells(column).tolist(), column[:, 0].tolist(), strict=True))
    return sorted(values.values())


def _grid(space: Space, data: FitData, name: str) -> list[float]:
    """Coordinates of another factor to average over."""
    found = _levels(space, data, name)
    if not space[name].domain.is_numeric or len(found) <= 2:
        return found
    return [float(data.points[:, space.names.index(name)].mean())]


def _text(space: Space, name: str, x: float) -> str:
    value = space[name].value(x)
    return f"{value:.10g}" if isinstance(value, float) else str(value)


def _estimate(surface: PolynomialSurface, row: Floats) -> tuple[float, float, float, float]:
    """Value, standard error, t and degrees of freedom of a linear function of the coefficients."""
    value, error, df = surface.judged(row)
    return value, error, value / error if error > 0 and not surface.fit.exact else math.nan, df


def _quantile(df: float, confidence: float) -> float:
    check_confidence(confidence)
    return float(stdtrit(df, 0.5 + 0.5 * confidence)) if df > 0 else math.nan
