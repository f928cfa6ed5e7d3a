"""Simulators that behave, misbehave and die; found by name beside the test data."""

import os
import signal
import socket
import subprocess
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path

import numpy as np


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


def gated(a, b, *, log, gate, free=0.0):
    """Like `logged`, but from a = `free` on it is finished only once the file `gate` is there."""
    _note(log, f"start {a!r} {b!r}")
    while a >= free and not Path(gate).exists():
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


def seeded(a, b, *, seed):
    return {"y": float(seed)}


def columns(a, b, *, log, bad=-1.0, seed=0):
    """Vectorised: arrays in, arrays out; fails for every array that holds `bad`, returns nan above 0.9."""
    _note(log, f"call {len(a)}")
    if (a == bad).any():
        raise ValueError("bad point")
    return {"y": np.where(a > 0.9, np.nan, a + 2.0 * b), "seed": seed + 0 * a}


def columns_alone(a, b):
    """Vectorised, as it claims, but only for arrays of length 1."""
    return {"y": np.array([float(a.item() + b.item())])}


def columns_normalised(a, b):
    """Vectorised, but what it returns depends on what else is in the batch."""
    return {"y": a / a.max() + b}


def columns_in_order(a, b):
    """Vectorised, but what it returns depends on the place in the batch."""
    return {"y": a + b + 0.0 * np.arange(len(a)) + (np.arange(len(a)) > 0)}


def remembering(a, b, *, before=[]):  # noqa: B006
    """Depends on the run before it."""
    before.append(a)
    return {"y": a + b + (before[-2] if len(before) > 1 else 0.0)}


def timed(a, b):
    """Takes a tenth of a second by a clock that nobody can set."""
    time.sleep(0.1)
    return {"y": a}


def scalar_for_arrays(a, b):
    return {"y": 1.0}


def flaky(a, b, *, log, successes_from):
    """Fails until it has been tried often enough."""
    _note(log, "start")
    tries = Path(log).read_text().count("start")
    if tries < successes_from:
        raise OSError("licence server busy")
    return {"y": float(tries)}


def hoarding(a, b, *, log, hoard=[]):  # noqa: B006
    """Never lets go of its memory."""
    hoard.append(b"x" * 150_000_000)
    _note(log, f"{os.getpid()}")
    time.sleep(0.4)
    return {"y": a}


def where(a, b):
    return {"y": 1.0, "folder": os.getcwd()}


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


def _interrupt():
    raise KeyboardInterrupt


def _vandalise():
    """Close what others use, wander off, and fail."""
    os.chdir("/")
    sys.stdout.close()
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    raise ValueError("left a mess")


def _signals_itself():
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        os.kill(os.getpid(), number)
    time.sleep(0.05)
    return {"y": 1.0}


def _wants_signals():
    """Take signals for itself, which the run before may have done too."""
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGTSTP)
    for number in numbers:
        os.kill(os.getpid(), number)
    for number in numbers:
        signal.signal(number, signal.SIG_DFL)
    return {"y": 1.0, "pid": os.getpid()}


def _forks():
    """Come back twice, from this process and from a copy of it."""
    pid = os.fork()
    return {"y": float(os.waitpid(pid, 0)[1])} if pid else {"y": 2.0}


class _Broken:
    """What stands in the place of a stream."""

    closed = False

    def flush(self):
        raise KeyboardInterrupt

    write = flush


def _breaks_streams():
    sys.stdout = sys.stderr = _Broken()
    raise ValueError("cannot speak")


def _sabotage():
    """Make rsmkit stumble over the outcome of this run."""
    from rsmkit.runs.one_run import execute

    sendable = execute._sendable

    def fail(outcome):
        execute._sendable = sendable
        raise OSError("no name")

    execute._sendable = fail
    return {"y": 1.0}


def _floods():
    """Print 20 MB, and return as much."""
    for _ in range(20):
        print("x" * 1_000_000)
    return {"y": 1.0, "log": "x" * 20_000_000, "table": list(range(1_000_000)), "array": np.zeros(10**6)}


def _leaves_children():
    """Leave a child, a daemon and a copy of this process behind, for longer than any test takes."""
    child = subprocess.Popen(["sleep", "600"])
    daemon = subprocess.Popen(["sleep", "600"], start_new_session=True)
    copy = os.fork()
    if copy == 0:
        time.sleep(600)
        os._exit(0)
    return {"y": 1.0, "left": [child.pid, daemon.pid, copy]}


def _spawns():
    """Use processes of its own, started afresh."""
    import multiprocessing

    with multiprocessing.get_context("spawn").Pool(1) as pool:
        return {"y": float(pool.apply(abs, (-1,)))}


def _patches():
    import builtins
    import json

    builtins.print = json.dumps = None
    time.perf_counter = time.monotonic = socket.gethostname = object
    os.pread = os.ftruncate = json.JSONEncoder.encode = signal.setitimer = None
    sys.path.clear()
    return {"y": 1.0}


def _never_ends():
    """Leave what keeps a process from ending: a thread, and something to do at exit."""
    import atexit

    atexit.register(time.sleep, 60)
    threading.Thread(target=time.sleep, args=(60,)).start()
    return {"y": 1.0, "pid": os.getpid()}


def _swallow():
    while True:
        with suppress(BaseException):
            time.sleep(0.1)


class _OddError(Exception):
    def __init__(self, one, two):
        super().__init__(one)
        self.kept = threading.Lock()


def _odd_error():
    raise _OddError("cannot be pickled", 2)


class _Treacherous:
    def __str__(self):
        raise RuntimeError("never")

    __repr__ = __float__ = __str__


def _nested(depth, bottom):
    inner = bottom
    for level in range(depth):
        inner = {"a": inner} if level % 2 else [inner]
    return {"y": 1.0, "inner": inner}


class _Text(str):
    """Looks like a text, and is none that can be sent."""

    def __reduce__(self):
        raise RuntimeError("stays here")


def _stopped():
    os.kill(os.getpid(), signal.SIGSTOP)


def _floods_the_disk():
    """Print 200 MB, half of it past Python, and fail."""
    for _ in range(50):
        print("x" * 2_000_000, flush=True)
        os.write(1, b"y" * 2_000_000)
        time.sleep(0.01)
    taken = os.fstat(1).st_blocks * 512
    time.sleep(0.5)
    raise ValueError(f"{taken > 100_000_000} {os.fstat(1).st_blocks * 512 < 10_000_000}")


_TROUBLES = {
    "floods_the_disk": _floods_the_disk,
    "spawns": _spawns,
    "wants_signals": _wants_signals,
    "forks": _forks,
    "breaks_streams": _breaks_streams,
    "sabotage": _sabotage,
    "half_character": lambda: {"y": 1.0, "\ud800": "\ud800"},
    "signals_itself": _signals_itself,
    "floods": _floods,
    "leaves_children": _leaves_children,
    "patches": _patches,
    "never_ends": _never_ends,
    "swallow": _swallow,
    "odd_error": _odd_error,
    "treacherous": lambda: {"y": 1.0, "extra": _Treacherous()},
    "nested": lambda: _nested(5000, 1.0),
    "nested_less": lambda: _nested(400, 1.0),
    "wide": lambda: {"y": 1.0, **{f"n{i}": {"a": [float(i)] * 3} for i in range(100_000)}},
    "long_texts": lambda: {"y": 1.0, **{f"t{i}": "x" * 9999 for i in range(3000)}},
    "odd_text": lambda: {"y": 1.0, "text": _Text("mine")},
    "stopped": _stopped,
    "base": lambda: (_ for _ in ()).throw(BaseException("mine")),
    "bool": lambda: {"y": True},
    "list": lambda: {"y": [1.0]},
    "inner_dict": lambda: {"y": {"y": 1.0}},
    "lone_surrogate": lambda: {"y": 1.0, "text": "\ud800\x1b"},
    "any_keys": lambda: {1: 2.0, None: 3.0, "y": 1.0, f"k{time.perf_counter()}": 4.0},
    "array": lambda: {"y": np.array(1.5), "z": np.float32(2.0)},
    "vandalise": _vandalise,
    "interrupt": _interrupt,
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
