"""``python -m rsmkit``: the command line."""

from rsmkit.cli import main

main(prog_name="rsmkit")
