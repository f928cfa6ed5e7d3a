"""Answers to questions, how they were found, and when they agree with what is printed."""

import ast
import math
import operator
import re
from dataclasses import dataclass
from decimal import Decimal

REPORTED, WORKED = "as reported", "by arithmetic"


class NotThereError(Exception):
    """The tool has no counterpart; the text names what would give one."""


class NothingToAskError(Exception):
    """A sum or mean of raw readings, a table of a distribution: nothing that the tool computes."""


@dataclass(frozen=True)
class Answer:
    """A number (or, with `verdict`, a text that was compared already) and how it was found."""

    value: float | str
    how: str = REPORTED
    verdict: bool | None = None

    def changed(self, function) -> "Answer":
        """The number after one line of arithmetic."""
        return Answer(function(self.value), WORKED)


def reported(value) -> Answer:
    """A number of a report, or that a public function returned."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        raise NotThereError("no error left to test by")
    return Answer(float(value))


def worked(value) -> Answer:
    """One line of arithmetic on such numbers."""
    return Answer(reported(value).value, WORKED)


ROMAN = {"III": 3, "IV": 4, "V": 5, "VI": 6, "VII": 7, "VIII": 8, "IX": 9}
NUMBER = re.compile(r"([<>]=?|[≤≥])?\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*%?")
OPERATORS = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}


def printed_number(text) -> tuple[str, str]:
    """A sign of comparison, or none, and the digits."""
    plain = str(text).replace("\N{MINUS SIGN}", "-").replace("\N{THIN SPACE}", "").replace(",", "").strip()
    found = NUMBER.fullmatch(str(ROMAN.get(plain, plain)))
    if found is None:
        raise ValueError(f"not a number: {text!r}")
    return found.group(1) or "", found.group(2)


def agrees(found: float, printed, check: dict) -> bool:
    """Whether a number lies within half a unit of the last printed digit, the catalogue's rule."""
    if check.get("expression"):
        return math.isclose(found, _calculated(printed), rel_tol=1e-9, abs_tol=1e-9)
    sign, digits = printed_number(printed)
    places = check.get("decimals")
    if places is None:
        places = -int(Decimal(digits).as_tuple().exponent)
    half = 0.5 * 10.0**-places
    room = check.get("of_rounded", 1) * half + min(1e-9, half * 1e-3) + 1e-10 * max(1.0, abs(found))
    off = found - float(digits)
    if sign and sign[0] in "<≤":
        return off <= room
    if sign and sign[0] in ">≥":
        return off >= -room
    return abs(off) <= room


def _calculated(text) -> float:
    def value(node) -> float:
        if isinstance(node, ast.Constant):
            return float(node.value)
        if isinstance(node, ast.UnaryOp):
            return -value(node.operand) if isinstance(node.op, ast.USub) else value(node.operand)
        return OPERATORS[type(node.op)](value(node.left), value(node.right))

    return value(ast.parse(str(text), mode="eval").body)


FINISHES = {
    "reciprocal": lambda x: 1.0 / x,
    "complement": lambda x: 1.0 - x,
    "squared": lambda x: x**2,
    "root": math.sqrt,
    "exp": math.exp,
    "exp10": lambda x: 10.0**x,
    "log10": lambda x: x / math.log(10.0),
    "percent": lambda x: 100.0 * x,
    "abs": abs,
}


def finished(answer: Answer, check: dict, words: str) -> Answer:
    """The last changes that a source makes before it prints a number, those of `words` that are asked for."""
    for word in words.split():
        if check.get(word):
            answer = answer.changed(FINISHES[word])
    return answer
