"""Public names with signature and one sentence, from the code: ``python docs/names.py > docs/names.md``."""

from __future__ import annotations

import inspect
import re
import sys
from types import ModuleType
from typing import Any

import rsmkit
import sim

HEAD = """# Public names

`import rsmkit as rk` and `import sim` cost nothing; each name is loaded when it is first used. What is listed
here stays; what lies deeper may move. This page is made from the code (`python docs/names.py >
docs/names.md`); `help(rk.ccd)` tells everything.
"""
ROOMS = {
    "language": "The words of the field",
    "design": "Designs",
    "runs": "Runs",
    "surfaces": "Surfaces",
    "optimum": "Search",
    "verification": "Verification",
    "variation": "Uncertainty",
    "study": "Studies",
    "stages": "The stages of a study",
    "api": "The stages as functions",
    "scikit_learn": "scikit-learn",
    "errors": "Errors",
}
FLOORS = {
    "reentry": "The re-entry vehicle",
    "flight": "Flight",
    "air": "Air and wind",
    "body": "Bodies",
    "aero": "Aerodynamics",
    "settings": "Settings",
    "plots": "Plots",
    "core": "Errors",
}


def page() -> str:
    """The page as Markdown."""
    parts = [HEAD, "## `rsmkit`", *_sections(rsmkit, ROOMS), "## `sim`", *_sections(sim, FLOORS)]
    return "\n\n".join(part.strip() for part in parts) + "\n"


def _sections(door: Any, headings: dict[str, str]) -> list[str]:
    parts = []
    for room, heading in headings.items():
        names = [name for name, home in sorted(door.HOMES.items()) if home.split(".")[1] == room]
        rows = [f"| {_signature(name, getattr(door, name))} | {_sentence(door, name)} |" for name in names]
        parts.append(f"### {heading}\n\n| name | |\n|---|---|\n" + "\n".join(rows))
    modules = [
        f"- `{door.__name__}.{name}`: {_first(getattr(door, name))}" for name in getattr(door, "MODULES", ())
    ]
    return [*parts, *(["### Modules\n\n" + "\n".join(modules)] if modules else [])]


def _signature(name: str, thing: Any) -> str:
    if not callable(thing) or (isinstance(thing, type) and issubclass(thing, Exception)):
        return f"`{name}`"
    try:
        parameters = [p for p in inspect.signature(thing).parameters.values() if not p.name.startswith("_")]
    except ValueError:
        return f"`{name}`"
    shown = []
    for parameter in parameters:
        if (
            parameter.kind is parameter.KEYWORD_ONLY
            and "*" not in shown
            and not any(s[0] == "*" for s in shown)
        ):
            shown.append("*")
        stars = {parameter.VAR_POSITIONAL: "*", parameter.VAR_KEYWORD: "**"}.get(parameter.kind, "")
        default = "" if parameter.default is parameter.empty else "=..."
        shown.append(f"{stars}{parameter.name}{default}")
    return f"`{name}({', '.join(shown)})`"


def _sentence(door: Any, name: str) -> str:
    thing = getattr(door, name)
    if callable(thing) or isinstance(thing, ModuleType):
        return _first(thing)
    return f"A {type(thing).__name__}." if type(thing).__module__ != "builtins" else f"`{thing!r:.60}`."


def _first(thing: Any) -> str:
    """First sentence of a docstring, fit for a table."""
    text = " ".join((inspect.getdoc(thing) or "").split("\n\n")[0].split())
    text = re.sub(r":\w+:`~?([^`]*)`", r"`\1`", text).replace("``", "`")
    return text.replace("|", "\\|")


if __name__ == "__main__":
    sys.stdout.write(page())
