"""Central composite designs: a cube, a star and centre points (Box & Wilson 1951)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from rsmkit.design.design import Design, classical
from rsmkit.design.families import pydoe
from rsmkit.design.families.site import Site
from rsmkit.design.families.two_level.factorial import LETTERS, STANDARD, fraction
from rsmkit.design.options import MOST_RUNS, DesignOptions, Problems, counts
from rsmkit.errors import RsmkitError
from rsmkit.io.arguments import checked
from rsmkit.io.option_fields import doc
from rsmkit.language.space import Space

__all__ = ["Alpha", "CompositeOptions", "Cube", "Star", "ccd", "make_ccd", "star_distance"]

Star = Literal["circumscribed", "inscribed", "faced"]
StarRule = Literal["rotatable", "orthogonal", "spherical", "uncorrelated"]
Alpha = StarRule | float
Cube = Literal["full", "fraction", "small"]

LARGEST_CUBE = 2**12


@dataclass(frozen=True, kw_only=True)
class CompositeOptions(DesignOptions):
    """Central composite design: a cube, a star and centre points."""

    star: Star = doc(
        "where the star points lie: circumscribed puts the cube on the bounds and the stars outside, "
        "inscribed the stars on the bounds, faced both on the bounds",
        "circumscribed",
    )
    alpha: Alpha = doc("star distance in coded units, or the property it shall give", "rotatable")
    center: int = doc("centre points, run with the cube", 3)
    center_axial: int = doc("centre points run with the star", 0)
    star_replicates: int = doc("how often each star point is run", 1)
    cube: Cube = doc(
        "corners: all, the smallest standard fraction of resolution five, or the small one of Hartley "
        "(1959), of which the star makes a second-order design",
        "full",
    )
    blocked: bool = doc("run cube and star in blocks of their own; alpha = 'orthogonal' goes with it", False)
    generators: tuple[str, ...] = doc("generators of a fractional cube, such as 'E=ABCD'", ())

    def problems(self) -> Problems:
        """Report what is wrong beyond types."""
        found = super().problems()
        if isinstance(self.alpha, float) and not self.alpha > 0:
            found.append(("alpha", f"must be positive, got {self.alpha:g}"))
        found += counts(self, 1, MOST_RUNS, "star_replicates")
        return found + counts(self, 0, MOST_RUNS, "center", "center_axial")


def make_ccd(space: Space, options: CompositeOptions, site: Site) -> Design:
    """The design of the study file."""
    return ccd(
        space,
        star=options.star,
        alpha=options.alpha,
        center=options.center,
        center_axial=options.center_axial,
        star_replicates=options.star_replicates,
        generators=options.generators,
        cube=options.cube,
        blocked=options.blocked,
    )


@checked
def ccd(
    space: Space,
    *,
    star: Star = "circumscribed",
    alpha: Alpha = "rotatable",
    center: int = 3,
    center_axial: int = 0,
    star_replicates: int = 1,
    generators: Sequence[str] = (),
    cube: Cube = "full",
    blocked: bool = False,
) -> Design:
    """Central composite design.

    Parameters
    ----------
    space : Space
        Two or more numeric factors; with categorical ones the design is run at all combinations of levels.
    star : {"circumscribed", "inscribed", "faced"}
        Circumscribed: the cube is on the bounds, the star points lie outside. Inscribed: the star points are
        on the bounds, the cube inside. Faced: both on the bounds.
    alpha : float or {"rotatable", "orthogonal", "spherical", "uncorrelated"}
        Star distance when the cube is at +-1; see :func:`star_distance`. Not used when faced.
    center, center_axial : int
        Centre points run with the cube, and with the star.
    star_replicates : int
        How often each star point is run; the rules for `alpha` allow for it.
    generators : sequence of str
        For a fractional cube: ``"E=ABCD"`` halves the cube of five factors. With resolution five it tells
        all two-factor interactions apart; with less only if no two of them are aliased (no word of four
        letters), and main effects lean on the star alone (Hartley 1959, Biometrics 15(4), 611-624).
    cube : {"full", "fraction", "small"}
        Without generators: all corners, the smallest standard fraction of them with resolution five, or
        Hartley's small fraction, whose words are products of two factors and a third.
    blocked : bool
        Number the runs of the cube block 1 and those of the star block 2; with ``alpha="orthogonal"`` the
        blocks do not disturb the estimates.

    Returns
    -------
    Design
        Kinds factorial, center, axial, center, in this order.

    Raises
    ------
    RsmkitError
        For fewer than two numeric factors, an unknown word, an impossible star distance or a fraction that
        aliases two-factor interactions.
    """
    generators = tuple(generators)
    k = int(space.numeric.sum())
    if k < 2:
        raise RsmkitError(f"a central composite design needs at least two numeric factors, got {k}")
    if cube != "full" and not generators:
        generators = _smallest_fraction(k) if cube == "fraction" else _hartley(k)
    if 2 ** (k - len(generators)) > LARGEST_CUBE:
        raise RsmkitError(
            f"the cube of {k} factors has {2 ** (k - len(generators))} runs: take a fraction of it (cube = "
            "'fraction' up to 15 factors, or generators), or use an optimal design"
        )
    core = fraction(k, generators)
    if any(len(word.lstrip("-")) == 4 for word in core.words):
        raise RsmkitError(
            f"the fraction {', '.join(core.generators)} has resolution 4 or a word of four letters: "
            "two-factor interactions are the same there, and a star does not part them; take one of "
            "resolution five"
        )
    if star_replicates < 1:
        raise RsmkitError(
            f"central composite design: star_replicates must be 1 or more, got {star_replicates}"
        )
    corners, tips = core.coded, np.tile(pydoe.star(k), (star_replicates, 1))
    runs = len(corners), center, center_axial
    distance = 1.0 if star == "faced" else star_distance(k, *runs, alpha, star_replicates=star_replicates)
    scale = 1.0 / distance if star == "inscribed" else 1.0
    coded = scale * np.vstack([corners, np.zeros((center, k)), distance * tips, np.zeros((center_axial, k))])
    kinds = (
        ["factorial"] * len(corners) + ["center"] * center + ["axial"] * len(tips) + ["center"] * center_axial
    )
    design = classical(space, coded, kinds, "a central composite design")
    if not blocked:
        return design
    return replace(
        design,
        blocks=tuple(
            np.resize([1] * (len(corners) + center) + [2] * (len(tips) + center_axial), len(design)).tolist()
        ),
    )


def _smallest_fraction(k: int) -> tuple[str, ...]:
    """Generators of the smallest standard fraction with resolution five; none when there is none."""
    for generated in sorted((p for factors, p in STANDARD if factors == k), reverse=True):
        generators = tuple(STANDARD[k, generated].split())
        if fraction(k, generators).resolution >= 5:
            return generators
    return ()


def _hartley(k: int) -> tuple[str, ...]:
    """Generators of the smallest fraction of words of three letters; resolution five where it is as small."""
    generated = max(p for p in range(k) if 2 * p <= k - p)
    best = _smallest_fraction(k)
    if k < 3 or len(best) >= generated:
        return best
    basic = k - generated
    pairs = (LETTERS[2 * i : 2 * i + 2] for i in range(generated))
    return tuple(f"{LETTERS[basic + i]}={pair}" for i, pair in enumerate(pairs))


def star_distance(
    k: int, cube: int, center: int, center_axial: int, alpha: Alpha, *, star_replicates: int = 1
) -> float:
    """Distance of the star points from the centre, with the cube at +-1.

    Parameters
    ----------
    k : int
        Number of factors.
    cube : int
        Runs of the cube, F.
    center, center_axial : int
        Centre points with the cube, n_c, and with the star, n_a.
    alpha : float or str
        ``rotatable``: (F / r)^(1/4), equal precision at equal distance from the centre. ``orthogonal``:
        sqrt(k (1 + n_a / 2kr) / (1 + n_c / F)), cube and star can be run as blocks that do not disturb the
        coefficients. ``spherical``: sqrt(k), all points but the centre on one sphere. ``uncorrelated``:
        sqrt((sqrt(F N) - F) / 2r) with N runs in all, the estimates of the squares are uncorrelated.
        A number is taken as it is.
    star_replicates : int
        How often each star point is run, r.

    Notes
    -----
    Box & Hunter (1957), Ann. Math. Statist. 28, 195-241; Myers, Montgomery & Anderson-Cook, Response Surface
    Methodology, section 8.
    """
    if isinstance(alpha, str):
        star = 2 * k * star_replicates
        runs = cube + star + center + center_axial
        rules = {
            "rotatable": math.sqrt(math.sqrt(cube / star_replicates)),
            "orthogonal": math.sqrt(k * (1 + center_axial / star) / (1 + center / cube)),
            "spherical": math.sqrt(k),
            "uncorrelated": math.sqrt((math.sqrt(cube * runs) - cube) / (2 * star_replicates)),
        }
        return rules[alpha]
    if not alpha > 0:
        raise RsmkitError(f"central composite design: alpha must be positive, got {alpha:g}")
    return float(alpha)
