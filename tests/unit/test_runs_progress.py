"""Counting, and estimating the time left."""

import pytest

from rsmkit.runs.progress import Progress, remaining_seconds


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
    assert progress.own_fraction == 1.0
    assert progress.ended == 0
