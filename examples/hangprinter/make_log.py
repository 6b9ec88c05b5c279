"""Write config.g and lines.csv: a Hangprinter with anchors by tape, and its lines at 40 places.

The nozzle touches the bed at ten places, the first of which is the origin. Nobody measured where it
was at the other thirty. Lines are read to 0.2 mm.
"""

from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
NOISE = 0.2  # mm
STATED = np.array([(0, -1600, -120), (1550, 900, -120), (-1370, 790, -120), (0, 0, 2350.0)])
TRUE = np.array([(0, -1611.8, -131.5), (1544.9, 912.6, -121.3), (-1381.7, 797.4, -121.8),
                 (1.5, -2.5, 2361.8)])  # fmt: skip


def write() -> None:
    """Hang the nozzle at 40 places, and read its lines from the origin on."""
    rng = np.random.default_rng(4)
    places = rng.uniform([-600, -600, 0], [600, 600, 1300], (40, 3))
    places[:10, 2] = 0.0
    places[0] = 0.0
    lines = np.linalg.norm(places[:, None] - TRUE, axis=2) - np.linalg.norm(TRUE, axis=1)
    lines += rng.normal(0, NOISE, lines.shape)
    known = ["0,0,0", *[",,0"] * 9, *[",,"] * 30]
    rows = [
        ",".join(f"{value:.2f}" for value in row) + f",{xyz}"
        for row, xyz in zip(lines, known, strict=True)
    ]
    head = ",".join(f"q{i} [mm]" for i in range(1, 5)) + ",x [mm],y [mm],z [mm]"
    (HERE / "lines.csv").write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    anchors = " ".join(
        f"{letter}" + ":".join(f"{v:.1f}" for v in at)
        for letter, at in zip("ABCD", STATED, strict=True)
    )
    (HERE / "config.g").write_text(f"; my Hangprinter\nM669 K6 N4 {anchors}\n", encoding="utf-8")


if __name__ == "__main__":
    write()
