"""From the ``[design]`` table of a study file to the design: the plan stage calls this."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from rsmkit.design.design import Design
from rsmkit.design.families.registry import family_of
from rsmkit.design.families.site import Site, allowed, needed_runs
from rsmkit.design.families.space_filling import fill
from rsmkit.design.optimal.optimal_design import optimal_design
from rsmkit.design.options import DesignOptions
from rsmkit.design.region import Margin, Region, ball, box, candidate_list
from rsmkit.errors import RsmkitError
from rsmkit.io.files.regular_files import inside
from rsmkit.io.tables.csv_tables import read_matrix
from rsmkit.language.space import Floats, Space
from rsmkit.language.space_terms import space_terms
from rsmkit.language.terms import Terms

__all__ = ["build_design", "grow", "region_of_interest"]

MIN_DISTANCE = 0.2
"""Distance that keeps the points of a design for a deterministic simulator apart, coded.

A tenth of the range of a factor: close enough to cost a correct quadratic only a tenth of its D-efficiency,
wide enough that the added points see what the quadratic misses.
"""


def build_design(
    space: Space,
    options: DesignOptions,
    *,
    order: int = 2,
    terms: Terms | None = None,
    constraints: Sequence[Margin] = (),
    folder: Path | str = ".",
    hard: Sequence[str] = (),
) -> Design:
    """Make the starting design and augment it.

    Parameters
    ----------
    space : Space
    options : DesignOptions
    order : int
        Order of the model that optimal points are chosen for.
    terms : Terms, optional
        The model itself, instead of all terms of that order.
    constraints : sequence of callable
        Margins: natural points, shape (n, k), to shape (n,); where any is negative no point is placed. Points
        of a starting design that break one are left out; a space-filling design goes on until it has its
        number of runs.
    folder : path
        Folder of the study, where its own files and modules are.
    hard : sequence of str
        Factors that are hard to change: they keep one setting in every whole plot.

    Raises
    ------
    RsmkitError
        When the options contradict each other or the constraints leave no room.
    """
    site = Site(Path(folder), constraints)
    if space.equalities:
        _refuse_off_the_flat(space, options)
    if hard:
        from rsmkit.design.families.whole_plots import design_in_plots

        model = space_terms(space, order) if terms is None else terms
        return design_in_plots(space, options, site, model, hard, _region)
    if options.whole_plots is not None:
        raise RsmkitError(
            "design.whole_plots: no factor has change = 'hard'; give it to the factor that keeps its setting "
            "in a plot, or leave whole_plots out"
        )
    start = allowed(family_of(options.kind).make(space, options, site), constraints)
    if not len(start) and not options.searched:
        raise RsmkitError(f"design: the starting design of kind '{options.kind}' has no points")
    total = options.augment_to or (needed_runs(options) if options.searched else len(start))
    if total < len(start):
        raise RsmkitError(
            f"design.augment_to: the starting design has {len(start)} runs already, {total} in all were "
            "asked for"
        )
    if total == len(start):
        return start
    region = _region(start, options, site)
    return grow(
        start, total, options, region=region, terms=order if terms is None else terms, folder=site.folder
    )


def _refuse_off_the_flat(space: Space, options: DesignOptions) -> None:
    """Refuse what cannot hold points on a mixture or another equality.

    Raises
    ------
    RsmkitError
        Saying what can.
    """
    sum_ = space.equalities[0].text
    if not family_of(options.kind).mixes:
        raise RsmkitError(
            f"design.kind: '{options.kind}' varies every factor on its own and cannot keep '{sum_}'; take "
            "'simplex-lattice', 'simplex-centroid', 'extreme-vertices', 'optimal', 'sobol' or 'maximin'"
        )


def grow(
    start: Design,
    total: int,
    options: DesignOptions,
    *,
    region: Region,
    terms: Terms | int,
    folder: Path,
    spread: bool = False,
) -> Design:
    """Add points to a design as the options say, until it has `total`.

    Parameters
    ----------
    start : Design
        Kept as it is, first.
    total : int
    options : DesignOptions
    region : Region
        Where new points may lie.
    terms : Terms or int
        The model that optimal points are chosen for, or its order.
    folder : path
        Folder of the study.
    spread : bool
        Spread the points whatever the options say.

    Raises
    ------
    RsmkitError
        When the options contradict each other or the region leaves no room.
    """
    if spread or options.spreads or options.criterion == "maximin":
        return fill(start, total, region=region, seed=options.seed)
    blocks = _blocks(start, total, options)
    random = bool(options.block_variance or options.covariance or (options.random and blocks))
    design = optimal_design(
        start.space,
        total,
        given=replace(start, blocks=()) if random else start,
        terms=terms,
        criterion=options.criterion,
        region=region,
        min_distance=_min_distance(options, region),
        blocks=None if random else blocks,
        covariance=_covariance(blocks, options, folder),
        starts=options.starts,
        seed=options.seed,
    )
    if not blocks:
        return design
    ratio = options.block_variance or (1.0 if options.random else None)
    return replace(design, blocks=blocks, block_ratio=None if options.covariance else ratio)


def region_of_interest(
    space: Space,
    options: DesignOptions,
    constraints: Sequence[Margin] = (),
    folder: Path | str = ".",
    *,
    stars: Design | None = None,
) -> Region:
    """Where predictions are wanted: what a design made from the options is judged by.

    With `stars`, a design, where points may be added to it: beyond the bounds where the options allow that.
    """
    start = Design(space, np.empty((0, len(space))), ()) if stars is None else stars
    return _region(start, options, Site(Path(folder), constraints))


def _region(design: Design, options: DesignOptions, site: Site) -> Region:
    if options.candidates:
        table = Design.from_csv(inside(site.folder, options.candidates, "design.candidates"), design.space)
        return candidate_list(design.space, table.points, site.constraints)
    if options.region == "ball":
        return ball(design.space, options.radius, site.constraints)
    reach = 1.0
    if options.region == "stars" and len(design):
        reach = max(1.0, float(np.abs(design.coded[:, design.space.numeric]).max()))
    return box(design.space, reach, site.constraints)


def _blocks(start: Design, total: int, options: DesignOptions) -> tuple[int, ...] | None:
    """Block of every run; runs added to a blocked design are a block of their own."""
    if options.blocks:
        if sum(options.blocks) != total:
            raise RsmkitError(
                f"design.blocks: {' + '.join(map(str, options.blocks))} = {sum(options.blocks)} runs, the "
                f"design has {total}"
            )
        return tuple(np.repeat(np.arange(len(options.blocks)) + 1, options.blocks).tolist())
    if start.blocks:
        return start.blocks + (max(start.blocks) + 1,) * (total - len(start))
    return None


def _covariance(blocks: tuple[int, ...] | None, options: DesignOptions, folder: Path) -> Floats | None:
    if options.covariance:
        path = inside(folder, options.covariance, "design.covariance")
        try:
            return read_matrix(path)
        except RsmkitError as error:
            raise RsmkitError(f"design.covariance: not a table of numbers ({error})") from None
    ratio = options.block_variance or (1.0 if options.random and blocks else None)
    if ratio is None:
        return None
    if blocks is None:
        raise RsmkitError("design.block_variance: name the blocks too, as in blocks = [4, 4, 4]")
    same = np.equal.outer(blocks, blocks)
    return np.asarray(np.eye(len(blocks)) + ratio * same)


def _min_distance(options: DesignOptions, region: Region) -> float:
    if options.min_distance is not None:
        return options.min_distance
    if options.replicates:
        return 0.0
    widths = [MIN_DISTANCE]
    if region.flat:
        tied = [group for group in region.groups if len(group.polytope.rhs)]
        widths += [0.1 * float(np.linalg.norm(np.ptp(group.corners, axis=0))) for group in tied]
    return min(widths)
