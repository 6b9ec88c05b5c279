"""A limb of another kind beside chains: the row of joints that it is.

Where a machine has a chain, all its limbs are solved as chains, and a leg UPS is read as if its
joints U, P and S had been listed. Actuators read the same as in a machine of such limbs alone. A
chain closes at home by construction; a limb of another kind must be so placed that it does.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.core.library import AXES, MAPS, SLOTS
from pkmcal.core.machine import Machine
from pkmcal.files.toml_table import Table
from pkmcal.geometry.chain_joints import Joint, across
from pkmcal.geometry.limb_kinds import KINDS
from pkmcal.geometry.limbs import Cone, Limb
from pkmcal.geometry.robot_file_limbs import Entry, Parameters, read_limb
from pkmcal.screw import from_pose

_OFF = 1e-6  # of its length: what a limb may miss at home, and a direction in the plane
_ROWS = ("base_plane", "platform_plane", "couple", "hinge_plane")  # that joints are known for
_Z = np.array([0.0, 0.0, 1.0])


class _Home(NamedTuple):
    """A limb at home: its points and directions in the base frame, and its q̃."""

    base: FloatArray
    anchor: FloatArray
    tip: FloatArray
    drive: float
    axes: dict[str, FloatArray]  # of each axis of the core that it has


def joints_of_kind(
    table: Table, parameters: Parameters, map: str, home: FloatArray
) -> tuple[tuple[Joint, ...], dict[str, float]]:
    """Joints from base to platform of a limb that is no chain, and its numbers by name.

    `home` is the platform's pose (6,). Names under ``[parameters]`` stand for their values.
    """
    named = KINDS.get(name) if isinstance(name := table.data.get("kind"), str) else None
    if named is not None and named.driver.bent:
        table.fail("kind", f"what a {name} takes up is no joint: it does not go beside chains")
    limb, entries, of_law = read_limb(table, table.integer("actuator", 1) - 1, parameters)
    if "actuator" not in table:
        table.fail("", "the key 'actuator' is missing: beside chains every limb states its own")
    if any(weight != 1.0 for weight in limb.weights):
        table.fail("weights", "beside chains joints yield by their `soft`: list this limb's joints")
    parameters.constants.update(parameters.units)
    kind, number = KINDS[limb.kind], limb.actuator + 1
    beside = set(kind.all_rows(limb.couple > 0.0))
    known = kind.driver.jointed and beside <= set(_ROWS)
    if map == "spherical" or not known or (map == "planar" and beside):
        table.fail("kind", f"with the map {map}, list the joints of a limb {limb.kind} as a chain")
    at = _at_home(table, limb, entries, home)
    if map == "planar":
        _check_plane(table, limb, at)
    values = {f"offset{number}": entries["offset"].value, f"gain{number}": entries["gain"].value}
    values |= {law.name: entry.value for law, entry in of_law}
    joints = _joints(limb, at, beside, map)
    return _with_cones(table, limb, joints, from_pose(home)[:3, :3]), values


def _at_home(table: Table, limb: Limb, entries: dict[str, Entry], home: FloatArray) -> _Home:
    """Return the limb with the platform at home; refuse it where it does not get there."""
    numbers = np.array([entries[slot].value if slot in entries else 0.0 for slot in SLOTS])
    value = dict(zip(SLOTS, numbers, strict=True))
    still = numbers.copy()
    still[[SLOTS.index("offset"), SLOTS.index("gain")]] = 0.0, 1.0
    alone = limb.for_core()
    count = len(MAPS["spatial"])  # as many of them as hold a platform
    slots = np.tile(still, (count, 1))
    limbs = [alone | {"actuator": i} for i in range(count)]
    machine = Machine("spatial", limbs, 1.0 + float(np.abs(still).max()), slots, home)
    own = np.ascontiguousarray(home[None])
    drive, along, _ = machine.limbs(slots, own)
    if not np.isfinite(drive).all():
        table.fail("", f"the limb {limb.kind} does not reach the home pose")
    missed = machine.closure(slots, own, machine.inverse(slots, own)).residual
    base = numbers[:3]
    T = from_pose(home)
    tip = T[:3, :3] @ numbers[3:6] + T[:3, 3]
    kind = KINDS[limb.kind]
    length = float(drive[0, 0]) if not kind.driver.carries else value["rod"]
    worst = float(np.abs(missed).max())
    if worst > _OFF * max(length, limb.couple):
        table.fail(
            "",
            f"at home the limb {limb.kind} misses its closures by {worst:.3g} mm: beside chains"
            " its axes and points must allow the home pose",
        )
    axes = {}
    for axis in kind.axes_of(limb.couple > 0.0):
        first, second = (value[slot] for slot in AXES[axis])
        tilted = from_pose(np.array([0.0, 0.0, 0.0, -first, -second, 0.0]))[:3, :3].T
        axes[axis] = (limb.frames[axis] @ tilted)[:, 2]
        if axis == "platform":
            axes[axis] = T[:3, :3] @ axes[axis]
    anchor = base if not kind.driver.carries else tip - length * along[0, 0]
    return _Home(base, anchor, tip, float(drive[0, 0]), axes)


def _check_plane(table: Table, limb: Limb, at: _Home) -> None:
    """Check that limbs of a plane machine move in it: chains know nothing beside it."""
    driver = KINDS[limb.kind].driver
    if driver.turns:
        out = float(np.linalg.norm(at.axes["base"][:2]))
        key, what = "axis", "must be along z"
    else:
        way = at.axes["base"] if driver.slides else at.tip - at.base
        out = abs(float(way[2])) / float(np.linalg.norm(way))
        key, what = ("slider", "must be") if driver.slides else ("", "its joints must be")
        what += " at right angles to z"
    if out > _OFF:
        table.fail(key, f"{what}: with the map planar, beside chains, limbs move in the plane")


def _joints(limb: Limb, at: _Home, beside: set[str], map: str) -> tuple[Joint, ...]:
    driver = KINDS[limb.kind].driver
    way = (at.tip - at.anchor) / np.linalg.norm(at.tip - at.anchor)
    slides = not driver.turns
    along = at.axes["base"] if driver.carries else way
    actuated = Joint(
        "P" if slides else "R",
        at.base,
        (along,),
        limb.actuator,
        home_value=at.drive,
        stroke=limb.stroke,
        law=limb.law,
    )
    if map == "planar":
        swings, last = Joint("R", at.anchor, (_Z,)), Joint("R", at.tip, (_Z,))
    else:
        swings, last = Joint("U", at.anchor, across(way)), Joint("S", at.tip, ())
        if "base_plane" in beside:
            swings = Joint("R", at.anchor, (at.axes["base"],))
        elif "hinge_plane" in beside:
            swings = Joint("R", at.anchor, (at.axes["hinge"],))
        elif "couple" in beside:
            swings = Joint("U", at.anchor, (at.axes["base"], at.axes["platform"]))
        elif "platform_plane" in beside:
            swings = Joint("S", at.anchor, ())
        if "platform_plane" in beside:
            last = Joint("R", at.tip, (at.axes["platform"],))
    before = (actuated, swings) if driver.carries else (swings, actuated)
    return (*before, last)


def _with_cones(
    table: Table, limb: Limb, joints: tuple[Joint, ...], turned: FloatArray
) -> tuple[Joint, ...]:
    """The joints with the cones of the limb; `turned` is how the platform is at home."""
    found = list(joints)
    swings = next(k for k, joint in enumerate(joints) if joint.actuator is None)
    for key, k, cone in (
        ("base_cone", swings, limb.base_cone),
        ("platform_cone", len(joints) - 1, limb.platform_cone),
    ):
        if cone is None:
            continue
        on_crank = key == "base_cone" and KINDS[limb.kind].driver.turns
        if joints[k].kind not in "US" or on_crank:
            table.fail(key, f"list the joints of this limb as a chain: its {joints[k].kind} has it")
        found[k] = _with_cone(joints[k], cone, np.eye(3) if key == "base_cone" else turned)
    return tuple(found)


def _with_cone(joint: Joint, cone: Cone, turned: FloatArray) -> Joint:
    return Joint(joint.kind, joint.at, joint.axes, cone=cone.angle, cone_axis=turned @ cone.axis)
