"""Tests of rows where what is stated of the actuators is not what their noise is."""

from __future__ import annotations

from functools import partial
from itertools import product
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.diagnostics import two_machines
from pkmcal.diagnostics.causes import found_causes
from pkmcal.diagnostics.late import late
from pkmcal.diagnostics.visits import visits_of

from ..simulated import with_errors
from ..sweeps import sweep

COUNT = 50
NOISE = np.array([0.02, 0.02, 0.02, 5e-5, 5e-5, 5e-5])  # mm, rad

pytestmark = pytest.mark.filterwarnings("ignore:residuals are", "ignore:the residuals of")


def hexapod(rng: np.random.Generator, width: int) -> Any:
    robot = pk.load("hexapod")
    q = robot.inverse(pk.sample_poses(robot, COUNT, seed=int(rng.integers(1000)), share=0.5))
    true = [with_errors(robot, 0.1, rng) for _ in range(2)]
    return robot, q, [lambda at, r=r: r.forward(at).pose[:, :width] for r in true]


def arm(rng: np.random.Generator, width: int) -> Any:
    robot = pk.SerialArm.from_dh(
        a=[0, 300, 50, 0, 0, 0], d=[400, 0, 0, 350, 0, 80],
        alpha=[-np.pi / 2, 0, -np.pi / 2, np.pi / 2, -np.pi / 2, 0], theta=np.zeros(6),
    )  # fmt: skip
    size = 0.1 * np.array([1, 1, 1, 2e-3, 2e-3, 2e-3])
    true = [robot.replace(size * rng.normal(size=(6, 6))) for _ in range(2)]
    poses = [lambda at, r=r: pk.screw.to_pose(r.forward(at))[:, :width] for r in true]
    return robot, rng.uniform(-1.0, 1.0, (COUNT, 6)), poses


# a machine, and noise of its actuators: such as it has, and much
MACHINES: dict[str, tuple[Any, float, float]] = {
    "hexapod": (partial(hexapod, width=6), 0.01, 0.1),
    "hexapod by positions": (partial(hexapod, width=3), 0.01, 0.1),
    "arm": (partial(arm, width=6), 3e-5, 1e-3),
}


def calibrated(
    machine: Any, seed: int, actual: float, stated: float, mixed: bool = False, lag: float = 0.0
) -> pk.Identification:
    """Rows of which actuators have noise of one size and a stated one of another."""
    rng = np.random.default_rng(seed)
    robot, q, (one, other) = machine(rng)
    at = q + actual * rng.normal(size=q.shape)
    read = one(at)
    if mixed:
        read[1::2] = other(at[1::2])
    read[1:] += lag * (read[:-1] - read[1:])
    sigma = NOISE[: read.shape[1]]
    read += sigma * rng.normal(size=read.shape)
    kind = "pose" if read.shape[1] == 6 else "position"
    return pk.identify(robot, pk.Measurements(q, read, kind, sigma=sigma, actuator_sigma=stated))


@sweep(
    "name, turn",
    product(MACHINES, ["every second", "a third"]),
    quick=[("hexapod by positions", "every second"), ("arm", "a third")],
)
def test_a_groups_test_does_not_depend_on_what_is_stated(name: str, turn: str) -> None:
    """The residuals tell the noise of readings and actuators, whatever weights the fit had."""
    machine, exact, _ = MACHINES[name]
    mine = np.arange(COUNT) % (2 if turn == "every second" else 3) == 1
    chances = []
    for stated in (0.2 * exact, exact, 5.0 * exact):
        found = calibrated(machine, 3, exact, stated)
        use, key = two_machines.equations_of_visits(found, visits_of(found))
        known = two_machines.tested(
            found, two_machines.weighed_alike(found).fit, {"": mine}, use, key
        )
        chances.append(known[""].chance)
    assert chances[0] == pytest.approx(chances[1], rel=0.05)
    assert chances[2] == pytest.approx(chances[1], rel=0.05)


@sweep("name", MACHINES, quick=["arm"])
def test_exact_actuators_whose_noise_is_stated_are_no_second_machine(name: str) -> None:
    machine, _, large = MACHINES[name]
    for seed in range(4):
        seen = two_machines.apart(calibrated(machine, seed, 0.0, large))
        assert seen is None or not seen.found


@sweep(
    "name, times",
    product(MACHINES, [0.3, 1.0, 10.0]),
    quick=[("hexapod by positions", 0.3), ("arm", 10.0)],
)
def test_a_second_machine_is_seen_whatever_is_stated_of_the_actuators(
    name: str, times: float
) -> None:
    machine, exact, _ = MACHINES[name]
    seen = two_machines.apart(calibrated(machine, 5, exact, times * exact, mixed=True))
    assert seen is not None and seen.found and seen.large
    assert seen.group == "every second pose"


@sweep("name", MACHINES, quick=["arm"])
def test_a_test_of_lag_does_not_depend_on_what_is_stated(name: str) -> None:
    """Nor does what causes explain: both rest on the noise that the residuals show."""
    machine, exact, _ = MACHINES[name]
    seen, named = [], []
    for stated in (0.2 * exact, exact, 5.0 * exact):
        found = calibrated(machine, 7, exact, stated, lag=1e-3)
        lag = late(found)
        assert lag is not None and lag.found and not lag.instead
        seen.append(np.log(lag.chance))
        named.append(found_causes(found)[0].name[:3])
    assert seen == pytest.approx([seen[1]] * 3, rel=0.1)  # the numbers found differ, too
    assert set(named) == {"lag"}


@pytest.mark.filterwarnings("ignore:.*further than errors of a machine")
def test_heights_of_a_plane_beside_noisy_actuators_are_no_second_machine() -> None:
    """A third of the equations is 0, and shows no noise: they counted as degrees of freedom."""
    robot, found = pk.load("five-bar"), []
    for seed in range(3):
        rng = np.random.default_rng(seed)
        at = pk.sample_poses(robot, 40, seed=seed, share=0.5)
        q = robot.inverse(at)
        true = [with_errors(robot, 0.3, rng) for _ in range(2)]
        for second in (False, True) if not seed else (False,):
            read = true[0].forward(q, guess=at).pose[:, :3]
            if second:
                read[1::2] = true[1].forward(q[1::2], guess=at[1::2]).pose[:, :3]
            read += rng.normal(size=read.shape) * [0.02, 0.02, 0.0]
            log = q + 1e-4 * rng.normal(size=q.shape)
            m = pk.Measurements(log, read, "position", actuator_sigma=1e-4)
            seen = two_machines.apart(pk.identify(robot, m))
            found.append((second, seen is not None and seen.found))
    assert not any(seen for second, seen in found if not second)
    assert all(seen for second, seen in found if second)
