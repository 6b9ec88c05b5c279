"""A TOML file knows on which line it says what."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import tomli_w
from hypothesis import given
from hypothesis import strategies as st

import pkmcal as pk
from pkmcal.files.toml_lines import Source, tomllib
from pkmcal.geometry import robot_file

EXAMPLES = Path(__file__).parents[2] / "examples"
FILES = {
    **{name: robot_file.located(name)[0].decode() for name in pk.machines()},
    **{
        str(path.relative_to(EXAMPLES)): path.read_text(encoding="utf-8")
        for path in EXAMPLES.rglob("*.toml")
    },
}
ODD = """\
# comments
name = "x"  # [not.a.table]
  [ pose ] # c
map = '''
[nor.this]
'''
home = [
  [1, 2],  # rows
  [3],
]
a.'b c'.d = 3
[[limb]]
"quoted key" = { x = 1, y = { z = 3 } }
[limb.sub]
u = 1

[[limb]]
[[limb.deep]]
v = 1
[[limb.deep]]
v = 2
[stated]
base1.x = 3
"base2.y" = 3
[[z.z]]
y = 3
"""


def paths(said: Any, before: tuple[str | int, ...] = ()) -> Iterator[tuple[str | int, ...]]:
    """Paths of all keys, and of the tables in arrays of tables."""
    if isinstance(said, dict):
        for key, value in said.items():
            yield (*before, key)
            yield from paths(value, (*before, key))
    elif isinstance(said, list) and said and all(isinstance(each, dict) for each in said):
        for place, value in enumerate(said):
            yield (*before, place)
            yield from paths(value, (*before, place))


def first_lines(text: str) -> dict[tuple[str | int, ...], int]:
    """Where the file must be cut off for a path to be missing, by reading all its beginnings."""
    found: dict[tuple[str | int, ...], int] = {}
    lines, whole = text.split("\n"), 0
    for count in range(1, len(lines) + 1):
        try:
            said = tomllib.loads("\n".join(lines[:count]))
        except tomllib.TOMLDecodeError:
            continue
        rest = lines[whole:count]
        begins = next(
            (i for i, line in enumerate(rest, whole + 1) if line.split("#")[0].strip()), 0
        )
        whole = count
        for path in paths(said):
            found.setdefault(path, begins)
    return found


def assert_lines(text: str) -> None:
    expected = first_lines(text)
    for content in (text, text.replace("\n", "\r\n")):
        source = Source(content.encode(), "my.toml")
        assert set(expected) == set(paths(source.data))
        for path, line in expected.items():
            assert source.where(*path) == f"my.toml, line {line}", path


@pytest.mark.parametrize("file", FILES)
def test_every_key_of_a_robot_file_is_on_the_line_that_it_is_missing_without(file: str) -> None:
    assert_lines(FILES[file])


def test_every_key_is_found_however_it_is_written() -> None:
    assert_lines(ODD)
    source = Source(ODD.encode(), "my.toml")
    assert source.where("stated", "base1.x") == "my.toml, line 23"
    assert source.where("stated", "base2.y") == "my.toml, line 24"


def test_what_is_missing_is_missing_in_its_table() -> None:
    source = Source(ODD.encode(), "my.toml")
    assert source.where("limb", 1, "kind") == "my.toml, line 17"
    assert source.where("limb", 0, "quoted key", "w") == "my.toml, line 13"
    assert source.where("units") == source.where() == "my.toml"


KEYS = st.text("ab. \"'é[]=#", min_size=1, max_size=4)
VALUES = st.recursive(
    st.integers(-9, 9) | st.text('a"[]#\n', max_size=5) | st.lists(st.integers(), max_size=3),
    lambda inner: st.dictionaries(KEYS, inner, max_size=3),
    max_leaves=6,
)


@given(st.dictionaries(KEYS, VALUES, max_size=3))
def test_every_key_of_any_file_is_found(data: dict[str, Any]) -> None:
    text = tomli_w.dumps(data, multiline_strings=True)
    source = Source(text.encode(), "my.toml")
    lines = text.split("\n")
    for path in paths(data):
        if not any("." in str(key) for key in path):
            place = source.where(*path)
            line = lines[int(place.rpartition(" ")[2]) - 1]
            name = [key for key in path if isinstance(key, str)][-1]
            assert name in line or tomli_w.dumps({name: 0}).rpartition(" = ")[0] in line
