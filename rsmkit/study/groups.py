"""In which random groups the runs of a study were made: whole plots of the design, columns of the sheet."""

from __future__ import annotations

from rsmkit.design.design import Design
from rsmkit.errors import RsmkitError
from rsmkit.runs.record.design_runs import DesignRuns
from rsmkit.study.file import WHOLE_PLOT, Study

__all__ = ["random_labels"]


def random_labels(study: Study, design: Design, evaluation: DesignRuns) -> dict[str, tuple[str, ...]]:
    """Give the group of each usable run, per kind of groups; empty when the study has none.

    What a column of the run sheet says counts; else the block of the run in the design, which is the whole
    plot, or without hard factors the first of ``design.random``. A run that is not of the design, and of
    which no column says more, is a plot of its own.

    Raises
    ------
    RsmkitError
        Naming the column and the run for which it says nothing.
    """
    if not study.random:
        return {}
    planned = {
        run.key: block
        for run, block in zip(evaluation.runs.runs, design.blocks or (0,) * len(design), strict=True)
        if run is not None
    }
    found: dict[str, tuple[str, ...]] = {}
    for name in study.random:
        of_blocks = bool(design.blocks) and name == study.random[0]
        labels = []
        for number, run in enumerate(evaluation.usable.runs, start=1):
            said = run.extras.get(name) if run is not None else None
            if said is None and of_blocks and run is not None:
                said = planned.get(run.key, f"added {number}")
            if said is None or said == "":
                where = "" if run is None else ", ".join(f"{k} = {v}" for k, v in run.factors.items())
                raise RsmkitError(
                    f"design.random names {name}, but the run at {where} says nothing of it: fill the column "
                    f"{name} of the run sheet for every run and record it again"
                    + ("" if name != WHOLE_PLOT else ", or plan again")
                )
            labels.append(f"{said:g}" if isinstance(said, float) else str(said))
        found[name] = tuple(labels)
    return found
