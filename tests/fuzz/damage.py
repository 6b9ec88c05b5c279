"""Inputs: what a door knows well, damaged in a few places.

Written out rather than as strategies of Hypothesis, which takes longer to make an input than the
package to read it.
"""

from __future__ import annotations

from random import Random

from .doors import Door

KINDS = ("delete", "insert", "replace", "repeat", "swap", "cut", "flip")
MOST = 8  # changes of one input


def changed(content: bytes, kind: str, place: int, length: int, token: bytes) -> bytes:
    """One change at a place between the beginning and the end."""
    at = place % (len(content) + 1)
    before, taken, after = content[:at], content[at : at + length], content[at + length :]
    if kind == "delete":
        return before + after
    if kind == "insert":
        return before + token + taken + after
    if kind == "replace":
        return before + token + after
    if kind == "repeat":
        return before + taken * (2 + length % 7) + after
    if kind == "swap":
        return before + after[:length] + taken + after[length:]
    if kind == "cut":
        return before
    return before + bytes(each ^ (1 << length % 8) for each in taken) + after


def damaged(door: Door, random: Random) -> bytes:
    """A seed with up to eight changes, most of them by words that mean something to the door."""
    content = random.choice(door.seeds)
    for _ in range(random.randrange(MOST + 1)):
        kind, place, length = random.choice(KINDS), random.getrandbits(20), random.randrange(41)
        some = random.randbytes(random.randrange(5))
        token = random.choice(door.tokens) if random.random() < 0.8 else some
        content = changed(content, kind, place, length, token)
    return content
