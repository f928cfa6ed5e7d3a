"""The verdict of a study in words: the first thing the explorer page shows.

Of each search it says the verdict in one sentence, the best known design with its true values, and the one
next thing to do; everything else is folded away.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from html import escape

from rsmkit.language.expression import parse_expression
from rsmkit.language.space import Value
from rsmkit.optimum.optimum import Optimum
from rsmkit.report.explorer.page_document import stride
from rsmkit.report.findings import Findings
from rsmkit.surfaces.kinds import form_of
from rsmkit.verification.next_steps import NOTHING, next_step
from rsmkit.verification.refinement.refinement import RefinementRecord
from rsmkit.verification.verification import BestKnown, Comparison, Confirmation, Verification

__all__ = ["capital", "quality_words", "verdict_html"]

ROUNDING_PCT = 1e-3
"""Smaller errors are none."""
_TONES = {
    "CONFIRMED": "good",
    "IMPROVED, MODEL POOR": "fair",
    "NOT CONFIRMED": "poor",
    "SETTLED": "good",
    "NOT SETTLED": "fair",
    "INFEASIBLE": "poor",
    "FAILED": "poor",
}


def verdict_html(findings: Findings) -> str:
    """Say what was found, whether the simulator agrees, what it cost and how good the surfaces are.

    Every text of the user is escaped.
    """
    verification = findings.verification
    confirmations = {c.name: c for c in verification.searches} if verification else {}
    cards = [_card(optimum, confirmations.get(optimum.name), findings) for optimum in findings.optima]
    rest = "\n".join([_cost(findings), _quality(findings)])
    folded = (
        f"<details><summary>What it cost, and how good the surfaces are</summary>{rest}</details>"
        if cards
        else rest
    )
    many = " many" if len(cards) > 1 else ""
    told = "\n".join([f'<div class="cards{many}">{"".join(cards)}</div>', folded, *_not_drawn(findings)])
    return re.sub(r"(?<=\d)e(?:\+|(-))0*(?=\d)", r"e\1", told).replace(
        " +- ", " ± "
    )  # as the views write numbers


def quality_words(
    r2_predicted: float | None,
    response: str = "",
    verification: Verification | None = None,
    tolerance_pct: float = 2.0,
) -> str:
    """Judge a surface by the share of variation it predicts in runs left out.

    With a verification, also by what it says, with its tolerance, against the surface of the `response`.
    """
    yet = _yet(verification, response, tolerance_pct) if verification else ""
    if r2_predicted is None:
        return f"cannot be judged: nothing tells how well it predicts runs left out{yet}"
    for least, words in ((0.99, "excellent"), (0.95, "very good"), (0.8, "good"), (0.5, "rough")):
        if r2_predicted >= least:
            return f"{words}{yet}"
    return f"poor: do not trust its optimum{yet}"


def _card(optimum: Optimum, confirmation: Confirmation | None, findings: Findings) -> str:
    refined = findings.refinements.get(optimum.name)
    refined = refined if refined and refined.verdict else None
    verdict, sentence = _judged(optimum, confirmation)
    before = ""
    if refined:  # what a refinement says replaces what was said of the surfaces' optimum
        before = f"<p>Before: {escape(verdict)}. {escape(capital(sentence))}.</p>"
        verdict, sentence = refined.verdict, refined.sentence
    wished = "desirability" in optimum.settings
    limits = f", subject to {' and '.join(optimum.subject_to)}" if optimum.subject_to else ""
    which = " (knee of the Pareto front)" if optimum.front else ""
    of = " of the surfaces" if refined or confirmation else ""
    what = f"Point of least violation{of}" if optimum.missed else f"Optimum{which}{of}"
    folded = (
        f"<p>{escape(capital(optimum.aim))}{escape(limits)}.</p>"
        f"<p>{what}: {_place(findings, optimum.factors)}.</p>{before}"
        f"{_comparisons(confirmation, findings, wished) if confirmation else ''}"
    )
    return (
        f'<article class="card {_TONES.get(verdict, "open")}">'
        f'<h2>{escape(optimum.name)} <span class="tag">{escape(verdict)}</span></h2>'
        f'<p class="lead">{escape(capital(sentence))}.</p>'
        f"<p>{_best_known(optimum, confirmation, refined, findings)}</p>"
        f"<p><b>Next:</b> {escape(_next(confirmation, refined, findings))}.</p>"
        f"<details><summary>Aim, optimum and comparison</summary>{folded}</details></article>"
    )


def _judged(optimum: Optimum, confirmation: Confirmation | None) -> tuple[str, str]:
    """Give the verdict on the optimum of the surfaces, and its sentence."""
    if confirmation:
        return confirmation.verdict, confirmation.sentence
    obstacles = f"{optimum.obstacles}; " if optimum.obstacles else ""
    return "NOT VERIFIED YET", (
        f"{obstacles}the surfaces predict {_objectives(optimum)}; a run there has yet to confirm it"
    )


def _best_known(
    optimum: Optimum,
    confirmation: Confirmation | None,
    refined: RefinementRecord | None,
    findings: Findings,
) -> str:
    """Name the best design of which the simulator has been asked, with its true values."""
    if refined:
        which = (
            "nearest to allowed"
            if not refined.feasible
            else "knee of the true front"
            if refined.front
            else ""
        )
        return _design("Best known design", which, refined.factors, refined.responses, findings)
    if confirmation is None:
        return _design(
            "Optimum of the surfaces", "predicted", optimum.factors, optimum.best.responses, findings
        )
    true = {name: c.actual for name, c in confirmation.responses.items() if c.actual is not None}
    known = confirmation.best_known
    if known is None or known.source == "verified optimum":
        which = (
            "knee of the front" if optimum.front else "misses a constraint" if known and known.missed else ""
        )
        return _design("Best known design", which, confirmation.factors, true, findings)
    ran = next((run for run in findings.runs.runs if run and run.factors == known.factors), None)
    keeps = (
        ", the best that keeps every limit: the optimum misses one" if _misses(confirmation, known) else ""
    )
    which = "a run of the design" + (", misses a constraint" if known.missed else keeps)
    return _design("Best known design", which, known.factors, ran.responses if ran else {}, findings)


def _misses(confirmation: Confirmation, known: BestKnown) -> bool:
    """Whether a limit, and not a better value, is why another run is known to be best."""
    actual = confirmation.objective.actual
    is_worse = known.desirability is not None or actual is None or known.objective > actual
    return is_worse and any(c.actual is not None and c.actual < 0 for c in confirmation.constraints)


def _design(
    what: str, which: str, factors: Mapping[str, Value], responses: Mapping[str, float], findings: Findings
) -> str:
    said = f" ({which})" if which else ""
    shown = [name for name in findings.surfaces if name in responses]
    values = ", ".join(f"{escape(findings.title(name))} <b>{responses[name]:.5g}</b>" for name in shown)
    return f"<b>{what}</b>{said}: {_place(findings, factors)}{f': {values}' if values else ''}."


def _place(findings: Findings, factors: Mapping[str, Value]) -> str:
    values = {name: f" <b>{escape(_text(value))}</b>" for name, value in factors.items()}
    told = (f"{escape(f.label or f.name)}{values[f.name]}{_unit(f.unit)}" for f in findings.space)
    return ", ".join(told)


def _next(confirmation: Confirmation | None, refined: RefinementRecord | None, findings: Findings) -> str:
    step = next_step(confirmation, refined.verdict if refined else "", by_hand=findings.by_hand)
    return step or (f"{NOTHING}; use the best known design" if refined else NOTHING)


def capital(sentence: str) -> str:
    """Begin a sentence with a capital letter."""
    return sentence[:1].upper() + sentence[1:]


def _comparisons(confirmation: Confirmation, findings: Findings, wished: bool) -> str:
    """Predicted against actual, folded away."""

    def row(name: str, c: Comparison) -> str:
        actual = "failed" if c.actual is None else f"{c.actual:.5g}"
        interval = "–" if c.low is None or c.high is None else f"{c.low:.5g} … {c.high:.5g}"
        error = "–" if c.error_pct is None else f"{c.error_pct:.2f} %"
        cells = (f"{c.predicted:.5g}", interval, actual, error)
        head = f'<th scope="row">{escape(findings.title(name))}</th>'
        return f"<tr>{head}{''.join(f'<td>{cell}</td>' for cell in cells)}</tr>"

    shown = {**({} if wished else confirmation.objectives), **confirmation.responses}
    rows = "".join(row(*item) for item in shown.items())
    true = "measured" if findings.by_hand else "simulator"
    head = "".join(f'<th scope="col">{text}</th>' for text in ("predicted", "interval", true, "error"))
    table = f"<table><thead><tr><td></td>{head}</tr></thead><tbody>{rows}</tbody></table>"
    return (
        f'<div class="scroller" tabindex="0" role="group" aria-label="Predicted against actual">{table}</div>'
    )


def _objectives(optimum: Optimum) -> str:
    if optimum.overall_desirability is not None:
        each = ", ".join(f"{name} {value:.3f}" for name, value in optimum.desirabilities.items())
        return f"an overall desirability of {optimum.overall_desirability:.3f} of 1 ({each})"
    pairs = zip(optimum.minimize, optimum.best.objectives, strict=True)
    return " and ".join(f"{text} = {value:.4g}" for text, value in pairs)


def _cost(findings: Findings) -> str:
    what = "Runs" if findings.by_hand else "Simulator runs"
    drawn = f" One run in {stride(findings)} is drawn below." if stride(findings) > 1 else ""
    return f"<p>{what}: {findings.cost.words}.{drawn}</p>"


def _quality(findings: Findings) -> str:
    items = []
    for name, surface in findings.surfaces.items():
        report = surface.report()
        r2, ahead = report.get("r2"), report.get("r2_predicted")
        shares = [] if r2 is None else [f"R² {r2:.4f}"]
        shares += [] if ahead is None else [f"predicting left-out runs {ahead:.4f}"]
        told = f" ({', '.join(shares)})" if shares else ""
        words = quality_words(ahead, name, findings.verification, findings.tolerance_pct)
        items.append(f"<li>{escape(findings.title(name))}: {words}{told}</li>")
    return f"<p>How good are the surfaces?</p><ul>{''.join(items)}</ul>"


def _yet(verification: Verification, response: str, tolerance_pct: float) -> str:
    """What verified points that are not confirmed say against a surface that is good over the runs."""
    points = [point for search in verification.searches for point in search.points]
    found = []
    for point in points:
        if point.verdict != "CONFIRMED":
            found += [c for name, c in point.responses.items() if name == response]
            found += [c for text, c in point.objectives.items() if response in parse_expression(text).names]
    found = [comparison for comparison in found if comparison.is_off(tolerance_pct)]
    if not found:
        return ""
    worst = max(comparison.scaled_error_pct or 0.0 for comparison in found)
    return f" over the runs, but not at the optimum ({worst:.3g} % off there)"


def _not_drawn(findings: Findings) -> list[str]:
    """Say which surfaces the page cannot evaluate by itself."""
    names = [
        f"{escape(findings.title(name))} ({escape(surface.form)})"
        for name, surface in findings.surfaces.items()
        if form_of(surface).page is None
    ]
    told = []
    if names:
        told.append(
            f"<p>This kind of surface cannot be drawn live here: {', '.join(names)}. Its profiles, contours "
            "and current values stay empty; optima, verdicts and statistics hold.</p>"
        )
    return told


def _text(value: float | int | str) -> str:
    return value if isinstance(value, str) else f"{value:.5g}"


def _unit(unit: str) -> str:
    return f" {escape(unit)}" if unit else ""
