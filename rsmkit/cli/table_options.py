"""Options of ``fit`` for a table of finished experiments."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from rsmkit.cli.decorators import Names, Rows, joined

__all__ = ["table_options"]

OPTIONS = [
    click.option(
        "--data",
        type=click.Path(path_type=Path),
        metavar="FILE",
        help="Fit a table (.csv, .xlsx) instead of a study.",
    ),
    click.option(
        "--sheet", metavar="NAME", help="With --data: sheet of a workbook; needed where several fit."
    ),
    click.option("--factors", type=Names(), default="", help="With --data: factor columns, such as x1,x2."),
    click.option(
        "--response", type=Names(), default="", help="With --data: response columns, such as y1,y2."
    ),
    click.option(
        "--coding", default="", metavar="x1=85:5,...", help="With --data: centre and half range of factors."
    ),
    click.option(
        "--columns",
        type=click.Choice(["natural", "coded"]),
        help="With --data: what numeric factor columns hold; judged by their values otherwise.",
    ),
    click.option(
        "--mixture",
        type=Names(),
        default="",
        help="With --data: components that add up to a constant, as a,b,c.",
    ),
    click.option(
        "--model",
        type=click.Choice(["scheffe-linear", "scheffe-quadratic", "scheffe-special-cubic", "scheffe-cubic"]),
        help="With --mixture: how components blend; by --order otherwise.",
    ),
    click.option(
        "--process",
        type=click.Choice(["combined", "main", "crossed"]),
        default="combined",
        help="With --mixture: how other factors join: by total degree, each, or all their products.",
    ),
    click.option(
        "--categorical",
        type=Names(),
        multiple=True,
        callback=joined,
        help="With --data: factors whose numbers are names (may be repeated).",
    ),
    click.option(
        "--contrasts",
        type=click.Choice(["treatment", "sum"]),
        default="treatment",
        help="With --data: categories against the first one, or against the average (sum).",
    ),
    click.option("--blocks", metavar="COLUMN", help="With --data: the block of each run."),
    click.option("--weights", metavar="COLUMN", help="With --data: weights, inverse to the variance."),
    click.option(
        "--random",
        type=Names(),
        multiple=True,
        callback=joined,
        help="With --data: groups of runs that are a sample, such as plots or days (may be repeated).",
    ),
    click.option(
        "--degrees",
        type=click.Choice(["kenward-roger", "kenward-roger-observed", "satterthwaite"]),
        default="kenward-roger",
        help="With --random: how degrees of freedom are found.",
    ),
    click.option(
        "--distribution",
        type=click.Choice(["binomial", "poisson"]),
        help="With --data: responses are counts of successes among trials, or of events.",
    ),
    click.option("--trials", metavar="COLUMN", help="With --distribution binomial: trials of each run."),
    click.option("--exposure", metavar="COLUMN", help="With --distribution poisson: area, time of each run."),
    click.option(
        "--bias-reduced", is_flag=True, help="With --distribution: Firth's estimates, always finite."
    ),
    click.option(
        "--order", type=click.IntRange(1, 20), default=2, help="With --data: degree of the surface."
    ),
    click.option(
        "--terms", type=Names(), default="", help="With --data: FO, TWI, PQ, terms as x1^2; 0: no constant."
    ),
    click.option(
        "--exact-terms",
        is_flag=True,
        help="With --terms: these and the constant alone, not what they contain.",
    ),
    click.option(
        "--means", type=Names(), default="", help="With --data: compare the means of factors' levels."
    ),
    click.option(
        "--compare",
        multiple=True,
        metavar="'tool: A=1, B=-1'",
        help="With --data: a contrast of means (may be repeated).",
    ),
    click.option(
        "--near-replicates",
        type=float,
        metavar="SHARE",
        help="With --data: runs this near, as a share of the ranges, are repeated.",
    ),
    click.option(
        "--robust",
        type=click.Choice(["huber", "mm"]),
        help="With --data: robust estimates beside those of least squares.",
    ),
    click.option(
        "--together", type=Names(), default="", help="With --data: terms or groups to test all at once."
    ),
    click.option(
        "--reduction",
        type=click.Choice(["aicc", "aic", "bic", "backward", "forward", "all"]),
        help="With --data: leave terms out, by a criterion or by tests.",
    ),
    click.option(
        "--exclude", type=Rows(), metavar="ROWS", help="With --data: rows to leave out, such as 3,7-9."
    ),
    click.option("--details", is_flag=True, help="With --data: leave nothing out of long texts."),
    click.option(
        "--report",
        "document",
        type=click.Path(path_type=Path),
        metavar="FILE",
        help="With --data: write a report to hand in (.html, .docx, .pdf, .xlsx).",
    ),
    click.option(
        "--page",
        type=click.Path(path_type=Path),
        metavar="FILE",
        help="With --data: write the explorer page (.html): profiles, contours, residuals.",
    ),
]


def table_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add them all, in their order."""
    for option in reversed(OPTIONS):
        command = option(command)
    return command
