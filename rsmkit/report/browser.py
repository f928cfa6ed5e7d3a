"""What the explorer page needs to evaluate surfaces and formulas by itself, as JSON values.

A surface becomes its working coordinates, its terms as powers of the variables, and its coefficients, in the
order of :mod:`rsmkit.terms`; a formula becomes nested lists ``[operation, argument, ...]``. The scripts in
``page/`` compute from these the numbers that Python computes, to rounding.
"""

from __future__ import annotations

import ast
from typing import Any

import numpy as np
from scipy.special import stdtrit

from rsmkit.errors import RsmkitError
from rsmkit.expression import Expression
from rsmkit.space import Floats
from rsmkit.surfaces.polynomial import PolynomialSurface
from rsmkit.surfaces.surface import Surface

__all__ = ["browser_formula", "browser_model"]

Formula = float | str | list[Any]

_OPERATIONS: dict[type[ast.operator], str] = {
    ast.Add: "+",
    ast.Sub: "-",
    ast.Mult: "*",
    ast.Div: "/",
    ast.Pow: "**",
}


def browser_model(surface: Surface, confidence: float = 0.95) -> dict[str, Any]:
    """Give everything the page needs to predict one response with its interval.

    Parameters
    ----------
    surface : Surface
    confidence : float
        Of the prediction interval.

    Raises
    ------
    RsmkitError
        For a kind of surface the page cannot evaluate.
    """
    if isinstance(surface, PolynomialSurface):
        return _polynomial(surface, confidence)
    raise RsmkitError(f"the explorer cannot show a surface of kind {type(surface).__name__}")


def browser_formula(expression: Expression) -> Formula:
    """Turn an expression into nested lists: ``"2*a - b"`` gives ``["+", ["*", 2.0, "a"], ["neg", "b"]]``."""
    summands = [_formula(ast.parse(part.text, mode="eval").body) for part in expression.terms()]
    return ["+", *summands] if len(summands) > 1 else summands[0]


def _polynomial(surface: PolynomialSurface, confidence: float) -> dict[str, Any]:
    fit, coordinates = surface.fit, surface.coordinates
    blocks = max(0, len(surface.data.block_names) - 1)
    return {
        "kind": "polynomial",
        "levels": list(surface.terms.levels),
        "columns": [list(column) for column in surface.terms.columns],
        "center": coordinates.center.tolist(),
        "half_range": coordinates.half_range.tolist(),
        "coefficients": _over_blocks(fit.coefficients, blocks).tolist(),
        "factor": _over_blocks(fit.factor, blocks).tolist(),
        "sigma": fit.sigma if fit.df else None,
        "quantile": float(stdtrit(fit.df, 0.5 + 0.5 * confidence)) if fit.df else None,
        "largest_leverage": float(surface.leverage(surface.data.points).max()),
    }


def _over_blocks(rows: Floats, blocks: int) -> Floats:
    """Rows that belong to the terms, with the mean block effect in the constant."""
    if not blocks:
        return rows
    kept = np.delete(rows, slice(1, 1 + blocks), axis=0)
    kept[0] += rows[1 : 1 + blocks].sum(axis=0) / (blocks + 1)
    return kept


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
