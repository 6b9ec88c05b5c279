"""A printer.cfg of Klipper or Kalico: numbers with their lines, and the text with some changed.

The block at the end that SAVE_CONFIG writes is read too. As in the firmware, an option above it
goes before the same one in it. Own code, for configparser loses lines and comments.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike

from pkmcal.arguments import path as as_path
from pkmcal.exceptions import FileError
from pkmcal.files.reading import MOST_TEXT, content

STEPPERS = ("stepper_a", "stepper_b", "stepper_c")
ANGLES = {  # by kinematics, where the file says nothing
    "delta": dict(zip(STEPPERS, (210.0, 330.0, 90.0), strict=True)),
    "rotary_delta": dict(zip(STEPPERS, (30.0, 150.0, 270.0), strict=True)),
}
SAME = 5e-7  # of numbers with six decimals

_SAVED = re.compile(r"#\*# <-+ SAVE_CONFIG -+>")
_SECTION = re.compile(r"\[([^\]]+)\]")
_OPTION = re.compile(r"(?P<name>[^\s#;\[:=][^:=#;]*?)\s*[:=]\s*(?P<value>[^#;]*?)\s*(?:[#;].*)?")


@dataclass(frozen=True)
class _Place:
    """Line of an option, counted from 0, and where its value begins and ends in it."""

    line: int
    start: int
    end: int
    text: str


class PrinterConfig:
    """The sections and options of a printer.cfg.

    Parameters
    ----------
    text : str
        The file.
    place : str
        What messages call it.
    """

    def __init__(self, text: str, place: str) -> None:
        self.place = place
        self._lines = text.splitlines(keepends=True)
        self._options: dict[tuple[str, str], _Place] = {}
        self._sections: dict[str, int] = {}  # the last line with something in it
        above: dict[tuple[str, str], _Place] = {}
        saved, section = False, ""
        for i, whole in enumerate(self._lines):
            line, start = whole.rstrip("\r\n"), 0
            if _SAVED.match(line):
                saved, section = True, ""
                continue
            if saved and line.startswith("#*#"):
                start = 4 if line.startswith("#*# ") else 3
            if match := _SECTION.match(line, start):
                section = match[1].strip()
                self._sections.setdefault(section, i)
            elif match := _OPTION.fullmatch(line, start):
                found = _Place(i, *match.span("value"), match["value"])
                (self._options if saved else above)[section, match["name"].lower()] = found
                if not saved:
                    self._sections[section] = i
            elif not saved and line[:1].isspace() and line.strip() and section:
                self._sections[section] = i  # goes on with the value above it
        self._options |= above

    def has(self, section: str, option: str | None = None) -> bool:
        """Whether there is such a section, or such an option in it."""
        if option is None:
            return section in self._sections
        return (section, option) in self._options

    def text(self, section: str, option: str, default: str | None = None) -> str:
        """What an option says.

        Raises
        ------
        FileError
            It is not there and has no default.
        """
        if (section, option) in self._options:
            return self._options[section, option].text
        if default is not None:
            return default
        raise FileError(
            f"{self.place}: [{section}] {option} is missing; included files are not read"
        )

    def number(self, section: str, option: str, default: float | None = None) -> float:
        """The number that an option says."""
        return self.numbers(section, option, 1, None if default is None else (default,))[0]

    def numbers(
        self, section: str, option: str, count: int, default: tuple[float, ...] | None = None
    ) -> tuple[float, ...]:
        """So many numbers, with commas between them."""
        if default is not None and not self.has(section, option):
            return default
        text = self.text(section, option)
        try:
            found = tuple(float(part) for part in text.split(","))
        except ValueError:
            found = ()
        if len(found) != count or not all(abs(each) < float("inf") for each in found):
            wanted = "a number" if count == 1 else f"{count} numbers"
            raise self.wrong(section, option, f"must be {wanted}, found {text!r}")
        return found

    def wrong(self, section: str, option: str, message: str) -> FileError:
        """What is wrong with an option, as an error to raise."""
        where = self.place
        if (section, option) in self._options:
            where += f", line {self._options[section, option].line + 1}"
        return FileError(f"{where}: [{section}] {option} {message}")

    def changed(self, values: Mapping[tuple[str, str], float]) -> str:
        """The text with these numbers by section and option; all else as it was.

        Six decimals, as the firmware writes them. An option that already says the same is left
        alone; one that is missing is added at the end of its section.
        """
        text = list(self._lines)
        for (section, option), value in values.items():
            new = f"{value:.6f}"
            place = self._options.get((section, option))
            if place is None:
                self._add(text, section, f"{option}: {new}")
            elif abs(self.number(section, option) - value) > SAME:
                line = self._lines[place.line]
                text[place.line] = line[: place.start] + new + line[place.end :]
        return "".join(text)

    def _add(self, text: list[str], section: str, line: str) -> None:
        if section not in self._sections:
            raise FileError(f"{self.place}: [{section}] is missing; included files are not read")
        last = self._sections[section]
        before = text[last]
        end = "\r\n" if before.endswith("\r\n") else "\n"
        prefix = "#*# " if self._lines[last].startswith("#*# ") else ""
        text[last] = before + ("" if before.endswith("\n") else end) + prefix + line + end


def read(path: str | PathLike[str]) -> PrinterConfig:
    """Read a printer.cfg."""
    return PrinterConfig(text_in(path), str(as_path("path", path)))


def text_in(path: str | PathLike[str]) -> str:
    """What a text file says, line ends as they are."""
    where = as_path("path", path)
    try:
        return content(path, MOST_TEXT).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise FileError(f"{where}: this is no text in UTF-8") from None


def kinematics(printer: PrinterConfig) -> str:
    """Of a delta, "delta" or "rotary_delta"; all else is refused."""
    found = printer.text("printer", "kinematics")
    if found not in ANGLES:
        raise printer.wrong(
            "printer", "kinematics", f"must be delta or rotary_delta, found {found!r}"
        )
    return found


def positive(
    printer: PrinterConfig, section: str, option: str, default: float | None = None
) -> float:
    """A number above 0."""
    value = printer.number(section, option, default)
    if value <= 0.0:
        raise printer.wrong(section, option, f"must be above 0, found {value:g}")
    return value


def step_of(printer: PrinterConfig, section: str) -> float:
    """Mm a step, or rad of a crank, which has no rotation distance but a turn."""
    gearing = 1.0
    if printer.has(section, "gear_ratio"):
        text = printer.text(section, "gear_ratio")
        try:
            for pair in text.split(","):
                one, other = map(float, pair.split(":"))
                gearing *= one / other
        except (ValueError, ZeroDivisionError):
            raise printer.wrong(
                section, "gear_ratio", f"must be like 57:11, found {text!r}"
            ) from None
    steps = positive(printer, section, "microsteps")
    steps *= positive(printer, section, "full_steps_per_rotation", 200.0)
    if kinematics(printer) == "rotary_delta":
        return 2.0 * math.pi / (steps * gearing)
    return positive(printer, section, "rotation_distance") / (steps * gearing)
