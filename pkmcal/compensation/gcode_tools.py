"""The tool that a program has in the machine, as its firmware changes it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from pkmcal.compensation.gcode_dialect import Dialect
from pkmcal.compensation.gcode_line import Command, Unclear


@dataclass
class Carried:
    """The tool that T selected, and which of the loads the machine carries."""

    selected: int | None = None
    load: int = 0


class Tools:
    """Follows changes of the tool where loads by tool are stated.

    Parameters
    ----------
    dialect : Dialect
        The firmware.
    loads : mapping of int to int
        Which load a tool is; load 0 is carried before the first change. Nothing is followed where
        no tool is stated.
    """

    def __init__(self, dialect: Dialect, loads: Mapping[int, int]) -> None:
        self._dialect, self._loads = dialect, loads

    def in_order(self, found: Sequence[Command]) -> Sequence[Command]:
        """The commands of a line: in a block T acts before what takes the tool."""
        if not self._loads or not self._dialect.block:
            return found
        return sorted(found, key=lambda command: command.name != "T")

    def changes(self, command: Command, state: Carried) -> bool:
        """Return whether a command changes the tool; the state follows.

        Raises
        ------
        Unclear
            A change that cannot be followed, or to a tool of which no load is stated.
        """
        if not self._loads:
            return False
        name = command.name
        if name in self._dialect.takes_unseen:
            raise Unclear(f"{command.shown} may change the tool, and loads are stated by tool")
        if name == "T":
            state.selected = _tool(command)
        if name != (self._dialect.takes or "T"):
            return False
        if state.selected is None:
            raise Unclear(f"{command.shown} takes a tool that no T before it names")
        if state.selected not in self._loads:
            raise Unclear(f"the load of tool {state.selected} is not stated")
        state.load = self._loads[state.selected]
        return True


def _tool(command: Command) -> int:
    """Return the number of a tool that a word names."""
    number = command.shown[1:].strip()
    if not number or float(number) % 1.0:
        raise Unclear(f"{command.shown} names no tool, and loads are stated by tool")
    return int(float(number))
