"""Runs made by hand to see whether the surfaces are right: judged as verified optima are."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from rsmkit.io.json_codec import to_json
from rsmkit.language.space import Value
from rsmkit.runs.record.run import KIND
from rsmkit.runs.record.run_table import Runs
from rsmkit.runs.sheets.hand_runs import CONFIRMATION, place_words
from rsmkit.study.counts import counted_predictors, rate_of
from rsmkit.study.folder import Fitted, StudyFolder
from rsmkit.verification.rivals import Predictor
from rsmkit.verification.verification import Comparison

__all__ = ["ConfirmationRun", "confirmation_runs", "overview"]


@dataclass(frozen=True)
class ConfirmationRun:
    """One run that the surfaces were not fitted to, against what they predict there.

    Parameters
    ----------
    factors : dict
        Where it was made.
    responses : dict of str to Comparison
        Predicted and measured, of those that were measured.
    verdict : str
        ``CONFIRMED`` when every measured response lies in its prediction interval, or within the tolerance
        where there is none.
    sentence : str
        The verdict in words.
    """

    factors: dict[str, Value]
    responses: dict[str, Comparison]
    verdict: Literal["CONFIRMED", "NOT CONFIRMED"]
    sentence: str


def overview(runs: Sequence[ConfirmationRun]) -> dict[str, Any]:
    """What ``--json`` prints of them; nothing where there is none."""
    return {"confirmation_runs": to_json(tuple(runs))} if runs else {}


def confirmation_runs(folder: StudyFolder, fitted: Fitted) -> tuple[ConfirmationRun, ...]:
    """Judge every recorded confirmation run that was not excluded."""
    if folder.study.file.simulator is not None:
        return ()
    options, found = folder.study.file.verify, []
    for run in folder.journal.load().values():
        if not run.by_hand or run.extras.get(KIND) != CONFIRMATION or run.excluded:
            continue
        point = folder.study.space.point(run.made_at)[None]
        made = Runs(folder.study.space, point, (run,), folder.study.responses)
        predictors: dict[str, Predictor] = {
            **fitted.surfaces,
            **counted_predictors(folder.study, fitted.surfaces, made),
        }
        compared = {}
        for name, predictor in predictors.items():
            actual = rate_of(folder.study, name, run)
            if math.isfinite(actual):
                mean, low, high = predictor.predict(point, interval=options.confidence)
                least, most = (float(end[0]) if math.isfinite(end[0]) else None for end in (low, high))
                known = fitted.runs.y(name)
                known = known[np.isfinite(known)]
                spread = float(np.median(known) - known.min()) or float(np.ptp(known))
                compared[name] = Comparison(float(mean[0]), actual, least, most, spread or None)
        if compared:
            found.append(_judged(run.made_at, compared, options.tolerance_pct, options.confidence))
    return tuple(found)


def _judged(
    factors: dict[str, Value], compared: dict[str, Comparison], tolerance_pct: float, confidence: float
) -> ConfirmationRun:
    wrong = {
        name: item
        for name, item in compared.items()
        if not (item.within(tolerance_pct) if item.inside is None else item.inside)
    }
    if wrong:
        told = [f"{name} is {c.actual:.5g}, predicted {_range(c)}" for name, c in wrong.items()]
        sentence = f"at {place_words(factors)}: {' and '.join(told)}"
        return ConfirmationRun(factors, compared, "NOT CONFIRMED", sentence)
    told = [f"{name} is {c.actual:.5g}, predicted {c.predicted:.5g}" for name, c in compared.items()]
    sentence = f"at {place_words(factors)}: {', '.join(told)}; inside the {100 * confidence:g} % intervals"
    return ConfirmationRun(factors, compared, "CONFIRMED", sentence)


def _range(item: Comparison) -> str:
    between = "" if item.low is None else f" ({item.low:.5g} to {item.high:.5g})"
    return f"{item.predicted:.5g}{between}"
