"""Write belts.csv: what four belts read at 25 places that nobody measured, 0.4 mm of noise."""

from pathlib import Path

import numpy as np

import pkmcal as pk

HERE = Path(__file__).parent
TRUE = {"base2.x": 3043.0, "base3.x": -3.0, "base3.y": 2132.0, "base4.x": 3036.0, "base4.y": 2133.0}


def main() -> None:
    """Drive the true machine over a grid and read its belts."""
    rng = np.random.default_rng(0)
    true = pk.load(HERE / "robot.toml").replace(TRUE)
    poses = np.zeros((25, 6))
    poses[:, :2] = [[x, y] for x in np.linspace(600, 2400, 5) for y in np.linspace(500, 1600, 5)]
    lengths = true.inverse(poses) + rng.normal(0, 0.4, (25, 4))
    pk.Measurements(lengths.round(2), None, "closure").write(HERE / "belts.csv")


if __name__ == "__main__":
    main()
