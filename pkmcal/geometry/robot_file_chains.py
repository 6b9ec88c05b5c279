"""The ``[[limb]]`` tables of kind ``"chain"``: joints in a row, copies of limbs, shared joints."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.core.chains import (
    GROUPS,
    MAX_CHAIN,
)
from pkmcal.core.library import MAX_LIMBS
from pkmcal.files.toml_table import Table, shown
from pkmcal.geometry.chain_joints import KINDS, Joint, across, error_unit, towards
from pkmcal.geometry.chains import Chains
from pkmcal.geometry.laws import gain_unit
from pkmcal.geometry.limbs import CHAIN, Limb
from pkmcal.geometry.robot_file_chain_checks import check
from pkmcal.geometry.robot_file_chain_copies import Listed, copied
from pkmcal.geometry.robot_file_kind_joints import joints_of_kind
from pkmcal.geometry.robot_file_laws import read_law
from pkmcal.geometry.robot_file_limbs import PARAMETER_NAME, Parameters

LIMB_KEYS = ("kind", "copies", "about", "group", "joints", "errors")
JOINT_KEYS = (
    "kind", "at", "axis", "axes", "actuator", "share", "home_value", "stroke", "cone", "soft",
    "offset", "gain", "drive",
)  # fmt: skip
TAIL_KEYS = (*(key for key in JOINT_KEYS if key not in ("axes", "share", "cone", "soft")), "errors")
AXES = {"R": 1, "P": 1, "C": 1, "U": 2, "S": 3}
FORMS = {1: "one axis, `axis = [x, y, z]`", 2: "two `axes`", 3: "three `axes`, or none of a ball"}


def read_chains(
    tables: Sequence[Table],
    tail_tables: Sequence[Table],
    parameters: Parameters,
    map: str,
    home: FloatArray,
) -> tuple[Chains, dict[str, float]]:
    """Read every ``[[limb]]`` and ``[[tail]]`` table of a machine of chains.

    Its limbs, and its numbers by name.
    """
    if map not in GROUPS:
        known = ", ".join(GROUPS)
        tables[0].fail("kind", f"limbs that are chains go with the maps {known}, found {map}")
    known_joints: dict[str, Joint] = {}
    listed = [
        _limb(table, parameters, map, known_joints)
        if table.data.get("kind") == CHAIN
        else _of_kind(table, parameters, map, home)
        for table in tables
    ]
    limbs, numbers, owners = copied(listed)
    if len(limbs) > MAX_LIMBS:
        tables[-1].fail("", f"a robot has at most {MAX_LIMBS} limbs, with copies {len(limbs)}")
    tail, of_tail = read_tail(tail_tables, parameters, map, limbs)
    numbers += of_tail
    chains = Chains(map, home, tuple(limb + tail for limb in limbs), len(tail))
    check(owners, chains)
    values = {number.name: chains.blank.flat[number.place or 0] for number in chains.numbers}
    stated: set[str] = set()
    for name, value, table in numbers:
        if name not in values:
            table.fail("errors", f"{name!r} is no error of this limb")
        if name in stated and value != values[name]:
            table.fail("", f"{name} is {value:g} here and {values[name]:g} in a limb before")
        values[name] = value
        stated.add(name)
    return chains, {name: float(value) for name, value in values.items()}


def chain_limbs(chains: Chains) -> tuple[Limb, ...]:
    """The limbs as the model has them: what of a chain is that of any limb."""
    made = []
    for limb, actuator in zip(chains.limbs, chains.first_drives, strict=True):
        stroke = next((joint.stroke for joint in limb if joint.actuator == actuator), None)
        made.append(Limb(CHAIN, actuator, 0, {}, stroke=stroke))
    return tuple(made)


def _limb(table: Table, parameters: Parameters, map: str, known: dict[str, Joint]) -> Listed:
    table.only(LIMB_KEYS, "a chain")
    listed = table.tables("joints", "a chain")
    joints: list[Joint] = []
    values: dict[str, float] = {}
    for k, each in enumerate(listed):
        share = _share(each)
        if share and any(joint.share == share for joint in joints):
            each.fail("share", f"{share!r} is a joint of this limb already")
        if share in known and set(each.data) == {"share"}:
            joints.append(known[share])
            continue
        joint, of_drive = _with_drive(each, _joint(each, parameters, map, joints))
        joints.append(joint)
        for name, value in of_drive.items():
            if values.setdefault(name, value) != value:
                each.fail("", f"{name} is {value:g} here and {values[name]:g} in a joint before")
        if k + 1 > MAX_CHAIN:
            each.fail("", f"a chain has at most {MAX_CHAIN} axes")
    joints = [_with_axes(each, joints, k, map) for k, each in enumerate(listed)]
    if "soft" in listed[-1] and joints[-1].ball:  # the core takes it as 1
        listed[-1].fail("soft", "the ball that ends a limb is always 1: state the other joints'")
    for k, joint in enumerate(joints):
        if joint.share and not _alike(known.setdefault(joint.share, joint), joint):
            listed[k].fail("share", f"{joint.share!r} is another joint in a limb before")
        joints[k] = known.get(joint.share or "", joint)
    if "errors" in table:
        errors = table.table("errors")
        for name in errors.data:
            values[name] = errors.number(name, error_unit(name))
    copies = table.integer("copies", 1)
    if copies < 1:
        table.fail("copies", f"must be 1 or more, found {copies}")
    if copies > MAX_LIMBS:  # before they are made
        table.fail("copies", f"a robot has at most {MAX_LIMBS} limbs, found {copies} copies")
    group = table.text("group") if "group" in table else ""
    return Listed(table, tuple(joints), values, copies, group, _about(table))


def read_tail(
    tables: Sequence[Table],
    parameters: Parameters,
    map: str,
    limbs: Sequence[tuple[Joint, ...]],
) -> tuple[tuple[Joint, ...], list[tuple[str, float, Table]]]:
    """Read the ``[[tail]]`` tables: joints behind the platform, and their numbers by name."""
    joints: list[Joint] = []
    numbers: list[tuple[str, float, Table]] = []
    first = 1 + max(
        (j.actuator for limb in limbs for j in limb if j.actuator is not None), default=-1
    )
    for k, table in enumerate(tables, 1):
        joint, of_drive = _with_drive(table, _joint(table, parameters, map, joints, TAIL_KEYS))
        joints.append(joint)
        if joint.actuator != first + k - 1:
            table.fail(
                "" if joint.actuator is None else "actuator",
                f"joints behind the platform are actuated, their actuators counted on from those of"
                f" the limbs: this one is {first + k}",
            )
        numbers += [(name, value, table) for name, value in of_drive.items()]
        errors = table.table("errors") if "errors" in table else Table({}, table.source)
        for error in errors.data:
            of_tool = error.startswith("tool.") and k == len(tables)
            name = error if of_tool else f"tail{k}.{error}"
            numbers.append((name, errors.number(error, error_unit(error)), table))
    return tuple(_with_axes(each, joints, k, map) for k, each in enumerate(tables)), numbers


def _of_kind(table: Table, parameters: Parameters, map: str, home: FloatArray) -> Listed:
    """A limb of another kind, as the chain that it is."""
    joints, values = joints_of_kind(table, parameters, map, home)
    return Listed(table, joints, values, 1, "", _about(Table({}, table.source)))


def _alike(a: Joint, b: Joint) -> bool:
    return all(np.array_equal(getattr(a, f.name), getattr(b, f.name)) for f in fields(Joint))


def _share(table: Table) -> str | None:
    if "share" not in table:
        return None
    share = table.text("share")
    if not PARAMETER_NAME.fullmatch(share) or share.startswith(("limb", "tail", "tool")):
        what = "letters, digits and _, not limb…, tail… or tool…"
        table.fail("share", f"{share!r} is no name of a joint: {what}")
    return share


def _joint(
    table: Table,
    parameters: Parameters,
    map: str,
    before: Sequence[Joint],
    keys: Sequence[str] = JOINT_KEYS,
) -> Joint:
    table.only(keys, "a joint")
    kind: Any = table.choice("kind", KINDS, "kind of joint")
    if "at" in table:
        at = _at(table, parameters, map)
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
    stroke = None
    if "stroke" in table:
        found = table.list_of("stroke", 2, "two numbers, the least and the greatest")
        low, high = (table.as_number("stroke", each, joint.unit) for each in found)
        if not low < high:
            table.fail("stroke", f"must rise, found {shown(list(found))}")
        if AXES[kind] > 1 or kind == "C":
            table.fail("stroke", f"a joint {kind} has several axes: give it a cone")
        stroke = (low, high)
    cone, cone_axis = _cone(table, kind)
    soft = table.number("soft", "1", 1.0)
    if not soft > 0.0:
        table.fail("soft", f"must be positive, found {shown(table['soft'])}")
    home_value = table.number("home_value", joint.unit, 0.0)
    return replace(
        joint, stroke=stroke, cone=cone, cone_axis=cone_axis, soft=soft, home_value=home_value
    )


def _cone(table: Table, kind: str) -> tuple[float | None, FloatArray | None]:
    """Return the bend of a U or an S, rad, and its zero direction; None: from home."""
    if "cone" not in table:
        return None, None
    axis: FloatArray | None = None
    if isinstance(table["cone"], Mapping):
        cone = table.table("cone")
        cone.only(("angle", "axis"), "a cone")
        angle, axis = cone.number("angle", "rad"), np.array(cone.vector("axis"))
    else:
        angle = table.number("cone", "rad")
    if kind not in "US" or not 0.0 < angle <= math.pi:
        table.fail("cone", "is how far a U or an S bends: above 0, at most half a turn")
    return angle, axis


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


def _at(table: Table, parameters: Parameters, map: str) -> FloatArray:
    """A point, cartesian or polar, in the plane without z; names of parameters are their values."""

    def value(of: Table, key: str, each: object, unit: Any) -> float:
        return parameters.constant(of, key, each, unit)

    given = table["at"]
    flat = map == "planar"
    if isinstance(given, list) and len(given) in ((2, 3) if flat else (3,)):
        return np.array(
            [value(table, "at", each, "mm") for each in given] + [0.0] * (3 - len(given))
        )
    if not isinstance(given, Mapping):
        form = "[x, y, z] or { radius = ..., angle = ..., z = ... }"
        form = "[x, y] or { radius = ..., angle = ... }" if flat else form
        table.fail("at", f"a point is {form}, found {shown(given)}")
    polar = table.table("at")
    polar.only(("radius", "angle", "z"), "a polar point")
    radius = value(polar, "radius", polar["radius"], "mm")
    angle = value(polar, "angle", polar["angle"], "rad")
    height = 0.0 if flat and "z" not in polar else value(polar, "z", polar["z"], "mm")
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
