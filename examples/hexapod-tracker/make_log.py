"""Write tracker.csv and legs.csv: a hexapod at 30 poses, each measured twice, in a tracker's frame.

The tracker reads three reflectors, good to 0.01 mm a coordinate; reflector B slipped in pose 12.
"""

from pathlib import Path

import numpy as np

import pkmcal as pk

HERE = Path(__file__).parent
NOISE, POSES, SLIPPED = 0.01, 30, 11  # mm; how many; the pose in which B sat 0.4 mm too high
REFLECTORS = {"A": (70.0, 10.0, 20.0), "B": (-30.0, 65.0, 12.0), "C": (-45.0, -60.0, 25.0)}  # mm
TRACKER = pk.screw.from_pose([1850.0, -900.0, 320.0, 0.02, -0.01, 2.4])  # of the base, seen by it


def true_machine() -> pk.Robot:
    """The machine as it was made: each number off by 0.15 mm, one standard deviation."""
    robot = pk.load(HERE / "robot.toml")
    rng = np.random.default_rng(7)
    free = robot.geometry.match(["base*", "platform*", "offset*"])
    return robot.replace({name: robot.geometry[name] + rng.normal(0, 0.15) for name in free})


def write() -> None:
    """Drive the machine through the poses twice; write what tracker and controller logged."""
    robot, true = pk.load(HERE / "robot.toml"), true_machine()
    rng = np.random.default_rng(8)
    wanted = np.tile(pk.sample_poses(robot, POSES, share=0.6, seed=5), (2, 1))
    q = robot.inverse(wanted).round(3)
    platforms = pk.screw.from_pose(true.forward(q).pose)
    legs = ["pose,time [s]," + ",".join(f"Leg {i} [mm]" for i in range(1, 7))]
    points = ["point,time [s],x [mm],y [mm],z [mm]"]
    for k, (row, platform) in enumerate(zip(q, platforms, strict=True)):
        name, time = f"P{k + 1:02d}", 30 * k
        legs.append(f"{name},{time}," + ",".join(f"{value:.3f}" for value in row))
        for reflector, place in REFLECTORS.items():
            high = 0.4 if (k, reflector) == (SLIPPED, "B") else 0.0
            seen = TRACKER @ platform @ [*np.add(place, (0, 0, high)), 1.0]
            xyz = seen[:3] + rng.normal(0, NOISE, 3)
            points.append(f"{name}_{reflector},{time + 5}," + ",".join(f"{v:.4f}" for v in xyz))
    (HERE / "legs.csv").write_text("\n".join(legs) + "\n", encoding="utf-8")
    (HERE / "tracker.csv").write_text("\n".join(points) + "\n", encoding="utf-8")


if __name__ == "__main__":
    write()
