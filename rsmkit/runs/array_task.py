"""One task of an array job, on a node of a cluster: makes its runs as on any computer, and notes each.

``python -m rsmkit.runs.array_task FOLDER INDEX`` is what the job's script calls.
"""

from __future__ import annotations

import sys
from pathlib import Path

from rsmkit.errors import RsmkitError
from rsmkit.runs.backends.queues.array_jobs import read_wave
from rsmkit.runs.dispatch import Dispatcher
from rsmkit.runs.how_to_run import HowToRun
from rsmkit.runs.one_run.interrupts import Interrupts

__all__ = ["make_runs"]

EXIT_STOPPED = 143


def make_runs(folder: Path, index: int) -> int:
    """Make the runs of one task of an array that have not ended yet; give the exit code.

    Parameters
    ----------
    folder : path
        The wave's folder.
    index : int
        Of the task, from 1; one beyond the last has nothing to do.
    """
    wave = read_wave(folder)
    if index > len(wave.form.slices):
        return 0
    file = wave.task_file(index)
    made = {outcome.run.key for outcome in file.read_on()}  # the system may have put the job back
    tasks = [task for task in wave.tasks(index) if task.key not in made]
    file.open()
    try:
        make_pool = HowToRun().pool_maker(wave.simulator, max(len(tasks), 1))
        with Interrupts() as interrupts:
            dispatcher = Dispatcher(
                wave.simulator,
                wave.form.names,
                make_pool,
                make_pool(wave.form.jobs),
                urgency=lambda: 2 * interrupts.count,
                on_start=file.begin,
                on_end=file.end,
            )
            dispatcher.add(tasks)
            dispatcher.run()
            return EXIT_STOPPED if interrupts.count else 0
    except RsmkitError as error:
        file.fail(str(error))
        return error.exit_code


if __name__ == "__main__":
    sys.exit(make_runs(Path(sys.argv[1]), int(sys.argv[2])))
