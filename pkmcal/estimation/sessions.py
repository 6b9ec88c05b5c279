"""Scopes of parameters: common to all rows, of a session, or of a set.

What a row depends on are the *numbers of a row*: the free numbers of the geometry, the frame, the
points. Each is common to all rows, or there is one of it for each session (``offset5@thursday``) or
for each set of measurements (``frame.x@2``). `PoseTable.columns` says which parameter of the search
each number of a row is; everything else knows the numbers of a row alone.
"""

from __future__ import annotations

import itertools
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from pathlib import PurePath
from typing import Literal

import numpy as np

from pkmcal.arguments import did_you_mean
from pkmcal.arrays import FloatArray, IntArray
from pkmcal.exceptions import ArgumentError
from pkmcal.measurements.measurements import Measurements

Scope = Literal["common", "session", "set"]
NONE = -1  # column of a number that a row does not depend on


def by_parameters(
    derivative: FloatArray, columns: IntArray, part_of: IntArray, size: int
) -> FloatArray:
    """Derivative (N, k, size) by the parameters, from one (N, k, m) by the numbers of a row.

    Parameters
    ----------
    derivative : ndarray (N, k, m)
        By the numbers of each row.
    columns : ndarray of int (P, m)
        Which parameters these are, of each part.
    part_of : ndarray of int (N,)
        The part of each row.
    size : int
        How many parameters there are.
    """
    if columns.shape == (1, size) and columns[0].tolist() == list(range(size)):
        return derivative
    rows, k, _ = derivative.shape
    whole = np.zeros((rows, k, size))
    for part, column in enumerate(columns):
        there = np.flatnonzero(column != NONE)
        if len(columns) == 1:
            whole[:, :, column[there]] = derivative[:, :, there]
        else:
            mine = np.flatnonzero(part_of == part)[:, None, None]
            every = np.arange(k)[:, None]
            whole[mine, every, column[there]] = derivative[mine, every, there]
    return whole


def set_names(
    sets: Sequence[Measurements], taken: Collection[str] = (), word: str = ""
) -> list[str]:
    """A name for each set: its session, else its file; `word` and a number if two are alike.

    `taken` are names of others.
    """
    found = []
    for measured in sets:
        alone = measured.sessions[0] if len(measured.sessions) == 1 else ""
        found.append(alone or " ".join(PurePath(measured.file).stem.replace("@", " ").split()))
    if all(found) and len(set(found)) == len(found) and not {*found} & {*taken}:
        return found
    numbered = itertools.chain([word] * bool(word), (f"{word}{k}" for k in itertools.count(1)))
    return list(itertools.islice((name for name in numbered if name not in taken), len(sets)))


def in_sessions(
    sets: Sequence[Measurements], beside: Collection[str] = (), word: str = ""
) -> list[Measurements]:
    """Return measurements with a session in every row; an unnamed one is named after its set.

    `beside` are names of other sessions; names that are made consist of `word` and a number.
    """
    unnamed = [measured for measured in sets if measured.session is None]
    taken = {name for measured in sets for name in measured.sessions} | {*beside}
    names = iter(set_names(unnamed, taken, word))
    return [
        replace(measured, session=np.full(len(measured), next(names)))
        if measured.session is None
        else measured
        for measured in sets
    ]


def scopes(
    names: Sequence[str],
    blocks: Mapping[tuple[str, str], slice],
    per_session: Sequence[str],
    by_set: frozenset[str],
) -> list[Scope]:
    """Return the scope of each number of a row: common, of a session or of a set.

    `blocks` are what belongs together, by role and name: the frame, each point. `per_session` are
    names or wildcards of what each session has for itself, `by_set` roles that each set has.

    Raises
    ------
    ValueError
        A pattern that matches nothing, or a part of a frame or point; a frame of both.
    """
    found: list[Scope] = ["common"] * len(names)
    for pattern in per_session:
        hits = [i for i, name in enumerate(names) if fnmatchcase(name, pattern)]
        if not hits:
            raise ArgumentError(
                f"per_session: no free parameter matches {pattern!r}{did_you_mean(pattern, names)}"
            )
        for i in hits:
            found[i] = "session"
    for (role, _), block in blocks.items():
        own = found[block]
        if "session" in own and "common" in own:
            whole = names[block.start].partition(".")[0]
            raise ArgumentError(
                f"per_session: the numbers of {whole} are found anew together: '{whole}.*'"
            )
        if role in by_set:
            if "session" in own:
                raise ArgumentError(
                    f"{role}: one for each set, or per_session one for each session, not both"
                )
            found[block] = ["set"] * len(own)
    return found


def matches(pattern: str, name: str) -> bool:
    """Return whether a name or wildcard means a parameter, with or without its session."""
    return fnmatchcase(name, pattern) or fnmatchcase(name.partition("@")[0], pattern)


def label(scope: Scope, session: str, set_name: str) -> str:
    """Return the label behind the @ of a number's name in rows of a session and set."""
    known: Mapping[Scope, str] = {"common": "", "session": session, "set": set_name}
    return known[scope]
