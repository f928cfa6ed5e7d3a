"""Designs of mixtures: simplex lattice, simplex centroid, extreme vertices; with process factors beside."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any, Literal

import numpy as np

from rsmkit.design.design import Design
from rsmkit.design.families.box_behnken import box_behnken
from rsmkit.design.families.composite import ccd
from rsmkit.design.families.mixtures.blends import (
    Blend,
    axial_shares,
    centroid_shares,
    face_blends,
    lattice_shares,
    of_corners,
)
from rsmkit.design.families.site import Site
from rsmkit.design.families.two_level.factorial import full_factorial
from rsmkit.design.options import MOST_RUNS, DesignOptions, Problems, counts
from rsmkit.design.region import Margin, Region, box, placed
from rsmkit.errors import RsmkitError
from rsmkit.geometry.tied_groups import Group
from rsmkit.io.arguments import checked
from rsmkit.io.option_fields import doc
from rsmkit.language.space import Floats, Space

__all__ = [
    "Centroids",
    "ExtremeVerticesOptions",
    "MixtureOptions",
    "Process",
    "SimplexCentroidOptions",
    "SimplexLatticeOptions",
    "extreme_vertices",
    "make_extreme_vertices",
    "make_simplex_centroid",
    "make_simplex_lattice",
    "simplex_centroid",
    "simplex_lattice",
]

Process = Literal["factorial", "three-level", "ccd", "box-behnken"]
Centroids = Literal["none", "overall", "edges", "planes", "all"]

HIGHEST: dict[Centroids, int] = {"none": 0, "overall": 0, "edges": 1, "planes": 2, "all": 99}
"""Dimensions of the faces whose centroids are run."""
PROCESS: dict[Process, Callable[[Space], Design]] = {
    "factorial": full_factorial,
    "three-level": lambda space: full_factorial(space, levels=3),
    "ccd": lambda space: ccd(space, star="faced", center=1),
    "box-behnken": lambda space: box_behnken(space, center=1),
}
"""Designs of the factors beside a mixture."""
LARGEST = 100_000


@dataclass(frozen=True, kw_only=True)
class MixtureOptions(DesignOptions):
    """Mixture design; every blend is run at every point of a design of the other factors."""

    process: Process = doc(
        "design of the factors beside the mixture, at whose every point all blends are run: corners "
        "(factorial), three levels of each, faced central composite, Box-Behnken; all categories always",
        "three-level",
    )
    center: int = doc(
        "runs of the centroid of the mixture besides, with the other factors at their middle", 0
    )
    repeats: int = doc("how often the whole design is run", 1)
    blocked: bool = doc("whether every repeat is a block of its own", False)

    def problems(self) -> Problems:
        """Report what is wrong beyond types."""
        found = (
            super().problems() + counts(self, 0, MOST_RUNS, "center") + counts(self, 1, MOST_RUNS, "repeats")
        )
        if self.blocked and self.repeats == 1:
            found.append(("blocked", "makes a block of every repeat, and there is one; set repeats"))
        return found


@dataclass(frozen=True, kw_only=True)
class SimplexLatticeOptions(MixtureOptions):
    """Simplex lattice: every component takes the shares 0, 1/m, 2/m, ..., 1."""

    degree: int = doc("m, the number of steps: 2 for a quadratic model, 3 for a cubic one", 2)
    axial: bool = doc("whether the centroid and the blends half-way to the corners are run to check", False)

    def problems(self) -> Problems:
        """Report what is wrong beyond types."""
        return super().problems() + counts(self, 1, 100, "degree")


@dataclass(frozen=True, kw_only=True)
class SimplexCentroidOptions(MixtureOptions):
    """Simplex centroid: equal shares of one component, of two, of three, ..., of all."""

    most: int | None = doc("components in a blend at most; all by default", None)
    axial: bool = doc("whether blends half-way from the centroid to the corners are run to check", False)

    def problems(self) -> Problems:
        """Report what is wrong beyond types."""
        return super().problems() + counts(self, 1, 100, "most")


@dataclass(frozen=True, kw_only=True)
class ExtremeVerticesOptions(MixtureOptions):
    """Extreme vertices of the region that bounds and linear limits leave, and centroids of its faces."""

    centroids: Centroids = doc(
        "which centroids are run besides: that of all vertices (overall), those of the edges too, of the "
        "planes too, of the faces of all dimensions",
        "edges",
    )


def make_simplex_lattice(space: Space, options: SimplexLatticeOptions, site: Site) -> Design:
    """The design of the study file."""
    return simplex_lattice(space, degree=options.degree, axial=options.axial, **_common(options))


def make_simplex_centroid(space: Space, options: SimplexCentroidOptions, site: Site) -> Design:
    """The design of the study file."""
    return simplex_centroid(space, most=options.most, axial=options.axial, **_common(options))


def make_extreme_vertices(space: Space, options: ExtremeVerticesOptions, site: Site) -> Design:
    """The design of the study file."""
    return extreme_vertices(
        space, centroids=options.centroids, constraints=site.constraints, **_common(options)
    )


def _common(options: MixtureOptions) -> dict[str, Any]:
    return {
        "process": options.process,
        "center": options.center,
        "repeats": options.repeats,
        "blocked": options.blocked,
    }


@checked
def simplex_lattice(
    space: Space,
    *,
    degree: int = 2,
    axial: bool = False,
    process: Process = "three-level",
    center: int = 0,
    repeats: int = 1,
    blocked: bool = False,
) -> Design:
    """Simplex lattice: every component of a mixture takes the shares 0, 1/m, ..., 1 (Scheffe 1958).

    Parameters
    ----------
    space : Space
        With a mixture whose bounds leave a simplex. Lower bounds do (the shares are then those of
        pseudo-components), most upper bounds do not.
    degree : int
        m, the degree of the model that can be fitted.
    axial : bool
        Run the centroid, and the blends half-way from it to the corners, to check the model.
    process : {"factorial", "three-level", "ccd", "box-behnken"}
        Design of the factors that are no components; every blend is run at each of its points.
    center : int
        Further runs at the centroid, with the other factors at their middle.
    repeats : int
        How often the whole is run.
    blocked : bool
        Every repeat is a block.

    Notes
    -----
    Scheffe, H. (1958), Journal of the Royal Statistical Society B 20(2), 344-360. Check blends: Snee (1971),
    Journal of Quality Technology 3(4), 159-169. Several mixtures: every blend of one with every blend of the
    other.

    Examples
    --------
    >>> space = Space(a=(0, 1), b=(0, 1), c=(0, 1)).mixture("a", "b", "c")
    >>> simplex_lattice(space).points[3:].tolist()
    [[0.5, 0.5, 0.0], [0.5, 0.0, 0.5], [0.0, 0.5, 0.5]]
    """

    def blends(group: Group, names: list[str]) -> list[Blend]:
        q = group.polytope.dimension + 1
        shares = _checked_by(lattice_shares(q, degree), q, axial=axial)
        return of_corners(group, shares, names, "simplex-lattice")

    region = _mixed(space, "simplex-lattice")
    return _crossed(region, blends, process, center, repeats, blocked)


@checked
def simplex_centroid(
    space: Space,
    *,
    most: int | None = None,
    axial: bool = False,
    process: Process = "three-level",
    center: int = 0,
    repeats: int = 1,
    blocked: bool = False,
) -> Design:
    """Simplex centroid: equal shares of one component, of every two, of every three, ... (Scheffe 1963).

    Parameters
    ----------
    space : Space
        With a mixture whose bounds leave a simplex; see :func:`simplex_lattice`.
    most : int, optional
        Components in a blend at most; all by default.
    axial : bool
        Run blends half-way from the centroid to the corners to check the model.
    process, center, repeats, blocked
        As for :func:`simplex_lattice`.

    Notes
    -----
    Scheffe, H. (1963), Journal of the Royal Statistical Society B 25(2), 235-251.
    """

    def blends(group: Group, names: list[str]) -> list[Blend]:
        q = group.polytope.dimension + 1
        shares = _checked_by(centroid_shares(q, min(most or q, q)), q, axial=axial)
        return of_corners(group, shares, names, "simplex-centroid")

    region = _mixed(space, "simplex-centroid")
    return _crossed(region, blends, process, center, repeats, blocked)


@checked
def extreme_vertices(
    space: Space,
    *,
    centroids: Centroids = "edges",
    constraints: Sequence[Margin] = (),
    process: Process = "three-level",
    center: int = 0,
    repeats: int = 1,
    blocked: bool = False,
) -> Design:
    """Corners of the region that bounds and linear limits leave of a mixture, and centroids of its faces.

    Parameters
    ----------
    space : Space
        With a mixture, or another equality.
    centroids : {"none", "overall", "edges", "planes", "all"}
        Which centroids are run besides: none; the mean of all corners; the mid-points of the edges too; the
        centroids of the faces of two dimensions too; those of all dimensions.
    constraints : sequence of callable
        Margins; see :func:`rsmkit.design.build.build_design`. Linear ones shape the region; the others leave
        points out.
    process, center, repeats, blocked
        As for :func:`simplex_lattice`. Factors that a limit ties to components belong to the region.

    Notes
    -----
    McLean, R. A. & Anderson, V. L. (1966), Technometrics 8(3), 447-454; the centroid of a face is the mean of
    its corners. The corners come from the double description of the region, which takes any linear limits
    (as Snee 1979, Technometrics 21(2), 149-159).
    """

    def blends(group: Group, names: list[str]) -> list[Blend]:
        return face_blends(group, HIGHEST[centroids], centroids != "none")

    region = _mixed(space, "extreme-vertices", constraints)
    return _crossed(region, blends, process, center, repeats, blocked)


def _mixed(space: Space, word: str, constraints: Sequence[Margin] = ()) -> Region:
    """The region of a space with a mixture.

    Raises
    ------
    RsmkitError
        When there is none.
    """
    others = word == "extreme-vertices"
    if not (space.equalities if others else space.mixtures):
        raise RsmkitError(
            f"design.kind: '{word}' is for mixtures, and no factors add up to a total here; name the "
            "components in the study file, [mixture] components = ['a', 'b', 'c'], in Python "
            "space.mixture('a', 'b', 'c'), or take kind = 'ccd', 'factorial' or 'optimal'"
        )
    loose = [e.text for e in space.equalities if e not in [m.equality for m in space.mixtures]]
    if loose and not others:
        raise RsmkitError(
            f"design.kind: '{word}' knows mixtures only, and '{loose[0]}' is none; take kind = "
            "'extreme-vertices' or 'optimal'"
        )
    return box(space, 1.0, constraints)


def _crossed(
    region: Region,
    blends: Callable[[Group, list[str]], list[Blend]],
    process: Process,
    center: int,
    repeats: int,
    blocked: bool,
) -> Design:
    """Every blend of every group with every point of a design of the factors that nothing ties."""
    space = region.space
    tied = [g for g in region.groups if len(g.polytope.rhs) or len(g.polytope.offsets)]
    lists = [blends(group, [space.names[j] for j in group.columns]) for group in tied]
    inside = {int(j) for group in tied for j in group.columns}
    free = [j for j in range(len(space)) if j not in inside]
    beside = PROCESS[process](Space([space.factors[j] for j in free])) if free else None
    count = len(beside) if beside else 1
    if count * np.prod([len(found) for found in lists], dtype=float) > LARGEST:
        raise RsmkitError(
            f"design: {' x '.join(str(len(found)) for found in lists)} blends at {count} points of the other "
            f"factors are more than {LARGEST} runs; take fewer centroids, or kind = 'optimal'"
        )
    coded = space.encode(np.array([factor.domain.middle for factor in space]))
    points, kinds = list[Floats](), list[str]()
    for row in range(count):
        for chosen in product(*lists):
            point = coded.copy()
            if beside is not None:
                point[free] = beside.coded[row]
            for group, (_, place) in zip(tied, chosen, strict=True):
                point[group.columns] = place
            points.append(point)
            kinds.append("-".join(dict.fromkeys(kind for kind, _ in chosen)))
    middle = coded.copy()
    for group in tied:
        middle[group.columns] = group.corners.mean(axis=0)
    natural = placed(space, np.array(points + [middle] * center))
    design = Design(space, natural, (*kinds, *["center"] * center))
    if repeats == 1:
        return design
    blocks = tuple(np.repeat(np.arange(repeats) + 1, len(design)).tolist()) if blocked else ()
    return replace(
        design, points=np.tile(design.points, (repeats, 1)), kinds=design.kinds * repeats, blocks=blocks
    )


def _checked_by(shares: list[Blend], q: int, *, axial: bool) -> list[Blend]:
    """With the blends half-way to the corners, and the centroid where it is not run anyway."""
    has_centroid = any(np.allclose(place, 1.0 / q) for _, place in shares)
    return shares + axial_shares(q, not has_centroid) if axial else shares
