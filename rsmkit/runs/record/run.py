"""One simulator run: what was asked, what came back, and the key by which it is found again."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

from rsmkit.errors import readable
from rsmkit.io.files.digests import digest

__all__ = [
    "ACTUAL",
    "EXCLUDED",
    "KIND",
    "LABORATORY",
    "Run",
    "State",
    "Status",
    "Value",
    "canonical",
    "key_maker",
    "recordable",
    "run_from_json",
    "run_key",
    "run_seed",
    "run_to_json",
]

Value = bool | int | float | str
Status = Literal["done", "failed", "timeout", "crashed"]
State = Literal["done", "partial", "excluded", "failed", "missing"]

LABORATORY = "laboratory"
"""What stands for the simulator in runs made by hand."""
ACTUAL = " actual"
"""A run made by hand keeps what a factor really was under the factor's name with this behind it."""
EXCLUDED = "excluded because"
"""Under which a run made by hand keeps why it is left out."""
KIND = "kind of run"
"""Under which a run made by hand that is not of the design keeps what it is."""

_NAMED_ONCE = {"excluded": EXCLUDED, "kind": KIND}

SCHEMA = 1
DEEPEST = 100
"""Lists and mappings within each other that a line may have."""
_NUMBERS = (int, float)
_VALUES = (int, float, str)
_LARGEST_INT = 2**1023
_KEY = re.compile(r"[0-9a-f]{16}")
_HUGE = re.compile(r"\d{300}|[eE]\+?\d{3}")
"""What a line must have for one of its numbers to be too large; texts may have it too."""
_STATUSES = frozenset(get_args(Status))


@dataclass(frozen=True)
class Run:
    """A run that has ended, well or badly; one line of ``runs.jsonl``.

    Parameters
    ----------
    key : str
        Identity of the run, see :func:`run_key`.
    simulator : str
        The simulator as the study names it.
    settings, factors : mapping
        Arguments it received.
    replicate : int
        0 for the first run of a point, 1 for its repetition, and so on.
    status : str
        ``done``; ``failed`` (raised, or returned something unusable), ``timeout``, or ``crashed`` (its
        process died).
    responses : mapping of str to float
        The finite numbers asked for. All of them when ``done``.
    extras : mapping
        Whatever else the simulator returned.
    seconds : float
        Duration by a clock that never jumps.
    attempt : int
        1 for the first try of this key.
    error : str
        Why it is not ``done``, in one line.
    host, started : str
        Computer, and UTC time of day by its calendar clock (for people; nothing is decided by it).
    """

    key: str
    simulator: str
    settings: Mapping[str, Any]
    factors: Mapping[str, Value]
    replicate: int
    status: Status
    responses: Mapping[str, float]
    extras: Mapping[str, Any]
    seconds: float
    attempt: int = 1
    error: str = ""
    host: str = ""
    started: str = ""

    @property
    def done(self) -> bool:
        """Whether the run came to a good end."""
        return self.status == "done"

    @property
    def described(self) -> str:
        """Where it was made and how it ended, in one line."""
        place = ", ".join(f"{name} {value}" for name, value in self.factors.items())
        return readable(f"{place}: {self.status}, {self.error}")

    def value(self, name: str) -> float:
        """A returned number by name, whether it was asked for at the time or not; nan when there is none."""
        if name in self.responses:
            return self.responses[name]
        extra = self.extras.get(name)
        return float(extra) if isinstance(extra, int | float) and not isinstance(extra, bool) else math.nan

    @property
    def by_hand(self) -> bool:
        """Whether people made it: such a run never fails, and each response counts by itself."""
        return self.simulator == LABORATORY

    @property
    def is_outside(self) -> bool:
        """Whether it was made by hand beside what a design has: an added run, a confirmation, an optimum."""
        return self.by_hand and KIND in self.extras

    @property
    def excluded(self) -> str:
        """Why a run made by hand is left out of every fit; empty for one that counts."""
        return str(self.extras.get(EXCLUDED, "")) if self.by_hand else ""

    @property
    def made_at(self) -> dict[str, Value]:
        """The factors as they really were: of a run made by hand not always as planned."""
        if not self.by_hand:
            return dict(self.factors)
        return {name: self.extras.get(f"{name}{ACTUAL}", value) for name, value in self.factors.items()}

    def state(self, names: Iterable[str]) -> State:
        """How far it is of use to those who ask for the responses `names`."""
        asked = tuple(names)
        if self.excluded:
            return "excluded"
        if self.answers(asked):
            return "done"
        if not self.by_hand:
            return "missing" if self.done else "failed"  # done, but not asked for all of them
        return "partial" if any(math.isfinite(self.value(name)) for name in asked) else "missing"

    def answers(self, names: Iterable[str]) -> bool:
        """Whether the record has a number for every one of `names` (without names: whether it is done)."""
        asked = tuple(names)
        return (
            all(name in self.responses or math.isfinite(self.value(name)) for name in asked)
            if asked
            else self.done
        )


def run_key(
    simulator: str, settings: Mapping[str, Any], factors: Mapping[str, Value], replicate: int = 0
) -> str:
    """Hash what decides a run's result: simulator, settings, factor values (every bit of them), replicate.

    The row of the design is not part of it, so that another design reuses the points already paid for. Order
    does not matter and 4300 is the same setting as 4300.0.

    Returns
    -------
    str
        16 hexadecimal digits; among 100,000 runs two different ones collide with probability 3e-10.
    """
    return key_maker(simulator, settings)(factors, replicate)


def key_maker(simulator: str, settings: Mapping[str, Any]) -> Callable[[Mapping[str, Value], int], str]:
    """Give :func:`run_key` for many runs of the same simulator and settings."""
    head = _SORTED.encode([simulator, canonical(settings)]).removesuffix("]")

    def key(factors: Mapping[str, Value], replicate: int) -> str:
        return digest(f"{head}, {_SORTED.encode(canonical(factors))}, {replicate}]")

    return key


def run_seed(key: str) -> int:
    """Derive a run's own seed from its key: the same on every machine, whatever worker makes the run.

    31 bits, which every generator and every external program can take.
    """
    return int(key[:8], 16) >> 1


def canonical(value: Any) -> Any:
    """Give an argument in the form in which equal ones are equal: 4300 is 4300.0, -0.0 is 0.0."""
    if isinstance(value, Mapping):
        return {str(name): canonical(inner) for name, inner in value.items()}
    if isinstance(value, list | tuple):
        return [canonical(inner) for inner in value]
    if isinstance(value, int) and not isinstance(value, bool) and abs(value) <= 2**53:
        return float(value)
    return value + 0.0 if isinstance(value, float) else value  # -0.0 is the same point as 0.0


def run_to_json(run: Run) -> str:
    """One line of the journal, without its newline. Not-a-number never gets in: it is refused here."""
    return _ENCODE({"schema": SCHEMA, **vars(run)})


def recordable(run: Run, settings: dict[str, Any] | None = None) -> Run:
    """Give the run as its line of the journal says it, which can be read back.

    One whose line could not be is a failed run: nothing it returned is kept.

    Parameters
    ----------
    run : Run
    settings : dict, optional
        As for :func:`run_from_json`.
    """
    try:
        _refuse_deep(run.extras, DEEPEST)
        return run_from_json(run_to_json(run), settings)
    except Exception as error:
        why = readable(f"returned something that cannot be recorded ({type(error).__name__})")
    return replace(run, status="failed", responses={}, extras={}, seconds=0.0, error=why, host="", started="")


def _refuse_deep(value: Any, left: int) -> None:
    """Refuse what the reader could refuse: how deep it can go depends on who calls it."""
    if left < 0:
        raise ValueError("nested too deeply")
    if isinstance(value, Mapping | list | tuple):
        for inner in value.values() if isinstance(value, Mapping) else value:
            if isinstance(inner, Mapping | list | tuple):
                _refuse_deep(inner, left - 1)


def run_from_json(text: bytes | str, settings: dict[str, Any] | None = None) -> Run:
    """Read one line of the journal.

    Parameters
    ----------
    text : bytes or str
        The line.
    settings : dict, optional
        Settings met before, by their text; thousands of runs then share one copy of theirs.

    Raises
    ------
    ValueError
        With what is wrong with the line; nothing else, whatever the bytes.
    """
    try:
        line = text if isinstance(text, str) else text.decode()
        return _checked(_DECODER.decode(line), {} if settings is None else settings, _HUGE.search(line))
    except RecursionError:
        raise ValueError("nested too deeply") from None


# By hand and not by the codec, which takes 1.6 times as long for a line: a journal may hold 100,000 of them.
def _checked(data: Any, settings: dict[str, Any], huge: object) -> Run:
    if not isinstance(data, dict):
        raise ValueError("not a JSON object")
    schema = data.pop("schema", None)
    if schema != SCHEMA:
        raise ValueError(f"schema {schema!r} is not {SCHEMA}, the one this version of rsmkit reads")
    for name, (kind, required) in _FIELDS.items():
        if name not in data:
            if required:
                raise ValueError(f"has no {name}")
        elif not isinstance(data[name], kind) or data[name] is True or data[name] is False:
            raise ValueError(f"{name} is {type(data[name]).__name__}")
    if not _KEY.fullmatch(data["key"]):
        raise ValueError("key is not 16 hexadecimal digits")
    if data["status"] not in _STATUSES:
        raise ValueError(f"unknown status {data['status']!r}")
    for number in (data["seconds"], *data["responses"].values()):
        if isinstance(number, bool) or not isinstance(number, _NUMBERS) or (huge and not _is_finite(number)):
            raise ValueError("responses or seconds has something that is not a finite number")
    for value in data["factors"].values():
        if not isinstance(value, _VALUES) or (huge and not _is_finite(value)):
            raise ValueError("factors has something that is neither finite number nor text")
    data["settings"] = settings.setdefault(repr(data["settings"]), data["settings"])
    if huge and not (_is_finite(data["extras"]) and _is_finite(data["settings"])):
        raise ValueError("a number is too large")
    if data["simulator"] == LABORATORY:
        _rename(data["extras"], data["factors"])
    return Run(**{name: data[name] for name in _FIELDS if name in data})


def _rename(extras: dict[str, Any], factors: Mapping[str, Value]) -> None:
    """Bring remarks of a run made by hand under their names of today.

    Once they stood under the heads of the sheet. Factors and responses may have these names now; a value of
    theirs is none of the texts that stood there.
    """
    for old, new in _NAMED_ONCE.items():
        if isinstance(extras.get(old), str) and old not in factors and new not in extras:
            extras[new] = extras.pop(old)


_FIELDS: dict[str, tuple[type | tuple[type, ...], bool]] = {
    "key": (str, True),
    "simulator": (str, True),
    "settings": (dict, True),
    "factors": (dict, True),
    "replicate": (int, True),
    "status": (str, True),
    "responses": (dict, True),
    "extras": (dict, True),
    "seconds": (_NUMBERS, True),
    "attempt": (int, False),
    "error": (str, False),
    "host": (str, False),
    "started": (str, False),
}


def _is_finite(value: Any) -> bool:
    """Whether all numbers in a JSON value are ones a float can hold."""
    if isinstance(value, float):
        return math.isfinite(value)
    if isinstance(value, int):
        return -_LARGEST_INT <= value <= _LARGEST_INT
    if isinstance(value, dict):
        return all(_is_finite(inner) for inner in value.values())
    return not isinstance(value, list) or all(_is_finite(inner) for inner in value)


def _refuse(name: str) -> None:
    raise ValueError(f"{name} is not a number of JSON")


_ENCODE = json.JSONEncoder(allow_nan=False, separators=(",", ":")).encode  # as it is now
_SORTED = json.JSONEncoder(allow_nan=False, sort_keys=True)
_DECODER = json.JSONDecoder(parse_constant=_refuse)
