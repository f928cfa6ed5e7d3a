"""How likely a screening design is to find one active effect, averaged over all effects of its kind."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from rsmkit.design.design import Design
from rsmkit.design.quality.power import check_test, two_sided_power
from rsmkit.errors import RsmkitError
from rsmkit.io.arguments import checked
from rsmkit.io.shown import Shown
from rsmkit.language.space import Floats

__all__ = ["ScreeningPower", "screening_power"]

ALIASED = 1e-9
"""Two columns whose cosine is this near one are the same."""


@dataclass(frozen=True)
class ScreeningPower(Shown):
    """Power of the tests of one kind of effect.

    Parameters
    ----------
    effect : str
        ``linear``, ``quadratic`` or ``interaction``.
    model : str
        What is fitted: the effect ``alone``, with all ``main effects``, or the ``full quadratic`` of the two
        factors concerned.
    average, least : float or None
        Over the tests that can be made; None when there are none.
    tests : int
        Effects of the kind.
    aliased : int
        Of these, effects that a second-order term outside the model looks exactly like.
    not_estimable : int
        Of these, effects whose model cannot be fitted, or leaves nothing to estimate the error from.
    """

    effect: str
    model: str
    average: float | None
    least: float | None
    tests: int
    aliased: int
    not_estimable: int

    @property
    def status(self) -> str:
        """``estimable``, ``aliased`` or ``not estimable``."""
        if self.average is not None:
            return "estimable"
        return "aliased" if self.aliased else "not estimable"


KINDS = (
    ("linear", "alone"),
    ("quadratic", "main effects"),
    ("interaction", "main effects"),
    ("linear", "full quadratic"),
    ("quadratic", "full quadratic"),
    ("interaction", "full quadratic"),
)
"""Jones and Nachtsheim's six cases, in the order of their Table 6."""


@checked
def screening_power(
    design: Design, *, signal_to_noise: float = 2.0, significance: float = 0.05
) -> tuple[ScreeningPower, ...]:
    """Average chance of finding one active effect, in the model that would be fitted to find it.

    Six cases of Jones & Nachtsheim (2011), Journal of Quality Technology 43(1), 1-15, Table 6: a linear
    effect alone; a square, and an interaction, beside all main effects; a linear effect, a square and an
    interaction in the full quadratic of two factors. Each is a t test of one coefficient; blocks of the
    design are fixed effects in every model.

    Parameters
    ----------
    design : Design
        With numeric factors.
    signal_to_noise : float
        Change of the response from the low to the high level over the error standard deviation: twice the
        coefficient in coded units, as in :func:`rsmkit.power_of_terms`.
    significance : float

    Returns
    -------
    tuple of ScreeningPower
        One per case.

    Examples
    --------
    >>> import rsmkit as rk
    >>> space = rk.Space([rk.Factor(name, -1, 1) for name in "abcdef"])
    >>> first, *_ = rk.screening_power(rk.definitive_screening(space, center=1))
    >>> first.effect, first.model, round(first.average, 3)
    ('linear', 'alone', 0.821)
    """
    check_test(signal_to_noise, significance)
    if any(factor.domain.categories for factor in design.space.factors):
        raise RsmkitError("power of screening: categories have no squares; leave categorical factors out")
    always, x = _always(design), design.coded
    second = {(i, j): x[:, i] * x[:, j] for i in range(x.shape[1]) for j in range(i, x.shape[1])}
    found = []
    for effect, model in KINDS:
        powers, tests, aliased, lost = list[float](), 0, 0, 0
        for columns, held, places in _models(x, second, effect, model):
            tests += len(places)
            matrix = np.column_stack([always, *columns])
            if (errors := _errors(matrix)) is None:
                lost += len(places)
                continue
            outside = [column for term, column in second.items() if term not in held]
            for at in (always.shape[1] + place for place in places):
                if _looks_like(matrix, at, outside):
                    aliased += 1
                    continue
                shift = np.array([0.5 * signal_to_noise / errors[at]])
                powers += two_sided_power(shift, len(x) - matrix.shape[1], significance).tolist()
        average = float(np.mean(powers)) if powers else None
        found.append(ScreeningPower(effect, model, average, min(powers, default=None), tests, aliased, lost))
    return tuple(found)


def _errors(matrix: Floats) -> Floats | None:
    """Standard errors of coefficients for error variance one; None without residual degrees of freedom."""
    lengths = np.linalg.norm(matrix, axis=0)
    scaled = matrix / np.where(lengths > 0, lengths, 1.0)
    if len(matrix) <= matrix.shape[1] or np.linalg.matrix_rank(scaled) < matrix.shape[1]:
        return None
    return np.asarray(np.linalg.norm(np.linalg.inv(np.linalg.qr(scaled)[1]), axis=1) / lengths)


def _always(design: Design) -> Floats:
    """Columns in every model: the constant, or one per block."""
    if not design.blocks:
        return np.ones((len(design), 1))
    blocks = np.array(design.blocks)
    return np.asarray((blocks[:, None] == np.unique(blocks)).astype(float))


Pair = tuple[int, int]


def _models(
    x: Floats, second: dict[Pair, Floats], effect: str, model: str
) -> Iterator[tuple[list[Floats], set[Pair], list[int]]]:
    """Columns of each model beside the constant, its second-order terms, and the places that are tested."""
    k = x.shape[1]
    linear = list(x.T)
    if model == "alone":
        for i in range(k):
            yield [linear[i]], set(), [0]
    elif model == "main effects":
        for pair in [(i, i) for i in range(k)] if effect == "quadratic" else combinations(range(k), 2):
            yield [*linear, second[pair]], {pair}, [k]
    else:
        tested = {"linear": [0, 1], "quadratic": [2, 3], "interaction": [4]}[effect]
        for a, b in combinations(range(k), 2):
            held = [(a, a), (b, b), (a, b)]
            yield [linear[a], linear[b], *(second[pair] for pair in held)], set(held), tested


def _looks_like(matrix: Floats, at: int, outside: list[Floats]) -> bool:
    """Whether a column, but for the others of the model, is that of a term outside the model."""
    if not outside:
        return False
    others = np.linalg.qr(np.delete(matrix, at, axis=1))[0]
    tested = matrix[:, at] - others @ (others.T @ matrix[:, at])
    columns = np.column_stack(outside)
    rest = columns - others @ (others.T @ columns)
    lengths = np.linalg.norm(rest, axis=0)
    live = lengths > 1e-8 * (1.0 + np.linalg.norm(columns, axis=0))
    cosines = np.abs(tested @ rest[:, live]) / (np.linalg.norm(tested) * lengths[live])
    return bool((cosines > 1.0 - ALIASED).any())
