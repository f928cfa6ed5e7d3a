"""What a table of finished experiments is asked beyond the report of every surface."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from rsmkit.surfaces.models.polynomial import PolynomialSurface
from rsmkit.surfaces.statistics.means import contrast_of_means, estimated_means, parse_contrast
from rsmkit.surfaces.statistics.texts import columns_of

__all__ = ["Questions", "answer_words", "answers"]


@dataclass(frozen=True)
class Questions:
    """What to add to the report of each response.

    Parameters
    ----------
    means : tuple of str
        Factors whose levels' means are compared, several joined by ``*`` for their combinations.
    compare : tuple of str
        Contrasts of means: ``tool: A=1, B=-0.5, C=-0.5``.
    """

    means: tuple[str, ...] = ()
    compare: tuple[str, ...] = ()


def answers(surface: PolynomialSurface, asked: Questions) -> dict[str, Any]:
    """Answer as JSON values; nothing for what was not asked.

    Raises
    ------
    RsmkitError
        For a question that makes no sense for this surface.
    """
    found: dict[str, Any] = {}
    if asked.means:
        found["means"] = {name: estimated_means(surface, name).report() for name in asked.means}
    if asked.compare:
        wanted = [parse_contrast(text) for text in asked.compare]
        found["contrasts_of_means"] = [
            contrast_of_means(estimated_means(surface, name), weights) for name, weights in wanted
        ]
    return found


def answer_words(found: dict[str, Any]) -> list[str]:
    """The answers as lines of text."""
    lines: list[str] = []
    for name, means in found.get("means", {}).items():
        lines += ["", *_means_words(name, means)]
    if compared := found.get("contrasts_of_means"):
        rows = [{**row, "name": _contrast_name(row)} for row in compared]
        keys = {"contrast": "name", "estimate": "estimate", "std. error": "std_error", "t": "t", "p": "p"}
        lines += ["", *columns_of(rows, keys)]
    return lines


def _means_words(name: str, means: dict[str, Any]) -> list[str]:
    level = {f"mean by {name}": "level", "mean": "mean", "std. error": "std_error"}
    pair = {
        "difference": "pair",
        "estimate": "difference",
        "std. error": "std_error",
        "t": "t",
        "p (Tukey)": "p",
    }
    limits = f"{100 * means['confidence']:g} % "
    lines = columns_of(means["levels"], {**level, f"{limits}low": "low", f"{limits}high": "high"})
    return [*lines, "", *columns_of(means["differences"], pair)] if means["differences"] else lines


def _contrast_name(row: dict[str, Any]) -> str:
    parts = (f"{weight:+g} {level}" for level, weight in row["weights"].items())
    return f"{row['factor']}: {' '.join(parts)}"
