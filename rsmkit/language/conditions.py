"""Conditions written by the user: ``"dp_kpa <= 40"``, ``"a + 2*b == 3"``, ``"not (cell == 'L3' and t > 9)"``.

Inequalities become margins that stay at or above zero. Tests of categories and ``not``, ``and``, ``or``
become margins too: a category that is the one named counts 1, any other -1; ``and`` is the least of its
parts, ``or`` the greatest, ``not`` the opposite. An equality of continuous factors becomes an
:class:`~rsmkit.language.equalities.Equality`, which no margin could stand for: points are put on it instead.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from rsmkit.errors import RsmkitError, did_you_mean
from rsmkit.io.arguments import checked
from rsmkit.io.shown import Shown
from rsmkit.language.equalities import Equality
from rsmkit.language.expression import Expression, compile_tree, evaluate_constant, parse_tree

__all__ = ["Conditions", "Constraint", "parse_conditions", "parse_constraint", "parse_equality"]

Categories = Mapping[str, Sequence[str]]
"""Levels of every categorical factor by its name."""

LOGIC = "and, or and not"


@dataclass(frozen=True)
class Constraint(Shown):
    """An inequality ``margin >= 0``, with the margin an expression of factors, responses and functions."""

    text: str
    margin: Expression

    @property
    def names(self) -> frozenset[str]:
        """The quantities it uses."""
        return self.margin.names


@dataclass(frozen=True)
class Conditions:
    """What a list of conditions asks: margins to keep and equalities to lie on."""

    constraints: tuple[Constraint, ...] = ()
    equalities: tuple[Equality, ...] = ()


@checked
def parse_constraint(
    text: str, known: Collection[str] | None = None, categories: Categories | None = None
) -> tuple[Constraint, ...]:
    """Check and compile ``a <= b``, ``a >= b``, a chain ``a <= b <= c``, or a rule for categories.

    Parameters
    ----------
    text : str
        Inequalities, and tests of categories such as ``cell == 'L3'``, ``cell != 'L3'`` and
        ``cell in ('L1', 'L2')``, joined by ``and``, ``or`` and ``not``.
    known : collection of str, optional
        Names it may use.
    categories : mapping of str to sequence of str, optional
        Levels of the categorical factors (:attr:`rsmkit.language.space.Space.categories`).

    Returns
    -------
    tuple of Constraint
        One per relation of a chain; each holds where its margin is at least zero.

    Raises
    ------
    RsmkitError
        With what is wrong; equalities are refused, see :func:`parse_equality`.
    """
    tree = parse_tree(text)
    reader = _Reader(text, categories or {})
    if reader.is_equality(tree):
        raise RsmkitError(
            f"'{text}' is an equality, and no inequality; of continuous factors it belongs to their space: "
            f"space.subject_to('{text}')"
        )
    return tuple(Constraint(text, compile_tree(text, margin, known)) for margin in reader.margins(tree))


@checked
def parse_equality(text: str, factors: Collection[str] | None = None) -> Equality:
    """Check an equality ``a + 2*b == 3`` that is linear in factors.

    Raises
    ------
    RsmkitError
        If it is none, is not linear or uses anything but `factors`.
    """
    tree = parse_tree(text)
    if not _Reader(text, {}).is_equality(tree):
        raise RsmkitError(f"'{text}' is no equality; write it as 'a + 2*b == 3'")
    assert isinstance(tree, ast.Compare)
    sides = [tree.left, *tree.comparators]
    if len(sides) != 2:
        raise RsmkitError(f"'{text}': write one equality, and each inequality by itself")
    difference = ast.BinOp(left=sides[0], op=ast.Sub(), right=sides[1])
    names = compile_tree(text, difference, None).names
    others = sorted(names - set(names if factors is None else factors))
    if others:
        raise RsmkitError(
            f"'{text}': an equality can be kept in factors only, and {', '.join(others)} "
            f"{'is none' if len(others) == 1 else 'are none'}{did_you_mean(others[0], factors or ())}. Give "
            "two inequalities with some room between them instead, in a search"
        )
    found = _linear(difference)
    if found is None:
        raise RsmkitError(
            f"'{text}': an equality must be linear in its factors, as a + 2*b == 3 is; a curved one can only "
            "be met nearly: give two inequalities with some room between them, in a search, or compute one "
            "of its factors in the simulator"
        )
    if not all(map(math.isfinite, found.values())):
        raise RsmkitError(f"'{text}': a number in it is not finite")
    constant = found.pop("", 0.0)
    if not any(found.values()):
        raise RsmkitError(f"'{text}': no factor is left in it")
    return Equality.of(found, 0.0 - constant)


@checked
def parse_conditions(
    texts: Iterable[str],
    known: Collection[str] | None = None,
    categories: Categories | None = None,
    factors: Collection[str] | None = None,
) -> Conditions:
    """Check and compile conditions of all sorts; see :func:`parse_constraint` and :func:`parse_equality`.

    Parameters
    ----------
    texts : iterable of str
    known : collection of str, optional
        Names that inequalities may use.
    categories : mapping of str to sequence of str, optional
        Levels of the categorical factors.
    factors : collection of str, optional
        Names that equalities may use.
    """
    constraints: list[Constraint] = []
    equalities: list[Equality] = []
    for text in texts:
        if _Reader(text, categories or {}).is_equality(parse_tree(text)):
            equalities.append(parse_equality(text, factors))
        else:
            constraints += parse_constraint(text, known, categories)
    return Conditions(tuple(constraints), tuple(equalities))


@dataclass(frozen=True)
class _Reader:
    """Turns the tree of a condition into trees of margins."""

    text: str
    categories: Categories = field(default_factory=dict)

    def is_equality(self, tree: ast.expr) -> bool:
        """Whether it is ``numbers == numbers``."""
        return (
            isinstance(tree, ast.Compare)
            and any(isinstance(op, ast.Eq) for op in tree.ops)
            and not any(_is_text(side) or self._is_category(side) for side in [tree.left, *tree.comparators])
        )

    def margins(self, tree: ast.expr) -> list[ast.expr]:
        """One margin per relation of the outermost chain."""
        if isinstance(tree, ast.Compare):
            sides = [tree.left, *tree.comparators]
            return [
                self._relation(left, op, right)
                for left, op, right in zip(sides, tree.ops, sides[1:], strict=False)
            ]
        if isinstance(tree, ast.BoolOp) and isinstance(tree.op, ast.And):
            return [margin for part in tree.values for margin in self.margins(part)]
        if isinstance(tree, ast.BoolOp):
            return [_call("max", [self._whole(part) for part in tree.values])]
        if isinstance(tree, ast.UnaryOp) and isinstance(tree.op, ast.Not):
            return [ast.UnaryOp(op=ast.USub(), operand=self._whole(tree.operand))]
        raise RsmkitError(f"'{self.text}' is not a constraint; write it as 'expression <= number'")

    def _whole(self, tree: ast.expr) -> ast.expr:
        """One margin for all of it."""
        parts = self.margins(tree)
        return parts[0] if len(parts) == 1 else _call("min", parts)

    def _relation(self, left: ast.expr, op: ast.cmpop, right: ast.expr) -> ast.expr:
        if any(map(self._is_category, (left, right))) or any(map(_is_text, (left, right))):
            return self._category(left, op, right)
        if isinstance(op, ast.In | ast.NotIn):
            raise RsmkitError(f"'{self.text}': 'in' tests a category, as in: cell in ('L1', 'L2')")
        if isinstance(op, ast.LtE | ast.Lt):
            return self._difference(right, left)
        if isinstance(op, ast.GtE | ast.Gt):
            return self._difference(left, right)
        raise RsmkitError(
            f"'{self.text}': numbers are compared by <= and >=, categories by == and !=; an equality of "
            f"numbers stands alone, without {LOGIC}"
        )

    def _difference(self, big: ast.expr, small: ast.expr) -> ast.expr:
        for node in (*ast.walk(big), *ast.walk(small)):
            if self._is_category(node):
                name = ast.unparse(node)
                raise RsmkitError(
                    f"'{self.text}': {name} is a category and no number; compare it with a text: {name} == "
                    f"'{self.categories[name][0]}'"
                )
        return ast.BinOp(left=big, op=ast.Sub(), right=small)

    def _category(self, left: ast.expr, op: ast.cmpop, right: ast.expr) -> ast.expr:
        """1 where a category is the one named, -1 elsewhere, as arithmetic on its index."""
        if _is_text(left) and not _is_text(right):
            left, right = right, left
        if not isinstance(left, ast.Name) or (self.categories and left.id not in self.categories):
            have = ", ".join(self.categories) or "there is none"
            raise RsmkitError(
                f"'{self.text}': {ast.unparse(left)} is compared with a text and is no categorical factor "
                f"({have})"
            )
        if left.id not in self.categories:
            raise RsmkitError(
                f"'{self.text}': the levels of {left.id} are not known here; give categories={{...}}, as "
                "space.categories"
            )
        if not isinstance(op, ast.Eq | ast.NotEq | ast.In | ast.NotIn):
            raise RsmkitError(
                f"'{self.text}': {left.id} is a category, which has no order; use == and != with a text"
            )
        several = isinstance(right, ast.Tuple | ast.List | ast.Set)
        if several != isinstance(op, ast.In | ast.NotIn):
            raise RsmkitError(
                f"'{self.text}': write {left.id} == 'text' for one category, {left.id} in ('one', 'other') "
                "for several"
            )
        named = right.elts if isinstance(right, ast.Tuple | ast.List | ast.Set) else [right]
        found = [_is_level(left, self._index(left.id, level)) for level in named]
        margin = found[0] if len(found) == 1 else _call("max", found)
        positive = isinstance(op, ast.Eq | ast.In)
        return margin if positive else ast.UnaryOp(op=ast.USub(), operand=margin)

    def _index(self, name: str, level: ast.expr) -> int:
        levels = list(self.categories[name])
        value = level.value if isinstance(level, ast.Constant) else None
        if not isinstance(value, str) or value not in levels:
            shown = repr(value) if isinstance(value, str) else ast.unparse(level)
            raise RsmkitError(
                f"'{self.text}': {name} has no level {shown}{did_you_mean(value, levels)}; its levels are "
                f"{', '.join(map(repr, levels))}"
            )
        return levels.index(value)

    def _is_category(self, node: ast.AST) -> bool:
        return isinstance(node, ast.Name) and node.id in self.categories


def _is_text(node: ast.expr) -> bool:
    if isinstance(node, ast.Tuple | ast.List | ast.Set):
        return any(map(_is_text, node.elts))
    return isinstance(node, ast.Constant) and isinstance(node.value, str)


def _is_level(name: ast.Name, index: int) -> ast.expr:
    """``1 - 2*min(1, abs(name - index))``."""
    away = ast.BinOp(left=name, op=ast.Sub(), right=ast.Constant(index))
    capped = _call("min", [ast.Constant(1), _call("abs", [away])])
    return ast.BinOp(
        left=ast.Constant(1),
        op=ast.Sub(),
        right=ast.BinOp(left=ast.Constant(2), op=ast.Mult(), right=capped),
    )


def _call(name: str, arguments: list[ast.expr]) -> ast.expr:
    return ast.Call(func=ast.Name(id=name, ctx=ast.Load()), args=arguments, keywords=[])


def _linear(tree: ast.expr) -> dict[str, float] | None:
    """Coefficients by name, and the constant under ``""``; None where it is not linear."""
    match tree:
        case ast.Name(id=name) if evaluate_constant(tree) is None:
            return {name: 1.0}
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return _scaled(_linear(operand), -1.0)
        case ast.UnaryOp(op=ast.UAdd(), operand=operand):
            return _linear(operand)
        case ast.BinOp(left=left, op=ast.Add() | ast.Sub() as op, right=right):
            one, other = _linear(left), _scaled(_linear(right), 1.0 if isinstance(op, ast.Add) else -1.0)
            if one is None or other is None:
                return None
            return {name: one.get(name, 0.0) + other.get(name, 0.0) for name in {**one, **other}}
        case ast.BinOp(left=left, op=ast.Mult(), right=right):
            for number, factor in ((left, right), (right, left)):
                if (value := evaluate_constant(number)) is not None:
                    return _scaled(_linear(factor), value)
        case ast.BinOp(left=left, op=ast.Div(), right=right):
            if value := evaluate_constant(right):
                return _scaled(_linear(left), 1.0 / value)
    constant = evaluate_constant(tree)
    return None if constant is None else {"": constant}


def _scaled(form: dict[str, float] | None, by: float) -> dict[str, float] | None:
    return None if form is None else {name: by * value for name, value in form.items()}
