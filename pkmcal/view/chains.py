"""Chains of joints as the page draws them and compares them with strokes and cones."""

from __future__ import annotations

from typing import Any

from pkmcal.arrays import FloatArray
from pkmcal.core.chains import ChainMachine
from pkmcal.geometry.chain_joints import Joint
from pkmcal.geometry.chains import Chains
from pkmcal.kinematics.chain_limits import cone_axes, home_axes, passive_coordinate
from pkmcal.kinematics.robot import Robot
from pkmcal.screw import from_pose


def strokes(chains: Chains, slots: FloatArray) -> list[tuple[float, float] | None]:
    """Return the limits of each actuator's coordinate."""
    place = chains.layout.drive_place
    offset, gain = slots.ravel()[place], slots.ravel()[place + 1]
    found: list[tuple[float, float] | None] = []
    for a, (_, joint) in enumerate(chains.actuated):
        if joint.stroke is None:
            found.append(None)
            continue
        low, high = sorted((end - offset[a]) / gain[a] for end in joint.stroke)
        found.append((float(low), float(high)))
    return found


def looks(
    robot: Robot, machine: ChainMachine, slots: FloatArray, moves: FloatArray
) -> dict[str, Any]:
    """Joints, limits and rails, limb by limb.

    A joint's `frame` is its place in what `chain_frames` of the core gives; axes and directions of
    cones are in the axes of such frames, so that they move along. `moves` (drives, 2) are the
    ends to which sliders take its drives.
    """
    chains = robot.model.chains
    assert chains is not None
    layout = machine.layout
    place = layout.drive_place
    offset, gain = slots.ravel()[place], slots.ravel()[place + 1]
    axes = home_axes(machine)
    platform = from_pose(robot.own_home)[:3, :3]
    limbs = []
    for i, limb in enumerate(chains.limbs):
        start, at, joints = int(layout.first[i]) + i, 0, []
        for k, joint in enumerate(limb):
            frame = start + at
            at += 0 if joint.ball and joint is limb[-1] else joint.parts
            behind = start + at if start + at != frame else None  # None: the platform
            seen: dict[str, Any] = {"kind": joint.kind, "frame": frame}
            if joint.kind in "RPC":
                seen["axis"] = (axes[frame].T @ joint.axes[0]).tolist()
            if joint.actuator is not None:
                seen["actuator"] = joint.actuator
            if joint.stroke is not None:
                seen["stroke"] = joint.stroke
                if joint.actuator is None:
                    seen["passive"] = passive_coordinate(chains, i, k)
            if joint.cone is not None:
                one, other = cone_axes(limb, k)
                after = platform if behind is None else axes[behind]
                seen["cone"] = {
                    "angle": joint.cone,
                    "after": behind,
                    "from": (axes[frame].T @ one).tolist(),
                    "to": (after.T @ other).tolist(),
                }
            if k == 0 and joint.kind == "P" and joint.actuator is not None:
                a = joint.actuator
                ends = gain[a] * moves[a] + offset[a] - layout.zero[a]
                seen["track"] = (joint.at + ends[:, None] * joint.axes[0]).round(3).tolist()
            joints.append(seen)
        base = limb[
            0
        ].at.tolist()  # of a joint that slides too: the carriage moves, the base does not
        limbs.append(
            {"kind": "chain", "joints": joints, "base": base, "end": _end(limb[-1], robot)}
        )
    drive = {"gain": gain.tolist(), "offset": offset.tolist()}
    frames = int(len(layout.member) + len(layout.ball))
    return {"limbs": limbs, "drive": drive, "frame_count": frames, "passive": layout.passive}


def _end(joint: Joint, robot: Robot) -> list[float]:
    """The last joint's point in the platform's axes; where it slides, the platform's origin."""
    if joint.kind == "P":
        return [0.0, 0.0, 0.0]
    home = from_pose(robot.own_home)
    found: list[float] = (home[:3, :3].T @ (joint.at - home[:3, 3])).tolist()
    return found
