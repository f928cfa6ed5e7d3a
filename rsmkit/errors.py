"""Errors that are meant for the person at the keyboard, and the exit codes that go with them.

Everything rsmkit raises on purpose derives from :class:`RsmkitError`; its message says what is wrong, where,
and what to do next. Anything else that escapes is a defect and ends with exit code 1.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from difflib import get_close_matches
from typing import ClassVar, TypeVar

__all__ = [
    "DamagedError",
    "FitError",
    "RsmkitError",
    "RunsFailedError",
    "StageError",
    "StudyError",
    "did_you_mean",
    "listed",
    "nearest",
    "one_of",
    "readable",
]

Word = TypeVar("Word")

EXIT_OK = 0
EXIT_UNEXPECTED = 1
EXIT_USAGE = 2
EXIT_RUNS_FAILED = 3
EXIT_STAGE = 4
EXIT_VERIFICATION = 5
EXIT_INTERRUPTED = 130

LONGEST_LINE = 500
MOST_MISTAKES = 8
"""Mistakes in a damaged file that a message spells out."""
LONGEST_MISTAKE = 160
"""Characters of each."""


def readable(text: str) -> str:
    """Make a text of unknown origin fit for a terminal: control characters as escapes, long lines cut."""
    lines = []
    for line in text.split("\n"):
        shown = line if len(line) <= LONGEST_LINE else line[: LONGEST_LINE - 3] + "..."
        if not shown.isprintable():
            shown = "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in shown)
        lines.append(shown)
    return "\n".join(lines)


class RsmkitError(Exception):
    """Base of all errors with a message for people; wrong input unless a subclass says otherwise."""

    exit_code: ClassVar[int] = EXIT_USAGE

    def __init__(self, message: str) -> None:
        super().__init__(readable(message))


class StudyError(RsmkitError):
    """The study file is wrong. Carries every problem found, not only the first.

    Parameters
    ----------
    source : str
        File the problems were found in, as the user would name it.
    problems : sequence of str
        One line each: the key, what is wrong, what to do.
    """

    def __init__(self, source: str, problems: Sequence[str]) -> None:
        self.source = source
        self.problems = tuple(readable(problem.replace("\n", "\\n")) for problem in problems)
        super().__init__("\n".join(f"{source}: {problem}" for problem in self.problems))


class DamagedError(RsmkitError):
    """A file that rsmkit wrote cannot be read. Carries every mistake found, not only the first.

    Parameters
    ----------
    source : path or str
        The file as the user knows it.
    mistakes : sequence of str
        One line each, beginning with the key's path.
    remedy : str
        What to do; ends the first line.
    cause : Exception, optional
        What knows the place of every mistake, when this is part of a larger file.
    """

    def __init__(
        self, source: object, mistakes: Sequence[str], remedy: str, cause: Exception | None = None
    ) -> None:
        self.mistakes, self.cause = tuple(mistakes), cause
        shown = [_shortened(mistake.replace("\n", "\\n")) for mistake in mistakes[:MOST_MISTAKES]]
        if len(mistakes) == 1:
            super().__init__(f"{source}: damaged ({shown[0]}). {remedy}")
            return
        more = [f"and {len(mistakes) - len(shown)} more"] if len(mistakes) > len(shown) else []
        head = f"{source}: damaged ({len(mistakes)} mistakes). {remedy}"
        super().__init__("\n".join([head, *(f"  {text}" for text in [*shown, *more])]))


def _shortened(mistake: str) -> str:
    return mistake if len(mistake) <= LONGEST_MISTAKE else f"{mistake[: LONGEST_MISTAKE - 3]}..."


class RunsFailedError(RsmkitError):
    """Some simulator runs failed; the finished ones are kept."""

    exit_code = EXIT_RUNS_FAILED


class StageError(RsmkitError):
    """An earlier stage is missing or out of date."""

    exit_code = EXIT_STAGE


class FitError(RsmkitError):
    """The surface cannot be estimated from these runs (too few, singular, aliased)."""

    exit_code = EXIT_STAGE


def one_of(name: str, value: Word, allowed: Iterable[str]) -> Word:
    """Give a word back if it is one of those allowed, else refuse it and name the nearest one.

    Parameters
    ----------
    name : str
        What the word is for, as the user writes it: ``"star"``, ``"design.kind"``.
    value : str
        What the user gave.
    allowed : iterable of str
        The words that mean something, in the order in which they are to be read.

    Raises
    ------
    RsmkitError
        With all allowed words, and the nearest one where one is near.

    Examples
    --------
    >>> one_of("star", "faced", ["circumscribed", "inscribed", "faced"])
    'faced'
    >>> one_of("cube", "ful", ["full", "fraction"])
    Traceback (most recent call last):
    ...
    rsmkit.errors.RsmkitError: cube must be full or fraction; got 'ful', did you mean 'full'?
    """
    words = [*allowed]
    if isinstance(value, str) and value in words:
        return value
    raise RsmkitError(f"{name} must be {listed(words)}; got {value!r:.60}{did_you_mean(value, words)}")


def listed(words: Sequence[str]) -> str:
    """Give alternatives as people write them: ``a, b or c``."""
    *first, last = words or ["nothing"]
    return f"{', '.join(first)} or {last}" if first else last


def did_you_mean(value: object, known: Iterable[str]) -> str:
    """End a message about a wrong word with the nearest known one, where one is near."""
    near = nearest(value, known) if isinstance(value, str) else None
    return f", did you mean '{near}'?" if near else ""


def nearest(word: str, known: Iterable[str]) -> str | None:
    """Give the known word that is most like this one, whatever its case; None when none is like it."""
    lower = {each.lower(): each for each in known}
    close = get_close_matches(word.lower(), lower, n=1)
    return lower[close[0]] if close else None
