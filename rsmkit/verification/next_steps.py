"""The one thing to do next about a search: terminal, page and report all have it from here."""

from __future__ import annotations

from rsmkit.verification.verification import Confirmation

__all__ = ["MORE_RUNS", "NOTHING", "next_step"]

NOTHING = "nothing is left to run"
"""What is said where the next step is empty."""
MORE_RUNS = "more runs ([design]), or model = 'auto' ([surface])"
"""What makes surfaces better where people make the runs."""
_MORE = "allow more runs: max_runs in [verify.refine]"
_REFINED = {
    "SETTLED": "",
    "NOT SETTLED": f"use the best known design, or {_MORE}",
    "INFEASIBLE": f"widen what is acceptable, or {_MORE}",
}


def next_step(search: Confirmation | None, refined: str = "", *, by_hand: bool = False) -> str:
    """Say it in words; empty where nothing is left.

    Parameters
    ----------
    search : Confirmation or None
        Its verification, None where there is none yet.
    refined : str
        The verdict of the refinement that followed, if one did.
    by_hand : bool
        Whether people make the runs.
    """
    if refined:
        return _REFINED[refined]
    if search is None:
        made = "rsmkit sheet FILE.csv, then rsmkit record FILE.csv, then " if by_hand else ""
        return f"runs at the predicted optimum have yet to confirm it: {made}rsmkit verify"
    if search.next_step or search.verdict == "CONFIRMED":
        return search.next_step
    # files of the first versions say nothing
    return MORE_RUNS if by_hand else "rsmkit verify --refine looks for better with true runs"
