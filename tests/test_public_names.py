"""The face of the package: what is public, where it lives, and what importing it loads."""

from __future__ import annotations

import ast
import importlib
import subprocess
import sys
import types
from pathlib import Path

import pytest

import pkmcal as pk


def test_the_names_for_type_checkers_are_those_that_are_found() -> None:
    tree = ast.parse(Path(pk.__file__).read_text(encoding="utf-8"))
    (block,) = (
        node
        for node in tree.body
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
    )
    stated = {}
    for node in block.body:
        assert isinstance(node, ast.ImportFrom)
        if node.module == "typing":
            continue
        for name in node.names:
            assert name.asname == name.name  # what makes it public to a type checker
            stated[name.name] = f"{node.module}"
    assert sorted(stated) == pk.__all__
    for name, module in stated.items():
        if module == "pkmcal":
            assert getattr(pk, name) is importlib.import_module(f"pkmcal.{name}")
        else:
            assert getattr(pk, name) is getattr(importlib.import_module(module), name)


def test_dir_shows_the_public_names_alone() -> None:
    assert dir(pk) == pk.__all__


@pytest.mark.parametrize("name", pk.__all__)
def test_no_public_name_hides_a_module(name: str) -> None:
    """`import pkmcal.name` fails, or gives what `pkmcal.name` is."""
    try:
        module = importlib.import_module(f"pkmcal.{name}")
    except ModuleNotFoundError:
        assert not isinstance(getattr(pk, name), types.ModuleType)
    else:
        assert getattr(pk, name) is module


def test_rooms_do_not_become_public_by_being_used() -> None:
    code = (
        "import pkmcal as pk; before = set(dir(pk)); pk.load('hexapod'); pk.identify;"
        "assert set(dir(pk)) == before; assert callable(pk.identify) and callable(pk.workspace)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_unknown_names_are_refused() -> None:
    with pytest.raises(AttributeError, match="no attribute 'robot'"):
        pk.robot  # noqa: B018
