"""Every command with its options."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from rsmkit.cli.decorators import (
    Rows,
    common,
    force_option,
    open_folder,
    retry_option,
    run_options,
    study_argument,
)
from rsmkit.cli.hand_commands import record, report, sheet
from rsmkit.cli.table_options import table_options

if TYPE_CHECKING:
    from rsmkit.cli.session import Session
    from rsmkit.runs.how_to_run import HowToRun
    from rsmkit.study.folder import StudyFolder

__all__ = ["main"]

CONTEXT = {"help_option_names": ["-h", "--help"], "max_content_width": 100}


class Ordered(click.Group):
    """A group that lists its commands in the order of use."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names in the order in which they were defined."""
        return list(self.commands)


def _version(ctx: click.Context, _: click.Parameter, value: bool) -> None:
    if value and not ctx.resilient_parsing:
        from rsmkit import __version__

        click.echo(f"rsmkit {__version__}")
        ctx.exit()


@click.group(cls=Ordered, context_settings=CONTEXT)
@click.option(
    "--version", is_flag=True, expose_value=False, is_eager=True, callback=_version, help="Show the version."
)
def main() -> None:
    """Find the optimum of a slow simulation with few runs.

    A study is a folder with a study.toml. Four stages take it to a verified optimum: plan the runs, evaluate
    them on the simulator, fit response surfaces and search them, verify the optimum on the simulator.

    
      rsmkit new my-study        start from a commented example
      rsmkit run my-study        all four stages, skipping what is up to date
      rsmkit status my-study     where the study stands, and what comes next

    Exit codes: 0 done, 1 unexpected, 2 usage or study file, 3 some runs failed, 4 a stage is missing or
    out of date, 5 verification outside the tolerance, 130 interrupted (type the command again to go on).
    """


@main.command()
@click.argument("folder", type=click.Path(path_type=Path))
@common
def new(session: Session, folder: Path) -> None:
    """Write a commented study that runs."""
    from rsmkit.cli import show
    from rsmkit.stages.new import create_study

    made = create_study(folder)
    session.document["files"] = [str(path) for path in made]
    show.created(session, folder, made)


@main.command()
@common
@study_argument
def check(session: Session, folder: StudyFolder) -> None:
    """Check the study file and run the simulator once, at the centre."""
    from rsmkit.cli import show
    from rsmkit.stages.looks.check import check_study

    result = check_study(folder)
    session.document.update(result.overview())
    show.check(session, folder.study, result)


@main.command()
@click.option(
    "--compare",
    "others",
    type=click.Path(path_type=Path),
    multiple=True,
    metavar="DESIGN.csv",
    help="Put another design of the same factors beside this one (may be repeated).",
)
@click.option(
    "--power",
    "experiments",
    type=click.IntRange(min=10),
    help="Simulate so many experiments: how often each term is found, in plots and of counts too.",
)
@click.option("--baseline", type=float, help="With --power: probability or rate where all terms are zero.")
@click.option("--size", type=float, help="With --power: trials or exposure of each run; the study's, or 1.")
@force_option
@common
@study_argument
def plan(
    session: Session,
    folder: StudyFolder,
    others: tuple[Path, ...],
    experiments: int | None,
    baseline: float | None,
    size: float | None,
    force: bool,
) -> None:
    """Choose the points to run, around runs that are there; costs nothing.

    When the study has changed, runs that still mean something stay, and only what is missing beside them is
    planned. Called again after runs have failed, it replaces them by other points.
    """
    from rsmkit.cli import show
    from rsmkit.cli.progress_bar import working
    from rsmkit.errors import RsmkitError
    from rsmkit.stages.planning.plan import plan_design

    if experiments is None and not (baseline is None and size is None):
        raise RsmkitError("--baseline and --size go with --power: name how many experiments to simulate")
    with working(session, "choosing the points"):
        result = plan_design(folder, force=force, replace_lost=True)
    session.document.update(result.overview())
    show.plan(session, folder.study, result, detail=True)
    if others:
        from rsmkit.stages.compare import compare_with_others

        comparison, figure = compare_with_others(folder, others)
        session.document["comparison"] = comparison.overview()
        show.comparison(session, comparison, figure)
    if experiments is not None:
        from rsmkit.cli.show_power import simulated_power
        from rsmkit.io.json_codec import to_json
        from rsmkit.stages.planning.simulated_power import power_of_study

        with working(session, "simulating experiments"):
            found = power_of_study(folder, experiments, baseline=baseline, size=size)
        session.document["simulated_power"] = to_json(found)
        simulated_power(session, found)


@main.command()
@click.option("--only", type=Rows(), metavar="ROWS", help="Only these rows of the design, such as 3,7-9.")
@click.option("--limit", type=click.IntRange(min=1), help="Make at most so many runs.")
@click.option("--dry-run", is_flag=True, help="Say what would be run, and run nothing.")
@retry_option
@common
@study_argument
@run_options
def evaluate(session: Session, folder: StudyFolder, how: HowToRun, dry_run: bool) -> None:
    """Run the simulator at every point that has no finished run yet."""
    from rsmkit.cli import show
    from rsmkit.cli.progress_bar import progress
    from rsmkit.errors import EXIT_RUNS_FAILED
    from rsmkit.stages.evaluate import evaluate_design, evaluation_agenda

    if dry_run:
        agenda = evaluation_agenda(folder, how)
        session.document["todo"] = [dict(task.factors) for task in agenda.todo]
        show.agenda(session, folder.study, agenda)
        return
    with progress(session) as on_event:
        result = evaluate_design(folder, how, on_event=on_event)
    session.document.update(result.overview())
    show.evaluate(session, folder.study, result)
    if result.evaluation.failed and not folder.study.failures:
        session.exit_code = EXIT_RUNS_FAILED


@main.command()
@click.option(
    "--paths", type=click.IntRange(min=2), default=10, help="Effects of each factor (k + 1 runs a path)."
)
@click.option("--seed", type=click.IntRange(min=0), default=1, help="Seed of the paths.")
@retry_option
@common
@study_argument
@run_options
def screen(session: Session, folder: StudyFolder, how: HowToRun, paths: int, seed: int) -> None:
    """Find which factors matter, from runs along random paths (Morris), before any surface."""
    from rsmkit.cli.progress_bar import progress
    from rsmkit.cli.show_service import screening
    from rsmkit.stages.service.screen import screen_study

    with progress(session) as on_event:
        result = screen_study(folder, how, paths=paths, seed=seed, on_event=on_event)
    session.document.update(result.overview())
    screening(session, result)


@main.command()
@click.argument("study", default=".", type=click.Path(path_type=Path))
@force_option
@table_options
@common
def fit(
    session: Session,
    study: Path,
    force: bool,
    data: Path | None,
    details: bool,
    document: Path | None,
    page: Path | None,
    **table: Any,
) -> None:
    """Fit the response surfaces and search them; costs no simulator run.

    With --data the surfaces are fitted to a table of finished experiments, without any study.
    """
    from rsmkit.cli import show
    from rsmkit.errors import RsmkitError

    if data is not None:
        if given := _typed(["force", "study"]):
            raise RsmkitError(f"--data fits a table without any study: leave {' and '.join(given)} out")
        from rsmkit.io.files.atomic_files import check_folder
        from rsmkit.stages.by_hand.fit_table import fit_data

        written = [path for path in (document, page) if path is not None]
        check_folder(*written)
        fitted = fit_data(data, **table)
        session.document.update(fitted.report())
        session.people.print(fitted.summary(details=details), markup=False)
        if document is not None:
            from rsmkit.stages.hand_in import report_table

            report_table(fitted, document)
        if page is not None:
            from rsmkit.stages.hand_in import page_table

            page_table(fitted, page)
        if written:
            session.document["files"] = [str(path) for path in written]
            session.people.print(f"Wrote {', '.join(map(str, written))}", markup=False)
        return
    if document is not None:
        raise RsmkitError("--report needs --data FILE; the report of a study is: rsmkit report")
    if page is not None:
        raise RsmkitError("--page needs --data FILE; the page of a study is written by: rsmkit explore")
    if given := _typed([*table, "details"]):
        raise RsmkitError(f"{' and '.join(given)} need{'s' * (len(given) == 1)} --data FILE")
    from rsmkit.cli.progress_bar import working
    from rsmkit.cli.show_service import carry_laws
    from rsmkit.stages.fit import fit_study
    from rsmkit.stages.report import write_reports

    folder = open_folder(session, study)
    with working(session, "fitting and searching the surfaces") as on_step:
        result = fit_study(folder, force=force, on_step=on_step)
    session.document.update(result.overview())
    show.fit(session, folder.study, result)
    carried = carry_laws(session, folder, force=force)
    if not result.fresh or carried:
        show.notes(session, write_reports(folder))


def _typed(names: Iterable[str]) -> list[str]:
    """Those of the parameters that stand on the command line, as they are written there."""
    context, typed = click.get_current_context(), click.core.ParameterSource.COMMANDLINE
    written = {
        p.name: p.opts[0] if p.opts[0].startswith("-") else "the study" for p in context.command.params
    }
    return [written[name] for name in names if context.get_parameter_source(name) is typed]


@main.command()
@click.option("--tolerance", type=float, help="Largest acceptable error of the objective in percent.")
@click.option("--against-ga", is_flag=True, help="Compare with the genetic algorithm on the simulator.")
@click.option("--seeds", type=click.IntRange(min=1), default=1, help="With --against-ga: number of searches.")
@click.option(
    "--uncertainty",
    "proving",
    type=click.IntRange(min=3),
    metavar="N",
    help="Run the simulator N times under the laws of [uncertainty] too, at the optimum.",
)
@click.option(
    "--refine", is_flag=True, help="Go on with runs around the optimum while models promise a gain."
)
@retry_option
@force_option
@common
@study_argument
@run_options
def verify(
    session: Session,
    folder: StudyFolder,
    how: HowToRun,
    tolerance: float | None,
    proving: int | None,
    refine: bool,
    against_ga: bool,
    seeds: int,
    force: bool,
) -> None:
    """Run the simulator at the optimum and compare.

    Exits with 0 when every prediction holds, 5 when one is outside the tolerance or violates a constraint, 3
    when the simulator failed at an optimum and all others hold. What --refine settles replaces this.
    """
    from rsmkit.cli import show
    from rsmkit.cli.progress_bar import progress
    from rsmkit.cli.refinements import refine_optima
    from rsmkit.stages.report import write_reports
    from rsmkit.stages.verify import verify_study

    with progress(session) as on_event:
        result = verify_study(folder, how, tolerance_pct=tolerance, force=force, on_event=on_event)
    session.document.update(result.overview())
    refine = refine or result.to_refine(folder.study.file.verify)
    show.verify(session, folder.study, result, refining=refine)
    if not result.fresh:
        show.notes(session, write_reports(folder, replay=result.verification))
    session.exit_code = result.exit_code()
    if refine:
        refined = refine_optima(session, folder, how, result)
        session.document["refinement"] = refined.overview()["searches"]
        show.notes(session, write_reports(folder))
    if proving is not None:
        from rsmkit.cli.show_service import prove_laws

        with progress(session) as on_event:
            proven = prove_laws(session, folder, proving, how, on_event)
        session.exit_code = session.exit_code or proven
        show.notes(session, write_reports(folder))
    if against_ga:
        from rsmkit.stages.compare import compare_with_direct

        with progress(session) as on_event:
            compared = compare_with_direct(folder, how, seeds=seeds, on_event=on_event)
        session.document["against_ga"] = [item.overview() for item in compared]
        show.against_ga(session, compared)


@main.command()
@retry_option
@force_option
@common
@study_argument
@run_options
def run(session: Session, folder: StudyFolder, how: HowToRun, force: bool) -> None:
    """Plan, evaluate, fit and verify, skipping what is up to date."""
    from rsmkit.cli.all_stages import run_stages

    run_stages(session, folder, how, force=force)


@main.command()
@common
@study_argument
def status(session: Session, folder: StudyFolder) -> None:
    """Say where the study stands and what comes next."""
    from rsmkit.cli import show
    from rsmkit.stages.looks.status import study_status

    result = study_status(folder)
    session.document.update(result.overview())
    show.status(session, folder.study, result)


@main.command()
@click.option("--no-open", is_flag=True, help="Only write the page.")
@common
@study_argument
def explore(session: Session, folder: StudyFolder, no_open: bool) -> None:
    """Open the study's explorer page in the browser."""
    from rsmkit.cli import show
    from rsmkit.errors import StageError
    from rsmkit.stages.report import write_reports

    folder.fitted()
    reports = write_reports(folder)
    if "explorer" not in reports.paths:
        raise StageError("; ".join(reports.notes))
    path = reports.paths["explorer"]
    session.document["file"] = str(path)
    show.explorer(session, path)
    if not no_open:
        click.launch(str(path))


for command in (report, sheet, record):
    main.add_command(command)


@main.command()
@click.argument("shell", type=click.Choice(["bash", "zsh", "fish"]))
def completion(shell: str) -> None:
    """Print a script that completes commands and options in your shell.

    
      bash   rsmkit completion bash > ~/.local/share/bash-completion/completions/rsmkit
      zsh    rsmkit completion zsh > ~/.zfunc/_rsmkit     (a folder of $fpath)
      fish   rsmkit completion fish > ~/.config/fish/completions/rsmkit.fish
    """
    from click.shell_completion import get_completion_class

    script = get_completion_class(shell)
    assert script is not None
    click.echo(script(main, {}, "rsmkit", "_RSMKIT_COMPLETE").source())
