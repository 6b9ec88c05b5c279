"""The machine of a calibration in a page: residuals where they were measured, what changed.

`pkmcal.view` moves and draws it; here is what a calibration adds.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pkmcal.arms.arm import SerialArm
from pkmcal.arrays import FloatArray
from pkmcal.calibration.identification import Identification
from pkmcal.kinematics.calibratable import as_given
from pkmcal.kinematics.robot import Robot
from pkmcal.report.drawing import sample
from pkmcal.report.exaggerated import middle_exaggerated
from pkmcal.report.rows import rows
from pkmcal.view import page

_MORE = 10  # times the exaggeration that is drawn at first
_POSES = 200  # measured poses that can be visited


def element(found: Identification) -> tuple[str, str]:
    """The element of the report, and the hash by which its policy names the script.

    Both are empty for a machine that the page cannot hold: the still pictures stay.
    """
    robot = found.robot
    if page.beyond(robot):
        return "", ""
    data = page.machine(robot, cloud=False)  # the report has its own pictures of the workspace
    data["places"] = measured_poses(found)
    data["calibration"] = {"points": _points(found), "change": change(found)}
    if seen := cameras(found):
        data["cameras"] = seen
    return page.plain_element(data)


def cameras(found: Identification) -> list[dict[str, Any]]:
    """Cameras as they were found, and their boards: places in the base and on what is carried."""
    return [view for each in found.instruments if (view := each.drawn()) is not None]


def _points(found: Identification) -> list[dict[str, Any]]:
    listed = rows(found)
    points = []
    fitted = np.array([use == "fitted" for use in listed.use])
    for k in sample(int(fitted.sum()), listed.outlier[fitted]):
        numbers = np.concatenate([listed.at[k], listed.before[k], listed.after[k]])
        if not np.isfinite(numbers).all():
            continue
        points.append(
            {
                "name": listed.name[k] if listed.outlier[k] else f"row {listed.row[k]}",
                "at": listed.at[k].round(3).tolist(),
                "before": [float(f"{x:.5g}") for x in listed.before[k]],
                "after": [float(f"{x:.5g}") for x in listed.after[k]],
                "outlier": bool(listed.outlier[k]),
            }
        )
    return points


def measured_poses(found: Identification) -> dict[str, Any]:
    """The measured poses as the identified machine has them, with their actuators."""
    end = found.fit.end
    reached = np.flatnonzero(np.isfinite(end.pose).all(axis=1) & (end.status == 0))
    chosen = reached[np.linspace(0, len(reached) - 1, min(len(reached), _POSES)).astype(int)]
    name, q = "measured poses", end.actuators[chosen]
    if isinstance(found.robot, SerialArm):
        return page.places(name, found.robot, q)
    return page.places(name, found.robot, end.pose[chosen], q)


def change(found: Identification) -> dict[str, Any]:
    """Numbers of the machine that changed, as the core has them, before and after.

    None of a machine with drive laws, whose numbers are not in the memory of the page's core: there
    the machine as assumed is not overlaid.
    """
    parameters = found.fit.equations.parameters
    if parameters.robot.model.driven:
        return {"places": [], "before": [], "after": [], "times": 1, "most": 1}
    assumed = as_given(parameters.robot.replace(parameters.values_at(found.fit.start.theta)))
    before, after = _numbers(assumed), _numbers(found.robot)
    places = np.flatnonzero(before != after)
    drawn = middle_exaggerated(found)
    times = 1 if drawn is None else drawn[2]
    return {
        "places": places.tolist(),
        "before": before[places].tolist(),
        "after": after[places].tolist(),
        "times": times,
        "most": _MORE * times,
    }


def _numbers(robot: Robot | SerialArm) -> FloatArray:
    return np.ravel(robot.joint_errors if isinstance(robot, SerialArm) else robot.slots)
