"""Response surfaces as scikit-learn estimators, for pipelines, grid searches and cross-validation."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.utils.validation import check_array, check_is_fitted, validate_data

from rsmkit.errors import FitError, RsmkitError
from rsmkit.language.space import Factor, Floats, Space
from rsmkit.surfaces.choose import Choice, choose_surface
from rsmkit.surfaces.options import SurfaceOptions

__all__ = ["SurfaceRegressor"]


class SurfaceRegressor(RegressorMixin, BaseEstimator):  # type: ignore[misc]
    """A response surface of any kind with `fit` and `predict`.

    The box of the training points becomes the design space. Columns that never vary are ignored.

    Parameters
    ----------
    model : str, default="polynomial"
        As in the ``[surface]`` table of a study: a word of :data:`rsmkit.surfaces.kinds.KINDS` or ``auto``.
    order : int, default=2
        Highest degree of the polynomial; lowered when the training points cannot estimate so many terms.
    stretch : str, default="exp"
        Family of stretched factors.

    Attributes
    ----------
    choice_ : Choice
        The surface with its statistics; ``choice_.surface`` and ``choice_.summary()``.
    order_ : int
        Degree that was used.
    n_features_in_ : int

    Examples
    --------
    >>> import numpy as np
    >>> x = np.random.default_rng(0).uniform(size=(20, 2))
    >>> float(SurfaceRegressor().fit(x, x[:, 0] ** 2 + x[:, 1]).score(x, x[:, 0] ** 2 + x[:, 1]))
    1.0
    """

    def __init__(self, model: str = "polynomial", order: int = 2, stretch: str = "exp") -> None:
        self.model = model
        self.order = order
        self.stretch = stretch

    def fit(self, X: ArrayLike, y: ArrayLike, sample_weight: ArrayLike | None = None) -> SurfaceRegressor:
        """Fit the surface.

        Parameters
        ----------
        X : array, shape (n, k)
        y : array, shape (n,)
        sample_weight : array, shape (n,), optional
            Inversely proportional to the variances; rows of weight zero are left out. Models that choose
            something (all but ``polynomial``) take whole weights as numbers of repetitions.

        Raises
        ------
        ValueError
            When not even a constant can be fitted, or a parameter means nothing, with the nearest word that
            does.
        """
        points, response = validate_data(self, X, y, y_numeric=True, dtype=np.float64)
        weights = None
        if sample_weight is not None:
            weights = _weights(sample_weight, len(points))
            points, response, weights = (a[weights > 0] for a in (points, response, weights))
        if not len(points):
            raise ValueError("all sample weights are zero; at least one must be positive")
        order = np.lexsort([response, *points.T])  # results do not depend on the order of the rows
        points, response = points[order], response[order]
        if weights is not None:
            weights = weights[order]
            if self.model != "polynomial" and (weights == np.round(weights)).all():
                repeats = weights.astype(int)
                points, response = np.repeat(points, repeats, axis=0), np.repeat(response, repeats)
                weights = None
        self._varying = np.ptp(points, axis=0) > 0
        if not self._varying.any():
            self._varying[0] = True
        points = points[:, self._varying]
        space = Space(
            Factor(f"x{j}", low - (low == high), high + (low == high))
            for j, (low, high) in enumerate(zip(points.min(axis=0), points.max(axis=0), strict=True))
        )
        self.choice_, self.order_ = self._choose(space, points, np.asarray(response, float), weights)
        return self

    def predict(self, X: ArrayLike) -> Floats:
        """Predict the response, shape (n,)."""
        check_is_fitted(self)
        points = validate_data(self, X, reset=False, dtype=np.float64)
        return self.choice_.surface.predict(points[:, self._varying])

    def predict_interval(self, X: ArrayLike, confidence: float = 0.95) -> tuple[Floats, Floats, Floats]:
        """Predict with an interval for new runs: mean, low and high, each of shape (n,)."""
        check_is_fitted(self)
        points = validate_data(self, X, reset=False, dtype=np.float64)
        return self.choice_.surface.predict(points[:, self._varying], interval=confidence)

    def _choose(self, space: Space, points: Floats, y: Floats, weights: Floats | None) -> tuple[Choice, int]:
        """Take the highest order, up to the one asked for, that can be estimated."""
        if self.order not in (1, 2, 3):
            raise ValueError(f"order must be 1, 2 or 3, got {self.order!r}")
        wrong = SurfaceOptions(model=self.model, stretch=self.stretch).wrong_words()
        if wrong:
            raise ValueError("; ".join(f"{key} {message}" for key, message in wrong))
        problem: RsmkitError = FitError("no runs")
        for order in range(self.order, -1, -1):
            options: Any = SurfaceOptions(model=self.model, order=order, stretch=self.stretch)  # type: ignore[arg-type]
            try:
                chosen = choose_surface(
                    space, points, y, options=options, weights=weights, deterministic=False, seed=0
                )
            except FitError as error:
                problem = error
                continue
            except RsmkitError as error:
                raise ValueError(str(error)) from None
            return chosen, order
        raise ValueError(str(problem))


def _weights(given: ArrayLike, n: int) -> Floats:
    """Weights of the rows as an array, shape (n,); one number stands for all."""
    weights = np.asarray(check_array(given, ensure_2d=False, dtype=np.float64, input_name="sample_weight"))
    if weights.ndim == 0:
        weights = np.full(n, float(weights))
    if weights.shape != (n,):
        raise ValueError(f"sample_weight must hold one weight per row, shape ({n},); got {weights.shape}")
    if (weights < 0).any():
        raise ValueError(f"sample_weight must not be negative; the least is {weights.min():g}")
    return weights
