"""Where a study stands: the state of each stage, and the command that comes next."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from rsmkit.errors import StageError
from rsmkit.study import Study

__all__ = ["StageState", "Status", "study_status"]

ALL_FAILED = "no run succeeded"
State = Literal["fresh", "to do", "waiting"]


@dataclass(frozen=True)
class StageState:
    """One stage: up to date, to do now, or waiting for an earlier one."""

    stage: str
    state: State
    reason: str


@dataclass(frozen=True)
class Status:
    """All four stages and the next command."""

    stages: tuple[StageState, ...]
    next: str

    def to_json(self) -> dict[str, Any]:
        """Document for ``--json``."""
        return {"stages": [vars(stage) for stage in self.stages], "next": self.next}


def study_status(study: Study) -> Status:
    """Look at every stage without running anything."""
    stages: list[StageState] = []
    for name, problem in (("plan", _plan), ("evaluate", _evaluate), ("fit", _fit), ("verify", _verify)):
        if stages and stages[-1].state != "fresh":
            stages.append(StageState(name, "waiting", f"needs {stages[-1].stage}"))
            continue
        reason, detail = problem(study)
        stages.append(StageState(name, "to do" if reason else "fresh", reason or detail))
    pending = next((stage for stage in stages if stage.state == "to do"), None)
    if pending is None:
        return Status(tuple(stages), "nothing to do")
    retry = " --retry-failed" if pending.reason.startswith(ALL_FAILED) else ""
    return Status(tuple(stages), f"rsmkit {pending.stage}{retry}")


def _plan(study: Study) -> tuple[str | None, str]:
    from rsmkit.stages.plan import load_plan, plan_problem

    reason = plan_problem(study)
    return reason, "" if reason else f"{len(load_plan(study).design)} points"


def _evaluate(study: Study) -> tuple[str | None, str]:
    from rsmkit.stages.evaluate import read_design_runs

    state = read_design_runs(study)
    detail = f"{state.done} of {state.distinct} runs done" + (
        f", {state.failed} failed" if state.failed else ""
    )
    if not state.done and not state.missing:
        return f"{ALL_FAILED}: {state.failed} failed", ""
    return (detail if state.missing else None), detail


def _fit(study: Study) -> tuple[str | None, str]:
    from rsmkit.stages.evaluate import load_runs
    from rsmkit.stages.fit import fit_problem

    reason = fit_problem(study, load_runs(study))
    return reason, f"{len(study.responses)} surfaces, {len(study.searches)} searches"


def _verify(study: Study) -> tuple[str | None, str]:
    from rsmkit.stages.verify import load_verification, verify_problem

    if not study.searches:
        return None, "no search to verify"
    reason = verify_problem(study)
    if reason:
        return reason, ""
    try:
        found = load_verification(study).verification.searches
    except StageError as error:
        return str(error), ""
    return None, "; ".join(f"{search.name}: {search.verdict}" for search in found)
