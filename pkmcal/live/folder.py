"""A folder that is watched: an instrument's program exports a line for each reading there."""

from __future__ import annotations

import os
import re
from pathlib import Path
from time import monotonic, sleep
from typing import NamedTuple

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.exceptions import ArgumentError
from pkmcal.live.device import DeviceError

_WAIT, _PAUSE = 600.0, 0.1  # s for a reading, and between two looks
_LONGEST = 100_000_000  # bytes of a file
_LAST = 4096  # bytes before its end by which a file is known again
_SEPARATORS = re.compile(r"[;,\t ]+")
_NUMBER = re.compile(r"[-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?")


class _Known(NamedTuple):
    """A file as it was: its size, when it was changed, and its last bytes."""

    size: int
    changed: int
    last: bytes


_NONE = _Known(0, 0, b"")


class WatchedFolder:
    """Text files of a folder. The next line that is added to any of them is the reading.

    It has as many numbers as a reading, in mm and deg, and nothing beside: what other columns mean
    is not guessed. Let the instrument's program export x, y, z alone.
    """

    ADDRESS = "FOLDER"

    def __init__(self, address: str, units: tuple[str, ...]) -> None:
        self._folder, self._units = Path(address), units
        if not self._folder.is_dir():
            raise ArgumentError(f"folder: {address} is no folder")

    def read(self, wanted: str) -> FloatArray:
        """The line that is added next."""
        before, end = self._files(), monotonic() + _WAIT
        seen: dict[Path, list[str]] = {}
        while monotonic() < end:
            for path in self._paths():
                try:
                    added = self._added(path, before.get(path, _NONE))
                except FileNotFoundError:  # it vanished meanwhile
                    continue
                except OSError as error:
                    raise DeviceError(f"folder: {error}") from None
                if added and seen.get(path) == added:  # nothing more comes with it
                    return self._numbers(path, added)
                seen[path] = added
            sleep(_PAUSE)
        raise DeviceError(f"folder: nothing was added in {self._folder} for {_WAIT:g} s")

    def close(self) -> None:
        """Do nothing: no connection is held."""

    def _paths(self) -> list[Path]:
        try:
            files = sorted(self._folder.iterdir())
        except OSError as error:
            raise DeviceError(f"folder: {error}") from None
        kinds = (".csv", ".txt", ".tsv", ".log", ".asc", ".xyz")
        return [path for path in files if path.suffix.lower() in kinds]

    def _files(self) -> dict[Path, _Known]:
        """Files as they are; those that vanish meanwhile are none."""
        found = {}
        for path in self._paths():
            try:
                with open(path, "rb") as file:
                    stat = os.fstat(file.fileno())
                    file.seek(max(0, stat.st_size - _LAST))
                    last = file.read(min(_LAST, stat.st_size))
            except OSError:
                continue
            found[path] = _Known(stat.st_size, stat.st_mtime_ns, last)
        return found

    def _added(self, path: Path, known: _Known) -> list[str]:
        """Whole lines behind what is known, or all of a file that was written anew.

        A heading of a new file is none.
        """
        with open(path, "rb") as file:
            stat = os.fstat(file.fileno())
            if (stat.st_size, stat.st_mtime_ns) == known[:2]:
                return []
            file.seek(max(0, known.size - len(known.last)))
            if file.read(len(known.last)) != known.last:  # another file, or written anew
                known = _NONE
                file.seek(0)
            content = file.read(_LONGEST)
        whole, end, _ = content.rpartition(b"\n")
        lines = [line.strip() for line in (whole + end).decode("utf-8", "replace").splitlines()]
        return [line for line in lines if line and not (known.size == 0 and _is_heading(line))]

    def _numbers(self, path: Path, lines: list[str]) -> FloatArray:
        if len(lines) > 1:
            raise DeviceError(
                f"{path}: {len(lines)} lines were added at once, where one is a reading"
            )
        parts = [part for part in _SEPARATORS.split(lines[0]) if part]
        if len(parts) != len(self._units) or not all(map(_NUMBER.fullmatch, parts)):
            raise DeviceError(
                f"{path}: expected a line of {len(self._units)} numbers, found {lines[0][:60]!r}"
            )
        numbers = np.array([float(part) for part in parts])
        turned = np.array([unit == "rad" for unit in self._units])
        return np.where(turned, np.radians(numbers), numbers)


def _is_heading(line: str) -> bool:
    return line.startswith("#") or not any(map(_NUMBER.fullmatch, _SEPARATORS.split(line)))
