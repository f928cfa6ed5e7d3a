"""What the Fit view of the explorer page shows of a surface beside its report: limits, quantiles, equations.

Everything is computed here; the page only draws it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.special import chdtri, fdtri, ndtri, stdtrit

from rsmkit.errors import RsmkitError
from rsmkit.language.space import Floats
from rsmkit.surfaces.choose import Choice
from rsmkit.surfaces.fitted_response import FittedResponse
from rsmkit.surfaces.kinds import form_of
from rsmkit.surfaces.models.box_cox import BoxCoxSurface, box_cox, box_cox_curve
from rsmkit.surfaces.models.glm import GlmSurface
from rsmkit.surfaces.models.polynomial import PolynomialSurface
from rsmkit.surfaces.models.surface import Surface
from rsmkit.surfaces.reading import number, numbers
from rsmkit.surfaces.statistics.equations.equation_terms import equation_terms
from rsmkit.surfaces.statistics.influence import SIGNIFICANCE, flagged_runs

__all__ = ["fit_scene"]

POLYNOMIALS = ("polynomial", "stretched")
"""Forms whose runs are independent and whose errors are normal: what is judged run by run below."""
WRITTEN = ("polynomial", "mixed", "glm")
"""Forms that predict what their polynomial says, or a function of it."""
INVERSES = {"binomial": "logistic", "poisson": "exponential"}
"""What makes the mean of a count from its polynomial."""
CONFIDENCE = 0.95


def fit_scene(
    surface: FittedResponse[Surface],
    choice: Choice | None = None,
    labels: Sequence[str] = (),
    runs: Sequence[int] = (),
) -> dict[str, Any]:
    """Collect it as JSON values.

    Parameters
    ----------
    surface : FittedResponse
        The one that is predicted with.
    choice : Choice, optional
        Why this kind of surface, and the polynomial beside it.
    labels : sequence of str, optional
        What people call each run of the surface; their number when left out.
    runs : sequence of int, optional
        Which of the runs on the page each of them is, -1 for those that are not drawn: of these only the
        flagged ones are kept.
    """
    data = surface.data
    count = len(data)
    own = surface.surface if isinstance(surface.surface, PolynomialSurface) else None
    whole = _run_by_run(own) if own is not None and surface.form in POLYNOMIALS else {}
    flagged = whole.pop("flagged", [])
    places = list(runs) or list(range(count))
    kept = [i for i in range(count) if places[i] >= 0 or any(item["run"] == i for item in flagged)]
    columns = {
        "labels": list(labels) or [str(i + 1) for i in range(count)],
        "runs": places,
        "order": list(data.order or ()),
        **_diagnostics(surface),
        **_groups(data.random or {}),
        "quantiles": whole.pop("quantiles", None),
    }
    is_own = own is not None or isinstance(surface.surface, BoxCoxSurface)
    beside: FittedResponse[Any] | None = (
        choice.polynomial if choice and not is_own else surface if is_own else None
    )
    return {
        "kind": surface.form,
        "columns": {name: [column[i] for i in kept] for name, column in columns.items() if column},
        "groups": [str(name) for name in data.random or {}],
        "flagged": [{**item, "run": kept.index(item["run"])} for item in flagged],
        "comparison": _comparison(choice),
        "polynomial": _equations(beside, surface) if beside else None,
        **whole,
    }


def _diagnostics(surface: FittedResponse[Surface]) -> dict[str, list[float | None]]:
    """Observed, predicted, residuals and what else the kind of surface knows of each run."""
    reported = surface.report().get("diagnostics")
    if reported:
        return {name: values for name, values in reported.items() if len(values) == len(surface.data)}
    form = form_of(surface)
    made = form.diagnostics(surface.surface) if form.diagnostics else {}
    return {name: numbers(np.asarray(values, float)) for name, values in made.items()}


def _groups(random: Mapping[str, Sequence[str]]) -> dict[str, list[str]]:
    """Groups of the runs that are a sample, such as whole plots: the label of each run's group."""
    return {f"group {name}": [str(label) for label in labels] for name, labels in random.items()}


def _run_by_run(surface: PolynomialSurface) -> dict[str, Any]:
    fit = surface.fit
    flagged = [
        {"run": item.run, "reasons": list(item.reasons), "p": number(item.p_bonferroni)}
        for item in flagged_runs(surface)
    ]
    deleted = float(stdtrit(fit.df - 1, 1.0 - 0.5 * SIGNIFICANCE / fit.n)) if fit.df > 1 else math.nan
    return {
        "flagged": flagged,
        "limits": {
            "leverage": 3.0 * fit.p / fit.n,
            "cooks_distance": number(float(fdtri(fit.p, fit.df, 0.5))) if fit.df else None,
            "deleted": number(deleted),
        },
        "quantiles": numbers(_quantiles_by_run(fit.studentised)),
        "effects": _effects(surface),
        "box_cox_limit": _box_cox_limit(surface),
        "parameters": fit.p,
    }


def _effects(surface: PolynomialSurface) -> dict[str, Any]:
    """Size of each term for normal plots (Daniel 1959), with the error that most of them show (Lenth 1989).

    t values, or where no degrees of freedom are left the coefficients in units of equal precision.
    """
    keep = [i for i, group in enumerate(surface.groups) if group not in ("", "block", "stretch")]
    if not keep:
        return {"names": []}
    saturated = surface.fit.df == 0
    lengths = np.linalg.norm(surface.coded_factor[keep], axis=1)
    sizes = np.asarray(surface.coefficients[keep] / lengths if saturated else surface.t_values[keep], float)
    known = np.isfinite(sizes)
    keep, sizes = [i for i, is_known in zip(keep, known, strict=True) if is_known], sizes[known]
    count = len(keep)
    if not count:
        return {"names": []}
    places = np.abs(sizes).argsort().argsort()
    first = 1.5 * float(np.median(np.abs(sizes)))
    small = np.abs(sizes)[np.abs(sizes) <= 2.5 * first]
    limit = None if saturated else number(float(stdtrit(surface.fit.df, 0.5 + 0.5 * CONFIDENCE)))
    return {
        "unit": "coefficient over its standard error at sigma = 1" if saturated else "t",
        "names": [surface.names[i] for i in keep],
        "sizes": numbers(sizes),
        "half_normal": numbers(_blom(2 * count)[count:][places]),
        "normal": numbers(_quantiles_by_run(sizes)),
        "error": number(1.5 * float(np.median(small))) if len(small) else None,
        "limit": limit,
    }


def _box_cox_limit(surface: PolynomialSurface) -> float | None:
    """Largest sum of squares of the powers in the interval (Box & Cox 1964)."""
    try:
        least = box_cox_curve(surface, np.array([box_cox(surface, CONFIDENCE).power]))[0]
    except RsmkitError:
        return None
    return number(float(least) * math.exp(float(chdtri(1, 1.0 - CONFIDENCE)) / surface.fit.n))


def _blom(count: int) -> Floats:
    """Median positions of ordered normal values (Blom 1958)."""
    return np.asarray(ndtri((np.arange(1, count + 1) - 0.375) / (count + 0.25)))


def _quantiles_by_run(values: Floats) -> Floats:
    """Normal quantile of each value by its rank; nan where it is not known."""
    found = np.full(len(values), np.nan)
    known = np.flatnonzero(np.isfinite(values))
    found[known[np.argsort(values[known], kind="stable")]] = _blom(len(known))
    return found


def _equations(polynomial: FittedResponse[Any], surface: FittedResponse[Surface]) -> dict[str, Any]:
    """Equations of a surface or of the polynomial beside it; `back` turns them into what is predicted."""
    own = surface.surface
    if isinstance(own, BoxCoxSurface) and own.inner.units != "stretched":
        back = {"function": "power", "power": own.power}
        return {"is_beside": False, "texts": {}, "equations": equation_terms(own.inner), "back": back}
    found = {
        "is_beside": polynomial is not surface,
        "texts": polynomial.report().get("equations") or {},
        "equations": [] if polynomial.form not in WRITTEN else equation_terms(polynomial.surface),
    }
    if isinstance(own, GlmSurface):
        found |= {"texts": {}, "back": {"function": INVERSES[own.distribution]}}
    return found


def _comparison(choice: Choice | None) -> dict[str, Any] | None:
    if choice is None:
        return None
    told = choice.report()
    return {"rows": told["comparison"], "reason": told["choice"], "note": told["choice_note"]}
