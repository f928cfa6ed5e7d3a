"""What the tables of a study file share: how each describes itself and checks itself.

Every table of ``study.toml`` is one frozen dataclass, kept beside the code it steers
(``rsmkit/design/options.py``, ``rsmkit/runs/options.py``, ...). A field's type is what the file may hold, its
default is the file's default, and ``doc(...)`` is its line in the reference.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, asdict, field, fields
from typing import Any, Protocol

from rsmkit.errors import listed

__all__ = ["Options", "doc", "given", "idle_options"]


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
    words = {key: listed([repr(taker) for taker in takers]) for key, takers in used_by.items()}
    return [
        (key, f"has no effect on {selector} = '{chosen}'; leave it out, or take {words[key]}")
        for key, takers in used_by.items()
        if chosen not in takers and set_ones.get(key)
    ]
