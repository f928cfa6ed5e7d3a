"""Every key of the study file is read by some code: an option that nothing reads cannot exist."""

import ast
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import get_args, get_type_hints

import pytest

from rsmkit.study.file import TAGGED, StudyFile

ROOT = Path(__file__).parents[3] / "rsmkit"


def tables(kind):
    """The table classes inside a type, and inside those."""
    if is_dataclass(kind):
        yield kind
        for hint in get_type_hints(kind).values():
            yield from tables(hint)
        for tagged in TAGGED:
            if tagged.base is kind:
                yield from tagged.classes().values()
    else:
        for part in get_args(kind):
            yield from tables(part)


KEYS = sorted(
    {(table.__module__, table.__name__, item.name) for table in tables(StudyFile) for item in fields(table)}
)


def reads(node):
    """Attributes that a piece of code reads; to check a key is not to read it."""
    if isinstance(node, ast.FunctionDef) and node.name == "problems":
        return
    if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Load):
        yield node.attr
    for child in ast.iter_child_nodes(node):
        yield from reads(child)


READ = {name for path in ROOT.rglob("*.py") for name in reads(ast.parse(path.read_text()))}


@pytest.mark.parametrize(("module", "table", "key"), KEYS, ids=lambda value: value)
def test_the_key_is_read(module, table, key):
    assert key in READ, f"{table}.{key} ({module}) is in the study file and nothing reads it"
