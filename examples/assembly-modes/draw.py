"""Draws every way in which machines can be assembled at the same actuator coordinates.

python examples/assembly-modes/draw.py pictures
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import pkmcal as pk
from pkmcal.core.screws import joint_motions
from pkmcal.report import drawing

HERE = Path(__file__).parent
FORTY = (100.0, 64.5275, 108.6284, 150.3439, 128.1933, 77.1071)  # mm
SIGNS = {1: "#0072b2", -1: "#d55e00"}  # of the determinant
BASE, LEGS = "#999999", "#444444"


def panel(axes, robot: pk.Robot, pose: np.ndarray, colour: str, heading: str) -> None:
    """One assembly mode: base in grey, platform in the colour of its determinant's sign."""
    joints = robot.geometry.slots
    motion = joint_motions(pose[None], np.zeros((1, 3))).reshape(4, 4)
    base, platform = joints[:, :3], joints[:, 3:6] @ motion[:3, :3].T + motion[:3, 3]
    for points, shade in ((base, BASE), (platform, colour)):
        axes.plot(*around(points).T, color=shade, lw=1.6)
    for a, b in zip(base, platform, strict=True):
        axes.plot(*np.array([a, b]).T, color=LEGS, lw=0.6)
    axes.set_title(heading, fontsize=8, pad=-2)
    axes.set_aspect("equal")
    axes.set_axis_off()


def around(points: np.ndarray) -> np.ndarray:
    """The joints as a closed line, around their middle as it is seen from above."""
    x, y = (points - points.mean(axis=0))[:, :2].T
    order = np.argsort(np.arctan2(y, x))
    return points[[*order, order[0]]]


def draw(robot: pk.Robot, q: object, columns: int, headings: bool) -> plt.Figure:
    """All modes of a robot, a panel each."""
    modes = robot.forward_all(q)
    rows = -(-len(modes) // columns)
    figure = plt.figure(figsize=(1.9 * columns, 2.0 * rows + 0.6), layout="constrained")
    for k, pose in enumerate(modes.poses):
        axes = figure.add_subplot(rows, columns, k + 1, projection="3d")
        heading = f"{k}"
        if headings:
            angles = np.degrees(pose[3:5]).round() + 0.0
            heading += f": z {pose[2]:.0f} mm\nα {angles[0]:.0f}°, β {angles[1]:.0f}°"
            heading += f"\nmirror of {modes.mirror[k]}"
        panel(axes, robot, pose, SIGNS[int(modes.sign[k])], heading)
    proof = "complete" if modes.complete else "perhaps not all"
    figure.suptitle(
        f"{robot.name}: {len(modes)} assembly modes, {proof}. Colour: sign of the determinant"
    )
    return figure


def main(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    machine = pk.load("2tpr2tps")
    four = draw(machine, [450.0, 452.0, 400.0, 405.0], 4, True)
    drawing.write_both(four, folder / "2tpr2tps-modes")
    forty = pk.load(HERE / "dietmaier.toml")
    drawing.write_both(draw(forty, FORTY, 8, False), folder / "forty-modes")
    print(machine.forward_all([450.0, 452.0, 400.0, 405.0]))


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "mode-pictures"))
