"""Documentation site: ``make docs`` builds it in ``build/site`` from the pages as they lie in the repository.

Nothing is fetched while building or reading: theme and search are files of the site itself, and notebooks are
shown with the output they were committed with.
"""

from typing import Any

import rsmkit

project = "rsmkit"
author = "The rsmkit developers"
copyright = author
release = version = rsmkit.__version__

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "sphinx_copybutton",
]
root_doc = "README"
include_patterns = [
    "README.md",
    "CHANGELOG.md",
    "CONTRIBUTING.md",
    "docs/**.md",
    "studies/*.ipynb",
    "studies/reentry/*.ipynb",
    "studies/reentry/RESULTS.md",
]

highlight_language = "none"
html_theme = "furo"
html_title = "rsmkit"
html_show_sourcelink = False
html_copy_source = False

myst_heading_anchors = 3
nb_execution_mode = "off"
suppress_warnings = ["mystnb.unknown_mime_type"]

autodoc_typehints = "none"  # the descriptions name types and shapes
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True}
napoleon_numpy_docstring = True
napoleon_google_docstring = False
napoleon_use_ivar = True

# The README stays free of site directives: the site's table of contents is added to it here.
CONTENTS = {
    "Start": ["docs/concepts", "docs/migrating"],
    "Notebooks": [
        "studies/first_study",
        "studies/your_own_simulator",
        "studies/*",
        "studies/reentry/paper",
        "studies/reentry/*",
    ],
    "Reference": [
        "docs/study-file",
        "docs/commands",
        "docs/artefacts",
        "docs/names",
        "docs/api",
        "docs/autodoc",
        "docs/simulators",
        "docs/couplings",
        "docs/laboratory",
        "docs/report",
        "docs/reliability",
    ],
    "Methods": [
        "docs/mixtures",
        "docs/designs",
        "docs/surfaces",
        "docs/search",
        "docs/uncertainty",
        "docs/verification",
        "docs/explorer",
        "docs/plots",
    ],
    "Re-entry simulator": [
        "docs/aerothermodynamics",
        "docs/flight",
        "docs/validation/README",
        "docs/validation/*",
    ],
    "Project": [
        "docs/benchmarks",
        "CONTRIBUTING",
        "docs/contributing",
        "docs/vision",
        "docs/decisions/*",
        "CHANGELOG",
        "docs/README",
    ],
}


def _add_contents(app: Any, page: str, source: list[str]) -> None:
    if page == root_doc:
        for caption, pages in CONTENTS.items():
            lines = "\n".join(pages)
            source[0] += f"\n```{{toctree}}\n:hidden:\n:glob:\n:caption: {caption}\n\n{lines}\n```\n"


def setup(app: Any) -> None:
    """Connect the table of contents."""
    app.connect("source-read", _add_contents)
