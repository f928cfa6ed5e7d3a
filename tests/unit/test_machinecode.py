"""Machine code cache: survives processes, changes with the sources, works from a read-only package, and is
filled by one process while the others wait."""

import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from machinecode.lock import FolderLock

pytestmark = pytest.mark.slow  # nearly every test starts fresh processes

ROOT = Path(__file__).parents[2]
CALL = "from sim.outer import outer; print(outer(3.0), sum(outer.stats.cache_hits.values()))"


def start(code, root, **environment):
    path = os.pathsep.join([str(root), str(ROOT)])
    return subprocess.Popen(
        [sys.executable, "-c", code],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=root,
        env={**os.environ, "PYTHONPATH": path, **environment},
    )


def end(process):
    out, err = process.communicate(timeout=120)
    assert process.returncode == 0, err
    return out.strip()


def run(code, root, **environment):
    return end(start(code, root, **environment))


@pytest.fixture
def copy(tmp_path):
    """A small package with the decorators, a function and one that calls it from another file."""
    package = tmp_path / "sim"
    (package / "core").mkdir(parents=True)
    (package / "__init__.py").touch()
    (package / "core" / "__init__.py").touch()
    shutil.copy(ROOT / "sim" / "core" / "compiled.py", package / "core")
    (package / "inner.py").write_text(
        "from sim.core.compiled import compiled\n\n\n@compiled\ndef inner(x):\n    return 2.0 * x\n"
    )
    (package / "outer.py").write_text(
        "from sim.core.compiled import compiled\nfrom sim.inner import inner\n\n\n"
        "@compiled\ndef outer(x):\n    return inner(x) + 1.0\n"
    )
    return tmp_path


def test_second_process_loads_and_an_edited_callee_is_compiled_afresh(copy):
    assert run(CALL, copy) == "7.0 0"
    assert run(CALL, copy) == "7.0 1"
    inner = copy / "sim" / "inner.py"
    inner.write_text(inner.read_text().replace("2.0", "3.0"))
    assert run(CALL, copy) == "10.0 0"


def test_of_processes_that_start_together_one_compiles(copy):
    code = (
        "from sim.outer import outer; print('ready', flush=True); input(); "
        "print(outer(3.0), sum(outer.stats.cache_misses.values()))"
    )
    processes = [start(code, copy) for _ in range(3)]
    for process in processes:
        assert process.stdout.readline() == "ready\n"
    for process in processes:
        process.stdin.write("go\n")
        process.stdin.flush()
    assert sorted(end(process) for process in processes) == ["7.0 0", "7.0 0", "7.0 1"]


HOLD = (
    "from machinecode.lock import FolderLock\nfrom sim.core.compiled import MACHINE_CODE\n"
    "with FolderLock(MACHINE_CODE.folder):\n    print('held', flush=True); input()"
)


def test_a_compiling_process_that_is_killed_holds_nobody_up(copy):
    holder, waiting = start(HOLD, copy), None
    try:
        assert holder.stdout.readline() == "held\n"
        waiting = start("print('here', flush=True)\n" + CALL, copy)
        assert waiting.stdout.readline() == "here\n"
        with pytest.raises(subprocess.TimeoutExpired):
            waiting.wait(timeout=3.0)
        holder.send_signal(signal.SIGKILL)
        assert end(waiting) == "7.0 0"
    finally:
        for process in (holder, waiting):
            if process is not None:
                process.kill()
                process.communicate()


def test_patience_with_one_that_does_not_end_is_limited(copy):
    holder = start(HOLD, copy)
    try:
        assert holder.stdout.readline() == "held\n"
        assert run("import machinecode.lock as lock; lock.PATIENCE_S = 0.2\n" + CALL, copy) == "7.0 0"
        assert holder.poll() is None
    finally:
        holder.kill()
        holder.communicate()


def test_where_there_is_no_locking_everyone_compiles_for_himself(copy):
    (copy / "sim" / "__init__.py").write_text(
        "import errno, fcntl\n"
        "def flock(handle, operation):\n    raise OSError(errno.ENOLCK, 'No locks available')\n"
        "fcntl.flock = flock\n"
    )
    assert run(CALL, copy) == "7.0 0"
    assert run(CALL, copy) == "7.0 1"


def test_a_lock_is_taken_once_and_given_back_at_last(tmp_path):
    mine = FolderLock(tmp_path)
    with mine:
        with mine:
            pass
        assert is_held(tmp_path)
    assert not is_held(tmp_path)
    with FolderLock(tmp_path / "missing"):
        pass  # a folder in which no lock can be made


def is_held(folder):
    import fcntl

    with open(folder / "lock") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
    return False


def test_a_kernel_allocates_nothing(copy):
    (copy / "sim" / "maker.py").write_text(
        "import numpy as np\nfrom sim.core.compiled import kernel\n\n\n"
        "@kernel\ndef maker(n):\n    return np.zeros(n).sum()\n"
    )
    code = "from numba.core.errors import TypingError\nfrom sim.maker import maker\n"
    code += "try:\n    maker(3)\nexcept TypingError:\n    print('refused')"
    assert run(code, copy) == "refused"


def test_cache_folder_can_be_chosen(copy, tmp_path):
    chosen = tmp_path / "elsewhere"
    assert run(CALL, copy, SIM_CACHE_DIR=str(chosen)) == "7.0 0"
    assert run(CALL, copy, SIM_CACHE_DIR=str(chosen)) == "7.0 1"
    assert list(chosen.glob("machine-code-*"))


def test_unwritable_folders_are_passed_over(copy, tmp_path):
    blocked = tmp_path / "blocked"
    blocked.touch()  # a file where a folder should be: unwritable for root, too
    (copy / "sim" / "__pycache__").touch()
    environment = {"SIM_CACHE_DIR": str(blocked), "XDG_CACHE_HOME": str(tmp_path / "cache")}
    assert run(CALL, copy, PYTHONDONTWRITEBYTECODE="1", **environment) == "7.0 0"
    assert run(CALL, copy, PYTHONDONTWRITEBYTECODE="1", **environment) == "7.0 1"
    assert list((tmp_path / "cache" / "rsmkit-sim").glob("machine-code-*"))


def test_machine_code_of_a_week_ago_is_removed(copy):
    old = copy / "sim" / "__pycache__" / "machine-code-0123456789abcdef"
    old.mkdir(parents=True)
    os.utime(old, (0, 0))
    run(CALL, copy)
    assert not old.exists()


def test_the_searches_for_designs_keep_theirs_apart():
    from rsmkit.design.machine_code import MACHINE_CODE as DESIGN
    from sim.core.compiled import MACHINE_CODE as SIM

    assert DESIGN.folder != SIM.folder
