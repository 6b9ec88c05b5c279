"""Strokes and cones of the joints of chains, at poses: `pkmcal.kinematics.limits` of any joint."""

from __future__ import annotations

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.core.chains import ChainMachine
from pkmcal.geometry.chain_joints import PARTS, Joint, towards
from pkmcal.geometry.chains import Chains
from pkmcal.kinematics.limits import Feasibility, kept, margin_of
from pkmcal.screw import from_pose


def feasibility(
    chains: Chains, machine: ChainMachine, slots: FloatArray, own: FloatArray, q: FloatArray
) -> Feasibility:
    """Compare the joints at N poses with their limits.

    Parameters
    ----------
    chains : Chains
        The joints.
    machine : ChainMachine
        The machine in the core.
    slots : ndarray (1, numbers)
        Geometry.
    own, q : ndarray (N, 6), (N, n)
        Poses and coordinates; NaN out of reach.
    """
    passive, frames = machine.frames(slots, own, q)
    drive = machine.drives(slots, q)
    shape = (len(own), len(chains.limbs) + (chains.tail > 0))
    stroke, before, last = (np.full(shape, np.inf) for _ in range(3))
    in_stroke = np.ones(shape, dtype=bool)
    turned, platform = _turned(machine, frames), _platform(machine, own)
    for i, limb in enumerate(chains.limbs):
        at = 0
        for k, joint in enumerate(limb):
            column = len(chains.limbs) if k >= len(limb) - chains.tail else i
            count = 0 if joint.ball and joint is limb[-1] else joint.parts
            if joint.stroke is not None:
                value = _value(chains, machine, i, k, passive, drive)
                margin = margin_of(joint.stroke, value)
                stroke[:, column] = np.fmin(stroke[:, column], margin)
                in_stroke[:, column] &= kept(margin, joint.unit, chains.size) | np.isnan(margin)
            if joint.cone is not None:
                start = machine.layout.first[i] + i + at
                behind = turned[:, start + count] if count else platform
                bend = _bend(limb, k, turned[:, start], behind)
                where = last if joint is limb[-1] else before
                where[:, column] = np.fmin(where[:, column], joint.cone - bend)
            at += count
    reach = np.asarray(np.isfinite(q).all(axis=1) & np.isfinite(frames).all(axis=(1, 2)))
    first = np.array([_first_actuator(limb[: len(limb) - chains.tail]) for limb in chains.limbs])
    if chains.tail:
        first = np.append(first, machine.layout.tail)
    shown = np.where(first >= 0, drive[:, np.maximum(first, 0)], 0.0)
    return Feasibility(
        np.broadcast_to(reach[:, None], shape).copy(), in_stroke,
        kept(before, "rad", chains.size), kept(last, "rad", chains.size),
        np.where(reach[:, None], shown, np.nan), stroke, before, last, tail=chains.tail > 0,
    )  # fmt: skip


def _first_actuator(limb: tuple[Joint, ...]) -> int:
    return next((j.actuator for j in limb if j.actuator is not None), -1)


def _value(
    chains: Chains, machine: ChainMachine, i: int, k: int, passive: FloatArray, drive: FloatArray
) -> FloatArray:
    joint = chains.limbs[i][k]
    if joint.actuator is not None:
        return drive[:, joint.actuator]
    return passive[:, passive_coordinate(chains, i, k)]


def passive_coordinate(chains: Chains, i: int, k: int) -> int:
    """Return the passive coordinate of joint k of limb i, of its first part."""
    name = chains.name_of(i, k) + PARTS[0]
    return int(chains.layout.coordinate[list(chains.parts).index(name)])


def home_axes(machine: ChainMachine) -> FloatArray:
    """Axes at home of each frame that `ChainMachine.frames` gives, (frames, 3, 3)."""
    layout = machine.layout
    home = np.empty((len(layout.member) + len(layout.ball), 3, 3))
    for i, (first, end) in enumerate(zip(layout.first[:-1], layout.first[1:], strict=True)):
        home[first + i : end + i] = layout.axes[layout.member[first:end]]
        home[end + i] = np.eye(3) if layout.ball[i] else layout.home[:3, :3]
    return home


def _turned(machine: ChainMachine, frames: FloatArray) -> FloatArray:
    """Return rotations since home of the body before each joint, and of each end."""
    R = frames[..., :9].reshape(*frames.shape[:2], 3, 3)
    found: FloatArray = R @ home_axes(machine).swapaxes(1, 2)
    return found


def _platform(machine: ChainMachine, own: FloatArray) -> FloatArray:
    """Return the platform's rotation since home, (N, 3, 3)."""
    found: FloatArray = from_pose(np.nan_to_num(own))[:, :3, :3] @ machine.layout.home[:3, :3].T
    return found


def bend_direction(limb: tuple[Joint, ...], k: int) -> FloatArray:
    """Return the direction that a cone of joint k limits, at home: a U's normal, an S's limb."""
    joint = limb[k]
    if joint.kind == "U":
        direction = np.cross(joint.axes[0], joint.axes[1])
        normal: FloatArray = direction / np.linalg.norm(direction)
        return normal
    way = towards(limb, k)
    return np.array([0.0, 0.0, 1.0]) if way is None else way


def cone_axes(limb: tuple[Joint, ...], k: int) -> tuple[FloatArray, FloatArray]:
    """Return what a cone of joint k compares, at home: directions of the bodies on either side."""
    direction, middle = bend_direction(limb, k), limb[k].cone_axis
    if middle is None:
        return direction, direction
    return (direction, middle) if k == len(limb) - 1 else (middle, direction)


def _bend(limb: tuple[Joint, ...], k: int, before: FloatArray, after: FloatArray) -> FloatArray:
    """Return the angle of a joint from the middle of its cone, rad."""
    one, other = cone_axes(limb, k)
    a, b = before @ one, after @ other
    return np.asarray(np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), (a * b).sum(axis=-1)))
