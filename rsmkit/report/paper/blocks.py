"""What a report to hand in is made of, whatever it is written as."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

__all__ = ["Block", "Grid", "Heading", "NewPage", "Paper", "Picture", "Text", "cell_text"]


@dataclass(frozen=True)
class Heading:
    """A title; level 1 begins a chapter."""

    text: str
    level: int = 1


@dataclass(frozen=True)
class Text:
    """A paragraph; a `strong` one is what the reader must not miss."""

    text: str
    strong: bool = False


@dataclass(frozen=True)
class Grid:
    """A table of texts.

    Parameters
    ----------
    title : str
        What is in it.
    heads : sequence of str
    rows : sequence of sequence of object
    greyed : frozenset of int
        Rows, from 0, that do not count.
    """

    title: str
    heads: Sequence[str]
    rows: Sequence[Sequence[object]]
    greyed: frozenset[int] = frozenset()


@dataclass(frozen=True)
class Picture:
    """A picture as PNG, with what it shows in words."""

    png: bytes = field(repr=False)
    caption: str


@dataclass(frozen=True)
class NewPage:
    """What follows begins on a new page."""


Block = Heading | Text | Grid | Picture | NewPage


@dataclass(frozen=True)
class Paper:
    """A whole report."""

    title: str
    blocks: Sequence[Block]


def cell_text(value: object) -> str:
    """A cell as people read it."""
    if value is None or value != value:
        return "–"
    return f"{value:.5g}" if isinstance(value, float) else str(value)
