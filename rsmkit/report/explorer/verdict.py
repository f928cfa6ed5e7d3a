"""The verdict of a study in words: the first thing the explorer page shows."""

from __future__ import annotations

from html import escape

from rsmkit.optimum.optimum import Optimum
from rsmkit.report.explorer.page_document import stride
from rsmkit.report.findings import Findings
from rsmkit.surfaces.kinds import form_of
from rsmkit.verification.verification import Comparison, Confirmation

__all__ = ["quality_words", "verdict_html"]

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
    return "\n".join([*cards, _cost(findings), _quality(findings), *_not_drawn(findings)])


def quality_words(r2_predicted: float | None) -> str:
    """Judge a surface by the share of variation it predicts in runs left out."""
    if r2_predicted is None:
        return "cannot be judged: nothing tells how well it predicts runs left out"
    for least, words in ((0.99, "excellent"), (0.95, "very good"), (0.8, "good"), (0.5, "rough")):
        if r2_predicted >= least:
            return words
    return "poor: do not trust its optimum"


def _card(optimum: Optimum, confirmation: Confirmation | None, findings: Findings) -> str:
    verdict: str = confirmation.verdict if confirmation else "NOT VERIFIED YET"
    sentence = (
        confirmation.sentence
        if confirmation
        else (f"{optimum.obstacles}; " if optimum.obstacles else "")
        + f"the surfaces predict {_objectives(optimum)}; a run there has yet to confirm it"
    )
    refined = findings.refinements.get(optimum.name)
    before = ""
    if refined and refined.verdict:  # what a refinement says replaces what was said of the surfaces' optimum
        before = (
            f'<p class="fine">Before: {escape(verdict)}. {escape(sentence[:1].upper() + sentence[1:])}.</p>'
        )
        verdict, sentence = refined.verdict, refined.sentence
    goal, wished = optimum.aim, "desirability" in optimum.settings
    limits = f", subject to {' and '.join(optimum.subject_to)}" if optimum.subject_to else ""
    where = ", ".join(
        f"<b>{escape(factor.label or factor.name)}</b> {escape(_text(value))}{_unit(factor.unit)}"
        for factor, value in zip(optimum.space, optimum.factors.values(), strict=True)
    )
    which = " (knee of the Pareto front)" if optimum.front else ""
    of = " of the surfaces" if before else ""
    what = f"Point of least violation{of}" if optimum.missed else f"Optimum{which}{of}"
    known = ""
    if confirmation and confirmation.best_known and not before:
        told = confirmation.best_known.sentence
        known = f"<p>{escape(told[:1].upper() + told[1:])}.</p>"
    if confirmation and confirmation.next_step and not before:
        known += f"<p>Next: {escape(confirmation.next_step)}.</p>"
    return (
        f'<article class="card {_TONES.get(verdict, "open")}">'
        f'<h2>{escape(optimum.name)} <span class="tag">{escape(verdict)}</span></h2>'
        f"<p>{escape(sentence[:1].upper() + sentence[1:])}.</p>"
        f"<p>{what}: {where}.</p>{known}{before}"
        f'<p class="fine">{escape(goal[:1].upper() + goal[1:])}{escape(limits)}.</p>'
        f"{_comparisons(confirmation, findings, wished) if confirmation else ''}</article>"
    )


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
    head = "".join(
        f'<th scope="col">{text}</th>' for text in ("", "predicted", "interval", "simulator", "error")
    )
    table = f"<table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>"
    return (
        '<details><summary>Predicted against actual</summary><div class="scroller" tabindex="0" role="group" '
        f'aria-label="Predicted against actual">{table}</div></details>'
    )


def _objectives(optimum: Optimum) -> str:
    if optimum.overall_desirability is not None:
        each = ", ".join(f"{name} {value:.3f}" for name, value in optimum.desirabilities.items())
        return f"an overall desirability of {optimum.overall_desirability:.3f} of 1 ({each})"
    pairs = zip(optimum.minimize, optimum.best.objectives, strict=True)
    return " and ".join(f"{text} = {value:.4g}" for text, value in pairs)


def _cost(findings: Findings) -> str:
    spent = findings.verification.simulator_runs if findings.verification else None
    checks = f" and {spent.verification} to verify" if spent else ""
    failed = findings.failed
    lost = f"; {failed} more {'runs' if failed > 1 else 'run'} failed" if failed else ""
    drawn = f" One run in {stride(findings)} is drawn below." if stride(findings) > 1 else ""
    return f"<p>Simulator runs: {len(findings.runs)} for the surfaces{checks}{lost}.{drawn}</p>"


def _quality(findings: Findings) -> str:
    items = []
    for name, surface in findings.surfaces.items():
        report = surface.report()
        r2, ahead = report.get("r2"), report.get("r2_predicted")
        shares = [] if r2 is None else [f"R² {r2:.4f}"]
        shares += [] if ahead is None else [f"predicting left-out runs {ahead:.4f}"]
        told = f" ({', '.join(shares)})" if shares else ""
        words = quality_words(ahead) + _yet(findings, name)
        items.append(f"<li>{escape(findings.title(name))}: {words}{told}</li>")
    return f"<p>How good are the surfaces?</p><ul>{''.join(items)}</ul>"


def _yet(findings: Findings, response: str) -> str:
    """What a verified point says against a surface that is good over the runs."""
    searches = findings.verification.searches if findings.verification else ()
    points = [point for search in searches for point in search.points]
    found = [point.responses[response] for point in points if response in point.responses]
    found += [c for point in points for text, c in point.objectives.items() if response in text]
    off = [c for c in found if c.inside is False and (c.scaled_error_pct or 0.0) > ROUNDING_PCT]
    poor = any(point.verdict == "IMPROVED, MODEL POOR" for point in points)
    if not (off and poor):
        return ""
    worst = max(c.scaled_error_pct or 0.0 for c in off)
    return f" over the runs, but not at the optimum ({worst:.3g} % off there)"


def _not_drawn(findings: Findings) -> list[str]:
    """Say which surfaces the page cannot evaluate by itself."""
    names = [
        f"{escape(findings.title(name))} ({escape(surface.form)})"
        for name, surface in findings.surfaces.items()
        if form_of(surface).page is None
    ]
    if not names:
        return []
    return [
        f"<p>This kind of surface cannot be drawn live here: {', '.join(names)}. Its profiles, contours and "
        "current values stay empty; optima, verdicts and statistics hold.</p>"
    ]


def _text(value: float | int | str) -> str:
    return value if isinstance(value, str) else f"{value:.5g}"


def _unit(unit: str) -> str:
    return f" {escape(unit)}" if unit else ""
