"""The ``[[limb]]`` tables of chains: every limb on its own, errors that are not 0 by name."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from pkmcal.geometry.chain_joints import PARTS, Joint
from pkmcal.geometry.chains import Chains
from pkmcal.geometry.geometry import Geometry
from pkmcal.geometry.limbs import CHAIN
from pkmcal.geometry.robot_file_laws import law_table


def chain_tables(chains: Chains, geometry: Geometry) -> Iterator[dict[str, Any]]:
    """The tables of all limbs, as `robot_file_chains.read_chains` reads them back."""
    said: set[str] = set()
    for i, limb in enumerate(chains.limbs):
        errors: dict[str, float] = {}
        joints = []
        for k, joint in enumerate(limb[: len(limb) - chains.tail], 1):
            if joint.share in said:
                joints.append({"share": joint.share})
                continue
            joints.append(_joint(joint, geometry))
            name = joint.share or f"limb{i + 1}.joint{k}"
            for suffix in PARTS:
                errors |= _errors(geometry, f"{name}{suffix}.", f"joint{k}{suffix}.")
            if joint.share:
                said.add(joint.share)
        for end in ("platform", "tail"):
            errors |= _errors(geometry, f"limb{i + 1}.{end}.", f"{end}.")
        table: dict[str, Any] = {"kind": CHAIN, "joints": joints}
        yield table | ({"errors": errors} if errors else {})


def tail_tables(chains: Chains, geometry: Geometry) -> Iterator[dict[str, Any]]:
    """The ``[[tail]]`` tables, as `robot_file_chains.read_tail` reads them back."""
    for k in range(1, chains.tail + 1):
        errors = _errors(geometry, f"tail{k}.", "")
        if k == chains.tail:
            errors |= _errors(geometry, "tool.", "tool.")
        table = _joint(chains.limbs[0][k - chains.tail - 1], geometry)
        yield table | ({"errors": errors} if errors else {})


def _errors(geometry: Geometry, name: str, key: str) -> dict[str, float]:
    found = {}
    for number in geometry.numbers:
        if number.name.startswith(name) and geometry[number.name] != 0.0:
            found[key + number.name[len(name) :]] = geometry[number.name]
    return found


def _joint(joint: Joint, geometry: Geometry) -> dict[str, Any]:
    data: dict[str, Any] = {"kind": joint.kind, "at": joint.at.tolist()}
    if joint.share:
        data["share"] = joint.share
    if len(joint.axes) == 1:
        data["axis"] = joint.axes[0].tolist()
    elif joint.axes:
        data["axes"] = [axis.tolist() for axis in joint.axes]
    if joint.actuator is not None:
        data["actuator"] = joint.actuator + 1
        data["home_value"] = joint.home_value
        data["offset"] = geometry[f"offset{joint.actuator + 1}"]
        data["gain"] = geometry[f"gain{joint.actuator + 1}"]
    if joint.law is not None:
        start = f"drive{(joint.actuator or 0) + 1}."
        data["drive"] = law_table(joint.law, joint.unit, lambda name: geometry[start + name])
    if joint.stroke is not None:
        data["stroke"] = list(joint.stroke)
    if joint.cone is not None:
        axis = joint.cone_axis
        data["cone"] = joint.cone if axis is None else {"angle": joint.cone, "axis": axis.tolist()}
    if joint.soft != 1.0:
        data["soft"] = joint.soft
    return data
