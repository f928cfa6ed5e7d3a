"""The explorer page as something to hold: a path that shows itself in a notebook."""

from __future__ import annotations

import sys
from html import escape
from pathlib import PosixPath, WindowsPath

__all__ = ["ExplorerPage"]

HEIGHT = 860
"""Of the frame in a notebook, in pixels."""
ALLOWED = "allow-scripts allow-downloads allow-modals"
"""What the page may do inside its frame: nothing that reaches the notebook around it."""

if sys.platform == "win32":
    _Path = WindowsPath
else:
    _Path = PosixPath


class ExplorerPage(_Path):
    """Where an explorer page is. A notebook shows the page itself, without any server."""

    def _repr_html_(self) -> str | None:
        try:
            text = self.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError):  # it was moved, or is a folder: the path alone is shown
            return None
        if not text.startswith("<!DOCTYPE html>"):
            return None
        # Links inside a page lead to the page around it unless it says where it stands.
        text = text.replace("<head>", '<head>\n<base href="about:srcdoc">', 1)
        return (
            f'<iframe title="{escape(self.name)}" width="100%" height="{HEIGHT}" sandbox="{ALLOWED}" '
            f'allow="clipboard-write" style="border: 0" srcdoc="{escape(text)}"></iframe>'
        )
