"""Settings in G-code: words of commands such as M665, by their letters, out and in.

Own code: where each word stands is needed, to change it and nothing else, and what is no plain
number, such as an expression, has to be refused rather than passed over.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from math import isfinite
from typing import NamedTuple

from pkmcal.exceptions import FileError
from pkmcal.files.text_lines import MARK

TOWERS = (210.0, 330.0, 90.0)  # of RepRapFirmware and Marlin
SAME = 5e-7  # of numbers with six decimals
_LINE = re.compile(r"[^\r\n]+")
_REMARK = re.compile(r"\([^)]*\)|;.*|\*\s*\d+\s*$")  # a checksum, too
_START = re.compile(  # as M503 lists it, or numbered
    MARK + r"?(?:[^;]*\becho:|\s*N\s*\d+)?\s*", re.IGNORECASE
)
_CODE = re.compile(r"([GM])\s*0*(\d+)(?![\d.])", re.IGNORECASE)
_BLOCK = re.compile(r"\s*(?:if|elif|else|while)\b", re.IGNORECASE)  # lines indented more are in it
_TEXTS = ("M23", "M28", "M30", "M32", "M117", "M118")  # what follows is a name or a message
_WORD = re.compile(
    r'\s*([A-Za-z])\s*(\{[^}]*\}|"[^"]*"|(?:[^A-Za-z\s]|(?<=[\d.])[eE](?=[-+]?\d))*)\s*'
)
_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)")


class Setting(NamedTuple):
    """The text behind a letter, and its place."""

    value: str
    start: int
    end: int


class Command(NamedTuple):
    """A line: where it ends, its code, the words behind it, whether it is under a condition."""

    end: int
    code: str
    words: str
    conditional: bool


Settings = dict[str, Setting]
Commands = Mapping[str, Mapping[str, Sequence[float]]]  # numbers by command and letter


def written(*values: float) -> str:
    """Numbers with six decimals and colons between them."""
    return ":".join(f"{round(value, 6) + 0.0:.6f}" for value in values)


def lines(commands: Commands, **kinds: int) -> str:
    """The lines of commands; of those of `kinds` with a K before the other words."""
    text = ""
    for command, values in commands.items():
        kind = f" K{kinds[command]}" if command in kinds else ""
        words = " ".join(letter + written(*each) for letter, each in values.items())
        text += f"{command}{kind} {words}\n"
    return text


def each(letters: str, values: Sequence[float]) -> dict[str, list[float]]:
    """A number for each letter."""
    return {letter: [value] for letter, value in zip(letters, values, strict=True)}


def off_towers(angles: Sequence[float]) -> dict[str, list[float]]:
    """X Y Z: by how much towers stand off the firmware's angles, deg."""
    pairs = zip(angles, TOWERS, strict=True)
    return each("XYZ", [(angle - tower + 180.0) % 360.0 - 180.0 for angle, tower in pairs])


def settings(
    text: str, command: str, place: str, missing: bool = False, kind: str = ""
) -> Settings:
    """The words of a command: what was set last, in one of them or in several.

    Another K starts anew: it is another kinematics. With `kind` those of another K are passed over,
    and those without K are of this one. With `missing` there may be no such command.

    Raises
    ------
    FileError
        There is no such command, something beside words in it, another command in its line, or a
        condition above it.
    """
    found: Settings = {}
    times = 0
    inner = re.compile(rf"(?<![A-Za-z]){command[0]}\s*0*{command[1:]}(?![\d.])", re.IGNORECASE)
    for line, code in _codes(text):
        if code[0] != command:
            others = re.sub(r'"[^"]*"', "", _without_remarks(line[0])[code[1] :])
            if code[0] not in _TEXTS and inner.search(others):
                raise _wrong(line, place, f"{command} must begin its line")
            continue
        times += 1
        if _in_a_block(text, line):
            raise _wrong(line, place, f"{command} under a condition, which cannot be followed")
        new = _words_of(line, code[1], command, place)
        if kind and "K" in new and new["K"].value != kind:
            continue
        if "K" in new and new["K"].value != found.get("K", new["K"]).value:
            found = {}
        found |= new
    if not times and not missing:
        raise FileError(f"{place}: {command} is missing")
    return found


def commanded(text: str, *codes: str) -> list[Command]:
    """The lines with these commands."""
    return [
        Command(
            line.end(),
            code[0],
            _without_remarks(line[0])[code[1] :].strip(),
            _in_a_block(text, line),
        )
        for line, code in _codes(text)
        if code[0] in codes
    ]


def require_mm(text: str, place: str, *commands: str) -> None:
    """Refuse numbers of these commands where G20 is in force: versions differ in what it is for.

    Raises
    ------
    FileError
        G20 stands above one of them, with its line.
    """
    inches = False
    for line, code in _codes(text):
        inches = code[0] == "G20" if code[0] in ("G20", "G21") else inches
        if inches and code[0] in commands:
            raise _wrong(line, place, "stands behind G20, in inches: list it in mm, behind G21")


def place_of(text: str, setting: Setting, place: str) -> str:
    """Name the place of a setting, for messages."""
    return f"{place}, line {text.count(chr(10), 0, setting.start) + 1}"


def changed(text: str, place: str, commands: Commands) -> str:
    """The text with these numbers by command and letter, and not a character else changed.

    Numbers that say the same stay as they are written, also one that stands for several. A letter
    that is missing is 0, or added to the last such command.

    Raises
    ------
    FileError
        There is no such command, or what stands there is no number.
    """
    edits: list[tuple[int, int, str]] = []
    for command, values in commands.items():
        found = settings(text, command, place)
        last = max((setting.end for setting in found.values()), default=0)
        for letter, new in values.items():
            if letter in found:
                old = numbers(found, letter, command, place, counts=(1, len(new)))
                old *= len(new) // len(old)
                start, end = found[letter][1:]
            else:
                old, start, end = [0.0] * len(new), last, last
            if any(abs(one - other) > SAME for one, other in zip(old, new, strict=True)):
                word = written(*new) if letter in found else f" {letter}{written(*new)}"
                edits.append((start, end, word))
    for start, end, word in sorted(edits, key=lambda edit: edit[:2], reverse=True):
        text = text[:start] + word + text[end:]
    return text


def numbers(
    found: Settings,
    letter: str,
    command: str,
    place: str,
    default: float | None = None,
    *,
    counts: tuple[int, ...] = (1,),
) -> list[float]:
    """The numbers behind a letter, as many as one of `counts`.

    Raises
    ------
    FileError
        It is missing and has no default, or is something else.
    """
    if letter not in found and default is not None:
        return [default]
    if letter not in found:
        raise FileError(f"{place}: {letter} of {command} is missing")
    value = found[letter].value
    parts = value.split(":")
    plain = all(_NUMBER.fullmatch(part) and isfinite(float(part)) for part in parts)
    if len(parts) not in counts or not plain:
        wanted = "a number" if counts == (1,) else f"{' or '.join(map(str, counts))} numbers"
        raise FileError(f"{place}: {letter} of {command} must be {wanted}, found {value!r}")
    return [float(part) for part in parts]


def number(
    found: Settings, letter: str, command: str, place: str, default: float | None = None
) -> float:
    """The number behind a letter; as `numbers`."""
    return numbers(found, letter, command, place, default)[0]


def require_positive(values: Sequence[float], letter: str, command: str, place: str) -> None:
    """Refuse numbers that are not above 0."""
    if not min(values) > 0.0:
        raise FileError(f"{place}: {letter} of {command} must be above 0, found {min(values):g}")


def _codes(text: str) -> list[tuple[re.Match[str], tuple[str, int]]]:
    """Lines that begin with a G or M code: the line, the code, and where it ends in the line."""
    found = []
    for line in _LINE.finditer(text):
        start = _START.match(line[0])
        code = _CODE.match(line[0], start.end() if start else 0)
        if code:
            found.append((line, (f"{code[1].upper()}{code[2]}", code.end())))
    return found


def _in_a_block(text: str, line: re.Match[str]) -> bool:
    """Return whether a line is indented under an `if` or a `while`."""
    indent = _indent(line[0])
    for above in reversed(_LINE.findall(text, 0, line.start())):
        if above.strip() and _indent(above) < indent:
            if _BLOCK.match(above):
                return True
            indent = _indent(above)
    return False


def _indent(line: str) -> int:
    return len(line) - len(line.lstrip())


def _without_remarks(line: str) -> str:
    return _REMARK.sub(lambda found: " " * len(found[0]), line)


def _wrong(line: re.Match[str], place: str, message: str) -> FileError:
    where = f"{place}, line {line.string.count(chr(10), 0, line.start()) + 1}"
    return FileError(f"{where}: {_without_remarks(line[0]).strip()!r:.60}: {message}")


def _words_of(line: re.Match[str], start: int, command: str, place: str) -> Settings:
    code = _without_remarks(line[0])
    at, found = start, {}
    while code[at:].strip():
        word = _WORD.match(code, at)
        if word is None:
            raise _wrong(line, place, f"{command} must have words alone")
        letter = word[1].upper()
        if letter in ("G", "M"):
            raise _wrong(line, place, f"{command} must be alone in its line")
        if letter in found:
            raise _wrong(line, place, f"{command} must have {letter} once")
        found[letter] = Setting(word[2], *(line.start() + end for end in word.span(2)))
        at = word.end()
    return found
