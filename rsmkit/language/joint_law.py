"""What varies together: a law for some factors, the others at a point, and how they are correlated.

Correlated laws are joined by a Gaussian copula: each factor is its law's quantile at the probability of a
standard normal number, and the matrix is that of these normal numbers (Nataf's model; for normal laws it is
the correlation of the factors themselves).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import combinations

import numpy as np
from scipy.special import ndtri

from rsmkit.errors import RsmkitError, one_of
from rsmkit.language.laws import Law, Levels, Normal, Uniform
from rsmkit.language.space import Floats, Space

__all__ = [
    "BEYOND",
    "JointLaw",
    "LawMaker",
    "Laws",
    "box_law",
    "check_correlation",
    "check_law",
    "normal_covariance",
]

BEYOND = 0.1
"""Part of its range by which a law may reach beyond the bounds of a factor; surfaces extrapolate there."""
RARE = 1e-3
"""What lies in a tail rarer than this may lie anywhere."""


@dataclass(frozen=True)
class JointLaw:
    """Laws of some factors of a space about one point.

    Parameters
    ----------
    space : Space
    point : array, shape (k,)
        Natural units; where the factors without a law stay.
    laws : mapping of str to Law
        By factor, at least one.
    correlation : array, shape (m, m), optional
        Of the normal numbers behind the laws, in their order; independent without it.

    Raises
    ------
    RsmkitError
        If a law is of no factor, or the matrix is no correlation matrix.
    """

    space: Space
    point: Floats
    laws: Mapping[str, Law]
    correlation: Floats | None = field(default=None)

    def __post_init__(self) -> None:
        if not self.laws:
            raise RsmkitError("uncertainty: at least one factor needs a law")
        for name in self.laws:
            one_of("uncertainty: factor", name, self.space.names)
            for equality in self.space.equalities:
                if name in equality.names:
                    raise RsmkitError(
                        f"uncertainty: {name} takes part in '{equality.text}', which it would break if it "
                        "varied by itself; give laws to factors outside the sum"
                    )
        if self.correlation is not None:
            check_correlation(self.correlation, tuple(self.laws))

    def __len__(self) -> int:
        return len(self.laws)

    @property
    def names(self) -> tuple[str, ...]:
        """Factors that vary, in order."""
        return tuple(self.laws)

    @cached_property
    def columns(self) -> list[int]:
        """Where they stand in the space."""
        return [self.space.names.index(name) for name in self.laws]

    @property
    def independent(self) -> bool:
        """Whether the laws are not correlated."""
        return self.correlation is None or not np.any(self.correlation - np.eye(len(self)))

    @property
    def matrix(self) -> Floats:
        """The correlation matrix, shape (m, m)."""
        return np.eye(len(self)) if self.correlation is None else np.asarray(self.correlation, float)

    @cached_property
    def root(self) -> Floats:
        """Lower factor of the correlation matrix, shape (m, m)."""
        return np.asarray(np.linalg.cholesky(self.matrix))

    def of_normal(self, z: Floats) -> Floats:
        """Points at standard normal numbers that are correlated already, shape (n, m) to (n, k)."""
        points = np.tile(self.point, (len(z), 1))
        for column, law, numbers in zip(self.columns, self.laws.values(), z.T, strict=True):
            points[:, column] = law.of_normal(numbers)
        return points

    def of_independent(self, z: Floats) -> Floats:
        """Points at independent standard normal numbers, shape (n, m) to (n, k)."""
        return self.of_normal(z if self.independent else z @ self.root.T)

    def of_uniform(self, u: Floats) -> Floats:
        """Points at numbers from 0 to 1, shape (n, m) to (n, k)."""
        if not self.independent:
            return self.of_independent(np.asarray(ndtri(u)))
        points = np.tile(self.point, (len(u), 1))
        for column, law, numbers in zip(self.columns, self.laws.values(), u.T, strict=True):
            points[:, column] = law.quantile(numbers)
        return points

    def draw(self, count: int, rng: np.random.Generator) -> Floats:
        """Points drawn at random, natural units, shape (count, k)."""
        return self.of_independent(rng.standard_normal((count, len(self))))


LawMaker = Callable[[float], Law]
"""A law about a value of its factor."""


@dataclass(frozen=True)
class Laws:
    """Laws of some factors, wherever the design is.

    Parameters
    ----------
    space : Space
    makers : mapping of str to LawMaker
        By factor; one that does not depend on the design gives the same law for every value.
    correlation : array, shape (m, m), optional
        As for :class:`JointLaw`.
    """

    space: Space
    makers: Mapping[str, LawMaker]
    correlation: Floats | None = None

    def at(self, point: Floats) -> JointLaw:
        """The laws about a point, natural units, shape (k,).

        Raises
        ------
        RsmkitError
            If a law cannot be about that point.
        """
        values = dict(zip(self.space.names, np.asarray(point, float).tolist(), strict=True))
        made = {}
        for name, maker in self.makers.items():
            one_of("uncertainty: factor", name, self.space.names)
            try:
                made[name] = maker(values[name])
            except RsmkitError as error:
                raise RsmkitError(f"uncertainty.{name}: {error}") from None
        return JointLaw(self.space, np.asarray(point, float), made, self.correlation)


def box_law(space: Space) -> JointLaw:
    """Every value of every factor alike, over the whole space."""
    laws: dict[str, Law] = {
        f.name: Uniform(f.low, f.high) if f.domain.is_continuous else Levels(f.domain) for f in space
    }
    return JointLaw(space, np.array([f.domain.middle for f in space]), laws)


def check_law(space: Space, name: str, law: Law) -> str:
    """Refuse a law that its factor cannot follow; give a note where it leaves the bounds a little.

    Raises
    ------
    RsmkitError
        With the factor's name.
    """
    factor = space[name]
    low, high = factor.low, factor.high
    if not factor.domain.is_numeric:
        raise RsmkitError(f"uncertainty.{name}: a categorical factor follows no law of numbers")
    if not factor.domain.is_continuous:
        values = law.rule()[0]
        if isinstance(law, Levels) or np.isin(values, factor.domain.allowed).all():
            return ""
        raise RsmkitError(
            f"uncertainty.{name}: takes {factor.domain.text} only; give it a sample of these values"
        )
    first, last = law.quantile(np.array([RARE, 1.0 - RARE])).tolist()
    room = BEYOND * (high - low)
    if first < low - room or last > high + room:
        raise RsmkitError(
            f"uncertainty.{name}: reaches from {first:.6g} to {last:.6g} ({law.text}), beyond the bounds "
            f"{low:g} to {high:g}, where no run was made. "
            "Widen the factor, or give a narrower or a truncated law"
        )
    share = law.outside(low, high)
    if share < 0.01:
        return ""
    return (
        f"{name} lies outside its bounds {low:g} to {high:g} in {100 * share:.2g} % of cases, where the "
        "surfaces extrapolate"
    )


def check_correlation(matrix: Floats, names: Sequence[str]) -> None:
    """Refuse what is no correlation matrix of so many factors.

    Raises
    ------
    RsmkitError
        Saying what is wrong, and between which factors.
    """
    array = np.asarray(matrix, float)
    m, of = len(names), f"correlation of {', '.join(names)}"
    if array.shape != (m, m) or not np.isfinite(array).all():
        raise RsmkitError(f"{of}: the matrix must be {m} by {m} finite numbers, got shape {array.shape}")
    if (np.diag(array) != 1.0).any():
        wrong = names[int(np.flatnonzero(np.diag(array) != 1.0)[0])]
        raise RsmkitError(f"{of}: the diagonal must be 1, but not so at {wrong}")
    for i, j in combinations(range(m), 2):
        if array[i, j] != array[j, i]:
            raise RsmkitError(f"{of}: the matrix is not symmetric between {names[i]} and {names[j]}")
        if not -1.0 < array[i, j] < 1.0:
            raise RsmkitError(
                f"{of}: {array[i, j]:g} between {names[i]} and {names[j]} does not lie between -1 and 1"
            )
    least = float(np.linalg.eigvalsh(array).min())
    if least <= 1e-10:
        raise RsmkitError(
            f"{of}: the matrix is not positive definite (least eigenvalue {least:.3g}): no quantities can be "
            "correlated so"
        )


def normal_covariance(law: JointLaw) -> Floats | None:
    """Covariance of the factors that vary, shape (m, m), where all laws are normal; else None."""
    if not all(isinstance(item, Normal) for item in law.laws.values()):
        return None
    sds = np.array([item.sd for item in law.laws.values()])
    return np.asarray(law.matrix * np.outer(sds, sds))
