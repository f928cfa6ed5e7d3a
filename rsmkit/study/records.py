"""What each artefact of a study was made from: when that changes, the artefact is out of date."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any

from rsmkit.design.design import Design
from rsmkit.errors import RsmkitError
from rsmkit.io.files.digests import digest, digest_of_all
from rsmkit.io.files.regular_files import inside
from rsmkit.io.option_fields import given
from rsmkit.io.tables.csv_tables import read_table_text
from rsmkit.runs.record.design_runs import DesignRuns
from rsmkit.runs.record.row_states import RowStates
from rsmkit.runs.record.run import Run
from rsmkit.study.counts import sizes_taken
from rsmkit.study.file import Study
from rsmkit.study.groups import random_labels
from rsmkit.verification.options import VerifyOptions

__all__ = [
    "fit_record",
    "measured",
    "measured_in_rows",
    "plan_record",
    "search_record",
    "uncertainty_record",
    "verify_record",
]


def plan_record(study: Study) -> dict[str, Any]:
    """Everything in the study file that the design depends on."""
    return {
        "factors": {name: given(options) for name, options in study.file.factors.items()},
        "functions": study.file.functions if study.file.design.subject_to else {},
        "design": study.file.design.record | _table_digests(study),
        "surface": {"order": study.file.surface.order}
        | ({"terms": list(study.file.surface.terms)} if study.file.surface.terms else {}),
    } | _mixture_record(study)


def measured(study: Study, design: Design, evaluation: DesignRuns) -> dict[str, str]:
    """Hashes of what a fit takes from the runs."""
    groups = random_labels(study, design, evaluation)
    done = (run for run in evaluation.usable.runs if run is not None)
    taken = {"runs": digest_of_all(_measured(run, study.responses) for run in done)}
    if study.failures:
        failed = evaluation.runs.failures()
        taken["failed"] = digest(sorted(run.key for run in failed))
    sizes = sizes_taken(study, evaluation.usable)
    taken |= {"sizes": digest(sizes)} if sizes else {}
    return taken | ({"groups": digest(groups)} if groups else {})


def measured_in_rows(rows: RowStates) -> dict[str, str]:
    """The same of runs of which only what they measured is at hand; empty where it is not."""
    if rows.values is None:
        return {}
    done = rows.done
    pairs = zip(rows.keys[done], rows.values[done], strict=True)
    return {"runs": digest_of_all([f"{int(key):016x}", *values.tolist()] for key, values in pairs)}


def fit_record(study: Study, taken: Mapping[str, str]) -> dict[str, Any]:
    """Everything the surfaces depend on; `taken` are hashes of what they take from the runs."""
    return (
        {
            "runs": taken["runs"],
            "surface": given(study.file.surface),
            "responses": list(study.responses),
            "objectives": sorted({text for item in study.searches for text in item.objectives}),
        }
        | {name: value for name, value in taken.items() if name != "runs"}
        | ({"counts": {name: o.distribution for name, o in study.counts.items()}} if study.counts else {})
        | ({"failures": list(study.failures)} if study.failures else {})
        | _mixture_record(study)
    )


def _measured(run: Run, responses: Sequence[str]) -> list[Any]:
    """What a fit takes from a run; of one made by hand also where it really was made, if not as planned."""
    values = [value if math.isfinite(value := run.value(name)) else None for name in responses]
    away = [] if run.made_at == run.factors else [run.made_at]
    return [run.key, *values, *away]


def search_record(study: Study, model_made_from: Any) -> dict[str, Any]:
    """Everything the optima depend on."""
    return (
        {
            "model": digest(model_made_from),
            "factors": {name: given(options) for name, options in study.file.factors.items()},
            "functions": study.file.functions,
            "search": {options.name: given(options) for options in study.searches},
        }
        | _mixture_record(study)
        | (_laws_record(study) if any(o.service for o in study.searches) else {})
    )


def uncertainty_record(study: Study, optimum: Any) -> dict[str, Any]:
    """Everything that the carried laws depend on."""
    return {"optimum": digest(optimum), "propagation": given(study.file.propagation)} | _laws_record(study)


def _mixture_record(study: Study) -> dict[str, Any]:
    """The mixtures, where there are any: records of studies without stay what they were."""
    mixtures = [given(mixture) for mixture in study.file.mixture]
    return {"mixture": mixtures} if mixtures else {}


def _laws_record(study: Study) -> dict[str, Any]:
    """The laws of service and the specifications."""
    file = study.file
    samples = {name: options.file for name, options in file.uncertainty.items() if options.file}
    return {
        "uncertainty": {name: given(options) for name, options in file.uncertainty.items()},
        "correlation": given(file.correlation) if file.correlation else {},
        "specifications": {name: given(options) for name, options in file.specifications.items()},
        "samples": {name: digest(read_table_text(study.folder / path)) for name, path in samples.items()},
    }


def verify_record(optimum: Any, options: VerifyOptions) -> dict[str, Any]:
    """Everything the verification depends on."""
    return {"optimum": digest(optimum), "verify": given(options)}


def _table_digests(study: Study) -> dict[str, str]:
    """Hashes of the user's own tables, so that editing one makes the design stale."""
    record = {}
    for key, name in study.file.design.tables.items():
        if name:
            try:
                path = inside(study.folder, name, "design")
                text = read_table_text(path)
            except RsmkitError as error:
                raise RsmkitError(f"design: {str(error).removeprefix('design: ')}") from None
            with suppress(UnicodeDecodeError):  # as ever, so that no hash on a disk changes
                text = path.read_text(encoding="utf-8")
            record[key] = digest(text)
    return record
