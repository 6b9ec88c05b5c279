"""Inputs: what a door knows well, damaged in a few places."""

from __future__ import annotations

from functools import reduce

from hypothesis import strategies as st

from .doors import Door

Edit = tuple[str, int, int, bytes]
KINDS = ("delete", "insert", "replace", "repeat", "swap", "cut", "flip")


def apply(content: bytes, edit: Edit) -> bytes:
    """One change at a place between the beginning and the end."""
    kind, place, length, token = edit
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


def inputs(door: Door) -> st.SearchStrategy[bytes]:
    """A seed with up to eight changes, most of them words that mean something to the door."""
    token = st.sampled_from(door.tokens) | st.binary(max_size=4)
    edit = st.tuples(st.sampled_from(KINDS), st.integers(0, 0xFFFF), st.integers(0, 40), token)
    edits = st.lists(edit, max_size=8)
    return st.builds(
        lambda seed, made: reduce(apply, made, seed), st.sampled_from(door.seeds), edits
    )
