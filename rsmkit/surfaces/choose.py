"""Which model a response gets: one table of honest leave-one-out errors, one sentence, one surface.

Every candidate is judged by errors at runs it has not seen: whatever it chooses (a stretch, a power, terms)
it chooses again without the run. A Gaussian process keeps its hyper-parameters, which many runs share.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NoReturn

import numpy as np
from numpy.typing import ArrayLike

from rsmkit.errors import FitError, RsmkitError
from rsmkit.language.space import Space
from rsmkit.language.terms import Terms, full_terms, parse_terms
from rsmkit.surfaces.estimation.fit_data import FitData, checked_data, collapse_duplicates
from rsmkit.surfaces.models.box_cox import BoxCoxSurface, fit_box_cox
from rsmkit.surfaces.models.gaussian_process import fit_gaussian_process
from rsmkit.surfaces.models.polynomial import PolynomialSurface, fit_polynomial
from rsmkit.surfaces.models.polynomial_fit import estimate
from rsmkit.surfaces.models.reduced import nested_press, reduce_surface
from rsmkit.surfaces.models.stretched import StretchedSurface, fit_stretched
from rsmkit.surfaces.models.surface import Surface, surface_from_json
from rsmkit.surfaces.options import SurfaceOptions
from rsmkit.surfaces.reading import fail, number, read_item
from rsmkit.surfaces.statistics.surface_report import stretched_words

__all__ = ["Choice", "ModelScore", "choose_surface"]

MOST_RUNS = 2_000
MOST_RUNS_PROCESS = 500


@dataclass(frozen=True)
class ModelScore:
    """One line of the comparison.

    Parameters
    ----------
    model : str
    rmse_loo : float
        Root mean square leave-one-out error; nan when the model was not possible.
    remark : str
        What was found, or why the model was not possible.
    """

    model: str
    rmse_loo: float
    remark: str = ""


@dataclass(frozen=True, eq=False)
class Choice:
    """The surface of a response, the polynomial to read beside it, and why.

    Parameters
    ----------
    surface : Surface
        The one to predict with.
    polynomial : PolynomialSurface
        Plain polynomial of the same runs; the same object when it was chosen.
    table : tuple of ModelScore
        Best first; a single line when nothing was compared.
    sentence : str
        The choice in words.
    """

    surface: Surface
    polynomial: PolynomialSurface
    table: tuple[ModelScore, ...]
    sentence: str

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
        parts += [self.surface.summary()] if self.surface is not self.polynomial else []
        return "\n\n".join([*parts, self.polynomial.summary()])

    def to_json(self) -> dict[str, Any]:
        """JSON values; inverse of :meth:`from_json`."""
        return {
            "surface": None if self.surface is self.polynomial else self.surface.to_json(),
            "polynomial": self.polynomial.to_json(),
            "table": [[c.model, number(c.rmse_loo), c.remark] for c in self.table],
            "sentence": self.sentence,
        }

    @staticmethod
    def from_json(data: Any) -> Choice:
        """Read what :meth:`to_json` wrote."""
        polynomial = surface_from_json(read_item(data, "polynomial", dict))
        if not isinstance(polynomial, PolynomialSurface):
            raise fail("'polynomial' should be a polynomial surface")
        surface = read_item(data, "surface", object)
        table = []
        for row in read_item(data, "table", list):
            match row:
                case [str() as model, None | float() | int() as error, str() as remark]:
                    table.append(ModelScore(model, math.nan if error is None else float(error), remark))
                case _:
                    raise fail("'table' should hold rows of model, error and remark")
        return Choice(
            polynomial if surface is None else surface_from_json(surface),
            polynomial,
            tuple(table),
            read_item(data, "sentence", str),
        )


def choose_surface(
    space: Space,
    points: ArrayLike,
    y: ArrayLike,
    *,
    response: str = "y",
    options: SurfaceOptions | None = None,
    weights: ArrayLike | None = None,
    blocks: Sequence[str] | None = None,
    deterministic: bool = True,
    seed: int = 0,
) -> Choice:
    """Fit the model the options ask for, or compare them all and take the best.

    Parameters
    ----------
    space, points, y, response, weights, blocks, deterministic
        As for :func:`rsmkit.surfaces.models.polynomial_fit.fit_surface`.
    options : SurfaceOptions, optional
        The ``[surface]`` table of a study file.
    seed : int
        For searches with random starts.

    Raises
    ------
    FitError
        When not even the polynomial can be estimated.
    """
    from threadpoolctl import threadpool_limits

    options = options or SurfaceOptions()
    data = checked_data(space, points, y, weights, blocks)
    if deterministic:
        data = collapse_duplicates(data)
    terms = parse_terms(space, options.terms) if options.terms else full_terms(space, options.order)
    polynomial = estimate(space, response, data, terms)
    with threadpool_limits(limits=1, user_api="blas"):
        if options.model == "auto":
            return _best(_Candidates(space, response, data, terms, polynomial, options, seed))
        return _asked_for(_Candidates(space, response, data, terms, polynomial, options, seed))


class _Candidates:
    """Fits every kind of model to one response."""

    def __init__(
        self,
        space: Space,
        response: str,
        data: FitData,
        terms: Terms,
        polynomial: PolynomialSurface,
        options: SurfaceOptions,
        seed: int,
    ) -> None:
        self.space, self.response, self.data, self.terms = space, response, data, terms
        self.polynomial, self.options, self.seed = polynomial, options, seed

    def reduced(self) -> tuple[PolynomialSurface, float, str]:
        found = reduce_surface(self.polynomial, self.options.reduction)
        remark = f"without {', '.join(found.dropped)}" if found.dropped else "no term left out"
        return found.surface, nested_press(self.polynomial, self.options.reduction), remark

    def stretched(
        self, family: str | dict[str, str], terms: Terms | None = None
    ) -> tuple[Surface, float, str]:
        found = fit_stretched(
            self.space, self.response, self.data, terms or self.terms, family, seed=self.seed
        )  # fmt: skip
        return found, found.nested_press, stretched_words(found)

    def box_cox(self, family: str | dict[str, str] | None = None) -> tuple[Surface, float, str]:
        found = fit_box_cox(self.space, self.response, self.data, self.terms, family, seed=self.seed)
        remark = f"power {found.power:.3g}"
        if isinstance(found.inner, StretchedSurface):
            remark += f", transformed response {stretched_words(found.inner)}"
        return found, found.nested_press, remark

    def cubic(self) -> tuple[Surface, float, str]:
        found = fit_polynomial(self.space, self.response, self.data, full_terms(self.space, 3)).refined()
        return found, found.fit.press, ""

    def gaussian_process(self) -> tuple[Surface, float, str]:
        found = fit_gaussian_process(self.space, self.response, self.data, seed=self.seed)
        return found, found.press, f"{found.kernel}, nugget {found.nugget:.2g}"

    def smooth_gaussian_process(self) -> tuple[Surface, float, str]:
        found = fit_gaussian_process(self.space, self.response, self.data, "rbf", seed=self.seed)
        return found, found.press, f"{found.kernel}, nugget {found.nugget:.2g}"

    @property
    def family(self) -> str | dict[str, str]:
        """Stretch the options ask for."""
        return self.options.stretch_factors or self.options.stretch

    def pool(self) -> dict[str, Callable[[], tuple[Surface, float, str]]]:
        """Everything that `auto` compares beside the polynomial itself."""
        pool: dict[str, Callable[[], tuple[Surface, float, str]]] = {
            "reduced": self.reduced,
            "stretched": lambda: self.stretched(self.family),
            "stretched (power)": lambda: self.stretched("power"),
            "box-cox": self.box_cox,
            "stretched box-cox": lambda: self.box_cox(self.family),
            "cubic": self.cubic,
            "stretched cubic": lambda: self.stretched(self.family, full_terms(self.space, 3)),
            "gaussian process": self.gaussian_process,
            "gaussian process (smooth)": self.smooth_gaussian_process,
        }
        if self.terms.order >= 3:
            del pool["cubic"], pool["stretched cubic"]
        if self.family == "power":
            del pool["stretched (power)"]
        return {name: self._unless_too_many(name, fit) for name, fit in pool.items()}

    def _unless_too_many(
        self, name: str, fit: Callable[[], tuple[Surface, float, str]]
    ) -> Callable[[], tuple[Surface, float, str]]:
        """Refuse what takes far too long with more runs: all but polynomials choose anew without each run."""
        most = MOST_RUNS_PROCESS if "process" in name else MOST_RUNS
        n = len(self.data)
        if n <= most or name == "cubic":
            return fit

        def refuse() -> NoReturn:
            raise FitError(f"it takes too long for {n:,} runs (at most {most:,})")

        return refuse


def _asked_for(candidates: _Candidates) -> Choice:
    polynomial, model, response = candidates.polynomial, candidates.options.model, candidates.response
    plain = ModelScore("polynomial", _rmse(polynomial.fit.press, len(candidates.data)))
    if model == "polynomial":
        return Choice(polynomial, polynomial, (plain,), f"{response}: polynomial, as asked for.")
    fit = candidates.pool()[model]
    try:
        surface, press, remark = fit()
    except FitError as error:
        refused = (plain, ModelScore(model, math.nan, str(error)))
        return Choice(polynomial, polynomial, refused, f"{response}: polynomial, because {error}.")
    table = _sorted([plain, ModelScore(model, _rmse(press, len(candidates.data)), remark)])
    if not _may_win(surface):
        sentence = (
            f"{response}: polynomial, because a stretch does not predict at least 10 % better ({remark})."
        )
        return Choice(polynomial, polynomial, table, sentence)
    return Choice(surface, polynomial, table, f"{response}: {model}, as asked for ({remark}).")


def _best(candidates: _Candidates) -> Choice:
    polynomial, n = candidates.polynomial, len(candidates.data)
    found: dict[str, Surface] = {"polynomial": polynomial}
    rows = [ModelScore("polynomial", _rmse(polynomial.fit.press, n))]
    for model, fit in candidates.pool().items():
        try:
            surface, press, remark = fit()
        except RsmkitError as error:
            rows.append(ModelScore(model, math.nan, str(error)))
            continue
        found[model] = surface
        rows.append(ModelScore(model, _rmse(press, n), remark))
    table, plain = _sorted(rows), rows[0].rmse_loo
    eligible = [row for row in table if row.model in found and _may_win(found[row.model])]
    winner = eligible[0]
    if winner.model == "polynomial":
        sentence = f"{candidates.response}: polynomial, which no other model predicts better than."
        return Choice(polynomial, polynomial, table, sentence)
    sentence = (
        f"{candidates.response}: {winner.model}, with a leave-one-out error of {winner.rmse_loo:.4g} against "
        f"{plain:.4g} of the polynomial (next best: {eligible[1].model}, {eligible[1].rmse_loo:.4g})."
    )
    return Choice(found[winner.model], polynomial, table, sentence)


def _may_win(surface: Surface) -> bool:
    """Whether a model may be chosen: a stretch only when it clearly beats the same terms without it."""
    stretched = surface.inner if isinstance(surface, BoxCoxSurface) else surface
    return not isinstance(stretched, StretchedSurface) or stretched.adopted


def _sorted(rows: list[ModelScore]) -> tuple[ModelScore, ...]:
    return tuple(sorted(rows, key=lambda row: row.rmse_loo if math.isfinite(row.rmse_loo) else math.inf))


def _rmse(press: float, n: int) -> float:
    return float(np.sqrt(press / n))
