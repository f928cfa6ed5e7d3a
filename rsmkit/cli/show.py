"""What people see: each stage's result as a few lines and a table, ending with what to type next."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any

from rich.markup import escape
from rich.table import Table

from rsmkit.cli.next_words import next_command as _next
from rsmkit.cli.next_words import next_stage
from rsmkit.cli.next_words import where_words as _where
from rsmkit.cli.progress_bar import duration
from rsmkit.cli.session import Session
from rsmkit.cli.show_sheets import confirmation_runs
from rsmkit.study.file import Study
from rsmkit.verification.next_steps import next_step

if TYPE_CHECKING:
    from rsmkit.design.design import Design
    from rsmkit.design.quality.assessment import Quality
    from rsmkit.design.quality.design_comparison import DesignComparison
    from rsmkit.language.space import Space
    from rsmkit.runs.agenda import Agenda
    from rsmkit.stages.compare import DirectComparison, FrontComparison
    from rsmkit.stages.evaluate import EvaluateResult
    from rsmkit.stages.fit import FitResult
    from rsmkit.stages.looks.check import CheckResult
    from rsmkit.stages.looks.status import Status
    from rsmkit.stages.planning.plan import PlanResult
    from rsmkit.stages.refine import RefineResult
    from rsmkit.stages.report import Reports
    from rsmkit.stages.verify import VerifyResult
    from rsmkit.surfaces.choose import Choice
    from rsmkit.verification import verification as verified
    from rsmkit.verification.judge import RefinedVerdict
    from rsmkit.verification.refinement.refinement import Wave

__all__ = [
    "against_ga",
    "agenda",
    "check",
    "comparison",
    "created",
    "evaluate",
    "explorer",
    "fit",
    "notes",
    "plan",
    "refine",
    "reports",
    "status",
    "verify",
    "wave",
]

MOST_TERMS = 30
ROUNDING_PCT = 1e-9
"""Smaller differences are those of the arithmetic."""


def created(session: Session, folder: Path, files: Sequence[Path]) -> None:
    """Show what ``new`` wrote."""
    session.people.print(f"Wrote {', '.join(path.name for path in files)} to {folder}", markup=False)
    _next(session, f"rsmkit check {folder}, then rsmkit run {folder}")


def check(session: Session, study: Study, result: CheckResult) -> None:
    """Show the run at the centre."""
    run = result.run
    runs = "its runs are made by hand" if run is None else "the simulator runs"
    session.people.print(f"[bold]{escape(study.name)}[/]: the study file is in order, and {runs}.")
    table = _table("at the centre of the space", "value")
    for group in ((run.factors, run.responses) if run else ()) + (result.functions,):
        for name, value in group.items():
            table.add_row(name, _value(value))
    if table.row_count:
        session.people.print(table)
    if run is not None and result.planned_runs is not None:
        total = duration(result.planned_runs * run.seconds)
        session.people.print(
            f"One run takes {duration(run.seconds)}: about {total} on one core for the "
            f"{result.planned_runs} planned."
        )
    words = {} if run is None else {"plan": f"rsmkit run{_where(study)}"}
    next_stage(session, study, "plan", words)


def plan(session: Session, study: Study, result: PlanResult, *, detail: bool = False) -> None:
    """Show the design's composition and quality; in detail also what it says about every term."""
    kinds = {kind: result.design.kinds.count(kind) for kind in dict.fromkeys(result.design.kinds)}
    session.people.print(
        f"[bold]Plan[/]  {len(result.design)} points "
        f"({', '.join(f'{count} {kind}' for kind, count in kinds.items())}){_fresh(result.fresh)}"
    )
    if result.stock and (result.stock.new or not result.fresh):
        for line in result.stock.sentences:
            session.people.print(f"  {line}", markup=False)
    quality = result.quality
    sums = [equality.text for equality in result.design.space.equalities]
    efficiencies = (  # where factors are tied there is no orthogonal design to compare with
        f"G {_percent(quality.g_efficiency)}"
        if sums
        else f"D {_percent(quality.d_efficiency)}, A {_percent(quality.a_efficiency)}, "
        f"G {_percent(quality.g_efficiency)}, I {_percent(quality.i_efficiency)}"
    )
    session.people.print(
        f"  {quality.p} terms, {quality.distinct} distinct points{' on ' * bool(sums)}{', '.join(sums)}; "
        f"efficiency {efficiencies}; condition number {_number(quality.condition_number)}; "
        f"largest VIF {_number(max(quality.vif.values(), default=None))}, "
        f"leverage {_number(max(quality.leverages, default=None))}"
    )
    searched = ""
    if quality.starts:
        searched = f"; best of {quality.starts} starts, found by {quality.hits}"
    fractions = quality.variance_fractions
    spread = f", at most {_number(fractions[5])} in half of the region" if len(fractions) > 5 else ""
    session.people.print(
        f"  D {_percent(quality.d_bound_efficiency)} of the bound for any design{searched}; "
        f"prediction variance {_number(quality.average_variance)} on average{spread}, "
        f"{_number(quality.largest_variance)} at most"
    )
    if quality.plots:
        _plots(session, result.design, quality)
    if detail:
        _terms(session, quality, result.design.space)
    for warning in quality.warnings:
        session.people.print(f"  [yellow]note:[/] {escape(warning)}")
    next_stage(session, study, "evaluate")


def _plots(session: Session, design: Design, quality: Quality) -> None:
    """Plots of the design, and what depends on the ratio of variances that nobody knows yet."""
    sizes = [design.blocks.count(block) for block in dict.fromkeys(design.blocks)]
    session.people.print(
        f"  {len(sizes)} plots of {', '.join(map(str, sizes))} runs; set hard factors anew in each"
    )
    head = (
        "variance of a plot / of a run",
        "D, whole-plot terms",
        "D, sub-plot terms",
        "prediction variance",
    )
    table = _table(*head)
    for at in quality.plots:
        efficiencies = (_percent(at.whole_plot_efficiency), _percent(at.sub_plot_efficiency))
        table.add_row(f"{at.ratio:g}", *efficiencies, _number(at.average_variance))
    session.people.print(table)
    degrees = ", ".join(
        f"{name} {_number(df)}" for name, df in list(quality.denominator_df.items())[:MOST_TERMS]
    )
    session.people.print(f"  degrees of freedom of each test: {escape(degrees)}")


def _terms(session: Session, quality: Quality, space: Space) -> None:
    """Standard error, variance inflation and power of every term, and the terms that are most alike."""
    wide = quality.region_standard_errors
    wide = {} if wide == quality.standard_errors else wide  # they differ where the region is not the bounds
    table = _table("term", "standard error", *(["over the region"] if wide else []), "VIF", "power")
    for name, error in list(quality.standard_errors.items())[:MOST_TERMS]:
        power = quality.power.get(name)
        table.add_row(
            escape(name),
            _number(error),
            *([_number(wide[name])] if wide else []),
            _number(quality.vif.get(name)),
            "-" if power is None else f"{power:.2f}",
        )
    session.people.print(table)
    more = len(quality.standard_errors) - MOST_TERMS
    note = f"{more} more terms in plan.json; " if more > 0 else ""
    session.people.print(
        f"  {note}standard errors are for a unit error of the runs; power when the response changes by two "
        f"of these {'over the region' if space.mixtures else 'from low to high'}"
    )
    for mixture in space.mixtures:
        least = space.decode([0.0] * len(space))[[space.names.index(c) for c in mixture.components]]
        if least.any():
            session.people.print(
                f"  {escape(', '.join(mixture.components))} are pseudo-components here: 0 at "
                f"{', '.join(map(_number, least))}, and they add up to 1"
            )
    several = [
        f"{escape(name)} {x:.2f}" for name, x in quality.power.items() if name not in quality.standard_errors
    ]
    if several:
        session.people.print(f"  power of the F tests of several categories: {', '.join(several)}")
    alike = [f"{escape(pair)}: {value:.2f}" for pair, value in quality.correlations.items()]
    if alike:
        session.people.print(f"  most correlated terms: {'; '.join(alike[:5])}")


def evaluate(session: Session, study: Study, result: EvaluateResult) -> None:
    """Show how many runs there are, how many failed, and what the new ones cost."""
    runs = result.evaluation
    session.people.print(f"[bold]Evaluate[/]  {runs.words}{_fresh(not result.made)}")
    if result.progress and result.made:
        session.people.print(
            f"  {result.made} new runs in {duration(result.progress.elapsed_seconds)}, "
            f"{result.progress.jobs} at a time, {duration(result.progress.median_seconds or 0.0)} each; "
            f"rsmkit itself used {100 * result.progress.own_fraction:.0f} % of the time"
        )
    for error in runs.errors[:5]:
        session.people.print(f"  failed: {error}", markup=False)
    if len(runs.errors) > 5:
        session.people.print(f"  and {len(runs.errors) - 5} more; all are in {result.path}", markup=False)
    if runs.missing:
        words = {"evaluate": f"rsmkit evaluate{_where(study)} for the other {runs.missing}"}
    elif runs.failed:
        retry = f"rsmkit evaluate{_where(study)} --retry-failed"
        words = {"fit": f"{retry}, or rsmkit fit{_where(study)} to go on with {runs.done} runs"}
    else:
        words = {}
    next_stage(session, study, "fit", words)


def agenda(session: Session, study: Study, planned: Agenda) -> None:
    """Show what an evaluation would run."""
    session.people.print(
        f"[bold]Evaluate[/]  {len(planned.rows)} planned, {planned.distinct} distinct, "
        f"{len(planned.recorded)} recorded, {len(planned.todo)} to make"
    )
    table = _table("run", *study.space.names)
    for task in planned.todo:
        table.add_row(task.key, *(_value(value) for value in task.factors.values()))
    if planned.todo:
        session.people.print(table)
    seconds = [run.seconds for run in planned.recorded.values() if run.done]
    if seconds and planned.todo:
        each = median(seconds)
        session.people.print(
            f"About {duration(each * len(planned.todo))} on one core ({duration(each)} per run)."
        )
    next_stage(session, study, "fit")


def fit(session: Session, study: Study, result: FitResult) -> None:
    """Show how good each surface is, and what the searches found."""
    failed = f", {result.failed} failed" if result.failed else ""
    session.people.print(f"[bold]Fit[/]  {len(result.runs)} runs{failed}{_fresh(result.fresh)}")
    table = _table("surface", "model", "coefficients", "R2", "R2 adj", "R2 pred", "PRESS", "sigma")
    choices = {**result.responses, **_titled(result)}
    for name, choice in choices.items():
        report = choice.surface.report()
        table.add_row(
            escape(name),
            escape(choice.model),
            str(len(report["terms"])) if "terms" in report else "-",
            *(_ratio(report.get(key)) for key in ("r2", "r2_adjusted", "r2_predicted")),
            *(_number(report.get(key)) for key in ("press", "sigma")),
        )
    session.people.print(table)
    session.people.print(f"  {_units_of_fit(choices)}", markup=False)
    for name, choice in choices.items():
        if len(choice.table) > 1:
            sentence = choice.sentence.replace(choice.polynomial.response, name, 1)
            session.people.print(f"  {sentence}", markup=False)
    for optimum in result.optima:
        session.people.print(f"  [bold]{escape(optimum.name)}[/]: {escape(optimum.aim)}")
        where = ", ".join(f"{name} = {_value(value)}" for name, value in optimum.factors.items())
        values = ", ".join(_number(value) for value in optimum.best.objectives)
        if optimum.overall_desirability is not None:
            values = f"overall desirability {optimum.overall_desirability:.3f} of 1"
        label = f"front of {len(optimum.front)} points, knee" if optimum.front else optimum.best.label
        session.people.print(f"    {label} at {where}: predicted {values}", markup=False)
        if optimum.desirabilities:
            each = ", ".join(f"{name} {value:.3f}" for name, value in optimum.desirabilities.items())
            session.people.print(f"    desirabilities: {each}", markup=False)
        if optimum.region:
            share = f"{100 * optimum.region.share:.3g} %"
            session.people.print(f"    the constraints leave {share} of the box", markup=False)
    for warning in result.warnings():
        session.people.print(f"  [yellow]note:[/] {escape(warning)}")
    confirmation_runs(session, result.confirmations)
    if result.optima:
        next_stage(session, study, "verify")


def verify(session: Session, study: Study, result: VerifyResult, *, refining: bool = False) -> None:
    """Show predicted against actual, and the verdict; the next step unless it is made already."""
    session.people.print(f"[bold]Verify[/]{_fresh(result.fresh)}")
    wished = {options.name for options in study.searches if options.desirability}
    by_hand = study.file.simulator is None
    for search in result.verification.searches:
        made = refining or search.name in result.refined
        _confirmation(session, search, search.name in wished, advise=not made, by_hand=by_hand)
        if search.name in result.refined and not refining:
            _refined(session, search.name, result.refined[search.name])
    confirmation_runs(session, result.confirmations)
    what = "Simulator runs" if study.file.simulator else "Runs"
    session.people.print(f"  {what}: {result.spent.words}", markup=False)
    session.people.print(
        f"  Files: {result.path.parent}/{{design.csv, runs.jsonl, model.json, optimum.json, "
        f"{result.path.name}}}",
        markup=False,
    )


def _confirmation(
    session: Session, search: verified.Confirmation, wished: bool, *, advise: bool, by_hand: bool
) -> None:
    where = ", ".join(f"{name} = {_value(value)}" for name, value in search.factors.items())
    table = _table("", "predicted", "actual", "difference", "interval")
    for number, (text, comparison) in enumerate(search.objectives.items(), start=1):
        if text not in search.responses:
            title = "objective" if len(search.objectives) == 1 else f"objective {number}"
            table.add_row(*_desirability(comparison) if wished else (title, *_compared(comparison)))
    for name, comparison in search.responses.items():
        table.add_row(escape(name), *_compared(comparison))
    session.people.print(f"  [bold]{escape(search.name)}[/], {escape(search.point)} at {escape(where)}")
    session.people.print(table)
    color = {"CONFIRMED": "green", "IMPROVED, MODEL POOR": "yellow"}.get(search.verdict, "red")
    session.people.print(f"  [bold {color}]{search.verdict}[/]: {escape(search.sentence)}")
    if search.best_known:
        sentence = search.best_known.sentence
        session.people.print(f"  {sentence[:1].upper()}{sentence[1:]}", markup=False)
    if advise and (advice := next_step(search, by_hand=by_hand)):
        session.people.print(f"  [dim]Next:[/] {escape(advice)}")
    for extreme in search.extremes:
        _confirmation(session, extreme, wished, advise=advise, by_hand=by_hand)


def _desirability(comparison: verified.Comparison) -> tuple[str, ...]:
    """Overall desirability, predicted and actual: minus the objective, which has a penalty where it is 0."""
    predicted, actual = (
        None if x is None else min(1.0, max(0.0, -x)) for x in (comparison.predicted, comparison.actual)
    )
    away = "-" if predicted is None or actual is None else f"{actual - predicted:+.3f}"
    shown = ["failed" if x is None else f"{x:.3f}" for x in (predicted, actual)]
    return "overall desirability", *shown, away, "-"


def wave(session: Session, search: str, done: Wave) -> None:
    """Show one wave of a refinement as it ends."""
    session.people.print(f"  {search}, {done.sentence}", markup=False)


def refine(session: Session, result: RefineResult) -> None:
    """Show where the refinement ended."""
    session.people.print("[bold]Refine[/]")
    for name, found in result.refinements.items():
        _refined(session, name, result.verdicts[name])
        session.people.print(f"  stopped because {found.reason}", markup=False)
    session.people.print(f"  File: {result.path}", markup=False)


def _refined(session: Session, name: str, found: RefinedVerdict) -> None:
    color = "green" if found.verdict == "SETTLED" else "yellow"
    session.people.print(
        f"  {escape(name)}, refined: [bold {color}]{found.verdict}[/], {escape(found.sentence)}"
    )
    if advice := next_step(None, found.verdict):
        session.people.print(f"  [dim]Next:[/] {escape(advice)}")


def comparison(session: Session, result: DesignComparison, figure: Path) -> None:
    """Show designs side by side."""
    table = _table("", *result.names)
    for label, values in result.rows:
        table.add_row(label, *(_number(value) for value in values))
    session.people.print(table)
    session.people.print(f"  Prediction variance over the design space: {figure}", markup=False)


def against_ga(session: Session, compared: Sequence[DirectComparison | FrontComparison]) -> None:
    """Show the surrogate's optimum or front beside the direct search's (the paper's Tables 8 and 9)."""
    from rsmkit.stages.compare import FrontComparison

    for item in compared:
        session.people.print(f"[bold]{escape(item.search)}[/]: surrogate against direct genetic search")
        if isinstance(item, FrontComparison):
            table = _table("front", "runs", "points", "hypervolume", "IGD+")
            for front in item.rows:
                volume = f"{front['hypervolume_pct']:.1f} %"
                table.add_row(
                    front["who"], str(front["runs"]), str(front["points"]), volume, _number(front["igd_plus"])
                )
            session.people.print(table)
            continue
        best = item.best
        table = _table("", "direct", "surrogate", "difference", "of the range")
        for row in item.differences:
            table.add_row(
                row.factor,
                _number(row.reference),
                _number(row.surrogate),
                f"{row.difference_pct:.3g} %",
                f"{row.range_pct:.3g} %",
            )
        direct = _number(best.optimum.best.objectives[0])
        surrogate = _number(item.surrogate_objective)
        table.add_row("true objective", direct, surrogate, f"{item.worse_pct:+.3g} %", "")
        table.add_row("simulator runs", str(best.runs), str(item.surrogate_runs), "", "")
        session.people.print(table)


def explorer(session: Session, page: Path) -> None:
    """Show where the explorer page is."""
    session.people.print(f"  Look at it: {page}", markup=False)


def reports(session: Session, written: Reports) -> None:
    """Show where the explorer page is, and what could not be written."""
    if "explorer" in written.paths:
        explorer(session, written.paths["explorer"])
    notes(session, written)


def notes(session: Session, written: Reports) -> None:
    """Show what could not be written, and why."""
    for text in written.notes:
        session.people.print(f"  [yellow]note:[/] {escape(text)}")


def status(session: Session, study: Study, result: Status) -> None:
    """Show the state of every stage."""
    table = _table("stage", "state", "")
    colors = {"fresh": "green", "to do": "yellow", "waiting": "dim"}
    for stage in result.stages:
        color = colors[stage.state]
        table.add_row(stage.stage, f"[{color}]{stage.state}[/]", escape(stage.reason))
    session.people.print(f"[bold]{escape(study.name)}[/]")
    session.people.print(table)
    _next(session, result.command(_where(study)))


def _table(*heads: str) -> Table:
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style="dim")
    for index, head in enumerate(heads):
        table.add_column(head, justify="left" if index == 0 else "right", overflow="fold")
    return table


def _units_of_fit(choices: Mapping[str, Choice]) -> str:
    """Say what PRESS and sigma are measured in."""
    reports = {name: choice.surface.report() for name, choice in choices.items()}
    other = [name for name, report in reports.items() if report.get("sigma_units", "").startswith("transf")]
    but = f"; of {', '.join(other)}: sigma in units of the transformed response" if other else ""
    return f"PRESS in squared units of each response, sigma in its units{but}"


def _titled(result: FitResult) -> dict[str, Choice]:
    """Surfaces of the objectives, named after the searches that use them."""
    return {
        f"objective of {optimum.name}" + (f" ({number})" if len(optimum.minimize) > 1 else ""): choice
        for optimum in result.optima
        for number, text in enumerate(optimum.minimize, start=1)
        if (choice := result.objectives.get(text)) is not None
    }


def _compared(comparison: verified.Comparison) -> tuple[str, str, str, str]:
    error = comparison.signed_error_pct
    low, high = comparison.low, comparison.high
    return (
        _number(comparison.predicted),
        "failed" if comparison.actual is None else _number(comparison.actual),
        "-" if error is None else "0 %" if abs(error) < ROUNDING_PCT else f"{error:+.3g} %",
        "-" if low is None or high is None else f"{_number(low)} .. {_number(high)}",
    )


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.6g}"


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{value:.1f} %"


def _ratio(value: float | None) -> str:
    return "-" if value is None else f"{value:.5f}"


def _value(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _fresh(fresh: bool) -> str:
    return "  [dim](up to date)[/]" if fresh else ""
