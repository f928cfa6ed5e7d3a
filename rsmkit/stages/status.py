"""Where a study stands: the state of each stage, and the command that comes next."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

from rsmkit.errors import StageError
from rsmkit.study.file import Study

if TYPE_CHECKING:
    from rsmkit.stages.evaluate import DesignRuns
    from rsmkit.stages.plan import PlanResult

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

    def overview(self) -> dict[str, Any]:
        """What ``--json`` prints."""
        return {"stages": [vars(stage) for stage in self.stages], "next": self.next}


def study_status(study: Study) -> Status:
    """Look at every stage without running anything."""
    look = _Look(study)
    stages: list[StageState] = []
    for name, problem in (
        ("plan", look.plan),
        ("evaluate", look.evaluate),
        ("fit", look.fit),
        ("verify", look.verify),
    ):
        if stages and stages[-1].state != "fresh":
            stages.append(StageState(name, "waiting", f"needs {stages[-1].stage}"))
            continue
        reason, detail = problem()
        stages.append(StageState(name, "to do" if reason else "fresh", reason or detail))
    pending = next((stage for stage in stages if stage.state == "to do"), None)
    if pending is None:
        return Status(tuple(stages), "nothing to do")
    retry = " --retry-failed" if pending.reason.startswith(ALL_FAILED) else ""
    return Status(tuple(stages), f"rsmkit {pending.stage}{retry}")


class _Look:
    """What is wrong with each stage (or None), and a detail of it when nothing is.

    Design and journal are read once: with 100,000 runs that is what takes the time.
    """

    def __init__(self, study: Study) -> None:
        self.study = study

    @cached_property
    def planned(self) -> PlanResult:
        from rsmkit.stages.plan import load_plan

        return load_plan(self.study)

    @cached_property
    def evaluation(self) -> DesignRuns:
        from rsmkit.stages.evaluate import read_design_runs

        return read_design_runs(self.study, self.planned)

    def plan(self) -> tuple[str | None, str]:
        from rsmkit.stages.plan import plan_problem

        reason = plan_problem(self.study)
        return reason, "" if reason else f"{len(self.planned.design)} points"

    def evaluate(self) -> tuple[str | None, str]:
        state = self.evaluation
        detail = f"{state.done} of {state.distinct} runs done" + (
            f", {state.failed} failed" if state.failed else ""
        )
        if not state.done and not state.missing:
            return f"{ALL_FAILED}: {state.failed} failed", ""
        return (detail if state.missing else None), detail

    def fit(self) -> tuple[str | None, str]:
        from rsmkit.stages.fit import fit_problem

        reason = fit_problem(self.study, self.evaluation)
        return reason, f"{len(self.study.responses)} surfaces, {len(self.study.searches)} searches"

    def verify(self) -> tuple[str | None, str]:
        from rsmkit.stages.verify import load_verification, verify_problem

        if not self.study.searches:
            return None, "no search to verify"
        reason = verify_problem(self.study)
        if reason:
            return reason, ""
        try:
            found = load_verification(self.study).verification.searches
        except StageError as error:
            return str(error), ""
        return None, "; ".join(f"{search.name}: {search.verdict}" for search in found)
