"""Fitting one polynomial surface; :mod:`rsmkit.surfaces.choose` offers every other model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from numpy.typing import ArrayLike

from rsmkit.io.arguments import checked
from rsmkit.language.space import Space
from rsmkit.language.space_terms import space_terms
from rsmkit.language.terms import Terms
from rsmkit.surfaces.estimation.fit_data import FitData, checked_data, collapse_duplicates
from rsmkit.surfaces.estimation.mixed.kenward_roger import DfMethod
from rsmkit.surfaces.fitted_response import FittedResponse
from rsmkit.surfaces.models.mixed import fit_mixed
from rsmkit.surfaces.models.polynomial import PolynomialSurface, fit_polynomial

__all__ = ["estimate", "fit_surface"]


@checked
def fit_surface(
    space: Space,
    points: ArrayLike,
    y: ArrayLike,
    *,
    response: str = "y",
    order: int = 2,
    terms: Terms | None = None,
    weights: ArrayLike | None = None,
    blocks: Sequence[str] | None = None,
    random: Mapping[str, Sequence[str]] | None = None,
    degrees: DfMethod = "kenward-roger",
    deterministic: bool = True,
    run_order: Sequence[int] | None = None,
) -> FittedResponse[PolynomialSurface]:
    """Fit a polynomial surface with statsmodels and measure everything about it.

    Parameters
    ----------
    space : Space
        Factors; coefficients are reported in its coded units. Points may lie outside its bounds.
    points : array, shape (n, k)
        Natural units.
    y : array, shape (n,)
    response : str
        Name of the response, for reports and messages.
    order : int
        All terms up to this degree, unless `terms` says which.
    terms : Terms, optional
    weights : array, shape (n,), optional
        Positive, inversely proportional to the variance of each run.
    blocks : sequence of str, optional
        Block of each run; block effects are estimated and averaged over in predictions.
    random : mapping of str to sequence of str, optional
        Groups that are a sample of all groups (plots, days): per kind the group of each run. The surface is
        then a :class:`rsmkit.surfaces.models.mixed.MixedSurface`.
    degrees : {"kenward-roger", "kenward-roger-observed", "satterthwaite"}
        With `random`, how degrees of freedom are found.
    deterministic : bool
        Whether repeated runs that agree exactly count as one (a simulator) or each (an experiment).
    run_order : sequence of int, optional
        When each run was made: its place among all runs, from 1. By default they are given in that order.

    Raises
    ------
    FitError
        When terms cannot be estimated from these runs, naming them.
    """
    data = checked_data(space, points, y, weights, blocks, random=random, order=run_order)
    if deterministic:
        data = collapse_duplicates(data)
    return FittedResponse(estimate(space, response, data, terms or space_terms(space, order), degrees))


def estimate(
    space: Space, response: str, data: FitData, terms: Terms, degrees: DfMethod = "kenward-roger"
) -> PolynomialSurface:
    """Fit given terms to checked runs: coefficients by statsmodels, then refined, the rest by one QR.

    With random groups by restricted maximum likelihood instead.
    """
    from rsmkit.surfaces.estimation import ols

    surface = fit_polynomial(space, response, data, terms)
    if data.random:
        return fit_mixed(surface, degrees)
    return surface.refined(ols.estimate(surface.matrix, data.y, data.weights))
