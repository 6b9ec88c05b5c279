"""Write rows.csv: a hexapod on legs that yield, at 30 poses without and with 80 kg on it."""

from pathlib import Path

import numpy as np

import pkmcal as pk

HERE = Path(__file__).parent
NOISE, MASS, CENTRE = 0.01, 80.0, (0.0, 0.0, 60.0)  # mm; kg; mm in the frame of the platform
COMPLIANCE = (5.5e-5, 8.0e-5, 6.5e-5, 5.0e-5, 9.5e-5, 7.0e-5)  # mm/N of each leg
ERRORS = {"offset1": 0.25, "offset4": -0.18, "base2.x": 0.3, "platform5.z": -0.2}  # mm


def true_machine() -> pk.Robot:
    """The machine as it is: with errors of its geometry, and legs of six compliances."""
    robot = pk.load("hexapod")
    robot = robot.replace({name: robot.geometry[name] + by for name, by in ERRORS.items()})
    return robot.yielding({f"offset{i}": c for i, c in enumerate(COMPLIANCE, 1)})


def rows() -> pk.Measurements:
    """What a tracker reads of the platform's pose, first without the payload."""
    robot = pk.load("hexapod")
    q = robot.inverse(pk.sample_poses(robot, 30, share=0.6, seed=1)).round(4)
    masses = np.repeat([0.0, MASS], len(q))
    load = pk.Load(mass=masses, centre=np.where(masses[:, None] > 0.0, CENTRE, 0.0))
    machine = pk.VirtualMachine(true_machine(), NOISE, seed=1)
    return machine.measure(np.vstack([q, q]), "pose", load=load)


if __name__ == "__main__":
    rows().write(HERE / "rows.csv")
