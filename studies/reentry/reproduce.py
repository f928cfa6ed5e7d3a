"""Make the notebooks and RESULTS.md again from their sources.

    python studies/reentry/reproduce.py                 # a minute on a quiet machine
    python studies/reentry/reproduce.py --fly           # fly the kept flights again first
    python studies/reentry/reproduce.py first_study.py  # only these notebooks

Needs the extra packages: ``pip install "rsmkit[notebooks]"``.
"""

from __future__ import annotations

import sys
from pathlib import Path

import jupytext
import nbformat
from nbclient import NotebookClient

STUDY = Path(__file__).parent
NOTEBOOKS = (STUDY / "paper.py", STUDY / "holdout.py", *sorted(STUDY.parent.glob("*.py")))


def main() -> None:
    arguments = sys.argv[1:]
    if "--fly" in arguments:
        import fly  # and with it all of rsmkit and sim, which the notebooks import for themselves

        arguments.remove("--fly")
        for part in fly.PARTS:
            fly.make(part)
    for source in map(Path, arguments or NOTEBOOKS):
        execute(source)
        print(source.with_suffix(".ipynb"))


def execute(source: Path) -> Path:
    """Execute a notebook kept as percent-format Python and write the ``.ipynb`` beside it."""
    notebook = jupytext.read(source)
    NotebookClient(notebook, timeout=600, resources={"metadata": {"path": str(source.parent)}}).execute()
    for number, cell in enumerate(notebook.cells, start=1):
        cell["id"] = f"cell-{number}"  # the same on every run, so that only results make a difference
        cell.metadata.pop("execution", None)
        for output in cell.get("outputs", ()):
            if len(output.get("data", {})) > 1:
                output["data"].pop("text/plain", None)  # the same again, for terminals
    target = source.with_suffix(".ipynb")
    nbformat.write(notebook, target)
    return target


if __name__ == "__main__":
    main()
