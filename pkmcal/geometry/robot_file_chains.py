"""The ``[[limb]]`` tables of kind ``"chain"``: joints in a row, copies of limbs, shared joints."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from typing import Any, NamedTuple

import numpy as np

from pkmcal.arrays import FloatArray, Unit
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
from pkmcal.geometry.chain_joints import ERRORS, KINDS, Joint, across, towards
from pkmcal.geometry.chains import Chains
from pkmcal.geometry.laws import gain_unit
from pkmcal.geometry.model import CHAIN, Limb
from pkmcal.geometry.robot_file_laws import read_law
from pkmcal.geometry.robot_file_limbs import PARAMETER_NAME, Parameters

LIMB_KEYS = ("kind", "copies", "about", "group", "joints", "errors")
JOINT_KEYS = (
    "kind", "at", "axis", "axes", "actuator", "share", "home_value", "stroke", "cone", "soft",
    "offset", "gain", "drive",
)  # fmt: skip
AXES = {"R": 1, "P": 1, "C": 1, "U": 2, "S": 3}
_DRIVEN = re.compile(r"(offset|gain|drive)(\d+)((?:\..*)?)")  # numbers of actuators
FORMS = {1: "one axis, `axis = [x, y, z]`", 2: "two `axes`", 3: "three `axes`, or none of a ball"}


class _Limb(NamedTuple):
    """A limb as it is listed, before it is copied."""

    table: Table
    joints: tuple[Joint, ...]
    values: dict[str, float]
    copies: int
    group: str
    turn: tuple[FloatArray, FloatArray]


def read_chains(
    tables: Sequence[Table], parameters: Parameters, map: str, home: FloatArray
) -> tuple[Chains, dict[str, float]]:
    """Read every ``[[limb]]`` table of a machine of chains: its limbs, and its numbers by name."""
    for table in tables:
        if table.data.get("kind") != CHAIN:
            table.fail("kind", "beside chains every limb is one: write it as its joints")
    if map not in GROUPS:
        known = ", ".join(GROUPS)
        tables[0].fail("kind", f"limbs that are chains go with the maps {known}, found {map}")
    known_joints: dict[str, Joint] = {}
    listed = [_limb(table, parameters, map, known_joints) for table in tables]
    limbs, numbers = _copied(listed)
    if len(limbs) > MAX_LIMBS:
        tables[-1].fail("", f"a robot has at most {MAX_LIMBS} limbs, with copies {len(limbs)}")
    chains = Chains(map, home, tuple(limbs))
    _check(tables, chains)
    values = {number.name: chains.blank.flat[number.place or 0] for number in chains.numbers}
    for name, value, table in numbers:
        if name not in values:
            table.fail("errors", f"{name!r} is no error of this limb")
        values[name] = value
    return chains, {name: float(value) for name, value in values.items()}


def chain_limbs(chains: Chains) -> tuple[Limb, ...]:
    """The limbs as the model has them: what of a chain is that of any limb."""
    made = []
    for limb in chains.limbs:
        driven = [joint for joint in limb if joint.actuator is not None]
        actuator = driven[0].actuator if driven else None
        stroke = driven[0].stroke if driven else None
        made.append(Limb(CHAIN, -1 if actuator is None else actuator, 0, {}, stroke=stroke))
    return tuple(made)


def _limb(table: Table, parameters: Parameters, map: str, known: dict[str, Joint]) -> _Limb:
    table.only(LIMB_KEYS, "a chain")
    listed = table.tables("joints", "a chain")
    joints: list[Joint] = []
    values: dict[str, float] = {}
    for k, each in enumerate(listed):
        share = _share(each)
        if share in known and set(each.data) == {"share"}:
            joints.append(known[share])
            continue
        joint, of_drive = _with_drive(each, _joint(each, parameters, map, joints))
        joints.append(joint)
        values |= of_drive
        if k + 1 > MAX_CHAIN:
            each.fail("", f"a chain has at most {MAX_CHAIN} axes")
    joints = [_with_axes(each, joints, k, map) for k, each in enumerate(listed)]
    for k, joint in enumerate(joints):
        if joint.share and not _alike(known.setdefault(joint.share, joint), joint):
            listed[k].fail("share", f"{joint.share!r} is another joint in a limb before")
        joints[k] = known.get(joint.share or "", joint)
    if "errors" in table:
        errors = table.table("errors")
        for name in errors.data:
            unit: Unit = "mm" if name.rpartition(".")[2] in ERRORS[:3] else "rad"
            values[name] = errors.number(name, unit)
    copies = table.integer("copies", 1)
    if copies < 1:
        table.fail("copies", f"must be 1 or more, found {copies}")
    group = table.text("group") if "group" in table else ""
    return _Limb(table, tuple(joints), values, copies, group, _about(table))


def _alike(a: Joint, b: Joint) -> bool:
    return all(np.array_equal(getattr(a, f.name), getattr(b, f.name)) for f in fields(Joint))


def _share(table: Table) -> str | None:
    if "share" not in table:
        return None
    share = table.text("share")
    if not PARAMETER_NAME.fullmatch(share) or share.startswith("limb"):
        table.fail("share", f"{share!r} is no name of a joint: letters, digits and _, not limb…")
    return share


def _joint(table: Table, parameters: Parameters, map: str, before: Sequence[Joint]) -> Joint:
    table.only(JOINT_KEYS, "a joint")
    kind: Any = table.choice("kind", KINDS, "kind of joint")
    if "at" in table:
        at = _at(table, parameters)
    elif before:
        at = before[-1].at
    elif map == "spherical":
        at = np.zeros(3)
    else:
        table.fail("", "the key 'at' is missing: where the first joint is")
    actuator = table.integer("actuator") - 1 if "actuator" in table else None
    if actuator is not None and actuator < 0:
        table.fail("actuator", f"actuators count from 1, found {actuator + 1}")
    if (actuator is not None and AXES[kind] > 1) or (actuator is not None and kind == "C"):
        table.fail("actuator", f"a joint {kind} has several axes: list the actuated one as R or P")
    joint = Joint(kind, at, (), actuator, _share(table))
    for key in ("home_value", "offset", "gain", "drive"):
        if key in table and actuator is None:
            table.fail(key, "only an actuated joint has this")
    stroke = cone = None
    if "stroke" in table:
        found = table.list_of("stroke", 2, "two numbers, the least and the greatest")
        low, high = (table.as_number("stroke", each, joint.unit) for each in found)
        if not low < high:
            table.fail("stroke", f"must rise, found {shown(list(found))}")
        if AXES[kind] > 1 or kind == "C":
            table.fail("stroke", f"a joint {kind} has several axes: give it a cone")
        stroke = (low, high)
    if "cone" in table:
        cone = table.number("cone", "rad")
        if kind not in "US" or not 0.0 < cone <= math.pi:
            table.fail("cone", "is how far a U or an S bends: above 0, at most half a turn")
    soft = table.number("soft", "1", 1.0)
    if not soft > 0.0:
        table.fail("soft", f"must be positive, found {shown(table['soft'])}")
    home_value = table.number("home_value", joint.unit, 0.0)
    return replace(joint, stroke=stroke, cone=cone, soft=soft, home_value=home_value)


def _with_drive(table: Table, joint: Joint) -> tuple[Joint, dict[str, float]]:
    """The joint with its drive law, and the numbers of its drive that are stated, by name."""
    if joint.actuator is None:
        return joint, {}
    number = joint.actuator + 1
    values: dict[str, float] = {}
    law, of_law = read_law(table, number, joint.unit, Table.as_number)
    for key, unit in (("offset", joint.unit), ("gain", gain_unit(law, joint.unit))):
        if key in table:
            values[f"{key}{number}"] = table.number(key, unit)
    if values.get(f"gain{number}") == 0.0:
        table.fail("gain", "must not be 0: the actuator would not move the limb")
    values |= {each.name: value for each, value in of_law}
    return replace(joint, law=law), values


def _with_axes(table: Table, joints: Sequence[Joint], k: int, map: str) -> Joint:
    """The joint with its axes: those given, or those that follow from the points."""
    joint = joints[k]
    if joint.axes or "kind" not in table:
        return joint
    count = AXES[joint.kind]
    if "axis" in table and (count > 1 or "axes" in table):
        table.fail("axis", f"a joint {joint.kind} has {FORMS[count]}")
    if "axis" in table:
        return replace(joint, axes=(np.array(table.vector("axis")),))
    if "axes" in table:
        if count == 1:
            table.fail("axes", f"a joint {joint.kind} has {FORMS[count]}")
        given = table.list_of("axes", count, f"{count} directions")
        source = Table({str(i): g for i, g in enumerate(given)}, table.source, table.path)
        axes = tuple(np.array(source.vector(str(i))) for i in range(count))
        spread = np.linalg.svd(np.array(axes), compute_uv=False)
        if spread[-1] < 1e-3:
            table.fail("axes", "must not lie on one line or in one plane")
        return replace(joint, axes=axes)
    if joint.kind == "S":
        return joint
    if map == "planar" and joint.kind == "R":
        return replace(joint, axes=(np.array([0.0, 0.0, 1.0]),))
    if joint.kind == "R" or joint.kind == "C":
        table.fail("", "the key 'axis' is missing")
    way = towards(tuple(joints), k)
    if way is None:
        table.fail("", "the key 'axis' is missing: no other joint of the limb says where it points")
    return replace(joint, axes=(way,) if joint.kind == "P" else across(way))


def _at(table: Table, parameters: Parameters) -> FloatArray:
    """A point, cartesian or polar; names of parameters stand for their values."""

    def value(of: Table, key: str, each: object, unit: Any) -> float:
        return parameters.constant(of, key, each, unit)

    given = table["at"]
    if isinstance(given, list) and len(given) == 3:
        return np.array([value(table, "at", each, "mm") for each in given])
    if not isinstance(given, Mapping):
        form = "[x, y, z] or { radius = ..., angle = ..., z = ... }"
        table.fail("at", f"a point is {form}, found {shown(given)}")
    polar = table.table("at")
    polar.only(("radius", "angle", "z"), "a polar point")
    radius = value(polar, "radius", polar["radius"], "mm")
    angle = value(polar, "angle", polar["angle"], "rad")
    height = value(polar, "z", polar["z"], "mm")
    return np.array([radius * math.cos(angle), radius * math.sin(angle), height])


def _about(table: Table) -> tuple[FloatArray, FloatArray]:
    """The axis that copies are turned about: its direction and a point."""
    if "about" not in table:
        return np.array([0.0, 0.0, 1.0]), np.zeros(3)
    about = table.table("about")
    about.only(("axis", "at"))
    point = about.list_of("at", 3, "a point of three numbers") if "at" in about else (0.0,) * 3
    return (
        np.array(about.vector("axis")),
        np.array([about.as_number("at", each, "mm") for each in point]),
    )


def _copied(listed: Sequence[_Limb]) -> tuple[list[tuple[Joint, ...]], list[Any]]:
    """Every limb with its copies, groups copied together; errors by their public names."""
    limbs: list[tuple[Joint, ...]] = []
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
                for name, value in listed[k].values.items():
                    numbers.append(
                        (
                            _named(name, len(limbs), listed[k], copy, copies, len(used)),
                            value,
                            listed[k].table,
                        )
                    )
    return limbs, numbers


def _named(name: str, limb: int, of: _Limb, copy: int, copies: int, used: int) -> str:
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
        R = _turned(turn[0], 2.0 * math.pi * copy / copies) if copy else np.eye(3)
        found = replace(
            joint,
            at=R @ (joint.at - turn[1]) + turn[1],
            axes=tuple(R @ axis for axis in joint.axes),
            actuator=None if joint.actuator is None else joint.actuator + copy * used,
            share=_share_name(joint.share, copy, copies) if joint.share else None,
        )
    if joint.share:
        shared[joint.share, copy] = found
    return found


def _turned(axis: FloatArray, angle: float) -> FloatArray:
    x, y, z = axis
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    found: FloatArray = np.eye(3) + math.sin(angle) * K + (1.0 - math.cos(angle)) * (K @ K)
    return found


def _check(tables: Sequence[Table], chains: Chains) -> None:
    """Refuse what the core cannot take, and actuators that are not counted on."""
    last = tables[-1]
    if chains.n_actuators < 1:
        last.fail("joints", "no joint has an actuator")
    used = {joint.actuator for limb in chains.limbs for joint in limb if joint.actuator is not None}
    units: dict[int, str] = {}
    for limb in chains.limbs:
        for joint in limb:
            if (
                joint.actuator is not None
                and units.setdefault(joint.actuator, joint.unit) != joint.unit
            ):
                last.fail(
                    "joints", f"actuator {joint.actuator + 1} turns one joint and slides another"
                )
    for a in range(chains.n_actuators):
        if a not in used:
            last.fail(
                "joints", f"found {chains.n_actuators} actuators, but no joint has actuator {a + 1}"
            )
    if chains.n_actuators > MAX_LIMBS:
        last.fail("joints", f"a machine has at most {MAX_LIMBS} actuators")
    if len(chains.parts) > MAX_JOINTS or chains.count > MAX_NUMBERS:
        last.fail("joints", f"a machine has at most {MAX_JOINTS} axes, found {len(chains.parts)}")
    layout = chains.layout
    if layout.shared > MAX_SHARED:
        last.fail("joints", f"limbs share at most {MAX_SHARED} passive axes, found {layout.shared}")
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
            last.fail(
                "joints",
                f"at home passive joints of limb {i + 1} can move while the platform stands still:"
                " write one S of a rod as a U, or take home away from a dead point of the limb",
            )
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
