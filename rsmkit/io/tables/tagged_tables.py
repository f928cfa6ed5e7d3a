"""Tables of a study file whose keys depend on the word that one of them holds: ``[design] kind``.

Each word has a class of its own. A key that belongs to other words is refused with these words, which a
converter that only knows one class at a time could not name.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from typing import Any

from cattrs import AttributeValidationNote, ClassValidationError, Converter

from rsmkit.errors import RsmkitError, listed, one_of

__all__ = ["TaggedTable"]


@dataclass(frozen=True)
class TaggedTable:
    """A table that is read into one of several dataclasses.

    Parameters
    ----------
    base : type
        What the classes share, also the type of the field that holds the table.
    key : str
        The key that says which class.
    default : str
        Its value when it is left out.
    classes : callable
        Gives the class for every word, in reading order; asked anew for every table.
    word_of : callable
        The word that a value of the key stands for.
    """

    base: type[Any]
    key: str
    default: str
    classes: Callable[[], Mapping[str, type[Any]]]
    word_of: Callable[[str], str]

    def register(self, converter: Converter) -> None:
        """Teach a converter to read the table; by identity, for the classes derive from the base."""
        converter.register_structure_hook_func(
            lambda kind: kind is self.base, lambda table, _: self._read(converter, table)
        )

    def _read(self, converter: Converter, table: Any) -> Any:
        classes = self.classes()
        if not isinstance(table, dict):
            return converter.structure(table, next(iter(classes.values())))  # which says: must be a table
        tag = table.get(self.key, self.default)
        try:
            chosen = classes[one_of(self.key, self.word_of(converter.structure(tag, str)), classes)]
        except (ValueError, RsmkitError) as error:
            text = str(error).removeprefix(f"{self.key} ")
            raise ClassValidationError("no such table", [_at(self.key, text)], self.base) from None
        foreign = {key: takers for key in table if (takers := self._takers(key)) and chosen not in takers}
        errors: list[Exception] = [
            _at(key, f"has no effect on {self.key} = '{tag}'; leave it out, or take {self._listed(takers)}")
            for key, takers in foreign.items()
        ]
        mine = {key: value for key, value in table.items() if key not in foreign}
        made = None
        try:
            made = converter.structure(mine | {self.key: tag}, chosen)
        except ClassValidationError as error:
            errors = [*error.exceptions, *errors]
        if errors:
            raise ClassValidationError("wrong keys", errors, chosen)
        return made

    def _takers(self, key: str) -> list[type[Any]]:
        """The classes that have the key."""
        return [kind for kind in self.classes().values() if key in (item.name for item in fields(kind))]

    def _listed(self, takers: list[type[Any]]) -> str:
        """The words of these classes."""
        return listed([f"'{word}'" for word, kind in self.classes().items() if kind in takers])


def _at(key: str, message: str) -> ValueError:
    """Make an error of one key, in the form in which cattrs notes it."""
    error = ValueError(message)
    error.add_note(AttributeValidationNote(message, key, Any))
    return error
