"""What a row of the register of surface kinds holds, what it is asked for and what it gives."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from rsmkit.language.space import Floats, Space
    from rsmkit.language.terms import Terms
    from rsmkit.surfaces.estimation.counts.scoring import Counts
    from rsmkit.surfaces.estimation.fit_data import FitData
    from rsmkit.surfaces.models.polynomial import PolynomialSurface
    from rsmkit.surfaces.models.reduction.term_chooser import Method
    from rsmkit.surfaces.models.surface import Surface
    from rsmkit.surfaces.posterior import Posterior

__all__ = ["Form", "Kind", "ModelFit", "ModelRequest"]


@dataclass(frozen=True)
class ModelRequest:
    """What a kind is asked to fit.

    Parameters
    ----------
    space : Space
    response : str
    data : FitData
        The runs, checked.
    terms : Terms
        Those of the study file's `order` or `terms`.
    polynomial : PolynomialSurface
        Of these terms, already fitted.
    stretch : str or mapping of str to str
        Family of stretched factors, of all or of each by name.
    reduction : {"aicc", "aic", "bic", "backward", "forward", "all"}
        How terms are chosen.
    seed : int
        For searches with random starts.
    compared : bool
        Whether kinds are compared, so that what it costs to judge this one alike is worth it.
    counts : Counts, optional
        Of responses that are counts of events or of successes.
    """

    space: Space
    response: str
    data: FitData
    terms: Terms
    polynomial: PolynomialSurface
    stretch: str | Mapping[str, str] = "exp"
    reduction: Method = "aicc"
    seed: int = 0
    compared: bool = False
    counts: Counts | None = None


@dataclass(frozen=True)
class ModelFit:
    """What came out.

    Parameters
    ----------
    surface : Surface
    press : float
        Sum of squared errors at each run, with everything that was chosen chosen again without it.
    remark : str
        What was found, in a few words.
    refusal : str
        Why it should not be taken although it could be fitted; nothing when it may.
    errors : array, shape (n,), optional
        The errors that `press` sums, by which `auto` tells a better model from a lucky one.
    """

    surface: Surface
    press: float
    remark: str = ""
    refusal: str = ""
    errors: Floats | None = None


@dataclass(frozen=True)
class Form:
    """What can be done with a surface, whichever kind has fitted it.

    Parameters
    ----------
    read : callable
        Inverse of the surface's ``to_json``; raises RsmkitError for what cannot be read.
    report : callable
        Statistics of a surface as JSON values; `response` and `model` at least, see ``docs/surfaces.md``.
    summary : callable
        Of a surface and its report: the same as text.
    html : callable, optional
        Of a surface and its report: for notebooks; the summary when left out.
    page : callable, optional
        Of a surface and a confidence: what ``page/models.js`` needs to predict with an interval, as JSON
        values. Without it the explorer page says that it cannot draw the surface.
    diagnostics : callable, optional
        ``observed``, ``fitted`` and ``studentised`` of the runs, shape (n,) each, where the report has none.
    posterior : callable, optional
        Of a surface, a count, a generator and whether runs repeat without noise: surfaces drawn from what the
        runs leave open (:class:`rsmkit.surfaces.posterior.Posterior`); guessed from intervals when left out.
    newer : tuple of str
        Keys of ``to_json`` that files of earlier versions do not have, and that `read` can do without.
    """

    read: Callable[[Any], Any]
    report: Callable[[Any], dict[str, Any]]
    summary: Callable[[Any, dict[str, Any]], str]
    html: Callable[[Any, dict[str, Any]], str] | None = None
    page: Callable[[Any, float], dict[str, Any]] | None = None
    diagnostics: Callable[[Any], dict[str, Floats]] | None = None
    posterior: Callable[[Any, int, Any, bool], Posterior] | None = None
    newer: tuple[str, ...] = ()


def _always(_: ModelRequest) -> bool:
    return True


@dataclass(frozen=True)
class Kind:
    """One row of the register.

    Parameters
    ----------
    help : str
        What the reference of the study file says of the word; nothing where the word says it all.
    fit : callable
        Fits a :class:`ModelRequest`; raises FitError when that is not possible.
    makes : str
        ``Surface.form`` of its surfaces, which stands as ``model`` in ``model.json``. Kinds that make the
        same share one form.
    form : callable
        Gives the :class:`Form` of its surfaces.
    options : tuple of str
        Fields of :class:`rsmkit.surfaces.options.SurfaceOptions` that it reads.
    is_word : bool
        Whether a study may ask for it; else only `auto` tries it.
    competes : callable
        Whether `auto` tries it for a request.
    most_runs : int, optional
        With more it would take far too long; no limit when None.
    grouped : {"never", "too", "only"}
        Whether it fits runs that share random groups.
    summed : bool
        Whether it fits factors that keep to a sum, as the components of a mixture do.
    """

    help: str
    fit: Callable[[ModelRequest], ModelFit]
    makes: str
    form: Callable[[], Form]
    options: tuple[str, ...] = ()
    is_word: bool = True
    competes: Callable[[ModelRequest], bool] = _always
    most_runs: int | None = None
    grouped: Literal["never", "too", "only"] = "never"
    summed: bool = True
