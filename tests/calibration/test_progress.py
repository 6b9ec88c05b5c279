"""Progress of calibrations: told in percent, never less than before, to the end."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.progress import part, step, telling, within


def measured(seed: int = 0) -> tuple[pk.Robot, pk.Measurements]:
    robot = pk.load("hexapod")
    q = robot.inverse(pk.sample_poses(robot, 40, seed, share=0.5))
    true = robot.replace({f"offset{i + 1}": 0.1 * i for i in range(6)})
    rows = pk.VirtualMachine(true, noise=0.02, seed=seed).measure(q)
    values = rows.values.copy()
    values[7] += 3.0  # so that robust fits have something to do
    return robot, pk.Measurements(q, values)


@pytest.mark.parametrize(
    "asked",
    [{}, {"loss": "huber", "drop": "outliers", "holdout": 0.2}, {"fix": "datum", "free": "*"}],
    ids=["plain", "robust", "datum"],
)
def test_what_is_told_grows_to_the_whole_and_changes_nothing(asked: dict[str, Any]) -> None:
    robot, rows = measured()
    told: list[tuple[int, int]] = []
    asked = {"free": "offset*"} | asked
    found = pk.identify(robot, rows, **asked, progress=lambda done, of: told.append((done, of)))
    assert {of for _, of in told} == {100}
    assert all(one <= other for (one, _), (other, _) in pairwise(told))
    assert told[0][0] < 5 and told[-1] == (100, 100)
    assert len({done for done, _ in told}) > 6
    np.testing.assert_array_equal(found.values, pk.identify(robot, rows, **asked).values)


def test_what_progress_raises_ends_the_fit() -> None:
    """A caller may stop a long fit so."""
    robot, rows = measured()

    def stop(done: int, of: int) -> None:
        if done > 10:
            raise TimeoutError

    with pytest.raises(TimeoutError):
        pk.identify(robot, rows, "offset*", progress=stop)
    pk.identify(robot, rows, "offset*")  # and nobody is told any more


def test_two_fits_of_effects_that_may_help_are_one_work() -> None:
    axes, points = [[0, 0, 1], [0, 1, 0], [0, 1, 0]], [[0, 0, 0], [0, 0, 290], [0, 0, 560]]
    arm = pk.SerialArm(axes, points, [450, 0, 630, 0, 0, 0])
    theta = np.random.default_rng(0).uniform(-1, 1, (30, 3))
    rows = pk.VirtualMachine(arm, noise=0.02).measure(theta, "pose")
    told: list[int] = []
    pk.identify(arm, rows, effects="auto", progress=lambda done, of: told.append(done))
    assert told == sorted(told) and told[-1] == 100


def test_replicates_are_counted() -> None:
    robot, rows = measured()
    told: list[tuple[int, int]] = []
    found = pk.identify(robot, rows, "offset*")
    pk.bootstrap(found, 60, progress=lambda done, of: told.append((done, of)))
    assert told[-1] == (60, 60) and told == sorted(told)


def test_no_function_is_refused() -> None:
    robot, rows = measured()
    with pytest.raises(TypeError, match="progress"):
        pk.identify(robot, rows, "offset*", progress=3)


def test_parts_and_steps_by_hand() -> None:
    told: list[int] = []
    with telling(within(lambda done, of: told.append(done), 0.5, 1.0)):
        part(0.4)
        step()
        part(1.0)
        part(1.0)
    assert told[0] == 50 and told[1] == 50 + int(100 * 0.5 * 0.06) and told[2:] == [70, 100, 100]
    step()  # outside of it nobody is told
    assert len(told) == 5
