"""Draw the figures of the pages on calibration: ``python docs/calibration/draw.py``."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

import pkmcal as pk

HERE = Path(__file__).parent
BLUE, ORANGE, GREY = "#3b6ea5", "#d9731a", "#999999"


def figure(width: float = 6.4, height: float = 2.8) -> Axes:
    """Return empty axes without a frame at the top and right."""
    axes = plt.figure(figsize=(width, height), layout="constrained").gca()
    axes.spines[["top", "right"]].set_visible(False)
    return axes


def save(axes: Axes, name: str) -> None:
    """Write a figure as SVG, the same bytes each time."""
    assert axes.figure is not None
    axes.figure.savefig(HERE / f"{name}.svg", metadata={"Date": None})
    plt.close("all")


def residual() -> None:
    """Draw what is minimised: from a row's actuators to its residual."""
    axes = figure(6.4, 1.5)
    axes.set_axis_off()
    axes.set(xlim=(0, 100), ylim=(0, 30))
    boxes = [("actuators q", 8, GREY), ("pose F(θ, q)", 33, BLUE),
             ("predicted reading h", 62, BLUE), ("residual", 90, ORANGE)]  # fmt: skip
    for text, x, colour in boxes:
        box = {"boxstyle": "round,pad=0.5", "facecolor": "white", "edgecolor": colour}
        axes.text(x, 20, text, ha="center", va="center", bbox=box)
    arrow = {"arrowstyle": "->", "color": "#444444"}
    for start, end in ((15.5, 24), (42, 49), (75.5, 83)):
        axes.annotate("", (end, 20), (start, 20), arrowprops=arrow)
    for text, x, to in (("geometry θ", 33, 33), ("frame, target", 62, 62), ("read: m", 90, 90)):
        axes.text(x, 4, text, ha="center", va="center", color="#444444")
        axes.annotate("", (to, 14.5), (x, 7), arrowprops=arrow)
    save(axes, "residual")


def singular_values() -> None:
    """Draw the singular values that decide what is identifiable, with the gap between."""
    robot = pk.load("2tpr2tps")
    poses = pk.sample_poses(robot, 40, seed=2, share=0.8)
    free = [robot.geometry.names.index(name) for name in robot.model.free]
    seen = robot.error_jacobian(poses)[:, :3][:, :, free]  # positions, mm
    units = [robot.geometry.units[place] for place in free]
    seen = seen / np.where(np.equal(units, "mm"), 1.0, robot.length)  # angles as arcs
    values = np.linalg.svd(seen.reshape(-1, len(free)), compute_uv=False)
    values = np.maximum(values / values[0], 1e-17)
    rank = int(np.sum(values > 1e-9))
    axes = figure()
    places = np.arange(1, len(values) + 1)
    kept = places <= rank
    axes.semilogy(places[kept], values[kept], "o", color=BLUE, label="identifiable")
    axes.semilogy(places[~kept], values[~kept], "o", color=ORANGE, label="not identifiable")
    axes.axvline(rank + 0.5, color=GREY, linestyle=":")
    axes.set(xlabel="combination of parameters", ylabel="singular value over the largest")
    axes.legend(frameon=False)
    save(axes, "singular-values")


def intervals() -> None:
    """Draw 95 % intervals of one number from forty calibrations, and the true value."""
    robot = pk.load("hexapod")
    true = robot.replace({"offset1": 0.4})
    axes, outside = figure(), 0
    for k in range(40):
        q = robot.inverse(pk.sample_poses(robot, 15, seed=k, share=0.5))
        seen = pk.VirtualMachine(true, noise=0.02, seed=k).measure(q, "position")
        found = pk.identify(robot, dataclasses.replace(seen, sigma=None), "offset*")
        value, (low, high) = found.values[0], found.interval95[0]
        holds = low <= 0.4 <= high
        outside += not holds
        axes.plot([k, k], [low, high], color=BLUE if holds else ORANGE, linewidth=1.5)
        axes.plot(k, value, ".", color=BLUE if holds else ORANGE)
    axes.axhline(0.4, color="#444444", linewidth=0.8)
    axes.set(xlabel="calibration, 15 points each", ylabel="offset1 [mm]")
    axes.set_title(f"{40 - outside} of 40 intervals hold the true value", fontsize=9)
    save(axes, "intervals")


def session(machine: pk.Robot, seed: int) -> pk.Measurements:
    """Measure forty points of the hexapod."""
    robot = pk.load("hexapod")
    q = robot.inverse(pk.sample_poses(robot, 40, seed=seed, share=0.5))
    noise = np.random.default_rng(seed).normal(0, 0.02, (40, 3))
    return pk.Measurements(q, machine.forward(q).pose[:, :3] + noise, "position")


def holdout() -> None:
    """Draw distances at fitted points, and at those of a later session in which a leg slipped."""
    robot = pk.load("hexapod")
    true = robot.replace({"offset1": 0.4, "offset3": -0.2})
    later = session(true.replace({"offset5": 0.3}), 2)
    found = pk.identify(robot, session(true, 1), free="offset*", holdout=later)
    fitted = np.linalg.norm(found.residuals[0], axis=1)
    held = np.linalg.norm(later.values - found.robot.forward(later.actuators).pose[:, :3], axis=1)
    axes = figure()
    axes.semilogy(fitted, "o", color=BLUE, markersize=4, label="fitted, first session")
    axes.semilogy(40 + np.arange(40), held, "o", color=ORANGE, markersize=4, label="held out")
    axes.axhline(found.holdout_expected, color=GREY, linestyle=":")
    axes.text(80, found.holdout_expected * 1.1, "expected", ha="right", color="#444444")
    axes.set(xlabel="row", ylabel="distance [mm]")
    axes.legend(frameon=False)
    save(axes, "holdout")


def sessions() -> None:
    """Draw zeros of legs found on two days, with their intervals."""
    robot = pk.load("hexapod")
    sets = []
    for name, zeros, seed in (("monday", 0.1, 1), ("thursday", 1.2, 2)):
        true = robot.replace({"offset1": 0.4, "offset5": zeros})
        sets.append(dataclasses.replace(session(true, seed), session=name))
    both = pk.identify(robot, sets, "offset*", per_session="offset*")
    axes = figure()
    for day, colour, by in (("monday", BLUE, -0.12), ("thursday", ORANGE, 0.12)):
        places = [both.free.index(f"offset{i}@{day}") for i in range(1, 7)]
        ends = np.abs(both.interval95[places].T - both.values[places])
        axes.errorbar(np.arange(1, 7) + by, both.values[places], ends, fmt="o", color=colour,
                      markersize=4, capsize=3, label=day)  # fmt: skip
    axes.set(xlabel="leg", ylabel="offset [mm]", xticks=range(1, 7))
    axes.legend(frameon=False)
    save(axes, "sessions")


def temperature() -> None:
    """Draw distances against the temperature, with the expansion stated and without."""
    rng = np.random.default_rng(1)
    robot = pk.load("hexapod")
    true = robot.replace({"offset1": 0.4})
    q = robot.inverse(pk.sample_poses(robot, 40, seed=1, share=0.5))
    warmth = np.linspace(20, 28, 40)
    lengths = {name: robot.geometry[name] for name in robot.geometry.match(["base*", "platform*"])}
    seen = []
    for row, above in enumerate(warmth - 20):
        longer = {f"gain{i}": 1 + 11.5e-6 * above for i in range(1, 7)}
        longer |= {name: mm * (1 + 11.5e-6 * above) for name, mm in lengths.items()}
        seen.append(true.replace(longer).forward(q[row]).pose[:3] + rng.normal(0, 0.01, 3))
    measured = pk.Measurements(q, seen, temperature=warmth)
    axes = figure()
    for effects, colour, text in (((), ORANGE, "without"), ([pk.Expansion(11.5e-6)], BLUE, "with")):
        found = pk.identify(robot, measured, free="offset*", effects=list(effects))
        axes.plot(warmth, found.residuals[0][:, 2], "o-", color=colour, markersize=3,
                  linewidth=0.8, label=f"{text} the expansion")  # fmt: skip
    axes.set(xlabel="temperature [°C]", ylabel="residual of z [mm]")
    axes.legend(frameon=False)
    save(axes, "temperature")


if __name__ == "__main__":
    mpl.rcParams |= {"svg.hashsalt": "pkmcal", "svg.fonttype": "none", "font.size": 9}
    for draw in (residual, singular_values, intervals, holdout, sessions, temperature):
        draw()
