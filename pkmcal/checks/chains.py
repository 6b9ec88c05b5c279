"""Mistakes in files of chains: too few actuators, home values, limits."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.checks.finding import Finding, named
from pkmcal.checks.function import outside_workspace, singular, turning
from pkmcal.geometry.chain_joints import Joint, axes_along_rods
from pkmcal.geometry.chains import Chains
from pkmcal.kinematics import pose_steps
from pkmcal.kinematics.robot import Robot

_NONE = 1e-7  # of the largest: a singular value that is none
_NEAR = 0.1  # of the distance: a home value that is meant to be it
_EXACT = 1e-3  # mm
_AXIS = 0.02  # entries of a direction that are shown as 0
_TURNS = 4 * np.pi  # rad: no joint of a limb turns further


def mobility(robot: Robot) -> Iterator[Finding]:
    """Machines whose platform moves though the actuators are held, near home too."""
    away = _away(robot)
    ways = [_free_ways(robot, own, q) for own, q in (_home(robot), away)]
    free = min(ways, key=len)  # home may be special
    if not len(free):
        return
    n = robot.n_actuators
    yield Finding(
        "mobility",
        (),
        f"{n} actuators, {n + len(free)} ways to move: with the actuators held the platform still"
        f" {' and '.join(_named_motion(robot, twist) for twist in free)}",
        "give an actuator to one more joint, or take a passive joint out of a limb",
    )


def home_values(robot: Robot) -> Iterator[Finding]:
    """Home values that are nearly the distance of the joints beside them."""
    for i, joint in _chains(robot).actuated:
        limb = _chains(robot).limbs[i]
        k = limb.index(joint)
        if joint.unit != "mm" or not 0 < k < len(limb) - 1 or joint.home_value == 0.0:
            continue
        apart = float(np.linalg.norm(limb[k + 1].at - limb[k - 1].at))
        off = abs(joint.home_value - apart)
        if _EXACT < off < _NEAR * apart:
            yield Finding(
                "home",
                (i + 1,),
                f"at home actuator {(joint.actuator or 0) + 1} reads {joint.home_value:.6g} mm, but"
                f" the joints beside it are {apart:.6g} mm apart",
                "check home_value, the joints' points and the home pose",
            )


def strokes(robot: Robot) -> Iterator[Finding]:
    """Home beyond a stroke or a cone."""
    home = robot.feasible(robot.home)
    for name in ("stroke", "base_cone", "platform_cone"):
        found = np.flatnonzero(~getattr(home, name))
        limbs = [int(i) for i in found if not home.is_tail(int(i))]
        who = [named(limbs)] if limbs else []
        who += ["the tail"] if len(found) > len(limbs) else []
        if who:
            yield Finding(
                "stroke",
                tuple(i + 1 for i in limbs),
                f"at home {' and '.join(who)} breaks a {name.replace('_', ' ')}",
                "check the limits of its joints, the home values and the home pose",
            )


def stroke_units(robot: Robot) -> Iterator[Finding]:
    """Strokes of turning joints that run far beyond a turn: degrees taken for radians."""
    for i, k, joint in _joints(robot):
        if joint.unit == "rad" and joint.stroke is not None:
            most = max(map(abs, joint.stroke))
            if most > _TURNS:
                yield Finding(
                    "angle",
                    (i + 1,),
                    f"the stroke of {_chains(robot).name_of(i, k)} runs to"
                    f" {np.degrees(most):.6g} deg",
                    f"is {most:.6g} in degrees? See angle under [units]",
                )


def along_its_rod(robot: Robot) -> Iterator[Finding]:
    """Axes of a U that lie along the rod beside it, which they turn about itself."""
    for i, limb in enumerate(_chains(robot).limbs):
        for k, ordinal in axes_along_rods(limb, _AXIS):
            yield Finding(
                "axis",
                (i + 1,),
                f"the {ordinal} axis of the U {_chains(robot).name_of(i, k)} lies"
                " along its rod, which it turns about itself",
                "give the U two axes across the rod; a rod that has to turn about itself is an R",
            )


def axes_in_line(robot: Robot) -> Iterator[Finding]:
    """Home at which the actuators move the tool in fewer ways than nearby."""
    home, near = (_ways(robot, q) for _, q in (_home(robot), _away(robot)))
    if home < near:
        yield Finding(
            "singular",
            (),
            f"home is singular: the actuators move the tool in {home} ways there, nearby in {near}",
            "choose a home pose beside it, turned or moved by some degrees or mm; inverse() and"
            " forward() start there",
        )


def idle_tail(robot: Robot) -> Iterator[Finding]:
    """Joints behind the platform that move the tool as the limbs do already."""
    if _has_idle_tail(robot):
        ways = _ways(robot, _away(robot)[1])
        yield Finding(
            "mobility",
            (),
            f"{robot.n_actuators} actuators, but the tool moves in {ways} ways: joints of the tail"
            " move it as the limbs do already, so no pose says where they are",
            "turn their axes, or take them out",
        )


def singular_anywhere(robot: Robot) -> Iterator[Finding]:
    """`singular`, of machines whose poses determine their actuators; exactly at home, too.

    The inverse goes from home by rates that do not exist there, so that no other pose is reached.
    """
    if _has_idle_tail(robot):
        return
    found = list(singular(robot))
    yield from found
    own, q = _home(robot)
    home, away = len(_free_ways(robot, own, q)), len(_free_ways(robot, *_away(robot)))
    if not found and home > away:
        yield Finding(
            "singular",
            (),
            f"home is singular: with the actuators held the platform still moves in {home} ways"
            f" there, nearby in {away}",
            "choose another home pose; forward() and inverse() start there",
        )


CHAIN_CHECKS = (
    outside_workspace,
    mobility,
    idle_tail,
    home_values,
    strokes,
    stroke_units,
    along_its_rod,
    turning,
    singular_anywhere,
    axes_in_line,
)


def surplus(robot: Robot) -> str:
    """List what is remarkable of a machine of chains though no mistake; empty where nothing is."""
    over = robot.machine.rows - robot.machine.m
    if over <= 0:
        return ""
    closures = f"{robot.machine.rows} closures for {robot.machine.m} coordinates"
    spare = pose_steps.surplus(robot)
    joints = f"over-constrained by {over - spare}" if over > spare else ""
    if not spare:
        return f"{joints}: {closures}; with errors the joints yield, each by its `soft`"
    return (
        f"{joints}{joints and '; '}{robot.n_actuators} actuators, {spare} more than needed:"
        f" {closures}; what they read can contradict itself: the joints then yield, each by its"
        " `soft`, and it can calibrate itself by their readings"
    )


def _joints(robot: Robot) -> Iterator[tuple[int, int, Joint]]:
    """Every joint once, with a limb that has it and its place there, both counted from 0."""
    seen: set[str] = set()
    for i, limb in enumerate(_chains(robot).limbs):
        for k, joint in enumerate(limb):
            name = _chains(robot).name_of(i, k)
            if name not in seen:
                seen.add(name)
                yield i, k, joint


def _home(robot: Robot) -> tuple[FloatArray, FloatArray]:
    return np.ascontiguousarray(robot.own_home[None]), robot.home_actuators[None]


def _away(robot: Robot) -> tuple[FloatArray, FloatArray]:
    """Another pose near home that the machine takes; home itself where none is found."""
    own, q = _home(robot)
    random = np.random.default_rng(0)
    step = np.array([0.1 * robot.length if unit == "mm" else 0.1 for unit in robot.actuator_units])
    there = q + step * random.uniform(-1, 1, q.shape)
    found, status, _, _ = robot.machine.forward(robot.slots, there, own[0], 1)
    return (found, there) if status[0] == 0 else (own, q)


def _ways(robot: Robot, q: FloatArray) -> int:
    """In how many ways the actuators move the tool; 0 where that is not defined."""
    twists = robot.actuator_twists(robot.forward(q).pose, q)[0]
    twists[3:] /= robot.length
    if not np.isfinite(twists).all():
        return 0
    sigma = np.linalg.svd(twists, compute_uv=False)
    return int((sigma > _NONE * sigma[0]).sum())


def _has_idle_tail(robot: Robot) -> bool:
    machine = robot.machine
    wanted = machine.m + min(0, machine.actuators - machine.rows)  # as `complete` takes them
    ways = _ways(robot, _away(robot)[1])
    return bool(_chains(robot).tail) and machine.rows <= machine.m and 0 < ways < wanted


def _free_ways(robot: Robot, own: FloatArray, q: FloatArray) -> FloatArray:
    """Twists (k, m) of the platform, as the pose map counts them, that no closure resists."""
    steps = robot.machine.closure(robot.slots, own, q).by_step[0]
    if not np.isfinite(steps).all():
        return np.empty((0, robot.machine.m))
    _, sigma, axes = np.linalg.svd(steps)
    rank = int((sigma > _NONE * max(float(sigma[0]), 1.0)).sum())
    return np.asarray(axes[rank:])


def _named_motion(robot: Robot, step: FloatArray) -> str:
    """A motion in words, from a step of the pose map with angles as arcs."""
    parts = dict(zip(robot.coordinates, step, strict=True))
    v = np.array([parts.get(name, 0.0) for name in ("x", "y", "z")])
    w = np.array([parts.get(name, 0.0) for name in ("alpha", "beta", "gamma")])
    turns, slides = float(np.linalg.norm(w)), float(np.linalg.norm(v))
    if turns < _AXIS * slides:
        return f"slides along {_direction(v / slides)}"
    w, v = w / turns, v / turns * robot.length
    point = (robot.own_home[:3] + np.cross(w, v)).round(6) + 0.0
    pitch = float(w @ v)
    said = f"turns about {_direction(w)} through ({', '.join(f'{x:.4g}' for x in point)}) mm"
    return said if abs(pitch) < _AXIS * robot.length else f"{said}, sliding along it"


def _direction(axis: FloatArray) -> str:
    shown = np.where(np.abs(axis) < _AXIS, 0.0, axis)
    for k, name in enumerate("xyz"):
        if np.count_nonzero(shown) == 1 and shown[k]:
            return name
    return f"({', '.join(f'{x:.2f}' for x in shown)})"


def _chains(robot: Robot) -> Chains:
    """Return the joints of a machine, which is asked for what only chains have."""
    assert robot.model.chains is not None
    return robot.model.chains
