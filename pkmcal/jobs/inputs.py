"""Files of a verb, each read once, so that outputs state the checksums of what was read."""

from __future__ import annotations

from pathlib import Path

from pkmcal.exceptions import FileError
from pkmcal.files import provenance
from pkmcal.files.reading import MOST_TABLE, Input
from pkmcal.geometry import robot_file
from pkmcal.loading import urdf_chain

_TABLES = (".csv", ".tsv", ".txt", ".log", ".xlsx")
CONFIGURATIONS = (".cfg", ".g", ".gcode")  # endings of a firmware's settings


class Inputs:
    """The files that a verb reads, by their full names."""

    def __init__(self) -> None:
        self._files: dict[str, Input] = {}
        self._built_in: list[str] = []

    def file(self, path: str | Path, called: str | None = None) -> Input:
        """Take a file, once for each name.

        What is meant may be a part of it, which is then what it is `called`.
        """
        return self._files.setdefault(str(path), Input(path, called))

    def robot(self, robot: str) -> str | Input:
        """Take a robot file, or a built-in machine by its name."""
        if robot_file.is_built_in(robot):
            self._built_in.append(robot)
            return robot
        chain = urdf_chain(robot)
        path = robot if chain is None else str(chain[0])
        if not Path(path).exists():
            return robot  # `load` refuses it
        suffix = Path(path).suffix.lower()
        if suffix in _TABLES:
            raise FileError(f"{path}: measurements, where a robot is needed: the robot comes first")
        if suffix in CONFIGURATIONS:
            raise FileError(
                f"{path}: a firmware's configuration, where a robot file is needed: pkmcal import"
                " makes one of it"
            )
        return self.file(path, robot if chain else None)

    @property
    def paths(self) -> list[Path]:
        """Paths of the files that were taken."""
        return [Path(each) for each in self._files.values()]

    def contents(self) -> dict[str, bytes]:
        """Return contents of files by their names; a built-in machine has its own name."""
        machines = (robot_file.located(name) for name in self._built_in)
        return {place: content for content, place, _ in machines} | {
            name: each.content(MOST_TABLE) for name, each in self._files.items()
        }

    def comment(self) -> str:
        """Lines for the head of a file that is made of these."""
        return provenance.comment(self.contents())
