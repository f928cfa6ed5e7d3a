"""Refine the verified optima and show how it goes: for ``verify --refine`` and ``[verify] always_refine``."""

from __future__ import annotations

from rsmkit.cli import show
from rsmkit.cli.session import Session
from rsmkit.runs.how_to_run import HowToRun
from rsmkit.stages.refine import RefineResult, refine_study
from rsmkit.stages.verify import VerifyResult
from rsmkit.study.folder import StudyFolder

__all__ = ["refine_optima"]


def refine_optima(
    session: Session, folder: StudyFolder, how: HowToRun, verified: VerifyResult
) -> RefineResult:
    """Go on with true runs around the optima; what they settle replaces the exit code of the verification."""
    refined = refine_study(folder, how, on_wave=lambda name, wave: show.wave(session, name, wave))
    show.refine(session, refined)
    session.exit_code = verified.exit_code(refined.verdicts)
    return refined
