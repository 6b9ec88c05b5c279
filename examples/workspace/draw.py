"""Draws where machines can go: singularity loci, conditioning, limits, slices, volume, a heat map.

python examples/workspace/draw.py pictures
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import pkmcal as pk
from pkmcal.report import drawing
from pkmcal.report import error_figures as figures

CELLS = 120  # of a slice, along each axis
TURN = float(np.radians(88.0))

# Slices through home, mm and rad, where the singularities are
SLICES: dict[str, list[dict[str, tuple[float, float, int]]]] = {
    "2tpr2tps": [
        {"y": (-300.0, 300.0, CELLS), "alpha": (-TURN, TURN, CELLS)},
        {"z": (200.0, 560.0, CELLS), "alpha": (-TURN, TURN, CELLS)},
        {"z": (50.0, 560.0, CELLS), "beta": (-1.2, 1.2, CELLS)},
    ],
    "rbt-6t03p": [
        {"x": (-180.0, 180.0, CELLS), "y": (-180.0, 180.0, CELLS)},
        {"beta": (-TURN, TURN, CELLS), "alpha": (-TURN, TURN, CELLS)},
        {"gamma": (-2.2, 2.2, CELLS), "z": (-80.0, 80.0, CELLS)},
    ],
}
VOLUME = {"x": (-130.0, 130.0, 65), "y": (-130.0, 130.0, 65), "z": (-60.0, 60.0, 40)}
SIGMA = 0.1  # mm, of every length of the heat map
MACHINES = 4_000


def draw(folder: Path) -> None:
    """Write all pictures to a folder, and print how large the workspace is."""
    for name, slices in SLICES.items():
        robot = pk.load(name)
        grids = [pk.workspace(robot, axes) for axes in slices]
        loci = figures.singularities(grids, robot.name)
        drawing.write_both(loci, folder / f"{name}-singularities")

    grid = pk.workspace(pk.load("rbt-6t03p"), VOLUME)
    drawing.write_both(figures.workspace_slices(grid, "z"), folder / "rbt-6t03p-slices")
    print(grid)

    plane = pk.workspace(pk.load("2tpr2tps"), {"y": (-180.0, 180.0, 50), "z": (280.0, 490.0, 50)})
    found = pk.tolerance(plane.robot, plane.poses, SIGMA, samples=MACHINES)
    drawing.write_both(figures.tolerance_map(found, plane), folder / "2tpr2tps-tolerance")
    print(plane)


if __name__ == "__main__":
    target = Path(sys.argv[1] if len(sys.argv) > 1 else "workspace-pictures")
    target.mkdir(parents=True, exist_ok=True)
    draw(target)
