"""The rules of the house: who may import whom, how large a module may be, what must be documented."""

import ast
import subprocess
import sys
from collections import defaultdict
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
MODULES = sorted([*(ROOT / "rsmkit").rglob("*.py"), *(ROOT / "sim").rglob("*.py")])
ROOMS = ("design", "runs", "surfaces", "optimum")
"""Side by side: they never import each other."""
ALIKE = ("options", "registry")
"""What every room may have one of, and calls alike."""
STOREYS = (
    ("errors", "machine_code", "newton"),
    ("geometry",),
    ("io",),
    ("language",),
    ROOMS,
    ("verification", "variation", "scikit_learn"),
    ("report",),
    ("plots", "study"),
    ("stages", "example"),
    ("api", "testing"),
    ("__init__",),
    ("cli",),
    ("__main__", "reference"),
)
"""The parts of rsmkit from the foundation up; imports fall."""
SIM_STOREYS = (
    ("core",),
    ("air", "body"),
    ("aero",),
    ("flight",),
    ("settings", "objectives", "plots"),
    ("reentry",),
)


def name_of(path):
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


NAMES = {name_of(path): path for path in MODULES}


def imports(path):
    """Every module of the house that `path` imports, at once, lazily or for types only."""
    package = name_of(path).split(".") if path.name == "__init__.py" else name_of(path).split(".")[:-1]
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            named = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            stem = ".".join([*base, *([node.module] if node.module else [])])
            named = [f"{stem}.{alias.name}" for alias in node.names]
        else:
            continue
        for name in named:
            while name and name not in NAMES:
                name = name.rpartition(".")[0]
            if name and name != name_of(path):
                yield name


GRAPH = {name: set(imports(path)) for name, path in NAMES.items()}


def part(name):
    """The part of rsmkit or sim that a module belongs to."""
    return [*name.split("."), "__init__"][1]


def storey(name):
    storeys = STOREYS if name.startswith("rsmkit") else SIM_STOREYS
    (number,) = (i for i, parts in enumerate(storeys) if part(name) in parts)
    return number


@pytest.mark.parametrize("name", [n for n in NAMES if n not in ("rsmkit", "sim")])
def test_imports_fall(name):
    for other in GRAPH[name]:
        assert other.split(".")[0] == name.split(".")[0], f"{name} imports {other}: rsmkit and sim never meet"
        if part(other) == part(name) or other in ("rsmkit", "sim"):
            continue
        assert storey(other) < storey(name), f"{name} imports {other}: imports fall, they never rise"


def test_what_compiles_exists_twice_and_knows_nothing():
    ours, theirs = NAMES["rsmkit.machine_code"], NAMES["sim.core.machine_code"]
    assert ours.read_bytes() == theirs.read_bytes(), f"{ours} and {theirs} must be the same, byte for byte"
    assert not GRAPH["rsmkit.machine_code"] | GRAPH["sim.core.machine_code"]


def test_the_four_rooms_never_meet():
    meetings = [
        (name, other)
        for name, others in GRAPH.items()
        for other in others
        if {part(name), part(other)} <= set(ROOMS) and part(name) != part(other)
    ]
    assert not meetings


def circle(graph):
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return error.args[1]
    return None


def test_no_circle_between_modules():
    """The doors, which are lazy, are left out."""
    assert circle({name: others - {"rsmkit", "sim"} for name, others in GRAPH.items()}) is None


def test_no_circle_between_floors():
    """A floor is a folder inside a room; modules that lie in the room itself stand for themselves."""

    def floor(name):
        parts = name.split(".")
        return ".".join(parts[:3]) if len(parts) > 3 else name

    graph = defaultdict(set)
    for name, others in GRAPH.items():
        graph[floor(name)] |= {floor(other) for other in others - {"rsmkit", "sim"}} - {floor(name)}
    assert circle(graph) is None


def test_every_module_has_a_name_of_its_own():
    seen = defaultdict(list)
    for name, path in NAMES.items():
        if path.name != "__init__.py" and part(name) != "example":
            seen[name.split(".")[0], name.rpartition(".")[2]].append(name)
    shared = {key[1]: names for key, names in seen.items() if len(names) > 1 and key[1] not in ALIKE}
    assert not shared


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
