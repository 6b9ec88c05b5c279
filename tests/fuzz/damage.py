"""Inputs: what a door knows well, damaged in a few places.

Written out rather than as strategies of Hypothesis, which takes longer to make an input than the
package to read it.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from random import Random


@dataclass(frozen=True)
class Door:
    """Seeds, words that mean something there, and what is done with an input."""

    seeds: tuple[bytes, ...]
    tokens: tuple[bytes, ...]
    enter: Callable[[Path, bytes, Random], bool]  # folder, input, for choices -> was it taken?


# How many changes an input has, and what they are: the first break the syntax more often than
# the others, which lead to a file that is read to its end.
CHANGES = (1, 1, 1, 2, 2, 3, 5, 8)
KINDS = (
    *("delete", "insert", "replace", "repeat", "swap", "flip", "cut"),
    *("number", "number", "number", "word", "word", "no line", "line again", "line there", "join"),
)
ENDLESS = 0.003  # of the repeated pieces are repeated a thousand times

NUMBERS = (
    *b"""
0 -0.0 -1 +1 1e308 -1e300 1e-320 1e999 nan -nan inf 1e15 99999999999 2147483648 4294967296
9223372036854775808 00012 1e 1.2.3 1,5 0x10 1_000 --1 + . 1e+0009 \xef\xbc\x91\xef\xbc\x92 \xd9\xa3
\xe2\x88\x921
""".split(),
    b"",
    b"9" * 400,
)
MARKS = (
    *(b"\n", b"\r", b"\t", b" ", b"\0", b"\x1a", b"\x7f", b"\\", b'"', b'"""'),
    *(
        b"\x1b[31m",
        b"\x1b]0;x\x07",
        b"\xff",
        b"\xc3",
        b"\xed\xa0\x80",
        b"\xef\xbb\xbf",
        b"\xc2\xa0",
    ),
    *("\u202e", "\u2066", "\u2028", "\x85", "\u0301", "\u05d0", "\U0001f9be", "\u200b"),
    *(b"$x_1^2$", b"%s%n", b"{}", b"<script>", b"../"),
)
HOSTILE = NUMBERS + tuple(each.encode() if isinstance(each, str) else each for each in MARKS)

_NUMBER = re.compile(rb"[-+]?[0-9][0-9.]*(?:[eE][-+]?[0-9]+)?")
_WORD = re.compile(rb"[A-Za-z_]+")


def damaged(door: Door, random: Random) -> bytes:
    """A seed with up to eight changes, most of them by words that mean something to the door."""
    content = random.choice(door.seeds)
    for _ in range(random.choice(CHANGES)):
        token = random.choice(door.tokens if random.random() < 0.6 else HOSTILE)
        if random.random() < 0.1:
            token = random.randbytes(random.randrange(5))
        content = changed(content, random.choice(KINDS), token, random, door)
    return content


def changed(content: bytes, kind: str, token: bytes, random: Random, door: Door) -> bytes:
    """One change at some place."""
    at, length = random.randrange(len(content) + 1), random.randrange(41)
    if kind in ("number", "word"):
        return _exchanged(content, at, _NUMBER if kind == "number" else _WORD, token)
    if kind == "join":
        return content[:at] + random.choice(door.seeds)[_line_at(content, at)[0] :]
    if "line" in kind:
        begin, end = _line_at(content, at)
        rest, line = content[:begin] + content[end:], content[begin:end]
        if kind == "no line":
            return rest
        there = _line_at(rest, random.randrange(len(rest) + 1))[0]
        kept = content if kind == "line again" else rest
        return kept[:there] + line + kept[there:]
    before, taken, after = content[:at], content[at : at + length], content[at + length :]
    if kind == "delete":
        return before + after
    if kind == "insert":
        return before + token + taken + after
    if kind == "replace":
        return before + token + after
    if kind == "repeat":
        return before + taken * (1000 if random.random() < ENDLESS else 2 + length % 7) + after
    if kind == "swap":
        return before + after[:length] + taken + after[length:]
    if kind == "cut":
        return before
    return before + bytes(each ^ (1 << length % 8) for each in taken) + after


def _exchanged(content: bytes, at: int, what: re.Pattern[bytes], token: bytes) -> bytes:
    """The next number or word after a place, or the first one, is another one."""
    found = what.search(content, at) or what.search(content)
    return content[: found.start()] + token + content[found.end() :] if found else content


def _line_at(content: bytes, at: int) -> tuple[int, int]:
    """Where the line that has this place begins and ends."""
    end = content.find(b"\n", at)
    return content.rfind(b"\n", 0, at) + 1, len(content) if end < 0 else end + 1
