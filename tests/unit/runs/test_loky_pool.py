"""What is asked of loky beyond its public names."""

from types import SimpleNamespace

import pytest

from rsmkit.errors import RsmkitError
from rsmkit.runs.backends.loky_pool import LokyPool, workers_of


@pytest.mark.parametrize("executor", [SimpleNamespace(), SimpleNamespace(_processes=None)])
def test_a_loky_that_hides_its_workers_is_one_message(executor):
    with pytest.raises(RsmkitError, match=r"loky [\d.]+ does not show .*: pip install 'loky>=3\.7,<3\.8'"):
        workers_of(executor)


def test_every_new_pool_looks(monkeypatch):
    def hidden(*arguments, **options):
        return SimpleNamespace()

    monkeypatch.setattr("loky.ProcessPoolExecutor", hidden)
    with pytest.raises(RsmkitError, match="does not show its worker processes"):
        LokyPool(1)


@pytest.mark.parametrize(
    ("codes", "cause"),
    [
        ("The exit codes of the workers are {SIGSEGV(-11)}", "SIGSEGV"),
        ("The exit codes of the workers are {EXIT(3)}", "exit code 3"),
        ("The exit codes of the workers are {EXIT(1), SIGKILL(-9)}", "SIGKILL"),
        ("A task has failed to un-serialize.", "unknown cause"),
    ],
)
def test_the_cause_of_a_death_is_read_from_what_loky_says(codes, cause):
    pool = LokyPool(1)
    try:
        assert pool.death_cause(RuntimeError(codes)) == cause
    finally:
        pool.close(kill=False)
