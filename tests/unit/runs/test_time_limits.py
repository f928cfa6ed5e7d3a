"""A limit on time leaves no trace when it is over."""

import signal
import time

import pytest

from rsmkit.runs.one_run.time_limits import TimeLimit, time_limit


@pytest.fixture
def heard():
    """What arrives at the handler that was there before."""
    found = []
    before = signal.signal(signal.SIGALRM, lambda number, frame: found.append(number))
    yield found
    signal.signal(signal.SIGALRM, before)


@pytest.mark.parametrize("seconds", [60.0, 0.05])
def test_the_handler_and_the_timer_are_those_of_before(heard, seconds):
    before = signal.getsignal(signal.SIGALRM)
    try:
        with time_limit(seconds):
            if seconds < 1.0:
                time.sleep(10.0)
    except TimeLimit:
        assert seconds < 1.0
    assert signal.getsignal(signal.SIGALRM) is before
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)
    signal.raise_signal(signal.SIGALRM)
    assert heard == [signal.SIGALRM]
