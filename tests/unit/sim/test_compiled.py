"""Machine code cache: survives processes, changes with the sources, works from a read-only package."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow  # every test starts fresh processes

PACKAGE = Path(__file__).parents[3] / "sim"


def run(code, root, **environment):
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        cwd=root,
        env={**os.environ, "PYTHONPATH": str(root), **environment},
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


@pytest.fixture
def copy(tmp_path):
    """A small package with the helper, a function and a function that calls it from another file."""
    package = tmp_path / "sim"
    package.mkdir()
    (package / "__init__.py").touch()
    shutil.copy(PACKAGE / "compiled.py", package)
    (package / "inner.py").write_text(
        "from sim.core.compiled import compiled\n\n\n@compiled\ndef inner(x):\n    return 2.0 * x\n"
    )
    (package / "outer.py").write_text(
        "from sim.core.compiled import compiled\nfrom sim.inner import inner\n\n\n"
        "@compiled\ndef outer(x):\n    return inner(x) + 1.0\n"
    )
    return tmp_path


CALL = "from sim.outer import outer; print(outer(3.0), sum(outer.stats.cache_hits.values()))"


def test_second_process_loads_and_an_edited_callee_is_compiled_afresh(copy):
    assert run(CALL, copy) == "7.0 0"
    assert run(CALL, copy) == "7.0 1"
    inner = copy / "sim" / "inner.py"
    inner.write_text(inner.read_text().replace("2.0", "3.0"))
    assert run(CALL, copy) == "10.0 0"


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
