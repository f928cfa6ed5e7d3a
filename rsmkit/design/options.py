"""The ``[design]`` table of a study file."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal

from rsmkit.io.option_fields import doc, given, idle_options

__all__ = ["KINDS", "DesignOptions"]

KINDS = (
    "ccd",
    "box-behnken",
    "factorial",
    "fractional-factorial",
    "plackett-burman",
    "definitive-screening",
    "latin-hypercube",
    "sobol",
    "halton",
    "maximin",
    "optimal",
    "file",
    "module:function",
)

SCREENING = ("fractional-factorial", "plackett-burman", "definitive-screening")
USED_BY = {
    "star": ("ccd",),
    "alpha": ("ccd",),
    "center": ("ccd", "box-behnken", "factorial", *SCREENING),
    "center_axial": ("ccd",),
    "cube": ("ccd",),
    "blocked": ("ccd", "box-behnken"),
    "runs": (*SCREENING, "latin-hypercube", "sobol", "halton", "maximin", "optimal"),
    "levels": ("factorial",),
    "reduction": ("factorial",),
    "generators": ("ccd", "fractional-factorial"),
    "spread": ("latin-hypercube",),
    "file": ("file",),
}
"""Options that only some kinds of design read."""

SEARCH = ("replicates", "min_distance", "blocks", "block_variance", "covariance", "starts")
"""Options that only the search for optimal points reads."""

MOST_RUNS = 1_000_000
"""More are a slip of the keyboard."""
MOST_SEARCHED = 10_000
"""Points that a criterion is optimised for, and starts of its search."""


@dataclass(frozen=True)
class DesignOptions:
    """Which points to run."""

    kind: str = doc(
        "family of the starting design: ccd, box-behnken, factorial, fractional-factorial, plackett-burman, "
        "definitive-screening, latin-hypercube, sobol, halton, maximin, optimal, file, or your own "
        "'module:function' of (space, runs, rng)",
        "ccd",
    )
    star: Literal["circumscribed", "inscribed", "faced"] = doc(
        "where a central composite design's star points lie: circumscribed puts the cube on the bounds and "
        "the stars outside, inscribed the stars on the bounds, faced both on the bounds",
        "circumscribed",
    )
    alpha: Literal["rotatable", "orthogonal", "spherical", "uncorrelated"] | float = doc(
        "star distance in coded units, or the property it shall give", "rotatable"
    )
    center: int = doc("centre points of the starting design", 3)
    center_axial: int = doc("centre points run with the star of a central composite design", 0)
    cube: Literal["full", "fraction"] = doc(
        "corners of a composite design: all, or the smallest standard fraction of resolution five", "full"
    )
    blocked: bool = doc("run a composite (alpha = 'orthogonal') or Box-Behnken design in its blocks", False)
    runs: int | None = doc("number of runs of a design that takes one", None)
    levels: int | dict[str, int] = doc(
        "levels of the continuous factors of a factorial design: of all, or by name", 2
    )
    reduction: int = doc("take one of so many balanced parts of a factorial design", 1)
    generators: tuple[str, ...] = doc(
        "generators of a fractional factorial or of a composite design's cube, such as 'E=ABCD'", ()
    )
    spread: Literal["maximin", "discrepancy", "correlation"] = doc(
        "what a Latin hypercube is improved for", "maximin"
    )
    file: str | None = doc("CSV table of your own points, for kind 'file'", None)
    augment_to: int | None = doc("total number of runs after D-optimal (or other) augmentation", None)
    criterion: Literal["D", "A", "G", "I", "bayesian-D", "maximin"] = doc(
        "criterion of optimal designs and of the augmentation", "D"
    )
    replicates: bool = doc(
        "whether optimal points may repeat others (useful for noisy simulators only)", False
    )
    min_distance: float | None = doc(
        "smallest distance of an added point from any other, in coded units; by default 0.2, or 0 with "
        "replicates",
        None,
    )
    region: Literal["bounds", "stars", "ball"] = doc(
        "where added points may lie: within the bounds, within the box that holds the star points, or within "
        "a ball about the centre",
        "bounds",
    )
    radius: float | None = doc(
        "coded radius of the ball; by default it goes through the corners of the bounds", None
    )
    candidates: str | None = doc("CSV table of the only points that may be added", None)
    blocks: tuple[int, ...] = doc("runs of each block, in order, that optimal points are chosen for", ())
    block_variance: float | None = doc(
        "variance of random block (or whole-plot) effects over that of the error; fixed effects by default",
        None,
    )
    covariance: str | None = doc(
        "CSV table, a row per run and no head, of the covariance of the runs' errors", None
    )
    starts: int | None = doc("random starts of the search; chosen from the size of the problem", None)
    seed: int = doc("seed of every random choice", 1)
    subject_to: tuple[str, ...] = doc("constraints on the factors that every point must satisfy", ())

    def problems(self) -> list[tuple[str, str]]:
        """Report what is wrong beyond types."""
        found = idle_options(self, "kind", USED_BY) if self.kind in KINDS else []
        found += self._contradictions()
        own = self.kind.count(":") == 1 and all(p.isidentifier() for p in re.split("[:.]", self.kind))
        if self.kind not in KINDS and not own:
            found.append(("kind", f"must be one of {', '.join(KINDS)}, got '{self.kind}'"))
        if self.kind == "file" and not self.file:
            found.append(("file", "is missing; name the CSV table of your own points"))
        counts = self.levels.values() if isinstance(self.levels, dict) else [self.levels]
        found += [("levels", f"must be at least 2, got {count}") for count in counts if count < 2]
        if self.radius is not None and not (self.radius > 0 and self.region == "ball"):
            found.append(("radius", "must be positive and goes with region = 'ball'"))
        if any(size < 1 for size in self.blocks):
            found.append(("blocks", "needs at least one run in every block"))
        if self.block_variance is not None and not self.block_variance > 0:
            found.append(("block_variance", f"must be positive, got {self.block_variance:g}"))
        if self.block_variance is not None and self.covariance:
            found.append(("covariance", "says it all: leave block_variance out"))
        if isinstance(self.alpha, float) and not self.alpha > 0:
            found.append(("alpha", f"must be positive, got {self.alpha:g}"))
        for key in ("center", "center_axial"):
            if not 0 <= getattr(self, key) <= MOST_RUNS:
                found.append((key, f"must be 0 to {MOST_RUNS}, got {getattr(self, key)}"))
        if self.min_distance is not None and not self.min_distance >= 0:
            found.append(("min_distance", f"must be at least 0, got {self.min_distance:g}"))
        most = {
            "runs": MOST_RUNS,
            "augment_to": MOST_SEARCHED,
            "starts": MOST_SEARCHED,
            "reduction": MOST_RUNS,
        }
        if self.kind in ("optimal", "maximin"):
            most["runs"] = MOST_SEARCHED
        for key, limit in most.items():
            value = getattr(self, key)
            if value is not None and not 1 <= value <= limit:
                found.append((key, f"must be 1 to {limit}, got {value}"))
        if self.seed < 0:
            found.append(("seed", f"must be at least 0, got {self.seed}"))
        return found

    def _contradictions(self) -> list[tuple[str, str]]:
        """Report options that others make meaningless."""
        found = []
        searched = self.kind in ("optimal", "maximin")
        if searched and self.runs and self.augment_to and self.runs != self.augment_to:
            both = f"is {self.augment_to}, but runs is {self.runs}"
            found.append(("augment_to", f"{both}: each is the number of runs in all; leave one of them out"))
        if self.kind == "maximin" and self.criterion not in ("D", "maximin"):
            found.append(("criterion", f"'{self.criterion}' goes with kind = 'optimal', not with 'maximin'"))
        if self.replicates and self.min_distance:
            found.append(("replicates", "contradicts min_distance; leave one of them out"))
        chosen = given(self)
        if not searched and self.augment_to is None:
            idle = [key for key in ("criterion", *SEARCH) if key in chosen]
            found += [(key, "has no effect without augment_to; leave it out, or name both") for key in idle]
        elif "maximin" in (self.kind, self.criterion):
            idle = [key for key in SEARCH if key in chosen]
            found += [(key, "has no effect on points spread by 'maximin'; leave it out") for key in idle]
        return found
