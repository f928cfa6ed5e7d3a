"""What the explorer page needs to evaluate a surface by itself, as JSON values.

A surface becomes its working coordinates, its terms as powers of the variables, and its coefficients, in the
order of :mod:`rsmkit.language.terms`. ``page/models.js`` computes from these the numbers that Python
computes, to rounding; ``kind`` names its function there.
"""

from __future__ import annotations

import base64
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.special import ndtri, stdtrit

from rsmkit.language.browser_formula import browser_formula
from rsmkit.language.expression import parse_expression
from rsmkit.language.space import Floats
from rsmkit.surfaces.estimation.stretch import Stretch, free_parameters
from rsmkit.surfaces.models.box_cox import BoxCoxSurface, power_change
from rsmkit.surfaces.models.gaussian_process import GaussianProcessSurface
from rsmkit.surfaces.models.glm import GlmSurface
from rsmkit.surfaces.models.mixed import MixedSurface
from rsmkit.surfaces.models.polynomial import PolynomialSurface

__all__ = ["box_cox_page", "glm_page", "mixed_page", "polynomial_page", "process_page"]


def polynomial_page(surface: PolynomialSurface, confidence: float) -> dict[str, Any]:
    """Parts of a polynomial, stretched or not, with those of its prediction interval."""
    judge, coordinates = surface.judge, surface.coordinates
    fit, place = judge.fit, {e: i for i, e in enumerate(judge.terms.columns)}
    coefficients = np.zeros(judge.terms.p)  # of terms that were left out: the page needs their leverage
    coefficients[[place[e] for e in surface.terms.columns]] = surface.working_coefficients
    blocks = max(0, len(surface.data.block_names) - 1)
    plain, weights = judge.terms.plain  # the page knows products of powers alone
    return {
        "kind": "polynomial",
        "levels": list(surface.terms.levels),
        "columns": [list(column) for column in plain.columns],
        "center": coordinates.center.tolist(),
        "half_range": coordinates.half_range.tolist(),
        "stretches": [_stretch(stretch) for stretch in coordinates.stretches],
        "shifts": _shifts(coordinates.stretches),
        "coefficients": (weights @ coefficients).tolist(),
        "factor": _columns(_with_extras(weights, _over_blocks(fit.factor, blocks))),
        "sigma": fit.sigma if fit.df else None,
        "quantile": float(stdtrit(fit.df, 0.5 + 0.5 * confidence)) if fit.df else None,
        "largest_leverage": float(judge.leverage(surface.data.points).max()),
    }


def mixed_page(surface: MixedSurface, confidence: float) -> dict[str, Any]:
    """Polynomial of the fixed part, and what its intervals and their degrees of freedom follow from.

    Those are the covariances of the coefficients, adjusted and as if variances were known, and the
    derivatives of the latter by the variances, all as triangles; the variances with their covariance; and
    directions in which variances cannot be told apart.
    """
    inference = surface.inference
    blocks = max(0, len(surface.data.block_names) - 1)
    onto = _with_extras(surface.terms.plain[1], _over_blocks(np.eye(surface.fit.p), blocks))
    matrices = [inference.covariance, surface.mixed.covariance, *inference.changes]
    leverages = np.einsum("np,pq,nq->n", surface.matrix, inference.covariance, surface.matrix)
    none = np.zeros((len(onto), 0))  # the leverage of independent runs has no meaning here
    return {
        "kind": "mixed",
        "inner": {**polynomial_page(surface, confidence), "factor": _columns(none), "sigma": None},
        "matrices": [_packed(_triangle(onto @ matrix @ onto.T)) for matrix in matrices],
        "variances": surface.mixed.variances.tolist(),
        "spread": inference.variance_covariance.tolist(),
        "unknown": inference.unknown.T.tolist(),
        "beyond": 0.5 * (1.0 - confidence),
        "normal": float(ndtri(0.5 + 0.5 * confidence)),
        "largest": float(leverages.max()),
    }


def _triangle(matrix: Floats) -> list[Floats]:
    """Rows of a symmetric matrix up to its diagonal."""
    return [row[: i + 1] for i, row in enumerate(matrix)]


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
    }


def _shifts(stretches: tuple[Stretch, ...]) -> list[dict[str, Any]]:
    """Place of each stretch parameter, and how it changes the slopes beyond both ends."""
    return [
        {"factor": j, "parameter": i, "ends": stretches[j].end_changes(i).tolist()}
        for j, i in free_parameters(stretches)
    ]


def box_cox_page(surface: BoxCoxSurface, confidence: float) -> dict[str, Any]:
    """Power with its uncertainty, and the polynomial of the transformed response."""
    fit, df = surface.inner.fit, surface.inner.fit.df - 1
    change = power_change(surface.inner.data.y, surface.power)
    coefficients = fit.factor @ (fit.factor.T @ (surface.inner.matrix.T @ (fit.weights * change)))
    blocks = max(0, len(surface.inner.data.block_names) - 1)
    return {
        "kind": "box-cox",
        "power": surface.power,
        "largest": surface.largest,
        "change": _over_blocks(coefficients[:, None], blocks)[:, 0].tolist(),
        "power_error": surface.power_error,
        "inner": {
            **polynomial_page(surface.inner, confidence),
            "sigma": surface.sigma if df > 0 else None,
            "quantile": float(stdtrit(df, 0.5 + 0.5 * confidence)) if df > 0 else None,
        },
    }


def glm_page(surface: GlmSurface, confidence: float) -> dict[str, Any]:
    """Polynomial of the link, and the size of the average run, for the limits of a new one."""
    size = float(surface.size.mean())
    return {
        "kind": "glm",
        "distribution": surface.distribution,
        "size": max(round(size), 1) if surface.distribution == "binomial" else size,
        "quantile": float(ndtri(0.5 + 0.5 * confidence)),
        "tail": 0.5 * (1.0 - confidence),
        "inner": polynomial_page(surface, confidence),
    }


def process_page(surface: GaussianProcessSurface, confidence: float) -> dict[str, Any]:
    """Runs, weights and bordered Cholesky factor of a Gaussian process."""
    parts = surface.prediction_parts()
    return {
        "kind": "gaussian process",
        "kernel": surface.kernel,
        "levels": [factor.domain.categories for factor in surface.space],
        "center": surface.coordinates.center.tolist(),
        "half_range": surface.coordinates.half_range.tolist(),
        "lengths": surface.lengths.tolist(),
        "runs": _packed(list(parts["runs"])),
        "weights": parts["weights"].tolist(),
        "cholesky": _packed(_triangle(parts["cholesky"])),
        "mean": parts["mean"],
        "nugget": surface.nugget,
        "half_width": float(ndtri(0.5 + 0.5 * confidence)) * parts["sd"],
        "largest_variance": parts["largest"],
    }


def _columns(matrix: Floats) -> dict[str, Any]:
    """Columns without the zeros at their ends, packed: the factor of a polynomial is a triangle."""
    lengths = [int(np.flatnonzero(column).max(initial=-1)) + 1 for column in matrix.T]
    packed = _packed([np.zeros(0), *(c[:length] for c, length in zip(matrix.T, lengths, strict=True))])
    return {"rows": len(matrix), "lengths": lengths, "packed": packed}


def _packed(rows: Sequence[Floats]) -> str:
    """Numbers, row by row, as base64 of little-endian doubles: half as long as their digits."""
    return base64.b64encode(np.concatenate(rows).astype("<f8").tobytes()).decode("ascii")


def _with_extras(weights: Floats, rows: Floats) -> Floats:
    """Rows of terms as those of products of powers; rows of a stretch after them stay."""
    terms = weights.shape[1]
    return np.asarray(np.vstack([weights @ rows[:terms], rows[terms:]]))


def _over_blocks(rows: Floats, blocks: int) -> Floats:
    """Rows without those of the blocks, with the mean block effect in the constant."""
    if not blocks:
        return rows
    kept = np.delete(rows, slice(1, 1 + blocks), axis=0)
    kept[0] += rows[1 : 1 + blocks].sum(axis=0) / (blocks + 1)
    return kept
