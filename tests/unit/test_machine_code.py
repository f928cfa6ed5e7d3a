"""Machine code cache: survives processes, changes with the sources, works from a read-only package, and is
filled by one process while the others wait."""

import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from rsmkit.machine_code import FolderLocks

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
    for module in ("compiled.py", "machine_code.py"):
        shutil.copy(ROOT / "sim" / "core" / module, package / "core")
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
    "from sim.core.machine_code import FolderLocks\nfrom sim.core.compiled import MACHINE_CODE\n"
    "with FolderLocks(MACHINE_CODE.folder).turn(['sim.outer.outer']):\n    print('held', flush=True); input()"
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
        assert run("import sim.core.machine_code as code; code.PATIENCE_S = 0.2\n" + CALL, copy) == "7.0 0"
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


def test_a_turn_is_taken_once_and_given_back_at_last(tmp_path):
    mine, other = FolderLocks(tmp_path), FolderLocks(tmp_path)
    with mine.turn(["a", "b"]) as name:
        assert name == "a"
        with mine.turn(["c"]):
            pass
        with other.turn(["a", "b"]) as free:
            assert free == "b"
    with other.turn(["a", "b"]) as name:
        assert name == "a"
    with FolderLocks(tmp_path / "missing").turn(["a"]) as name:  # where no lock can be made
        assert name == "a"


def test_processes_share_what_is_to_be_compiled(copy):
    (copy / "sim" / "other.py").write_text(
        "from sim.core.compiled import compiled\n\n\n@compiled\ndef other(x):\n    return x - 1.0\n"
    )
    code = (
        "from sim.outer import outer\nfrom sim.other import other\n"
        "from sim.core.compiled import MACHINE_CODE\n"
        "def job(function):\n    print(function.__name__, flush=True); input(); function(3.0)\n"
        "MACHINE_CODE.share({f: (lambda f=f: job(f)) for f in (outer, other)})\n"
        "print(*(sum(f.stats.cache_misses.values()) for f in (outer, other)))"
    )
    first, second = start(code, copy), None
    try:
        assert first.stdout.readline() == "outer\n"
        second = start(code, copy)
        assert second.stdout.readline() == "other\n"
        for process in (second, first):
            process.stdin.write("go\ngo\n")
            process.stdin.flush()
        assert [end(first).splitlines()[-1], end(second).splitlines()[-1]] == ["1 0", "0 1"]
    finally:
        for process in (first, second):
            if process is not None:
                process.kill()
                process.communicate()


def test_machine_code_is_called_by_its_address(copy):
    (copy / "sim" / "far.py").write_text(
        "import numba\nfrom sim.core.machine_code import call, reference\n"
        "from sim.core.compiled import MACHINE_CODE, kernel\n\n\n"
        "@kernel\ndef body(at, place):\n    out = place[0]\n    out[0] = at[0][0] + 2.0 * at[0][1]\n\n\n"
        "@kernel\ndef caller(address, pair, out):\n    call(address, (reference(pair), reference(out)))\n"
    )
    code = (
        "import numba, numpy as np\nfrom sim.far import *\nout, pair = np.zeros(1), (1.0, 3.0)\n"
        "kinds = [numba.types.CPointer(numba.typeof(value)) for value in (pair, out)]\n"
        "caller(MACHINE_CODE.entry(body, *kinds, _nrt=False), pair, out)\n"
        "print(out[0], sum(caller.stats.cache_hits.values()), len(body.signatures))"
    )
    assert run(code, copy) == "7.0 0 0"
    assert run(code, copy) == "7.0 1 0"


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
    from rsmkit.design.compiled import MACHINE_CODE as DESIGN
    from sim.core.compiled import MACHINE_CODE as SIM

    assert DESIGN.folder != SIM.folder
