"""What people see of the laws of service."""

from __future__ import annotations

from rich.markup import escape
from rich.table import Table

from rsmkit.cli.session import Session
from rsmkit.runs.how_to_run import HowToRun
from rsmkit.runs.record.run_progress import Watcher
from rsmkit.stages.service.screen import ScreenResult
from rsmkit.study.folder import StudyFolder
from rsmkit.variation.findings_of_laws import OutOfSpecification, ResponseUncertainty, Uncertainty

__all__ = ["carry_laws", "prove_laws", "screening"]


def carry_laws(session: Session, folder: StudyFolder, *, force: bool) -> bool:
    """Carry the laws through the surfaces and show what they do; say whether anything was found anew."""
    if not folder.study.file.uncertainty:
        return False
    from rsmkit.stages.service.propagate import propagate_study

    result = propagate_study(folder, force=force)
    if result is None:
        session.people.print(
            "[bold]Service[/]  no factor has a law, and surfaces know nothing of settings"
            + (": rsmkit verify --uncertainty N asks the simulator" if folder.study.file.simulator else "")
        )
        return False
    session.document["uncertainty"] = result.overview()
    state = "  [dim](up to date)[/]" if result.fresh else ""
    session.people.print(
        f"[bold]Service[/]  {len(result.found.laws)} laws about {_place(result.found)}{state}"
    )
    _responses(session, result.found)
    for note in result.found.notes:
        session.people.print(f"  [yellow]note:[/] {escape(note)}")
    return not result.fresh


def prove_laws(
    session: Session, folder: StudyFolder, runs: int, how: HowToRun, on_event: Watcher | None
) -> int:
    """Run the simulator under the laws, show what that says, and give the exit code."""
    from rsmkit.stages.service.prove import prove_study

    result = prove_study(folder, runs, how, on_event=on_event)
    session.document["uncertainty"] = result.overview()
    found, true = result.found, result.found.true or {}
    session.people.print(
        f"[bold]Service, proven[/]  {true['runs']} runs under the laws about {_place(found)}"
    )
    table = Table(box=None, pad_edge=False, header_style="dim")
    for column in ("response", "", "promised", "true", "interval", "gain"):
        table.add_column(column, justify="left" if column in ("response", "") else "right")
    for name, own in found.responses.items():
        promised = {"mean": own.mean, "sd": own.sd, "out_of_specification": own.out_of_specification}
        for key, value in promised.items():
            if own.true and value is not None and key in own.true:
                low, high = own.true[f"{_short(key)}_low"], own.true[f"{_short(key)}_high"]
                gain = own.true[f"{_short(key)}_gain"]
                cells = (f"{value:.5g}", f"{own.true[key]:.5g}", f"{low:.5g} .. {high:.5g}", f"{gain:.3g}")
                table.add_row(escape(name) if key == "mean" else "", key.replace("_", " "), *cells)
    session.people.print(table)
    session.people.print("  gain: how many times more plain runs would say as much", markup=False)
    color = {"CONFIRMED": "green", "NOT CONFIRMED": "red"}.get(true["verdict"], "yellow")
    session.people.print(f"  [bold {color}]{true['verdict']}[/]: {escape(true['sentence'])}")
    return result.exit_code


def screening(session: Session, result: ScreenResult) -> None:
    """Show how much each factor matters to each response."""
    session.people.print(f"[bold]Screen[/]  {result.runs} runs; effects over the whole range of each factor")
    for response, effects in result.effects.items():
        table = Table(box=None, pad_edge=False, header_style="dim")
        for column in (escape(response), "mean size", "error", "mean", "sd"):
            table.add_column(column, justify="left" if column == escape(response) else "right")
        for name, own in sorted(effects.items(), key=lambda item: -item[1].mean_size):
            cells = (f"{value:.4g}" for value in (own.mean_size, own.error, own.mean, own.sd))
            table.add_row(escape(name), *cells)
        session.people.print(table)
    session.people.print("  a large sd beside the mean size: the factor bends or interacts", markup=False)
    session.people.print(f"  File: {result.path}", markup=False)


def _short(key: str) -> str:
    return "out" if key == "out_of_specification" else key


def _place(found: Uncertainty) -> str:
    values = (f"{k} = {v:.6g}" if isinstance(v, float) else f"{k} = {v}" for k, v in found.at.items())
    return escape(f"{found.name}: {', '.join(values)}")


def _responses(session: Session, found: Uncertainty) -> None:
    table = Table(box=None, pad_edge=False, header_style="dim")
    for column in ("response", "mean", "sd", "outside", "interval", "Cpk", "mostly from"):
        table.add_column(column, justify="left" if column in ("response", "mostly from") else "right")
    for name, own in found.responses.items():
        table.add_row(escape(name), f"{own.mean:.6g}", f"{own.sd:.4g}", *_conformance(own), _causes(own))
    session.people.print(table)
    specified = [name for name, own in found.responses.items() if own.specification]
    if found.out_of_specification and len(specified) > 1:
        session.people.print(f"  any specification not kept: {_fraction(found.out_of_specification)}")
    for name in specified:
        own = found.responses[name]
        worst = min(own.causes, key=lambda factor: own.causes[factor].sd_without)
        cause = own.causes[worst]
        session.people.print(
            f"  {name}: without the variation of {worst} its sd would be {cause.sd_without:.4g} "
            f"instead of {own.sd:.4g}",
            markup=False,
        )
    for text in found.design_space.sentences if found.design_space else ():
        session.people.print(f"  {text}", markup=False)


def _conformance(own: ResponseUncertainty) -> tuple[str, str, str]:
    if own.out_of_specification is None or own.out_low is None or own.out_high is None:
        return "-", "-", "-"
    cpk = "-" if own.cpk is None else f"{own.cpk:.3g}"
    interval = f"{100 * own.out_low:.3g} .. {100 * own.out_high:.3g} %"
    return f"{100 * own.out_of_specification:.3g} %", interval, cpk


def _causes(own: ResponseUncertainty) -> str:
    ranked = sorted(own.sobol, key=lambda factor: -own.sobol[factor].total)[:2]
    return escape(", ".join(f"{name} {100 * own.sobol[name].total:.3g} %" for name in ranked))


def _fraction(found: OutOfSpecification) -> str:
    low, high = 100 * found.low, 100 * found.high
    return f"{100 * found.fraction:.3g} % ({low:.3g} to {high:.3g} %)"
