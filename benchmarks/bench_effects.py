"""How true calibrations with effects are: coverage, what is found that is not there, and the time.

Compliances of a hexapod under two payloads; arms that are rigid, of which `effects="auto"` must
take no sag and no wave of a gear may be named; arms that sag; and how long both take beside rigid
machines.

    python -m benchmarks.bench_effects [RUNS]
"""

from __future__ import annotations

import sys
import time
import warnings
from collections.abc import Callable

import numpy as np

import pkmcal as pk
from benchmarks.timing import Report, medians
from pkmcal.arms.weights import at_rest, gravity_torques
from pkmcal.arrays import FloatArray
from pkmcal.diagnostics.waves import scan_waves

NOISE = 0.02  # mm
ARM = pk.SerialArm(
    [[0, 0, 1], [0, 1, 0], [0, 1, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0]],
    [[0, 0, 0], [0, 0, 330], [0, 0, 600], [0, 0, 690], [320, 0, 690], [400, 0, 690]],
    [480, 0, 690, 0, 0, 0],
)
RANGE = np.array([2.4, 0.9, 0.9, 1.9, 1.6, 2.4])
TARGETS = np.array([[60.0, 30.0, 0.0], [50.0, -40.0, 15.0], [85.0, 5.0, 45.0]])
MASSES = np.array([4.0, 5.0, 3.0, 1.2, 0.7, 0.3])
CENTRES = np.array(
    [[0, 0, 220], [15, 10, 450], [60, 0, 680], [210, 5, 690], [340, 0, 700], [410, 10, 690]], float
)
SPRINGS = np.array([2.0, 4.0, 5.0, 15.0, 25.0, 25.0]) * 1e-8  # rad/(N mm)
FRAME = np.array([700.0, -150.0, 120.0, 0.05, -0.15, 1.2])


def payloads(seed: int, noise: float) -> tuple[pk.Identification, FloatArray]:
    """Calibrate a hexapod at 25 poses, each with nothing and with 800 N; return the truth, too.

    Poses near a singularity, where the machine gives way under the load, are left out.
    """
    rng = np.random.default_rng(seed)
    robot = pk.load("hexapod")
    true = robot.yielding({f"offset{i}": rng.uniform(1e-4, 2e-4) for i in range(1, 7)})
    true = true.replace({f"offset{i}": rng.normal(0, 0.3) for i in range(1, 7)})
    drawn = robot.inverse(pk.sample_poses(robot, 40, seed=seed))
    most = pk.Load(force=[0.0, 0.0, -800.0])
    q = drawn[true.forward(drawn).ok & true.forward(drawn, load=most).ok][:25]
    force = np.zeros((50, 3))
    force[25:, 2] = -800.0
    rows = pk.VirtualMachine(true, noise, seed=seed).measure(
        np.vstack([q, q]), "pose", load=pk.Load(force=force)
    )
    found = pk.identify(robot, rows, effects=[pk.Elasticity("offset*")])
    truth = np.array([true.geometry[name] for name in found.free])
    return found, truth


def arm_rows(seed: int, sags: bool, shared: float, poses: int) -> pk.Measurements:
    """Three targets at random poses of an arm with errors, from an unknown place; `shared` by pose."""
    rng = np.random.default_rng(seed)
    true = ARM.replace(rng.normal(size=(6, 6)) * [0.3, 0.3, 0.3, 5e-4, 5e-4, 5e-4])
    theta = rng.uniform(-1, 1, (poses, 6)) * RANGE
    stands = theta
    if sags:
        stands = at_rest(lambda at: gravity_torques(true, at, MASSES, CENTRES), theta, SPRINGS)
    tool = pk.screw.from_pose(FRAME) @ true.forward(stands)
    points = np.einsum("nij,kj->nki", tool[:, :3, :3], TARGETS) + tool[:, None, :3, 3]
    points += rng.normal(0, NOISE, points.shape) + rng.normal(0, shared, (poses, 1, 3))
    reflectors = np.tile(np.arange(3), poses)
    return pk.Measurements(
        np.repeat(theta, 3, axis=0), points.reshape(-1, 3), "position", target=TARGETS,
        target_names=("A", "B", "C"), target_index=reflectors,
    )  # fmt: skip


def fitted(m: pk.Measurements, effects: object) -> pk.Identification:
    return pk.identify(ARM, m, effects=effects, unknown=["frame", "target"])


def share_of(runs: int, happens: Callable[[int], bool]) -> str:
    count = sum(happens(seed) for seed in range(runs))
    return f"{count} of {runs}"


def takes_sag(found: pk.Identification) -> bool:
    return any(name.startswith("sag") for name in found.free)


def compliances(runs: int, noise: float) -> str:
    """How well a hexapod's compliances are found, in one line."""
    inside = known = calibrated = 0
    off: list[FloatArray] = []
    for seed in range(runs):
        found, truth = payloads(seed, noise)
        low, high = found.interval95.T
        inside, known = inside + int(((low <= truth) & (truth <= high)).sum()), known + len(truth)
        soft = [i for i, name in enumerate(found.free) if name.startswith("compliance")]
        off.append(found.values[soft] / truth[soft] - 1)
        calibrated += found.verdict.state == "calibrated"
    return (
        f"compliances of a hexapod, 25 poses under 0 and 800 N, poses to {noise} mm: {calibrated}"
        f" of {runs} calibrated; {100 * inside / known:.1f} % of all numbers inside of their 95 %"
        f" intervals; compliances off by {100 * float(np.sqrt(np.mean(np.square(off)))):.1f} % rms"
    )


def main(runs: int = 200) -> None:
    warnings.simplefilter("ignore", pk.CalibrationWarning)
    report = Report("effects")
    start = time.process_time()
    for noise in (0.01, 0.02):
        report.text(compliances(runs, noise))
    for shared in (0.0, 0.05):
        taken = share_of(
            runs, lambda s, e=shared: takes_sag(fitted(arm_rows(s, False, e, 40), "auto"))
        )
        report.text(
            f"rigid arms, 40 poses, errors of {shared} mm shared by a pose: auto takes sag in {taken}"
        )
    named = share_of(
        runs, lambda s: bool(scan_waves(fitted(arm_rows(s, True, 0.03, 120), [pk.Sag("all")])))
    )
    report.text(f"arms that sag, 120 poses, without waves: waves are named in {named}")
    few = max(runs // 10, 1)
    taken = share_of(few, lambda s: takes_sag(fitted(arm_rows(s, True, 0.0, 40), "auto")))
    report.text(f"arms that sag: auto takes sag in {taken}")
    m = arm_rows(1, False, 0.0, 400)
    times = medians(
        {"rigid": lambda: fitted(m, ()), "sag": lambda: fitted(m, [pk.Sag()])},
        rounds=5,
        clock=time.process_time,
    )
    report.text(f"identify of 400 poses: with sag {times['sag'] / times['rigid']:.2f} times rigid")
    robot = pk.load("hexapod")
    soft = robot.yielding({f"offset{i}": 1e-4 for i in range(1, 7)})
    q = robot.inverse(pk.sample_poses(robot, 100_000, seed=1))
    load = pk.Load(force=[0.0, 0.0, -800.0])
    times = medians(
        {"rigid": lambda: robot.forward(q), "loaded": lambda: soft.forward(q, load=load)},
        rounds=5,
        clock=time.process_time,
    )
    report.text(f"forward of 1e5 rows: loaded {times['loaded'] / times['rigid']:.2f} times rigid")
    report.text(f"processor time: {time.process_time() - start:.0f} s")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
