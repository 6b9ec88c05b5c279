"""Draw where all eight cables can pull, at three heights: ``python draw.py``."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import pkmcal as pk

HERE = Path(__file__).parent


def main() -> None:
    """Write picture.png: the largest tension that is needed, white where some cable would push."""
    robot = pk.load(HERE / "robot.toml")
    x, y = np.meshgrid(np.linspace(-2400, 2400, 49), np.linspace(-1800, 1800, 37))
    figure, axes = plt.subplots(1, 3, figsize=(7.2, 2.4), sharey=True, layout="constrained")
    for height, each in zip((600, 1200, 1800), axes, strict=True):
        poses = np.zeros((*x.shape, 6))
        poses[..., 0], poses[..., 1], poses[..., 2] = x, y, height
        held = pk.tensions(robot, poses.reshape(-1, 6))
        most = np.where(held.ok, held.tension.max(axis=1), np.nan).reshape(x.shape)
        image = each.pcolormesh(x, y, most, vmin=0, vmax=300, cmap="viridis", shading="nearest")
        each.set(title=f"z = {height} mm", xlabel="x [mm]", aspect="equal")
    axes[0].set_ylabel("y [mm]")
    figure.colorbar(image, ax=axes, label="largest tension [N]")
    figure.savefig(HERE / "picture.png", dpi=90)


if __name__ == "__main__":
    main()
