"""The reference as plain Markdown, from the code: ``python docs/api.py > docs/api.md``.

What is in it, and in which order, is said by the directives in ``docs/autodoc.md``.
"""

from __future__ import annotations

import importlib
import inspect
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

HEAD = """# Python reference

`import rsmkit as rk` costs nothing; each name is loaded when it is first used. Every line is a signature and
one sentence; [the site](autodoc.md) built by `make docs` shows the whole descriptions, and so does
`help(rk.ccd)`. What can be had from `rk` itself is listed in [names.md](names.md). This page is made from the
code (`python docs/api.py > docs/api.md`).
"""
LIST = Path(__file__).with_name("autodoc.md")
DIRECTIVE = re.compile(r"^\.\. (automodule|autoclass|autofunction):: ([\w.]+)$", re.MULTILINE)


def page() -> str:
    """The page as Markdown."""
    parts = [HEAD]
    _, *sections = re.split(r"^## (.*)$", LIST.read_text(encoding="utf-8"), flags=re.MULTILINE)
    for title, text in zip(sections[::2], sections[1::2], strict=True):
        parts.append(f"## {title}")
        lines = [line for kind, name in DIRECTIVE.findall(text) for line in _lines(kind, name)]
        parts.append("\n".join(lines))
    return "\n\n".join(part.strip() for part in parts) + "\n"


def _lines(kind: str, name: str) -> Iterator[str]:
    if kind == "automodule":
        module = importlib.import_module(name)
        yield f"\n### `{name}`\n\n{_sentence(module)}\n"
        members = getattr(module, "__all__", None) or [n for n in vars(module) if n[0] != "_"]
        for member in members:
            yield from _thing(member, getattr(module, member))
    else:
        module_name, _, member = name.rpartition(".")
        yield from _thing(member, getattr(importlib.import_module(module_name), member))


def _thing(name: str, thing: Any) -> Iterator[str]:
    """One line, and one for each public method of a class."""
    if inspect.ismodule(thing) or not (inspect.getdoc(thing) and callable(thing)):
        return
    yield f"- `{name}{_signature(thing)}`: {_sentence(thing)}"
    if not inspect.isclass(thing) or issubclass(thing, Exception):
        return
    for method, made in vars(thing).items():
        made = made.fget if isinstance(made, property) else getattr(made, "__func__", made)
        if method[0] == "_" or not inspect.isfunction(made) or not made.__doc__:
            continue
        is_property = isinstance(vars(thing)[method], property)
        yield f"  - `.{method}{'' if is_property else _signature(made)}`: {_sentence(made)}"


def _signature(thing: Any) -> str:
    """Names and plain defaults; types are in the descriptions."""
    if inspect.isclass(thing) and issubclass(thing, Exception):
        return ""
    try:
        parameters = inspect.signature(thing).parameters.values()
    except (ValueError, TypeError):
        return ""
    shown: list[str] = []
    for p in parameters:
        if p.name in ("self", "cls") or p.name[0] == "_":
            continue
        if p.kind is p.KEYWORD_ONLY and not any(s[0] == "*" and s[1:2] != "*" for s in shown):
            shown.append("*")
        stars = {p.VAR_POSITIONAL: "*", p.VAR_KEYWORD: "**"}.get(p.kind, "")
        shown.append(f"{stars}{p.name}{'' if p.default is p.empty else f'={_default(p.default)}'}")
    return f"({', '.join(shown)})"


def _default(value: Any) -> str:
    plain = isinstance(value, bool | int | float | str | None) or value in ((), [], {})
    return repr(value) if plain else "..."


def _sentence(thing: Any) -> str:
    """The first paragraph of its description."""
    text = " ".join((inspect.getdoc(thing) or "").split("\n\n")[0].split())
    return re.sub(r":\w+:`~?([^`]*)`", r"`\1`", text).replace("``", "`")


if __name__ == "__main__":
    sys.stdout.write(page())
