"""A session held out with a frame and zeros of its own: how near it comes to what is expected.

Hexapods are measured in two sessions, each with a tracker of its own place and zeros found anew; a
third is held out, that finds its own frame and zeros first. Its rms over what `expected` says is
near 1 where the model is right, wherever the session was. Gains that are wrong and not free leave
errors that the fit takes for noise; the numbers of a session that covers a part of the workspace
take most of them up there, so that it comes out nearer than expected.

    python -m benchmarks.bench_own_session [RUNS]
"""

from __future__ import annotations

import sys
import warnings

import numpy as np

import pkmcal as pk
from benchmarks.timing import Report

ROBOT = pk.load("hexapod")
NOISE = 0.02  # mm
ZEROS = 0.3  # mm, of each session
GAINS = (0.0, 1e-3, 3e-3)
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
    geometry = ROBOT.geometry
    wrong = {n: geometry[n] + rng.normal(0.0, 0.3) for n in geometry.match(["base*", "platform*"])}
    wrong |= {n: 1.0 + rng.normal(0.0, gains) for n in geometry.match("gain*")}
    true = ROBOT.replace(wrong)
    fitted = [session(true, name, "all of the workspace", rng) for name in ("one", "two")]
    held = session(true, "three", part, rng)
    found = pk.identify(
        ROBOT, fitted, ["base*", "platform*", "offset*"], holdout=held, unknown="frame",
        per_session=["offset*", "frame.*"],
    )  # fmt: skip
    return float(found.holdout_rms / found.holdout_expected)


def main() -> None:
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    report = Report("A session with a frame and zeros of its own")
    lines = []
    for gains in GAINS:
        for part in PARTS:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                found = [ratio(part, gains, np.random.default_rng(k)) for k in range(runs)]
            low, middle, high = np.quantile(found, [0.1, 0.5, 0.9])
            lines.append([f"{1e3 * gains:g}", part, f"{middle:.2f}", f"{low:.2f} to {high:.2f}"])
    report.table(["gains wrong, per mille", "held out", "rms / expected", "8 of 10"], lines)
    report.write("own_session")


if __name__ == "__main__":
    main()
