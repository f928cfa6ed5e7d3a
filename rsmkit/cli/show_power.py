"""Power of a planned design by simulation, as text."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from rich.markup import escape
from rich.table import Table

if TYPE_CHECKING:
    from rsmkit.cli.session import Session
    from rsmkit.stages.planning.simulated_power import SimulatedPower

__all__ = ["simulated_power"]


def simulated_power(session: Session, found: Mapping[str, SimulatedPower]) -> None:
    """Show how often each term was found."""
    for kind, own in found.items():
        table = Table(box=None, pad_edge=False, header_style="dim")
        for column in ("term", "coefficient", "found", "interval"):
            table.add_column(column, justify="left" if column == "term" else "right")
        for name, share in own.power.items():
            ends = f"{100 * own.low[name]:.3g} .. {100 * own.high[name]:.3g} %"
            table.add_row(escape(name), f"{own.effects[name]:.3g}", f"{100 * share:.3g} %", ends)
        session.people.print(f"  power in {own.experiments} simulated experiments, {kind}", markup=False)
        session.people.print(table)
        if own.without:
            session.people.print(f"  {own.without} experiments could not be fitted", markup=False)
