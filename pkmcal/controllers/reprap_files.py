"""The files that RepRapFirmware runs at its start: config.g, and those of M501 and M98.

M501 runs config-override.g, to which M500 saves what a calibration of the firmware found; it
usually stands last, so that its numbers are those in force. M98 P"file" runs another file of its
folder sys, or of another folder of the card.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

from pkmcal.arguments import path as as_path
from pkmcal.controllers.gcode_words import Command, commanded, require_mm, settings
from pkmcal.exceptions import FileError
from pkmcal.files.text_lines import text_in

GEOMETRY = ("M665", "M666", "M669")  # what a calibration changes
_OVERRIDE = "config-override.g"
_NAMED = re.compile(r'P\s*(?:"(?P<quoted>[^"]*)"|(?P<bare>[^\s;"{]+))', re.IGNORECASE)
_CARD = re.compile(r"^[0-9]:")
_SYS = "/sys/"


@dataclass(frozen=True)
class Running:
    """The commands that are run, in their order.

    Attributes
    ----------
    text : str
        The lines of all files, those of another where it is run.
    notes : tuple of str
        What could not be read, a line each.
    hides : str
        Why numbers written into the file itself need not be those in force; "" where they are.
    """

    text: str
    notes: tuple[str, ...]
    hides: str


def running(path: str | PathLike[str]) -> Running:
    """Read a config.g and the files it runs.

    Raises
    ------
    ValueError
        A file that runs itself; a command of the geometry that cannot be followed.
    OSError
        A file that is there and cannot be read.
    """
    where = as_path("path", path)
    found = _Run()
    text = found.of(text_in(path, "replace"), where, (where,))
    return Running(text, tuple(found.notes), "; ".join(found.hides))


def own_config(config: str | PathLike[str]) -> str:
    """The text of a user's config.g, whose numbers are those in force.

    Raises
    ------
    ValueError
        It runs another file that sets them, or one that is not there.
    """
    if hides := running(config).hides:
        raise FileError(
            f"{as_path('config', config)}: other numbers may be in force than those written into"
            f" it: {hides}; give the file that sets them as config (--config), or none, which"
            " writes the lines alone"
        )
    return text_in(config, "surrogateescape")


class _Run:
    """Collects what is read while files run files."""

    def __init__(self) -> None:
        self.notes: list[str] = []
        self.hides: list[str] = []

    def of(self, text: str, file: Path, within: tuple[Path, ...]) -> str:
        """Return the text of a file, with files that it runs behind the commands that run them."""
        for code in GEOMETRY:  # a mistake is named with the line of its own file
            settings(text, code, str(file), missing=True)
        require_mm(text, str(file), *GEOMETRY)
        if len(within) > 1 and (sets := [c for c in GEOMETRY if commanded(text, c)]):
            self.hides.append(f"{file} sets {' and '.join(sets)}")
        parts, last = [], 0
        for command in commanded(text, "M501", "M98"):
            parts += [text[last : command.end], self._run(command, file, within)]
            last = command.end
        return "".join([*parts, text[last:]])

    def _run(self, command: Command, file: Path, within: tuple[Path, ...]) -> str:
        """The text of the file that a command runs, or nothing where it cannot be read."""
        named = _NAMED.search(command.words)
        said = f"{command.code} {command.words}".strip()
        if command.conditional:
            return self._unread(f"{file}: {said} stands under a condition and was not followed")
        if command.code == "M98" and named is None:
            return self._unread(f"{file}: {said} names its file by an expression")
        name = _OVERRIDE if named is None else named["quoted"] or named["bare"]
        there = _place(name, within[0].parent)
        if there in within:
            raise FileError(f"{file}: {said} runs a file that is being run")
        if not there.is_file():
            return self._unread(f"{there}, which {said} runs, is not there and was not read")
        return "\n" + self.of(text_in(there, "replace"), there, (*within, there)) + "\n"

    def _unread(self, why: str) -> str:
        self.notes.append(why)
        self.hides.append(why)
        return ""


def _place(name: str, folder: Path) -> Path:
    """Return the place of a file of the card whose folder sys is `folder`."""
    name = _CARD.sub("", name)
    if name.lower().startswith(_SYS):
        name = name[len(_SYS) :]
    return folder.parent / name[1:] if name.startswith("/") else folder / name
