"""Every machine that is driven and every instrument that is read, by its word."""

from __future__ import annotations

from typing import Any

from pkmcal.arguments import did_you_mean
from pkmcal.exceptions import ArgumentError
from pkmcal.kinematics.robot import Robot
from pkmcal.live.device import Instrument, Machine
from pkmcal.live.fluidnc import FluidNC
from pkmcal.live.folder import WatchedFolder
from pkmcal.live.linuxcnc import LinuxCNC
from pkmcal.live.moonraker import Moonraker
from pkmcal.live.person import Ask, PersonDrives, PersonReads
from pkmcal.live.reprap import RepRap
from pkmcal.live.serial_gauge import SerialGauge

MACHINES: dict[str, Any] = {
    "person": PersonDrives,
    "moonraker": Moonraker,
    "reprap": RepRap,
    "fluidnc": FluidNC,
    "linuxcnc": LinuxCNC,
}
INSTRUMENTS: dict[str, Any] = {
    "person": PersonReads,
    "serial": SerialGauge,
    "folder": WatchedFolder,
}


def machine(text: str, robot: Robot, ask: Ask | None = None) -> Machine:
    """The machine that ``WORD:ADDRESS`` states, connected; `ask` asks people, else a terminal.

    Raises
    ------
    ValueError
        No such word, or an address that is none.
    DeviceError
        It does not answer.
    """
    kind, address = _stated("--machine", text, MACHINES)
    made: Machine = kind(address, robot, *_asking(kind, ask))
    return made


def instrument(text: str, units: tuple[str, ...], ask: Ask | None = None) -> Instrument:
    """The instrument that ``WORD:ADDRESS`` states, opened; `ask` as of `machine`.

    Raises
    ------
    ValueError
        No such word, or an address that is none.
    DeviceError
        It is not there.
    """
    kind, address = _stated("--instrument", text, INSTRUMENTS)
    made: Instrument = kind(address, units, *_asking(kind, ask))
    return made


def words(kinds: dict[str, Any]) -> str:
    """The words with their addresses, for help."""
    return ", ".join(f"{word}:{of.ADDRESS}" if of.ADDRESS else word for word, of in kinds.items())


def _asking(kind: Any, ask: Ask | None) -> tuple[Ask, ...]:
    return (ask,) if ask is not None and getattr(kind, "ASKS", False) else ()


def _stated(option: str, text: str, kinds: dict[str, Any]) -> tuple[Any, str]:
    word, colon, address = text.partition(":")
    if word not in kinds:
        known = did_you_mean(word, kinds)
        raise ArgumentError(f"{option} {text}: no {word!r}{known}; it has {words(kinds)}")
    wanted = kinds[word].ADDRESS
    if bool(wanted) != bool(address) or (colon and not address):
        raise ArgumentError(f"{option} {text}: expected {word}{':' + wanted if wanted else ''}")
    return kinds[word], address
