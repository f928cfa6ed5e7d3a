"""What a restricted likelihood depends on: the runs, free of the terms, split by what groups can explain.

Runs ``y = X b + sum Z_i u_i + e`` whose groups (plots, days) are samples of all groups have the covariance
``V = sum v_i Z_i Z_i' + v_e I``. The part of y that no term can explain has n - p dimensions; in d of them
groups matter (``K`` spans what is left of the columns of all Z without X), the rest knows of ``v_e`` alone.
So the likelihood of Patterson & Thompson, Biometrika 58 (1971), needs matrices of d rows, not of n.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve, qr

from rsmkit.language.space import Floats

__all__ = ["ErrorContrasts", "error_contrasts", "indicators"]

DEPENDENT = 1e-9
"""Length left of a unit column that is a combination of others."""


@dataclass(frozen=True, eq=False)
class ErrorContrasts:
    """Runs without what the terms explain.

    Parameters
    ----------
    parts : array, shape (r, d, d)
        ``K' Z_i Z_i' K`` of each kind of groups.
    u : array, shape (d,)
        ``K' y``.
    rest : float
        Sum of squares of y that neither terms nor groups explain.
    rest_df : int
        Its degrees of freedom.
    """

    parts: Floats
    u: Floats
    rest: float
    rest_df: int

    @property
    def df(self) -> int:
        """Degrees of freedom of all runs beside the terms."""
        return len(self.u) + self.rest_df

    @cached_property
    def scales(self) -> Floats:
        """Mean eigenvalue of each part that is not zero, shape (r,): about the runs per group; 1 for none."""
        sizes = []
        for part in self.parts:
            values = np.linalg.eigvalsh(part)
            large = values[values > DEPENDENT * max(values.max(initial=0.0), 1.0)]
            sizes.append(large.mean() if large.size else 1.0)
        return np.array(sizes)

    def profile(self, ratios: Floats) -> tuple[float, Floats, Floats]:
        """``(n-p) log s2 + log|H| + log|X'H^-1X|`` up to a constant, with gradient and Hessian.

        Parameters
        ----------
        ratios : array, shape (r,)
            Variances of the groups over that of the runs; s2 is profiled out.
        """
        inverse, log_det = self._inverse(np.eye(len(self.u)) + np.tensordot(ratios, self.parts, 1))
        moved = inverse @ self.u
        total = self.rest + float(self.u @ moved)
        pulls = self.parts @ moved  # S_i C^-1 u
        spread = np.array([inverse @ part for part in self.parts])
        slopes = pulls @ moved
        traces = np.trace(spread, axis1=1, axis2=2)
        bends = 2.0 * pulls @ inverse @ pulls.T / total - np.outer(slopes, slopes) / total**2
        value = self.df * math.log(total / self.df) + log_det
        gradient = traces - self.df * slopes / total
        hessian = self.df * bends - np.einsum("iab,jba->ij", spread, spread)
        return value, gradient, hessian

    def residual_variance(self, ratios: Floats) -> float:
        """``s2`` at the given ratios."""
        inverse, _ = self._inverse(np.eye(len(self.u)) + np.tensordot(ratios, self.parts, 1))
        return (self.rest + float(self.u @ inverse @ self.u)) / self.df

    def deviance(self, variances: Floats) -> tuple[float, Floats]:
        """Minus twice the restricted log-likelihood without its constant, and its gradient, shape (r + 1,).

        Parameters
        ----------
        variances : array, shape (r + 1,)
            Of the groups, then of the runs (above zero).
        """
        own = variances[-1]
        inverse, log_det = self._inverse(self._covariance(variances))
        moved = inverse @ self.u
        value = log_det + float(self.u @ moved) + self.rest_df * math.log(own) + self.rest / own
        slopes = [float((inverse * part).sum() - moved @ part @ moved) for part in self.parts]
        last = np.trace(inverse) - float(moved @ moved) + self.rest_df / own - self.rest / own**2
        return value, np.array([*slopes, last])

    def information(self, variances: Floats) -> Floats:
        """``tr(P V_i P V_j)``: twice the expected information of the variances, shape (r + 1, r + 1)."""
        spread = self._spread(variances)
        found = np.einsum("iab,jba->ij", spread, spread)
        found[-1, -1] += self.rest_df / variances[-1] ** 2
        return np.asarray(found)

    def observed_information(self, variances: Floats) -> Floats:
        """Twice the observed information of the variances: second derivatives of :meth:`deviance`."""
        spread = self._spread(variances)
        inverse, _ = self._inverse(self._covariance(variances))
        pulls = self._all_parts @ (inverse @ self.u)
        found = 2.0 * pulls @ inverse @ pulls.T - np.einsum("iab,jba->ij", spread, spread)
        own = variances[-1]
        found[-1, -1] += 2.0 * self.rest / own**3 - self.rest_df / own**2
        return np.asarray(found)

    @cached_property
    def _all_parts(self) -> Floats:
        return np.concatenate([self.parts, np.eye(len(self.u))[None]])

    def _covariance(self, variances: Floats) -> Floats:
        return np.asarray(np.tensordot(variances, self._all_parts, 1))

    def _spread(self, variances: Floats) -> Floats:
        inverse, _ = self._inverse(self._covariance(variances))
        return np.array([inverse @ part for part in self._all_parts])

    @staticmethod
    def _inverse(matrix: Floats) -> tuple[Floats, float]:
        if not len(matrix):
            return matrix, 0.0
        factor = cho_factor(matrix, lower=True)
        return cho_solve(factor, np.eye(len(matrix))), 2.0 * float(np.log(np.diag(factor[0])).sum())


def indicators(index: NDArray[np.intp]) -> Floats:
    """Column of ones and zeros per group, shape (n, groups)."""
    return np.asarray(index[:, None] == np.arange(index.max() + 1), float)


def error_contrasts(matrix: Floats, y: Floats, groups: Sequence[Floats]) -> ErrorContrasts:
    """Split runs into what terms explain, what groups could, and the rest.

    Parameters
    ----------
    matrix : array, shape (n, p)
        Of full rank.
    y : array, shape (n,)
    groups : sequence of array, shape (n, q_i)
        Z of each kind of groups.
    """
    base, _ = np.linalg.qr(matrix)
    everything = np.hstack(groups)
    left = everything - base @ (base.T @ everything)
    left -= base @ (base.T @ left)  # again, because the first subtraction cancels digits
    q, r, _ = qr(left, mode="economic", pivoting=True)
    sizes = np.abs(np.diag(r))
    basis = q[:, : int((sizes > DEPENDENT * np.linalg.norm(everything, axis=0).max()).sum())]
    residual = y - base @ (base.T @ y)
    u = basis.T @ residual
    rest = residual - basis @ u
    projected = [basis.T @ z for z in groups]
    return ErrorContrasts(
        parts=np.array([z @ z.T for z in projected]),
        u=u,
        rest=float(rest @ rest),
        rest_df=len(y) - matrix.shape[1] - basis.shape[1],
    )
