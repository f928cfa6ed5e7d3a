"""What one term of a model is: its exponents, its name, its group, what it contains.

Among the components of a mixture exponents 2 and 1 of two of them, the larger first, stand for Scheffe's
``a*b*(a-b)``; see :mod:`rsmkit.language.scheffe`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import product

__all__ = [
    "Exponents",
    "blending_of",
    "difference_in",
    "group_of",
    "hierarchical_closure",
    "monomial_name",
    "monomials",
    "reading_order",
]

Exponents = tuple[int, ...]

BLENDING = {1: "linear", 2: "quadratic", 3: "special cubic"}


def hierarchical_closure(exponents: Iterable[Exponents]) -> tuple[Exponents, ...]:
    """Add everything the given terms contain, down to the constant; sorted in reading order."""
    closed: set[Exponents] = set()
    for e in exponents:
        closed.update(product(*(range(power + 1) for power in e)))
    return tuple(sorted(closed, key=reading_order))


def group_of(exponents: Exponents) -> str:
    """Group of a term in an analysis of variance: ``FO``, ``TWI``, ``PQ``, ``cubic``; ``""`` for 1."""
    degree = sum(exponents)
    if degree == 2:
        return "PQ" if max(exponents) == 2 else "TWI"
    return {0: "", 1: "FO", 3: "cubic"}.get(degree, f"order {degree}")


def blending_of(exponents: Exponents, components: Sequence[int]) -> str:
    """Group of a term of a mixture model: how the components blend, and whether process factors take part."""
    powers = [exponents[j] for j in components if exponents[j]]
    process = sum(exponents) - sum(powers)
    if not powers:
        return "process" if process else ""
    order = "full cubic" if sorted(powers) == [1, 2] else BLENDING.get(sum(powers), f"order {sum(powers)}")
    return f"{order} blending{' x process' if process else ''}"


def difference_in(exponents: Exponents, components: Sequence[int]) -> tuple[int, int] | None:
    """The two components a and b of ``a*b*(a-b)``, if a term is that."""
    powers = {j: exponents[j] for j in components if exponents[j]}
    if sorted(powers.values()) != [1, 2]:
        return None
    first, second = sorted(powers, key=lambda j: -powers[j])
    return first, second


def monomials(exponents: Exponents, pair: tuple[int, int] | None) -> list[tuple[Exponents, float]]:
    """Products of powers, with weights, that a column is the sum of: ``a^2*b - a*b^2`` for a difference."""
    if pair is None:
        return [(exponents, 1.0)]
    swapped = list(exponents)
    swapped[pair[0]], swapped[pair[1]] = 1, 2
    return [(exponents, 1.0), (tuple(swapped), -1.0)]


def reading_order(exponents: Exponents) -> tuple[int, int, tuple[int, ...]]:
    """Degree first, then mixed before pure, then the factors' own order."""
    return (sum(exponents), -sum(x > 0 for x in exponents), tuple(-x for x in exponents))


def monomial_name(column: Exponents, variables: Sequence[str], pair: tuple[int, int] | None = None) -> str:
    """``x1*x2^2``, ``1``; ``a*b*(a-b)`` for a difference."""
    if pair:
        a, b = (variables[v] for v in pair)
        rest = monomial_name(tuple(0 if v in pair else x for v, x in enumerate(column)), variables)
        return f"{a}*{b}*({a}-{b})" + ("" if rest == "1" else f"*{rest}")
    parts = [
        name if power == 1 else f"{name}^{power}"
        for name, power in zip(variables, column, strict=True)
        if power
    ]
    return "*".join(parts) or "1"
