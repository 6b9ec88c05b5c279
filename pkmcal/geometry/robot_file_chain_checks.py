"""Errors of chain files: joints that contradict each other, or too many of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NoReturn

import numpy as np

from pkmcal.core.chains import (
    GROUPS,
    MAX_CHAIN,
    MAX_CHAIN_ROWS,
    MAX_JOINTS,
    MAX_NUMBERS,
    MAX_SHARED,
)
from pkmcal.core.library import MAPS, MAX_LIMBS
from pkmcal.files.toml_table import Table, shown
from pkmcal.geometry.chain_joints import Joint, axes_along_rods
from pkmcal.geometry.chains import Chains

_ALONG = 1e-6  # sine of the angle between an axis and a rod that leaves the rod free to turn
_IN_PLANE = 1e-6  # what an axis may be out of the plane


def check(tables: Sequence[Table], chains: Chains) -> None:
    """Refuse what the core cannot take, and actuators that are not counted on.

    `tables` are those of each limb.
    """
    last = tables[-1]
    _check_actuators(last, chains)
    if len(chains.parts) > MAX_JOINTS or chains.count > MAX_NUMBERS:
        last.fail("joints", f"a machine has at most {MAX_JOINTS} axes, found {len(chains.parts)}")
    layout = chains.layout
    if layout.shared > MAX_SHARED:
        last.fail("joints", f"limbs share at most {MAX_SHARED} passive axes, found {layout.shared}")
    _check_group(last, chains)
    group = GROUPS[chains.map]
    for i, (names, limb) in enumerate(zip(chains.members, chains.limbs, strict=True)):
        ball = limb[-1].ball
        if not 1 <= len(names) <= MAX_CHAIN:
            last.fail(
                "joints", f"limb {i + 1} has {len(names)} axes, 1 to {MAX_CHAIN} are possible"
            )
        if ball and group != 6:
            last.fail("joints", f"limb {i + 1}: a ball is no joint of the map {chains.map}")
        if chains.dependent(i):
            _fail_dependent(tables[i], chains, i)
    if layout.rows > MAX_CHAIN_ROWS:
        last.fail(
            "joints", f"the limbs close {layout.rows} rows, at most {MAX_CHAIN_ROWS} are possible"
        )
    need = len(MAPS[chains.map]) + layout.shared
    if layout.rows < need:
        n = chains.n_actuators
        last.fail(
            "joints",
            f"{n} actuator{'s' * (n > 1)}, {n + need - layout.rows} ways to move: the limbs leave"
            f" {layout.rows} closures for {need} unknowns with the actuators held",
        )


def _check_actuators(last: Table, chains: Chains) -> None:
    """Refuse actuators that no joint has, and joints of one actuator that differ."""
    if chains.n_actuators < 1:
        last.fail("joints", "no joint has an actuator")
    first: dict[int, Joint] = {}
    for joint in (joint for limb in chains.limbs for joint in limb):
        if joint.actuator is not None:
            one = first.setdefault(joint.actuator, joint)
            _check_alike(last, joint.actuator + 1, one, joint)
    for a in range(chains.n_actuators):
        if a not in first:
            last.fail(
                "joints", f"found {chains.n_actuators} actuators, but no joint has actuator {a + 1}"
            )
    if chains.n_actuators > MAX_LIMBS:
        last.fail("joints", f"a machine has at most {MAX_LIMBS} actuators")


def _fail_dependent(table: Table, chains: Chains, i: int) -> NoReturn:
    """Refuse a limb whose passive joints do not follow from the pose of the platform alone."""
    limb = chains.limbs[i]
    along = [
        f"the {ordinal} axis of the U {chains.name_of(i, k)} lies along its rod, which it turns"
        " about itself: give that U two axes across the rod"
        for k, ordinal in axes_along_rods(limb, _ALONG)
    ]
    remedy = "take home away from a dead point of the limb"
    if sum(joint.kind == "S" for joint in limb) > 1:
        remedy = "write one S of a rod as a U, or " + remedy
    if any(joint.share is not None and joint.actuator is None for joint in limb):
        remedy += (
            "; every limb must be determined by itself: that another limb shares a joint and"
            " determines it is not enough"
        )
    table.fail(
        "joints",
        f"at home passive joints of limb {i + 1} can move while the platform stands still:"
        f" {'; '.join(along) or remedy}",
    )


def _check_alike(table: Table, number: int, one: Joint, other: Joint) -> None:
    """Refuse two joints of one actuator that it would have to move differently."""
    if one.unit != other.unit:
        table.fail("joints", f"actuator {number} turns one joint and slides another")
    if abs(one.home_value - other.home_value) > 1e-9 * (1.0 + abs(one.home_value)):
        values = f"{one.home_value:g} in one limb and {other.home_value:g} in another"
        table.fail("joints", f"actuator {number} reads at home {values}")
    if one.law != other.law:
        table.fail("joints", f"actuator {number} has two drive laws: one for all its joints")


def _check_group(table: Table, chains: Chains) -> None:
    """Refuse joints that move what they carry out of the plane, or away from the point."""
    for i, limb in enumerate(chains.limbs):
        for k, joint in enumerate(limb):
            out = _out_of_group(joint, chains.map)
            if out:
                table.fail("joints", f"{chains.name_of(i, k)}: with the map {chains.map}, {out}")


def _out_of_group(joint: Joint, map: str) -> str:
    if map == "spherical" and joint.kind in "PC":
        return f"nothing slides, found a joint {joint.kind}"
    if map == "planar":
        if joint.kind not in "RP":
            return f"joints are R and P, found {joint.kind}"
        axis = joint.axes[0] / np.linalg.norm(joint.axes[0])
        if joint.kind == "R" and np.linalg.norm(axis[:2]) > _IN_PLANE:
            return f"joints turn about z, found the axis {shown(joint.axes[0].tolist())}"
        if joint.kind == "P" and abs(axis[2]) > _IN_PLANE:
            return f"joints slide across z, found the axis {shown(joint.axes[0].tolist())}"
    return ""
