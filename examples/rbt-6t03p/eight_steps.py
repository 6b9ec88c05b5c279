"""The eight steps of the RBT-6T03P paper, its two tables, and what is wrong with them.

    python examples/rbt-6t03p/eight_steps.py [FOLDER]

prints every step with the printed numbers and with the true geometry, what check_geometry finds,
and draws listing.png, move.png and space.png.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import pkmcal as pk
from pkmcal.report import drawing, move_figures

HERE = Path(__file__).parent
TARGETS = {"(0, 0, 50)": (163.61, 48.96), "(0, 0, -20)": (232.25, 19.68)}  # Table 2
# the listing's y = a t³ + b t² + c, t = 0 … 2 s; the sign of the third curve's a is a misprint
LISTING = np.array([
    (-4.48, 13.43, 38.74), (-4.98, 14.93, 42.90), (-0.98, -2.93, -2.81),
    (0.7, -2.10, -1.12), (-3.75, 11.24, 32.84), (-3.0, 9.0, 26.95),
])  # fmt: skip


def joints(robot: pk.Robot, side: str) -> np.ndarray:
    """Base or platform joints with a fourth coordinate 1: points, (6, 4)."""
    points = [[robot.geometry[f"{side}{i}.{axis}"] for axis in "xyz"] for i in range(1, 7)]
    return np.column_stack([points, np.ones(6)])


def carried(robot: pk.Robot, pose: np.ndarray) -> np.ndarray:
    """Platform joints in the base frame at a pose, (6, 3): steps 3 and 6."""
    return (joints(robot, "platform") @ pk.screw.from_pose(pose).T)[:, :3]


def steps(robot: pk.Robot, drive: str) -> None:
    """Steps 1 to 8, with the platform at pose 0 and at the two targets of Table 2."""
    print(f"1 data       {robot.name}: limbs {robot.model.limbs[0].kind}")
    print("2 frames     base frame and platform frame coincide at pose 0, z up")
    print(f"3 joints     platform joint 1 at {carried(robot, np.zeros(6))[0]}")
    at_rest = robot.inverse(np.zeros(6))
    print(f"4 {drive:10} {at_rest}")
    for target, (length, change) in TARGETS.items():
        pose = np.array([*map(float, target.strip("()").split(",")), 0.0, 0.0, 0.0])
        moved = robot.inverse(pose)
        print(f"5 target     {target}")
        print(f"6 joints     platform joint 1 at {carried(robot, pose)[0]}")
        print(f"7 {drive:10} {moved}   (Table 2: {length})")
        print(f"8 change     {moved - at_rest}   (Table 2: {change})")


def directions(robot: pk.Robot) -> None:
    """A point and a direction under one homogeneous transform."""
    T = pk.screw.from_pose([0, 0, 50, 0, 0, np.radians(90)])
    print(f"a point      T (1, 0, 0, 1) = {T @ [1, 0, 0, 1] + 0.0}")
    print(f"a direction  T (1, 0, 0, 0) = {T @ [1, 0, 0, 0] + 0.0}")


def rods_by_angles(robot: pk.Robot, height: float = 208.897) -> np.ndarray:
    """Distances of the joints with Table 1 read as polar angles, radii 129.74 and 65.5 mm."""
    upper, lower = (np.radians(joints(robot, side)[:, 0]) for side in ("base", "platform"))
    along = 129.74 * np.exp(1j * upper) - 65.5 * np.exp(1j * lower)
    return np.hypot(np.abs(along), height)


def save(figure: Figure, path: Path) -> Path:
    """Write a figure as PNG."""
    drawing.write(figure, path)
    return path


def draw_listing(folder: Path) -> Path:
    """The listing's six curves; the third as printed and as it stops."""
    t = np.arange(0.0, 2.05, 0.1)
    figure = Figure(figsize=(8.4, 4.6), layout="constrained")
    panels = figure.subplots(2, 3, sharex=True)
    for i, (panel, (a, b, c)) in enumerate(zip(panels.flat, LISTING, strict=True)):
        panel.plot(t, a * t**3 + b * t**2 + c, "o-", ms=2.5, lw=1.0, color="#0072b2")
        if i == 2:
            panel.plot(t, -a * t**3 + b * t**2 + c, "--", color="#d55e00", label="with +0.98")
            panel.legend(frameon=False)
        panel.set_title(f"y{i + 1}", fontsize="medium")
        panel.grid(color="0.9")
    for panel in panels[1]:
        panel.set_xlabel("time [s]")
    for panel in panels[:, 0]:
        panel.set_ylabel("as printed [mm]")
    figure.suptitle("The listing's curves: y3 does not stop as printed", fontsize="medium")
    return save(figure, folder / "listing.png")


def draw_moves(robot: pk.Robot, folder: Path) -> tuple[Path, Path]:
    """A move of the true machine by both laws, and the machine on the way."""
    start, end = [0, 0, -20, 0, 0, 0], [25, 10, 35, 0.1, -0.08, 0.25]
    cubic, quintic = (
        pk.trajectory.move(robot, start, end, duration=2.0, law=law) for law in ("cubic", "quintic")
    )
    print(f"\n{quintic}")
    for name, made in (("cubic", cubic), ("quintic", quintic)):
        jump = np.abs(made.sample(0.0).accelerations).max()
        print(f"{name:8} jumps by {jump:.4g} mm/s² in acceleration at the start")
    title = f"{robot.name}: straight in space, carriages"
    curves = move_figures.curves([cubic, quintic], ["cubic", "quintic"], title)
    times = [0.0, 1.0, 2.0]
    poses = quintic.sample(times).pose
    space = move_figures.in_space(robot, poses, [f"t = {t:g} s" for t in times], robot.name)
    return save(curves, folder / "move.png"), save(space, folder / "space.png")


def main(folder: Path) -> None:
    """Print the steps and draw the figures."""
    with np.printoptions(precision=4, suppress=True, linewidth=120):
        show(folder)


def show(folder: Path) -> None:
    printed, robot = pk.load("rbt-6t03p-printed"), pk.load("rbt-6t03p")
    print("--- with the numbers as printed: legs of variable length [mm]")
    steps(printed, "length")
    print("\n--- the check")
    print(pk.check_geometry(printed))
    print(f"\nas polar angles: rods of {rods_by_angles(printed)} mm; stated are 223")
    print("\n--- with the true geometry: sliders on rods of 223 mm [mm]")
    steps(robot, "slider")
    directions(robot)
    written = (draw_listing(folder), *draw_moves(robot, folder))
    print("\n" + "\n".join(str(path) for path in written))


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else HERE)
