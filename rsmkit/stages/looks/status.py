"""Where a study stands: the state of each stage, and the command that comes next."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from rsmkit.io.arguments import checked
from rsmkit.io.shown import Shown
from rsmkit.study.folder import StudyFolder
from rsmkit.verification.next_steps import NOTHING, next_step

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
class Status(Shown):
    """All four stages and the next command."""

    stages: tuple[StageState, ...]
    next: str

    @property
    def stage(self) -> str:
        """The stage to do now; empty where every one is up to date."""
        return next((stage.stage for stage in self.stages if stage.state == "to do"), "")

    def command(self, where: str) -> str:
        """What to type next, with the study's folder (`where`) named in it."""
        return self.next + (where if self.stage else "")

    def overview(self) -> dict[str, Any]:
        """What ``--json`` prints."""
        return {"stages": [vars(stage) for stage in self.stages], "next": self.next}


@checked
def study_status(folder: StudyFolder) -> Status:
    """Look at every stage without running anything."""
    stages: list[StageState] = []
    for name, look in (("plan", _plan), ("evaluate", _evaluate), ("fit", _fit), ("verify", _verify)):
        if stages and stages[-1].state != "fresh":
            stages.append(StageState(name, "waiting", f"needs {stages[-1].stage}"))
            continue
        reason, detail = look(folder)
        stages.append(StageState(name, "to do" if reason else "fresh", reason or detail))
    pending = next((stage for stage in stages if stage.state == "to do"), None)
    if pending is None:
        return Status(tuple(stages), _next_step(folder) or NOTHING)
    if folder.study.file.simulator is None and (sheet := _by_hand(folder, pending.stage)):
        return Status(tuple(stages), sheet)
    retry = " --retry-failed" if pending.reason.startswith(ALL_FAILED) else ""
    return Status(tuple(stages), f"rsmkit {pending.stage}{retry}")


def _by_hand(folder: StudyFolder, stage: str) -> str:
    """What stands for a stage whose runs people still have to make; empty where that is not so."""
    if stage == "evaluate":
        made = folder.standing().usable
        return "rsmkit record FILE.csv" if made else "rsmkit sheet FILE.csv"
    if stage != "verify":
        return ""
    from rsmkit.stages.verify import lacks_runs

    return "rsmkit sheet FILE.csv" if lacks_runs(folder) else ""


def _next_step(folder: StudyFolder) -> str:
    """What verify and refinements advise; empty where nothing."""
    if not folder.study.searches:
        return ""
    refined = {name: record.verdict for name, record in folder.refinements().items()}
    by_hand = folder.study.file.simulator is None
    found = folder.verification().searches
    steps = (next_step(item, refined.get(item.name, ""), by_hand=by_hand) for item in found)
    return next(filter(None, steps), "")


# Each says what is wrong with its stage (or None), and a detail of it when nothing is.


def _plan(folder: StudyFolder) -> tuple[str | None, str]:
    reason = folder.plan_problem()
    return reason, "" if reason else f"{folder.standing().points} points"


def _evaluate(folder: StudyFolder) -> tuple[str | None, str]:
    state = folder.standing()
    detail = state.words
    if not state.usable and not state.missing:
        return f"{ALL_FAILED}: {state.failed} failed", ""
    return (detail if state.missing else None), detail


def _fit(folder: StudyFolder) -> tuple[str | None, str]:
    study = folder.study
    return folder.fit_problem(), f"{len(study.responses)} surfaces, {len(study.searches)} searches"


def _verify(folder: StudyFolder) -> tuple[str | None, str]:
    if not folder.study.searches:
        return None, "no search to verify"
    reason = folder.verify_problem()
    if reason:
        return reason, ""
    refined = {name: record.verdict for name, record in folder.refinements().items() if record.verdict}
    found = folder.verification().searches
    return None, "; ".join(f"{search.name}: {refined.get(search.name, search.verdict)}" for search in found)
