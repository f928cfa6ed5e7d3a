"""Which model a response gets: one table of honest leave-one-out errors, one sentence, one surface.

Every candidate is judged by errors at runs it has not seen: whatever it chooses (a stretch, a power, terms,
lengths and nugget of a process) it chooses again without the run. The best of many is partly the luckiest;
what is done about it, see :mod:`rsmkit.surfaces.choice_rule`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Annotated, Any, cast

import numpy as np
from numpy.typing import ArrayLike

from rsmkit.errors import FitError, RsmkitError, one_of
from rsmkit.io.arguments import checked
from rsmkit.io.strict_types import ReadBy
from rsmkit.language.space import Floats, Space
from rsmkit.language.space_terms import read_terms, space_terms
from rsmkit.language.terms import Terms
from rsmkit.surfaces.choice_rule import winner
from rsmkit.surfaces.estimation.counts.scoring import Counts
from rsmkit.surfaces.estimation.fit_data import FitData, checked_data, collapse_duplicates
from rsmkit.surfaces.fitted_response import FittedResponse, surface_from_json
from rsmkit.surfaces.kinds import AUTO, KINDS, ModelFit, ModelRequest, fit_kind, words
from rsmkit.surfaces.models.glm import GlmSurface
from rsmkit.surfaces.models.mixed import MixedSurface
from rsmkit.surfaces.models.polynomial import PolynomialSurface, fit_polynomial
from rsmkit.surfaces.models.reduction.reduced import reduce_surface
from rsmkit.surfaces.models.surface import Surface
from rsmkit.surfaces.options import SurfaceOptions
from rsmkit.surfaces.polynomial_fit import estimate
from rsmkit.surfaces.reading import ModelDocument, fail, number

__all__ = ["Choice", "ModelScore", "choose_surface"]

PLAIN = "polynomial"
"""The kind that the others are compared with, and that is kept beside them."""
PROCESS = "gaussian process"
"""The kind that can be fitted whatever the terms."""
REDUCED = "reduced"
"""The kind that leaves terms out, of counts too."""
COUNTED = "glm"
"""The kind of responses that are counts, with which no other is compared."""

LEFT_OUT = "Left out: "
APART = 1e-8
"""Part of a column that must be no combination of others."""

UNCERTAIN = (
    "the same runs chose the model, so its intervals do not hold: 95 % intervals held 76-80 % in a noisy "
    "trial with 20 runs; ask for one model where intervals matter"
)
"""What is said of intervals where many models were compared."""


@dataclass(frozen=True)
class ModelScore:
    """One line of the comparison.

    Parameters
    ----------
    model : str
    rmse_loo : float
        Root mean square leave-one-out error, every run by its weight; nan when the model was not possible.
    remark : str
        What was found, or why the model was not possible.
    """

    model: str
    rmse_loo: float
    remark: str = ""


@dataclass(frozen=True, eq=False)
class Choice(ModelDocument):
    """The surface of a response, the polynomial to read beside it, and why.

    Parameters
    ----------
    surface : FittedResponse
        The one to predict with.
    polynomial : FittedResponse
        Plain polynomial of the same runs; the same object when it was chosen.
    table : tuple of ModelScore
        Best first; a single line when nothing was compared.
    sentence : str
        The choice in words.
    """

    surface: FittedResponse[Surface]
    polynomial: FittedResponse[PolynomialSurface]
    table: tuple[ModelScore, ...]
    sentence: str

    @property
    def model(self) -> str:
        """The word for the model chosen, as the table and the sentence have it: ``stretched box-cox``."""
        told = self.sentence.removeprefix(f"{self.polynomial.response}: ")
        named = [score.model for score in self.table if told.startswith(f"{score.model},")]
        return max(named, key=len, default=self.surface.form)

    @property
    def left_out(self) -> str:
        """Which terms are left out because runs have failed, in words; empty when none are."""
        _, found, told = self.sentence.partition(LEFT_OUT)
        return found + told

    def report(self) -> dict[str, Any]:
        """Report of the polynomial, and of the chosen model with the comparison."""
        return {
            **self.polynomial.report(),
            "chosen": None if self.surface is self.polynomial else self.surface.report(),
            "comparison": [
                {
                    "model": c.model,
                    "rmse_loo": number(c.rmse_loo),
                    "remark": c.remark,
                }
                for c in self.table
            ],
            "choice": self.sentence,
            "choice_note": UNCERTAIN if len(self.table) > 2 else "",
        }

    def summary(self) -> str:
        """Comparison, sentence and statistics as text."""
        width = max(len(c.model) for c in self.table)
        head = f"{'model'.ljust(width)}  error (leave-one-out)"
        lines = []
        for c in self.table:
            error = "-" if math.isnan(c.rmse_loo) else format(c.rmse_loo, ".5g")
            lines.append(f"{c.model.ljust(width)}  {error:>21}  {c.remark}")
        parts = [self.sentence, "\n".join([head, *lines])] if len(lines) > 1 else [self.sentence]
        parts += [f"Note: {UNCERTAIN}."] if len(lines) > 2 else []  # auto compared many
        parts += [self.surface.summary()] if self.surface is not self.polynomial else []
        return "\n\n".join([*parts, self.polynomial.summary()])

    def to_form(self) -> ChoiceForm:
        """Show how it is written: a polynomial that was chosen stands there once."""
        return ChoiceForm(
            None if self.surface is self.polynomial else self.surface,
            self.polynomial,
            tuple((score.model, number(score.rmse_loo), score.remark) for score in self.table),
            self.sentence,
        )

    @classmethod
    def from_form(cls, form: ChoiceForm) -> Choice:
        """Inverse of :meth:`to_form`."""
        scores = ((model, math.nan if error is None else error, why) for model, error, why in form.table)
        table = tuple(ModelScore(*score) for score in scores)
        return cls(form.surface or form.polynomial, form.polynomial, table, form.sentence)


def _read_polynomial(document: Any) -> FittedResponse[PolynomialSurface]:
    for kind in (PolynomialSurface, MixedSurface, GlmSurface):
        if isinstance(document, dict) and document.get("model") == kind.form:
            return FittedResponse(kind.from_json(document))
    raise fail("should be a polynomial surface")


@dataclass(frozen=True)
class ChoiceForm:
    """How a choice is written."""

    surface: Annotated[FittedResponse[Surface], ReadBy(surface_from_json)] | None
    polynomial: Annotated[FittedResponse[PolynomialSurface], ReadBy(_read_polynomial)]
    table: tuple[tuple[str, float | None, str], ...]
    sentence: str


@checked
def choose_surface(
    space: Space,
    points: ArrayLike,
    y: ArrayLike,
    *,
    response: str = "y",
    options: SurfaceOptions | None = None,
    weights: ArrayLike | None = None,
    blocks: Sequence[str] | None = None,
    random: Mapping[str, Sequence[str]] | None = None,
    deterministic: bool = True,
    seed: int = 0,
    counts: Counts | None = None,
    failed_runs: int = 0,
    run_order: Sequence[int] | None = None,
) -> Choice:
    """Fit the model the options ask for, or compare them all and take the best.

    Parameters
    ----------
    space, points, y, response, weights, blocks, random, deterministic
        As for :func:`rsmkit.surfaces.polynomial_fit.fit_surface`.
    options : SurfaceOptions, optional
        The ``[surface]`` table of a study file.
    seed : int
        For searches with random starts.
    counts : Counts, optional
        When `y` counts events or successes: the terms are then those of the logarithm of a rate or the logit
        of a probability, whatever model the options ask for.
    failed_runs : int
        Runs that were planned for this model and failed. Terms of the order asked for that the others cannot
        tell apart are then left out, and the choice says which; without failed runs they are refused.
    run_order : sequence of int, optional
        When each run was made: its place among all runs, from 1. By default they are given in that order.

    Raises
    ------
    FitError
        When not even the polynomial can be estimated.
    RsmkitError
        For a model that is none.
    """
    from threadpoolctl import threadpool_limits

    options = options or SurfaceOptions()
    one_of("surface model", options.model, words())
    data = checked_data(space, points, y, weights, blocks, random=random, order=run_order)
    if counts:
        return _counted(space, response, data, options, counts)
    if deterministic:
        data = collapse_duplicates(data)
    terms, polynomial, lowered = _polynomial_beside(space, response, data, options, failed_runs)
    request = ModelRequest(
        space,
        response,
        data,
        terms,
        polynomial,
        stretch=options.stretch_factors or options.stretch,
        reduction=options.reduction,
        seed=seed,
    )
    with threadpool_limits(limits=1, user_api="blas"):
        choice = _best(request) if options.model == AUTO else _asked_for(options.model, request)
    return replace(choice, sentence=f"{choice.sentence} {lowered}") if lowered else choice


def _counted(space: Space, response: str, data: FitData, options: SurfaceOptions, counts: Counts) -> Choice:
    """Fit counts with all the terms there are, or those that earn their place."""
    terms = read_terms(space, options.terms) if options.terms else space_terms(space, options.order)
    plain = fit_polynomial(space, response, data, terms)
    request = ModelRequest(space, response, data, terms, plain, counts=counts)
    found = fit_kind(KINDS[COUNTED], request)
    surface = cast("GlmSurface", found.surface)
    others = "" if options.model == PLAIN else f"; model = '{options.model}' is for other responses"
    if options.model == REDUCED:
        reduction = reduce_surface(surface, options.reduction)
        surface = cast("GlmSurface", reduction.surface)
        others = f", without {', '.join(reduction.dropped)}" if reduction.dropped else ", no term left out"
    fitted = FittedResponse(surface)
    errors = surface.loo_residuals
    score = ModelScore(counts.distribution, float(np.sqrt(errors @ errors / len(data))))
    return Choice(fitted, fitted, (score,), f"{response}: {counts.distribution}, as it is a count{others}.")


def _polynomial_beside(
    space: Space, response: str, data: FitData, options: SurfaceOptions, failed_runs: int
) -> tuple[Terms, PolynomialSurface, str]:
    """The polynomial that is compared with or kept beside the others, its terms, and what was left out.

    A Gaussian process needs no polynomial: where the runs cannot tell its terms apart, one of lower order
    stands beside it. Where that is so because runs have failed, the terms that can be told apart do.
    """
    terms = read_terms(space, options.terms) if options.terms else space_terms(space, options.order)
    try:
        return terms, estimate(space, response, data, terms), ""
    except FitError:
        if options.terms or not (failed_runs or options.model in (AUTO, PROCESS)):
            raise
        if failed_runs:
            kept = _told_apart(space, data, terms)
            out = [name for name in terms.names(space) if name not in kept.names(space)]
            told = f"{LEFT_OUT}{', '.join(out)}; {failed_runs} runs failed, and the other {len(data)} cannot"
            return kept, estimate(space, response, data, kept), f"{told} tell {_them(out)} from other terms."
        for order in range(options.order - 1, 0, -1):
            lower = space_terms(space, order)
            with suppress(FitError):
                found = estimate(space, response, data, lower)
                told = f"{len(data)} runs cannot tell the {terms.p} terms of order {options.order} apart"
                return lower, found, f"The polynomial beside it has order {order}: {told}."
        raise


def _told_apart(space: Space, data: FitData, terms: Terms) -> Terms:
    """The terms, in order, that are no combinations of earlier ones; one fewer than the runs at most."""
    matrix = terms.matrix(space.encode(data.points))
    owner = np.array(terms.column_terms)
    basis = np.linalg.qr(data.block_columns())[0]
    kept = []
    for index, exponents in enumerate(terms.exponents):
        columns = matrix[:, owner == index]
        longer = np.linalg.qr(np.column_stack([basis, columns]))
        sizes = np.abs(np.diag(longer[1]))[basis.shape[1] :]
        told = len(sizes) == columns.shape[1] and (sizes > APART * np.linalg.norm(columns, axis=0)).all()
        if told and longer[0].shape[1] < len(data):
            kept.append(exponents)
            basis = longer[0]
    return terms.subset(kept)


def _them(names: Sequence[str]) -> str:
    return "it" if len(names) == 1 else "them"


def _asked_for(word: str, request: ModelRequest) -> Choice:
    response, polynomial = request.response, FittedResponse(request.polynomial)
    plain = ModelScore(PLAIN, _plain_rmse(request))
    try:
        found = fit_kind(KINDS[word], request)
    except FitError as error:
        refused = (plain, ModelScore(word, math.nan, str(error)))
        return Choice(polynomial, polynomial, refused, f"{response}: {PLAIN}, because {error}.")
    if found.surface is request.polynomial:
        return Choice(polynomial, polynomial, (plain,), f"{response}: {PLAIN}, as asked for.")
    table = _sorted([plain, ModelScore(word, _rmse(found, request.data), found.remark)])
    if found.refusal:
        sentence = f"{response}: {PLAIN}, because {found.refusal} ({found.remark})."
        return Choice(polynomial, polynomial, table, sentence)
    told = f" ({found.remark})" if found.remark else ""
    return Choice(
        FittedResponse(found.surface), polynomial, table, f"{response}: {word}, as asked for{told}."
    )


def _best(request: ModelRequest) -> Choice:
    polynomial = FittedResponse(request.polynomial)
    found: dict[str, ModelFit] = {}
    rows, compared = [], replace(request, compared=True)
    for word, kind in KINDS.items():
        if not kind.competes(request):
            continue
        try:
            found[word] = fit_kind(kind, compared)
        except RsmkitError as error:
            rows.append(ModelScore(word, math.nan, str(error)))
            continue
        rows.append(ModelScore(word, _rmse(found[word], request.data), found[word].remark))
    table = _sorted(rows)
    eligible = [row for row in table if row.model in found and not found[row.model].refusal]
    spread, weights = float(request.data.y.std()), _relative_weights(request.data)
    word = winner(found, [row.model for row in eligible], spread, weights)
    (first,), others = ([row for row in eligible if (row.model == word) is own] for own in (True, False))
    surface, plain = found[word].surface, _plain_rmse(request)
    if surface is request.polynomial:
        best = eligible[0]
        clearly = "" if best is first else "clearly "
        within = "" if best is first else f" ({best.model}: {best.rmse_loo:.4g} against {plain:.4g})"
        sentence = f"{request.response}: {PLAIN}, which no other model predicts {clearly}better than{within}."
        return Choice(polynomial, polynomial, table, sentence)
    sentence = (
        f"{request.response}: {first.model}, with a leave-one-out error of {first.rmse_loo:.4g} against "
        f"{plain:.4g} of the {PLAIN} (next best: {others[0].model}, {others[0].rmse_loo:.4g})."
    )
    return Choice(FittedResponse(surface), polynomial, table, sentence)


def _sorted(rows: list[ModelScore]) -> tuple[ModelScore, ...]:
    return tuple(sorted(rows, key=lambda row: row.rmse_loo if math.isfinite(row.rmse_loo) else math.inf))


def _rmse(found: ModelFit, data: FitData) -> float:
    if found.errors is None or data.weights is None:
        return float(np.sqrt(found.press / len(data)))
    return float(np.sqrt((_relative_weights(data) * found.errors**2).mean()))


def _plain_rmse(request: ModelRequest) -> float:
    fit = request.polynomial.fit
    return _rmse(ModelFit(request.polynomial, fit.press, errors=fit.loo_residuals), request.data)


def _relative_weights(data: FitData) -> Floats:
    """Weights of the runs, one on average."""
    if data.weights is None:
        return np.ones(len(data))
    return np.asarray(data.weights / data.weights.mean())
