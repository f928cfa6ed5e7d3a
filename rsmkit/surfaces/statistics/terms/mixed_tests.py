"""F tests of whole terms of a mixed surface, each against the variances that it depends on.

Type III: each term after all others, with contrasts that add to zero over the levels of a category (R's
``lmerTest::anova``). Type II: after all terms that do not contain it, in the metric of the fitted covariance
(R's ``car::Anova``; Fox, *Applied Regression Analysis and Generalized Linear Models*, 3rd ed., 2016, 8.2).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from rsmkit.language.space import Floats
from rsmkit.surfaces.estimation.mixed.kenward_roger import FixedTest
from rsmkit.surfaces.models.mixed import MixedSurface
from rsmkit.surfaces.reading import number
from rsmkit.surfaces.statistics.terms.anova import LINEAR
from rsmkit.surfaces.statistics.terms.term_tests import (
    combinations_tested,
    containing_terms,
    sum_coded,
    term_members,
)

__all__ = ["MixedTermTest", "mixed_term_report", "mixed_term_tests"]


@dataclass(frozen=True)
class MixedTermTest:
    """The tests of one term.

    Parameters
    ----------
    term : str
        ``x1``, ``x1*tool``, ``x1^2``; ``block`` for fixed blocks.
    type2, type3 : FixedTest
    """

    term: str
    type2: FixedTest
    type3: FixedTest


def mixed_term_tests(surface: MixedSurface) -> list[MixedTermTest]:
    """Test every term but the constant, in the order of the columns."""
    names, members = term_members(surface)
    own_to_sum = sum_coded(surface)
    whitened = own_to_sum @ surface.into_coded @ surface.mixed.factor
    containing, found = containing_terms(surface), []
    for t, columns in enumerate(members):
        third = surface.test(combinations_tested(names[t], own_to_sum[columns]))
        larger = [] if names[t] == LINEAR else containing[t]  # the others hold the constant with it
        second = surface.test(_after_others(whitened, members, t, larger) @ own_to_sum) if larger else third
        found.append(MixedTermTest(names[t], second, third))
    return found


def mixed_term_report(surface: MixedSurface) -> list[dict[str, Any]]:
    """The tests as JSON values; ``reason`` says why there is none."""
    rows = []
    for test in mixed_term_tests(surface):
        third = _values(test.type3)
        refusal = {"reason": test.type3.refusal} if test.type3.refusal else {}
        rows.append(
            {
                "term": test.term,
                **{key: third[key] for key in ("df", "numerator_df", "denominator_df", "F", "p")},
                "type2": _values(test.type2),
                "type3": third,
                **refusal,
            }
        )
    return rows


def _values(test: FixedTest) -> dict[str, Any]:
    return {
        "df": test.numerator_df,
        "numerator_df": test.numerator_df,
        "denominator_df": number(test.denominator_df),
        "F": number(test.f),
        "p": number(test.p),
    }


def _after_others(whitened: Floats, members: list[np.ndarray], t: int, larger: list[int]) -> Floats:
    """Combinations of the coefficients that say what term `t` adds to all but the terms `larger`.

    The columns of the model, whitened, are those of the inverse up to a rotation.
    """
    columns = np.linalg.inv(whitened)
    left_out = np.concatenate([members[u] for u in larger])
    others = np.setdiff1d(np.arange(len(columns)), np.concatenate([left_out, members[t]]))
    kept = columns[:, np.concatenate([others, members[t]])]
    q = np.linalg.qr(kept / np.linalg.norm(kept, axis=0))[0]
    return np.asarray(q[:, len(others) :].T @ columns)
