"""Arithmetic written by the user: ``"0.2*axial + 0.7*heat"``; conditions are in ``conditions``.

Text becomes a syntax tree, the tree is checked against a short whitelist, and only then is it turned into an
array function. Nothing is ever passed to ``eval``.
"""

from __future__ import annotations

import ast
import math
import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from keyword import kwlist

import numpy as np
from numpy.typing import NDArray

from rsmkit.errors import RsmkitError
from rsmkit.io.arguments import checked
from rsmkit.io.shown import Shown

__all__ = ["Expression", "compile_tree", "evaluate_constant", "parse_expression", "parse_tree"]

Floats = NDArray[np.float64]

MAX_LENGTH = 2000
MAX_DEPTH = 60

_BINARY: dict[type[ast.operator], Callable[[Floats, Floats], Floats]] = {
    ast.Add: np.add,
    ast.Sub: np.subtract,
    ast.Mult: np.multiply,
    ast.Div: np.divide,
    ast.Pow: np.power,
}
_FUNCTIONS: dict[str, tuple[int, Callable[..., Floats]]] = {
    "abs": (1, np.abs),
    "sqrt": (1, np.sqrt),
    "exp": (1, np.exp),
    "log": (1, np.log),
    "log10": (1, np.log10),
    "sin": (1, np.sin),
    "cos": (1, np.cos),
    "tan": (1, np.tan),
    "tanh": (1, np.tanh),
    "min": (2, np.minimum),
    "max": (2, np.maximum),
}
_CONSTANTS = {"pi": math.pi}
_OPERATORS = {"and", "or", "not", "in", "is", "if", "else", "True", "False", "None"}
"""Words of Python's grammar that mean something in a condition."""
_WORDS = "|".join(sorted(set(kwlist) - _OPERATORS))
_NAMES = re.compile(rf"'[^']*'|\"[^\"]*\"|(?<![\w.])({_WORDS})(?!\w)")
_DISGUISE = "\N{LATIN LETTER RETROFLEX CLICK}"


@dataclass(frozen=True)
class Expression(Shown):
    """A checked arithmetic expression.

    Parameters
    ----------
    text : str
        What the user wrote.
    names : frozenset of str
        The quantities it uses.
    """

    text: str
    names: frozenset[str]
    _tree: ast.expr = field(repr=False, compare=False)

    def __call__(self, values: Mapping[str, Floats | float]) -> Floats:
        """Evaluate with one array (or number) per name; shapes broadcast.

        Division by zero, overflow and roots of negative numbers give inf or nan, never an exception.
        """
        with np.errstate(all="ignore"):
            return np.asarray(_evaluate(self._tree, values), dtype=float)

    def terms(self) -> list[Expression]:
        """Split into the summands of its outermost sum: ``a + 2*b - c`` gives ``a``, ``2*b``, ``-c``."""
        return [Expression(ast.unparse(tree), _names(tree), tree) for tree in _summands(self._tree, False)]


@checked
def parse_expression(text: str, known: Collection[str] | None = None) -> Expression:
    """Check and compile one expression.

    Parameters
    ----------
    text : str
        Numbers, names, ``+ - * / **``, parentheses and
        ``abs sqrt exp log log10 sin cos tan tanh min max`` and ``pi``.
    known : collection of str, optional
        Names it may use; anything else is refused with the closest match.

    Raises
    ------
    RsmkitError
        With the offending part named.
    """
    return compile_tree(text, parse_tree(text), known)


def parse_tree(text: str) -> ast.expr:
    """Turn a text into a syntax tree that has not been checked yet.

    A quantity may be called like a word of Python's grammar: ``yield``, ``lambda``, ``class``.
    """
    if len(text) > MAX_LENGTH:
        raise RsmkitError(f"expression of {len(text)} characters; at most {MAX_LENGTH} are allowed")
    try:
        tree = ast.parse(_NAMES.sub(_disguised, text.strip()), mode="eval").body
    except (SyntaxError, ValueError, MemoryError, RecursionError):
        raise RsmkitError(f"'{text}' is not a valid expression") from None
    for node in ast.walk(tree):
        if isinstance(node, ast.Name) and node.id.endswith(_DISGUISE):
            node.id = node.id.removesuffix(_DISGUISE)
    return tree


def _disguised(match: re.Match[str]) -> str:
    """A word of the grammar with a letter that no keyword has; texts in quotes stay as they are."""
    return match[0] + _DISGUISE if match[1] else match[0]


def compile_tree(text: str, tree: ast.expr, known: Collection[str] | None) -> Expression:
    """Check a tree that stands for `text`, and make an expression of it."""
    _check(tree, text, MAX_DEPTH)
    names = _names(tree)
    if known is not None:
        for name in sorted(names - set(known)):
            close = get_close_matches(name, list(known), n=1)
            hint = f"did you mean {close[0]}?" if close else f"known names: {', '.join(sorted(known))}"
            raise RsmkitError(f"'{text}' uses the unknown name {name}; {hint}")
    return Expression(text, names, tree)


def _check(node: ast.expr, text: str, depth: int) -> None:
    if depth == 0:
        raise RsmkitError(f"'{text}' is nested too deeply")
    match node:
        case ast.Constant(value=value) if isinstance(value, int | float) and not isinstance(value, bool):
            try:
                float(value)
            except OverflowError:
                raise RsmkitError(f"'{text}' has a number too large for arithmetic") from None
        case ast.Name():
            pass
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _BINARY:
            _check(left, text, depth - 1)
            _check(right, text, depth - 1)
        case ast.UnaryOp(op=ast.USub() | ast.UAdd(), operand=operand):
            _check(operand, text, depth - 1)
        case ast.Call(func=ast.Name(id=name), args=args, keywords=[]) if name in _FUNCTIONS:
            if len(args) < _FUNCTIONS[name][0]:
                raise RsmkitError(f"'{text}': {name}() needs at least {_FUNCTIONS[name][0]} argument(s)")
            if _FUNCTIONS[name][0] == 1 and len(args) > 1:
                raise RsmkitError(f"'{text}': {name}() takes one argument")
            for argument in args:
                _check(argument, text, depth - 1)
        case _:
            raise RsmkitError(
                f"'{text}': only numbers, names, + - * / ** and the functions "
                f"{', '.join(_FUNCTIONS)} are allowed"
            )


def evaluate_constant(tree: ast.expr) -> float | None:
    """Value of a tree without names of quantities; None where there are any."""
    if _names(tree):
        return None
    with np.errstate(all="ignore"):
        return float(_evaluate(tree, {}))


def _names(tree: ast.expr) -> frozenset[str]:
    called = {id(node.func) for node in ast.walk(tree) if isinstance(node, ast.Call)}
    found = {n.id for n in ast.walk(tree) if isinstance(n, ast.Name) and id(n) not in called}
    return frozenset(found - set(_CONSTANTS))


def _evaluate(node: ast.expr, values: Mapping[str, Floats | float]) -> Floats:
    match node:
        case ast.Constant(value=value):
            return np.asarray(value, float)
        case ast.Name(id=name):
            return np.asarray(_CONSTANTS[name] if name in _CONSTANTS else values[name], float)
        case ast.BinOp(left=left, op=op, right=right):
            return _BINARY[type(op)](_evaluate(left, values), _evaluate(right, values))
        case ast.UnaryOp(op=op, operand=operand):
            inner = _evaluate(operand, values)
            return -inner if isinstance(op, ast.USub) else inner
        case ast.Call(func=ast.Name(id=name), args=args):
            function = _FUNCTIONS[name][1]
            result = _evaluate(args[0], values)
            if _FUNCTIONS[name][0] == 1:
                return function(result)
            for argument in args[1:]:
                result = function(result, _evaluate(argument, values))
            return result
    raise AssertionError("unreachable: the tree was checked when it was parsed")


def _summands(tree: ast.expr, negative: bool) -> list[ast.expr]:
    if isinstance(tree, ast.BinOp) and isinstance(tree.op, ast.Add | ast.Sub):
        flip = negative != isinstance(tree.op, ast.Sub)
        return _summands(tree.left, negative) + _summands(tree.right, flip)
    return [ast.UnaryOp(op=ast.USub(), operand=tree)] if negative else [tree]
