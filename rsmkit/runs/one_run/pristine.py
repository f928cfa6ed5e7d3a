"""Modules of Python as they were before any simulator was loaded.

A simulator may replace any function of them, on purpose or by way of a library (frozen clocks, mocks). What
the record of a run and a worker's own life depend on is taken from here. Names in a namespace, and not in a
module, are also out of reach for libraries that look through all modules.
"""

from __future__ import annotations

import os as _os
import signal as _signal
import socket as _socket
import time as _time
from types import SimpleNamespace
from typing import Any

__all__ = ["HOST", "os", "signal", "time"]

os: Any = SimpleNamespace(**vars(_os))
signal: Any = SimpleNamespace(**vars(_signal))
time: Any = SimpleNamespace(**vars(_time))
HOST = _socket.gethostname()
"""Name of this computer."""
