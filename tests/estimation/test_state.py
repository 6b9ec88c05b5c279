"""What a caller holds does not change under him: no attribute is assigned outside of `__init__`."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

import pkmcal

ROOMS = ("estimation", "effects")
MODULES = [
    path for room in ROOMS for path in sorted((Path(pkmcal.__file__).parent / room).glob("*.py"))
]


def assigned(source: str) -> Iterator[tuple[str, str, int]]:
    """Function, attribute and line of what is assigned or deleted outside of `__init__`."""
    for function in ast.walk(ast.parse(source)):
        if not isinstance(function, ast.FunctionDef) or function.name == "__init__":
            continue
        for node in ast.walk(function):
            if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store | ast.Del):
                yield function.name, node.attr, node.lineno
            elif ast.unparse(node).endswith((".__setattr__", ".__dict__", "setattr")) and (
                function.name != "__getstate__"
            ):
                yield function.name, ast.unparse(node), node.lineno


@pytest.mark.parametrize("path", MODULES, ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_no_attribute_is_assigned_outside_of_init(path: Path) -> None:
    assert list(assigned(path.read_text(encoding="utf-8"))) == []


@pytest.mark.parametrize(
    "line", ["self.a = 1", "other.a += 1", "self.a, b = 1, 2", "del self.a", "x.__dict__['a'] = 1"]
)
def test_each_way_of_assigning_is_seen(line: str) -> None:
    assert list(assigned(f"class A:\n    def f(self):\n        {line}\n"))
    assert not list(assigned("class A:\n    def __init__(self):\n        self.a = 1\n"))
