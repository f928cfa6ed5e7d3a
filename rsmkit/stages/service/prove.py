"""``rsmkit verify --uncertainty N``: runs of the simulator under the laws of service, at the optimum.

Writes what they say into ``uncertainty.json``. Every run goes through the journal: started again after an
interruption nothing is repeated, and more runs go on where fewer ended.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from rsmkit.errors import EXIT_OK, EXIT_RUNS_FAILED, EXIT_VERIFICATION, RsmkitError, StageError
from rsmkit.io.arguments import checked
from rsmkit.io.json_codec import to_json
from rsmkit.language.space import Floats, Space
from rsmkit.runs.evaluation import evaluate_points
from rsmkit.runs.how_to_run import HowToRun
from rsmkit.runs.one_run.simulator import Simulator
from rsmkit.runs.record.run_progress import Watcher
from rsmkit.stages.service.propagate import ask_of, propagate_study
from rsmkit.study.counts import as_rates
from rsmkit.study.folder import StudyFolder
from rsmkit.variation.conformity.judgement import CONFIRMED, with_truth
from rsmkit.variation.conformity.proof import Trial, prove
from rsmkit.variation.findings_of_laws import Uncertainty
from rsmkit.variation.propagation import posteriors_of

__all__ = ["ProveResult", "prove_study", "varied_simulator"]


@dataclass(frozen=True)
class ProveResult:
    """What runs under the laws say."""

    found: Uncertainty
    path: Path

    @property
    def exit_code(self) -> int:
        """0 where nothing contradicts the surfaces, 5 where something does, 3 with too few runs."""
        verdict = (self.found.true or {}).get("verdict")
        if verdict == "FAILED":
            return EXIT_RUNS_FAILED
        return EXIT_VERIFICATION if verdict == "NOT CONFIRMED" else EXIT_OK

    @property
    def confirmed(self) -> bool:
        """Whether the runs agree with the surfaces."""
        return (self.found.true or {}).get("verdict") == CONFIRMED

    def overview(self) -> dict[str, Any]:
        """What ``--json`` prints."""
        return {"file": str(self.path), **to_json(self.found)}


@checked
def prove_study(
    folder: StudyFolder,
    runs: int,
    how: HowToRun | None = None,
    *,
    on_event: Watcher | None = None,
    on_wave: Callable[[int], None] | None = None,
) -> ProveResult:
    """Run the simulator under the laws at the optimum and compare with what the surfaces promise.

    Parameters
    ----------
    folder : StudyFolder
        With an up-to-date fit.
    runs : int
        How many runs, those in the journal included.
    how : HowToRun, optional
    on_event : callable, optional
        Told of every run that starts and ends.
    on_wave : callable, optional
        Told how many runs there are after each wave.

    Raises
    ------
    StageError
        If there is no up-to-date fit, no law, or no simulator.
    """
    study = folder.study
    if runs < 3:
        raise RsmkitError(f"--uncertainty needs at least 3 runs, got {runs}")
    if study.file.simulator is None:
        raise StageError("this study has no simulator to run under its laws")
    carried = propagate_study(folder)
    question = ask_of(folder, folder.fitted())
    if carried is None or question is None:
        raise StageError(
            "no factor has a law, so the surfaces promise nothing of service. "
            "Name what varies in the table [uncertainty]"
        )
    laws, values = study.service.of_runs()
    law = laws.at(np.append(question.point, values))
    trial = Trial(
        law,
        posteriors_of(question),
        list(range(len(study.space))),
        {name: (own.mean, own.sd**2 - own.noise_sd**2) for name, own in carried.found.responses.items()},
        study.file.specifications,
        runs,
        study.file.propagation.confidence,
        study.file.propagation.seed,
    )
    fly = varied_simulator(folder, law.space, how or HowToRun(), on_event)
    proof = prove(trial, fly, on_wave=on_wave)
    found = with_truth(carried.found, proof, study.service.varied_settings)
    return ProveResult(found, folder.keep_uncertainty(found))


def varied_simulator(
    folder: StudyFolder, space: Space, how: HowToRun, on_event: Watcher | None = None
) -> Callable[[Floats], dict[str, Floats]]:
    """The simulator as a function of points of a space that may hold settings too; nan where it fails."""
    responses = folder.study.responses
    options = folder.simulator.options
    kept = {name: value for name, value in options.settings.items() if name not in space.names}
    simulator = Simulator(replace(options, settings=kept, replicates=1), folder.path)
    how = replace(how, only=None, limit=None)

    def fly(points: Floats) -> dict[str, Floats]:
        made = evaluate_points(
            simulator, points, space, folder.journal, how, responses=folder.study.asked, on_event=on_event
        )
        if not made.done.any():
            return dict.fromkeys(responses, np.full(len(points), np.nan))
        made = as_rates(folder.study, made)
        return {name: made.y(name) for name in responses}

    return fly
