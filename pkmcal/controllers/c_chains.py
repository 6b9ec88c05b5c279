"""The chains of a robot in a C header: joints, and motions from each to the next."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.controllers import c_source
from pkmcal.controllers.c_source import Number
from pkmcal.core.chains import GROUPS, ChainLayout, ChainMachine
from pkmcal.exceptions import ArgumentError
from pkmcal.kinematics.robot import Robot

_STEPS = 40  # of a chain alone, as the core takes
_CLOSES = {"spatial": range(6), "planar": (2, 3, 4), "spherical": range(3)}
_CALLED = ("arm_turned", "arm_slid", "motion_compose", "chain_turn", "chain_ball", "chain_closure")


def contents(robot: Robot, prefix: str, number: Number) -> tuple[dict[str, Any], list[str]]:
    """Fill the template for chains, and list the generated functions that it calls.

    Raises
    ------
    ArgumentError
        A machine with more closures than free coordinates, with joints behind its platform, or
        with joints by which one chain holds another.
    """
    machine, n = robot.machine, robot.n_actuators
    inner, slots, _ = machine.bare(robot.slots, np.zeros((1, n)))
    assert isinstance(inner, ChainMachine)
    layout, bare = inner.layout, slots.ravel()
    if machine.rows != machine.m:
        raise ArgumentError(
            f"robot: {robot.name} has {machine.rows} closures for {machine.m} free coordinates;"
            " a header holds chains with as many of both"
        )
    if layout.tail < len(layout.zero):
        raise ArgumentError(
            f"robot: {robot.name} has joints behind its platform; a header holds none"
        )
    if layout.shared or layout.loose:
        raise ArgumentError(
            f"robot: {robot.name} shares joints between chains; a header takes each chain alone"
        )
    one, several, whole = c_source.writers(number)
    wide = number == "double"
    size, passive = machine.struct.size, layout.passive
    joints, group = np.diff(layout.first), GROUPS[layout.map]
    of_joint = np.where(layout.actuator >= 0, passive + layout.actuator, layout.coordinate)
    values, members = passive + n, len(layout.member)
    turns = np.zeros(values, dtype=bool)
    turns[of_joint] = layout.prismatic == 0
    of_member = of_joint[layout.member]
    offset, gain = bare[layout.drive_place], bare[layout.drive_place + 1]
    links, points = _links(layout, bare)
    unknowns = max(machine.m + passive, 6)
    says = {
        "chains": len(joints),
        "over": False,
        "limbs": n,  # drives
        "members": members,
        "first": whole(layout.first),
        "ball": whole(layout.ball != 0),
        "all_balls": bool(layout.ball.all()),
        "point": [several(point) for point in points],
        "link": [several(link) for link in links],
        "value": whole(of_member),
        "values": values,
        "passive": passive,
        "turns": whole(turns),
        "times": several(np.bincount(of_member, minlength=values).astype(float)),
        "gain": several(gain),
        "shifts": several(offset - layout.zero),
        "near": several(layout.near - layout.zero),
        "turning": bool(turns[passive:].any()),
        "group": group,
        "closes": whole(_CLOSES[layout.map]),
        "most_joints": int(joints.max()),
        "unknowns": machine.m + passive,
        "arm": one(layout.length),
        # what a step leaves is its square by pivot and size
        "settled": one((1e-10 if wide else 2e-5) * size),
        "least_pivot": one(1e-6 if wide else 1e-4),
        "least_square": one(1e-12 if wide else 1e-6),
        "chain_steps": _STEPS,
        "chain_settled": one((5e-12 if wide else 2e-6) * size),
        "chain_closed": one((1e-9 if wide else 1e-5) * size),
        "calls": (_calls(layout), _calls(layout), unknowns),
    }
    return says, list(_CALLED)


def numbers(
    robot: Robot, texts: list[str], prefix: str, several: Callable[[Any], str]
) -> tuple[dict[str, Any], list[str]]:
    """None: functions of chains read the arrays that `contents` fills."""
    return {}, texts


def _links(layout: ChainLayout, numbers: FloatArray) -> tuple[list[FloatArray], list[FloatArray]]:
    """Return motions from each joint of a chain to the next, to its end, and to the ball.

    As ``prepare_chains`` of csrc/chain_system.h has them.
    """
    links, points = [], []
    for chain, ball in enumerate(layout.ball):
        axes, at = np.eye(3), np.zeros(3)
        for joint in layout.member[layout.first[chain] : layout.first[chain + 1]]:
            place = layout.place[joint]
            to, there = layout.axes[joint], layout.point[joint]
            links.append(_link(numbers[place : place + 6], axes, at, to, there))
            axes, at = to, there
        error = numbers[layout.end_place[chain] : layout.end_place[chain] + 6]
        if ball:
            rest = np.append(
                numbers[layout.ball_place[chain] : layout.ball_place[chain] + 3], np.zeros(3)
            )
            links.append(_link(rest, axes, at, np.eye(3), layout.end[chain]))
            off = layout.end[chain] + error[:3] - layout.home[:3, 3]
            points.append(layout.home[:3, :3].T @ off)
        else:
            given = {"e": error.tolist(), "r": layout.end[chain].tolist()}
            E, moved = c_source.evaluate("joint_error", given, ("R", "p"))
            turned = np.array(E).reshape(3, 3).T
            R = axes.T @ turned @ layout.home[:3, :3]
            p = axes.T @ (turned @ (layout.home[:3, 3] - moved) - at)
            links.append(np.append(R.ravel(), p))
            points.append(np.zeros(3))
    return links, points


def _link(
    error: FloatArray, axes: FloatArray, at: FloatArray, to: FloatArray, there: FloatArray
) -> FloatArray:
    """From one joint's frame to the next's, which has an error: rotation and displacement (12,)."""
    given = {"e": error.tolist(), "Qa": axes.ravel().tolist(), "ra": at.tolist()}
    given |= {"Q": to.ravel().tolist(), "r": there.tolist()}
    return np.concatenate(c_source.evaluate("arm_link", given, ("R", "p")))


def _calls(layout: ChainLayout) -> list[str]:
    """Return the calls for one step of every chain."""
    calls = []
    for chain, ball in enumerate(layout.ball):
        calls.append("chain_ball" if ball else "chain_closure")
        for joint in layout.member[layout.first[chain] : layout.first[chain + 1]]:
            calls += ["motion_compose"]
            slides = layout.prismatic[joint]
            calls += ["arm_slid"] if slides else ["sincos", "arm_turned", "chain_turn"]
    return calls
