"""What the tables of a study file share: how each describes itself and checks itself.

Every table of ``study.toml`` is one frozen dataclass, kept beside the code it steers
(``rsmkit/design/options.py``, ``rsmkit/runs/options.py``, ...). A field's type is what the file may hold, its
default is the file's default, and ``doc(...)`` is its line in the reference.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, asdict, field, fields
from typing import Any, Literal, Protocol, TypeVar, cast, get_args, get_origin, get_type_hints

from rsmkit.errors import RsmkitError, one_of

__all__ = ["Options", "doc", "given", "idle_options", "make_options"]

Made = TypeVar("Made", bound="Options")


class Options(Protocol):
    """A table of the study file."""

    def problems(self) -> list[tuple[str, str]]:
        """Report what is wrong beyond types: pairs of (key, message), empty when all is well."""
        ...


def doc(
    text: str,
    default: Any = MISSING,
    *,
    factory: Any = MISSING,
    words: Callable[[], Sequence[str]] | None = None,
) -> Any:
    """Make a dataclass field that carries its own line of the study-file reference.

    `words` gives what a text may say where a register knows that; the table's `problems` check it.
    """
    metadata = {"doc": text, "words": words}
    if factory is not MISSING:
        return field(default_factory=factory, metadata=metadata)
    return field(default=default, metadata=metadata)


def make_options(kind: type[Made], values: Mapping[str, Any]) -> Made:
    """Make a table of options from keywords of a Python call, checked as the study file would be.

    Raises
    ------
    RsmkitError
        For an option that does not exist, a word that means nothing, or a contradiction.
    """
    hints = get_type_hints(kind)
    for key, value in values.items():
        hint = hints[one_of("option", key, [item.name for item in fields(cast(Any, kind))])]
        if get_origin(hint) is Literal and value not in get_args(hint):
            words = [str(word) for word in get_args(hint)]
            one_of(key, value if isinstance(value, str) else repr(value), words)
    options = kind(**values)
    if problems := options.problems():
        raise RsmkitError("; ".join(f"{key}: {message}" for key, message in problems))
    return options


def given(options: Any) -> dict[str, Any]:
    """Give the fields of a table that differ from their defaults, as JSON values.

    This is what an artefact was made from: an option that a later version adds changes nothing for a study
    that does not use it.
    """
    plain = asdict(options)
    chosen = {}
    for item in fields(options):
        default = item.default if item.default_factory is MISSING else item.default_factory()
        if default is MISSING or getattr(options, item.name) != default:
            chosen[item.name] = plain[item.name]
    made: dict[str, Any] = json.loads(json.dumps(chosen))
    return made


def idle_options(options: Any, selector: str, used_by: Mapping[str, Sequence[str]]) -> list[tuple[str, str]]:
    """Report options that were set although the chosen kind or model does not read them.

    Parameters
    ----------
    options : dataclass
        The table.
    selector : str
        The field that chooses.
    used_by : mapping of str to sequence of str
        For each option that only some choices read, these choices.
    """
    chosen, set_ones = getattr(options, selector), given(options)
    return [
        (key, f"has no effect on {selector} = '{chosen}'; leave it out, or take {_listed(takers)}")
        for key, takers in used_by.items()
        if chosen not in takers and set_ones.get(key)
    ]


def _listed(words: Sequence[str]) -> str:
    *first, last = (f"'{word}'" for word in words)
    return f"{', '.join(first)} or {last}" if first else last
