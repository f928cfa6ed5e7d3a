"""The layout's rules: who may import whom, how large a module may be, what must be documented."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
MODULES = sorted([*(ROOT / "rsmkit").rglob("*.py"), *(ROOT / "sim").rglob("*.py")])
# rsmkit's packages in the order in which data flows through them; imports point backwards only
ORDER = ["design", "runs", "surfaces", "optimum", "verification", "report"]
FOUNDATION = {"space", "expression", "errors", "options", "terms", "tables", "files"}


def imports(path):
    """Every module that `path` imports, relative imports resolved, with the line."""
    package = list(path.relative_to(ROOT).with_suffix("").parts[:-1])
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            stem = ".".join([*base, *([node.module] if node.module else [])])
            yield stem
            yield from (f"{stem}.{alias.name}" for alias in node.names)


@pytest.mark.parametrize("path", MODULES, ids=lambda p: str(p.relative_to(ROOT)))
def test_imports_point_one_way(path):
    parts = path.relative_to(ROOT).with_suffix("").parts
    for name in imports(path):
        target = name.split(".")
        if target[0] not in ("rsmkit", "sim"):
            continue
        assert target[0] == parts[0], f"{path} imports {name}: rsmkit and sim must not know each other"
        if parts[0] == "sim" or len(target) < 2:
            continue
        here, there = parts[1], target[1]
        if here in FOUNDATION:
            assert there in FOUNDATION, f"{path} imports {name}: the foundation imports only itself"
        elif here in ORDER and there not in FOUNDATION:
            assert there in ORDER, f"{path} imports {name}: only the command line knows the stages"
            assert ORDER.index(there) <= ORDER.index(here), f"{path} imports {name}: against the flow of data"


@pytest.mark.parametrize("path", MODULES, ids=lambda p: str(p.relative_to(ROOT)))
def test_modules_are_short_and_say_what_they_are(path):
    text = path.read_text()
    assert text.count("\n") <= 500
    assert ast.get_docstring(ast.parse(text)), f"{path} does not say what it is"


def test_help_is_cheap():
    code = (
        "import sys; from rsmkit.cli import main\n"
        "try: main(['--help'])\n"
        "except SystemExit: pass\n"
        "heavy = {'numpy', 'scipy', 'pandas', 'joblib', 'matplotlib', 'rich', 'numba'} & set(sys.modules)\n"
        "assert not heavy, heavy"
    )
    subprocess.run([sys.executable, "-c", code], check=True, capture_output=True)
