"""From the ``[design]`` table of a study file to the design: the plan stage calls this."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from rsmkit.design.design import Design
from rsmkit.design.families.box_behnken import box_behnken
from rsmkit.design.families.composite import ccd
from rsmkit.design.families.factorial import fractional_factorial, full_factorial
from rsmkit.design.families.screening import definitive_screening, plackett_burman
from rsmkit.design.families.space_filling import fill, halton, latin_hypercube, sobol
from rsmkit.design.optimal.optimal_design import optimal_design
from rsmkit.design.options import KINDS, DesignOptions
from rsmkit.design.region import MOST_DRAWS, Margin, Region, ball, box, candidate_list
from rsmkit.errors import RsmkitError
from rsmkit.language.space import Floats, Space
from rsmkit.language.terms import Terms

__all__ = ["build_design", "region_of_interest"]

MIN_DISTANCE = 0.2
"""Distance that keeps the points of a design for a deterministic simulator apart, coded.

A tenth of the range of a factor: close enough to cost a correct quadratic only a tenth of its D-efficiency,
wide enough that the added points see what the quadratic misses.
"""
FILLING = ("latin-hypercube", "sobol", "halton")


def build_design(
    space: Space,
    options: DesignOptions,
    *,
    order: int = 2,
    terms: Terms | None = None,
    constraints: Sequence[Margin] = (),
    folder: Path | str = ".",
    workers: int = 1,
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
    workers : int
        Threads of the search; the design does not depend on it.

    Raises
    ------
    RsmkitError
        When the options contradict each other or the constraints leave no room.
    """
    folder = Path(folder)
    if options.kind in ("optimal", "maximin"):
        start = Design(space, np.empty((0, len(space))), ())
        total = options.augment_to or _runs(options)
    else:
        start = _allowed_start(space, options, constraints, folder)
        total = options.augment_to or len(start)
    if total < len(start):
        raise RsmkitError(
            f"design.augment_to: the starting design has {len(start)} runs already, {total} in all were "
            "asked for"
        )
    if total == len(start):
        return start
    region = _region(start, options, constraints, folder)
    if options.criterion == "maximin" or options.kind == "maximin":
        return fill(start, total, region=region, seed=options.seed)
    blocks = _blocks(start, total, options)
    random = bool(options.block_variance or options.covariance)
    design = optimal_design(
        space,
        total,
        given=replace(start, blocks=()) if random else start,
        terms=order if terms is None else terms,
        criterion=options.criterion,
        region=region,
        min_distance=_min_distance(options),
        blocks=None if random else blocks,
        covariance=_covariance(blocks, options, folder),
        starts=options.starts,
        seed=options.seed,
        workers=workers,
    )
    return replace(design, blocks=blocks) if blocks else design


def _start(space: Space, options: DesignOptions, folder: Path) -> Design:
    center, seed = options.center, options.seed
    numeric_center = center if space.numeric.all() else 0
    families: dict[str, Callable[[], Design]] = {
        "ccd": lambda: ccd(
            space,
            star=options.star,
            alpha=options.alpha,
            center=center,
            center_axial=options.center_axial,
            generators=options.generators,
            cube=options.cube,
            blocked=options.blocked,
        ),
        "box-behnken": lambda: box_behnken(space, center=center, blocked=options.blocked),
        "factorial": lambda: full_factorial(
            space, options.levels, reduction=options.reduction, center=numeric_center
        ),
        "fractional-factorial": lambda: fractional_factorial(
            space, options.generators or None, runs=options.runs, center=numeric_center
        ),
        "plackett-burman": lambda: plackett_burman(space, runs=options.runs, center=numeric_center),
        "definitive-screening": lambda: definitive_screening(space, runs=options.runs, center=center),
        "latin-hypercube": lambda: latin_hypercube(space, _runs(options), spread=options.spread, seed=seed),
        "sobol": lambda: sobol(space, _runs(options), seed=seed),
        "halton": lambda: halton(space, _runs(options), seed=seed),
        "file": lambda: Design.from_csv(folder / _file(options), space),
    }
    if options.kind in families:
        return families[options.kind]()
    if ":" in options.kind:
        return _own(space, options, folder)
    raise RsmkitError(f"design.kind: '{options.kind}' is not known; use one of {', '.join(KINDS)}")


def _own(space: Space, options: DesignOptions, folder: Path) -> Design:
    """Points of the user's function ``module:function(space, runs, rng)``, natural units."""
    module, _, name = options.kind.partition(":")
    sys.path.insert(0, str(folder))
    try:
        points = getattr(importlib.import_module(module), name)(
            space, options.runs, np.random.default_rng(options.seed)
        )
    except (ImportError, AttributeError) as error:
        raise RsmkitError(f"design.kind: '{options.kind}' cannot be loaded ({error})") from None
    finally:
        sys.path.remove(str(folder))
    points = np.asarray(points, float)
    return Design(space, points, ("given",) * len(points))


def _runs(options: DesignOptions) -> int:
    if options.runs is None:
        raise RsmkitError(f"design.runs is missing: a design of kind '{options.kind}' takes a number of runs")
    return options.runs


def _file(options: DesignOptions) -> str:
    if not options.file:
        raise RsmkitError("design.file is missing: name the CSV table of your own points")
    return options.file


def _allowed_start(
    space: Space, options: DesignOptions, constraints: Sequence[Margin], folder: Path
) -> Design:
    """The starting design without the points that a constraint forbids."""
    design = _allowed(_start(space, options, folder), constraints)
    if options.kind not in FILLING or len(design) == _runs(options):
        return design
    if options.kind == "latin-hypercube":
        return fill(design, _runs(options), region=box(space, 1.0, constraints), seed=options.seed)
    more = options
    while len(design) < _runs(options):
        more = replace(more, runs=2 * _runs(more))
        if _runs(more) > MOST_DRAWS:
            raise RsmkitError(
                f"design: only {len(design)} of the first {_runs(more) // 2} {options.kind} points satisfy "
                "the constraints (subject_to); widen them or shrink the factor ranges around them"
            )
        design = _allowed(_start(space, more, folder), constraints)
    return design.select(list(range(_runs(options))))


def _allowed(design: Design, constraints: Sequence[Margin]) -> Design:
    keep = np.ones(len(design), bool)
    for constraint in constraints:
        keep &= np.asarray(constraint(design.points)) >= -1e-9
    if not keep.any():
        raise RsmkitError("design: no point of the starting design satisfies the constraints (subject_to)")
    return design if keep.all() else design.select(np.flatnonzero(keep).tolist())


def region_of_interest(
    space: Space, options: DesignOptions, constraints: Sequence[Margin] = (), folder: Path | str = "."
) -> Region:
    """Where predictions are wanted: what a design made from the options is judged by."""
    return _region(Design(space, np.empty((0, len(space))), ()), options, constraints, Path(folder))


def _region(design: Design, options: DesignOptions, constraints: Sequence[Margin], folder: Path) -> Region:
    if options.candidates:
        table = Design.from_csv(folder / options.candidates, design.space)
        return candidate_list(design.space, table.points, constraints)
    if options.region == "ball":
        return ball(design.space, options.radius, constraints)
    reach = 1.0
    if options.region == "stars" and len(design):
        reach = max(1.0, float(np.abs(design.coded[:, design.space.numeric]).max()))
    return box(design.space, reach, constraints)


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
        path = folder / options.covariance
        try:
            return np.loadtxt(path, delimiter=",", ndmin=2)
        except (OSError, ValueError) as error:
            raise RsmkitError(f"design.covariance: {path} is not a table of numbers ({error})") from None
    if options.block_variance is None:
        return None
    if blocks is None:
        raise RsmkitError("design.block_variance: name the blocks too, as in blocks = [4, 4, 4]")
    same = np.equal.outer(blocks, blocks)
    return np.asarray(np.eye(len(blocks)) + options.block_variance * same)


def _min_distance(options: DesignOptions) -> float:
    if options.min_distance is not None:
        return options.min_distance
    return 0.0 if options.replicates else MIN_DISTANCE
