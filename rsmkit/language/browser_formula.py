"""Formulas for evaluation outside Python: nested lists ``[operation, argument, ...]``, as JSON holds them."""

from __future__ import annotations

import ast
from typing import Any

from rsmkit.language.expression import Expression, parse_tree

__all__ = ["Formula", "browser_formula"]

Formula = float | str | list[Any]

_OPERATIONS: dict[type[ast.operator], str] = {
    ast.Add: "+",
    ast.Sub: "-",
    ast.Mult: "*",
    ast.Div: "/",
    ast.Pow: "**",
}


def browser_formula(expression: Expression) -> Formula:
    """Turn an expression into nested lists: ``"2*a - b"`` gives ``["+", ["*", 2.0, "a"], ["neg", "b"]]``."""
    summands = [_formula(parse_tree(part.text)) for part in expression.terms()]
    return ["+", *summands] if len(summands) > 1 else summands[0]


def _formula(node: ast.expr) -> Formula:
    match node:
        case ast.Constant(value=value):
            return float(value)  # type: ignore[arg-type]
        case ast.Name(id=name):
            return name
        case ast.BinOp(left=left, op=op, right=right):
            return [_OPERATIONS[type(op)], _formula(left), _formula(right)]
        case ast.UnaryOp(op=op, operand=operand):
            return ["neg", _formula(operand)] if isinstance(op, ast.USub) else _formula(operand)
        case ast.Call(func=ast.Name(id=name), args=args):
            return [name, *(_formula(argument) for argument in args)]
    raise AssertionError("unreachable: the expression was checked when it was parsed")
