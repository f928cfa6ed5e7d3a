"""Models of mixtures: Scheffe's polynomials in the proportions of components, with process factors.

The proportions add up to one, so a constant and squares would say nothing new: ``1 = a + b + c`` and
``a^2 = a - a*b - a*c``. Scheffe's canonical polynomials leave them out. Full cubic terms are ``a*b*(a-b)``.

Scheffe, *J. R. Statist. Soc. B* 20 (1958), 344-360; Cornell, *Experiments with Mixtures*, 3rd ed. (2002),
chapters 2 and 7; Kowalski, Cornell & Vining, *Communications in Statistics* 29 (2000), 2255-2280.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from itertools import combinations, product
from typing import Literal, get_args

from rsmkit.errors import RsmkitError, one_of
from rsmkit.io.arguments import checked
from rsmkit.language.exponents import Exponents, difference_in, hierarchical_closure, reading_order
from rsmkit.language.space import Space
from rsmkit.language.terms import EXACT, Terms, full_terms, parse_terms, space_levels

__all__ = ["MODELS", "Blending", "Process", "movable", "on_simplex", "parse_scheffe", "scheffe_terms"]

Blending = Literal["linear", "quadratic", "special cubic", "cubic"]
"""How components blend, each with all that stands before it."""

Process = Literal["combined", "main", "crossed"]
"""How process factors join a Scheffe model: by total degree; every blending term with each of them, or with
all their products."""

MODELS: dict[str, Blending] = {f"scheffe-{name.replace(' ', '-')}": name for name in get_args(Blending)}
"""Words of the command line and the study file."""

ORDERS: dict[Blending | int, str] = {1: "linear", 2: "quadratic", 3: "cubic"}
SQUARES = "the proportions add up to a constant, so squares and a constant say nothing new"


@checked
def scheffe_terms(
    space: Space,
    components: Sequence[str],
    blending: Blending | int = "quadratic",
    process: Process = "combined",
) -> Terms:
    """Terms of a Scheffe model, crossed with the factors that are no components.

    Parameters
    ----------
    space : Space
    components : sequence of str
        Two or more numeric factors, the proportions of a mixture.
    blending : {"linear", "quadratic", "special cubic", "cubic"} or int
        Or the order: 1, 2, or 3 for the full cubic model.
    process : {"combined", "main", "crossed"}
        ``combined``: all terms whose total degree is at most that of the blending (Kowalski, Cornell &
        Vining): with quadratic blending ``a*z``, ``z*t`` and ``z^2`` too. ``main``: every blending term times
        1 and times each process factor. ``crossed``: times every product of process factors.

    Raises
    ------
    RsmkitError
        If a component is no numeric factor, or there are less than two.

    Examples
    --------
    >>> space = Space(a=(0, 1), b=(0, 1), z=(20, 80))
    >>> scheffe_terms(space, ["a", "b"]).names(space)
    ('a', 'b', 'a*b', 'a*z', 'b*z', 'z^2')
    >>> scheffe_terms(space, ["a", "b"], "cubic", "main").names(space)[-5:]
    ('a*b*(a-b)', 'a*z', 'b*z', 'a*b*z', 'a*b*(a-b)*z')
    """
    places = _places(space, components)
    name = one_of("blending", ORDERS.get(blending, str(blending)), get_args(Blending))
    one_of("process", process, get_args(Process))
    degree = {"linear": 1, "quadratic": 2}.get(name, 3)
    found: list[Exponents] = []
    for setting in _settings(space, places, process, degree):
        left = degree - sum(setting) if process == "combined" else degree
        blends = _blends(len(space), places, name, left)
        found += [tuple(x + z for x, z in zip(e, setting, strict=True)) for e in blends]
    return _terms(space, places, found)


def parse_scheffe(space: Space, components: Sequence[str], words: Iterable[str]) -> Terms:
    """Read a mixture model written by hand; the linear blending terms always belong to it.

    Parameters
    ----------
    space : Space
    components : sequence of str
    words : iterable of str
        Single terms ``a*b``, ``a*b*c``, ``a*b*(a-b)``, ``a*z``, ``z^2``; groups ``FO`` (linear blending),
        ``TWI`` (all products of two factors); ``exact`` adds nothing that the terms contain. ``0`` is
        understood.

    Raises
    ------
    RsmkitError
        For squares of components and other terms that a mixture does not have.
    """
    places, words = _places(space, components), list(words)
    wanted = {_unit(len(space), j) for j in places}
    for word in words:
        if word in ("0", "FO", EXACT) and word not in space.names:
            continue
        if word == "TWI":
            wanted |= {e for e in full_terms(space, 2).exponents if sum(e) == 2 and max(e) == 1}
            continue
        if word in ("PQ", "SO", "cubic"):
            names = "scheffe-quadratic, scheffe-special-cubic or scheffe-cubic"
            raise RsmkitError(f"model terms: {word}: {SQUARES}; ask for the model {names}")
        wanted.add(_read(space, places, word))
    if EXACT not in words or EXACT in space.names:
        wanted |= _contained(wanted, places)
    return _terms(space, places, wanted)


def on_simplex(
    monomial: Exponents, basis: Mapping[Exponents, tuple[int, int] | None], components: Sequence[int]
) -> dict[Exponents, float] | None:
    """Write a product of powers as a sum of the columns of a Scheffe model.

    Parameters
    ----------
    monomial : tuple of int
        Exponents over the variables of the columns.
    basis : mapping of tuple of int to tuple or None
        The columns, and the two components of each that is an ``a*b*(a-b)``.
    components : sequence of int
        Variables that add up to one.

    Returns
    -------
    dict of tuple of int to float, or None
        Weights of the columns; None where the model does not hold it.
    """
    if monomial in basis and basis[monomial] is None:
        return {monomial: 1.0}
    powers = {v: monomial[v] for v in components if monomial[v]}
    found: dict[Exponents, float] = {}
    if not powers:
        parts = [(1.0, _changed(monomial, v, 1)) for v in components]
    elif pair := difference_in(monomial, components):
        a, b = sorted(pair)
        key = tuple({a: 2, b: 1}.get(v, power) for v, power in enumerate(monomial))
        if basis.get(key) is None:
            return None
        found[key] = 0.5 if pair == (a, b) else -0.5
        product_ab = _changed(monomial, pair[0], -1)
        parts = [(-0.5, _changed(product_ab, v, 1)) for v in components if v not in pair]
        parts.append((0.5, product_ab))
    elif max(powers.values()) > 1 and sum(powers.values()) <= 3:
        v = max(powers, key=lambda w: powers[w])
        lower = _changed(monomial, v, -1)
        parts = [(1.0, lower), *((-1.0, _changed(lower, w, 1)) for w in components if w != v)]
    else:
        return None
    for weight, part in parts:
        inner = on_simplex(part, basis, components)
        if inner is None:
            return None
        for key, by in inner.items():
            found[key] = found.get(key, 0.0) + weight * by
    return found


def movable(terms: Terms) -> tuple[bool, ...]:
    """Whether the model stays the same when the origin of a factor moves; the components move together.

    Without components of a mixture only the factors of hierarchical models may.
    """
    if not terms.components:
        return (terms.hierarchical,) * terms.k
    plain, basis = terms.plain[0], dict(zip(terms.columns, terms.differences, strict=True))
    place = terms.variable_factors.index
    components = [place(j) for j in terms.components]

    def stays(variables: list[int]) -> bool:
        lowered = (
            product(*(range(x + 1) if v in variables else (x,) for v, x in enumerate(column)))
            for column in plain.columns
        )
        return all(
            on_simplex(e, basis, components) is not None for found in lowered for e in sorted(found)[:-1]
        )

    together = stays(components)
    return tuple(
        together if j in terms.components else bool(terms.levels[j]) or stays([place(j)])
        for j in range(terms.k)
    )


def _places(space: Space, components: Sequence[str]) -> list[int]:
    unknown = [name for name in components if name not in space.names]
    if unknown:
        one_of("component", unknown[0], space.names)
    categories = [name for name in components if not space[name].domain.is_numeric]
    if categories:
        raise RsmkitError(f"component {categories[0]} is categorical; a component is a proportion, a number")
    if len(set(components)) < 2:
        raise RsmkitError("a mixture needs at least two different components")
    return [space.names.index(name) for name in components]


def _terms(space: Space, places: Sequence[int], exponents: Iterable[Exponents]) -> Terms:
    """In the order linear, quadratic, special cubic, full cubic blending; without process factors first."""

    def order(e: Exponents) -> tuple[int, bool, bool, tuple[int, int, tuple[int, ...]]]:
        process = sum(x for j, x in enumerate(e) if j not in places)
        pure = process == sum(e)
        return (process, pure, difference_in(e, places) is not None, reading_order(e))

    return Terms(tuple(sorted(set(exponents), key=order)), space_levels(space), components=tuple(places))


def _blends(k: int, places: Sequence[int], blending: str, degree: int) -> list[Exponents]:
    """Blending terms up to a degree; the constant alone for degree zero."""
    if degree == 0:
        return [(0,) * k]
    found = [_unit(k, *chosen) for size in range(1, degree + 1) for chosen in combinations(places, size)]
    if blending == "cubic" and degree == 3:
        found += [_unit(k, min(pair), *pair) for pair in combinations(places, 2)]
    return found


def _settings(space: Space, places: Sequence[int], process: str, degree: int) -> list[Exponents]:
    """Products of process factors that blending terms are multiplied with, the constant first."""
    levels = space_levels(space)
    most = {"combined": degree, "main": 1}.get(process, len(space))
    highest = [
        0 if j in places else 1 if levels[j] or process != "combined" else most for j in range(len(space))
    ]
    found = product(*(range(x + 1) for x in highest))
    return sorted((e for e in found if sum(e) <= most), key=reading_order)


def _read(space: Space, places: Sequence[int], word: str) -> Exponents:
    names = "|".join(re.escape(space.names[j]) for j in sorted(places, key=lambda j: -len(space.names[j])))
    if match := re.fullmatch(rf"(.*?)\*?\(\s*({names})\s*-\s*({names})\s*\)(?:\*(.*))?", word.strip()):
        rest = "*".join(filter(None, [match[1], match[4]]))
        a, b = (space.names.index(match[i]) for i in (2, 3))
        e = parse_terms(space, [EXACT, rest]).exponents[-1] if rest else (0,) * len(space)
        if a == b or any(e[j] != (j in (a, b)) for j in places):
            raise RsmkitError(f"model terms: '{word}': a full cubic term is written a*b*(a-b)")
        return _changed(e, min(a, b), 1)
    e = parse_terms(space, [EXACT, word]).exponents[-1]
    if any(e[j] > 1 for j in places):
        raise RsmkitError(f"model terms: '{word}': {SQUARES}; write a*b and a*b*(a-b) instead of squares")
    if not any(e):
        raise RsmkitError(f"model terms: '{word}': {SQUARES}")
    return e


def _contained(exponents: Iterable[Exponents], places: Sequence[int]) -> set[Exponents]:
    """What terms contain: products of fewer components, lower powers of process factors beside components."""
    found = set()
    for e in exponents:
        blends = any(e[j] for j in places)
        for lower in hierarchical_closure([e]):
            powers = [lower[j] for j in places]
            whole = powers == [e[j] for j in places]  # a*b*(a-b) holds no a^2
            if (any(powers) or (not blends and any(lower))) and (max(powers) < 2 or whole):
                found.add(lower)
    said = {
        e for e in found if not any(e[j] for j in places) and all(_changed(e, j, 1) in found for j in places)
    }
    return found - said  # z says nothing beside a*z, b*z, c*z


def _unit(k: int, *places: int) -> Exponents:
    return tuple(places.count(j) for j in range(k))


def _changed(e: Exponents, place: int, by: int) -> Exponents:
    return (*e[:place], e[place] + by, *e[place + 1 :])
