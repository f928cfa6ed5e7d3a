"""Polynomial surfaces in stretched factors.

Inference is joint, because tests that take the stretch as known reject far too often: in covariances and
intervals the derivatives of the prediction by the stretch parameters are columns beside the terms
(Gauss-Newton); tests of coefficients are score tests (:mod:`rsmkit.surfaces.estimation.score_test`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from rsmkit.errors import FitError
from rsmkit.io.json_codec import left_out_if_none
from rsmkit.language.space import Floats, Space
from rsmkit.language.terms import Terms
from rsmkit.surfaces.estimation.coordinates import Coordinates, covering, working
from rsmkit.surfaces.estimation.fit_data import FitData
from rsmkit.surfaces.estimation.least_squares import least_squares
from rsmkit.surfaces.estimation.score_test import score_statistic
from rsmkit.surfaces.estimation.stretch import FAMILIES, Stretch, free_parameters, theta_of, with_theta
from rsmkit.surfaces.models.polynomial import PolynomialForm, PolynomialSurface, fit_polynomial, with_blocks
from rsmkit.surfaces.models.stretch_search import StretchSearch
from rsmkit.surfaces.reading import fail, read_form

__all__ = ["ADOPT", "StretchedSurface", "box_to_stretch", "fit_stretched", "stretched_at"]

ADOPT = 0.9
"""A stretch is adopted when its nested leave-one-out error is at most this part of the plain one's."""
HEAVY = 4.0
"""Degrees of freedom of the t law from which stretch parameters are proposed, for its heavy tails."""
PROPOSALS = 2000
SINGULAR = 1e-10
"""Least diagonal of a triangular factor, in units of the largest, with which terms still differ."""


@dataclass(frozen=True, eq=False)
class StretchedSurface(PolynomialSurface):
    """A polynomial in stretched factors.

    The first coefficients of `fit` belong to the terms in stretched units, the last to the stretch
    parameters.

    Parameters
    ----------
    nested_press : float
        Sum of squared leave-one-out errors with the stretch chosen anew without each run.
    plain_press : float
        PRESS of the same terms without a stretch.
    nested_errors : array, shape (n,), optional
        The errors that `nested_press` sums; not kept in files.
    """

    form: ClassVar[str] = "stretched"

    nested_press: float
    plain_press: float
    nested_errors: Floats | None = None

    @property
    def adopted(self) -> bool:
        """Whether the stretch predicts clearly better than the plain surface."""
        return self.nested_press <= ADOPT**2 * self.plain_press

    @property
    def units(self) -> str:
        """Units of the coefficients."""
        return "stretched"

    def to_units(self, natural: Floats) -> Floats:
        """Natural to stretched units, shape (..., k)."""
        return self.coordinates.forward(natural)

    def from_units(self, values: Floats) -> Floats:
        """Stretched to natural units, shape (..., k)."""
        return self.coordinates.backward(values)

    @property
    def theta(self) -> Floats:
        """Fitted stretch parameters, shape (q,)."""
        return self.fit.coefficients[self.fit.p - self._extra_count :]

    @cached_property
    def coefficients(self) -> Floats:
        """Coefficients in stretched units, then the stretch parameters, shape (p,)."""
        return self.fit.coefficients

    @cached_property
    def coded_factor(self) -> Floats:
        """Joint covariance factor in stretched units."""
        return self.fit.factor

    @cached_property
    def coded_matrix(self) -> Floats:
        """Same as :attr:`matrix`."""
        return self.matrix

    @cached_property
    def t_values(self) -> Floats:
        """Signed roots of the score statistics of the coefficients and stretch parameters, shape (p,).

        Not estimates over standard errors: those reject true hypotheses too often.
        """
        identity = [FAMILIES[s.family].identity[i] for s, i in self._parameters]
        departure = self.coefficients - np.r_[np.zeros(self.fit.p - len(identity)), identity]
        with threadpool_limits(limits=1, user_api="blas"):
            f = np.array([self._score([c]) for c in range(self.fit.p)])
        return np.asarray(np.copysign(np.sqrt(f), departure))

    def group_squares(self, columns: Sequence[int]) -> float:
        """Sum of squares that gives the F of the score test of several coefficients at once."""
        return self._score(columns) * len(columns) * self.fit.sigma**2

    def drawn(self, count: int, rng: np.random.Generator) -> tuple[Floats, Floats, tuple[Coordinates, ...]]:
        """Draw coefficients and stretches; see :meth:`PolynomialSurface.drawn`.

        The stretch parameters are drawn about their estimates and chosen by their likelihood (sampling,
        importance, resampling; Rubin 1988): the coefficients given them are linear, they themselves are not.
        """
        p, q = self.fit.p - self._extra_count, self._extra_count
        if self.fit.df == 0 or q == 0:
            return super().drawn(count, rng)
        df, root = self.fit.df, np.sqrt(self.fit.weights)
        lower = np.linalg.cholesky(self.fit.sigma**2 * (self.fit.factor @ self.fit.factor.T)[p:, p:])
        tails = np.sqrt(HEAVY / rng.chisquare(HEAVY, PROPOSALS))
        steps = rng.standard_normal((q, PROPOSALS)) * tails
        thetas = self.theta[:, None] + lower @ steps
        logs, fits = np.full(PROPOSALS, -np.inf), []
        for i, theta in enumerate(thetas.T):
            basis, upper = np.linalg.qr(self.matrix_at(theta) * root[:, None])
            projected = basis.T @ (self.data.y * root)
            rest = float(np.square(self.data.y * root).sum() - projected @ projected)
            diagonal = np.abs(np.diag(upper))
            fits.append((upper, projected, rest))
            if np.isfinite(upper).all() and diagonal.min() > SINGULAR * diagonal.max() and rest > 0:
                proposal = -0.5 * (HEAVY + q) * np.log1p(np.square(steps[:, i]).sum() / HEAVY)
                logs[i] = -0.5 * (df + q) * np.log(rest) - np.log(diagonal).sum() - proposal
        weights = np.exp(logs - logs.max())
        chosen = rng.choice(PROPOSALS, count, p=weights / weights.sum())
        sigmas = np.sqrt(np.array([fits[i][2] for i in chosen]) / rng.chisquare(df + q, count))
        noise = rng.standard_normal((p, count)) * sigmas
        coefficients = np.column_stack(
            [np.linalg.solve(fits[i][0], fits[i][1] + noise[:, c]) for c, i in enumerate(chosen)]
        )
        members = [with_theta(self.coordinates.stretches, thetas[:, i]) for i in chosen]
        moved = tuple(replace(self.coordinates, stretches=item) for item in members)
        extra = np.zeros((q, count))
        return self.over_blocks(np.vstack([coefficients, extra])), sigmas, moved

    def _score(self, columns: Sequence[int]) -> float:
        """F of a score test, found once: each is a fit of its own."""
        key = tuple(columns)
        if key not in self._scores:
            self._scores[key] = score_statistic(self, key)
        return self._scores[key]

    @cached_property
    def _scores(self) -> dict[tuple[int, ...], float]:
        return {}

    def matrix_at(self, theta: Floats) -> Floats:
        """Columns of blocks and terms for other stretch parameters, shape (n, p - q)."""
        return with_blocks(self.terms.matrix(self._at(theta)[1]), self.data.block_columns())

    def changes_at(self, theta: Floats) -> Floats:
        """Derivatives of :meth:`matrix_at` by the stretch parameters, shape (q, n, p - q)."""
        members, z = self._at(theta)
        lower, blocks = self.terms.derivatives[0].matrix(z), self.data.block_columns().shape[1]
        found = np.zeros((self._extra_count, len(z), blocks + self.terms.p))
        for c, (j, i) in enumerate(free_parameters(members)):
            rows, columns, weights = self._derivatives[j]
            moves = 2.0 * members[j].change(i, self._on_hull[:, j])
            found[c][:, columns + np.where(columns > 0, blocks, 0)] = (
                moves[:, None] * lower[:, rows] @ weights
            )
        return found

    @cached_property
    def _derivatives(self) -> tuple[tuple[NDArray[np.intp], NDArray[np.intp], Floats], ...]:
        """Of the terms by each factor: what of the matrix is not zero, and its rows and columns."""
        found = []
        for by in self.terms.derivatives[1]:
            rows, columns = np.flatnonzero(by.any(axis=1)), np.flatnonzero(by.any(axis=0))
            found.append((rows, columns, by[np.ix_(rows, columns)]))
        return tuple(found)

    def _at(self, theta: Floats) -> tuple[tuple[Stretch, ...], Floats]:
        """Stretches of other parameters, and the runs in them."""
        members, u = with_theta(self.coordinates.stretches, theta), self._on_hull
        z = 2.0 * u - 1.0
        for j, member in enumerate(members):
            if member.family != "identity":
                z[:, j] = 2.0 * member.inside(u[:, j]) - 1.0
        return members, z

    @cached_property
    def _on_hull(self) -> Floats:
        """Runs on [0, 1] of their hull, shape (n, k); categories so that ``2 u - 1`` is their index."""
        flat = replace(self.coordinates, stretches=())
        u, numeric = 0.5 * (flat.forward(self.data.points) + 1.0), self.space.numeric
        u[:, numeric] = np.clip(u[:, numeric], 0.0, 1.0)
        return np.asarray(u)

    def intervals_of_theta(self, confidence: float = 0.95) -> Floats:
        """Wald limits of the stretch parameters, shape (q, 2)."""
        return self.confidence_intervals(confidence)[self.fit.p - self._extra_count :]

    @classmethod
    def from_json(cls, document: Any) -> StretchedSurface:
        """Read what :meth:`to_json` wrote, checking that it belongs together."""
        return cls.from_form(read_form(StretchedForm, document))

    def to_form(self) -> StretchedForm:
        """Show how it is written."""
        return StretchedForm(
            **self._written(),
            stretches=tuple(
                StretchForm(s.family, tuple(s.parameters), s.expression) for s in self.coordinates.stretches
            ),
            nested_press=self.nested_press,
            plain_press=self.plain_press,
            scores=tuple((c, f) for c, f in self._scores.items() if np.isfinite(f)) or None,
        )

    @classmethod
    def from_form(cls, form: PolynomialForm) -> StretchedSurface:
        """Inverse of :meth:`to_form`."""
        if not isinstance(form, StretchedForm):
            raise fail("it is not stretched")
        space, terms, coordinates, runs = form.fitted()
        if len(form.stretches) != len(space):
            raise fail("stretches should hold one entry per factor")
        ends = zip(form.stretches, coordinates.low, coordinates.high, strict=True)
        stretches = tuple(Stretch(s.family, s.parameters, low, high, s.expression) for s, low, high in ends)
        stretched = replace(coordinates, stretches=stretches)
        presses = form.nested_press, form.plain_press
        surface = stretched_at(space, form.response, runs, terms, stretched, *presses).restored(form)
        surface._scores.update(form.scores or ())
        return surface

    def polynomial(self) -> tuple[Terms, Floats]:
        """Terms and coefficients in stretched units of the predicted surface (blocks averaged)."""
        return self.terms, self.working_coefficients

    @property
    def _parameters(self) -> list[tuple[Stretch, int]]:
        """Member and position of every fitted stretch parameter."""
        members = self.coordinates.stretches
        return [(members[j], i) for j, i in free_parameters(members)]

    def _extra_names(self) -> tuple[str, ...]:
        members, factors = self.coordinates.stretches, self.space.names
        return tuple(
            f"stretch[{factors[j]}].{FAMILIES[members[j].family].parameters[i]}"
            for j, i in free_parameters(members)
        )

    def _residuals(self, coefficients: Floats) -> Floats:
        return super()._residuals(coefficients[: self.fit.p - self._extra_count])

    def _extra_columns(self, points: Floats) -> Floats:
        return _theta_columns(self.terms, self.coordinates, self.working_coefficients, points)


@dataclass(frozen=True)
class StretchForm:
    """How the stretch of a factor is written."""

    family: str
    parameters: tuple[float, ...]
    expression: str


@dataclass(frozen=True, kw_only=True)
class StretchedForm(PolynomialForm):
    """How a stretched polynomial is written."""

    stretches: tuple[StretchForm, ...]
    nested_press: float
    plain_press: float
    scores: tuple[tuple[tuple[int, ...], float], ...] | None = left_out_if_none()


def fit_stretched(
    space: Space,
    response: str,
    data: FitData,
    terms: Terms,
    family: str | Mapping[str, str] = "exp",
    *,
    penalty: float = 1.0,
    seed: int = 0,
) -> StretchedSurface:
    """Choose a stretch per factor and fit the terms in it.

    Parameters
    ----------
    space, response, data, terms
        As for :func:`rsmkit.surfaces.models.polynomial.fit_polynomial`.
    family : str or mapping of str to str
        Family of all numeric factors, or of each by name (``identity`` where not named; a formula of ``x``
        is a fixed map of the user's own).
    penalty : float
        Weight that pulls the stretch towards none.
    seed : int
        For the three random starts of the search.

    Returns
    -------
    StretchedSurface
        The best one found, whether :attr:`StretchedSurface.adopted` or not.

    Raises
    ------
    FitError
        With too few runs, or when no factor gains from being stretched.
    """
    plain = fit_polynomial(space, response, data, terms, box_to_stretch(space, data, terms, family))
    search = StretchSearch(plain, penalty=penalty, seed=seed)
    with threadpool_limits(limits=1, user_api="blas"):  # thousands of tiny decompositions
        stretches = search.find(family)
        errors = search.nested_errors(stretches)
    coordinates = replace(plain.coordinates, stretches=stretches)
    press = float(errors @ errors)
    found = stretched_at(space, response, data, terms, coordinates, press, plain.fit.press)
    return replace(found, nested_errors=errors)


def box_to_stretch(space: Space, data: FitData, terms: Terms, family: str | Mapping[str, str]) -> Coordinates:
    """Coordinates in which factors are stretched: those of runs alone where all values must be positive."""
    families = {family} if isinstance(family, str) else set(family.values())
    box = working if "natpower" in families else covering
    return box(space, data.points, terms)


def _theta_columns(terms: Terms, coordinates: Coordinates, beta: Floats, points: Floats) -> Floats:
    """Derivatives of predictions by the stretch parameters, shape (n, q)."""
    members = coordinates.stretches
    u = 0.5 * (replace(coordinates, stretches=()).forward(points) + 1.0)
    slopes = terms.slopes(coordinates.forward(points), beta)
    columns = [
        2.0 * slopes[:, j] * members[j].change_anywhere(i, u[:, j]) for j, i in free_parameters(members)
    ]
    return np.stack(columns, axis=1) if columns else np.empty((len(points), 0))


def stretched_at(
    space: Space,
    response: str,
    data: FitData,
    terms: Terms,
    coordinates: Coordinates,
    nested_press: float,
    plain_press: float,
) -> StretchedSurface:
    """Fit the terms for a given stretch, with the joint covariance.

    The two sums of squared leave-one-out errors are kept as they are given.
    """
    conditional = fit_polynomial(space, response, data, terms, coordinates).refined()
    theta = theta_of(coordinates.stretches)
    beta = conditional.working_coefficients
    joint = np.hstack([conditional.matrix, _theta_columns(terms, coordinates, beta, data.points)])
    names = (*conditional.names, *(f"stretch {c + 1}" for c in range(len(theta))))
    try:
        fit = least_squares(joint, data.y, data.weights, names=names, has_constant=terms.has_constant)
    except FitError as error:
        raise FitError(f"response {response}: {error}") from None
    fit = replace(
        fit,
        coefficients=np.r_[conditional.fit.coefficients, theta],
        residuals=conditional.fit.residuals,
    )
    return StretchedSurface(space, response, terms, coordinates, data, fit, nested_press, plain_press)
