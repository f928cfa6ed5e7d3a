"""The contract of a report writer: what the stages rely on when they call it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from rsmkit.language.space import Factor, Space
from rsmkit.report.findings import Findings
from rsmkit.report.writers import Writer
from rsmkit.runs.record.run import Run
from rsmkit.runs.record.run_table import Runs
from rsmkit.surfaces.polynomial_fit import fit_surface

__all__ = ["check_report_writer"]

HOSTILE = "</script><b>\" & ' = \u2028 \u00e9"


def check_report_writer(writer: Writer, folder: Path) -> None:
    """Assert that a writer of reports keeps the contract: one file, whole, whatever the findings hold.

    Parameters
    ----------
    writer : Writer
        The row to check.
    folder : path
        An empty folder to write into.

    Raises
    ------
    AssertionError
        Saying which part of the contract is broken.
    """
    assert writer.word.isidentifier(), f"{writer.word!r} cannot be typed as one word"
    assert Path(writer.file).name == writer.file, f"{writer.file} is not the name of a file in the folder"
    path = folder / writer.file
    findings = _findings()
    for what, case in (
        ("surfaces alone", findings),
        ("failed runs", replace(findings, failed=3)),
        ("hostile texts", replace(findings, study_name=HOSTILE, titles={"y": HOSTILE})),
        ("no surface yet", replace(findings, surfaces={})),
    ):
        path.write_text("an older report", encoding="utf-8")
        writer.write(case, path)
        assert path.read_bytes() != b"an older report", f"{writer.word} wrote nothing given {what}"
        others = [item.name for item in folder.iterdir() if item != path]
        assert not others, f"{writer.word} left {', '.join(others)} in the folder given {what}"
        first = path.read_bytes()
        writer.write(case, path)
        assert path.read_bytes() == first, (
            f"{writer.word} writes something else the second time, given {what}"
        )


def _findings() -> Findings:
    """A small study of a number, a whole number and a category."""
    space = Space([Factor("x", 0.0, 1.0), Factor("n", 1, 3, integer=True), Factor("c", levels=("a", "b"))])
    points = np.array([[x, n, c] for x in (0.0, 0.5, 1.0) for n in (1.0, 2.0, 3.0) for c in (0.0, 1.0)])
    y = 1.0 + points[:, 0] * points[:, 1] + points[:, 2]
    runs = tuple(
        Run(str(i), "s", {}, space.values(point), 0, "done", {"y": float(value)}, {}, 0.1)
        for i, (point, value) in enumerate(zip(points, y, strict=True))
    )
    return Findings("Study", Runs(space, points, runs), {"y": fit_surface(space, points, y, response="y")})
