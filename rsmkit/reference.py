"""The references of the study file and of the command line, written from the code itself.

``python -m rsmkit.reference study-file`` prints ``docs/study-file.md``, and
``python -m rsmkit.reference commands`` prints ``docs/commands.md``.
"""

from __future__ import annotations

import sys
from collections.abc import Container, Iterable, Mapping
from dataclasses import MISSING, Field, fields, is_dataclass
from textwrap import dedent
from types import NoneType, UnionType
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

import click

from rsmkit.io.tables.tagged_tables import TaggedTable
from rsmkit.study.file import TAGGED, StudyFile

__all__ = ["command_reference", "study_reference"]

HEAD = """# The study file

`study.toml` is the only input of a study. This page is made from the code (`python -m rsmkit.reference
study-file`); what the program accepts is what stands here. An unknown key, a wrong type or a
contradiction is refused, all of them at once.

Names of factors, responses and functions are used in expressions: `minimize = "0.2*axial + 0.7*heat"`,
`subject_to = ["dp_kpa <= 40", "0 <= sag_mm <= 10"]`. Expressions know `+ - * / **`, parentheses, `abs
sqrt exp log log10 sin cos tan tanh min max` and `pi`.
"""


def study_reference() -> str:
    """Write the reference as Markdown."""
    parts = [HEAD, "## Top level", _table(StudyFile, skip_tables=True), *_sections(StudyFile)]
    return "\n\n".join(part.strip() for part in parts) + "\n"


def _sections(kind: Any, within: str = "") -> list[str]:
    """One section per table inside `kind`, and inside those."""
    hints = get_type_hints(kind)
    parts = []
    for item in fields(kind):
        table, heading = _inner_table(hints[item.name], within + item.name)
        if table is not None:
            text = item.metadata["doc"]
            tagged = [known for known in TAGGED if known.base is table]
            defaults = {known.key: f'`"{known.default}"`' for known in tagged}
            parts += [f"## `{heading}`", f"{text[0].upper()}{text[1:]}.", _table(table, defaults=defaults)]
            parts += [part for known in tagged for part in _kinds(known)]
            parts += _sections(table, f"{within}{item.name}.")
    return parts


def _kinds(tagged: TaggedTable) -> list[str]:
    """One section per class of a table whose keys depend on the word of one of them."""
    words: dict[type[Any], list[str]] = {}
    for word, kind in tagged.classes().items():
        words.setdefault(kind, []).append(word)
    shared = {item.name for item in fields(tagged.base)}
    parts = [f"Each `{tagged.key}` reads further keys, and refuses those of others."]
    for kind, own in words.items():
        heading = ", ".join(f'`{tagged.key} = "{word}"`' for word in own)
        parts += [f"### {heading}", (kind.__doc__ or "").split("\n")[0], _table(kind, leave_out=shared)]
    return parts


def _inner_table(hint: Any, name: str) -> tuple[Any, str]:
    """Give the dataclass behind a field and how its table is written in TOML."""
    if get_origin(hint) is dict and is_dataclass(get_args(hint)[1]):
        return get_args(hint)[1], f"[{name}]` one entry per name, `name = {{ ... }}"
    if get_origin(hint) is tuple and is_dataclass(get_args(hint)[0]):
        return get_args(hint)[0], f"[[{name}]]"
    for option in (hint, *get_args(hint)):
        if is_dataclass(option):
            return option, f"[{name}]"
    return None, name


def _table(
    kind: Any,
    *,
    skip_tables: bool = False,
    leave_out: Container[str] = (),
    defaults: Mapping[str, str] | None = None,
) -> str:
    hints = get_type_hints(kind)
    rows = ["| key | value | default | meaning |", "|---|---|---|---|"]
    for item in fields(kind):
        if item.name in leave_out or (skip_tables and _inner_table(hints[item.name], "")[0] is not None):
            continue
        default = (defaults or {}).get(item.name) or _default(item)
        words = item.metadata.get("words")
        value = _listed(words()) if words else _describe(hints[item.name])
        cells = (f"`{item.name}`", value, default, item.metadata["doc"])
        rows.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return "\n".join(rows)


def _describe(hint: Any) -> str:
    words = {str: "text", float: "number", int: "whole number", bool: "true or false"}
    if hint in words:
        return words[hint]
    origin, arguments = get_origin(hint), get_args(hint)
    if origin is Literal:
        return _listed(arguments)
    if origin in (Union, UnionType):
        return " or ".join(dict.fromkeys(_describe(a) for a in arguments if a is not NoneType))
    if origin in (tuple, list):
        return f"list of {_describe(arguments[0])}"
    return "table" if is_dataclass(hint) or origin is dict else str(hint)


def _listed(choices: Iterable[Any]) -> str:
    return ", ".join(f'`"{a}"`' if isinstance(a, str) else f"`{a}`" for a in choices)


def _default(item: Field[Any]) -> str:
    if item.default is MISSING and item.default_factory is MISSING:
        return "required"
    value = item.default if item.default is not MISSING else None
    if value is None or value == () or value == "":
        return ""
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    return f'`"{value}"`' if isinstance(value, str) else f"`{value}`"


COMMANDS_HEAD = """# Commands

This page is made from the code (`python -m rsmkit.reference commands`). STUDY is a folder with a
`study.toml`, or the file itself; by default the current folder. With `--json` exactly one JSON document
goes to standard output and everything for people to standard error. The exit code is 0 when all is
done, 1 for the unexpected, 2 for wrong usage or a wrong study file, 3 when some runs failed, 4 when a
stage is missing or out of date, 5 when a verification is outside the tolerance, 130 after an
interruption (type the command again to go on).
"""

KINDS = {
    "integer range": "N",
    "integer": "N",
    "float": "X",
    "float range": "X",
    "text": "TEXT",
    "names": "NAMES",
}


def command_reference() -> str:
    """Write the reference of the command line as Markdown."""
    from rsmkit.cli import main

    parts = [COMMANDS_HEAD]
    for name, command in main.commands.items():
        arguments = [p for p in command.params if isinstance(p, click.Argument)]
        options = [p for p in command.params if isinstance(p, click.Option)]
        words = [a.human_readable_name.upper() if a.required else f"[{a.name}]".upper() for a in arguments]
        parts += [f"## `{' '.join(['rsmkit', name, *words])}`", *_paragraphs(command.help or "")]
        if options:
            rows = [f"| {_spelling(o)} | {o.help or ''} |" for o in options]
            parts.append("| option | meaning |\n|---|---|\n" + "\n".join(rows))
    return "\n\n".join(part.strip() for part in parts) + "\n"


def _paragraphs(text: str) -> list[str]:
    """Lines run together, but those that click is told to keep (by a backspace) stay as they are."""
    parts = []
    for part in text.split("\n\n"):
        before, keep, lines = part.partition("\b\n")
        parts.append(f"```text\n{dedent(lines).strip()}\n```" if keep else " ".join(before.split()))
    return parts


def _spelling(option: click.Option) -> str:
    names = "`, `".join(option.opts)
    if option.is_flag:
        return f"`{names}`"
    kind = option.type
    value = "|".join(kind.choices) if isinstance(kind, click.Choice) else option.metavar or KINDS[kind.name]
    return f"`{names} {value}`".replace("|", "\\|")


if __name__ == "__main__":
    sys.stdout.write(command_reference() if sys.argv[1:] == ["commands"] else study_reference())
