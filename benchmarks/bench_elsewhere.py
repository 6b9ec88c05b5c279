"""What is said of places and days that were not measured: how near the truth comes to it.

`accuracy` of hexapods that were measured in one half of the workspace, in that half and in the
other, beside the note on regions that are left out. It holds if the model is right; gains that are
wrong and not free are no error of readings.

A session held out with a frame and zeros of its own: hexapods are measured in two sessions, each with a tracker of its own place and zeros found anew; a
third is held out, that finds its own frame and zeros first. Its rms over what `expected` says is
near 1 where the model is right, wherever the session was. Gains that are wrong and not free leave
errors that the fit takes for noise; the numbers of a session that covers a part of the workspace
take most of them up there, so that it comes out nearer than expected.

    python -m benchmarks.bench_elsewhere [RUNS]
"""

from __future__ import annotations

import sys
import warnings

import numpy as np

import pkmcal as pk
from benchmarks.timing import Report
from pkmcal.arrays import FloatArray

ROBOT = pk.load("hexapod")
NOISE, TURNING = 0.02, 5e-5  # mm, rad
ZEROS = 0.3  # mm, of each session
GAINS = (0.0, 1e-4, 1e-3, 3e-3)
PARTS = {"all of the workspace": (np.zeros(3), 1.0), "a third": (np.array([60.0, 40, 30]), 1 / 3)}
SPREAD = np.array([100.0, 100.0, 70.0, 0.2, 0.2, 0.2])


def session(true: pk.Robot, name: str, part: str, rng: np.random.Generator) -> pk.Measurements:
    """Positions of 40 poses in a frame and with zeros of their own."""
    middle, share = PARTS[part]
    poses = ROBOT.home + rng.uniform(-1.0, 1.0, (40, 6)) * SPREAD * share
    poses[:, :3] += middle
    q = ROBOT.inverse(poses)
    offsets = true.geometry.match("offset*")
    own = true.replace({n: true.geometry[n] + rng.normal(0.0, ZEROS) for n in offsets})
    frame = pk.screw.from_pose([*rng.uniform(-500, 500, 3), *rng.uniform(-0.2, 0.2, 3)])
    motion = frame @ pk.screw.from_pose(own.forward(q, guess=poses).pose)
    there = motion[:, :3, 3] + rng.normal(0.0, NOISE, (40, 3))
    return pk.Measurements(q, there, "position", session=name)


def ratio(part: str, gains: float, rng: np.random.Generator) -> float:
    """Rms of the session that is held out over what is expected of it."""
    true = drawn(gains, rng, ("base*", "platform*"))
    fitted = [session(true, name, "all of the workspace", rng) for name in ("one", "two")]
    held = session(true, "three", part, rng)
    found = pk.identify(
        ROBOT, fitted, ["base*", "platform*", "offset*"], holdout=held, unknown="frame",
        per_session=["offset*", "frame.*"],
    )  # fmt: skip
    return float(found.holdout_rms / found.holdout_expected)


def halves(gains: float, rng: np.random.Generator) -> tuple[float, float, bool, bool]:
    """True error over `accuracy` in the half that was measured, and in the other.

    Besides whether a note on regions is made, and whether the result is doubted.
    """
    true = drawn(gains, rng, ("base*", "platform*", "offset*"))
    measured, same = (in_half(rng, count, -1.0) for count in (60, 100))
    other = in_half(rng, 100, 1.0)
    q = ROBOT.inverse(measured)
    read = true.forward(q, guess=measured).pose + rng.normal(size=measured.shape) * [
        *[NOISE] * 3, *[TURNING] * 3,
    ]  # fmt: skip
    found = pk.identify(ROBOT, pk.Measurements(q, read, "pose"), ["base*", "platform*", "offset*"])
    ratios = []
    for poses in (same, other):
        there = true.forward(found.robot.inverse(poses), guess=poses).pose[:, :3]
        off = np.sqrt(((there - poses[:, :3]) ** 2).sum(axis=1).mean())
        ratios.append(float(off / np.sqrt((found.accuracy(poses) ** 2).mean())))
    noted = any(said.check == "regions-left-out" for said in found.verdict.said)
    return ratios[0], ratios[1], noted, found.verdict.state != "calibrated"


def in_half(rng: np.random.Generator, count: int, side: float) -> FloatArray:
    """Poses in one half of the workspace, by the sign of x."""
    off = rng.uniform(-1.0, 1.0, (count, 6)) * SPREAD
    off[:, 0] = side * np.abs(off[:, 0])
    return ROBOT.home + off


def drawn(gains: float, rng: np.random.Generator, free: tuple[str, ...]) -> pk.Robot:
    """A hexapod with errors of what is looked for, and of its gains."""
    geometry = ROBOT.geometry
    wrong = {n: geometry[n] + rng.normal(0.0, 0.3) for n in geometry.match(free)}
    return ROBOT.replace(wrong | {n: 1.0 + rng.normal(0.0, gains) for n in geometry.match("gain*")})


def main() -> None:
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 40
    report = Report("Places and days that were not measured")
    warnings.simplefilter("ignore")
    lines = []
    for gains in GAINS:
        every = np.array([halves(gains, np.random.default_rng(k)) for k in range(runs)])
        same, other = np.sqrt((every[:, :2] ** 2).mean(axis=0))
        noted, doubted = every[:, 2:].sum(axis=0).astype(int)
        lines.append([f"{1e3 * gains:g}", f"{same:.2f}", f"{other:.2f}", noted, doubted])
    report.text(f"Error over `accuracy`, rms of {runs} machines.")
    report.table(
        ["gains wrong, per mille", "measured half", "other half", "regions noted", "doubted"], lines
    )
    lines = []
    for gains in GAINS:
        for part in PARTS:
            found = [ratio(part, gains, np.random.default_rng(k)) for k in range(runs)]
            low, middle, high = np.quantile(found, [0.1, 0.5, 0.9])
            lines.append([f"{1e3 * gains:g}", part, f"{middle:.2f}", f"{low:.2f} to {high:.2f}"])
    report.text("A session that is held out, with a frame and zeros of its own.")
    report.table(["gains wrong, per mille", "held out", "rms / expected", "8 of 10"], lines)
    report.write("elsewhere")


if __name__ == "__main__":
    main()
