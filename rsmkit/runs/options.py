"""The ``[simulator]`` table of a study file."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass

from rsmkit.io.files.regular_files import stays_inside
from rsmkit.io.option_fields import doc

__all__ = ["PickOptions", "SimulatorOptions"]

Setting = bool | int | float | str | list[bool | int | float | str]


@dataclass(frozen=True)
class PickOptions:
    """Where one number is found in what a command leaves behind: exactly one of key, pattern and column."""

    file: str = doc("file in the run's own folder; by default what the command prints", "")
    key: str = doc("JSON: path of the number, 'summary.drag'", "")
    pattern: str = doc("text: regular expression with one group, the number; its last match counts", "")
    column: str = doc("CSV: head of the column", "")
    row: int = doc("CSV: row below the head, from 0; negative counts from the end", -1)

    def problems(self) -> list[tuple[str, str]]:
        """Report what is wrong beyond types."""
        found = []
        rules = [name for name in ("key", "pattern", "column") if getattr(self, name)]
        if len(rules) != 1:
            found.append(
                ("needs", f"exactly one of key, pattern and column, got {' and '.join(rules) or 'none'}")
            )
        if self.file and not stays_inside(self.file):
            found.append(("file", f"must lie in the run's own folder, got '{self.file}'"))
        if self.pattern:
            try:
                groups = re.compile(self.pattern).groups
                if groups != 1:
                    found.append(
                        ("pattern", f"must have exactly one group (...), the number; it has {groups}")
                    )
            except (re.error, OverflowError, RecursionError) as error:
                found.append(("pattern", f"is not a regular expression: {error}"))
        return found


@dataclass(frozen=True)
class SimulatorOptions:
    """What one run is: a Python function (``run``) or an external program (``command``)."""

    run: str = doc("Python callable, 'module:function', found beside the study file or installed", "")
    command: str | tuple[str, ...] = doc(
        "external program and its arguments, with placeholders {factor}, {setting}, {study}, {folder}, "
        "{python}, {seed}; never given to a shell",
        "",
    )
    deterministic: bool = doc("same input, same output: repeated points are run once", True)
    timeout_s: float | None = doc("a run longer than this is stopped and recorded as timed out", None)
    retries: int = doc("how often a run that failed is tried again at once", 0)
    replicates: int = doc("runs of each point, when the simulator is not deterministic", 1)
    seed: str = doc("keyword by which a Python callable receives each run's own seed", "")
    vectorized: bool = doc("the callable takes arrays, one entry per run, and returns arrays", False)
    batch: int | None = doc("runs handed to a worker at once; by default chosen from their duration", None)
    inputs: dict[str, str] = doc(
        "input files of a command: name in the run's folder = template beside the study file", factory=dict
    )
    output_file: str = doc("JSON file the command writes; by default the last line it prints is JSON", "")
    outputs: dict[str, PickOptions] = doc("responses picked from text, CSV or JSON by a rule", factory=dict)
    success_codes: tuple[int, ...] = doc("exit codes of a command that mean success", (0,))
    environment: dict[str, str] = doc("environment variables added for a command", factory=dict)
    keep_folders: bool = doc("keep the folder runs/<key> of a successful command too", True)
    settings: dict[str, Setting] = doc("passed to every run; part of the run's identity", factory=dict)
    defaults: dict[str, Setting] = doc(
        "what the simulator takes for an argument that it is not given, never passed to it: runs made before "
        "one became a factor or a setting count as runs at this value",
        factory=dict,
    )
    version: int | str = doc(
        "version of the simulator, part of the run's identity: change it after an edit that makes older runs "
        "worthless, and they are made anew; 'code' takes a hash of the program's text, so that any edit does",
        "",
    )

    @property
    def words(self) -> tuple[str, ...]:
        """The command's words; a text is split at blanks outside quotes."""
        return tuple(shlex.split(self.command)) if isinstance(self.command, str) else self.command

    def problems(self) -> list[tuple[str, str]]:
        """Report what is wrong beyond types."""
        return [*self._target_problems(), *self._number_problems(), *self._command_problems()]

    def _target_problems(self) -> Iterator[tuple[str, str]]:
        if bool(self.run) == bool(self.command):
            yield (
                "run",
                (
                    "and command exclude each other; keep one"
                    if self.run
                    else "is missing; name your simulator as 'module:function', or give a command"
                ),
            )
        elif self.run and not re.fullmatch(r"[^\W\d]\w*(\.[^\W\d]\w*)*:[^\W\d]\w*(\.[^\W\d]\w*)*", self.run):
            yield "run", f"must look like 'module:function', got '{self.run}'"
        elif self.command:
            try:
                if not self.words or not all(self.words):
                    yield "command", "has an empty word"
            except ValueError as error:
                yield "command", f"cannot be split into words: {error}"

    def _number_problems(self) -> Iterator[tuple[str, str]]:
        if self.timeout_s is not None and not self.timeout_s > 0:
            yield "timeout_s", f"must be positive, got {self.timeout_s:g}"
        for name, least in (("retries", 0), ("replicates", 1), ("batch", 1)):
            value = getattr(self, name)
            if value is not None and value < least:
                yield name, f"must be at least {least}, got {value}"
        if self.replicates > 1 and self.deterministic:
            yield "replicates", "need deterministic = false: a deterministic simulator repeats itself"
        if self.seed and (not self.seed.isidentifier() or self.seed in self.settings):
            yield "seed", f"must be a keyword of the callable other than the settings, got '{self.seed}'"

    def _command_problems(self) -> Iterator[tuple[str, str]]:
        for name in ("inputs", "outputs", "output_file", "environment"):
            if self.run and getattr(self, name):
                yield name, "belongs to a command, but the simulator is a Python callable"
        for name in ("vectorized", "seed"):
            if self.command and getattr(self, name):
                yield name, "belongs to a Python callable" + " (a command has {seed})" * (name == "seed")
        for name in self.environment:
            if not name or "=" in name:
                yield "environment", f"has an impossible name, '{name}'"
        if self.outputs and self.output_file:
            yield "output_file", "and outputs exclude each other; a rule of outputs names its own file"
        for name in (*self.inputs, *([self.output_file] if self.output_file else [])):
            if not stays_inside(name):
                yield (
                    "inputs" if name in self.inputs else "output_file",
                    (f"must lie in the run's own folder, got '{name}'"),
                )
