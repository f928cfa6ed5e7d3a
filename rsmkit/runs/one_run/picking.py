"""Numbers out of what a program leaves behind: JSON, text by a pattern, CSV by column and row."""

from __future__ import annotations

import json
import re
import stat
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rsmkit.errors import RsmkitError
from rsmkit.io.tables.code_pages import decoded
from rsmkit.io.tables.csv_tables import LARGEST_FILE_BYTES, parse_table
from rsmkit.runs.one_run.simulator import OutputError
from rsmkit.runs.options import PickOptions, SimulatorOptions

__all__ = ["STDOUT_FILE", "pick_outputs"]

STDOUT_FILE = "stdout.txt"


def pick_outputs(options: SimulatorOptions, folder: Path) -> Mapping[str, Any]:
    """Read a command's results from its folder.

    By rule if the study states rules; else from the JSON file it names; else from the last line that the
    command printed, a JSON object.

    Raises
    ------
    OutputError
        Naming the file and what is wrong with it.
    """
    if options.outputs:
        return {name: _pick(rule, folder, name) for name, rule in options.outputs.items()}
    if options.output_file:
        return _json_object(_read(folder, options.output_file), options.output_file)
    lines = [line for line in _read(folder, STDOUT_FILE).splitlines() if line.strip()]
    if not lines:
        raise OutputError("printed nothing; its last line must be a JSON object of names and numbers")
    return _json_object(lines[-1], "the last line it printed")


def _pick(rule: PickOptions, folder: Path, name: str) -> Any:
    file = rule.file or STDOUT_FILE
    text = _read(folder, file)
    if rule.pattern:
        matches = re.findall(rule.pattern, text, re.MULTILINE)
        if not matches:
            raise OutputError(f"{name}: nothing in {file} matches the pattern {rule.pattern}")
        return _as_number(matches[-1])
    if rule.column:
        return _as_number(_cell(rule, text, file, name))
    value: Any = _json_object(text, file)
    for part in rule.key.split("."):
        if isinstance(value, list) and part.lstrip("-").isdigit() and -len(value) <= int(part) < len(value):
            value = value[int(part)]
        elif isinstance(value, dict) and part in value:
            value = value[part]
        else:
            raise OutputError(f"{name}: {file} has no {rule.key}")
    return value


def _cell(rule: PickOptions, text: str, file: str, name: str) -> str:
    try:
        table = parse_table(text, file, [rule.column], fill=True, by_program=True)
    except RsmkitError as error:
        raise OutputError(f"{name}: {error}") from None
    if rule.column not in table.names:
        have = ", ".join(table.names) or "nothing"
        raise OutputError(f"{name}: {file} has no column {rule.column} (its head is {have:.200})")
    column = table.cells[table.names.index(rule.column)]
    if not -len(column) <= rule.row < len(column):
        raise OutputError(f"{name}: {file} has {len(column)} rows; {rule.column} has no row {rule.row}")
    try:
        return table.plain(column[rule.row])
    except RsmkitError:
        return column[rule.row]


def _as_number(text: str) -> float | str:
    """Read a number as engineers' programs write it, 1.5D-3 included; leave anything else as it is."""
    try:
        return float(re.sub(r"(?<=[\d.])[dD](?=[+-]?\d)", "e", text.strip()))
    except ValueError:
        return text


def _json_object(text: str, where: str) -> dict[str, Any]:
    try:
        data = json.loads(text)
    except (ValueError, RecursionError):
        raise OutputError(f"{where} is not JSON: {text[:80]!r}") from None
    if not isinstance(data, dict):
        raise OutputError(f"{where} is not a JSON object of names and numbers: {text[:80]!r}")
    return data


def _read(folder: Path, name: str) -> str:
    try:
        found = (folder / name).stat()
        size = found.st_size
        if stat.S_ISFIFO(found.st_mode) or stat.S_ISCHR(found.st_mode):
            raise OutputError(f"{name} is not a file")  # and could be read for ever
        if size > LARGEST_FILE_BYTES:
            raise OutputError(
                f"{name} has {size >> 20} MB; results are read from at most {LARGEST_FILE_BYTES >> 20} MB"
            )
        data = (folder / name).read_bytes()
    except OSError as error:
        raise OutputError(f"{name} cannot be read: {error.strerror}") from None
    try:
        text = decoded(data, name)
    except RsmkitError:  # a few odd bytes in what a program printed are nobody's concern
        text = data.decode("utf-8-sig", errors="replace")
    return text.replace("\r\n", "\n").replace("\r", "\n")
