"""What a table of finished experiments is asked beyond the report of every surface."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from rsmkit.errors import RsmkitError
from rsmkit.surfaces.estimation.fit_data import cells
from rsmkit.surfaces.models.polynomial import PolynomialSurface
from rsmkit.surfaces.statistics.anova import lack_of_fit
from rsmkit.surfaces.statistics.means import contrast_of_means, estimated_means, parse_contrast
from rsmkit.surfaces.statistics.texts import columns_of, short

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
    near_replicates : float, optional
        Share of the range of each number within which runs count as repeated, for one more lack-of-fit test.
    """

    means: tuple[str, ...] = ()
    compare: tuple[str, ...] = ()
    near_replicates: float | None = None

    def __post_init__(self) -> None:
        within = self.near_replicates
        if within is not None and not 0.0 < within < 0.5:
            raise RsmkitError(f"near replicates: give a share of the range between 0 and 0.5, not {within:g}")


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
    if asked.near_replicates is not None:
        found["near_replicates"] = _near_replicates(surface, asked.near_replicates)
    return found


def _near_replicates(surface: PolynomialSurface, within: float) -> dict[str, Any]:
    split = lack_of_fit(surface, within)
    groups = int(cells(surface.data.points, within).max()) + 1
    if split.lack is None or split.pure is None or split.absent:
        return {"within": within, "groups": groups, "reason": split.absent}
    return {
        "within": within,
        "groups": groups,
        "F": split.lack.f,
        "p": split.lack.p,
        "df": [split.lack.df, split.pure.df],
    }


def answer_words(found: dict[str, Any]) -> list[str]:
    """The answers as lines of text."""
    lines: list[str] = []
    for name, means in found.get("means", {}).items():
        lines += ["", *_means_words(name, means)]
    if compared := found.get("contrasts_of_means"):
        rows = [{**row, "name": _contrast_name(row)} for row in compared]
        keys = {"contrast": "name", "estimate": "estimate", "std. error": "std_error", "t": "t", "p": "p"}
        lines += ["", *columns_of(rows, keys)]
    if near := found.get("near_replicates"):
        lines += ["", _near_words(near)]
    return lines


def _near_words(near: dict[str, Any]) -> str:
    head = f"Lack of fit, runs within {100 * near['within']:g} % of the ranges as repeated"
    if "reason" in near:
        return f"{head}: not tested, {near['reason']}."
    return (
        f"{head} ({near['groups']} groups): F {short(near['F'])} on {near['df'][0]} and {near['df'][1]} "
        f"degrees of freedom, p {short(near['p'])}"
    )


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
