"""The arguments of public functions, checked once at the door: their names, their kinds, their words.

What people type into a notebook is outside data as much as what they write into a study file, and is refused
in the same words.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache, wraps
from inspect import Parameter, Signature, signature
from numbers import Integral, Real
from pathlib import PurePath
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, ParamSpec, TypeVar, Union, get_args, get_origin, get_type_hints

from rsmkit.errors import RsmkitError, did_you_mean, listed, one_of
from rsmkit.io.strict_types import describe

__all__ = ["checked"]

P = ParamSpec("P")
R = TypeVar("R")

_NUMBERS: dict[Any, Any] = {float: Real, int: Integral}


def checked(function: Callable[P, R]) -> Callable[P, R]:
    """Check what a public function is called with against its type hints, before it does anything.

    Arrays are left to the function, which knows what shape it wants.

    Raises
    ------
    RsmkitError
        From the function that is made: for an argument that it does not have, that is missing, of the wrong
        kind, or a word that means nothing; with the nearest right one.

    Examples
    --------
    >>> @checked
    ... def paint(color: Literal["red", "green"], coats: int = 1) -> str:
    ...     return coats * color
    >>> paint("gren")
    Traceback (most recent call last):
    ...
    rsmkit.errors.RsmkitError: paint(): color must be red or green; got 'gren', did you mean 'green'?
    """

    @wraps(function)
    def at_the_door(*args: P.args, **kwargs: P.kwargs) -> R:
        known, hints = _wanted(function)
        where = f"{function.__name__}()"
        for name, value in _bound(known, where, args, kwargs).items():
            if name not in hints or known.parameters[name].kind in (
                Parameter.VAR_KEYWORD,
                Parameter.VAR_POSITIONAL,
            ):
                continue
            if right := _misfit(hints[name], value):
                hint = did_you_mean(value, _choices(hints[name]))
                raise RsmkitError(f"{where}: {name} must be {listed(right)}; got {_shown(value)}{hint}")
        return function(*args, **kwargs)

    return at_the_door


def _shown(value: object) -> str:
    """A word or a number as it is, anything larger by its kind."""
    plain = isinstance(value, str | Real | list | tuple | dict | None)
    return f"{value!r:.60}" if plain else f"a {type(value).__name__}"


@cache
def _wanted(function: Callable[..., Any]) -> tuple[Signature, dict[str, Any]]:
    return signature(function), get_type_hints(function)


def _bound(known: Signature, where: str, args: Any, kwargs: Any) -> Mapping[str, Any]:
    try:
        return known.bind(*args, **kwargs).arguments
    except TypeError as error:
        for name in kwargs:
            one_of(f"an argument of {where}", name, known.parameters)
        raise RsmkitError(f"{where}: {error}") from None


def _misfit(hint: Any, value: Any) -> list[str]:
    """What a value should be instead, in words; nothing when it fits."""
    origin = get_origin(hint)
    if origin is Annotated:
        return _misfit(get_args(hint)[0], value)
    if origin in (Union, UnionType):
        members = [_misfit(member, value) for member in get_args(hint)]
        return [] if not all(members) else [word for words in members for word in words if word != "nothing"]
    if origin is Literal:
        fits = any(value == word and type(value) is type(word) for word in get_args(hint))
        return [] if fits else [str(word) for word in get_args(hint)]
    if hint is NoneType:
        return [] if value is None else ["nothing"]
    if hint in (float, int):
        return [] if isinstance(value, _NUMBERS[hint]) and not isinstance(value, bool) else [describe(hint)]
    if hint in (str, bool):
        return [] if isinstance(value, hint) or _is_numpy_bool(hint, value) else [describe(hint)]
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return [] if isinstance(value, Mapping) else ["a mapping"]
    if isinstance(origin, type) and issubclass(origin, Sequence | Iterable):
        return _misfit_of_elements(get_args(hint)[0], value)
    if origin is not None:  # callables, arrays
        return [] if origin is not Callable or callable(value) else ["a function"]
    return _misfit_of_class(hint, value)


def _choices(hint: Any) -> list[str]:
    """Give the words that a hint allows; a kind of object is not a word that somebody meant to type."""
    if get_origin(hint) is Literal:
        return [word for word in get_args(hint) if isinstance(word, str)]
    return [word for member in get_args(hint) for word in _choices(member)]


def _is_numpy_bool(hint: Any, value: Any) -> bool:
    return hint is bool and getattr(getattr(value, "dtype", None), "name", "") == "bool"


def _misfit_of_elements(element: Any, value: Any) -> list[str]:
    several = f"a list (each element {describe(element)})"
    if isinstance(value, str) or not isinstance(value, Iterable):
        return [several]
    looked_at = value if isinstance(value, list | tuple) else ()
    return [several] if any(_misfit(element, item) for item in looked_at) else []


def _misfit_of_class(kind: Any, value: Any) -> list[str]:
    """Of a class of ours, or a path; protocols and what is no class accept anything.

    An object whose class names in ``stands_for`` an attribute that is used through it passes as that, too.
    """
    value = getattr(value, getattr(type(value), "stands_for", ""), value)
    ours = isinstance(kind, type) and (kind.__module__.startswith("rsmkit.") or issubclass(kind, PurePath))
    if not ours or getattr(kind, "_is_protocol", False) or isinstance(value, kind):
        return []
    return [f"a {kind.__name__}"]
