"""Every command with its options."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from rsmkit.cli.session import Session
    from rsmkit.study import Study

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


def common(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command the options that all share, and a session that catches what goes wrong."""

    @click.option("--json", "as_json", is_flag=True, help="One JSON document on stdout, messages on stderr.")
    @click.option("-q", "--quiet", is_flag=True, help="Only errors.")
    @click.option("--no-color", is_flag=True, help="No colours (also: NO_COLOR=1).")
    @wraps(command)
    def wrapped(as_json: bool, quiet: bool, no_color: bool, **options: Any) -> None:
        from rsmkit.cli.session import Session

        session = Session(as_json=as_json, quiet=quiet, color=not no_color)
        with session.guard():
            command(session, **options)
        session.finish()

    return wrapped


def study_argument(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command its STUDY argument, read and checked."""

    @click.argument("study", default=".", type=click.Path(path_type=Path))
    @wraps(command)
    def wrapped(session: Session, study: Path, **options: Any) -> None:
        from rsmkit.study import load_study

        loaded = load_study(study)
        session.log_to(loaded.folder)
        command(session, loaded, **options)

    return wrapped


force_option = click.option("--force", is_flag=True, help="Redo the stage even if it is up to date.")
jobs_option = click.option(
    "-j", "--jobs", type=click.IntRange(min=1), help="Parallel runs (default: all cores)."
)


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
def check(session: Session, study: Study) -> None:
    """Check the study file and run the simulator once, at the centre."""
    from rsmkit.cli import show
    from rsmkit.stages.check import check_study

    result = check_study(study)
    session.document.update(result.to_json())
    show.check(session, study, result)


@main.command()
@force_option
@common
@study_argument
def plan(session: Session, study: Study, force: bool) -> None:
    """Choose the points to run; costs nothing."""
    from rsmkit.cli import show
    from rsmkit.stages.plan import plan_design

    result = plan_design(study, force=force)
    session.document.update(result.to_json())
    show.plan(session, study, result)


@main.command()
@jobs_option
@click.option("--retry-failed", is_flag=True, help="Run again what failed before.")
@common
@study_argument
def evaluate(session: Session, study: Study, jobs: int | None, retry_failed: bool) -> None:
    """Run the simulator at every point that has no finished run yet."""
    from rsmkit.cli import show
    from rsmkit.cli.progress import progress
    from rsmkit.errors import EXIT_RUNS_FAILED
    from rsmkit.stages.evaluate import evaluate_design

    with progress(session) as on_event:
        result = evaluate_design(study, jobs=jobs, retry_failed=retry_failed, on_event=on_event)
    session.document.update(result.to_json())
    show.evaluate(session, study, result)
    if result.evaluation.failed:
        session.exit_code = EXIT_RUNS_FAILED


@main.command()
@force_option
@common
@study_argument
def fit(session: Session, study: Study, force: bool) -> None:
    """Fit the response surfaces and search them; costs no simulator run."""
    from rsmkit.cli import show
    from rsmkit.stages.fit import fit_study

    result = fit_study(study, force=force)
    session.document.update(result.to_json())
    show.fit(session, study, result)


@main.command()
@jobs_option
@click.option("--tolerance", type=float, help="Largest acceptable error of the objective in percent.")
@force_option
@common
@study_argument
def verify(session: Session, study: Study, jobs: int | None, tolerance: float | None, force: bool) -> None:
    """Run the simulator at the optimum and compare."""
    from rsmkit.cli import show
    from rsmkit.cli.progress import progress
    from rsmkit.errors import EXIT_VERIFICATION
    from rsmkit.stages.verify import verify_study

    with progress(session) as on_event:
        result = verify_study(study, jobs=jobs, tolerance_pct=tolerance, force=force, on_event=on_event)
    session.document.update(result.to_json())
    show.verify(session, study, result)
    if not result.within_tolerance:
        session.exit_code = EXIT_VERIFICATION


@main.command()
@jobs_option
@click.option("--retry-failed", is_flag=True, help="Run again what failed before.")
@force_option
@common
@study_argument
def run(session: Session, study: Study, jobs: int | None, retry_failed: bool, force: bool) -> None:
    """Plan, evaluate, fit and verify, skipping what is up to date."""
    from rsmkit.cli.run import run_stages

    run_stages(session, study, jobs=jobs, retry_failed=retry_failed, force=force)


@main.command()
@common
@study_argument
def status(session: Session, study: Study) -> None:
    """Say where the study stands and what comes next."""
    from rsmkit.cli import show
    from rsmkit.stages.status import study_status

    result = study_status(study)
    session.document.update(result.to_json())
    show.status(session, study, result)
