"""``rsmkit run``: the four stages in order."""

from __future__ import annotations

from rsmkit.cli import show
from rsmkit.cli.progress_bar import progress
from rsmkit.cli.session import Session
from rsmkit.errors import EXIT_RUNS_FAILED, EXIT_VERIFICATION
from rsmkit.stages.evaluate import HowToRun, evaluate_design
from rsmkit.stages.explore import EXPLORER_FILE, save_histories, write_page
from rsmkit.stages.fit import fit_study
from rsmkit.stages.plan import plan_design
from rsmkit.stages.verify import verify_study
from rsmkit.study.file import Study

__all__ = ["run_stages"]


def run_stages(session: Session, study: Study, how: HowToRun, *, force: bool) -> None:
    """Plan, evaluate, fit and verify; each stage that is up to date is skipped.

    Failed runs do not stop the study while the surfaces can still be estimated; the exit code tells of them
    all the same.
    """
    session.document["stages"] = stages = []
    session.next_commands = False
    planned = plan_design(study, force=force)
    stages.append(planned.overview())
    show.plan(session, study, planned)

    with progress(session) as on_event:
        evaluated = evaluate_design(study, how, on_event=on_event)
    stages.append(evaluated.overview())
    show.evaluate(session, study, evaluated)
    if evaluated.evaluation.failed:
        session.exit_code = EXIT_RUNS_FAILED

    fitted = fit_study(study, force=force)
    stages.append(fitted.overview())
    show.fit(session, study, fitted)
    if not study.searches:
        show.explorer(session, write_page(study, fitted))
        return

    with progress(session) as on_event:
        verified = verify_study(study, how, force=force, on_event=on_event)
    stages.append(verified.overview())
    show.verify(session, study, verified)
    page = study.folder / EXPLORER_FILE
    if not verified.fresh or not page.exists():
        save_histories(study, verified.verification)
        write_page(study, fitted)
    show.explorer(session, page)
    if not verified.within_tolerance:
        session.exit_code = EXIT_VERIFICATION
