"""Generalised linear models of counts and yes/no: iterated weighted least squares, and separation.

McCullagh & Nelder, *Generalized Linear Models*, 2nd ed. (1989), chapter 2; canonical links.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit, gammaln, xlogy

from rsmkit.errors import FitError
from rsmkit.language.space import Floats

__all__ = ["DISTRIBUTIONS", "Counts", "Distribution", "DistributionName", "score", "separated", "wrong_count"]

DistributionName = Literal["binomial", "poisson"]

PASSES = 100
SETTLED = 1e-12
"""Relative change of the deviance at which the iteration ends."""


@dataclass(frozen=True)
class Distribution:
    """One distribution with its canonical link.

    Parameters
    ----------
    link : str
    mean : callable
        Of the linear predictor: a probability, or a rate.
    spread : callable
        Variance of one trial, or of a count of unit exposure, as a function of that mean.
    deviance : callable
        Of counts y, sizes, and means, shape (n,) each: contribution of each run.
    log_likelihood : callable
        Likewise, in all.
    """

    link: str
    mean: Callable[[Floats], Floats]
    spread: Callable[[Floats], Floats]
    deviance: Callable[[Floats, Floats, Floats], Floats]
    log_likelihood: Callable[[Floats, Floats, Floats], float]


def _exponential(eta: Floats) -> Floats:
    return np.asarray(np.exp(np.clip(eta, -700.0, 700.0)))


def _binomial_deviance(y: Floats, size: Floats, mean: Floats) -> Floats:
    rest = size - y
    return np.asarray(
        2.0 * (xlogy(y, y) - xlogy(y, size * mean) + xlogy(rest, rest) - xlogy(rest, size * (1.0 - mean)))
    )


def _poisson_deviance(y: Floats, size: Floats, mean: Floats) -> Floats:
    return np.asarray(2.0 * (xlogy(y, y) - xlogy(y, size * mean) - (y - size * mean)))


def _binomial_likelihood(y: Floats, size: Floats, mean: Floats) -> float:
    choices = gammaln(size + 1) - gammaln(y + 1) - gammaln(size - y + 1)
    return float((choices + xlogy(y, mean) + xlogy(size - y, 1.0 - mean)).sum())


def _poisson_likelihood(y: Floats, size: Floats, mean: Floats) -> float:
    return float((xlogy(y, size * mean) - size * mean - gammaln(y + 1)).sum())


DISTRIBUTIONS: dict[str, Distribution] = {
    "binomial": Distribution(
        "logit",
        lambda eta: np.asarray(expit(eta)),
        lambda mean: mean * (1.0 - mean),
        _binomial_deviance,
        _binomial_likelihood,
    ),
    "poisson": Distribution("log", _exponential, lambda mean: mean, _poisson_deviance, _poisson_likelihood),
}


@dataclass(frozen=True, eq=False)
class Counts:
    """What makes responses counts.

    Parameters
    ----------
    distribution : {"binomial", "poisson"}
    size : array, shape (n,)
        Trials, or exposure, of each run.
    """

    distribution: DistributionName
    size: Floats


def wrong_count(distribution: DistributionName, count: float, size: float, *, stated: bool) -> str:
    """Why a count cannot be one of so many trials or such an exposure; empty where it can.

    Parameters
    ----------
    stated : bool
        Whether anything was said of sizes.
    """
    if count < 0 or count != int(count):
        return f"{count:g} is no count; it should be a whole number from 0"
    what = "trials" if distribution == "binomial" else "exposure"
    if not 0 < size < np.inf:
        return f"{what} of {size:g}; it should be above 0: correct it, or leave the run out"
    if distribution == "binomial" and size != int(size):
        return f"{size:g} trials; it should be a whole number"
    if distribution == "binomial" and count > size:
        if not stated:
            return (
                f"{count:g} is neither 0 nor 1; name the trials of each run, or the distribution poisson for "
                "counts without an upper limit"
            )
        return f"{count:g} of {size:g} trials; correct the count or the trials, or leave the run out"
    return ""


def score(
    family: Distribution, matrix: Floats, y: Floats, size: Floats, offset: Floats | float = 0.0
) -> tuple[Floats, float]:
    """Coefficients and deviance by Fisher scoring; `offset` is added to the linear predictor.

    Parameters
    ----------
    matrix : array, shape (n, p)
    y, size : array, shape (n,)
        Counts, and trials or exposures.
    """
    shrunk = (y + 0.5 * y.mean() / size.mean()) / (size + 0.5 * (1.0 + y.mean() / size.mean()))
    mean = np.clip(shrunk, 1e-8, 1.0 - 1e-8 if family.link == "logit" else np.inf)
    eta = np.log(mean / (1.0 - mean)) if family.link == "logit" else np.log(mean)
    before, beta = np.inf, np.zeros(matrix.shape[1])
    for _ in range(PASSES):
        mean = family.mean(eta)
        weight = np.maximum(size * family.spread(mean), 1e-300)
        root = np.sqrt(weight)
        target = eta - offset + (y - size * mean) / weight
        beta = np.linalg.lstsq(matrix * root[:, None], target * root, rcond=None)[0]
        eta = matrix @ beta + offset
        deviance = float(family.deviance(y, size, family.mean(eta)).sum())
        if abs(deviance - before) <= SETTLED * (abs(deviance) + 0.1):
            break
        before = deviance
    return np.asarray(beta), deviance


def separated(
    name: DistributionName, matrix: Floats, y: Floats, size: Floats, names: Sequence[str]
) -> list[str]:
    """Terms whose coefficients run to infinity, because a combination of them splits the runs; none mostly.

    A direction that raises the likelihood for ever: it moves runs without an event down, runs with nothing
    but events up, and leaves all others where they are (Albert & Anderson, Biometrika 71, 1984). Found, or
    excluded, by a linear programme.
    """
    from scipy.optimize import linprog

    scaled = matrix / np.abs(matrix).max(axis=0)
    none = y == 0
    every: NDArray[np.bool_] = (y == size) if name == "binomial" else np.zeros(len(y), bool)
    signed = np.vstack([scaled[none], -scaled[every]])
    others = scaled[~none & ~every]
    if not len(signed):
        return []
    found = linprog(
        signed.sum(axis=0),
        A_ub=signed,
        b_ub=np.zeros(len(signed)),
        A_eq=others if len(others) else None,
        b_eq=np.zeros(len(others)) if len(others) else None,
        bounds=(-1.0, 1.0),
    )
    if found.status != 0 or found.x is None or found.fun is None:
        raise FitError(f"whether the runs are separated cannot be settled ({found.message})")
    if found.fun > -1e-7:
        return []
    return [term for term, value in zip(names, found.x, strict=True) if abs(value) > 1e-6]
