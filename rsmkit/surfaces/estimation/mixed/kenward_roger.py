"""Tests and intervals of fixed effects whose variances are estimated.

Covariance, scale and degrees of freedom of Kenward & Roger, Biometrics 53 (1997), with the expected
or the observed information of the variances; degrees of freedom of Satterthwaite (1946), for several
coefficients at once as Fai & Cornelius, J. Stat. Comput. Simul. 54 (1996), with the observed information.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from scipy.special import fdtrc

from rsmkit.language.space import Floats
from rsmkit.surfaces.estimation.mixed.reml import Reml

__all__ = ["DfMethod", "FixedTest", "Inference"]

DfMethod = Literal["kenward-roger", "kenward-roger-observed", "satterthwaite"]
"""How degrees of freedom are found; JMP takes the observed information where R and SAS take the expected."""

SINGULAR = 1e-8
"""Smallest eigenvalue of the scaled information that tells variances apart."""
FELT = 1e-7
"""Share of a variance that must not depend on what cannot be estimated."""


@dataclass(frozen=True)
class FixedTest:
    """F test that linear combinations of the coefficients are zero.

    ``refusal`` says why there is none; the numbers are nan then.
    """

    numerator_df: int
    denominator_df: float = math.nan
    f: float = math.nan
    p: float = math.nan
    refusal: str = ""


@dataclass(frozen=True, eq=False)
class Inference:
    """Everything that tests, standard errors and intervals of a fit need.

    Parameters
    ----------
    fit : Reml
    method : {"kenward-roger", "kenward-roger-observed", "satterthwaite"}
    """

    fit: Reml
    method: DfMethod = "kenward-roger"

    @cached_property
    def information(self) -> Floats:
        """Twice the expected information of the variances in units of that of a run, shape (r+1, r+1)."""
        own = float(self.fit.variances[-1])
        return np.asarray(own**2 * self.fit.contrasts.information(self.fit.variances))

    @cached_property
    def unknown(self) -> Floats:
        """Directions in which variances cannot be told from each other, shape (r + 1, m); mostly m = 0."""
        values, vectors = np.linalg.eigh(self._scaled_information)
        return np.asarray(vectors[:, values <= SINGULAR] / self._sizes[:, None])

    @cached_property
    def unknown_groups(self) -> tuple[str, ...]:
        """Names of the variances that these directions move."""
        felt = np.abs(self.unknown).max(axis=1, initial=0.0) > 1e-6
        return tuple(name for name, moved in zip(self.fit.names, felt, strict=True) if moved)

    @cached_property
    def variance_covariance(self) -> Floats:
        """Covariance of the estimated variances, units of the fourth power, shape (r + 1, r + 1).

        From the expected information for Kenward and Roger; else from the observed one of the variances above
        zero.
        """
        own = self.fit.variances[-1]
        if self.method != "kenward-roger":
            free = np.nonzero(self.fit.variances > 0)[0]
            observed = self.fit.contrasts.observed_information(self.fit.variances)[np.ix_(free, free)]
            found = np.zeros((len(self.fit.variances),) * 2)
            found[np.ix_(free, free)] = 2.0 * np.linalg.pinv(observed, hermitian=True)
            return found
        inverse = np.linalg.pinv(self._scaled_information, rcond=SINGULAR, hermitian=True)
        return np.asarray(2.0 * own**2 * inverse / np.outer(self._sizes, self._sizes))

    @cached_property
    def _sizes(self) -> Floats:
        diagonal = np.sqrt(np.diag(self.information))
        return np.where(diagonal > 1e-8, diagonal, 1.0)

    @cached_property
    def _scaled_information(self) -> Floats:
        return np.asarray(self.information / np.outer(self._sizes, self._sizes))

    @cached_property
    def changes(self) -> Floats:
        """Derivatives of the covariance of the coefficients by the variances, shape (r + 1, p, p)."""
        phi = self.fit.covariance
        return np.array([phi @ inner @ phi for inner in self._inner])

    @cached_property
    def _inner(self) -> Floats:
        """``X' V^-1 V_i V^-1 X``, shape (r + 1, p, p)."""
        pulled = [z.T @ self.fit.weighted for z in self.fit.columns]
        return np.array([*(a.T @ a for a in pulled), self.fit.weighted.T @ self.fit.weighted])

    @cached_property
    def covariance(self) -> Floats:
        """Covariance of the coefficients, shape (p, p): adjusted for the variances being estimates.

        That of Satterthwaite's method is the one with the variances taken as known.
        """
        phi = self.fit.covariance
        if self.method == "satterthwaite":
            return phi
        spread = self.variance_covariance
        inside = np.zeros_like(phi)
        roots = [*self.fit.columns, None]
        pulled = [self.fit.weighted if z is None else z.T @ self.fit.weighted for z in roots]
        for i, left in enumerate(roots):
            moved = pulled[i] if left is None else left @ pulled[i]
            solved = self.fit.solve(moved)
            for j, right in enumerate(roots):
                seen = solved if right is None else right.T @ solved
                second = pulled[j].T @ seen  # X' V^-1 V_j V^-1 V_i V^-1 X
                inside += spread[i, j] * (second - self._inner[i] @ phi @ self._inner[j])
        found = phi + 2.0 * phi @ inside @ phi
        return np.asarray(0.5 * (found + found.T))

    # ------------------------------------------------------------------ single combinations

    def degrees(self, rows: Floats, extra: Floats | None = None) -> Floats:
        """Degrees of freedom of single combinations of the coefficients, shape (m,).

        ``2 v^2 / var(v)`` with v the variance of the combination, plus `extra` (r + 1 numbers: how many
        times each variance comes on top, for predictions); nan where v depends on what cannot be estimated.
        """
        slopes = np.einsum("mp,ipq,mq->mi", rows, self.changes, rows)
        value = np.einsum("mp,pq,mq->m", rows, self.fit.covariance, rows)
        if extra is not None:
            slopes, value = slopes + extra, value + float(extra @ self.fit.variances)
        return self.degrees_of(value, slopes)

    def degrees_of(self, value: Floats, slopes: Floats) -> Floats:
        """Degrees of freedom of variances, shape (m,), with derivatives by the variances, shape (m, r+1)."""
        spread = np.einsum("mi,ij,mj->m", slopes, self.variance_covariance, slopes)
        with np.errstate(divide="ignore", invalid="ignore"):
            found = np.where(value > 0, 2.0 * value**2 / spread, np.nan)
        return np.where(self._felt(slopes, value), np.nan, found)

    def _felt(self, slopes: Floats, value: Floats) -> Floats:
        """Whether variances depend on a direction that cannot be estimated, shape (m,)."""
        if not self.unknown.size:
            return np.zeros(len(value), bool)
        moved = np.abs(slopes @ self.unknown).max(axis=1) * self.fit.variances[-1]
        return np.asarray(moved > FELT * np.maximum(value, np.finfo(float).tiny))

    # ------------------------------------------------------------------ several at once

    def test(self, rows: Floats) -> FixedTest:
        """Test ``L b = 0``.

        Parameters
        ----------
        rows : array, shape (m, p)
            L, of full rank.
        """
        inside = rows @ self.fit.covariance @ rows.T
        slopes = np.array([rows @ change @ rows.T for change in self.changes])
        count = len(rows)
        if self.unknown.size:
            moved = np.einsum("im,iab->mab", self.unknown, slopes) * self.fit.variances[-1]
            if np.abs(moved).max() > FELT * np.abs(inside).max():
                return FixedTest(count, refusal=self.refusal)
        tests: dict[DfMethod, Callable[..., tuple[float, float]]] = {
            "kenward-roger": self._scaled_f,
            "kenward-roger-observed": self._scaled_f,
            "satterthwaite": self._approximate_f,
        }
        estimate = rows @ self.fit.coefficients
        f, df = tests[self.method](rows, estimate, inside, slopes)
        return FixedTest(count, df, f, float(fdtrc(count, df, f)) if df > 0 else math.nan)

    @property
    def refusal(self) -> str:
        """Why combinations that depend on an unknown variance are not tested."""
        groups = [name for name in self.unknown_groups if name != "residual"]
        named = " and ".join(groups)
        return (
            f"no degrees of freedom are left between the groups of {named}: the terms that are constant "
            f"within them use up all of them, so their variance is unknown. Make more groups of {named}, or "
            "leave such terms out"
        )

    def _scaled_f(
        self, rows: Floats, estimate: Floats, inside: Floats, slopes: Floats
    ) -> tuple[float, float]:
        """F with its scale, and its degrees of freedom; the names are those of the paper, section 3."""
        q = len(rows)
        relative = np.linalg.solve(inside, slopes)  # Theta Phi P_i Phi, up to sign
        traces = np.trace(relative, axis1=1, axis2=2)
        spread = self.variance_covariance
        a1 = float(traces @ spread @ traces)
        a2 = float(np.einsum("ij,iab,jba->", spread, relative, relative))
        adjusted = rows @ self.covariance @ rows.T
        f = float(estimate @ np.linalg.solve(adjusted, estimate)) / q
        if a2 <= 0:
            return f, math.inf
        b = (a1 + 6.0 * a2) / (2.0 * q)
        g = ((q + 1) * a1 - (q + 4) * a2) / ((q + 2) * a2)
        bottom = 3.0 * q + 2.0 * (1.0 - g)
        c1, c2, c3 = g / bottom, (q - g) / bottom, (q + 2 - g) / bottom
        v0, v1, v2 = 1.0 + c1 * b, 1.0 - c2 * b, 1.0 - c3 * b
        short = 1.0 - a2 / q  # one over the expected F
        share = 1.0 if abs(v1) < 1e-10 and abs(short) < 1e-10 else short / v1
        # The paper's rho is above / below, and infinite where df is 4.
        above, below = share**2 * (0.0 if abs(v0) < 1e-10 else v0), q * v2
        if q * above == below:
            return short * f, math.inf
        df = 4.0 + (q + 2) * below / (q * above - below)
        scale = 1.0 if abs(df - 2.0) < 0.01 else df * short / (df - 2.0)
        return scale * f, df

    def _approximate_f(
        self, rows: Floats, estimate: Floats, inside: Floats, slopes: Floats
    ) -> tuple[float, float]:
        """F of independent combinations, each with degrees of freedom of its own."""
        values, vectors = np.linalg.eigh(inside)
        directions = vectors.T @ rows
        t2 = (directions @ self.fit.coefficients) ** 2 / values
        own = self.degrees(directions)
        f = float(t2.mean())
        if len(rows) == 1 or np.ptp(own) < 1e-8 * own.max():
            return f, float(own.mean())
        if own.min() <= 2:
            return f, 2.0
        total = float((own / (own - 2.0)).sum())
        return f, 2.0 * total / (total - len(rows))
