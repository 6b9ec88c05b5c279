"""Recognition of the firmware that wrote a file, by its content."""

from __future__ import annotations

import re
from typing import Literal

from pkmcal.controllers.gcode_words import commanded, number, settings
from pkmcal.exceptions import FileError
from pkmcal.geometry.controller import FIRMWARES

Firmware = Literal["klipper", "reprap", "marlin", "hangprinter", "maslow"]
_MASLOW = re.compile(r"MaslowKinematics|Maslow_[tb][lr][XY][ \t]*[:=]|CLBM:\[")
_SECTION = re.compile(r"^\[(?:printer|stepper_[abc])\]", re.MULTILINE)
_LISTED = re.compile(r"^[^;\r\n]*\becho:", re.MULTILINE)  # as M503 of Marlin lists settings
_OF_REPRAP = ("G31", "M98", "M558", "M574", "M584")
_HANGPRINTER = 6  # K of M669


def firmware_of(text: str, place: str) -> Firmware:
    """The firmware whose file this is.

    Raises
    ------
    ValueError
        The file does not show it, or shows two.
    """
    if _MASLOW.search(text):
        return "maslow"
    if _SECTION.search(text):
        return "klipper"
    if number(settings(text, "M669", place, missing=True), "K", "M669", place, 0.0) == _HANGPRINTER:
        return "hangprinter"
    marlin = bool(_LISTED.search(text) or _has_all(text, place, "M851", "XYZ"))
    reprap = bool(commanded(text, "M669", *_OF_REPRAP) or "RepRapFirmware" in text)
    if marlin is reprap:
        raise FileError(
            f"{place}: it does not show whose file it is: state firmware (--from"
            f" {', '.join(FIRMWARES)}); adjustments of M666 have opposite signs in RepRapFirmware"
            " and in Marlin"
        )
    return "marlin" if marlin else "reprap"


def _has_all(text: str, place: str, command: str, letters: str) -> bool:
    """Return whether a command has all these letters: RepRapFirmware's M851 knows Z alone."""
    return set(letters) <= settings(text, command, place, missing=True).keys()
