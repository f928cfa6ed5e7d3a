"""A simulator that has to be warmed up, found by name beside the test data."""

import os
import time
from pathlib import Path

import simulators


def moody(a, b, *, folder, trouble="", first_s=0.0, second_s=0.0, seconds=0.0):
    """Like its namesake, after some time."""
    assert f"{os.getpid()}" in (Path(folder) / "warm").read_text().split(), "not warmed up"
    time.sleep(seconds)
    return simulators.moody(a, b, trouble=trouble)


def warm_up(*, folder, first_s=0.0, second_s=0.0, trouble="", seconds=0.0):
    """Takes its time in the first two processes; leaves a line for each that it warms, and has warmed."""
    _note(folder, "begun")
    if trouble == "cold":
        raise ValueError("no fuel")
    for name, pause in (("first", first_s), ("second", second_s)):
        try:
            (Path(folder) / name).touch(exist_ok=False)
        except FileExistsError:
            continue
        time.sleep(pause)
        break
    _note(folder, "warm")


def _note(folder, name):
    with open(Path(folder) / name, "a") as file:
        file.write(f"{os.getpid()}\n")
