"""A folder that is watched: an instrument's program exports a line for each reading there."""

from __future__ import annotations

import re
from pathlib import Path
from time import monotonic, sleep

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.exceptions import ArgumentError
from pkmcal.live.device import DeviceError

_WAIT, _PAUSE = 600.0, 0.1  # s for a reading, and between two looks
_LONGEST = 100_000_000  # bytes of a file
_SEPARATORS = re.compile(r"[;,\t ]+")
_NUMBER = re.compile(r"[-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?")


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
        before, end = self._sizes(), monotonic() + _WAIT
        while monotonic() < end:
            for path, size in self._sizes().items():
                known = before.get(path, 0)
                if size < known:  # written anew
                    before[path] = 0
                    continue
                added = self._added(path, known)
                if added:
                    return self._numbers(path, added)
            sleep(_PAUSE)
        raise DeviceError(f"folder: nothing was added in {self._folder} for {_WAIT:g} s")

    def close(self) -> None:
        """Nothing is open."""

    def _sizes(self) -> dict[Path, int]:
        """Files by their size; those that vanish meanwhile are none."""
        found = {}
        for path in sorted(self._folder.iterdir()):
            if path.suffix.lower() in (".csv", ".txt", ".tsv", ".log", ".asc", ".xyz"):
                try:
                    found[path] = path.stat().st_size
                except OSError:
                    continue
        return found

    def _added(self, path: Path, known: int) -> list[str]:
        """Whole lines behind what is known; a heading of a new file is none."""
        with open(path, "rb") as file:
            file.seek(known)
            content = file.read(_LONGEST)
        whole, end, _ = content.rpartition(b"\n")
        lines = [line.strip() for line in (whole + end).decode("utf-8", "replace").splitlines()]
        return [line for line in lines if line and not (known == 0 and _is_heading(line))]

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
