"""Terms of models that must be fitted anew to be judged: counts, and runs in random groups."""

from __future__ import annotations

import numpy as np
from scipy.special import chdtrc

from rsmkit.errors import FitError
from rsmkit.surfaces.estimation.mixed.full_likelihood import full_deviance
from rsmkit.surfaces.models.glm import GlmSurface, fit_glm
from rsmkit.surfaces.models.mixed import MixedSurface, fit_mixed
from rsmkit.surfaces.models.polynomial import PolynomialSurface, fit_polynomial
from rsmkit.surfaces.models.reduction.reduction_steps import Subset
from rsmkit.surfaces.models.reduction.term_chooser import Method, TermChooser, penalty

__all__ = ["fitted_like", "refitted"]


def refitted(surface: PolynomialSurface, method: Method) -> TermChooser:
    """What judges the terms of a surface of counts, or of runs in random groups."""
    if isinstance(surface, GlmSurface):
        return _CountChooser(surface, method)
    assert isinstance(surface, MixedSurface)
    return _MixedChooser(surface, method)


def fitted_like(surface: PolynomialSurface, plain: PolynomialSurface) -> PolynomialSurface:
    """Fit other terms of the same runs, fitted by ordinary least squares, as a surface was."""
    if isinstance(surface, GlmSurface):
        return fit_glm(plain, surface.distribution, surface.size, bias_reduced=surface.bias_reduced)
    assert isinstance(surface, MixedSurface)
    return fit_mixed(plain, surface.method)


class _CountChooser(TermChooser):
    """Deviances of subsets of terms."""

    def __init__(self, surface: GlmSurface, method: Method) -> None:
        super().__init__(surface, method)
        self.surface = surface
        self.known: dict[Subset, float] = {}

    def deviance(self, terms: Subset) -> float:
        if terms not in self.known:
            self.known[terms] = self.surface.deviance_of(self.steps.columns_of(terms))
        return self.known[terms]

    def criterion(self, terms: Subset) -> float:
        """See :class:`TermChooser`."""
        return self.deviance(terms) + penalty(self.method, len(self.steps.columns_of(terms)), self.n)

    def p_value(self, small: Subset, large: Subset) -> float:
        """Likelihood-ratio test of the larger model against the smaller one."""
        df = len(self.steps.columns_of(large - small))
        return float(chdtrc(df, max(self.deviance(small) - self.deviance(large), 0.0)))


class _MixedChooser(TermChooser):
    """Likelihoods and tests of subsets of terms, the variances estimated anew with each."""

    def __init__(self, surface: MixedSurface, method: Method) -> None:
        super().__init__(surface, method)
        self.surface = surface
        self.known: dict[Subset, float] = {}
        self.fits: dict[Subset, MixedSurface | None] = {}

    def criterion(self, terms: Subset) -> float:
        """See :class:`TermChooser`; the variances are parameters too."""
        if terms not in self.known:
            mixed, columns = self.surface.mixed, self.steps.columns_of(terms)
            deviance = full_deviance(mixed.matrix[:, columns], mixed.y, mixed.columns)
            count = len(columns) + len(mixed.variances)
            self.known[terms] = deviance + penalty(self.method, count, self.n)
        return self.known[terms]

    def p_value(self, small: Subset, large: Subset) -> float:
        """F test of what the larger model has more, as its degrees of freedom allow."""
        found = self._fit(large)
        if found is None:
            return float("nan")
        columns = self.steps.columns_of(large)
        more = [columns.index(column) for column in self.steps.columns_of(large - small)]
        return found.test(np.eye(len(columns))[more]).p

    def _fit(self, terms: Subset) -> MixedSurface | None:
        if terms not in self.fits:
            own = self.surface
            kept = own.terms.subset(self.steps.chosen(terms))
            plain = fit_polynomial(own.space, own.response, own.data, kept, own.coordinates)
            try:
                self.fits[terms] = fit_mixed(plain, own.method)
            except FitError:
                self.fits[terms] = None
        return self.fits[terms]
