"""A robot as a model of MuJoCo: limbs as chains of joints, closed by equality constraints."""

from __future__ import annotations

from os import PathLike
from xml.etree import ElementTree as Xml

import numpy as np
from scipy.spatial.transform import Rotation

from pkmcal.arguments import path as as_path
from pkmcal.arrays import FloatArray, furthest_axis
from pkmcal.controllers.arm_tree import MILLIMETRE
from pkmcal.controllers.c_limbs import prepared
from pkmcal.controllers.laws import require_plain_limbs
from pkmcal.controllers.loss import Loss, sag
from pkmcal.core.library import POSE
from pkmcal.exceptions import ArgumentError
from pkmcal.files.atomic import write_whole
from pkmcal.geometry.drivers import Driver
from pkmcal.geometry.limb_kinds import KINDS
from pkmcal.geometry.limbs import CHAIN
from pkmcal.kinematics.robot import Robot, require_parallel

_PLATFORM = {  # joints of the platform by pose map; none: it is free
    "spatial": (),
    "translation": ("x", "y", "z"),
    "planar": ("x", "y", "gamma"),
}
_ROWS = {"UPS": (), "PUS": (), "RUS": (), "RPS": ("base_plane",)}


def mjcf(robot: Robot, path: str | PathLike[str]) -> Loss | None:
    """Write a robot as an MJCF file of MuJoCo.

    The model stands in the home pose, or beside it where errors of the geometry do not let it close
    there, in metres and radians. Joint ``q1`` and so on are the limbs'
    own coordinates, `gain` · q + `offset`; each has a position actuator. Masses and inertias are
    1 kg and 0.01 kg m² throughout: a robot file has none.

    Parameters
    ----------
    robot : Robot
        Limbs of the kinds UPS, RPS, PUS and RUS.
    path : str or path
        Where to write; an existing file is replaced, whole or not at all.

    Returns
    -------
    Loss or None
        Of a machine that yields, of which the model is the rigid one: how far it sags under what
        its file states.

    Raises
    ------
    ValueError
        A limb or a pose map that the model cannot hold, or base and tool frames; nothing is
        written.

    Examples
    --------
    >>> import pkmcal as pk
    >>> import pathlib, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     pk.export.mjcf(pk.load("hexapod"), f"{folder}/hexapod.xml")
    ...     pathlib.Path(folder, "hexapod.xml").read_text().count("<connect")
    6
    """
    require_parallel(robot)
    write_whole(as_path("path", path), text_of(robot.rigid))
    return None if robot is robot.rigid else sag(robot)


def text_of(robot: Robot) -> str:
    """The MJCF text."""
    _require(robot)
    require_plain_limbs(robot, "this model")
    home, drives = _closed_home(robot)
    directions = robot.limb_machine.limbs(robot.slots, home[None])[1]
    top = Xml.Element("mujoco", model=robot.name)
    Xml.SubElement(top, "compiler", angle="radian", autolimits="false")
    world = Xml.SubElement(top, "worldbody")
    _platform(world, robot.model.map, home)
    equality, actuator = Xml.SubElement(top, "equality"), Xml.SubElement(top, "actuator")
    first, second, _, axes = prepared(robot)
    driving: dict[int, int] = {}
    for i, limb in enumerate(robot.model.limbs):
        kind, g, drive = KINDS[limb.kind], robot.slots[i], float(drives[i])
        tip = _limb(
            world, i, kind.driver, g, drive, directions[0, i], (first[i], second[i]), axes[i][0]
        )
        anchor = _numbers([0.0, 0.0, tip * MILLIMETRE])
        Xml.SubElement(equality, "connect", body1=f"limb{i + 1}", body2="platform", anchor=anchor)
        if limb.actuator not in driving:
            driving[limb.actuator] = i
            Xml.SubElement(actuator, "position", name=f"drive{i + 1}", joint=f"q{i + 1}", kp="1e5")
            continue
        leader = driving[limb.actuator]
        ratio = _numbers([0.0, g[7] / robot.slots[leader][7], 0.0, 0.0, 0.0])
        joints = {"joint1": f"q{i + 1}", "joint2": f"q{leader + 1}", "polycoef": ratio}
        Xml.SubElement(equality, "joint", joints)
    Xml.indent(top)
    return Xml.tostring(top, encoding="unicode") + "\n"


def _require(robot: Robot) -> None:
    model = robot.model
    reasons = []
    if model.map not in _PLATFORM:
        reasons.append(f"the pose map {model.map}")
    for i, limb in enumerate(model.limbs, 1):
        if limb.kind == CHAIN or (
            KINDS[limb.kind].all_rows(limb.couple > 0) != _ROWS.get(limb.kind)
        ):
            reasons.append(f"limb {i}, a {limb.kind}")
    if not robot.frames.trivial:
        reasons.append("base and tool frames")
    if reasons:
        raise ArgumentError(f"robot: {robot.name} has what this model cannot hold: {reasons[0]}")


def _closed_home(robot: Robot) -> tuple[FloatArray, FloatArray]:
    """The own pose (6,) beside home at which all limbs close, and their drives there (limbs,).

    The file's home is that of the machine without errors. Links that are taken there point where
    they cannot with errors, and limbs that share an actuator ask for different coordinates.
    """
    q = robot.inverse(robot.home)[None]
    found = robot.forward(q)
    if not found.ok.all():
        why = found.failures() if np.isfinite(q).all() else "a limb does not reach it"
        raise ArgumentError(f"robot: {robot.name} cannot take its home pose: {why}")
    return robot.frames.inward(found.pose)[0], robot.drives(q)[0]


def _platform(world: Xml.Element, map: str, home: FloatArray) -> None:
    turned = Rotation.from_euler("xyz", home[3:])
    body = _body(world, "platform", home[:3], turned)
    names = _PLATFORM[map]
    if not names:
        Xml.SubElement(body, "freejoint", name="platform")
    for name in names:
        axis = np.eye(3)["xyz".index(name) if name in "xyz" else 2]
        kind, scale = ("slide", MILLIMETRE) if name in "xyz" else ("hinge", 1.0)
        if name in "xyz":
            axis = turned.inv().apply(axis)  # in the body's axes
        value = home[POSE.index(name)] * scale
        _joint(body, f"platform_{name}", kind, axis, value)


def _limb(
    world: Xml.Element,
    i: int,
    driver: Driver,
    g: FloatArray,
    drive: float,
    along: FloatArray,
    moves: tuple[FloatArray, FloatArray],
    normal: FloatArray,
) -> float:
    """Add a limb to the model in its home pose; how far its tip is along its last body's z, mm."""
    base, rod, name = g[:3], float(g[8]), f"q{i + 1}"
    first, second = moves
    if not driver.carries:
        leg = _swinging(world, f"leg{i + 1}", base, along, normal)
        tip = _body(leg, f"limb{i + 1}", np.array([0.0, 0.0, drive]), None)
        _joint(tip, name, "slide", np.array([0.0, 0.0, 1.0]), drive * MILLIMETRE)
        return 0.0
    if driver.slides:
        carriage = _body(world, f"carriage{i + 1}", base + drive * first, None)
        _joint(carriage, name, "slide", first, drive * MILLIMETRE)
        _swinging(carriage, f"limb{i + 1}", np.zeros(3), along, np.zeros(3))
        return rod
    crank = _body(world, f"crank{i + 1}", base, None)
    axis = np.cross(first, second)
    _joint(crank, name, "hinge", axis / np.linalg.norm(axis), drive)
    end = first * np.cos(drive) + second * np.sin(drive)
    _swinging(crank, f"limb{i + 1}", end, along, np.zeros(3))
    return rod


def _swinging(
    parent: Xml.Element, name: str, at: FloatArray, along: FloatArray, normal: FloatArray
) -> Xml.Element:
    """A body whose z points along the leg: on two hinges, or on one about a normal."""
    other = normal if normal.any() else np.eye(3)[furthest_axis(along)]
    x = np.cross(np.cross(along, other), along)
    x /= np.linalg.norm(x)
    body = _body(
        parent, name, at, Rotation.from_matrix(np.stack([x, np.cross(along, x), along], 1))
    )
    _joint(body, f"{name}_x", "hinge", np.array([1.0, 0.0, 0.0]), 0.0)
    if not normal.any():
        _joint(body, f"{name}_y", "hinge", np.array([0.0, 1.0, 0.0]), 0.0)
    return body


def _body(parent: Xml.Element, name: str, at: FloatArray, turned: Rotation | None) -> Xml.Element:
    body = Xml.SubElement(parent, "body", name=name, pos=_numbers(at * MILLIMETRE))
    if turned is not None:
        body.set("quat", _numbers(np.roll(turned.as_quat(), 1)))  # w first
    inertia = {"pos": "0 0 0", "mass": "1", "diaginertia": "0.01 0.01 0.01"}
    Xml.SubElement(body, "inertial", inertia)
    return body


def _joint(body: Xml.Element, name: str, kind: str, axis: FloatArray, ref: float) -> None:
    given = {"name": name, "type": kind, "axis": _numbers(axis), "ref": repr(float(ref))}
    Xml.SubElement(body, "joint", given)


def _numbers(values: FloatArray | list[float]) -> str:
    return " ".join(repr(float(value)) for value in values)
