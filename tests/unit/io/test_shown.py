"""What users hold shows itself in a notebook: a table, with every text escaped."""

import re
from dataclasses import dataclass, field

import numpy as np

from rsmkit.io.shown import Shown


@dataclass(frozen=True)
class Part:
    name: str
    size: float | None


@dataclass(frozen=True)
class Whole(Shown):
    title: str
    parts: tuple[Part, ...]
    by_name: dict[str, Part]
    loads_N: np.ndarray
    table: np.ndarray
    limits: dict[str, float]
    hidden: str = field(default="secret", repr=False)


WHOLE = Whole(
    "<b>&", (Part("a", 1 / 3), Part("<i>", None)), {"k<": Part("x", 2.0)}, np.array([1.0, 2.5]),
    np.zeros((3, 2)), {"low": float("nan")},
)  # fmt: skip


def test_a_record_is_a_table_of_its_fields_with_lists_of_records_as_tables():
    html = WHOLE._repr_html_()
    assert "&lt;b&gt;&amp;" in html
    assert not re.search("<[bi]>", html)
    assert "<th>1</th><td>a</td><td>0.333333</td>" in html
    assert "<th>2</th><td>&lt;i&gt;</td><td>–</td>" in html
    assert "<th>k&lt;</th><td>x</td><td>2</td>" in html
    for cell in ("1, 2.5", "array of shape (3, 2)", "<th>low</th><td>–</td>"):
        assert cell in html
    assert "secret" not in html


def test_long_lists_are_cut():
    many = Whole(
        "t", (Part("p", 1.0),) * 99, {}, np.arange(13.0), np.zeros(1), {str(i): 1.0 for i in range(40)}
    )
    html = many._repr_html_()
    for told in ("99 in all", "40 in all", "array of shape (13,)"):
        assert told in html
    assert html.count("<tr>") < 80
