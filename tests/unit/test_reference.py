"""Documentation that is made from the code is current; links lead somewhere."""

import re
from pathlib import Path

import pytest

from rsmkit.reference import command_reference, study_reference

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted((ROOT / "docs").rglob("*.md"))]


def test_the_study_file_reference_is_current():
    written = (ROOT / "docs" / "study-file.md").read_text()
    assert written == study_reference(), "run: python -m rsmkit.reference study-file > docs/study-file.md"


def test_the_command_reference_is_current():
    written = (ROOT / "docs" / "commands.md").read_text()
    assert written == command_reference(), "run: python -m rsmkit.reference commands > docs/commands.md"


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)#]+)[^)]*\)", page.read_text()):
        if not target.startswith("http"):
            assert (page.parent / target).exists(), f"{page.name} links to {target}"
