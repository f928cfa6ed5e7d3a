"""The explorer: one HTML file, without server or network, in which a fitted study can be looked at.

Everything stands in the file: the data as JSON and this package's own scripts (``page/``).
"""

from __future__ import annotations

import json
import re
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import Any

from rsmkit.io.files.atomic_files import write_text
from rsmkit.report.explorer.page_document import page_document
from rsmkit.report.explorer.service_html import service_html
from rsmkit.report.explorer.verdict import verdict_html
from rsmkit.report.findings import Findings

__all__ = ["explorer_html", "write_explorer"]

SCRIPTS = (
    "models.js",
    "student.js",
    "stretches.js",
    "counts.js",
    "mixed.js",
    "processes.js",
    "state.js",
    "format.js",
    "plot.js",
    "charts.js",
    "bands.js",
    "cliffs.js",
    "limits.js",
    "sums.js",
    "slice.js",
    "maps.js",
    "turntable.js",
    "surface.js",
    "goals.js",
    "optimise.js",
    "profiler.js",
    "traces.js",
    "scene.js",
    "contours.js",
    "ternary.js",
    "pareto.js",
    "parallel.js",
    "pins.js",
    "runs.js",
    "equations.js",
    "fit.js",
    "searches.js",
    "refinement.js",
    "uncertainty.js",
    "current.js",
    "views.js",
    "main.js",
)
"""The page's own scripts, in loading order."""

POLICY = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:"
"""Content security policy: the page cannot reach any network."""


STYLES = ("page.css", "fit.css")
"""The page's own styles."""


def write_explorer(path: str | Path, findings: Findings) -> None:
    """Write the explorer page of a study, replacing the file in one step.

    Parameters
    ----------
    path : path
        Usually ``explorer.html`` in the study's folder.
    findings : Findings
        What the study found.
    """
    write_text(Path(path), explorer_html(findings))


def explorer_html(findings: Findings) -> str:
    """Make the text of the explorer page."""
    scripts = [_script(_lean(_asset(name)), name) for name in SCRIPTS]
    if findings.scene:
        scripts.append(
            _script(f"rsmkit.scene = (function () {{\n{findings.scene}\nreturn {{ draw }};\n}})();", "scene")
        )
    parts = {
        "TITLE": escape(findings.study_name),
        "POLICY": escape(POLICY),
        "STYLE": "\n".join(map(_asset, STYLES)),
        "VERDICT": verdict_html(findings),
        "SERVICE": service_html(findings),
        "DATA": embedded_json(page_document(findings)),
        "SCRIPTS": "\n".join(scripts),
    }
    return re.sub(r"\{\{([A-Z]+)\}\}", lambda match: parts[match[1]], _asset("page.html"))


def embedded_json(document: Any) -> str:
    """JSON text that can stand inside a script element whatever texts the document holds."""
    text = json.dumps(document, allow_nan=False, ensure_ascii=False, separators=(",", ":"))
    escapes = {"<": "\\u003c", ">": "\\u003e", "&": "\\u0026", "\u2028": "\\u2028", "\u2029": "\\u2029"}
    return re.sub("[<>&\u2028\u2029]", lambda match: escapes[match[0]], text)


def _asset(name: str) -> str:
    return (files("rsmkit.report") / "page" / name).read_text(encoding="utf-8")


def _lean(script: str) -> str:
    """Leave out indentation and lines that are comments: a sixth of the page's own scripts."""
    lines = (line.strip() for line in script.splitlines())
    return "\n".join(line for line in lines if line and not line.startswith("//"))


def _script(text: str, name: str) -> str:
    return f"<script>\n{_harmless(text)}\n//# sourceURL=rsmkit/{name}\n</script>"


def _harmless(script: str) -> str:
    r"""Keep text from ending its script element; inside JavaScript's texts ``<\/`` means ``</``."""
    return re.sub(r"<(?=/script|!--)", r"<\\", script, flags=re.IGNORECASE)
