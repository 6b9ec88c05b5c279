"""What intervals hold where fixed numbers are slightly wrong and their uncertainty is stated.

Five kinds of errors of a hexapod that its rigid model does not have: base and platform joints wrong
by 0.6 of the noise, read as positions or as poses; gains wrong by 1 per mille; play of 0.1 mm whose
direction was not recorded; three targets that lean alike. Each machine is identified twice, without
a statement and with the true one. Then statements that are wrong: twice as large as they should be,
made of what is right, and contradicted by one number that is four deviations off.

    python -m benchmarks.bench_uncertainty [RUNS [SCENARIO ...]]
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import pkmcal as pk
from pkmcal.arrays import FloatArray

NOISE = 0.02  # mm; of turnings its share of the characteristic length
ROBOT = pk.load("hexapod")
SPREAD = np.array([150.0, 150.0, 100.0, 0.3, 0.3, 0.3])  # of poses about the middle
ABOVE = np.array([0.0, 0.0, 50.0, 0.0, 0.0, 0.0])  # the middle, over home
TARGETS = np.array([[80.0, 0.0, 60.0], [-40.0, 70.0, 60.0], [-40.0, -70.0, 60.0]])
ALL = ("base*", "platform*", "offset*")


@dataclass(frozen=True)
class Scenario:
    """A machine that is slightly wrong where nothing is looked for.

    Attributes
    ----------
    free : sequence of str
        What is looked for.
    poses : int
        How many are measured.
    kind : str
        What is read.
    wrong : mapping of str to float
        Standard deviations of errors of numbers that are not free.
    stated : mapping
        The argument `uncertainty`.
    sigma : bool
        Whether the noise is stated.
    play, lean : float
        Half the play of each drive, and how far all targets lean, mm.
    stated_play : float, optional
        What is stated of the play, where it is not the truth.
    """

    free: tuple[str, ...]
    poses: int
    kind: str
    wrong: Mapping[str, float]
    stated: Mapping[str, Any]
    sigma: bool = False
    play: float = 0.0
    lean: float = 0.0
    stated_play: float | None = None


JOINTS = {"base*": 0.6 * NOISE, "platform*": 0.6 * NOISE}
GAINS = {"gain*": 1e-3}
SCENARIOS = {
    "joints, positions": Scenario(("offset*",), 40, "position", JOINTS, JOINTS, sigma=True),
    "joints, poses": Scenario(("offset*",), 40, "pose", JOINTS, JOINTS, sigma=True),
    "gains": Scenario(ALL, 45, "pose", GAINS, GAINS),
    "play": Scenario(ALL, 45, "pose", {}, {}, play=0.05),
    "leaning targets": Scenario(
        ALL, 45, "targets", {}, {"target*": 0.02, "common": {"target*": 0.29}}, lean=0.5
    ),
}


@dataclass(frozen=True)
class Tally:
    """Of one calibration: what its intervals hold and how good its poses are elsewhere."""

    inside: float
    width: float
    error: float
    actual: float
    stated: float
    doubted: bool
    named: frozenset[str]


def drawn(
    scenario: Scenario, random: np.random.Generator, off: Mapping[str, float] | None = None
) -> tuple[pk.Robot, pk.Measurements]:
    """A machine with errors, some of them as in `off`, and what is measured of it."""
    geometry = ROBOT.geometry
    changes = {n: geometry[n] + random.normal(0.0, 0.2) for n in geometry.match(scenario.free)}
    for pattern, sigma in scenario.wrong.items():
        changes |= {n: geometry[n] + random.normal(0.0, sigma) for n in geometry.match(pattern)}
    true = ROBOT.replace(changes | {n: geometry[n] + error for n, error in (off or {}).items()})
    places = ROBOT.home + ABOVE + random.uniform(-1.0, 1.0, (scenario.poses, 6)) * SPREAD
    q = ROBOT.inverse(places)
    pose = true.forward(q + scenario.play * random.choice([-1.0, 1.0], q.shape)).pose
    return true, read(scenario, q, pose, random)


def read(
    scenario: Scenario, q: FloatArray, pose: FloatArray, random: np.random.Generator
) -> pk.Measurements:
    """What an instrument reads at poses (N, 6)."""
    stated = scenario.play if scenario.stated_play is None else scenario.stated_play
    about = {"actuator_sigma": stated} if scenario.play else {}
    motion = pk.screw.from_pose(pose)
    if scenario.kind == "pose":
        small = pk.screw.from_pose(
            np.hstack(
                [np.zeros((len(q), 3)), random.normal(0.0, NOISE / ROBOT.length, (len(q), 3))]
            )
        )
        motion = motion.copy()
        motion[:, :3, :3] = small[:, :3, :3] @ motion[:, :3, :3]
        motion[:, :3, 3] += random.normal(0.0, NOISE, (len(q), 3))
        sigma = [NOISE] * 3 + [NOISE / ROBOT.length] * 3 if scenario.sigma else None
        return pk.Measurements(q, pk.screw.to_pose(motion), "pose", sigma=sigma, **about)
    targets = TARGETS if scenario.kind == "targets" else np.zeros((1, 3))
    lean = random.normal(size=3)
    lean *= scenario.lean / np.linalg.norm(lean)
    points = np.einsum("nij,kj->nki", motion[:, :3, :3], targets + lean) + motion[:, None, :3, 3]
    values = points.reshape(-1, 3) + random.normal(0.0, NOISE, (points.size // 3, 3))
    sigma = NOISE if scenario.sigma else None
    if len(targets) == 1:
        return pk.Measurements(q, values, "position", sigma=sigma)
    return pk.Measurements(
        np.repeat(q, len(targets), axis=0), values, "position", sigma=sigma,
        target=targets, target_index=np.tile(np.arange(len(targets)), len(q)),
    )  # fmt: skip


def tally(scenario: Scenario, true: pk.Robot, found: pk.Identification) -> Tally:
    """Compare a calibration with the truth, at the numbers and at poses elsewhere."""
    wanted = true.geometry.match(scenario.free)
    mine = [found.free.index(name) for name in wanted]
    error = np.array([found.values[i] - true.geometry[found.free[i]] for i in mine])
    ends = found.interval95[mine]
    half = (ends[:, 1] - ends[:, 0]) / 2.0
    random = np.random.default_rng(7)
    places = ROBOT.home + ABOVE + random.uniform(-1.0, 1.0, (60, 6)) * SPREAD
    q = ROBOT.inverse(places)
    at = found.robot.forward(q).pose
    off = at[:, :3] - true.forward(q).pose[:, :3]
    return Tally(
        inside=float(np.mean(np.abs(error) <= half)),
        width=float(np.mean(found.stderr[mine] ** 2)),
        error=float(np.mean(error**2)),
        actual=float(np.mean((off**2).sum(axis=1))),
        stated=float(np.mean(found.accuracy(at) ** 2)),
        doubted=found.verdict.state != "calibrated",
        named=frozenset(
            word.strip(":,")
            for said in found.verdict.said
            if said.check == "uncertainty-contradicted"
            for word in said.text.split()
        ),
    )


def runs(
    scenario: Scenario,
    count: int,
    stated: Mapping[str, Any],
    play: bool = True,
    first: int = 0,
    off: Mapping[str, float] | None = None,
) -> list[Tally]:
    """Calibrations of `count` machines with this statement."""
    done = []
    for k in range(first, first + count):
        true, measured = drawn(scenario, np.random.default_rng(k), off)
        if not play and scenario.play:
            measured = pk.Measurements(measured.actuators, measured.values, "pose")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found = pk.identify(ROBOT, measured, scenario.free, uncertainty=stated)
        done.append(tally(scenario, true, found))
    return done


def summed(done: list[Tally], get: Callable[[Tally], float]) -> float:
    """Mean over calibrations."""
    return float(np.mean([get(each) for each in done]))


def shown(name: str, done: list[Tally]) -> str:
    """One line of the table."""
    inside = 100.0 * summed(done, lambda t: t.inside)
    ratio = np.sqrt(summed(done, lambda t: t.stated) / summed(done, lambda t: t.actual))
    width, error, actual = (
        np.sqrt(summed(done, get))
        for get in (lambda t: t.width, lambda t: t.error, lambda t: t.actual)
    )
    doubted = sum(each.doubted for each in done)
    return (
        f"{name:34s} inside {inside:5.1f} %  ± {width:.4f}  error {error:.4f}  poses {actual:.4f}"
        f"  stated/actual {ratio:.2f}  doubted {doubted} of {len(done)}"
    )


def wrongly_stated(count: int) -> None:
    """Print what statements do that are too large, needless or contradicted."""
    for name in ("joints, positions", "joints, poses", "gains", "play", "leaning targets"):
        scenario = SCENARIOS[name]
        if scenario.play:  # the statement is that of the actuators
            scenario = replace(scenario, stated_play=2.0 * scenario.play)
        done = runs(scenario, count, doubled(scenario.stated))
        print(shown(f"{name}, stated twice as large", done), flush=True)
    right = replace(SCENARIOS["gains"], wrong={})
    for words, stated in (("nothing stated", {}), ("needlessly stated", GAINS)):
        print(shown(f"gains that are right, {words}", runs(right, count, stated)), flush=True)
    for name, number, error in (
        ("gains", "gain3", 4e-3), ("joints, poses", "base2.x", 4.0 * 0.6 * NOISE),
    ):  # fmt: skip
        scenario = SCENARIOS[name]
        off = runs(scenario, count, scenario.stated, off={number: error})
        on = runs(scenario, count, scenario.stated)
        print(
            f"{name}, {number} off by four deviations: named {sum(number in t.named for t in off)}"
            f" of {count}; any named falsely {sum(bool(t.named) for t in on)} of {count}",
            flush=True,
        )


def doubled(stated: Mapping[str, Any]) -> dict[str, Any]:
    """A statement with deviations twice as large."""
    return {
        name: doubled(each) if isinstance(each, Mapping) else 2.0 * each
        for name, each in stated.items()
    }


def main() -> None:
    """Print the table."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    for name in sys.argv[2:] or SCENARIOS:
        scenario = SCENARIOS[name]
        print(shown(f"{name}, nothing stated", runs(scenario, count, {}, play=False)), flush=True)
        print(shown(f"{name}, stated", runs(scenario, count, scenario.stated)), flush=True)
    if not sys.argv[2:]:
        wrongly_stated(count)


if __name__ == "__main__":
    main()
