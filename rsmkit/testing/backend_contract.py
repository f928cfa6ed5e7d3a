"""The contract of an evaluation backend: what an evaluation relies on, wherever its runs are made."""

from __future__ import annotations

import signal
from collections import Counter
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from dataclasses import dataclass, fields
from pathlib import Path
from tempfile import TemporaryDirectory
from time import monotonic, sleep
from typing import Any

import numpy as np

from rsmkit.errors import RsmkitError
from rsmkit.language.space import Space
from rsmkit.runs.agenda import make_task
from rsmkit.runs.backends.options import BackendOptions
from rsmkit.runs.backends.pool import BatchCut, Pool
from rsmkit.runs.backends.registry import BACKENDS, backend_options
from rsmkit.runs.evaluation import evaluate_points
from rsmkit.runs.how_to_run import HowToRun
from rsmkit.runs.one_run.execute import Outcome
from rsmkit.runs.one_run.interrupts import Interrupted
from rsmkit.runs.one_run.simulator import Simulator, SimulatorError
from rsmkit.runs.options import SimulatorOptions
from rsmkit.runs.record.journal import Journal
from rsmkit.runs.record.run_progress import RunEvent, Watcher
from rsmkit.runs.record.run_table import Runs

__all__ = ["check_backend"]

SPACE = Space(a=(0.0, 1.0), b=(0.0, 1.0))
GOOD = ((0.0, 0.0), (0.25, 0.5), (0.375, 0.25), (0.125, 1.0), (0.25, 0.5))
"""Points that cause no trouble; the last repeats the second."""
MIXED = ((0.125, 0.0), (0.75, 0.0), (0.25, 0.0), (0.375, 0.0))
"""Of these the second may cause some."""
LIMIT_S = 3.0
"""Time limit of runs that hang; the others need no time, but the computer may be busy."""
LONG_S = 300.0
"""Duration of runs that nobody is to wait for: a pool that does is seen by the end they note."""


@dataclass(frozen=True)
class Bench:
    """A backend at work on the troubled simulator, in a folder of its own."""

    how: HowToRun
    folder: Path
    lasting: bool = False

    def simulator(self, timeout_s: float | None = None, **settings: Any) -> Simulator:
        """The troubled simulator, which notes in a file what it does."""
        settings["log"] = str(self.folder / "log")
        options = SimulatorOptions(run="troubled_simulator:moody", timeout_s=timeout_s, settings=settings)
        return Simulator(options, Path(__file__).parent)

    def evaluate(self, simulator: Simulator, points: object, watch: Watcher | None = None) -> Runs:
        """Make the runs that are missing."""
        x = np.array(points, float)
        return evaluate_points(simulator, x, SPACE, self.journal, self.how, responses=["y"], on_event=watch)

    @property
    def journal(self) -> Journal:
        """Where they are recorded."""
        return Journal(self.folder / "runs.jsonl")

    @property
    def lines(self) -> int:
        """Runs recorded, each as often as it was."""
        path = self.journal.path
        return len(path.read_text().splitlines()) if path.exists() else 0

    @property
    def ended(self) -> Counter[str]:
        """How often each run came to an end, by the simulator's own account."""
        log = self.folder / "log"
        lines = log.read_text().splitlines() if log.exists() else []
        return Counter(line for line in lines if line.startswith("end"))


def check_backend(
    word: str,
    options: Mapping[str, Any] | None = None,
    *,
    folder: str | Path | None = None,
    processes: bool = True,
    lasting: bool = False,
) -> None:
    """Assert that a backend keeps the contract of the register.

    Every run is made once and its result comes back in its place; a run that fails or takes too long is
    recorded as such and the others are made; asked to stop, the evaluation finishes what is under way, and
    the same call goes on from there. A simulator that cannot be loaded ends the evaluation with one message.
    Where workers are `processes`, one that dies or cannot be interrupted costs the run that did it and no
    other, and asked to stop twice, the evaluation comes back at once.

    Call it in the main thread, which alone receives signals: Ctrl-C is sent to this process.

    Parameters
    ----------
    word : str
        The word of its row in :data:`rsmkit.runs.backends.registry.BACKENDS`.
    options : mapping, optional
        What it must know.
    folder : path, optional
        An empty folder that its workers can see under the same path; a temporary one of this computer by
        default.
    processes : bool
        Whether its workers are processes other than this one.
    lasting : bool
        Whether what was handed over goes on without the evaluation, which then need not wait for it when it
        is asked to stop.

    Raises
    ------
    AssertionError
        Saying which part of the contract is broken.
    """
    _check_options(word, options or {})
    checks: list[Callable[[Bench], None]] = [
        _check_results,
        _check_failures,
        _check_time_limit,
        _check_refusal,
        _check_interrupt,
        _check_pool,
    ]
    if processes:
        checks += [_check_deaths, _check_deep_hang, _check_second_interrupt, _check_kill]
    with TemporaryDirectory() as temporary:
        for check in checks:
            place = Path(folder or temporary) / check.__name__.strip("_")
            place.mkdir()
            check(Bench(HowToRun(2, word, options or {}), place, lasting))


def _check_options(word: str, options: Mapping[str, Any]) -> None:
    """Frozen, documented, fit to become flags, and sound."""
    row = BACKENDS[word]
    assert row.word == word, f"the row of {word} calls itself {row.word}"
    assert row.where, f"{word} does not say where that is"
    kind = row.options
    assert issubclass(kind, BackendOptions), f"{kind.__name__} is no class of options"
    parameters: Any = vars(kind)["__dataclass_params__"]
    assert parameters.frozen, f"{kind.__name__} is not frozen"
    for item in fields(kind):
        assert item.metadata.get("doc"), f"{item.name} has no line in the reference"
        assert item.metadata.get("metavar"), f"{item.name} has no word for its value"
        assert isinstance(item.default, str | int | float), f"{item.name} cannot be a flag"
    found = backend_options(word, **options).problems()
    assert found == [], f"the options are refused: {found}"


def _check_results(bench: Bench) -> None:
    runs = bench.evaluate(bench.simulator(), GOOD)
    expected = [a + 2.0 * b for a, b in GOOD]
    assert runs.y("y").tolist() == expected, f"results in another order: {runs.y('y')} for {expected}"
    bench.evaluate(bench.simulator(), GOOD[::-1])
    assert set(bench.ended.values()) == {1}, f"runs were made more than once: {bench.ended}"
    assert len(bench.ended) == bench.lines == 4, f"{len(bench.ended)} runs made, {bench.lines} recorded"


def _check_failures(bench: Bench) -> None:
    runs = bench.evaluate(bench.simulator(trouble="fail"), MIXED)
    _assert_statuses(runs, "failed", "a run that failed")
    error = runs.failures()[0].error
    assert error == "ValueError: step size underflow", f"the reason of a failure is lost: {error}"


def _check_time_limit(bench: Bench) -> None:
    runs = bench.evaluate(bench.simulator(timeout_s=LIMIT_S, trouble="hang"), MIXED)
    _assert_statuses(runs, "timeout", "a run that took too long")


def _check_refusal(bench: Bench) -> None:
    try:
        bench.evaluate(Simulator(SimulatorOptions(run="no_such_module:f"), bench.folder), GOOD)
    except SimulatorError:
        assert bench.lines == 0, "a simulator that cannot be loaded is recorded as runs that failed"
    else:
        raise AssertionError("a simulator that cannot be loaded is no error")


def _check_interrupt(bench: Bench) -> None:
    """Asked to stop once, it finishes what is under way; asked to go on, it makes the rest."""
    points = [(i / 16, 0.0) for i in range(8)]
    simulator = bench.simulator(seconds=0.3)
    started = _interrupted(bench, simulator, points, after=1)
    assert bench.lasting or 1 <= bench.lines == started < len(points), (
        f"interrupted with {started} runs under way, of which {bench.lines} were recorded"
    )
    runs = bench.evaluate(simulator, points)
    assert runs.done.all(), "an interrupted evaluation does not go on"
    assert set(bench.ended.values()) == {1}, f"after an interruption runs are made again: {bench.ended}"


def _check_second_interrupt(bench: Bench) -> None:
    points = [(i / 16, 0.0) for i in range(8)]
    _interrupted(bench, bench.simulator(seconds=LONG_S), points, after=2)
    assert not bench.ended, "interrupted twice, it waited for a run"
    assert bench.lines == 0, "a run that was given up is recorded"


def _interrupted(bench: Bench, simulator: Simulator, points: object, *, after: int) -> int:
    """Send as many interrupts as `after`, once so many runs have been started; give the number started."""
    started: list[str] = []

    def watch(event: RunEvent) -> None:
        if event.kind == "started":
            started.append(event.key)
            if len(started) == after:
                for _ in range(after):
                    signal.raise_signal(signal.SIGINT)

    try:
        bench.evaluate(simulator, points, watch)
    except Interrupted:
        return len(started)
    raise AssertionError("an interruption goes unheard")


def _check_deaths(bench: Bench) -> None:
    runs = bench.evaluate(bench.simulator(trouble="die"), MIXED)
    _assert_statuses(runs, "crashed", "a run that ended its process")
    assert bench.lines == len(MIXED), f"{bench.lines} lines in the journal for {len(MIXED)} runs"


def _check_deep_hang(bench: Bench) -> None:
    runs = bench.evaluate(bench.simulator(timeout_s=LIMIT_S, trouble="hang deep"), MIXED)
    _assert_statuses(runs, "timeout", "a run that hangs in compiled code")


def _check_pool(bench: Bench) -> None:
    """What a pool finishes when it is let go, and that it can be asked everything meanwhile."""
    simulator = bench.simulator(seconds=0.3)
    pool = bench.how.pool_maker(simulator, 1)(1)
    assert pool.jobs == 1, f"a pool of {pool.jobs} instead of 1"
    tasks = [make_task(simulator, {"a": a, "b": 0.0}) for a in (0.25, 0.125)]
    future = pool.submit(simulator, tasks, ("y",))
    pool.check()
    assert pool.patience_s >= 0.0, "negative patience"
    assert isinstance(pool.output(), str), "what was printed is not a text"
    assert isinstance(pool.age_s(future), float), "the age of a batch is not a number"
    outcomes = _awaited(pool, simulator, future)
    keys = [outcome.run.key for outcome in outcomes]
    assert keys == [task.key for task in tasks], "a batch comes back in another order"
    pool.close(kill=False)


def _check_kill(bench: Bench) -> None:
    """A batch that is abandoned and a pool that is closed do not hold up anybody."""
    simulator = bench.simulator(seconds=LONG_S)
    pool = bench.how.pool_maker(simulator, 1)(1)
    future = pool.submit(simulator, [make_task(simulator, {"a": 0.25, "b": 0.0})], ("y",))
    while not (bench.folder / "log").exists() and not future.done():
        pool.check()
        sleep(0.05)
    quick = bench.simulator()
    if pool.abandon(future):
        task = make_task(quick, {"a": 0.125, "b": 0.0})
        (outcome,) = _awaited(pool, quick, pool.submit(quick, [task], ("y",)))
        assert outcome.run.done, "after a batch was abandoned the pool is of no use"
    pool.close(kill=True)
    assert f"end {0.25!r}" not in bench.ended, "a pool that is to end at once waits for its run"
    pool = bench.how.pool_maker(quick, 1)(1)
    try:
        task = make_task(quick, {"a": 0.375, "b": 0.0})
        assert _awaited(pool, quick, pool.submit(quick, [task], ("y",)))[0].run.done, "no pool after another"
    except RsmkitError as error:
        raise AssertionError(f"no pool can be made after another was killed: {error}") from None
    finally:
        pool.close(kill=False)


def _awaited(pool: Pool, simulator: Simulator, future: Future[list[Outcome]]) -> list[Outcome]:
    """Wait as an evaluation does."""
    before: list[Outcome] = []
    begin = monotonic()
    while True:
        pool.check()
        assert monotonic() - begin < LONG_S, "a batch does not come back"
        if not future.done():
            sleep(0.05)
            continue
        error = future.exception()
        if not isinstance(error, BatchCut):
            return before + future.result()
        before += error.outcomes
        future = pool.submit(simulator, error.again, ("y",))


def _assert_statuses(runs: Runs, status: str, what: str) -> None:
    found = [run.status if run else "missing" for run in runs.runs]
    expected = [status if a >= 0.5 else "done" for a, _ in MIXED]
    assert found == expected, f"{what}, among others: {found} instead of {expected}"
