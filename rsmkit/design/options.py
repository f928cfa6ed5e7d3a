"""The ``[design]`` table of a study file: what all kinds of design read.

Each kind has a class of its own with the keys that it reads besides, next to its design
(:mod:`rsmkit.design.families`); the register says which (:mod:`rsmkit.design.families.registry`).
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, ClassVar, Literal

from rsmkit.io.option_fields import doc, given

__all__ = ["DEFAULT_KIND", "MOST_RUNS", "MOST_SEARCHED", "DesignOptions", "SearchedOptions", "counts"]

DEFAULT_KIND = "ccd"

MOST_RUNS = 1_000_000
"""More are a slip of the keyboard."""
MOST_SEARCHED = 10_000
"""Points that a criterion is optimised for, and starts of its search."""

SEARCH = ("replicates", "min_distance", "blocks", "block_variance", "whole_plots", "covariance", "starts")
"""Options that only the search for optimal points reads."""

Problems = list[tuple[str, str]]


def counts(options: Any, least: int, most: int, *keys: str) -> Problems:
    """Report which of these whole numbers, where given, are out of their range."""
    values = {key: getattr(options, key) for key in keys}
    return [
        (key, f"must be {least} to {most}, got {value}")
        for key, value in values.items()
        if value is not None and not least <= value <= most
    ]


@dataclass(frozen=True, kw_only=True)
class DesignOptions:
    """Which points to run."""

    searched: ClassVar[bool] = False
    """Whether there is no starting design: all points are searched for."""
    spreads: ClassVar[bool] = False
    """Whether points are spread out and not chosen for a model, also without criterion = 'maximin'."""
    fills: ClassVar[bool] = False
    """Whether points that are added to earlier runs are spread out."""
    fixed: ClassVar[bool] = False
    """Whether the user named the very points."""

    kind: str = doc(
        "family of the starting design, or your own 'module:function' of (space, runs, rng); when left out, "
        "optimal where a central composite design would be cut by constraints or have more than 80 runs"
    )
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
    whole_plots: int | tuple[int, ...] | None = doc(
        "where a factor has change = 'hard': number of whole plots, within which it keeps one setting, or "
        "the runs of each (as blocks)",
        None,
    )
    random: tuple[str, ...] = doc(
        "names of columns of the run sheet, such as day, whose values are a sample: their effects are "
        "random. With blocks, the first name is that of the blocks",
        (),
    )
    covariance: str | None = doc(
        "CSV table, a row per run and no head, of the covariance of the runs' errors", None
    )
    starts: int | None = doc("random starts of the search; chosen from the size of the problem", None)
    seed: int = doc("seed of every random choice", 1)
    subject_to: tuple[str, ...] = doc("constraints on the factors that every point must satisfy", ())
    keep_runs: bool = doc(
        "whether runs of an earlier design stay when the study has changed, and only what is missing beside "
        "them is planned; false plans as if there were none",
        True,
    )

    @property
    def planned_runs(self) -> int | None:
        """Number of runs in all, where the options say it."""
        return self.augment_to or getattr(self, "runs", None)

    @property
    def tables(self) -> dict[str, str | None]:
        """The user's own tables that the design is made from, by what they hold."""
        return {"candidate_points": self.candidates, "covariances": self.covariance}

    @property
    def record(self) -> dict[str, Any]:
        """What a design was made from, as JSON: the options that differ from their defaults, kind first.

        The order, and the default kind left out, are those of the first study files, so that their designs
        stay up to date.
        """
        chosen = given(self)
        if self.kind == DEFAULT_KIND:
            del chosen["kind"]
        shared = [item.name for item in fields(DesignOptions) if item.name != "kind"]
        return {key: chosen[key] for key in chosen if key not in shared} | {
            key: chosen[key] for key in shared if key in chosen
        }

    def problems(self) -> Problems:
        """Report what is wrong beyond types."""
        found = self._contradictions()
        if self.radius is not None and not (self.radius > 0 and self.region == "ball"):
            found.append(("radius", "must be positive and goes with region = 'ball'"))
        if any(size < 1 for size in self.blocks):
            found.append(("blocks", "needs at least one run in every block"))
        if self.block_variance is not None and not self.block_variance > 0:
            found.append(("block_variance", f"must be positive, got {self.block_variance:g}"))
        sizes = self.whole_plots if isinstance(self.whole_plots, tuple) else ()
        if isinstance(self.whole_plots, int) and self.whole_plots < 1:
            found.append(("whole_plots", f"must be at least 1, got {self.whole_plots}"))
        if any(size < 1 for size in sizes):
            found.append(("whole_plots", "needs at least one run in every plot"))
        if self.whole_plots is not None and self.blocks:
            found.append(("whole_plots", "says what blocks says; leave one of them out"))
        if len(set(self.random)) < len(self.random):
            found.append(("random", "names a column twice"))
        if self.block_variance is not None and self.covariance:
            found.append(("covariance", "says it all: leave block_variance out"))
        if self.min_distance is not None and not self.min_distance >= 0:
            found.append(("min_distance", f"must be at least 0, got {self.min_distance:g}"))
        found += counts(self, 1, MOST_SEARCHED, "augment_to", "starts")
        if self.seed < 0:
            found.append(("seed", f"must be at least 0, got {self.seed}"))
        return found

    def _contradictions(self) -> Problems:
        """Report options that others make meaningless."""
        found, chosen = Problems(), given(self)
        if self.replicates and self.min_distance:
            found.append(("replicates", "contradicts min_distance; leave one of them out"))
        if not self.searched and self.augment_to is None:
            idle = [key for key in ("criterion", *SEARCH) if key in chosen]
            found += [(key, "has no effect without augment_to; leave it out, or name both") for key in idle]
        elif self.spreads or self.criterion == "maximin":
            idle = [key for key in SEARCH if key in chosen]
            found += [(key, "has no effect on points spread by 'maximin'; leave it out") for key in idle]
        return found


@dataclass(frozen=True, kw_only=True)
class SearchedOptions(DesignOptions):
    """All points are searched for; there is no starting design."""

    searched: ClassVar[bool] = True

    runs: int | None = doc("number of runs in all; augment_to says the same", None)

    def problems(self) -> Problems:
        """Report what is wrong beyond types."""
        found = super().problems() + counts(self, 1, MOST_SEARCHED, "runs")
        if self.runs and self.augment_to and self.runs != self.augment_to:
            both = f"is {self.augment_to}, but runs is {self.runs}"
            found.append(("augment_to", f"{both}: each is the number of runs in all; leave one of them out"))
        return found
