"""Mistakes that show in how far a machine yields: compliances and masses in other units."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pkmcal.checks.finding import Finding
from pkmcal.geometry.elastic import COMPLIANCE, PER_LENGTH
from pkmcal.kinematics.robot import Robot

_MOST = 0.01  # of the size: what no machine sags at home


def sags(robot: Robot) -> Iterator[Finding]:
    """A sag at home that no machine has."""
    if robot is robot.rigid:
        return
    geometry = dict(robot.geometry.items())
    for name, value in geometry.items():
        if name.startswith(COMPLIANCE) and not name.endswith(PER_LENGTH) and value < 0.0:
            yield Finding(
                "load",
                (),
                f"{name} is {value:.3g}, below 0: no spring",
                "a calibration may find that of what does not yield; hold it at 0",
            )
    home = robot.home
    found = robot.forward(robot.rigid.inverse(home, match=True), guess=home)
    sag = float(np.linalg.norm(found.pose[:3] - home[:3]))
    if found.ok and sag <= _MOST * float(robot.machine.struct.size):
        return
    what = f"sags by {sag:.4g} mm" if found.ok else found.STATUS[int(found.status)]
    yield Finding(
        "load",
        (),
        f"at home the machine {what} under the load that its file states",
        "stiffnesses are in N/mm and N m/rad, compliances in mm/N and rad/(N mm), masses in kg",
    )
