"""The machine of a calibration in a page: residuals where they were measured, what changed.

`pkmcal.view` moves and draws it; here is what a calibration adds.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pkmcal.arms.arm import SerialArm
from pkmcal.arrays import FloatArray
from pkmcal.calibration.evaluation import Evaluation
from pkmcal.calibration.identification import Identification
from pkmcal.calibration.row_names import row_names
from pkmcal.core import instruments
from pkmcal.kinematics.robot import Robot
from pkmcal.measurements.calibratable import as_given
from pkmcal.report.drawing import sample
from pkmcal.report.exaggerated import middle_exaggerated
from pkmcal.view import page

_NAMED = 100  # outliers, which have the names of their lines; others have numbers
_MORE = 10  # times the exaggeration that is drawn at first
_POSES = 200  # measured poses that can be visited


def element(found: Identification) -> tuple[str, str]:
    """The element of the report, and the hash by which its policy names the script.

    Nothing, and "none", of a machine that the page cannot hold: the still pictures stay.
    """
    robot = found.robot
    if isinstance(robot, Robot) and (
        robot.model.driven or any(limb.kind == "pulley" for limb in robot.model.limbs)
    ):
        return "", "none"
    data = page.machine(robot, cloud=False)  # the report has its own pictures of the workspace
    data["places"] = _measured(found)
    data["calibration"] = {"points": _points(found), "change": _change(found)}
    return page.plain_element(data)


def residual_vectors(found: Identification, at: Evaluation) -> FloatArray:
    """Residuals of all rows as vectors in the robot's base frame, mm (N, 3); NaN where unread.

    A reading changes with the platform's velocity by the last three columns of its derivative by
    the twist: unit vectors of the instrument's axes, of a height's axis or along a distance.
    """
    parts = []
    for residual, predicted in zip(at.residuals, at.predicted, strict=True):
        k = min(residual.shape[1], 3)
        along = predicted.by_twist[:, :k, 3:]
        vectors = np.einsum("nk,nki->ni", residual[:, :k], along)
        parts.append(vectors if k else np.full((len(residual), 3), np.nan))
    return np.concatenate(parts)


def measured_places(found: Identification) -> FloatArray:
    """Where the measured points of all rows are in the robot's base frame, mm (N, 3)."""
    equations, end = found.fit.equations, found.fit.end
    parts = []
    for i in range(len(equations.sets)):
        target = equations.arguments_of(i, end.theta).get("target")
        if target is None:
            parts.append(end.pose[equations.pose_of[i], :3])
        else:
            parts.append(instruments.points(end.pose[equations.pose_of[i]], target)[0])
    return np.concatenate(parts)


def _points(found: Identification) -> list[dict[str, Any]]:
    before, after = (residual_vectors(found, at) for at in (found.fit.start, found.fit.end))
    places = measured_places(found)
    odd = np.isin(found.rows, found.outliers)
    drawn = sample(len(places), odd)
    names = found.fit.equations.datasets
    named = {int(row): row_names(names, [row]) for row in found.outliers[:_NAMED]}
    points = []
    for k in drawn:
        numbers = np.concatenate([places[k], before[k], after[k]])
        if not np.isfinite(numbers).all():
            continue
        row = int(found.rows[k])
        points.append(
            {
                "name": named.get(row, f"row {row}"),
                "at": places[k].round(3).tolist(),
                "before": [float(f"{x:.5g}") for x in before[k]],
                "after": [float(f"{x:.5g}") for x in after[k]],
                "outlier": bool(odd[k]),
            }
        )
    return points


def _measured(found: Identification) -> dict[str, Any]:
    """The measured poses as the identified machine has them, with their actuators."""
    end = found.fit.end
    reached = np.flatnonzero(np.isfinite(end.pose).all(axis=1) & (end.status == 0))
    chosen = reached[np.linspace(0, len(reached) - 1, min(len(reached), _POSES)).astype(int)]
    name, q = "measured poses", end.actuators[chosen]
    if isinstance(found.robot, SerialArm):
        return page.places(name, found.robot, q)
    return page.places(name, found.robot, end.pose[chosen], q)


def _change(found: Identification) -> dict[str, Any]:
    """Numbers of the machine that changed, as the core has them, before and after."""
    parameters = found.fit.equations.parameters
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
