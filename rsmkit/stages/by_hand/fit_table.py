"""``rsmkit fit --data``: surfaces from finished experiments, without a study or a simulator."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rsmkit.errors import RsmkitError
from rsmkit.language.terms import EXACT
from rsmkit.surfaces.tables.coding import parse_coding
from rsmkit.surfaces.tables.table_fit import TableFit, fit_table

__all__ = ["fit_data"]


def fit_data(
    data: Path,
    *,
    factors: tuple[str, ...],
    response: tuple[str, ...],
    coding: str,
    blocks: str | None,
    weights: str | None,
    order: int,
    terms: tuple[str, ...],
    exact_terms: bool = False,
    exclude: tuple[int, ...] | None,
    **asked: Any,
) -> TableFit:
    """Fit the surfaces of a table; the options are those of the command line.

    Raises
    ------
    RsmkitError
        If columns are not named, or the file is not as it should be.
    """
    if exact_terms and not terms:
        raise RsmkitError("--exact-terms needs --terms: the terms of the model")
    if not (factors or asked.get("mixture")) or not response:
        raise RsmkitError("--data needs --factors and --response: the columns of the table to use")
    return fit_table(
        data,
        factors,
        response,
        coding=parse_coding(coding) if coding else None,
        blocks=blocks,
        weights=weights,
        order=order,
        terms=(EXACT, *terms) if exact_terms else terms,
        exclude=exclude or (),
        **asked,
    )
