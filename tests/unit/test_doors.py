"""One public door each: every name can be had from ``rsmkit`` or ``sim``, lazily, and is documented."""

import ast
import importlib.util
import inspect
import re
import subprocess
import sys
import typing
from pathlib import Path

import pytest

import rsmkit
import sim

ROOT = Path(__file__).parents[2]
DOORS = [rsmkit, sim]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
NOTEBOOKS = sorted(path.with_suffix(".py") for path in (ROOT / "studies").rglob("*.ipynb"))


@pytest.mark.parametrize("door", DOORS, ids=lambda door: door.__name__)
def test_every_name_is_there_and_comes_from_where_type_checkers_look(door):
    checked = {}
    for node in ast.walk(ast.parse(Path(door.__file__).read_text())):
        if isinstance(node, ast.ImportFrom) and node.module.startswith(f"{door.__name__}."):
            checked |= {alias.asname: node.module for alias in node.names}
    assert checked == door.HOMES
    for name in door.__all__:
        assert getattr(door, name) is not None
        assert name in dir(door)


@pytest.mark.parametrize("door", DOORS, ids=lambda door: door.__name__)
def test_a_wrong_name_gets_the_nearest_right_one(door):
    name = "evaluat"
    with pytest.raises(AttributeError, match="did you mean evaluate"):
        getattr(door, name)


@pytest.mark.parametrize("door", DOORS, ids=lambda door: door.__name__)
def test_opening_a_door_costs_nothing(door):
    code = f"import sys, {door.__name__}; assert not {{'numpy', 'scipy', 'numba'}} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize("name", ["names", "api"])
def test_the_pages_made_from_the_code_are_current(name):
    spec = importlib.util.spec_from_file_location(name, ROOT / "docs" / f"{name}.py")
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    written = (ROOT / "docs" / f"{name}.md").read_text()
    assert written == script.page(), f"run: python docs/{name}.py > docs/{name}.md"


def deep_imports(text):
    """Names that a text imports from deeper than a door."""
    for module, names in re.findall(
        r"^\s*(?:>>> )?from ((?:rsmkit|sim)\.[\w.]+) import ([\w, ]+)", text, re.MULTILINE
    ):
        door = module.split(".")[0]
        if module not in (f"{door}.testing", f"{door}.plots", "sim.reentry"):
            yield module, names


@pytest.mark.parametrize("path", [*PAGES, *NOTEBOOKS], ids=lambda path: path.name)
def test_what_people_read_goes_through_the_door(path):
    assert not list(deep_imports(path.read_text()))


def held_classes():
    """Every class of rsmkit that its public functions give, or that is public itself."""
    found = set()

    def walk(hint):
        if inspect.isclass(hint) and hint.__module__.startswith("rsmkit"):
            found.add(hint)
        for part in typing.get_args(hint):
            walk(part)

    for name in rsmkit.HOMES:
        thing = getattr(rsmkit, name)
        if inspect.isclass(thing):
            walk(thing)
        else:
            walk(typing.get_type_hints(inspect.unwrap(thing)).get("return"))
    return sorted(found, key=lambda c: c.__name__)


def test_whatever_a_user_holds_shows_itself():
    held = [
        c for c in held_classes() if not issubclass(c, Exception) and not getattr(c, "_is_protocol", False)
    ]
    assert len(held) > 40
    mute = [c.__name__ for c in held if not hasattr(c, "_repr_html_")]
    assert not mute, f"{mute}: let them inherit from rsmkit.io.shown.Shown, so that notebooks show them"
