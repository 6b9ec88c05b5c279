"""Write rows.csv: an arm whose joints 2 and 3 yield, at 30 poses with 5 kg and with 120 kg."""

from pathlib import Path

import numpy as np

import pkmcal as pk

HERE = Path(__file__).parent
NOISE, TARGET, CENTRE = 0.03, (0.0, 0.0, 150.0), (0.0, 0.0, 180.0)  # mm, in the frame of the tool
COMPLIANCE = {2: 5.0e-10, 3: 9.0e-10}  # rad/(N mm): 2 and 1.1 MN m/rad
ERRORS = {(2, 2): 0.4, (3, 4): 3e-4, (5, 5): -4e-4}  # of joint j the number k: mm, rad


def true_arm() -> pk.SerialArm:
    """Return the arm as it is: with errors of its joints, two of which yield."""
    errors = np.zeros((6, 6))
    for (joint, number), value in ERRORS.items():
        errors[joint - 1, number] = value
    return pk.load(HERE / "robot.toml").replace(errors).yielding(COMPLIANCE)


def rows() -> pk.Measurements:
    """Return the positions of a reflector, first with the light tool."""
    rng = np.random.default_rng(3)
    wide = np.radians([60, 35, 40, 90, 60, 90])
    q = rng.uniform(-wide, wide, (30, 6))
    machine = pk.VirtualMachine(true_arm(), NOISE, seed=3)
    load = pk.Load(mass=np.repeat([5.0, 120.0], len(q)), centre=CENTRE)
    return machine.measure(np.vstack([q, q]).round(6), target=TARGET, load=load)


if __name__ == "__main__":
    rows().write(HERE / "rows.csv")
