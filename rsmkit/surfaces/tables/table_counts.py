"""Responses of a table that are counts."""

from __future__ import annotations

from collections.abc import Sequence

from rsmkit.errors import RsmkitError
from rsmkit.language.space import Floats
from rsmkit.surfaces.estimation.counts.scoring import DistributionName
from rsmkit.surfaces.fitted_response import FittedResponse
from rsmkit.surfaces.models.polynomial import PolynomialSurface

__all__ = ["check_counts", "counted"]


def check_counts(
    distribution: DistributionName | None,
    trials: str | None,
    exposure: str | None,
    weights: str | None,
    random: Sequence[str],
    *,
    bias_reduced: bool,
) -> None:
    """Refuse what does not go with counts, or needs them."""
    if trials and distribution != "binomial":
        raise RsmkitError("trials go with the distribution binomial; name it")
    if exposure and distribution != "poisson":
        raise RsmkitError("an exposure goes with the distribution poisson; name it")
    if distribution and (weights or random):
        raise RsmkitError("counts have neither weights nor random groups here; leave them out")
    if bias_reduced and not distribution:
        raise RsmkitError("bias-reduced estimates are of counts; name their distribution")


def counted(
    plain: PolynomialSurface,
    distribution: DistributionName,
    size: Floats | None,
    rows: Sequence[int],
    *,
    bias_reduced: bool,
) -> FittedResponse[PolynomialSurface]:
    """The same terms fitted to counts."""
    from rsmkit.surfaces.models.glm import checked_sizes, fit_glm

    sizes = checked_sizes(plain.response, distribution, plain.data.y, size, rows)
    return FittedResponse(fit_glm(plain, distribution, sizes, bias_reduced=bias_reduced))
