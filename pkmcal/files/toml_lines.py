"""A TOML file: what it says, and on which line it says it."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from functools import cached_property
from typing import Any

from pkmcal.exceptions import FileError

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib  # type: ignore[import-not-found,unused-ignore]

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
            self._text = content.decode("utf-8-sig")
            self.data: dict[str, Any] = tomllib.loads(self._text)
        except UnicodeDecodeError as error:
            raise FileError(f"{place}: not a text file in UTF-8 (byte {error.start})") from None
        except (ValueError, RecursionError) as error:  # syntax, an endless number or nesting
            raise FileError(f"{place}: not valid TOML: {error}") from None

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
        """Each heading, and each key with its value: where it begins, its text, its data.

        A statement ends where it is TOML by itself: one that is not closed yet is none.
        """
        first, text = 0, ""
        for line, more in enumerate(self._text.replace("\r\n", "\n").split("\n"), 1):
            first, text = (first, f"{text}\n{more}") if text else (line, more.lstrip())
            try:
                said = tomllib.loads(text)
            except ValueError:
                continue
            if said:
                yield first, text, said
            text = ""


def _keys(heading: dict[str, Any]) -> Iterator[str]:
    """The keys of a heading, one below the other."""
    while heading:
        ((key, below),) = heading.items()
        yield key
        heading = below[0] if isinstance(below, list) else below


def _paths(said: object, before: KeyPath) -> Iterator[KeyPath]:
    """All keys of a statement, those of tables in its value among them."""
    if isinstance(said, dict):
        for key, value in said.items():
            yield (*before, key)
            yield from _paths(value, (*before, key))
