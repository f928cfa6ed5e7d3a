"""Simulators that behave, misbehave and die; found by name beside the test data."""

import os
import signal
import sys
import threading
import time
from pathlib import Path


def plane(a, b, *, slope=1.0):
    return {"y": slope * (a + 2.0 * b), "product": a * b, "note": "fine"}


def logged(a, b, *, log, seconds=0.0):
    """Leaves one line for every time it is started and finished."""
    _note(log, f"start {a!r} {b!r}")
    end = time.perf_counter() + seconds
    while time.perf_counter() < end:
        time.sleep(0.005)
    _note(log, f"end {a!r} {b!r}")
    return {"y": a + b}


def moody(a, b, *, trouble, log=""):
    """Behaves below a = 0.5, and gets into trouble above it."""
    if log:
        _note(log, f"start {a!r}")
    if a < 0.5:
        time.sleep(0.02)
        return {"y": a}
    return _TROUBLES[trouble]()


def noisy(a, b, *, seed=0):
    return {"y": a + time.perf_counter_ns() % 1000}


def loud(a, b):
    print("this goes to standard output")
    os.write(2, b"and this to standard error\n")
    raise ValueError("after speaking")


def reads(a, b):
    return {"y": float(input("a number please: "))}


def threads(a, b):
    return {"y": float(os.environ["OMP_NUM_THREADS"]), "blas": os.environ["OPENBLAS_NUM_THREADS"]}


def stateful(a, b):
    return {"y": float(os.getpid())}


not_callable = 3


def _note(log, text):
    with open(log, "a") as file:
        file.write(text + "\n")


def _raise():
    raise ValueError("step size\nunderflow")


def _bad_str():
    class OddError(Exception):
        def __str__(self):
            raise RuntimeError

    raise OddError


def _deep():
    return _deep()


def _out_of_memory():
    import resource

    resource.setrlimit(resource.RLIMIT_AS, (2 << 30, 2 << 30))
    return {"y": float(len(bytearray(8 << 30)))}


def _hang():
    while True:
        time.sleep(0.01)


def _hang_on():
    """Stay in compiled code that lets neither signals nor threads have a turn."""
    return {"y": float(sum(range(10**13)))}


def _segfault():
    os.kill(os.getpid(), signal.SIGSEGV)


def _killed():
    os.kill(os.getpid(), signal.SIGKILL)


def _thread_dies():
    threading.Thread(target=lambda: 1 / 0).start()
    time.sleep(0.05)
    return {"y": 1.0}


class _Unpicklable:
    def __str__(self):
        return "an open file"

    def __reduce__(self):
        raise TypeError("never")


_TROUBLES = {
    "raise": _raise,
    "bad_str": _bad_str,
    "recursion": _deep,
    "exit": lambda: sys.exit("goodbye"),
    "os_exit": lambda: os._exit(3),
    "memory": _out_of_memory,
    "hang": _hang,
    "hang_on": _hang_on,
    "segfault": _segfault,
    "killed": _killed,
    "nan": lambda: {"y": float("nan")},
    "inf": lambda: {"y": float("-inf")},
    "text": lambda: {"y": "12.5"},
    "none": lambda: None,
    "missing": lambda: {"z": 1.0},
    "complex": lambda: {"y": 1 + 2j},
    "huge": lambda: {"y": 10**400},
    "unpicklable": lambda: {"y": _Unpicklable()},
    "thread": _thread_dies,
    "path": lambda: {"y": Path("somewhere")},
}
