"""``rsmkit check``: the study file, and one run of the simulator (if any) at the centre of the space."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from rsmkit.errors import RunsFailedError
from rsmkit.runs.evaluation import check_once
from rsmkit.runs.one_run.command import refuse_unused
from rsmkit.runs.record.run import Run
from rsmkit.study.folder import StudyFolder
from rsmkit.study.user_functions import check_functions

__all__ = ["CheckResult", "check_study"]


@dataclass(frozen=True)
class CheckResult:
    """One run at the centre, none where runs are made by hand, and how many the study plans."""

    run: Run | None
    functions: dict[str, float]
    planned_runs: int | None

    def overview(self) -> dict[str, Any]:
        """What ``--json`` prints."""
        run = self.run
        return {
            "run": run
            and {
                "status": run.status,
                "factors": dict(run.factors),
                "responses": dict(run.responses),
                "seconds": run.seconds,
                "error": run.error,
            },
            "functions": self.functions,
            "planned_runs": self.planned_runs,
        }


def check_study(folder: StudyFolder) -> CheckResult:
    """Run the simulator once at the centre, recording nothing.

    Raises
    ------
    RsmkitError
        If the simulator or a function cannot be loaded, or a command does not receive every factor.
    RunsFailedError
        If the run fails or a response is missing.
    """
    study = folder.study
    functions = check_functions(study)
    if study.file.simulator is None:
        return CheckResult(None, functions, study.file.design.planned_runs)
    refuse_unused(folder.simulator, study.space.names)
    factors = study.space.values(study.space.clip(study.space.snap([f.center for f in study.space])))
    run = check_once(folder.simulator, factors, responses=study.asked).run
    if not run.done:
        raise RunsFailedError(f"the run at the centre ({dict(run.factors)}) {run.status}: {run.error}")
    return CheckResult(run, functions, study.file.design.planned_runs)
