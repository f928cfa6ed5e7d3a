"""``rsmkit screen``: which factors matter, from runs of the simulator alone (``screening.json``)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rsmkit.errors import RunsFailedError, StageError
from rsmkit.io.arguments import checked
from rsmkit.io.json_codec import to_json, write_json
from rsmkit.runs.how_to_run import HowToRun
from rsmkit.runs.record.run_progress import Watcher
from rsmkit.stages.service.prove import varied_simulator
from rsmkit.study.folder import StudyFolder
from rsmkit.variation.sensitivity.morris import ElementaryEffects, elementary_effects, morris

__all__ = ["ScreenResult", "screen_study"]

SCREENING_FILE = "screening.json"


@dataclass(frozen=True)
class ScreenResult:
    """Effects of every factor on every response."""

    effects: dict[str, dict[str, ElementaryEffects]]
    runs: int
    path: Path

    def overview(self) -> dict[str, Any]:
        """What ``--json`` prints."""
        return {
            "stage": "screen",
            "file": str(self.path),
            "runs": self.runs,
            "responses": to_json(self.effects),
        }


@checked
def screen_study(
    folder: StudyFolder,
    how: HowToRun | None = None,
    *,
    paths: int = 10,
    seed: int = 1,
    on_event: Watcher | None = None,
) -> ScreenResult:
    """Screen the factors of a study; its runs go through the journal, so that nothing is run twice.

    Parameters
    ----------
    folder : StudyFolder
        Needs no design.
    how : HowToRun, optional
    paths : int
        Effects of each factor; all take ``paths * (k + 1)`` runs.
    seed : int
    on_event : callable, optional
        Told of every run that starts and ends.

    Raises
    ------
    StageError
        If the study has no simulator.
    RunsFailedError
        If no run succeeded.
    """
    study = folder.study
    if study.file.simulator is None:
        raise StageError("this study has no simulator to screen")
    made = morris(study.space, paths=paths, seed=seed)
    values = varied_simulator(folder, study.space, how or HowToRun(), on_event)(made.points)
    if all((y != y).all() for y in values.values()):
        raise RunsFailedError("every run of the screening failed")
    effects = {name: elementary_effects(made, y) for name, y in values.items()}
    path = folder.path / SCREENING_FILE
    document = {"schema": 1, "paths": paths, "seed": seed, "responses": to_json(effects)}
    write_json(path, document)
    return ScreenResult(effects, len(made.points), path)
