"""Progress where nobody watches: a line a minute and every failure, not a line for every run."""

from types import SimpleNamespace

from rsmkit.cli import progress_bar
from rsmkit.cli.session import Session


def test_a_log_gets_a_line_a_minute(monkeypatch, capsys):
    now = [0.0]
    monkeypatch.setattr(progress_bar.time, "monotonic", lambda: now[0])
    with progress_bar.progress(Session(as_json=False, quiet=False, color=False)) as watch:
        for ended in range(1, 401):
            now[0] += 1.0
            run = SimpleNamespace(
                done=ended != 130,
                status="done" if ended != 130 else "failed",
                seconds=1.0,
                factors={},
                error="",
            )
            watch(SimpleNamespace(kind="finished", run=run, progress=SimpleNamespace(ended=ended, todo=400)))
    told = [line.split()[0] for line in capsys.readouterr().err.splitlines()]
    # the first, one each 60 s since the last that was told (the failure is one), and the end
    assert told == [
        "1/400",
        "61/400",
        "121/400",
        "130/400",
        "190/400",
        "250/400",
        "310/400",
        "370/400",
        "400/400",
    ]


def test_many_small_batches_are_counted_as_one(capsys):
    run = SimpleNamespace(done=True, status="done", seconds=1.0, factors={}, error="")
    with progress_bar.progress(Session(as_json=False, quiet=False, color=False)) as watch:
        for _ in range(50):
            state = SimpleNamespace(ended=0, todo=3)
            watch(SimpleNamespace(kind="planned", run=None, progress=state))
            for ended in (1, 2, 3):
                state.ended = ended
                watch(SimpleNamespace(kind="finished", run=run, progress=state))
    assert [line.split()[0] for line in capsys.readouterr().err.splitlines()] == ["1/3", "150/150"]


def test_long_free_work_says_that_it_goes_on(monkeypatch, capsys):
    monkeypatch.setattr(progress_bar, "TELL_EVERY_S", 0.01)
    told = ""
    with progress_bar.working(Session(as_json=False, quiet=False, color=False), "fitting"):
        while "so far" not in told:
            told += capsys.readouterr().err
    assert told.startswith(" fitting: ")


def test_it_says_which_step_goes_on(monkeypatch, capsys):
    monkeypatch.setattr(progress_bar, "TELL_EVERY_S", 0.01)
    told = ""
    with progress_bar.working(Session(as_json=False, quiet=False, color=False), "fitting") as on_step:
        on_step("fitting sag_mm (2 of 3)")
        while " fitting sag_mm (2 of 3): " not in told:
            told += capsys.readouterr().err
    assert told.endswith("so far\n")
