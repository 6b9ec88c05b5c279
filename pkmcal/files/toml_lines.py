"""A TOML file: what it says, and on which line it says it."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from functools import cached_property
from typing import Any

from pkmcal.exceptions import FileError
from pkmcal.files.reading import LONGEST_NAME

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib  # type: ignore[import-not-found,unused-ignore]

MOST_NESTED = 50  # keys and lists, one within the other
_TOO_DEEP = f"keys and lists nested deeper than {MOST_NESTED}"
_MOST_DOTS = 1000
# What the end of a statement hangs on: text, in which brackets mean nothing, brackets, line ends.
_TOKEN = re.compile(
    r'"""(?:[^"\\]|\\.|"(?!""))*"{3,5}'
    r"|'''(?:[^']|'(?!''))*'{3,5}"
    r'|"(?:[^"\\\n]|\\.)*"'
    r"|'[^'\n]*'"
    r"|#[^\n]*|[\[\]{}\n]",
    re.DOTALL,
)

KeyPath = tuple[str | int, ...]  # keys from the top, and places in arrays of tables


class Source:
    r"""The content of a file.

    Parameters
    ----------
    content : bytes
        The file, in UTF-8.
    place : str
        How messages call it.

    Attributes
    ----------
    data : dict
        What it says, before anything of it is checked.
    text : str
        The same as text, with line feeds alone.
    line_end : str
        What ended its lines.

    Raises
    ------
    ValueError
        No text, or no TOML.

    Examples
    --------
    >>> source = Source(b"[pose]\nmap = 'planar'\n[[limb]]\n[[limb]]\nbase = {z = 1}", "my.toml")
    >>> source.where("pose", "map"), source.where("limb", 1, "base", "z")
    ('my.toml, line 2', 'my.toml, line 5')
    """

    def __init__(self, content: bytes, place: str) -> None:
        self.place = place
        try:
            self.text = content.decode("utf-8-sig").replace("\r\n", "\n")
            self.line_end = "\r\n" if b"\r\n" in content else "\n"
        except UnicodeDecodeError as error:
            at = content.count(b"\n", 0, error.start) + 1
            raise FileError(
                f"{place}, line {at}: not a text file in UTF-8 (byte {error.start}): save it as"
                " UTF-8, in an editor by Save as, Encoding"
            ) from None
        for number, line in enumerate(self.text.split("\n"), 1):
            if line.count(".") > _MOST_DOTS:  # the parser's time grows with their square
                raise FileError(f"{place}, line {number}: more than {_MOST_DOTS} dots on a line")
        try:
            self.data: dict[str, Any] = tomllib.loads(self.text)
        except ValueError as error:  # syntax, or an endless number
            raise FileError(f"{place}: not valid TOML: {error}") from None
        except RecursionError:
            raise FileError(f"{place}: {_TOO_DEEP}") from None
        self._limit()

    def _limit(self) -> None:
        """Refuse keys that are nested too deep or too long."""
        below: list[tuple[Any, int]] = [(self.data, 0)]
        while below:
            value, depth = below.pop()
            if depth > MOST_NESTED:
                raise FileError(f"{self.place}: {_TOO_DEEP}")
            if isinstance(value, dict):
                if long := next((key for key in value if len(key) > LONGEST_NAME), None):
                    raise FileError(
                        f"{self.place}: the key {long[:20]!r}… has {len(long)} characters,"
                        f" at most {LONGEST_NAME} are taken"
                    )
                below += [(each, depth + 1) for each in value.values()]
            elif isinstance(value, list):
                below += [(each, depth + 1) for each in value]

    def where(self, *path: str | int) -> str:
        """File and line of what stands there, or else of the table it would stand in."""
        while path and path not in self._lines:
            dotted = (*path[:-1], *str(path[-1]).split("."))  # base1.x without quotes
            path = dotted if dotted in self._lines else path[:-1]
        return f"{self.place}, line {self._lines[path]}" if path else self.place

    @cached_property
    def _lines(self) -> dict[KeyPath, int]:
        """First line of each table and key."""
        found: dict[KeyPath, int] = {}
        last: dict[KeyPath, int] = {}  # the place of the last table in each array of tables
        heading: KeyPath = ()
        for line, text, said in self._statements():
            if text.startswith("["):
                heading = ()
                keys = list(_keys(said))
                for depth, key in enumerate(keys, 1):
                    heading = (*heading, key)
                    found.setdefault(heading, line)
                    if text.startswith("[[") and depth == len(keys):
                        last[heading] = last.get(heading, -1) + 1
                    if heading in last:
                        heading = (*heading, last[heading])
                found.setdefault(heading, line)
            else:
                for path in _paths(said, heading):
                    found.setdefault(path, line)
        return found

    def _statements(self) -> Iterator[tuple[int, str, dict[str, Any]]]:
        """Return headings and keys with their values: place, text and data of each.

        A statement ends with the line on which its brackets are closed.
        """
        begin, line, open_brackets = 0, 1, 0
        for token in _TOKEN.finditer(self.text + "\n"):
            found = token[0]
            open_brackets += (found in ("[", "{")) - (found in ("]", "}"))
            if found == "\n" and not open_brackets:
                text = self.text[begin : token.start()]
                if said := tomllib.loads(text):
                    yield line, text.lstrip(), said
                line += text.count("\n") + 1
                begin = token.end()


def _keys(heading: dict[str, Any]) -> Iterator[str]:
    """The keys of a heading, one below the other."""
    while heading:
        ((key, below),) = heading.items()
        yield key
        heading = below[0] if isinstance(below, list) else below


def _paths(said: object, before: KeyPath) -> Iterator[KeyPath]:
    """Return the keys of a statement, those of tables in its value included."""
    if isinstance(said, dict):
        for key, value in said.items():
            yield (*before, key)
            yield from _paths(value, (*before, key))
