"""Two or more designs side by side: a table of figures and the fraction-of-design-space plot."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from rsmkit.design.design import Design
from rsmkit.design.quality.assessment import Quality, assess
from rsmkit.design.quality.variance import design_space_fraction
from rsmkit.design.region import Region
from rsmkit.errors import RsmkitError
from rsmkit.io.arguments import checked
from rsmkit.io.shown import Shown
from rsmkit.language.terms import Terms

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["DesignComparison", "compare_designs", "plot_design_space_fraction"]

ROWS = (
    ("runs", "runs"),
    ("distinct points", "distinct"),
    ("D-efficiency, %", "d_efficiency"),
    ("D-efficiency against the bound, %", "d_bound_efficiency"),
    ("A-efficiency, %", "a_efficiency"),
    ("G-efficiency, %", "g_efficiency"),
    ("I-efficiency, %", "i_efficiency"),
    ("average prediction variance", "average_variance"),
    ("largest prediction variance", "largest_variance"),
    ("condition number", "condition_number"),
)


@dataclass(frozen=True)
class DesignComparison(Shown):
    """Figures of several designs for the same model and region.

    Parameters
    ----------
    names : tuple of str
    qualities : tuple of Quality
    """

    names: tuple[str, ...]
    qualities: tuple[Quality, ...]

    @property
    def rows(self) -> list[tuple[str, tuple[float | None, ...]]]:
        """Label and one value per design; None where a design is singular."""
        table = [(label, tuple(getattr(q, key) for q in self.qualities)) for label, key in ROWS]
        table.append(("largest VIF", tuple(max(q.vif.values(), default=None) for q in self.qualities)))
        for label, place in (("half", 5), ("90 %", 9)):
            values = [q.variance_fractions[place] if q.variance_fractions else None for q in self.qualities]
            table.append((f"prediction variance in {label} of the region, at most", tuple(values)))
        table.append(("least power of a term", tuple(_least_power(q) for q in self.qualities)))
        if any(q.plots for q in self.qualities):
            table += self._plot_rows()
        table.append(("largest leverage", tuple(max(q.leverages, default=None) for q in self.qualities)))
        return table

    def _plot_rows(self) -> list[tuple[str, tuple[float | None, ...]]]:
        """Efficiencies at both levels of a split plot, for every ratio that all designs have figures for."""
        rows: list[tuple[str, tuple[float | None, ...]]] = []
        at = [{figures.ratio: figures for figures in q.plots} for q in self.qualities]
        for ratio in sorted({ratio for figures in at for ratio in figures}):
            here = [figures.get(ratio) for figures in at]
            for label, key in (
                ("D-efficiency of whole-plot terms, %", "whole_plot_efficiency"),
                ("D-efficiency of sub-plot terms, %", "sub_plot_efficiency"),
                ("average prediction variance", "average_variance"),
            ):
                values = tuple(None if f is None else getattr(f, key) for f in here)
                rows.append((f"{label}, ratio {ratio:g}", values))
        least = (
            min((df for df in q.denominator_df.values() if df is not None), default=None)
            for q in self.qualities
        )
        return [*rows, ("least degrees of freedom of a test", tuple(least))]

    def overview(self) -> dict[str, Any]:
        """The figures by design, as plain JSON types."""
        return {name: quality.to_json() for name, quality in zip(self.names, self.qualities, strict=True)}


def _least_power(quality: Quality) -> float | None:
    return min((x for x in quality.power.values() if x is not None), default=None)


@checked
def compare_designs(
    designs: Mapping[str, Design],
    *,
    order: int = 2,
    terms: Terms | None = None,
    region: Region | None = None,
    deterministic: bool = True,
) -> DesignComparison:
    """Assess several designs of the same factors for the same model.

    Raises
    ------
    RsmkitError
        When their factors differ.
    """
    if len({design.space for design in designs.values()}) > 1:
        raise RsmkitError("designs can be compared only when they have the same factors and ranges")
    options: dict[str, Any] = {
        "order": order,
        "terms": terms,
        "region": region,
        "deterministic": deterministic,
    }
    qualities = [assess(design, **options) for design in designs.values()]
    return DesignComparison(tuple(designs), tuple(qualities))


def plot_design_space_fraction(
    designs: Mapping[str, Design],
    *,
    order: int = 2,
    terms: Terms | None = None,
    region: Region | None = None,
) -> Figure:
    """Draw prediction variance against the fraction of the region where it is not exceeded."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.0, 4.0), layout="constrained")
    axes = figure.subplots()
    for name, design in designs.items():
        axes.plot(*design_space_fraction(design, order=order, terms=terms, region=region), label=name)
    axes.set(
        xlabel="fraction of design space",
        ylabel="prediction variance / error variance",
        xlim=(0, 1),
        ylim=(0, None),
    )
    axes.grid(alpha=0.3)
    axes.legend()
    return figure
