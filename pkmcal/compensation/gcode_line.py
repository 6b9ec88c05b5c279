"""A line of G-code as the commands that a firmware makes of it."""

from __future__ import annotations

import re
from functools import lru_cache
from typing import NamedTuple

from pkmcal.compensation.gcode_dialect import AXES, Dialect, Meaning

_MOST_BYTES = 4  # of a character
_NUMBER = r"[-+]?(?:\d+(?:\.\d*)?|\.\d+)"


def _ascii(pattern: str) -> re.Pattern[str]:
    """A pattern to which digits and spaces of other scripts are none, as to controllers."""
    return re.compile(pattern, re.ASCII)


_WORD = _ascii(rf"([A-Za-z])[ \t]*({_NUMBER})")
_PLAIN = _ascii(rf"[ \t]*(?:[A-Za-z][ \t]*{_NUMBER}[ \t]*)*")
_HEAD = _ascii(
    r"[ \t]*(?:([Nn])\d+(?:[ \t]+|$))?"
    r"(?:([A-Za-z_][A-Za-z_]\w*)|([GMTgmt])([ \t]*)(\d+(?:\.\d+)?)?)?"
)
_EXPONENT = _ascii(r"[\d.][Ee][-+]?[\d.]")
_CHECKSUM = _ascii(r".*\*[ \t]*\d+[ \t]*")
_TEXT = _ascii(r'"[^"]*"?|\{[^{}]*\}')
_VALUE = rf"(?:_+(?!_)|{_NUMBER}(?![\d.]))"  # a text is blanked; whole, lest parts are tried
_QUOTED = _ascii(rf"[ \t]*(?:[A-Za-z]?[ \t]*{_VALUE}[ \t]*)*")
_NEXT = _ascii(r"[GgMm]")
_LOWER = _ascii(r"'[GgMm]")
_PASSED_OVER = _ascii(r"(?<![A-Za-z_=])[GgMm](?=[ \t]*\d)")
_LETTER = _ascii(r"(?<![A-Za-z_=])[A-Za-z](?![A-Za-z_])")
_PROGRAM_NUMBER = _ascii(r"[ \t]*[Oo][ \t]*\d+[ \t]*")
_REMARK_ALONE = _ascii(r"[ \t]*\([^()]*\)[ \t]*")


class Word(NamedTuple):
    """The place of a word in its line, and of its number."""

    at: int
    start: int
    end: int
    value: float


class Command(NamedTuple):
    """A command and its words.

    Attributes
    ----------
    name : str
        As its firmware's table has it; empty for words that repeat the last G0 or G1.
    shown : str
        As it stands in the line.
    letters : frozenset of str
        The letters of its words.
    words : dict
        The numbers by their letters, of what is followed.
    number : Word or None
        The number of its own name, in a block.
    behind : str
        What acts behind it in its line.
    """

    name: str
    shown: str
    letters: frozenset[str] = frozenset()
    words: dict[str, Word] | None = None
    number: Word | None = None
    behind: str = ""


class Unclear(ValueError):
    """Why a line cannot be followed."""


def bare(line: str, dialect: Dialect) -> str:
    """A line with spaces in place of its remarks."""
    return _compiled(dialect.remark).sub(_blank, line)


def commands(line: str, dialect: Dialect) -> list[Command]:
    """The commands of a line, in the order in which they act.

    Raises
    ------
    Unclear
        A line that versions of the firmware read differently, or not at all.
    """
    for pattern, why in dialect.unclear.items():
        if _compiled(pattern).search(line):
            raise Unclear(why)
    code = bare(line, dialect)
    if code.strip() in ("", "%"):
        return []
    if not dialect.block:
        return _in_turn(code, dialect)
    require_short(line, dialect)
    return _of_block(code, dialect)


@lru_cache
def _compiled(pattern: str) -> re.Pattern[str]:
    return re.compile(pattern)


def require_short(line: str, dialect: Dialect) -> None:
    """Refuse a line that is longer than its firmware reads, the end of a printer's is a remark."""
    if dialect.longest is None or len(line) * _MOST_BYTES <= dialect.longest:
        return
    read = line if dialect.block else bare(line, dialect).rstrip()
    if len(read.encode("utf-8", errors="surrogateescape")) > dialect.longest:
        raise Unclear(f"{dialect.title} reads {dialect.longest} characters of a line")


def _blank(found: re.Match[str]) -> str:
    """Spaces for a remark; a text in quotation marks stays, whatever is in it."""
    return found[0] if found[0][0] == '"' else " " * len(found[0])


def _of_block(code: str, dialect: Dialect) -> list[Command]:
    """The codes of a block, and its move as the last, which has axes, F and S."""
    if _PROGRAM_NUMBER.fullmatch(code):
        return []
    codes: list[Command] = []
    motion, behind = Command("", "axis words"), ""
    words: dict[str, Word] = {}
    for letter, word, text in _words(code, dialect, code):
        if letter not in ("G", "M", "T"):
            _add(words, letter, word)
            continue
        command = Command(dialect.name(letter, text), letter + text, words={}, number=word)
        if command.name in dialect.behind:
            behind = command.name
        if command.name not in ("G0", "G1"):
            codes.append(command)
        elif motion.name:
            raise Unclear("G0 or G1 stands twice in it")
        else:
            motion = command
    words.pop("N", None)
    others = words.keys() - AXES - dialect.letters
    if others and not codes:
        raise Unclear(f"{min(others)} is no word of {motion.shown} that is followed")
    letters = frozenset(words)
    owner = next((k for k, each in enumerate(codes) if _takes_axes(each, dialect)), None)
    if owner is not None and letters & AXES:
        codes[owner] = codes[owner]._replace(letters=letters)
        letters -= AXES
    words = {letter: word for letter, word in words.items() if letter in letters - others}
    if motion.name or words:
        codes.append(motion._replace(words=words, letters=frozenset(words), behind=behind))
    return codes


def _add(words: dict[str, Word], letter: str, word: Word) -> None:
    if letter in words:
        raise Unclear(f"{letter} stands twice in it")
    words[letter] = word


def _takes_axes(command: Command, dialect: Dialect) -> bool:
    """Return whether axis words of its block are a code's own, as those of G28 and G92 are."""
    meaning = dialect.words.get(command.name)
    return command.name[0] == "G" and meaning not in (Meaning.FOLLOWED, Meaning.HARMLESS)


def _in_turn(code: str, dialect: Dialect) -> list[Command]:
    """The commands of a line, each with the words behind it."""
    if _REMARK_ALONE.fullmatch(code) and not dialect.exact:
        return []
    found: list[Command] = []
    while code.strip():
        command, end = _command(code, dialect)
        if found and not dialect.several:
            raise Unclear(
                f"{dialect.title} reads one command a line and passes over {command.shown}"
            )
        if found:
            found[-1] = found[-1]._replace(behind=command.shown)
        found.append(command)
        code = " " * end + code[end:]
    return found


def _command(code: str, dialect: Dialect) -> tuple[Command, int]:
    """The command that begins a line, and where it ends."""
    head = _HEAD.match(code)
    assert head is not None  # it may be empty
    line_number, macro, letter, gap, number = head.groups()
    name, shown = _named(dialect, macro, letter, number or "")
    if gap and number:
        raise Unclear(f"not all read {letter}{gap}{number} as {shown}: take out what is between")
    rest = code[head.end() :]
    if macro and dialect.several and name not in dialect.words and _NEXT.search(name):
        raise Unclear(f"{shown} has a G or M in it, with which {dialect.title} begins a command")
    if dialect.capitals and any(each and each.islower() for each in (line_number, letter)):
        raise Unclear(f"{shown} is not in capitals: {dialect.title} may not read it")
    if name in dialect.texts and not (dialect.several and rest.lstrip().startswith('"')):
        return Command(name, shown), len(code)
    if '"' in rest or "{" in rest:
        rest = _TEXT.sub(lambda found: "_" * len(found[0]), rest)
    if dialect.several and letter and _LOWER.search(rest):
        raise Unclear("a G or M behind ' begins a command in some versions and not in others")
    remark = rest.partition("(")[2] if dialect.several and letter else ""
    if remark and (")" not in remark or _NEXT.search(remark)):
        raise Unclear(
            f"parentheses behind {shown} are a remark to some versions, others read in it: put a"
            " remark behind ;"
        )
    following = None if macro else (_NEXT if dialect.several else _PASSED_OVER).search(rest)
    if following is not None:
        rest = rest[: following.start()]
        quoted = '"' in code[: head.end() + len(rest)] and _QUOTED.fullmatch(rest)
        if name in dialect.unquoted and not quoted:
            raise Unclear(
                f"what follows {shown} may be a text to it: put that in quotes, or break the line"
            )
    end = head.end() + len(rest)
    if name and dialect.words.get(name) is not Meaning.FOLLOWED:
        return Command(name, shown, frozenset(_LETTER.findall(rest.upper()))), end
    require_short(code, dialect)
    if "*" in code and _CHECKSUM.fullmatch(code):
        raise Unclear("the checksum would no longer be right: take checksums out")
    words: dict[str, Word] = {}
    for each, word, _ in _words(" " * head.end() + rest, dialect, code):
        _add(words, each, word)
    return Command(name, shown, frozenset(words), words), end


def _named(dialect: Dialect, macro: str | None, letter: str | None, number: str) -> tuple[str, str]:
    """The name of a command, "" of axis words alone, and what messages call it."""
    if macro:
        return macro.upper(), macro.upper()
    return (dialect.name(letter, number), letter + number) if letter else ("", "axis words")


def _words(code: str, dialect: Dialect, line: str) -> list[tuple[str, Word, str]]:
    """The words of plain G-code, each with its letter and the text of its number."""
    if not _PLAIN.fullmatch(code):
        raise Unclear(f"{line.strip()!r:.40} is no plain G-code: words and numbers alone")
    capitals = code.upper()
    if "E" in capitals and _EXPONENT.search(code):
        raise Unclear("E right behind a number may be an exponent: put a space before it")
    if dialect.capitals and code != capitals:
        raise Unclear(f"words that are not in capitals: {dialect.title} may not read them")
    found = []
    for each in _WORD.finditer(capitals):
        letter, number = each.groups()
        found.append((letter, Word(each.start(), *each.span(2), float(number)), number))
    return found
