"""The command line within a test's own process."""

from inspect import signature

from click.testing import CliRunner


def runner() -> CliRunner:
    """Run commands with what they print and what they tell beside it apart, as every click from 8.2 does."""
    apart = {"mix_stderr": False} if "mix_stderr" in signature(CliRunner).parameters else {}
    return CliRunner(**apart)
