"""A formula of the catalogue as factors, points, and terms of rsmkit.

patsy (a dependency of statsmodels) reads the formula. Products of powers become exponents; anything else
within ``I()`` becomes a factor of its own. A category without its margins (``0 + a``, ``a + a:x``) is
fitted with them, which spans the same; the coefficients of patsy's columns are then those of rsmkit times
one matrix.
"""

import ast
import itertools
import re
from collections import Counter
from functools import cached_property

import numpy as np
import pandas as pd
from patsy import ModelDesc, dmatrix

import rsmkit as rk
from catalogue.answers import NotThereError

NAMED = re.compile(r"(.*)\[(?:[TS]\.)?([^\]]*)\]$")


def spelled_out(text: str, names) -> str:
    """A formula without the words for whole groups of terms."""
    text, names = text.split("~", 1)[-1].strip(), list(names)
    linear = " + ".join(names)
    pairs = " + ".join(f"{a}:{b}" for a, b in itertools.combinations(names, 2))
    triples = " + ".join(":".join(three) for three in itertools.combinations(names, 3))
    squares = " + ".join(f"I({n} ** 2)" for n in names)
    words = {
        "main_effects": linear,
        "linear": linear,
        "interactions": f"({linear}) ** 2",
        "quadratic": f"({linear}) ** 2 + {squares}",
        "scheffe_linear": f"0 + {linear}",
        "scheffe_quadratic": f"0 + {linear} + {pairs}",
        "scheffe_special_cubic": f"0 + {linear} + {pairs} + {triples}",
    }
    if text == "scheffe_cubic":
        raise NotThereError("mixtures: full cubic model")
    return words.get(text, text) if text not in names else text


def as_formula(term: str) -> str:
    """A term as the catalogue names it, in the words of a formula."""
    parts = [re.sub(r"^(\w+)²$", r"I(\1 ** 2)", part) for part in term.split("·")]
    return ":".join(parts)


def _powers(code: str) -> Counter | None:
    """Powers of the factors in ``I(x1 ** 2 * x2)``; None for what is no product of powers."""

    def read(node) -> Counter:
        if isinstance(node, ast.Name):
            return Counter({node.id: 1})
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult):
            return read(node.left) + read(node.right)
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow) and isinstance(node.right.value, int):
            return Counter({name: n * node.right.value for name, n in read(node.left).items()})
        raise ValueError

    node = ast.parse(code, mode="eval").body
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "I":
        node = node.args[0]
    try:
        return read(node)
    except (ValueError, AttributeError):
        return None


class Model:
    """What rsmkit is given for a formula and settings.

    ``ranges`` (name: low, high) puts factors in their natural units.
    """

    def __init__(self, settings: pd.DataFrame, text: str, ranges: dict | None = None):
        self.settings, self.text = settings, spelled_out(text, settings.columns)
        self.described = ModelDesc.from_formula(self.text)
        self.wanted = [
            frozenset(f.code for f in term.factors) for term in self.described.rhs_termlist if term.factors
        ]
        self.constant = any(not term.factors for term in self.described.rhs_termlist)
        self.levels: dict[str, list] = {}
        self.values: dict[str, np.ndarray] = {}
        self.of_code: dict[str, Counter] = {}
        for code in dict.fromkeys(code for term in self.wanted for code in sorted(term)):
            self._add(code)
        if not self.values:
            self.values["run"] = np.arange(len(settings), dtype=float)
        self.names = list(self.values)
        exponents = [self.exponents(term) for term in self.wanted]
        nothing = (0,) * len(self.names)
        found = ([nothing] if self.constant else []) + exponents
        if len(set(found)) != len(found):
            raise NotThereError("a formula that repeats a term")
        self.with_margins = self._margins(found)
        sums = "Sum" in self.text
        counts = tuple(len(self.levels.get(n, ())) for n in self.names)
        self.terms = rk.Terms(tuple(self.with_margins), counts, "sum" if sums else "treatment")
        self.space = rk.Space([self._factor(name, ranges or {}) for name in self.names])
        columns = [self._coordinates(name, ranges or {}) for name in self.names]
        self.points = np.column_stack(columns)

    @property
    def whole(self) -> bool:
        """Whether no margin had to be added."""
        return len(self.with_margins) == len(self.wanted) + self.constant

    def exponents(self, term) -> tuple[int, ...]:
        """Exponents of a term given as codes, or as text."""
        if isinstance(term, str):
            term = self.codes(term)
        total: Counter = Counter()
        for code in term:
            if code not in self.of_code:
                raise NotThereError("a term that the model has not")
            total += self.of_code[code]
        return tuple(total[name] for name in self.names)

    def codes(self, term: str) -> frozenset:
        """Codes of the factors of a term in words."""
        listed = ModelDesc.from_formula(f"0 + {as_formula(term)}").rhs_termlist
        return frozenset(f.code for f in listed[-1].factors)

    def _add(self, code: str) -> None:
        category = re.fullmatch(r"C\((\w+)(?:, (.*))?\)", code)
        name = category.group(1) if category else code
        if name in self.settings and (category or not pd.api.types.is_numeric_dtype(self.settings[name])):
            if name in self.values and name not in self.levels:
                raise NotThereError("a factor that is a number and a category in one model")
            self._add_category(name, (category.group(2) if category else "") or "")
            self.of_code[code] = Counter({name: 1})
            return
        powers = _powers(code)
        if powers is None or any(n not in self.settings for n in powers):
            inside = {n: self.settings[n].to_numpy(float) for n in self.settings if n in code}
            self.values[code] = np.asarray(dmatrix(f"0 + {code}", inside))[:, 0]
            self.of_code[code] = Counter({code: 1})
            return
        for name in powers:
            if name in self.levels:
                raise NotThereError("a factor that is a number and a category in one model")
            self.values[name] = self.settings[name].to_numpy(float)
        self.of_code[code] = powers

    def _add_category(self, name: str, contrasts: str) -> None:
        levels = sorted(set(self.settings[name].tolist()))
        if len(levels) < 2:
            raise NotThereError("a category with one level among these runs")
        first = re.search(r"Treatment\((?:reference=)?'?([^')]*)'?\)", contrasts)
        last = re.search(r"omit=(\d+)", contrasts)
        if first:
            base = next(x for x in levels if str(x) == first.group(1) or x == first.group(1))
            levels = [base, *(x for x in levels if x != base)]
        if last:
            levels.append(levels.pop(int(last.group(1))))
        self.levels[name] = levels
        self.values[name] = np.array([levels.index(x) for x in self.settings[name]], float)

    def _margins(self, exponents: list) -> list:
        """Add what a category's columns span where its margin is not in the model."""
        found = list(exponents)
        for e in exponents:
            for j, name in enumerate(self.names):
                if e[j] and name in self.levels:
                    rest = tuple(0 if i == j else x for i, x in enumerate(e))
                    if rest not in found:
                        found.append(rest)
        if len(found) > len(exponents):
            return self._margins(sorted(found, key=lambda e: (any(e), sum(e))))
        return found

    def _factor(self, name: str, ranges: dict):
        if name in self.levels:
            return rk.Factor(name, levels=tuple(self.level_text(name, x) for x in self.levels[name]))
        low, high = ranges.get(name, (-1.0, 1.0))
        return rk.Factor(name, float(low), float(high))

    def _coordinates(self, name: str, ranges: dict):
        if name in self.levels or name not in ranges:
            return self.values[name]
        low, high = ranges[name]
        return (low + high) / 2 + (high - low) / 2 * self.values[name]

    @staticmethod
    def level_text(name: str, level) -> str:
        """A level as rsmkit is told it."""
        return f"{level:g}" if isinstance(level, float) else str(level)

    def level(self, name: str, text) -> int:
        """Place of a level that the catalogue names."""
        for place, x in enumerate(self.levels[name]):
            if str(x) == str(text) or (isinstance(x, float) and _number(text) == x):
                return place
        raise NotThereError(f"{name} has no level {text}")

    @cached_property
    def patsy(self) -> pd.DataFrame:
        """Patsy's columns."""
        return dmatrix(self.text, self.settings, return_type="dataframe")

    @cached_property
    def turned(self) -> np.ndarray:
        """Matrix that makes patsy's coefficients of rsmkit's."""
        own = self.terms.matrix(self.space.encode(self.points))
        theirs = self.patsy.to_numpy(float)
        if theirs.shape[1] != own.shape[1]:
            raise NotThereError("a formula that rsmkit reads as other columns")
        matrix = np.linalg.lstsq(theirs, own, rcond=None)[0]
        if not np.allclose(theirs @ matrix, own, atol=1e-8 * (1 + np.abs(own).max())):
            raise NotThereError("a formula that rsmkit reads as other columns")
        return np.where(np.abs(matrix) < 1e-11, 0.0, matrix)

    def combination(self, term: str) -> np.ndarray:
        """The coefficient of a term, by the catalogue's name, as a combination of rsmkit's."""
        if term == "Intercept" and not self.constant:
            raise NotThereError("a term that the model has not")
        names = list(self.patsy.columns)
        if term in names:
            return self.turned[names.index(term)]
        wanted = _short(as_formula(term))
        for name, row in zip(names, self.turned, strict=True):
            if _short(name) == wanted:
                return row
        return self._left_out(wanted)

    def _left_out(self, wanted) -> np.ndarray:
        """The level that a sum contrast leaves out: minus the sum of the others."""
        rows = []
        for name, row in zip(self.patsy.columns, self.turned, strict=True):
            short = _short(name)
            if "[S." in name and {n for n, _ in short} == {n for n, _ in wanted}:
                rows.append(row)
        if len(wanted) != 1 or not rows:
            raise NotThereError("a term that the model has not")
        return -np.sum(rows, axis=0)


def _short(name: str) -> frozenset:
    """A column as pairs of factor and level, however its contrasts are written."""
    found = []
    for part in re.split(r":(?![^(]*\))", name):
        level = NAMED.match(part)
        base, text = (level.group(1), level.group(2)) if level else (part, "")
        category = re.fullmatch(r"C\((\w+)(?:, .*)?\)", base)
        number = _number(text)
        found.append(
            (category.group(1) if category else base.replace(" ", ""), text if number is None else number)
        )
    return frozenset(found)


def _number(text) -> float | None:
    try:
        return float(text)
    except (TypeError, ValueError):
        return None
