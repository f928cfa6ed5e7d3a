"""What a design can detect: the power of the tests of its terms."""

from __future__ import annotations

from itertools import combinations, product

import numpy as np

from rsmkit.design.design import Design
from rsmkit.design.optimal.criteria import precision_of
from rsmkit.design.quality.variance import inverse_information
from rsmkit.design.region import box
from rsmkit.errors import RsmkitError
from rsmkit.io.arguments import checked
from rsmkit.language.space import Floats, Space
from rsmkit.language.space_terms import space_terms
from rsmkit.language.terms import Exponents, Terms

__all__ = ["check_test", "power_of_terms", "two_sided_power"]

SOME = 500
"""Blends over which the change that a term makes is looked at."""


@checked
def power_of_terms(
    design: Design,
    *,
    order: int = 2,
    terms: Terms | None = None,
    signal_to_noise: float = 2.0,
    significance: float = 0.05,
) -> dict[str, float]:
    """Chance that its test finds each term, if it has a given size.

    Parameters
    ----------
    order, terms
        The model.
    signal_to_noise : float
        Change of the response from the low to the high level, or from one category to another, over the error
        standard deviation; the coefficient of a numeric term in coded units is half of it.
    significance : float
        Size of the two-sided t tests, and of the F tests.

    Returns
    -------
    dict
        Name to power. Each column of the model: the t test of a numeric term, or of the difference between a
        category and the first one, averaged over the other categories. Each term with more than one degree of
        freedom besides: its F test when two categories differ by the signal and all others are half-way
        between them, the least that any such difference can give, for the pair that is hardest to tell apart.

    Raises
    ------
    RsmkitError
        When no degree of freedom is left for the error.

    Notes
    -----
    In the models of mixtures columns are judged by the change they make over the region; a pure component is
    tested against the mean of the others. Noncentral t and F with the covariance of the coefficients;
    categories as deviations from the mean over their levels, as in F tests of type III. In a model without
    all that its terms contain, columns are taken as they are (differences from the first category).
    """
    check_test(signal_to_noise, significance)
    terms = (space_terms(design.space, order) if terms is None else terms).with_contrasts("treatment")
    freedom = len(design) - terms.p - (len(set(design.blocks)) - 1 if design.blocks else 0)
    if freedom < 1:
        raise RsmkitError(
            f"power: {len(design)} runs for {terms.p} coefficients leave nothing to estimate the error from: "
            "add runs"
        )
    centred = terms.hierarchical
    X = terms.sum_matrix(design.coded) if centred else terms.matrix(design.coded)
    covariance = inverse_information(X, precision_of(len(design), design.blocks or None, None))
    if terms.components:
        return _of_blends(terms, design.space, covariance, freedom, signal_to_noise, significance)
    contrasts = _contrasts(terms) if centred else np.eye(terms.p)
    categories = [
        sum(1 for e, count in zip(terms.exponents[i], terms.levels, strict=True) if e and count)
        for i in terms.column_terms
    ]
    errors = np.sqrt(np.einsum("ij,jk,ik->i", contrasts, covariance, contrasts))
    shifts = 0.5 * signal_to_noise * 2.0 ** np.array(categories) / errors
    powers = two_sided_power(shifts, freedom, significance)
    found = dict(zip(terms.names(design.space), powers.tolist(), strict=True))
    if centred:
        found |= _of_several_levels(terms, design, covariance, freedom, signal_to_noise, significance)
    return found


def check_test(signal_to_noise: float, significance: float) -> None:
    """Refuse sizes of effects and of tests that are none."""
    if not 0.0 < significance < 1.0:
        raise RsmkitError(f"power: the significance of a test lies between 0 and 1, got {significance:g}")
    if not np.isfinite(signal_to_noise):
        raise RsmkitError(f"power: the signal to noise should be a finite number, got {signal_to_noise:g}")


def two_sided_power(shifts: Floats, freedom: int, significance: float) -> Floats:
    """Power of t tests of effects that are so many standard errors large."""
    from scipy.stats import nct, t

    limit = float(t.ppf(1.0 - significance / 2.0, freedom))
    # The far tail, at most the normal probability of -shift, comes out as nan where it is below 1e-13.
    far = np.nan_to_num(nct.cdf(-limit, freedom, shifts))
    return np.asarray(nct.sf(limit, freedom, shifts) + far)


def _of_blends(
    terms: Terms, space: Space, covariance: Floats, freedom: int, signal: float, significance: float
) -> dict[str, float]:
    """Power in a mixture model, by name of the column.

    A pure component against the mean of the others, when it changes the response by the signal between its
    least and its greatest amount; any other column, when it does so between two blends of the region.
    """
    region = box(space)
    blends = np.vstack([region.nodes(SOME), region.sample(SOME, 0)])
    spans = np.ptp(terms.matrix(blends), axis=0)
    contrasts = np.eye(terms.p)
    pure = [m for m, e in enumerate(terms.columns) if sum(e) == 1 and e.index(1) in _variables(terms)]
    for m in pure:
        contrasts[m, [other for other in pure if other != m]] = -1.0 / (len(pure) - 1)
    errors = np.sqrt(np.einsum("ij,jk,ik->i", contrasts, covariance, contrasts))
    powers = two_sided_power(signal / np.maximum(spans, 1e-12) / errors, freedom, significance)
    return dict(zip(terms.names(space), powers.tolist(), strict=True))


def _variables(terms: Terms) -> list[int]:
    return [terms.variable_factors.index(j) for j in terms.components]


def _of_several_levels(
    terms: Terms, design: Design, covariance: Floats, freedom: int, signal: float, significance: float
) -> dict[str, float]:
    """F tests of the terms with more than one column, by name."""
    from scipy.stats import f, ncf

    found = {}
    for index, exponents in enumerate(terms.exponents):
        columns = np.flatnonzero(np.array(terms.column_terms) == index)
        if len(columns) == 1:
            continue
        information = np.linalg.inv(covariance[np.ix_(columns, columns)])
        least = min(float(pattern @ information @ pattern) for pattern in _patterns(exponents, terms.levels))
        limit = float(f.ppf(1.0 - significance, len(columns), freedom))
        name = Terms((exponents,), (0,) * terms.k).names(design.space.names)[0]
        found[name] = float(ncf.sf(limit, len(columns), freedom, (0.5 * signal) ** 2 * least))
    return found


def _contrasts(terms: Terms) -> Floats:
    """What each column of the usual model says, in coefficients of the centred one, shape (p, p)."""
    rows = np.zeros((terms.p, terms.p))
    start = 0
    for exponents in terms.exponents:
        block: Floats = np.ones((1, 1))
        for power, count in zip(exponents, terms.levels, strict=True):
            if power and count:  # a level less the first, whose effect is less the sum of the others
                less = np.eye(count - 1) + np.ones((count - 1, count - 1))
                block = np.asarray(np.kron(block, less), float)
        rows[start : start + len(block), start : start + len(block)] = block
        start += len(block)
    return rows


def _patterns(exponents: Exponents, levels: tuple[int, ...]) -> list[Floats]:
    """Effects of a term of size one: +1 and -1 at two categories of each factor, 0 at the others."""
    of_factors = []
    for power, count in zip(exponents, levels, strict=True):
        if power and count:
            effects = [np.eye(count)[a] - np.eye(count)[b] for a, b in combinations(range(count), 2)]
            of_factors.append([effect[1:] for effect in effects])
    found = []
    for parts in product(*of_factors):
        pattern = np.ones(1)
        for part in parts:
            pattern = np.kron(pattern, part)
        found.append(pattern)
    return found
