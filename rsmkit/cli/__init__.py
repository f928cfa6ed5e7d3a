"""The command line: ``rsmkit plan | evaluate | fit | verify | run | status | check | new``.

Commands only parse options and hand over; what a stage does is in :mod:`rsmkit.stages`, what people see is in
:mod:`rsmkit.cli.show`. Nothing numerical is imported until a command needs it.
"""

from __future__ import annotations

from rsmkit.cli.commands import main

__all__ = ["main"]
