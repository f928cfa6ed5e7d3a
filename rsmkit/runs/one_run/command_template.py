"""Placeholders in commands and input files: ``{radius_m}``, ``{radius_m:.4f}``; ``{{x}}`` stands for ``{x}``.

Only a name (and a number format) between braces is a placeholder, so that most braces of input files can stay
as they are. Nothing is evaluated.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

from rsmkit.runs.one_run.simulator import SimulatorError

__all__ = ["fill", "placeholders"]

_PLACEHOLDER = re.compile(r"\{\{(\w+)\}\}|\{([^\W\d]\w*)(?::([^{}\s]*))?\}")


def placeholders(text: str) -> set[str]:
    """Names that a text has in braces."""
    return {match[2] for match in _PLACEHOLDER.finditer(text) if match[2]}


def fill(text: str, values: Mapping[str, object], where: str) -> str:
    """Put values in the place of their names.

    A float is written with the digits that give it back exactly, unless a format follows the colon.

    Raises
    ------
    SimulatorError
        If a placeholder has no value or its format does not fit; `where` says whose text it is.
    """

    def replace(match: re.Match[str]) -> str:
        literal, name, form = match.groups()
        if literal:
            return f"{{{literal}}}"
        if name not in values:
            raise SimulatorError(
                f"{where}: {{{name}}} has no value; there are {', '.join(sorted(values))}. "
                f"Write {{{{{name}}}}} for the text itself."
            )
        value = values[name]
        try:
            return (
                format(value, form) if form else str(value).lower() if isinstance(value, bool) else str(value)
            )
        except (ValueError, TypeError) as error:
            raise SimulatorError(f"{where}: {match[0]} does not fit {value!r}: {error}") from None

    return _PLACEHOLDER.sub(replace, text)
