"""In which random groups and in which order the runs of a study were made."""

from __future__ import annotations

from collections.abc import Iterable

from rsmkit.design.design import Design
from rsmkit.errors import RsmkitError
from rsmkit.runs.record.design_runs import DesignRuns
from rsmkit.study.file import WHOLE_PLOT, Study

__all__ = ["places_in_time", "random_labels"]


def places_in_time(study: Study, evaluation: DesignRuns, recorded: Iterable[str]) -> dict[str, int]:
    """Give the place of each run made by hand in the order they were made in, from 1, by its key.

    Empty where a simulator makes the runs, which does not change in the course of them.

    Parameters
    ----------
    study : Study
    evaluation : DesignRuns
        The runs in question.
    recorded : iterable of str
        Keys of all runs, those that were recorded first before others.
    """
    if study.file.simulator is not None:
        return {}
    tables = [evaluation.runs, *([evaluation.added] if evaluation.added else [])]
    own = {run.key for table in tables for run in table.runs if run is not None}
    return {key: place for place, key in enumerate((key for key in recorded if key in own), start=1)}


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
