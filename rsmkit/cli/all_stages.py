"""``rsmkit run``: the four stages in order."""

from __future__ import annotations

from rsmkit.cli import show
from rsmkit.cli.progress_bar import progress, working
from rsmkit.cli.refinements import refine_optima
from rsmkit.cli.session import Session
from rsmkit.cli.show_service import carry_laws
from rsmkit.errors import EXIT_RUNS_FAILED
from rsmkit.runs.how_to_run import HowToRun
from rsmkit.stages.evaluate import evaluate_design
from rsmkit.stages.fit import fit_study
from rsmkit.stages.planning.plan import plan_design
from rsmkit.stages.report import write_reports
from rsmkit.stages.verify import verify_study
from rsmkit.study.folder import EXPLORER_FILE, StudyFolder

__all__ = ["run_stages"]


def run_stages(session: Session, folder: StudyFolder, how: HowToRun, *, force: bool) -> None:
    """Plan, evaluate, fit and verify; each stage that is up to date is skipped.

    Failed runs do not stop the study while the surfaces can still be estimated; the exit code tells of them
    all the same.
    """
    study = folder.study
    session.document["stages"] = stages = []
    session.next_commands = False
    with working(session, "choosing the points"):
        planned = plan_design(folder, force=force)
    stages.append(planned.overview())
    show.plan(session, study, planned)

    with progress(session) as on_event:
        evaluated = evaluate_design(folder, how, on_event=on_event)
    stages.append(evaluated.overview())
    show.evaluate(session, study, evaluated)
    if evaluated.evaluation.failed and not study.failures:
        session.exit_code = EXIT_RUNS_FAILED

    with working(session, "fitting and searching the surfaces") as on_step:
        fitted = fit_study(folder, force=force, on_step=on_step)
    stages.append(fitted.overview())
    show.fit(session, study, fitted)
    carry_laws(session, folder, force=force)
    if not study.searches:
        show.reports(session, write_reports(folder))
        return

    with progress(session) as on_event:
        verified = verify_study(folder, how, force=force, on_event=on_event)
    stages.append(verified.overview())
    refining = verified.to_refine(study.file.verify)
    show.verify(session, study, verified, refining=refining)
    unsound, session.exit_code = session.exit_code, verified.exit_code()
    if refining:
        refined = refine_optima(session, folder, how, verified)
        stages.append({"stage": "refine", "skipped": False, "file": str(refined.path), **refined.overview()})
    page = folder.path / EXPLORER_FILE
    if verified.fresh and not refining and page.exists():
        show.explorer(session, page)
    else:
        show.reports(session, write_reports(folder, replay=verified.verification))
    session.exit_code = session.exit_code or unsound
