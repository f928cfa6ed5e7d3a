"""Points of the user's own: a CSV table, or a function that makes them."""

from __future__ import annotations

import importlib
import re
import sys
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from rsmkit.design.design import Design
from rsmkit.design.families.site import Site
from rsmkit.design.options import MOST_RUNS, DesignOptions, Problems, counts
from rsmkit.errors import RsmkitError
from rsmkit.io.files.regular_files import inside
from rsmkit.io.option_fields import doc
from rsmkit.language.space import Space

__all__ = [
    "FUNCTION",
    "FileOptions",
    "FunctionOptions",
    "is_function",
    "points_of_a_file",
    "points_of_a_function",
]

FUNCTION = "module:function"
"""Stands for all functions that a user may name as kind."""


@dataclass(frozen=True, kw_only=True)
class FileOptions(DesignOptions):
    """Your own points, from a CSV table with a column per factor."""

    fixed: ClassVar[bool] = True

    file: str | None = doc("CSV table of your own points", None)

    @property
    def tables(self) -> dict[str, str | None]:
        """The user's own tables that the design is made from, by what they hold."""
        return {"points": self.file, **super().tables}

    def problems(self) -> Problems:
        """Report what is wrong beyond types."""
        missing = [] if self.file else [("file", "is missing; name the CSV table of your own points")]
        return super().problems() + missing


@dataclass(frozen=True, kw_only=True)
class FunctionOptions(DesignOptions):
    """Your own points, from a Python function beside the study file or installed."""

    fixed: ClassVar[bool] = True

    runs: int | None = doc("passed to the function", None)

    def problems(self) -> Problems:
        """Report what is wrong beyond types."""
        return super().problems() + counts(self, 1, MOST_RUNS, "runs")


def is_function(kind: str) -> bool:
    """Whether a kind of design names a function."""
    return kind.count(":") == 1 and all(part.isidentifier() for part in re.split("[:.]", kind))


def points_of_a_file(space: Space, options: FileOptions, site: Site) -> Design:
    """Read the points of the table, natural units."""
    if not options.file:
        raise RsmkitError("design.file is missing: name the CSV table of your own points")
    return Design.from_csv(inside(site.folder, options.file, "design.file"), space)


def points_of_a_function(space: Space, options: FunctionOptions, site: Site) -> Design:
    """Call ``module:function(space, runs, rng)`` for points in natural units."""
    module, _, name = options.kind.partition(":")
    sys.path.insert(0, str(site.folder))
    try:
        points = getattr(importlib.import_module(module), name)(
            space, options.runs, np.random.default_rng(options.seed)
        )
    except (ImportError, AttributeError) as error:
        raise RsmkitError(f"design.kind: '{options.kind}' cannot be loaded ({error})") from None
    finally:
        sys.path.remove(str(site.folder))
    points = np.asarray(points, float)
    return Design(space, points, ("given",) * len(points))
