"""A printer.cfg of Klipper or Kalico: numbers with their lines, and the text with some changed.

Lines are read as by the firmware, which is by Python's configparser: an option may go on in lines
that are indented more, and `#` begins a comment anywhere. Included files are read where they are
named; the block at the end that SAVE_CONFIG writes comes last, and an option above it goes before
the same one in it. Own code, for configparser loses lines and comments.
"""

from __future__ import annotations

import glob
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path

from pkmcal.arguments import path as as_path
from pkmcal.controllers.gcode_words import SAME
from pkmcal.exceptions import FileError
from pkmcal.files.text_lines import MARK, lines_of, text_in

STEPPERS = ("stepper_a", "stepper_b", "stepper_c")
CALIBRATE = "delta_calibrate"
ANGLES = {  # by kinematics, where the file says nothing
    "delta": dict(zip(STEPPERS, (210.0, 330.0, 90.0), strict=True)),
    "rotary_delta": dict(zip(STEPPERS, (30.0, 150.0, 270.0), strict=True)),
}

_SAVED = re.compile(r"#\*# <-+ SAVE_CONFIG -+>")
_PREFIX = "#*# "
_HEADER = (  # letter for letter, or the firmware finds no block (_find_autosave_data)
    "#*# <---------------------- SAVE_CONFIG ---------------------->",
    "#*# DO NOT EDIT THIS BLOCK OR BELOW. The contents are auto-generated.",
    "#*#",
)
_SECTION = re.compile(r"\[([^\]]+)\]")
_INCLUDE = re.compile(r"\[include +([^\]]+)\]")
_OPTION = re.compile(r"(?P<name>.*?)\s*[:=]\s*(?P<value>.*)")
_NAMED = re.compile(r"\$\{(?:([^.:${}]+)[.:])?([^${}]+)\}")  # Kalico: a value of another option
_MOST_NAMES = 10  # of which each names the next
_REMARK = re.compile(r"#.*|(?:^|(?<=\s));.*")


@dataclass(frozen=True)
class _Place:
    """Line of an option, counted from 0, and where its value begins and ends in it."""

    file: str
    line: int
    start: int
    end: int
    text: str


@dataclass(frozen=True)
class _End:
    """The last line of a section with something in it, and how its options are indented."""

    line: int
    indent: str


class _Reader:
    """Sections and options of lines, as the firmware reads them.

    Parameters
    ----------
    file : str
        What messages call the file.
    """

    def __init__(self, file: str) -> None:
        self.options: dict[tuple[str, str], _Place] = {}
        self.ends: dict[str, _End] = {}
        self._file = file
        self._section = ""
        self._option: tuple[str, str] | None = None
        self._lead = ""

    def take(self, i: int, line: str, start: int) -> None:
        """Read line i from `start`."""
        code = _REMARK.sub("", line[start:]).rstrip()
        if not code:
            return
        lead = code[: len(code) - len(code.lstrip())]
        start, code = start + len(lead), code.lstrip()
        if self._option and len(lead) > len(self._lead):
            self._go_on(i, start, code)
        elif header := _SECTION.match(code):
            self._section, self._option, self._lead = header[1].strip(), None, lead
        elif option := _OPTION.fullmatch(code):
            self._option, self._lead = (self._section, option["name"].lower()), lead
            at, end = (start + each for each in option.span("value"))
            self.options[self._option] = _Place(self._file, i, at, end, option["value"])
        self.ends[self._section] = _End(i, self._lead)

    def _go_on(self, i: int, start: int, code: str) -> None:
        """A line that goes on with the value above it."""
        assert self._option is not None
        value = self.options[self._option]
        if value.text:
            self.options[self._option] = replace(value, text=f"{value.text}\n{code}")
        else:
            self.options[self._option] = _Place(self._file, i, start, start + len(code), code)


class PrinterConfig:
    """The sections and options of a printer.cfg.

    Parameters
    ----------
    text : str
        The file.
    place : str
        What messages call it, and where it is: included files are sought beside it.

    Attributes
    ----------
    absent : list of str
        Included files that are not there.
    """

    def __init__(self, text: str, place: str) -> None:
        self.place = place
        self.absent: list[str] = []
        self._lines = lines_of(text)
        self._options: dict[tuple[str, str], _Place] = {}
        self._ends: dict[str, _End] = {}
        self._saved: dict[str, _End] = {}
        self._read(self._lines, place, (place,))

    def _read(self, lines: list[str], file: str, within: tuple[str, ...]) -> None:
        above, saved, start = _Reader(file), None, 0
        while lines and not lines[-1].strip():
            lines = lines[:-1]
        for i, whole in enumerate(lines):
            line = whole.rstrip("\r\n")
            if len(within) == 1 and saved is None and _SAVED.match(line):
                self._require_block(i, lines)
                saved = _Reader(file)
            elif saved is not None:
                self._require_saved(i, line)
                saved.take(i, line, len(_PREFIX))
            elif include := _INCLUDE.match(line):
                self._options |= above.options
                above.options = {}
                self._include(include[1].strip(), within)
            else:
                start = len(MARK) if i == 0 and line.startswith(MARK) else 0
                above.take(i, line, start)
        self._options |= above.options
        if len(within) == 1:
            self._ends = above.ends
        if saved is not None:
            self._options = saved.options | self._options
            self._saved = saved.ends

    def _require_block(self, i: int, lines: list[str]) -> None:
        """Refuse a block of SAVE_CONFIG that begins in line i, where the firmware leaves it out."""
        said = tuple(line.rstrip("\r\n") for line in lines[i : i + len(_HEADER)])
        if said != _HEADER or not i:
            raise FileError(
                f"{self.place}, line {i + 1}: the three lines of SAVE_CONFIG's header, below"
                " another line, are not letter for letter the firmware's, and it leaves the whole"
                " block out: restore them, or delete the block"
            )
        for above, line in enumerate(lines[1:i], 2):
            if line.startswith(_PREFIX):
                raise FileError(
                    f"{self.place}, line {above}: begins with {_PREFIX!r} above SAVE_CONFIG, and"
                    " the firmware leaves the whole block out: delete the line, or begin it with"
                    " '# '"
                )

    def _require_saved(self, i: int, line: str) -> None:
        """Refuse lines for which the firmware would leave the block of SAVE_CONFIG out."""
        unlike = line != _PREFIX.rstrip() and not line.startswith(_PREFIX)
        if unlike or _SAVED.match(line):
            raise FileError(
                f"{self.place}, line {i + 1}: behind SAVE_CONFIG lines must begin with"
                f" {_PREFIX!r} and not repeat its header, or the firmware leaves the whole block"
                " out: move others above it"
            )

    def _include(self, named: str, within: tuple[str, ...]) -> None:
        """Read the files that a line names, relative to the file it is in."""
        pattern = Path(within[-1]).parent / named
        found = sorted(
            each for each in glob.glob(str(pattern), recursive=True) if Path(each).is_file()
        )
        if not found and not glob.has_magic(named):
            self.absent.append(named)
        for file in found:
            if file in within:
                raise FileError(f"{within[-1]}: [include {named}] includes itself")
            self._read(lines_of(text_in(file)), file, (*within, file))

    def has(self, section: str, option: str) -> bool:
        """Return whether there is such an option."""
        return (section, option) in self._options

    def sections(self, *options: str) -> list[str]:
        """The sections that have one of these options, each once."""
        return list(dict.fromkeys(section for section, name in self._options if name in options))

    def text(self, section: str, option: str, default: str | None = None, depth: int = 0) -> str:
        """Return the text of an option, `depth` names away from the one that was asked for.

        Raises
        ------
        FileError
            It is not there and has no default.
        """
        if (section, option) in self._options:
            if depth > _MOST_NAMES:
                raise self.wrong(section, option, "names itself")
            return _NAMED.sub(
                lambda named: self.text(named[1] or section, named[2].lower(), depth=depth + 1),
                self._options[section, option].text,
            )
        if default is not None:
            return default
        raise FileError(f"{self.place}: [{section}] {option} is missing{self._lacking()}")

    def _lacking(self) -> str:
        """Name the causes for which a number may be missing."""
        return f"; {', '.join(self.absent)}, included, is not there" if self.absent else ""

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
        """Make an error about an option, to be raised."""
        where = self.place
        if (section, option) in self._options:
            found = self._options[section, option]
            where = f"{found.file}, line {found.line + 1}"
        return FileError(f"{where}: [{section}] {option} {message}")

    def changed(self, values: Mapping[tuple[str, str], float]) -> str:
        """The text with these numbers by section and option; all else as it was.

        Six decimals, as the firmware writes them. An option that already says the same is left
        alone; one that is missing is added at the end of its section.

        Raises
        ------
        FileError
            An option that would change is in an included file, or has no section.
        """
        text = list(self._lines)
        for (section, option), value in values.items():
            new = f"{value:.6f}"
            place = self._options.get((section, option))
            if place is None:
                self._add(text, section, f"{option}: {new}")
            elif abs(self.number(section, option) - value) > SAME:
                if place.file != self.place:
                    raise self.wrong(
                        section,
                        option,
                        f"would be {new}, in an included file, which is not changed: give that"
                        " file as config (--config), or none, which writes the lines alone",
                    )
                line = text[place.line]
                text[place.line] = line[: place.start] + new + line[place.end :]
        return "".join(text)

    def _add(self, text: list[str], section: str, line: str) -> None:
        if section not in self._ends and section not in self._saved:
            raise FileError(f"{self.place}: [{section}] is missing in it{self._lacking()}")
        last = self._ends.get(section) or self._saved[section]
        before = text[last.line]
        end = "\r\n" if before.endswith("\r\n") else "\n"
        prefix = last.indent if section in self._ends else _PREFIX
        text[last.line] = before + ("" if before.endswith("\n") else end) + prefix + line + end


def read(path: str | PathLike[str]) -> PrinterConfig:
    """Read a printer.cfg."""
    return PrinterConfig(text_in(path), str(as_path("path", path)))


def kinematics(printer: PrinterConfig) -> str:
    """Return the kind of a delta, "delta" or "rotary_delta"; all else is refused."""
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
                if not all(0.0 < teeth < math.inf for teeth in (one, other)):
                    raise ValueError
                gearing *= one / other
        except ValueError:
            raise printer.wrong(
                section, "gear_ratio", f"must be like 57:11, found {text!r}"
            ) from None
    steps = positive(printer, section, "microsteps")
    steps *= positive(printer, section, "full_steps_per_rotation", 200.0)
    if kinematics(printer) == "rotary_delta":
        return 2.0 * math.pi / (steps * gearing)
    return positive(printer, section, "rotation_distance") / (steps * gearing)
