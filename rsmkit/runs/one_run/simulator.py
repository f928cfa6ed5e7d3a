"""The simulator a study names: how it is found, what identifies it, what it must return.

The contract of a Python callable: keywords in (the factors and the settings), a mapping out (response name ->
number; other keys are kept with the run). It runs in worker processes and is found there by its name, so
nothing is ever pickled but names and numbers. A function ``warm_up`` in its module is called once in every
worker before the first run, with the settings.
"""

from __future__ import annotations

import hashlib
import importlib
import importlib.util
import math
import shlex
import sys
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

from rsmkit.errors import RsmkitError
from rsmkit.io.files.digests import digest
from rsmkit.io.files.regular_files import inside, read_regular
from rsmkit.runs.one_run.returned_values import MOST_VALUES, number_of, plain_values
from rsmkit.runs.options import SimulatorOptions
from rsmkit.runs.record.run import LABORATORY

__all__ = ["Output", "OutputError", "Simulator", "SimulatorError", "describe", "read_output"]


CODE = "code"
"""The version that is a hash of the program."""


class SimulatorError(RsmkitError):
    """The simulator cannot be found or is not something that can be called."""


class OutputError(ValueError):
    """A run came back with something unusable; ``extras`` holds what could be kept."""

    def __init__(self, message: str, extras: dict[str, Any] | None = None) -> None:
        super().__init__(message)
        self.extras = extras or {}


class Output(NamedTuple):
    """What one run returned, sorted: the numbers asked for, and the rest."""

    responses: dict[str, float]
    extras: dict[str, Any]


@dataclass(frozen=True)
class Simulator:
    """A simulator named by a study, with the folder it is looked for in first.

    Parameters
    ----------
    options : SimulatorOptions
        The study's ``[simulator]`` table.
    folder : path
        The study's folder; modules beside the study file are found there.
    """

    options: SimulatorOptions
    folder: Path

    @cached_property
    def identity(self) -> str:
        """Text that identifies the simulator in keys and in the journal.

        For a command it has a hash of everything in the study that shapes its results: templates of input
        files, rules for outputs, environment. It ends with the version, where the study names one; after
        "code" with a hash of the program itself.
        """
        version = self.options.version
        if version == "":
            return self._name
        return f"{self._name}, {f'code {code_digest(self)}' if version == CODE else f'version {version}'}"

    @property
    def _name(self) -> str:
        if not self.options.command:
            return self.options.run or LABORATORY
        outputs = {name: vars(rule) for name, rule in self.options.outputs.items()}
        shape = [self.templates(), outputs, self.options.output_file, self.options.environment]
        return f"{shlex.join(self.options.words)} #{digest(shape)[:8]}"

    def templates(self) -> dict[str, str]:
        """Read the templates of a command's input files, by file name in the run's folder.

        Raises
        ------
        SimulatorError
            If one cannot be read.
        """
        texts = {}
        for name, template in self.options.inputs.items():
            try:
                text = read_regular(inside(self.folder, template, "simulator.inputs")).decode("utf-8")
                texts[name] = text.replace("\r\n", "\n").replace("\r", "\n")
            except RsmkitError as error:
                raise SimulatorError(str(error)) from None
            except (OSError, UnicodeDecodeError) as error:
                reason = error.strerror if isinstance(error, OSError) else "it is not UTF-8 text"
                raise SimulatorError(f"simulator.inputs: {self.folder / template}: {reason}") from None
        return texts

    def load(self) -> Callable[..., Any]:
        """Import the callable, with the study's folder first on the module search path.

        Raises
        ------
        SimulatorError
            Saying which module was looked for, where, and what went wrong.
        """
        if not self.options.run:
            raise SimulatorError("these runs are made by hand: no simulator is named that could make them")
        title = f"simulator {self.identity}"
        module_name, _, attribute = self.options.run.partition(":")
        folder = str(self.folder.resolve())
        if folder not in sys.path:
            sys.path.insert(0, folder)
        importlib.invalidate_caches()
        try:
            found: Any = importlib.import_module(module_name)
        except BaseException as error:  # a module may even call sys.exit() while it is imported
            raise SimulatorError(
                f"{title}: module {module_name} cannot be imported (looked in {folder} and among installed "
                f"packages): {describe(error)}"
            ) from None
        for name in attribute.split("."):
            try:
                found = getattr(found, name)
            except BaseException as error:  # a module may look names up itself
                where = getattr(sys.modules[module_name], "__file__", None) or module_name
                why = "" if isinstance(error, AttributeError) else f" ({describe(error)})"
                raise SimulatorError(f"{title}: {where} has no '{attribute}'{why}") from None
        if not callable(found):
            raise SimulatorError(f"{title}: '{attribute}' is not a function but {found!r:.100}")
        call: Callable[..., Any] = found
        return call

    def warm_up(self) -> None:
        """Call the function ``warm_up`` of the module that :meth:`load` has imported, if there is one.

        Raises
        ------
        SimulatorError
            Saying how it failed.
        """
        module_name, _, attribute = self.options.run.partition(":")
        warm_up = vars(sys.modules[module_name]).get("warm_up")
        if not callable(warm_up) or attribute == "warm_up":
            return
        try:
            warm_up(**self.options.settings)
        except BaseException as error:
            raise SimulatorError(
                f"simulator {self.identity}: the function warm_up of module {module_name}, called with the "
                f"settings before the first run, failed: {describe(error)}"
            ) from None


def code_digest(simulator: Simulator) -> str:
    """Hash the program's text: the module of a callable with all of its package, the files a command names.

    What these import or call in turn is not part of it.

    Raises
    ------
    SimulatorError
        If no such file is found.
    """
    options = simulator.options
    try:
        texts = [
            [path.name, hashlib.sha256(path.read_bytes()).hexdigest()] for path in program_files(simulator)
        ]
    except OSError as error:
        raise SimulatorError(f"simulator.version: {error.filename}: {error.strerror}") from None
    if not texts:
        raise SimulatorError(
            "simulator.version: 'code' needs a program whose text can be read: a Python module, or a file in "
            f"the study's folder that the command names. None was found for {options.run or options.words[0]}"
        )
    return digest(texts)[:8]


def program_files(simulator: Simulator) -> list[Path]:
    """Files of the program: the module of a callable with all of its package, the files a command names."""
    options, folder = simulator.options, simulator.folder
    if not options.command:
        return _sources(options.run.partition(":")[0], folder) if options.run else []
    words = [word.replace("{study}/", "") for word in options.words]
    return [path for word in words if "{" not in word and (path := folder / word).is_file()]


def _sources(module: str, folder: Path) -> list[Path]:
    """Files of a module, or of the whole package it lies in, beside the study file or installed."""
    top = module.partition(".")[0]
    if (folder / f"{top}.py").is_file():
        return [folder / f"{top}.py"]
    if (folder / top).is_dir():
        return sorted((folder / top).rglob("*.py"))
    found = importlib.util.find_spec(top)
    if found is None or not found.origin:
        return []
    origin = Path(found.origin)
    return sorted(origin.parent.rglob("*.py")) if origin.name == "__init__.py" else [origin]


def read_output(returned: object, names: Collection[str] = ()) -> Output:
    """Sort what a simulator returned into finite responses and extras.

    Parameters
    ----------
    returned : object
        The simulator's return value; a mapping of names if it keeps the contract.
    names : collection of str
        Responses the study asks for. When empty, every finite number is a response.

    Raises
    ------
    OutputError
        If it is no mapping, or a response is missing, not a number, nan or infinite; the message names all of
        them.
    """
    if not isinstance(returned, Mapping):
        raise OutputError(
            f"returned {type(returned).__name__} instead of a mapping of names to numbers: {returned!r:.80}"
        )
    values = {str(name): value for name, value in returned.items()}
    responses: dict[str, float] = {}
    problems = []
    for name in names:
        if name not in values:
            have = ", ".join(values) or "nothing"
            problems.append(f"did not return {name} (it returned {have})")
            continue
        number = number_of(values[name])
        if number is None:
            problems.append(f"returned {name} = {values[name]!r:.60}, which is not a number")
        elif not math.isfinite(number):
            problems.append(f"returned {name} = {number}")
        else:
            responses[name] = number
    if not names:
        if len(values) > MOST_VALUES:
            raise OutputError(f"returned {len(values):,} values; a run may have {MOST_VALUES:,}")
        found = {name: number_of(value) for name, value in values.items()}
        responses = {
            name: number for name, number in found.items() if number is not None and math.isfinite(number)
        }
    extras = plain_values({name: value for name, value in values.items() if name not in responses})
    if problems:
        raise OutputError("; ".join(problems), responses | extras)
    return Output(responses, extras)


def describe(error: BaseException) -> str:
    """Name an error that a simulator raised, and what it says, even if saying it raises another."""
    name = type(error).__name__
    try:
        text = str(error)
    except BaseException:
        text = ""
    return f"{name}: {text}" if text else name
