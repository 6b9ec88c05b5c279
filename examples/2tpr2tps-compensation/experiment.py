"""The compensation experiment of the 2TPR&2TPS paper (§4.2), end to end on a simulated machine.

A machine with errors in all 28 parameters goes to 30 random poses at zero orientation; a tracker
reads its positions; a particle swarm (eq. 19) minimises eq. 18 for each pose; the corrected
commands go out and the machine is measured again. Writes desired.csv, measured.csv and the figures.

    python examples/2tpr2tps-compensation/experiment.py [FOLDER]
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import pkmcal as pk
from pkmcal.core.swarm import CONSTRICTION
from pkmcal.measurements.pose_csv import write_poses

HERE = Path(__file__).parent
SIGMA = 0.5  # mm, of each of the 28 errors
NOISE = 0.02  # mm, of each coordinate the tracker reads
POSES = 30
MARGIN = 5.0  # mm that a leg keeps from the ends of its stroke, for its errors
SEED = 18


@dataclass(frozen=True)
class Experiment:
    """One run; poses in mm and rad, distances in mm."""

    desired: np.ndarray  # (30, 6)
    measured: np.ndarray  # (30, 3), what the tracker read first
    compensation: pk.Compensation
    before: np.ndarray  # (30, 3), position errors as measured
    after: np.ndarray

    @property
    def improvement(self) -> float:
        """By how many percent the mean distance to the desired position fell."""
        before, after = (
            np.linalg.norm(error, axis=1).mean() for error in (self.before, self.after)
        )
        return float(100 * (1 - after / before))


def with_errors(robot: pk.Robot, rng: np.random.Generator, sigma: float = SIGMA) -> pk.Robot:
    """The robot with an error in each joint coordinate and each zero length."""
    names = robot.geometry.match(["base*", "platform*", "offset*"])
    errors = rng.normal(0.0, sigma, len(names))
    return robot.replace(
        {name: robot.geometry[name] + error for name, error in zip(names, errors, strict=True)}
    )


def level_poses(robot: pk.Robot, rng: np.random.Generator, count: int = POSES) -> np.ndarray:
    """Random poses at zero orientation that keep the strokes."""
    poses = np.zeros((20 * count, 6))
    poses[:, 1] = rng.uniform(-80.0, 80.0, len(poses))
    poses[:, 2] = rng.uniform(330.0, 450.0, len(poses))
    return within_strokes(robot, poses)[:count]


def within_strokes(robot: pk.Robot, poses: np.ndarray) -> np.ndarray:
    """Those of the poses at which every leg keeps its stroke."""
    shortest, longest = np.transpose([limb.stroke for limb in robot.model.limbs])
    q = robot.inverse(poses)
    return poses[((q > shortest + MARGIN) & (q < longest - MARGIN)).all(axis=1)]


def run(seed: int = SEED, noise: float = NOISE) -> Experiment:
    """The experiment, with the swarm of the paper and β read from the position."""
    rng = np.random.default_rng(seed)
    robot = pk.load("2tpr2tps")
    true = with_errors(robot, rng)
    desired = level_poses(robot, rng).round(3)
    machine = pk.VirtualMachine(true, noise=noise, seed=seed)
    measured = machine.measure(robot.inverse(desired)).values
    found = pk.compensate(
        robot, desired, measured, method="pso", orientation="from-position", seed=seed
    )
    again = machine.measure(found.actuators).values
    return Experiment(desired, measured, found, measured - desired[:, :3], again - desired[:, :3])


def draw_errors(result: Experiment, title: str, path: Path) -> None:
    """Fig. 11, 12: the position error of each pose before and after."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.5, 6.5), layout="constrained")
    panels = figure.subplots(4, 1, sharex=True)
    number = np.arange(1, len(result.desired) + 1)
    for panel, name, k in zip(panels, ("Δx", "Δy", "Δz", "distance"), range(4), strict=True):
        for label, error, colour, mark in (
            ("before", result.before, "#d55e00", "o"),
            ("after", result.after, "#0072b2", "s"),
        ):
            values = error[:, k] if k < 3 else np.linalg.norm(error, axis=1)
            panel.plot(number, values, mark + "-", ms=3.5, lw=0.8, color=colour, label=label)
        panel.set_ylabel(f"{name} [mm]")
        panel.grid(axis="y", color="0.88")
        panel.axhline(0, color="0.5", lw=0.6)
    panels[0].set_title(f"{title}: {result.improvement:.2f} % of the mean error is gone")
    panels[-1].set(xlabel="pose", xlim=(0, len(number) + 1))
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    figure.savefig(path, dpi=110, metadata={"Software": None})


def draw_convergence(histories: dict[str, np.ndarray], path: Path) -> None:
    """Fig. 13: E of the best particle against the iteration, every pose thin, the median thick."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.5, 4.0), layout="constrained")
    axes = figure.subplots()
    for (label, history), colour in zip(histories.items(), ("#d55e00", "#0072b2"), strict=True):
        axes.semilogy(history.T, color=colour, lw=0.5, alpha=0.25)
        axes.semilogy(np.median(history, axis=0), color=colour, lw=2.2, label=label)
    axes.axvline(17, color="0.35", lw=1, ls="--")
    axes.text(18.5, 3e-10, "17 iterations", color="0.35")
    axes.set(
        title="Convergence of the swarms",
        xlabel="iteration",
        ylabel="E [mm]",
        xlim=(0, history.shape[1] - 1),
    )
    axes.grid(color="0.88")
    axes.legend(frameon=False)
    figure.savefig(path, dpi=110, metadata={"Software": None})


def main(folder: Path) -> None:
    simulated, measured = run(noise=0.0), run()
    write_poses(folder / "desired.csv", measured.desired)
    robot = pk.load("2tpr2tps")
    pk.Measurements(
        robot.inverse(measured.desired).round(6),
        measured.measured.round(4),
        "position",
        sigma=NOISE,
        actuator_units="mm",
    ).write(folder / "measured.csv")
    stable = pk.compensate(
        robot,
        measured.desired,
        measured.measured,
        method="pso",
        orientation="from-position",
        seed=SEED,
        swarm=CONSTRICTION,
    )
    draw_errors(simulated, "Without noise", folder / "fig11.png")
    draw_errors(measured, f"Tracker good to {NOISE} mm", folder / "fig12.png")
    factors = "ω = 0.8, c1 = c2 = 1.5 (printed)", "ω = 0.7298, c1 = c2 = 1.49618 (constriction)"
    histories = measured.compensation.history, stable.history
    draw_convergence(dict(zip(factors, histories, strict=True)), folder / "fig13.png")
    exact = pk.compensate(robot, measured.desired, measured.measured, orientation="from-position")
    for name, result in (("without noise", simulated), (f"noise {NOISE} mm", measured)):
        before, after = (np.linalg.norm(error, axis=1) for error in (result.before, result.after))
        print(
            f"{name:14}  mean error {before.mean():.4f} -> {after.mean():.4f} mm,"
            f" {result.improvement:.3f} % gone (published: 98.148 and 87.457 %)"
        )
    median = np.median(measured.compensation.history, axis=0)
    print(
        f"the swarms: E {median[0]:.3f} mm at the start, {median[17]:.3f} after 17 iterations,"
        f" {median[-1]:.1e} after 200 (median of the poses)"
    )
    off = np.abs(measured.compensation.correction - exact.correction).max()
    print(f"the closed form gives the same corrections to {off:.1e} mm")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else HERE)
