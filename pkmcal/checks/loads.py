"""Mistakes that show in how far a machine yields: compliances, masses, gravity in other units."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from pkmcal.arms.arm import SerialArm
from pkmcal.checks.finding import Finding, named
from pkmcal.geometry.elastic import COMPLIANCE, PER_LENGTH
from pkmcal.kinematics.robot import Robot

_MOST = 0.01  # of the size: what no machine sags at home
_STRONGEST = 30.0  # m/s²: no machine on a planet is under more
_POSTURES = 100
_UNITS = "stiffnesses are in N/mm and N m/rad, compliances in mm/N and rad/(N mm), masses in kg"


def sags(robot: Robot) -> Iterator[Finding]:
    """A sag at home that no machine has."""
    if robot is robot.rigid:
        return
    if robot.model.elastic is not None:
        yield from _gravity(robot.model.elastic.gravity)
    geometry = dict(robot.geometry.items())
    for name, value in geometry.items():
        if name.startswith(COMPLIANCE) and not name.endswith(PER_LENGTH) and value < 0.0:
            yield Finding(
                "load",
                (),
                f"{name} is {value:.3g}, below 0: no spring",
                "a calibration may find that of what does not yield; hold it at 0",
            )
    yield from _several_springs(robot)
    home = robot.home
    found = robot.forward(robot.rigid.inverse(home, match=True), guess=home)
    sag = float(np.linalg.norm(found.pose[:3] - home[:3]))
    if found.ok and sag <= _MOST * float(robot.machine.struct.size):
        return
    what = f"sags by {sag:.4g} mm" if found.ok else found.STATUS[int(found.status)]
    yield Finding(
        "load", (), f"at home the machine {what} under the load that its file states", _UNITS
    )


def _several_springs(robot: Robot) -> Iterator[Finding]:
    """Yield limbs on one actuator whose drives yield each by itself."""
    elastic = robot.model.elastic
    assert elastic is not None
    own = {f"offset{i + 1}": limb.actuator for i, limb in enumerate(robot.model.limbs)}
    springs = [each.number for each in elastic.springs if each.of_drive and each.number in own]
    for actuator in sorted({own[name] for name in springs}):
        mine = [name for name in springs if own[name] == actuator]
        if len(mine) < 2:
            continue
        limbs = tuple(int(name.removeprefix("offset")) for name in mine)
        yield Finding(
            "load",
            limbs,
            f"{named(i - 1 for i in limbs)} share actuator {actuator + 1}, and the drive of each"
            " yields by itself",
            "one screw or crank under all of them is a parameter: screw = 0.0 under [parameters],"
            ' offset = "screw" in each limb, and screw = 5e-5 under [compliance]',
        )


def arm_sags(arm: SerialArm) -> Iterator[Finding]:
    """Yield gravity that no arm is under, compliances below 0, and a sag that no arm has."""
    if arm.laws is None:
        return
    yield from _gravity(arm.laws.pulls.gravity)
    for term, value in arm.laws.numbers.items():
        if term.kind == "compliance" and value < 0.0:
            yield Finding(
                "load",
                (term.joint + 1,),
                f"{term.name} is {value:.3g}, below 0: no spring",
                "a calibration may find that of what does not yield; hold it at 0",
            )
    if not arm.laws.yielding:
        return
    turning = np.array([unit == "rad" for unit in arm.actuator_units])
    postures = np.random.default_rng(0).uniform(-np.pi, np.pi, (_POSTURES, len(turning))) * turning
    moved = arm.forward(postures)[:, :3, 3] - arm.rigid.forward(postures)[:, :3, 3]
    sags = np.linalg.norm(moved, axis=1)
    sag = float(np.median(np.where(np.isfinite(sags), sags, np.inf)))  # NaN: it gives way
    if sag > _MOST * arm.length:
        how = f"sags by more than {sag:.4g} mm" if np.isfinite(sag) else "gives way"
        yield Finding(
            "load",
            (),
            f"in half of all postures the arm {how} under the weights that its file states",
            _UNITS,
        )


def _gravity(gravity: Sequence[float]) -> Iterator[Finding]:
    size = float(np.linalg.norm(gravity))
    if size > _STRONGEST:
        yield Finding(
            "load",
            (),
            f"gravity is {size:.6g} m/s²",
            "it is in m/s², 9.80665 on earth: were mm/s² meant?",
        )
