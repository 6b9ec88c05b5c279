"""The 3R arm of the paper on joint structure errors: its path, its errors, and what they do.

    python examples/3r-joint-errors/joint_errors.py [curves.png]

prints each joint's error screw, where the joints then stand, and the tool's error along the path,
and draws the error curves of the paper's Fig. 8.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import pkmcal as pk

HERE = Path(__file__).parent
ERRORS = np.tile([0.1, 0.1, 0.1, *np.radians([0.01, 0.01, 0.01])], (3, 1))  # Table 3, mm and rad
PATH = np.radians(np.linspace(0.0, -30.0, 301))[:, None] * np.ones(3)  # all joints alike
PRINTED = {"joint 2": (0.2908, 0.1093, 520.1999), "joint 3": (0.3297, 350.2092, 520.3611)}


def joint_points(arm: pk.SerialArm) -> np.ndarray:
    """Where the points of the joints stand at zero with the errors, (n, 3): Table 4."""
    points, place = [], np.eye(4)
    for error, point in zip(arm.error_motions(), arm.points, strict=True):
        place = place @ error
        points.append((place @ [*point, 1.0])[:3])
    return np.array(points)


def tip_errors(arm: pk.SerialArm) -> np.ndarray:
    """Tool position with errors less without, along the path, (301, 3) mm: eq. 20 less eq. 5."""
    nominal = arm.replace(np.zeros((3, 6)))
    return (arm.forward(PATH) - nominal.forward(PATH))[:, :3, 3]


def draw(errors: np.ndarray, path: str | Path) -> None:
    """Fig. 8: the three error curves over the path."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7, 4), layout="constrained")
    axes = figure.subplots()
    for label, curve in zip("xyz", errors.T, strict=True):
        axes.plot(np.degrees(PATH[:, 0]), curve, label=f"Δ{label}")
    axes.set(xlabel="angle of each joint [deg]", ylabel="tool error [mm]", xlim=(0.0, -30.0))
    axes.set_title("3R arm: tool error by the joint errors of Table 3")
    axes.legend()
    axes.grid(alpha=0.3)
    figure.savefig(path, dpi=120)


def main(curves: str | Path) -> None:
    """Print the numbers and draw the curves."""
    arm = pk.load("3r").replace(ERRORS)
    print("error screw of each joint, in its own frame:", pk.screw.joint_error(*ERRORS[0]))
    print("\njoint points at zero with the errors [mm]")
    for name, point in zip(("joint 1", "joint 2", "joint 3"), joint_points(arm), strict=True):
        off = "" if name not in PRINTED else f"   printed: off by {point - PRINTED[name]}"
        print(f"  {name}  {point}{off}")
    print("\ntool error along the path [mm]")
    errors = tip_errors(arm)
    for k in (0, 150, 300):
        print(f"  {np.degrees(PATH[k, 0]):6.1f} deg  {errors[k]}")
    draw(errors, curves)
    print(f"\ncurves: {curves}")


if __name__ == "__main__":
    np.set_printoptions(precision=6, suppress=True)
    main(sys.argv[1] if len(sys.argv) > 1 else HERE / "curves.png")
