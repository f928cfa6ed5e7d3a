"""Counting, and estimating the time left."""

import pytest

from rsmkit.runs.record.run import Run
from rsmkit.runs.record.run_progress import Progress, remaining_seconds


@pytest.mark.parametrize(
    ("durations", "queued", "ages", "jobs", "expected"),
    [
        ([], 10, [], 2, None),
        ([2.0], 10, [], 2, 10.0),  # ten runs of 2 s on two workers
        ([2.0, 2.0, 50.0], 10, [], 2, 10.0),  # one slow run does not move a median
        ([2.0], 0, [0.5, 1.5], 2, 1.0),  # (1.5 + 0.5) / 2 still to go
        ([2.0], 0, [7.0], 1, 0.0),  # overdue: no negative time
        ([2.0], 4, [1.0], 1, 9.0),
    ],
)
def test_remaining_time(durations, queued, ages, jobs, expected):
    assert remaining_seconds(durations, queued, ages, jobs) == expected


def test_progress_before_anything_happened():
    progress = Progress(planned=5, distinct=3, recorded=1, todo=2, jobs=2)
    assert progress.remaining_seconds() is None
    assert progress.median_seconds is None
    assert progress.own_fraction == 0.0
    assert progress.ended == 0


def ended(key, seconds):
    return Run(key, "m:f", {}, {}, 0, "done", {"y": 1.0}, {}, seconds)


def test_what_rsmkit_itself_used(monkeypatch):
    clock = [100.0]
    monkeypatch.setattr("rsmkit.runs.record.run_progress.monotonic", lambda: clock[0])
    progress = Progress(planned=3, distinct=3, recorded=0, todo=3, jobs=2, began=100.0)
    for key, now, seconds in (("a", 102.0, 1.5), ("b", 102.0, 1.5), ("c", 112.0, 9.5)):
        clock[0] = now
        progress.end(ended(key, seconds))
    # two workers for 2 s, then one for 10 s with the last run: 14 s, of which the simulator had 12.5 s
    assert progress.own_fraction == pytest.approx(1.5 / 14.0)
    assert progress.elapsed_seconds == 12.0
