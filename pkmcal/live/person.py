"""A person who drives the machine by hand, or reads an instrument and types."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.display import visible
from pkmcal.files.number_text import typed
from pkmcal.kinematics.robot import Robot
from pkmcal.live.device import FARTHEST, DeviceError, Where

Ask = Callable[[str], str]  # prints a question and returns what is typed; EOFError: nobody there


def _ask(question: str) -> str:
    return input(visible(question))


class PersonDrives:
    """A machine that a person drives to each pose."""

    ADDRESS, ASKS = "", True

    def __init__(self, address: str, robot: Robot, ask: Ask = _ask) -> None:
        self._axes, self._ask = robot.coordinates, ask

    def require_ready(self) -> None:
        """A person is ready who pressed start."""

    def go(self, pose: FloatArray, feed: float) -> None:
        """Say where to drive, and wait for Enter."""
        shown = np.r_[pose[:3], np.degrees(pose[3:])]
        names = ("x", "y", "z", "alpha", "beta", "gamma")
        words = [
            f"{name} {value:.3f}"
            for name, value in zip(names, shown, strict=True)
            if name in self._axes
        ]
        _answer(self._ask, f"drive to {', '.join(words)} and press Enter ")

    def where(self) -> Where:
        """Nothing is known but what was asked for."""
        return Where()

    def stop(self) -> None:
        """A person stops by hand."""

    def close(self) -> None:
        """Do nothing: no connection is held."""


class PersonReads:
    """An instrument that a person reads and types: numbers in mm and deg, or - for nothing."""

    ADDRESS, ASKS = "", True

    def __init__(self, address: str, units: tuple[str, ...], ask: Ask = _ask) -> None:
        self._units, self._ask = units, ask

    def read(self, wanted: str) -> FloatArray:
        """Ask until as many numbers are typed as a reading has."""
        count = len(self._units)
        while True:
            said = _answer(self._ask, f"{wanted}: ").strip()
            if said == "-":
                return np.full(count, np.nan)
            try:
                numbers = [typed(each) for each in said.replace(",", " ").split()]
            except ValueError:
                numbers = []
            if len(numbers) == count and (np.abs(numbers) <= FARTHEST).all():
                turned = np.array([unit == "rad" for unit in self._units])
                return np.where(turned, np.radians(numbers), numbers)
            one = "a number" if count == 1 else f"{count} numbers"
            wanted = f"expected {one}, such as 0.12, or - where nothing is seen; again"

    def close(self) -> None:
        """Do nothing: no connection is held."""


def _answer(ask: Ask, question: str) -> str:
    try:
        return ask(question)
    except EOFError:
        raise DeviceError("nobody types: standard input has ended") from None
