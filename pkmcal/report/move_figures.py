"""Figures of moves: actuators against time, and the machine in space at chosen times."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from pkmcal import display
from pkmcal.arrays import FloatArray, as_rows
from pkmcal.kinematics.robot import Robot
from pkmcal.report.drawing import BLUE, FAINT, ORANGE, empty_figure, in_context

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from pkmcal.moves.move import Move

_POINTS = 400
_LEAD = 0.08  # of the duration, shown before and after the move


@in_context
def curves(moves: Sequence[Move], labels: Sequence[str], title: str) -> Figure:
    """Draw actuator coordinates, their velocities and accelerations against time, a column a move.

    Parameters
    ----------
    moves : sequence of Move
        Side by side on the same scales, at rest a little before and after.
    labels : sequence of str
        One a move.
    title : str
        Above all.
    """
    figure = empty_figure(1.4 + 4.0 * len(moves), 7.2)
    panels = figure.subplots(3, len(moves), sharex="col", sharey="row", squeeze=False)
    unit = moves[0].robot.actuator_units[0]
    factor, shown = display.displayed(1.0, unit)
    for column, (made, label) in enumerate(zip(moves, labels, strict=True)):
        lead = _LEAD * made.duration
        inside = np.linspace(0.0, made.duration, _POINTS)
        edge = made.duration + 1e-9
        time = np.concatenate([[-lead, -1e-9], inside, [edge, edge + lead]])
        at = made.sample(np.clip(time, 0.0, made.duration))
        resting = (time < 0) | (time > made.duration)
        rows = (
            (at.actuators, f"actuator [{shown}]"),
            (np.where(resting[:, None], 0.0, at.velocities), f"velocity [{shown}/s]"),
            (np.where(resting[:, None], 0.0, at.accelerations), f"acceleration [{shown}/s²]"),
        )
        for row, (values, name) in enumerate(rows):
            panel = panels[row, column]
            for i, curve in enumerate(values.T):
                panel.plot(time, curve * factor, lw=1.3, label=f"q{i + 1}")
            panel.grid()
            if column == 0:
                panel.set_ylabel(name)
        panels[0, column].set_title(label, fontsize="medium")
        panels[-1, column].set_xlabel("time [s]")
    panels[0, -1].legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    figure.suptitle(title, fontsize="medium")
    return figure


@in_context
def in_space(robot: Robot, poses: ArrayLike, labels: Sequence[str], title: str) -> Figure:
    """Draw the machine in space at each pose: base, limbs with their moving anchors, and platform.

    Parameters
    ----------
    robot : Robot
        The machine, in its own frames.
    poses : array_like (N, 6)
        x y z in mm, α β γ in rad.
    labels : sequence of str
        One a pose.
    title : str
        Above all.
    """
    rows, _ = as_rows("poses", poses, 6)
    own = np.ascontiguousarray(robot.frames.inward(rows))
    base, anchors, joints = places(robot, own)
    figure = empty_figure(0.4 + 3.7 * len(rows), 4.3, None)  # layouts leave no room for 3-D labels
    figure.subplots_adjust(left=0.01, right=0.95, bottom=0.05, top=0.88, wspace=0.02)
    seen = np.concatenate([base.reshape(-1, 3), anchors.reshape(-1, 3), joints.reshape(-1, 3)])
    low, high = seen.min(axis=0), seen.max(axis=0)
    for k, label in enumerate(labels):
        panel = figure.add_subplot(1, len(rows), k + 1, projection="3d")
        for i, limb in enumerate(robot.model.limbs):
            if limb.driver is not None and limb.driver.slides:
                way = (anchors[:, i] - base[i]) @ (anchors[0, i] - base[i])
                rail = anchors[[way.argmin(), way.argmax()], i]
                panel.plot(*rail.T, color="0.75", lw=3, solid_capstyle="butt")
            elif limb.driver is None or limb.driver.turns:
                panel.plot(*np.array([base[i], anchors[k, i]]).T, color=FAINT, lw=3)
            panel.plot(*np.array([anchors[k, i], joints[k, i]]).T, color=BLUE, lw=1.6)
            panel.text(*anchors[k, i], f" {i + 1}", fontsize=8)
        for points, colour in ((anchors[k], FAINT), (joints[k], ORANGE)):
            ring = _ring(points)
            panel.plot(*ring.T, color=colour, lw=1.2, marker="o", ms=3)
        panel.set_xlim(low[0], high[0])
        panel.set_ylim(low[1], high[1])
        panel.set_zlim(low[2], high[2])
        panel.set_box_aspect(np.maximum(high - low, 1e-3 * float(np.ptp(seen))), zoom=0.92)
        panel.set(xlabel="x [mm]", ylabel="y [mm]", zlabel="z [mm]")
        panel.locator_params(nbins=5)
        panel.tick_params(labelsize=7)
        panel.set_title(label, fontsize="medium")
    figure.suptitle(title, fontsize="medium")
    return figure


def places(robot: Robot, own: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return base joints (limbs, 3), anchors and platform joints (N, limbs, 3) at own poses."""
    limbs = robot.limb_kinematics.lines(robot, own, robot.machine.inverse(robot.slots, own))
    base = np.array([limb[0, 0] for limb in limbs])
    anchors, joints = (np.stack([limb[:, k] for limb in limbs], axis=1) for k in (-2, -1))
    return base, anchors, joints


def _ring(points: FloatArray) -> FloatArray:
    """Return the points in order around their middle, closed."""
    middle = points.mean(axis=0)
    order = np.argsort(np.arctan2(points[:, 1] - middle[1], points[:, 0] - middle[0]))
    return points[[*order, order[0]]]
