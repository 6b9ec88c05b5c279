"""Write maslow.yaml and maslow.log: a Maslow 4 as its anchors were paced off, and its belts' log.

The log has the four belts at 30 places that nobody measured, good to 0.5 mm.
"""

from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
NOISE = 0.5  # mm
CORNERS = ("tl", "tr", "bl", "br")
STATED = [(-10.0, 2040.0), (2960.0, 2040.0), (0.0, 0.0), (2950.0, 0.0)]  # paced off, mm
TRUE = np.array([(-27.6, 2064.9), (2924.3, 2066.5), (0.0, 0.0), (2953.2, 0.0)])


def write() -> None:
    """Drive the sled over a grid and read its belts."""
    grid = [(x, y) for x in np.linspace(500, 2450, 6) for y in np.linspace(450, 1600, 5)]
    away = np.array(grid)[:, None] - TRUE
    belts = np.linalg.norm(away, axis=2) + np.random.default_rng(2).normal(0, NOISE, (30, 4))
    rows = [",   ".join(f"{c}:{v:.2f}" for c, v in zip(CORNERS, row, strict=True)) for row in belts]
    log = "CLBM:[" + ",".join(f"{{{row}}}" for row in rows) + ",]\n"
    (HERE / "maslow.log").write_text(log, encoding="utf-8")
    numbers = [f"    {c}{a}: {v:.6f}" for c, at in zip(CORNERS, STATED, strict=True)
               for a, v in zip("XY", at, strict=True)]  # fmt: skip
    yaml = "\n".join(["name: Maslow 4", "kinematics:", "  MaslowKinematics:", *numbers]) + "\n"
    (HERE / "maslow.yaml").write_text(yaml, encoding="utf-8")


if __name__ == "__main__":
    write()
