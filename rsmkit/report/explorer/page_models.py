"""What the explorer page needs to evaluate surfaces and formulas by itself, as JSON values.

A surface becomes its working coordinates, its terms as powers of the variables, and its coefficients, in the
order of :mod:`rsmkit.language.terms`; a formula becomes nested lists ``[operation, argument, ...]``. The
scripts in ``page/`` compute from these the numbers that Python computes, to rounding.
"""

from __future__ import annotations

import ast
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.special import betaln, ndtri, stdtrit

from rsmkit.errors import RsmkitError
from rsmkit.language.expression import Expression, parse_expression
from rsmkit.language.space import Floats
from rsmkit.surfaces.estimation.stretch import Stretch, free_parameters
from rsmkit.surfaces.models.box_cox import BoxCoxSurface
from rsmkit.surfaces.models.gaussian_process import GaussianProcessSurface
from rsmkit.surfaces.models.polynomial import PolynomialSurface
from rsmkit.surfaces.models.stretched import STEP
from rsmkit.surfaces.models.surface import Surface

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
    if isinstance(surface, BoxCoxSurface):
        inner = _polynomial(surface.inner, confidence)
        return {"kind": "box-cox", "power": surface.power, "inner": inner}
    if isinstance(surface, PolynomialSurface):
        return _polynomial(surface, confidence)
    if isinstance(surface, GaussianProcessSurface):
        return _gaussian_process(surface, confidence)
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
        "stretches": [_stretch(stretch) for stretch in coordinates.stretches],
        "shifts": _shifts(coordinates.stretches),
        "coefficients": surface.working_coefficients.tolist(),
        "factor": _over_blocks(fit.factor, blocks).tolist(),
        "sigma": fit.sigma if fit.df else None,
        "quantile": float(stdtrit(fit.df, 0.5 + 0.5 * confidence)) if fit.df else None,
        "largest_leverage": float(surface.leverage(surface.data.points).max()),
    }


def _stretch(stretch: Stretch) -> dict[str, Any] | None:
    """Give a stretch with its slopes beyond both ends; None for the identity."""
    if stretch.family == "identity":
        return None
    beyond = stretch.forward(np.array([-1.0, 2.0]))
    return {
        "family": stretch.family,
        "parameters": list(stretch.parameters),
        "low": stretch.low,
        "high": stretch.high,
        "slopes": [float(-beyond[0]), float(beyond[1] - 1.0)],
        "formula": browser_formula(parse_expression(stretch.expression)) if stretch.expression else None,
        "log_beta": float(betaln(*np.exp(stretch.parameters))) if stretch.family == "beta" else None,
    }


def _shifts(stretches: tuple[Stretch, ...]) -> list[dict[str, Any]]:
    """For each stretch parameter, the stretch on both sides of it: the page differentiates by them."""
    shifts = []
    for factor, i in free_parameters(stretches):
        sides = []
        for step in (STEP, -STEP):
            moved = list(stretches[factor].parameters)
            moved[i] += step
            sides.append(_stretch(replace(stretches[factor], parameters=tuple(moved))))
        shifts.append({"factor": factor, "plus": sides[0], "minus": sides[1], "step": STEP})
    return shifts


def _gaussian_process(surface: GaussianProcessSurface, confidence: float) -> dict[str, Any]:
    parts = surface.prediction_parts()
    return {
        "kind": "gaussian process",
        "kernel": surface.kernel,
        "levels": [factor.domain.categories for factor in surface.space],
        "center": surface.coordinates.center.tolist(),
        "half_range": surface.coordinates.half_range.tolist(),
        "lengths": surface.lengths.tolist(),
        "runs": parts["runs"].tolist(),
        "weights": parts["weights"].tolist(),
        "cholesky": [row[: i + 1].tolist() for i, row in enumerate(parts["cholesky"])],
        "mean": parts["mean"],
        "scale": parts["scale"],
        "nugget": surface.nugget,
        "half_width": float(ndtri(0.5 + 0.5 * confidence)) * parts["sd"],
        "largest_variance": parts["largest"],
    }


def _over_blocks(rows: Floats, blocks: int) -> Floats:
    """Rows without those of the blocks, with the mean block effect in the constant."""
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
