"""Copies of chains that a robot file lists once: turned, their actuators counted on."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

from pkmcal.arrays import FloatArray
from pkmcal.files.toml_table import Table
from pkmcal.geometry.chain_joints import Joint
from pkmcal.screw import exp

_DRIVEN = re.compile(r"(offset|gain|drive)(\d+)((?:\..*)?)")  # numbers of actuators


class Listed(NamedTuple):
    """A limb as it is listed, before it is copied."""

    table: Table
    joints: tuple[Joint, ...]
    values: dict[str, float]
    copies: int
    group: str
    turn: tuple[FloatArray, FloatArray]


def copied(
    listed: Sequence[Listed],
) -> tuple[list[tuple[Joint, ...]], list[Any], list[Table]]:
    """Every limb with its copies, groups copied together; errors by their public names; tables.

    The tables are those of each limb.
    """
    limbs: list[tuple[Joint, ...]] = []
    owners: list[Table] = []
    numbers: list[tuple[str, float, Table]] = []
    done: set[int] = set()
    for i, limb in enumerate(listed):
        if i in done:
            continue
        mine = [
            k
            for k, other in enumerate(listed)
            if k == i or (limb.group and other.group == limb.group)
        ]
        done.update(mine)
        copies = max(listed[k].copies for k in mine)
        for k in mine:
            if listed[k].copies not in (1, copies):
                listed[k].table.fail("copies", f"the group {limb.group!r} has {copies} copies")
        used = sorted(
            {j.actuator for k in mine for j in listed[k].joints if j.actuator is not None}
        )
        shared: dict[tuple[str, int], Joint] = {}
        for copy in range(copies):
            for k in mine:
                made = tuple(
                    _copy(joint, copy, copies, len(used), listed[mine[0]].turn, shared)
                    for joint in listed[k].joints
                )
                limbs.append(made)
                owners.append(listed[k].table)
                for name, value in listed[k].values.items():
                    numbers.append(
                        (
                            _named(name, len(limbs), listed[k], copy, copies, len(used)),
                            value,
                            listed[k].table,
                        )
                    )
    return limbs, numbers, owners


def _named(name: str, limb: int, of: Listed, copy: int, copies: int, used: int) -> str:
    if driven := _DRIVEN.fullmatch(name):
        return f"{driven[1]}{int(driven[2]) + copy * used}{driven[3]}"
    head, _, error = name.partition(".")
    for k, joint in enumerate(of.joints, 1):
        for suffix in ("", "b", "c"):
            if head == f"joint{k}{suffix}" and joint.share:
                return f"{_share_name(joint.share, copy, copies)}{suffix}.{error}"
    return f"limb{limb}.{name}"


def _share_name(share: str, copy: int, copies: int) -> str:
    return share if copies == 1 else f"{share}{copy + 1}"


def _copy(
    joint: Joint,
    copy: int,
    copies: int,
    used: int,
    turn: tuple[FloatArray, FloatArray],
    shared: dict[tuple[str, int], Joint],
) -> Joint:
    if joint.share and (joint.share, copy) in shared:
        return shared[joint.share, copy]
    found = joint
    if copies > 1:
        R = exp([*(2.0 * math.pi * copy / copies * turn[0]), 0.0, 0.0, 0.0])[:3, :3]
        found = replace(
            joint,
            at=R @ (joint.at - turn[1]) + turn[1],
            axes=tuple(R @ axis for axis in joint.axes),
            cone_axis=None if joint.cone_axis is None else R @ joint.cone_axis,
            actuator=None if joint.actuator is None else joint.actuator + copy * used,
            share=_share_name(joint.share, copy, copies) if joint.share else None,
        )
    if joint.share:
        shared[joint.share, copy] = found
    return found
