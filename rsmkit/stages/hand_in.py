"""``rsmkit report``: a study, or a fitted table, as one document to hand in."""

from __future__ import annotations

from collections.abc import Sequence
from hashlib import file_digest
from pathlib import Path
from typing import TYPE_CHECKING

from rsmkit.errors import RsmkitError
from rsmkit.io.files.regular_files import open_regular
from rsmkit.optimum.optimum import Optimum
from rsmkit.report.explorer.verdict import capital, quality_words
from rsmkit.report.paper.blocks import Block, Grid, Heading, NewPage, Paper, Text
from rsmkit.report.paper.other_papers import write_paper
from rsmkit.report.paper.service_chapter import service_chapter, service_sentence
from rsmkit.report.paper.surface_chapter import surface_chapter
from rsmkit.runs.one_run.simulator import program_files
from rsmkit.runs.record.run import Run, State
from rsmkit.runs.sheets.hand_runs import remarks
from rsmkit.stages.by_hand.kept_order import ORDER_FILE
from rsmkit.stages.by_hand.laboratory import all_corrections
from rsmkit.stages.confirmations import confirmation_runs
from rsmkit.stages.planning.design_cost import design_cost, excluded_words
from rsmkit.study.folder import (
    DESIGN_FILE,
    JOURNAL_FILE,
    MODEL_FILE,
    OPTIMUM_FILE,
    REFINEMENT_FILE,
    UNCERTAINTY_FILE,
    VERIFICATION_FILE,
    Fitted,
    StudyFolder,
)
from rsmkit.study.groups import places_in_time
from rsmkit.surfaces.tables.table_fit import TableFit
from rsmkit.verification.next_steps import NOTHING, next_step
from rsmkit.verification.refinement.refinement import RefinementRecord
from rsmkit.verification.verification import Confirmation, Verification, place_words

if TYPE_CHECKING:
    from rsmkit.report.explorer.inline_page import ExplorerPage

__all__ = ["REPORT_FILE", "page_table", "report_study", "report_table", "study_paper", "table_paper"]

REPORT_FILE = "report"
"""Name of a report in the study's folder, without its ending."""


def report_study(folder: StudyFolder, paths: Sequence[Path]) -> list[Path]:
    """Write the report of a fitted study, to each path as what its name ends in.

    Raises
    ------
    StageError
        If the study has no up-to-date fit.
    RsmkitError
        If a file cannot be written, or a library for it is missing.
    """
    paper = study_paper(folder)
    for path in paths:
        write_paper(paper, path)
    return list(paths)


def report_table(fitted: TableFit, path: Path) -> None:
    """Write the report of a fitted table."""
    write_paper(table_paper(fitted), path)


def page_table(fitted: TableFit, path: Path) -> ExplorerPage:
    """Write the explorer page of a fitted table: that of a study, without a simulator."""
    from rsmkit.report.explorer.explorer_page import write_explorer
    from rsmkit.report.explorer.inline_page import ExplorerPage
    from rsmkit.report.table_findings import table_findings

    page = ExplorerPage(path)
    if page.suffix.lower() not in (".html", ".htm"):
        raise RsmkitError(f"{path}: the page is an HTML file; let its name end in .html")
    write_explorer(page, table_findings(fitted))
    return page


def study_paper(folder: StudyFolder) -> Paper:
    """Collect all that a study has found: a page of summary, then the chapters."""
    fitted = folder.fitted()
    verified = None if folder.verify_problem() else folder.verification()
    blocks: list[Block] = [
        *_summary(folder, fitted, verified),
        NewPage(),
        *_question(folder),
        *_runs(folder, fitted),
        Heading("Surfaces"),
    ]
    at = fitted.optima[0].point if fitted.optima else None
    for name, choice in fitted.responses.items():
        title = folder.study.file.responses[name].title(name)
        blocks += surface_chapter(title, choice.surface, choice.polynomial, sentence=choice.sentence, at=at)
    blocks += _searches(fitted.optima)
    blocks += _verdicts(folder, fitted, verified)
    if (served := folder.uncertainty()) is not None:
        titles = {name: options.title(name) for name, options in folder.study.file.responses.items()}
        blocks += service_chapter(served, titles)
    blocks += _sources(folder)
    return Paper(folder.study.name, blocks)


def table_paper(fitted: TableFit) -> Paper:
    """Collect all that was found of a table of finished experiments."""
    blocks: list[Block] = [Heading("Summary")]
    names = ", ".join(fitted.space.names)
    blocks.append(Text(f"{Path(fitted.source).name}: {', '.join(fitted.surfaces)} as functions of {names}."))
    for name, surface in fitted.surfaces.items():
        best = fitted.optimum(name)
        found = [
            f"{goal} {best[goal]['predicted']:.5g} at {place_words(best[goal]['natural'])}"
            for goal in ("maximum", "minimum")
            if goal in best
        ]
        words = quality_words(surface.report().get("r2_predicted"))
        blocks.append(Text(f"{name}: {words}; between the bounds {' and '.join(found)}.", strong=True))
        if fitted.left_out[name]:
            blocks.append(Text(f"{name}: {fitted.left_out[name]} rows lack a value and are left out."))
    blocks += [NewPage(), Heading("Surfaces")]
    for name, surface in fitted.surfaces.items():
        blocks += surface_chapter(name, surface, surface)
        data = surface.data
        rows = [
            [*fitted.space.values(point).values(), float(y)]
            for point, y in zip(data.points, data.y, strict=True)
        ]
        blocks.append(Grid(f"{name}: runs", [*fitted.space.names, name], rows))
    blocks += [Heading("Sources"), _versions(), _digests([Path(fitted.source).resolve()])]
    return Paper(f"Analysis of {Path(fitted.source).name}", blocks)


def _summary(folder: StudyFolder, fitted: Fitted, verified: Verification | None) -> list[Block]:
    """One page in words for whoever reads no further."""
    study = folder.study
    factors = ", ".join(f"{f.title} ({f.domain.text})" for f in study.space)
    responses = ", ".join(options.title(name) for name, options in study.file.responses.items())
    runs = folder.fit_runs()
    blocks: list[Block] = [
        Heading("Summary"),
        Text(
            f"Question: how {responses} {'depends' if len(study.responses) == 1 else 'depend'} on {factors}."
        ),
        Text(f"Done: {runs.words}; {len(runs.usable)} of them carry the surfaces."),
    ]
    judged = {search.name: search for search in verified.searches} if verified else {}
    refined = folder.refinements()
    for optimum in fitted.optima:
        again = refined.get(optimum.name)
        before = _answer(optimum, judged.get(optimum.name))
        if again and again.verdict:
            blocks.append(Text(_refined_answer(optimum, again), strong=True))
            blocks.append(Text(f"Before the refinement: {before}"))
        else:
            blocks.append(Text(before, strong=True))
    served = folder.uncertainty()
    if served is not None and (text := service_sentence(served)):
        blocks.append(Text(f"In service: {text}.", strong=True))
    trust = [
        f"{study.file.responses[name].title(name)}: "
        + quality_words(surface.report().get("r2_predicted"), name, verified, study.file.verify.tolerance_pct)
        for name, surface in fitted.surfaces.items()
    ]
    blocks.append(Text(f"How far the surfaces can be trusted over the runs: {'; '.join(trust)}."))
    blocks += [Text(f"To know: {text}.") for text in design_cost(folder)]
    by_hand = study.file.simulator is None
    verdicts = {name: record.verdict for name, record in refined.items()}
    steps = (
        next_step(judged.get(item.name), verdicts.get(item.name, ""), by_hand=by_hand)
        for item in fitted.optima
    )
    if step := next(filter(None, steps), NOTHING if fitted.optima else ""):
        blocks.append(Text(f"Next: {step}."))
    return blocks


def _answer(optimum: Optimum, judged: Confirmation | None) -> str:
    """The answer of one search in a few sentences."""
    where = place_words(optimum.factors)
    promised = ", ".join(f"{name} {value:.5g}" for name, value in optimum.best.responses.items())
    whole = optimum.overall_desirability
    level = "" if whole is None else f" (overall desirability {whole:.3f} of 1)"
    text = f"{optimum.name} ({optimum.aim}): best at {where}; predicted {promised}{level}."
    if optimum.obstacles:
        said = judged is not None and judged.sentence.startswith(optimum.obstacles)
        what = "" if said else f" {optimum.obstacles}."
        text = f"{optimum.name} ({optimum.aim}):{what} The nearest is at {where}."
    if judged is None:
        return f"{text} Not verified yet."
    known = judged.best_known
    beside = f" {capital(known.sentence)}." if known and known.source == "design run" else ""
    return f"{text} {judged.verdict}: {judged.sentence}.{beside}"


def _refined_answer(optimum: Optimum, found: RefinementRecord) -> str:
    """The answer of a search that true runs have refined."""
    values = ", ".join(f"{name} {value:.5g}" for name, value in found.responses.items())
    which = "best known" if found.feasible else "nearest to acceptable"
    knee = ", the knee of the true front" if found.front else ""
    where = f"{which} at {place_words(found.factors)}{knee}: {values}"
    return f"{optimum.name} ({optimum.aim}): {where}. {found.verdict}: {found.sentence}."


def _question(folder: StudyFolder) -> list[Block]:
    """What was varied, what was measured, what was sought, and what the design can tell."""
    study, plan = folder.study, folder.plan()
    factors = [[f.name, f.title, f.kind, f.domain.text] for f in study.space]
    responses = [[name, options.title(name)] for name, options in study.file.responses.items()]
    kinds = plan.design.kinds
    count = ", ".join(f"{kinds.count(kind)} {kind}" for kind in dict.fromkeys(kinds))
    quality = plan.quality
    numbers = [
        ["D-efficiency [%]", quality.d_efficiency],
        ["A-efficiency [%]", quality.a_efficiency],
        ["G-efficiency [%]", quality.g_efficiency],
        ["I-efficiency [%]", quality.i_efficiency],
        ["condition number", quality.condition_number],
        ["largest variance inflation", max(quality.vif.values(), default=None)],
        ["largest leverage", max(quality.leverages, default=None)],
    ]
    powers = [[name, value] for name, value in quality.power.items()]
    return [
        Heading("Question and design"),
        Grid("Factors", ["name", "factor", "kind", "values"], factors),
        Grid("Responses", ["name", "response"], responses),
        Text(f"Design: {len(plan.design)} runs ({count}), seed {study.file.design.seed}."),
        Grid("What the design can tell", ["", "value"], numbers),
        Grid("Chance to see an effect of two standard deviations", ["term", "power"], powers),
        *[Text(f"Note: {warning}.") for warning in quality.warnings],
    ]


def _runs(folder: StudyFolder, fitted: Fitted) -> list[Block]:
    """Every run, those that do not count in grey, with what happened to them.

    Of runs made by hand also when they were made, and what was noted beside them.
    """
    state, names = folder.design_runs(), folder.study.asked
    rows: list[list[object]] = []
    greyed = set()
    added = state.added
    table: list[tuple[int | str, Run | None, State]] = [
        (i + 1, run, s) for i, (run, s) in enumerate(zip(state.runs.runs, state.runs.states, strict=True))
    ]
    table += [("added", run, s) for run, s in zip(added.runs, added.states, strict=True)] if added else []
    places = places_in_time(folder.study, state, folder.journal.load())
    notes = remarks([run for _, run, _ in table if run is not None], names)
    for label, run, how in table:
        if run is None:
            continue
        if how not in ("done", "partial"):
            greyed.add(len(rows))
        remark = run.excluded or run.error
        made = [places[run.key]] if places else []
        noted = [run.extras.get(name, "") for name in notes]
        values = [run.value(name) for name in names]
        rows.append([label, *made, *run.made_at.values(), *values, how, remark, *noted])
    order = ["made as"] if places else []
    heads = ["run", *order, *folder.study.space.names, *names, "state", "why", *notes]
    blocks: list[Block] = [
        Heading("Runs"),
        Text(f"{state.words}."),
        Grid("Runs", heads, rows, frozenset(greyed)),
    ]
    if excluded := excluded_words(state):
        blocks.append(Text(f"Excluded: {', '.join(excluded)}."))
    drifts = [
        f"{label}: {place_words(run.made_at)} instead of {place_words(run.factors)}"
        for label, run, _ in table
        if run is not None and run.made_at != run.factors
    ]
    blocks += [Text(f"Not made as planned, fitted where made: {'; '.join(drifts)}.")] if drifts else []
    told = [] if folder.study.file.simulator else all_corrections(folder)
    if told:
        cells = [[item.run, item.name, item.old, item.new] for item in told]
        blocks.append(Grid("Corrections", ["which", "what", "old", "new"], cells))
    blocks += [Text(f"Failed: {text}.") for text in state.errors]
    return blocks


def _searches(optima: Sequence[Optimum]) -> list[Block]:
    """What was searched for and found on the surfaces."""
    blocks: list[Block] = [Heading("Search")] if optima else []
    for optimum in optima:
        blocks.append(Heading(optimum.name, 2))
        limits = f", subject to {' and '.join(optimum.subject_to)}" if optimum.subject_to else ""
        blocks.append(Text(f"Sought: {optimum.aim}{limits}. Seed {optimum.seed}."))
        rows: list[list[object]] = [[name, value] for name, value in optimum.factors.items()]
        rows += [[f"{name}, predicted", value] for name, value in optimum.best.responses.items()]
        rows += [[f"desirability of {name}", value] for name, value in optimum.desirabilities.items()]
        if optimum.overall_desirability is not None:
            rows.append(["overall desirability (0 to 1)", optimum.overall_desirability])
        blocks.append(Grid(f"{optimum.name}: best point", ["", "value"], rows))
        if optimum.obstacles:
            blocks.append(Text(f"{optimum.obstacles}.", strong=True))
    return blocks


def _verdicts(folder: StudyFolder, fitted: Fitted, verified: Verification | None) -> list[Block]:
    """Predicted against actual."""
    blocks: list[Block] = []
    for point in [p for search in verified.searches for p in search.points] if verified else []:
        rows = [
            [name, c.predicted, c.actual, c.error_pct, c.low, c.high] for name, c in point.responses.items()
        ]
        heads = ["", "predicted", "actual", "error [%]", "interval from", "to"]
        blocks += [
            Heading(f"{point.name}, {point.point}", 2),
            Text(f"{point.verdict}: {point.sentence}.", strong=True),
            Text(f"At {place_words(point.factors)}; {point.replicates} runs."),
            Grid(f"{point.name} {point.point}: predicted and actual", heads, rows),
        ]
    runs = confirmation_runs(folder, fitted)
    blocks += [Heading("Confirmation runs", 2)] if runs else []
    blocks += [Text(f"{run.verdict}: {run.sentence}.") for run in runs]
    return [Heading("Verdict"), *blocks] if blocks else []


def _sources(folder: StudyFolder) -> list[Block]:
    """From what exactly all this comes."""
    study, root = folder.study, folder.path.resolve()
    tables = [*study.file.design.tables.values(), *(law.file for law in study.file.uncertainty.values())]
    programs = (path.resolve() for path in program_files(folder.simulator))
    files = [study.path, *(folder.path / name for name in tables if name)]
    files += [path for path in programs if path.is_relative_to(root)]
    files += [
        folder.path / name
        for name in (
            DESIGN_FILE,
            ORDER_FILE,
            JOURNAL_FILE,
            MODEL_FILE,
            OPTIMUM_FILE,
            VERIFICATION_FILE,
            REFINEMENT_FILE,
            UNCERTAINTY_FILE,
        )
    ]
    return [Heading("Sources"), _versions(), _digests([path for path in files if path.is_file()])]


def _versions() -> Text:
    from importlib.metadata import version
    from platform import python_version

    packages = ("numpy", "scipy", "statsmodels", "scikit-learn")
    told = ", ".join(f"{name} {version(name)}" for name in packages)
    from rsmkit import __version__

    return Text(f"Made with rsmkit {__version__}, Python {python_version()}, {told}.")


def _digests(paths: Sequence[Path]) -> Grid:
    rows = []
    for path in paths:
        try:
            with open(open_regular(path), "rb") as stream:
                rows.append([path.name, file_digest(stream, "sha256").hexdigest()])
        except OSError as error:
            raise RsmkitError(f"{path}: cannot be read: {error.strerror}") from None
    return Grid("Files and their hashes", ["file", "SHA-256"], rows)
