"""What a table of finished experiments is asked beyond the report of every surface."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from rsmkit.errors import RsmkitError
from rsmkit.surfaces.estimation.fit_data import cells
from rsmkit.surfaces.estimation.robust_regression import RobustMethod
from rsmkit.surfaces.models.polynomial import PolynomialSurface
from rsmkit.surfaces.statistics.influence import influence_report, influence_words
from rsmkit.surfaces.statistics.robust_estimates import robust_report, robust_words
from rsmkit.surfaces.statistics.terms.anova import lack_of_fit
from rsmkit.surfaces.statistics.terms.means import contrast_of_means, estimated_means, parse_contrast
from rsmkit.surfaces.statistics.terms.nested_tests import extra_report
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
    robust : {"huber", "mm"}, optional
        Robust estimates beside those of least squares.
    together : tuple of str
        Terms, or groups of them, that are tested all at once.
    """

    means: tuple[str, ...] = ()
    compare: tuple[str, ...] = ()
    near_replicates: float | None = None
    robust: RobustMethod | None = None
    together: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        within = self.near_replicates
        if within is not None and not 0.0 < within < 0.5:
            raise RsmkitError(f"near replicates: give a share of the range between 0 and 0.5, not {within:g}")


def answers(
    surface: PolynomialSurface, asked: Questions = Questions(), rows: list[int] | None = None
) -> dict[str, Any]:
    """Answer as JSON values: outliers and influence always, nothing else that was not asked.

    Parameters
    ----------
    surface : PolynomialSurface
    asked : Questions
    rows : list of int, optional
        Number of each run in its table; from 1 by default.

    Raises
    ------
    RsmkitError
        For a question that makes no sense for this surface.
    """
    if surface.data.random and (asked.robust is not None or asked.near_replicates is not None):
        raise RsmkitError(
            f"{surface.response}: robust estimates and near replicates are for independent runs, not for "
            "runs in random groups"
        )
    if not surface.normal and (asked.robust or asked.together or asked.near_replicates is not None):
        raise RsmkitError(
            f"{surface.response}: robust estimates, near replicates and tests of terms together are for "
            "normal responses; a surface of counts has likelihood-ratio tests by term"
        )
    found: dict[str, Any] = {"influence": influence_report(surface, rows)} if surface.normal else {}
    if asked.means:
        found["means"] = {name: estimated_means(surface, name).report() for name in asked.means}
    if asked.compare:
        wanted = [parse_contrast(text) for text in asked.compare]
        found["contrasts_of_means"] = [
            contrast_of_means(estimated_means(surface, name), weights) for name, weights in wanted
        ]
    if asked.together:
        found["together"] = extra_report(surface, asked.together)
    if asked.near_replicates is not None:
        found["near_replicates"] = _near_replicates(surface, asked.near_replicates)
    if asked.robust is not None:
        found["robust"] = robust_report(surface, asked.robust, rows)
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


def answer_words(
    surface: PolynomialSurface, found: dict[str, Any], rows: list[int] | None = None
) -> list[str]:
    """The answers as lines of text."""
    lines = influence_words(surface, found["influence"], rows) if "influence" in found else []
    if robust := found.get("robust"):
        lines += robust_words(surface, robust)
    for name, means in found.get("means", {}).items():
        lines += ["", *_means_words(name, means)]
    if compared := found.get("contrasts_of_means"):
        named = [{**row, "name": _contrast_name(row)} for row in compared]
        keys = {"contrast": "name", "estimate": "estimate", "std. error": "std_error", "t": "t", "p": "p"}
        lines += ["", *columns_of(named, keys)]
    if extra := found.get("together"):
        what = f"{', '.join(extra['terms'])} together: sum of squares {short(extra['ss'])}"
        degrees = f"{extra['df'][0]} and {extra['df'][1]} degrees of freedom"
        lines += ["", f"{what}, F {short(extra['F'])} on {degrees}, p {short(extra['p'])}"]
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
