"""The estimator knows no kind of reading and no effect by its name: each states what is asked."""

from __future__ import annotations

import ast
import dataclasses
import importlib
import inspect
import pkgutil
import re
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest

import pkmcal
from pkmcal import effects, readings
from pkmcal.calibration.asked import ROLES
from pkmcal.core.library import SLOTS
from pkmcal.measurements.measurements import Measurements
from pkmcal.readings.predicted import At
from pkmcal.readings.reading import Reading
from pkmcal.readings.registry import KINDS

ROOM = Path(pkmcal.__file__).parent / "estimation"


def is_kind(given: object) -> bool:
    """Whether it is a class of a reading or an effect, not one that says what these have to be."""
    if not inspect.isclass(given) or given is Reading or getattr(given, "_is_protocol", False):
        return False
    effect = given.__module__.startswith(effects.__name__) and (
        hasattr(given, "of_machine") or hasattr(given, "of_rows")
    )
    return issubclass(given, Reading) or effect


def modules(of: ModuleType) -> Iterator[ModuleType]:
    for each in pkgutil.iter_modules(of.__path__, f"{of.__name__}."):
        yield importlib.import_module(each.name)


OF_KINDS = [
    module
    for room in (readings, effects)
    for module in modules(room)
    if any(is_kind(each) and each.__module__ == module.__name__ for each in vars(module).values())
]
CLASSES = {name for module in OF_KINDS for name, each in vars(module).items() if is_kind(each)}
EVERY = {*ROLES, *(each.name for each in dataclasses.fields(Measurements))}
EVERY |= {each.name for each in dataclasses.fields(At)} | {"self", "at", "numbers"}
WORDS = {
    *KINDS,
    *(each.name for kind in KINDS.values() for each in dataclasses.fields(kind)),  # type: ignore[arg-type]
    *(name for kind in KINDS.values() for name in inspect.signature(kind.predict).parameters),
    *("anchor", "touch", "run", "mounting", "camera", "board"),
} - EVERY
# numbers of limbs and drives have such names, too
WORDS -= {re.sub(r"\d", "", name) for name in SLOTS}

OWNER = re.compile(r"(instrument|reading|measured|\bm)$")  # what attributes of a reading are of


def named(source: str) -> Iterator[str]:
    """What a module names of single kinds: imports, classes, attributes, and words in strings."""
    tree = ast.parse(source)
    texts = {
        id(node.body[0].value)
        for node in ast.walk(tree)
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef)
        and node.body
        and isinstance(node.body[0], ast.Expr)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module in {m.__name__ for m in OF_KINDS}:
            yield f"import of {node.module}"
        elif isinstance(node, ast.Name | ast.Attribute | ast.alias):
            name = node.attr if isinstance(node, ast.Attribute) else ""
            name = name or (node.id if isinstance(node, ast.Name) else "")
            name = node.name.rpartition(".")[2] if isinstance(node, ast.alias) else name
            of = ast.unparse(node.value) if isinstance(node, ast.Attribute) else ""
            if name in CLASSES or (name in WORDS and OWNER.search(of)):
                yield name
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            if id(node) in texts or " " in node.value.strip():  # prose
                continue
            yield from WORDS.intersection(re.findall(r"[a-z]+(?:[-_][a-z]+)*", node.value))


@pytest.mark.parametrize("path", sorted(ROOM.glob("*.py")), ids=lambda path: path.stem)
def test_no_module_of_the_estimator_names_a_kind(path: Path) -> None:
    assert list(named(path.read_text(encoding="utf-8"))) == []


@pytest.mark.parametrize(
    "line",
    [
        "from pkmcal.readings.touches import TouchDistance",
        "from pkmcal.readings import Camera",
        "from pkmcal.effects.instrument_scale import InstrumentScale",
        "isinstance(m.instrument, readings.Tilt)",
        "m.instrument.touched",
        "getattr(m.instrument, 'touched', None)",
        "m.kind == 'relative-distance'",
        "found['tool'] = 1",
        "name.startswith(('frame.', 'tool.'))",
        "re.compile(r'(frame|target|mounting)\\.')",
        "found[f'{name}.anchor']",
    ],
)
def test_each_way_of_naming_one_is_seen(line: str) -> None:
    assert list(named(line))


def test_words_that_every_reading_has_are_none_of_a_kind() -> None:
    assert not list(named("m.instrument.predict(at, target=m.target)\nroles('target', 'frame')"))
