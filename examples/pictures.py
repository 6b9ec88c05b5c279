"""Draw the pictures of the examples: what the command of each README writes, made small.

python examples/pictures.py [EXAMPLE …]
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np

HERE = Path(__file__).parent


def draw(example: Path) -> None:
    """Run the example's commands in a copy of it; keep the picture of the residuals."""
    (commands,) = re.findall(r"^```sh\n(.*?)^```", (example / "README.md").read_text(), re.M | re.S)
    with tempfile.TemporaryDirectory() as made:
        folder = shutil.copytree(example, Path(made, "example"))
        bin_ = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
        subprocess.run(commands, shell=True, cwd=folder, env={**os.environ, "PATH": bin_})
        picture = cv2.imread(str(folder / "found" / "residuals.png"))
    small = cv2.resize(picture, None, fx=0.6, fy=0.6, interpolation=cv2.INTER_AREA)
    levels = np.round(small / 17.0).clip(0, 15).astype(np.uint8) * 17
    cv2.imwrite(str(example / "picture.png"), levels, [cv2.IMWRITE_PNG_COMPRESSION, 9])


if __name__ == "__main__":
    for readme in sorted(HERE.glob("*/README.md")):
        named = not sys.argv[1:] or readme.parent.name in sys.argv[1:]
        if named and "--out found" in readme.read_text(encoding="utf-8"):
            draw(readme.parent)
