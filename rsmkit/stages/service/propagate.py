"""Laws of service through the surfaces, about the optimum (``uncertainty.json``); a part of the fit stage."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rsmkit.io.arguments import checked
from rsmkit.io.json_codec import to_json
from rsmkit.study.folder import UNCERTAINTY_FILE, Fitted, StudyFolder
from rsmkit.variation.findings_of_laws import Uncertainty
from rsmkit.variation.propagation import Question, propagate

__all__ = ["PropagateResult", "ask_of", "propagate_study"]


@dataclass(frozen=True)
class PropagateResult:
    """What the laws do, and whether it had to be found."""

    found: Uncertainty
    path: Path
    fresh: bool

    def overview(self) -> dict[str, Any]:
        """What ``--json`` prints."""
        return {"skipped": self.fresh, "file": str(self.path), **to_json(self.found)}


@checked
def propagate_study(folder: StudyFolder, *, force: bool = False) -> PropagateResult | None:
    """Carry the laws of the study file through the surfaces, unless that is up to date.

    None where no factor has a law: surfaces know nothing of settings, which a run must vary.

    Raises
    ------
    RsmkitError
        For a law that leaves the bounds at the optimum, naming the factor.
    StageError
        If there is no up-to-date fit.
    """
    fitted = folder.fitted()
    question = ask_of(folder, fitted)
    if question is None:
        return None
    known = None if force else folder.uncertainty()
    if known is not None:
        return PropagateResult(known, folder.path / UNCERTAINTY_FILE, True)
    found = propagate(question)
    return PropagateResult(found, folder.keep_uncertainty(found), False)


def ask_of(folder: StudyFolder, fitted: Fitted) -> Question | None:
    """What the study asks of its surfaces; None where no factor has a law."""
    study = folder.study
    laws = study.service.of_factors()
    if laws is None:
        return None
    wanted = study.file.propagation.search
    optima = [optimum for optimum in fitted.optima if not wanted or optimum.name == wanted]
    middle = study.space.clip([factor.domain.middle for factor in study.space])
    return Question(
        fitted.surfaces,
        laws,
        optima[0].best.point if optima else middle,
        optima[0].name if optima else "centre",
        study.file.specifications,
        study.deterministic,
        study.file.propagation,
    )
