"""The analysis of variance as it is printed: the whole regression, its groups, the residual, the total."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rsmkit.surfaces.models.polynomial import PolynomialSurface
from rsmkit.surfaces.reading import number
from rsmkit.surfaces.statistics.terms.anova import overall_test

__all__ = ["anova_table"]


def anova_table(surface: PolynomialSurface, rows: Mapping[str, Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Rows of an analysis of variance by groups between those of the whole regression and of the total.

    Parameters
    ----------
    surface : PolynomialSurface
    rows : mapping of str to mapping
        By source: ``df``, ``ss``, ``ms``, ``F``, ``p``.

    Returns
    -------
    list of dict
        The same keys and ``source``. The total is about the mean where the model holds a constant.
    """
    fit, whole = surface.fit, overall_test(surface)
    numbers = {"ss": whole.ss, "ms": whole.ms, "F": whole.f, "p": whole.p}
    regression = {"df": whole.df, **{key: number(value) for key, value in numbers.items()}}
    total = {"df": fit.n - fit.has_constant, "ss": number(fit.tss), "ms": None, "F": None, "p": None}
    listed = [("model", regression), *rows.items(), ("total", total)]
    return [{"source": source, **row} for source, row in listed]
