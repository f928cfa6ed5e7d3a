"""What optimal means: each criterion as a prior and a weight matrix for the exchange.

The exchange maximises log det of ``prior + X'PX`` or minimises the trace of ``weights @ inv(prior + X'PX)``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal, NamedTuple

import numpy as np

from rsmkit.design.optimal.encoding import encode_model, model_rows, moments
from rsmkit.design.region import Region
from rsmkit.errors import RsmkitError
from rsmkit.language.scheffe import Blending, scheffe_terms
from rsmkit.language.space import Floats
from rsmkit.language.space_terms import space_terms
from rsmkit.language.terms import Terms

__all__ = ["Aim", "Criterion", "aim_for", "lattice", "precision_of", "variance_points"]

Criterion = Literal["D", "A", "G", "I", "bayesian-D"]

LATTICE_MOST = 3**8


class Aim(NamedTuple):
    """A criterion, ready for the exchange."""

    terms: Terms
    prior: Floats  # (p, p)
    weights: Floats  # (p, p) for a trace criterion, (0, 0) for the determinant


def aim_for(criterion: Criterion, terms: Terms, region: Region) -> Aim:
    """Turn a criterion into matrices.

    Parameters
    ----------
    criterion : {"D", "A", "G", "I", "bayesian-D"}
        G begins as D; :mod:`rsmkit.design.optimal.minimax` goes on from there. Bayesian D (DuMouchel & Jones
        1994, Technometrics 36(1), 37-47) adds to the primary terms the potential ones of the next order, each
        with a prior standard deviation of one over its range about the primary model.
    terms : Terms
    region : Region
    """
    p = terms.p
    nothing = np.zeros((0, 0))
    if criterion == "A":
        return Aim(terms, np.zeros((p, p)), np.eye(p))
    if criterion == "I":
        return Aim(terms, np.zeros((p, p)), moments(encode_model(terms), region))
    if criterion == "bayesian-D":
        potential = tuple(e for e in _next_order(terms, region).exponents if e not in terms.exponents)
        both = replace(terms, exponents=(*terms.exponents, *potential))
        rows = model_rows(encode_model(both), variance_points(region))
        primary, rest = rows[:, :p], rows[:, p:]
        residual = rest - primary @ np.linalg.lstsq(primary, rest, rcond=None)[0]
        spans = np.ptp(residual, axis=0)
        return Aim(both, np.diag(np.concatenate([np.zeros(p), np.maximum(spans, 1e-6) ** 2])), nothing)
    return Aim(terms, np.zeros((p, p)), nothing)


def _next_order(terms: Terms, region: Region) -> Terms:
    """All terms up to the order that follows that of the model."""
    if not terms.components:
        return space_terms(region.space, terms.order + 1)
    names = [region.space.names[j] for j in terms.components]
    blending: Blending = "quadratic" if terms.order == 1 else "special cubic" if terms.order == 2 else "cubic"
    return scheffe_terms(region.space, names, blending)


def precision_of(runs: int, blocks: Sequence[int] | None, covariance: Floats | None) -> Floats:
    """Inverse covariance of the runs with fixed block effects projected out; (0, 0) for independent runs.

    Parameters
    ----------
    runs : int
    blocks : sequence of int, optional
        Block of every run. Blocks shift the mean by unknown amounts that sum to zero over the runs.
    covariance : array, shape (runs, runs), optional
        Covariance of the errors, up to a factor: ``I + ratio * Z Z'`` for whole plots Z.
    """
    if covariance is None and blocks is None:
        return np.zeros((0, 0))
    precision = np.eye(runs)
    if covariance is not None:
        sigma = np.asarray(covariance, float)
        if sigma.shape != (runs, runs) or not np.allclose(sigma, sigma.T):
            raise RsmkitError(f"covariance must be a symmetric matrix of shape ({runs}, {runs})")
        if np.linalg.eigvalsh(sigma)[0] <= 0:
            raise RsmkitError("covariance must be positive definite")
        precision = np.linalg.inv(sigma)
    if blocks is not None:
        labels = np.asarray(blocks)
        if labels.shape != (runs,):
            raise RsmkitError(f"blocks must name the block of each of the {runs} runs, got {len(labels)}")
        indicators = (labels[:, None] == np.unique(labels)).astype(float)
        centred = (indicators - indicators.mean(axis=0))[:, 1:]
        weighted = precision @ centred
        precision = precision - weighted @ np.linalg.pinv(centred.T @ weighted) @ weighted.T
    return 0.5 * (precision + precision.T)


def variance_points(region: Region, count: int = 2**11) -> Floats:
    """Points that stand for the region when a maximum is looked for: inside, faces and corners; coded."""
    if region.candidates is not None:
        return region.candidates
    inside = region.sample(count, 0)
    corners = lattice(region, LATTICE_MOST)
    if np.isfinite(region.radius):  # the sphere itself
        numeric = region.space.numeric
        lengths = np.linalg.norm(inside[:, numeric], axis=1, keepdims=True)
        shell = inside.copy()
        shell[:, numeric] *= region.radius / np.maximum(lengths, 1e-12)
        corners = np.vstack([corners, shell[region.contains(shell)]])
    return np.vstack([inside, corners])


def lattice(region: Region, most: int, steps: int = 3) -> Floats:
    """Allowed points of a lattice of that many levels (all of discrete factors), coded; at most `most`."""
    if region.candidates is not None:
        return region.candidates
    if region.flat:
        return region.nodes(most)
    grids = [
        levels if len(levels) else np.linspace(low, high, steps)
        for levels, low, high in zip(region.levels, region.lows, region.highs, strict=True)
    ]
    if np.prod([len(g) for g in grids], dtype=float) <= most:
        points = np.stack(np.meshgrid(*grids, indexing="ij"), axis=-1).reshape(-1, len(grids))
    else:
        rng = np.random.default_rng(0)
        points = np.stack([rng.choice(levels, most) for levels in grids], axis=1)
    return points[region.contains(points)]
