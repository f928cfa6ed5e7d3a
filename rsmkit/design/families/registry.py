"""The register of design families: a new one is a file beside this one, and a row here.

What loops over it: ``[design] kind`` of the study file, its reference, the plan stage, the contract test.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from rsmkit.design.design import Design
from rsmkit.design.families.box_behnken import BoxBehnkenOptions, box_behnken, make_box_behnken
from rsmkit.design.families.composite import CompositeOptions, ccd, make_ccd
from rsmkit.design.families.mixtures.blend_designs import (
    ExtremeVerticesOptions,
    SimplexCentroidOptions,
    SimplexLatticeOptions,
    extreme_vertices,
    make_extreme_vertices,
    make_simplex_centroid,
    make_simplex_lattice,
    simplex_centroid,
    simplex_lattice,
)
from rsmkit.design.families.own_points import (
    FUNCTION,
    FileOptions,
    FunctionOptions,
    is_function,
    points_of_a_file,
    points_of_a_function,
)
from rsmkit.design.families.searched import MaximinOptions, OptimalOptions, no_points
from rsmkit.design.families.site import Site
from rsmkit.design.families.space_filling import (
    LatinHypercubeOptions,
    SequenceOptions,
    fill,
    halton,
    latin_hypercube,
    make_halton,
    make_latin_hypercube,
    make_sobol,
    sobol,
)
from rsmkit.design.families.two_level.factorial import (
    FactorialOptions,
    FractionalFactorialOptions,
    fractional_factorial,
    full_factorial,
    make_factorial,
    make_fractional_factorial,
)
from rsmkit.design.families.two_level.screening import (
    ScreeningOptions,
    definitive_screening,
    make_definitive_screening,
    make_plackett_burman,
    plackett_burman,
)
from rsmkit.design.optimal.optimal_design import optimal_design
from rsmkit.design.options import DEFAULT_KIND, DesignOptions
from rsmkit.errors import one_of
from rsmkit.language.space import Space

__all__ = ["FAMILIES", "Family", "design_options", "family_of", "option_classes", "word_of"]


@dataclass(frozen=True)
class Family:
    """One kind of design.

    Parameters
    ----------
    word : str
        What ``[design] kind`` calls it.
    options : type
        The keys it reads: a frozen dataclass derived from :class:`rsmkit.design.options.DesignOptions`.
    make : callable
        ``make(space, options, site)`` gives the starting design. Points that a constraint forbids may be in
        it, they are left out; a family that promises a number of runs makes others instead.
    function : callable, optional
        The same design from Python, a name of ``rsmkit``.
    mixes : bool
        Whether it can hold its points on a mixture or another equality of factors.
    """

    word: str
    options: type[DesignOptions]
    make: Callable[[Space, Any, Site], Design]
    function: Callable[..., Design] | None = None
    mixes: bool = False


FAMILIES = {
    row.word: row
    for row in (
        Family("ccd", CompositeOptions, make_ccd, ccd),
        Family("box-behnken", BoxBehnkenOptions, make_box_behnken, box_behnken),
        Family("factorial", FactorialOptions, make_factorial, full_factorial),
        Family(
            "fractional-factorial",
            FractionalFactorialOptions,
            make_fractional_factorial,
            fractional_factorial,
        ),
        Family("plackett-burman", ScreeningOptions, make_plackett_burman, plackett_burman),
        Family("definitive-screening", ScreeningOptions, make_definitive_screening, definitive_screening),
        Family("latin-hypercube", LatinHypercubeOptions, make_latin_hypercube, latin_hypercube),
        Family("sobol", SequenceOptions, make_sobol, sobol, mixes=True),
        Family("halton", SequenceOptions, make_halton, halton, mixes=True),
        Family("maximin", MaximinOptions, no_points, fill, mixes=True),
        Family("optimal", OptimalOptions, no_points, optimal_design, mixes=True),
        Family("simplex-lattice", SimplexLatticeOptions, make_simplex_lattice, simplex_lattice, mixes=True),
        Family(
            "simplex-centroid", SimplexCentroidOptions, make_simplex_centroid, simplex_centroid, mixes=True
        ),
        Family(
            "extreme-vertices", ExtremeVerticesOptions, make_extreme_vertices, extreme_vertices, mixes=True
        ),
        Family("file", FileOptions, points_of_a_file, mixes=True),
        Family(FUNCTION, FunctionOptions, points_of_a_function, mixes=True),
    )
}
"""Every kind of design, by its word, in the order in which people read of them."""


def word_of(kind: str) -> str:
    """The word of the row that a kind belongs to: every user's function is of one kind."""
    return FUNCTION if is_function(kind) else kind


def family_of(kind: str) -> Family:
    """The row of a kind.

    Raises
    ------
    RsmkitError
        If there is none.
    """
    return FAMILIES[one_of("design.kind", word_of(kind), FAMILIES)]


def option_classes() -> dict[str, type[DesignOptions]]:
    """Which class of options each kind reads, by its word."""
    return {word: row.options for word, row in FAMILIES.items()}


def design_options(kind: str = DEFAULT_KIND, **keys: Any) -> DesignOptions:
    """The options of a kind of design, as a ``[design]`` table would give them.

    Parameters
    ----------
    kind : str
        A word of the register, or ``module:function``.
    **keys
        Those the kind reads.

    Examples
    --------
    >>> design_options("sobol", runs=16).planned_runs
    16
    """
    return family_of(kind).options(kind=kind, **keys)
