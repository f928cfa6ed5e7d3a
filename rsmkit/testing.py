"""Checks that other people's simulators can put into their own tests."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from rsmkit.runs.evaluate import check_once
from rsmkit.runs.options import SimulatorOptions
from rsmkit.runs.run import Run, Value
from rsmkit.runs.simulator import Simulator

__all__ = ["check_simulator"]


def check_simulator(
    simulator: str | SimulatorOptions,
    factors: Mapping[str, Value],
    *,
    responses: Sequence[str] = (),
    folder: str | Path = ".",
) -> Run:
    """Assert that a simulator keeps the contract: keywords in, finite numbers out, the same again.

    The simulator is run at one point in a fresh process, as a study would run it, and, if it is said to be
    deterministic, once more in another one.

    Parameters
    ----------
    simulator : str or SimulatorOptions
        ``'module:function'``, or the whole table a study would have.
    factors : mapping
        One point, by factor name.
    responses : sequence of str
        Numbers it must return; by default all finite numbers it does return.
    folder : path
        Where its module or its files are, if they are not installed.

    Returns
    -------
    Run
        The run that was made.

    Raises
    ------
    AssertionError
        Saying which part of the contract is broken.
    SimulatorError
        If it cannot be loaded at all.
    """
    options = SimulatorOptions(run=simulator) if isinstance(simulator, str) else simulator
    problems = [f"{key} {text}" for key, text in options.problems()]
    assert not problems, f"not a simulator: {'; '.join(problems)}"
    made = Simulator(options, Path(folder))
    first = check_once(made, factors, responses=responses)
    assert first.run.done, f"the run {first.run.status}: {first.run.error}\n{first.traceback}{first.output}"
    assert first.run.responses, "the run returned no number"
    if options.deterministic:
        second = check_once(made, factors, responses=responses).run
        assert second.responses == first.run.responses, (
            f"not deterministic: {dict(first.run.responses)} the first time, {dict(second.responses)} the "
            "second; say deterministic = false, or fix its seed"
        )
    return first.run
