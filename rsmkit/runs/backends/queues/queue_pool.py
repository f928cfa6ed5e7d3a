"""Runs as array jobs of a batch system, on the disk at every step: a driver may die and the next goes on.

Batches that are handed over together become one array. What its tasks write is read as it comes; how they
fare is asked now and then. Jobs that an earlier driver has left are taken up, never submitted twice: a run
that is asked for and lies in one of them is waited for there.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from time import monotonic

from rsmkit.errors import RsmkitError
from rsmkit.io.files.atomic_files import write_text
from rsmkit.runs.backends.options import QueueOptions
from rsmkit.runs.backends.pool import BatchCut, Pool
from rsmkit.runs.backends.queues.array_jobs import Slice, WaveFolder, open_waves, write_wave
from rsmkit.runs.backends.queues.job_script import job_script, read_template
from rsmkit.runs.backends.queues.job_times import PastRuns
from rsmkit.runs.backends.queues.systems import BatchSystem, JobState, SilentError
from rsmkit.runs.one_run.execute import Outcome, Task, given_up
from rsmkit.runs.one_run.simulator import Simulator, SimulatorError
from rsmkit.runs.record.run import Run, Status

__all__ = ["QueuePool", "meeting_place"]

LOOK_S = 1.0
ASK_S = 10.0
LAG_S = 20.0
"""A file that a node has written may be seen so much later on another."""
LARGEST_ARRAY = 1000
"""Slurm's own limit unless its administrator has set another."""
MOST_LOSSES = 3
"""Of a job under one and the same run, which is then to blame, or under runs that none began."""

Id = tuple[str, int]


def meeting_place(options: QueueOptions, simulator: Simulator) -> Path:
    """Where the folders of array jobs lie."""
    return Path(options.job_folder or simulator.folder / "runs" / "queue").resolve()


class QueuePool(Pool):
    """Array jobs of a batch system.

    Parameters
    ----------
    system : BatchSystem
    options : QueueOptions
    simulator : Simulator
    jobs : int
        Tasks of arrays that wait or run at the same time.
    """

    shares = True
    patience_s = math.inf  # each job keeps the time limits of its runs itself

    def __init__(self, system: BatchSystem, options: QueueOptions, simulator: Simulator, jobs: int) -> None:
        self.jobs = jobs
        self._system, self._options, self._simulator = system, options, simulator
        self._home = meeting_place(options, simulator)
        self._slices: list[Slice] = []
        self._results: dict[Id, Outcome | None] = {}  # None: to be made again
        self._asked_for: dict[Future[list[Outcome]], dict[Id, Task]] = {}
        self._fresh: list[tuple[tuple[str, ...], list[Task]]] = []
        self._delivered: set[Id] = set()
        self._losses: Counter[str] = Counter()
        self._past, self._overtimes = PastRuns(), Counter[str]()
        self._template = read_template(options, simulator.folder)
        self._states: dict[tuple[str, int], JobState] = {}
        self._looked = self._asked = -math.inf
        for wave in open_waves(self._home, simulator):
            self._take_up(wave)

    def _take_up(self, wave: WaveFolder) -> None:
        """Go on with what an earlier driver has left."""
        slices = [Slice.of(wave, index + 1) for index in range(len(wave.form.slices))]
        for part in slices:
            self._read(part, heed=False)
        alive = wave.form.system == self._system.word and not wave.stopped
        if alive and not wave.job:
            # It died between submitting and noting the number; or before submitting.
            job = self._system.find(wave.name)
            if job:
                wave.note_job(job)
            alive = bool(job)
        for part in slices:
            if not alive or part.file.error:
                for run in part.left:
                    del part.tasks[run]
                part.left.clear()
        self._slices += slices

    def submit(
        self, simulator: Simulator, tasks: Sequence[Task], names: tuple[str, ...]
    ) -> Future[list[Outcome]]:
        """Hand over a batch: one task of the next array, less the runs that are under way already."""
        future: Future[list[Outcome]] = Future()
        wanted = {(task.key, task.attempt): task for task in tasks}
        under_way = {run for part in self._slices for run in part.left}
        new = [task for run, task in wanted.items() if run not in under_way and not self._results.get(run)]
        for task in new:
            self._results.pop((task.key, task.attempt), None)
        self._asked_for[future] = wanted
        alone = [[task] for task in new if self._losses[task.key]]  # then it is plain which is to blame
        together = [task for task in new if not self._losses[task.key]]
        self._fresh += [(names, group) for group in (*alone, together) if group]
        return future

    def check(self) -> None:
        """Submit what was handed over, read what has come, ask how the rest fares.

        Raises
        ------
        RsmkitError
            If the system refuses, or jobs end before they have begun a run.
        """
        now = monotonic()
        if self._fresh:
            self._send()
        if now - self._looked >= LOOK_S:
            self._looked = now
            for part in self._slices:
                self._read(part)
            if now - self._asked >= ASK_S:
                self._asked = now
                self._ask()
            self._settle()

    def known(self, recorded: Mapping[str, Run]) -> None:
        """Do without what an earlier driver has recorded before it died; learn how long runs take."""
        for made in recorded.values():
            self._learn(made)
        for part in self._slices:
            for run in part.tasks:
                there = recorded.get(run[0])
                if there and there.attempt >= run[1]:
                    self._delivered.add(run)
                    part.left.pop(run, None)

    def recorded(self) -> None:
        """Remove the waves of which everything is in the journal."""
        for path in {part.wave.path for part in self._slices}:
            parts = [part for part in self._slices if part.wave.path == path]
            if all(not part.left and part.tasks.keys() <= self._delivered for part in parts):
                parts[0].wave.remove()
                self._slices = [part for part in self._slices if part.wave.path != path]

    def close(self, *, kill: bool) -> None:
        """Leave the jobs to the next driver, or take them back."""
        waves = {part.wave.path: part.wave for part in self._slices if part.left}.values()
        jobs = [wave.job for wave in waves if wave.job]
        if kill and jobs:
            with suppress(RsmkitError, SilentError):
                self._system.cancel(jobs)
                for wave in waves:
                    wave.note_stopped()

    def age_s(self, future: Future[list[Outcome]]) -> float:
        """Nothing: a run that waits in a queue does not grow older."""
        return 0.0

    def _send(self) -> None:
        """Submit everything that was handed over since, as few arrays as can be."""
        fresh, self._fresh = self._fresh, []
        for first in range(0, len(fresh), LARGEST_ARRAY):
            group = fresh[first : first + LARGEST_ARRAY]
            names = group[0][0]
            slices = [tasks for _, tasks in group]
            options = replace(self._options, time=self._options.time or self._guess(slices))
            wave = write_wave(
                self._home,
                self._system.word,
                self._simulator,
                names,
                slices,
                options.cpus,
                guessed=options.time != self._options.time,
            )
            script = wave.path / "job.sh"
            write_text(script, job_script(options, self._system.index, wave.path, self._template))
            try:
                wave.note_job(self._system.submit(options, wave.name, len(slices), script))
            except SilentError as error:
                if not self._found(wave):
                    wave.remove()
                    if not any(part.left for part in self._slices):
                        raise RsmkitError(f"{self._system.word} takes no job now: {error}") from None
                    self._fresh += group  # when others have ended there may be room
                    continue
            except BaseException:
                wave.remove()
                raise
            self._slices += [Slice.of(wave, index + 1) for index in range(len(slices))]

    def _found(self, wave: WaveFolder) -> bool:
        """Whether a job was submitted though the answer was lost."""
        with suppress(SilentError):
            if job := self._system.find(wave.name):
                wave.note_job(job)
                return True
        return False

    def _learn(self, run: Run) -> None:
        if run.done and not run.by_hand:
            self._past.add(run.seconds)

    def _guess(self, slices: Sequence[Sequence[Task]]) -> str:
        """Time that each of these jobs may take, by past runs; empty where there are too few."""
        rounds = max(math.ceil(len(tasks) / self._options.cpus) for tasks in slices)
        doubled = max(self._overtimes[task.key] for tasks in slices for task in tasks)
        return self._past.job_time(rounds, self._simulator.options.timeout_s, doubled)

    def _read(self, part: Slice, *, heed: bool = True) -> None:
        for outcome in part.file.read_on():
            run = outcome.run.key, outcome.run.attempt
            if run in part.tasks and run not in self._delivered:
                self._results[run] = outcome
                self._learn(outcome.run)
                part.left.pop(run, None)
        if part.file.error and part.left and heed:
            part.wave.note_stopped()
            raise SimulatorError(part.file.error)

    def _ask(self) -> None:
        """Ask how the jobs fare, and judge what ended without giving everything back."""
        waiting = [part for part in self._slices if part.left]
        if not waiting:
            return
        try:
            self._states = self._system.states(sorted({part.wave.job for part in waiting}))
        except SilentError:
            return  # it will answer again
        for part in waiting:
            state = self._states.get((part.wave.job, part.index), JobState("done", "unknown"))
            if state.fate in ("waiting", "running"):
                part.ended_at = None
                continue
            part.ended_at = part.ended_at or monotonic()
            if monotonic() - part.ended_at < LAG_S:
                continue
            self._read(part)
            if part.left:
                self._judge(part, state)

    def _judge(self, part: Slice, state: JobState) -> None:
        """Decide about the runs of a job that ended before they did."""
        where = f"{self._system.word} job {part.wave.job}, task {part.index}"
        where += f" on {state.node}: {state.word}" if state.node else f": {state.word}"
        left, part.left = part.left, {}
        begun = [task for task in left.values() if task.key in part.file.begun]
        verdicts: dict[str, tuple[Status, str]] = {}
        if state.fate == "cancelled":
            verdicts = {task.key: ("failed", f"cancelled ({where})") for task in left.values()}
        elif not begun and state.fate != "lost":
            part.wave.note_stopped()
            said = part.wave.last_words(part.index)
            raise RsmkitError(
                f"a job ended before it began a run ({where}){f': {said}' if said else ''}. "
                f"Its folder is {part.wave.path}; nothing recorded is lost"
            )
        elif state.fate == "memory" and len(begun) == 1:
            verdicts[begun[0].key] = "crashed", f"out of memory ({where})"
        elif state.fate == "overtime" and len(begun) == 1:
            self._overtimes[begun[0].key] += part.wave.form.guessed  # then the next may take longer
            patient = part.wave.form.guessed and self._overtimes[begun[0].key] < MOST_LOSSES
            if len(left) == len(part.tasks) and not patient:  # it had all of the job's time
                verdicts[begun[0].key] = "timeout", f"the job's time was over ({where})"
        else:
            for task in begun or left.values():
                self._losses[task.key] += 1
                if self._losses[task.key] >= MOST_LOSSES:
                    verdicts[task.key] = "crashed", f"its job was lost {MOST_LOSSES} times ({where})"
        for run, task in left.items():
            if task.key not in verdicts:
                self._results[run] = None
                del part.tasks[run]
            else:
                status, text = verdicts[task.key]
                said = part.wave.last_words(part.index)
                self._results[run] = given_up(self._simulator, task, status, text, 0.0, said)

    def _settle(self) -> None:
        """Give back what has come; of a batch of which more is to come, the rest is asked for again."""
        for future, wanted in tuple(self._asked_for.items()):
            come = {run: self._results[run] for run in wanted if run in self._results}
            if not come:
                continue
            del self._asked_for[future]
            outcomes = [outcome for outcome in come.values() if outcome is not None]
            self._delivered |= {run for run, outcome in come.items() if outcome is not None}
            rest = [task for run, task in wanted.items() if come.get(run) is None]
            if rest:
                future.set_exception(BatchCut(outcomes, rest))
            else:
                future.set_result(outcomes)
