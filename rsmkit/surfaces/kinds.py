"""The register of surface kinds: one row for each word of ``[surface] model`` and each variant `auto` tries.

Whoever must know what kinds there are loops over :data:`KINDS`: the study file, `auto`, the reader of
``model.json``, reports, the explorer page, the scikit-learn estimator. A kind of one's own is one more row::

    KINDS["nearest"] = Kind("the value of the nearest run", fit_nearest, "nearest", nearest_form)

and :func:`rsmkit.testing.check_surface_kind` tells whether it keeps the contract. The register lies above the
models because it knows their statistics too; what a row needs is loaded when it is used.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, cast

from rsmkit.errors import FitError, RsmkitError
from rsmkit.surfaces.kind_rows import Form, Kind, ModelFit, ModelRequest

if TYPE_CHECKING:
    import numpy as np

    from rsmkit.language.space import Floats
    from rsmkit.language.terms import Terms
    from rsmkit.surfaces.estimation.processes.correlation import Kernel
    from rsmkit.surfaces.models.box_cox import BoxCoxSurface
    from rsmkit.surfaces.models.stretched import StretchedSurface
    from rsmkit.surfaces.models.surface import Surface
    from rsmkit.surfaces.posterior import Posterior

__all__ = [
    "AUTO",
    "KINDS",
    "Form",
    "Kind",
    "ModelFit",
    "ModelRequest",
    "fit_kind",
    "form_of",
    "page_model",
    "posterior_of",
    "read_surface",
    "words",
]

AUTO = "auto"
"""The word that stands for the best of all kinds that compete."""


def words() -> tuple[str, ...]:
    """Everything ``[surface] model`` may say."""
    return (*(word for word, kind in KINDS.items() if kind.is_word), AUTO)


def fit_kind(kind: Kind, request: ModelRequest) -> ModelFit:
    """Fit a kind, unless there are too many runs for it.

    Raises
    ------
    FitError
        When it cannot be fitted to these runs.
    """
    n = len(request.data)
    if kind.most_runs is not None and n > kind.most_runs:
        raise FitError(f"it takes too long for {n:,} runs (at most {kind.most_runs:,})")
    groups = request.data.random
    if groups and kind.grouped == "never":
        raise FitError(f"it takes runs as independent, and these share random {', '.join(groups)}")
    if request.space.equalities and not kind.summed:
        raise FitError("factors that keep to a sum would not keep to it when each is stretched")
    if not groups and kind.grouped == "only":
        raise FitError("the runs share no random groups")
    return kind.fit(request)


def form_of(surface: Surface) -> Form:
    """What can be done with a surface.

    Raises
    ------
    RsmkitError
        When no kind in the register makes such surfaces.
    """
    name = getattr(surface, "form", "")
    for kind in KINDS.values():
        if kind.makes == name:
            return kind.form()
    raise RsmkitError(
        f"no kind of surface makes a {type(surface).__name__}; "
        "add a row for it to rsmkit.surfaces.kinds.KINDS"
    )


def read_surface(document: Any) -> Surface:
    """Make a surface from what its ``to_json`` returned.

    Raises
    ------
    RsmkitError
        If anything is missing, of the wrong type, or does not belong together.
    """
    from rsmkit.surfaces.reading import fail

    name = document.get("model") if isinstance(document, dict) else None
    for kind in KINDS.values():
        if kind.makes == name:
            surface: Surface = kind.form().read(document)
            return surface
    raise fail(f"has the unknown model {name!r:.40}")


def page_model(surface: Surface, confidence: float = 0.95) -> dict[str, Any] | None:
    """Give everything the explorer page needs to predict a response with its interval.

    None for a surface of a kind that the page cannot evaluate.
    """
    draw = form_of(surface).page
    return draw(surface, confidence) if draw else None


def posterior_of(
    surface: Surface, count: int, rng: np.random.Generator, *, deterministic: bool = True
) -> Posterior:
    """Draw surfaces from what the runs leave open.

    Parameters
    ----------
    surface : Surface
        Of any kind in the register.
    count : int
        How many.
    rng : Generator
    deterministic : bool
        Whether runs repeat without noise.
    """
    from rsmkit.surfaces.posterior import interval_posterior

    surface = getattr(surface, "surface", surface)
    make = form_of(surface).posterior or interval_posterior
    return make(surface, count, rng, deterministic)


# ---------------------------------------------------------------------- what surfaces there are


def _polynomial_form() -> Form:
    from rsmkit.surfaces.models.polynomial import PolynomialSurface
    from rsmkit.surfaces.page_models import polynomial_page
    from rsmkit.surfaces.posterior import polynomial_posterior
    from rsmkit.surfaces.statistics.reports import surface_report as its

    return Form(
        PolynomialSurface.from_json,
        its.polynomial_report,
        its.polynomial_summary,
        its.polynomial_html,
        polynomial_page,
        posterior=polynomial_posterior,
        newer=("considered",),
    )


def _mixed_form() -> Form:
    from rsmkit.surfaces.models.mixed import MixedSurface
    from rsmkit.surfaces.page_models import mixed_page
    from rsmkit.surfaces.statistics.reports import mixed_report as its

    return Form(MixedSurface.from_json, its.mixed_report, its.mixed_summary, its.mixed_html, mixed_page)


def _glm_form() -> Form:
    from rsmkit.surfaces.models.glm import GlmSurface
    from rsmkit.surfaces.page_models import glm_page
    from rsmkit.surfaces.statistics.reports.glm_report import glm_report, glm_summary

    return Form(GlmSurface.from_json, glm_report, glm_summary, page=glm_page, newer=("bias_reduced",))


def _stretched_form() -> Form:
    from rsmkit.surfaces.models.stretched import StretchedSurface
    from rsmkit.surfaces.page_models import polynomial_page
    from rsmkit.surfaces.posterior import polynomial_posterior
    from rsmkit.surfaces.statistics.reports import surface_report as its

    return Form(
        StretchedSurface.from_json,
        its.stretched_report,
        its.stretched_summary,
        its.stretched_html,
        polynomial_page,
        posterior=polynomial_posterior,
    )


def _box_cox_form() -> Form:
    from rsmkit.surfaces.models.box_cox import BoxCoxSurface
    from rsmkit.surfaces.page_models import box_cox_page
    from rsmkit.surfaces.posterior import box_cox_posterior
    from rsmkit.surfaces.statistics.reports.box_cox_report import box_cox_report, box_cox_summary

    def report(surface: BoxCoxSurface) -> dict[str, Any]:
        return box_cox_report(surface, form_of(surface.inner).report(surface.inner))

    def summary(surface: BoxCoxSurface, _: dict[str, Any]) -> str:
        inner = form_of(surface.inner)
        return box_cox_summary(surface, inner.summary(surface.inner, inner.report(surface.inner)))

    return Form(BoxCoxSurface.from_json, report, summary, page=box_cox_page, posterior=box_cox_posterior)


def _process_form() -> Form:
    from rsmkit.surfaces.models.gaussian_process import GaussianProcessSurface
    from rsmkit.surfaces.page_models import process_page
    from rsmkit.surfaces.posterior import process_posterior
    from rsmkit.surfaces.statistics.reports import process_report as its

    return Form(
        GaussianProcessSurface.from_json,
        its.process_report,
        its.process_summary,
        page=process_page,
        diagnostics=its.process_diagnostics,
        posterior=process_posterior,
        newer=("kriging",),
    )


# ---------------------------------------------------------------------- how they are fitted

WEAK_STRETCH = "a stretch does not predict at least 10 % better"


def _fit_polynomial(request: ModelRequest) -> ModelFit:
    fit = request.polynomial.fit
    return ModelFit(request.polynomial, fit.press, errors=fit.loo_residuals)


def _fit_counts(request: ModelRequest) -> ModelFit:
    from dataclasses import replace

    import numpy as np

    from rsmkit.surfaces.estimation.counts.scoring import Counts
    from rsmkit.surfaces.models.glm import fit_glm, no_estimate

    counts = request.counts or Counts("poisson", np.ones(len(request.data)))
    why = no_estimate(request.polynomial, counts.distribution, counts.size)
    found = fit_glm(request.polynomial, counts.distribution, counts.size, bias_reduced=bool(why))
    found = replace(found, note=f"bias-reduced estimates (Firth), because {why}") if why else found
    return ModelFit(found, float((found.loo_residuals**2).sum()))


def _fit_reduced(request: ModelRequest) -> ModelFit:
    from rsmkit.surfaces.models.reduction.reduced import reduce_surface
    from rsmkit.surfaces.models.reduction.reduced_errors import nested_errors

    found = reduce_surface(request.polynomial, request.reduction)
    remark = f"without {', '.join(found.dropped)}" if found.dropped else "no term left out"
    if request.data.random:
        return ModelFit(
            found.surface, found.surface.fit.press, remark, errors=found.surface.fit.loo_residuals
        )
    return _nested(found.surface, nested_errors(request.polynomial, request.reduction), remark)


def _never_in_groups(request: ModelRequest) -> bool:
    """Runs in groups are not left out one by one with their terms chosen anew, which is what is compared."""
    return not request.data.random


def _fit_stretched(request: ModelRequest) -> ModelFit:
    return _stretched(request, request.terms, request.stretch)


def _fit_stretched_by_power(request: ModelRequest) -> ModelFit:
    return _stretched(request, request.terms, "power")


def _fit_stretched_cubic(request: ModelRequest) -> ModelFit:
    from rsmkit.language.space_terms import space_terms

    return _stretched(request, space_terms(request.space, 3), request.stretch)


def _stretched(request: ModelRequest, terms: Terms, stretch: str | Mapping[str, str]) -> ModelFit:
    from rsmkit.surfaces.models.stretched import fit_stretched
    from rsmkit.surfaces.statistics.reports.surface_report import stretched_words

    found = fit_stretched(request.space, request.response, request.data, terms, stretch, seed=request.seed)
    refusal = "" if found.adopted else WEAK_STRETCH
    return ModelFit(found, found.nested_press, stretched_words(found), refusal, found.nested_errors)


def _fit_box_cox(request: ModelRequest) -> ModelFit:
    from rsmkit.surfaces.models.box_cox import fit_box_cox

    found = fit_box_cox(request.space, request.response, request.data, request.terms, seed=request.seed)
    return ModelFit(found, found.nested_press, f"power {found.power:.3g}", errors=found.nested_errors)


def _fit_stretched_box_cox(request: ModelRequest) -> ModelFit:
    from rsmkit.surfaces.models.box_cox import fit_box_cox
    from rsmkit.surfaces.statistics.reports.surface_report import stretched_words

    found = fit_box_cox(
        request.space, request.response, request.data, request.terms, request.stretch, seed=request.seed
    )
    inner = cast("StretchedSurface", found.inner)  # because a stretch was asked for
    remark = f"power {found.power:.3g}, transformed response {stretched_words(inner)}"
    refusal = "" if inner.adopted else WEAK_STRETCH
    return ModelFit(found, found.nested_press, remark, refusal, found.nested_errors)


def _fit_cubic(request: ModelRequest) -> ModelFit:
    from rsmkit.language.space_terms import space_terms

    return _with_terms(request, space_terms(request.space, 3))


def _fit_special_cubic(request: ModelRequest) -> ModelFit:
    from dataclasses import replace

    from rsmkit.language.space_terms import space_terms

    full = space_terms(request.space, 3)
    kept = tuple(e for e in full.exponents if sum(e) < 3 or max(e) == 1)
    return _with_terms(request, replace(full, exponents=kept))


def _with_terms(request: ModelRequest, terms: Terms) -> ModelFit:
    from rsmkit.surfaces.models.polynomial import fit_polynomial

    found = fit_polynomial(request.space, request.response, request.data, terms).refined()
    if not found.fit.df:
        raise FitError("it has as many coefficients as there are runs, so that nothing tells how good it is")
    return ModelFit(found, found.fit.press, errors=found.fit.loo_residuals)


def _fit_process(request: ModelRequest) -> ModelFit:
    return _process(request, "matern52")


def _fit_smooth_process(request: ModelRequest) -> ModelFit:
    return _process(request, "rbf")


def _process(request: ModelRequest, kernel: Kernel) -> ModelFit:
    from rsmkit.surfaces.models.gaussian_process import fit_gaussian_process, nested_errors

    found = fit_gaussian_process(request.space, request.response, request.data, kernel)
    errors = nested_errors(found) if request.compared else found.loo_residuals
    return _nested(found, errors, f"{found.kernel}, nugget {found.nugget:.2g}")


def _never(_: ModelRequest) -> bool:
    return False


def _nested(surface: Surface, errors: Floats, remark: str) -> ModelFit:
    return ModelFit(surface, float(errors @ errors), remark, errors=errors)


def _below_cubic(request: ModelRequest) -> bool:
    return request.terms.order < 3


def _below_special_cubic(request: ModelRequest) -> bool:
    """Whether three components of a mixture blend by less than a special cubic term."""
    return len(request.terms.components) > 2 and request.terms.order < 3


def _not_by_power_anyway(request: ModelRequest) -> bool:
    return request.stretch != "power"


# ---------------------------------------------------------------------- the register

TERMS = ("order", "terms")
STRETCH = (*TERMS, "stretch", "stretch_factors")
CHOOSING_ANEW = 2_000
"""Most runs for kinds that choose anew without each of them."""
INVERTING = 500
"""Most runs for kinds that invert a matrix of their size many times."""

KINDS: dict[str, Kind] = {
    "polynomial": Kind(
        "the terms below", _fit_polynomial, "polynomial", _polynomial_form, TERMS, grouped="too"
    ),
    "reduced": Kind(
        "only those that earn their place",
        _fit_reduced,
        "polynomial",
        _polynomial_form,
        (*TERMS, "reduction"),
        competes=_never_in_groups,
        most_runs=CHOOSING_ANEW,
        grouped="too",
    ),
    "stretched": Kind(
        "factors mapped monotonically where that predicts clearly better",
        _fit_stretched,
        "stretched",
        _stretched_form,
        STRETCH,
        most_runs=CHOOSING_ANEW,
        summed=False,
    ),
    "stretched (power)": Kind(
        "",
        _fit_stretched_by_power,
        "stretched",
        _stretched_form,
        TERMS,
        is_word=False,
        competes=_not_by_power_anyway,
        most_runs=CHOOSING_ANEW,
        summed=False,
    ),
    "box-cox": Kind(
        "the response transformed", _fit_box_cox, "box-cox", _box_cox_form, TERMS, most_runs=CHOOSING_ANEW
    ),
    "stretched box-cox": Kind(
        "", _fit_stretched_box_cox, "box-cox", _box_cox_form, STRETCH, most_runs=CHOOSING_ANEW, summed=False
    ),
    "cubic": Kind("", _fit_cubic, "polynomial", _polynomial_form, is_word=False, competes=_below_cubic),
    "special cubic": Kind(
        "", _fit_special_cubic, "polynomial", _polynomial_form, is_word=False, competes=_below_special_cubic
    ),
    "stretched cubic": Kind(
        "",
        _fit_stretched_cubic,
        "stretched",
        _stretched_form,
        ("stretch", "stretch_factors"),
        is_word=False,
        competes=_below_cubic,
        most_runs=CHOOSING_ANEW,
        summed=False,
    ),
    "gaussian process": Kind("", _fit_process, "gaussian process", _process_form, most_runs=INVERTING),
    "gaussian process (smooth)": Kind(
        "", _fit_smooth_process, "gaussian process", _process_form, is_word=False, most_runs=INVERTING
    ),
    "mixed": Kind(
        "",
        _fit_polynomial,
        "mixed",
        _mixed_form,
        TERMS,
        is_word=False,
        competes=_never,
        grouped="only",
    ),
    "glm": Kind("", _fit_counts, "glm", _glm_form, TERMS, is_word=False, competes=_never),
}
"""By word, in the order in which `auto` tries them; the first is what the others are compared with."""
