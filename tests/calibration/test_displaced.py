"""A target that is not where it is stated is named: poses and held-out points have it as well."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.arrays import FloatArray
from pkmcal.diagnostics.displaced import DisplacedTarget, displaced_target

from ..simulated import hexapod_poses, with_errors

TARGETS = np.array([[100.0, 0.0, 20.0], [-60.0, 80.0, 20.0], [-60.0, -80.0, 20.0]])
NOISE, COUNT = 0.02, 30


def read(
    robot: pk.Robot, seed: int, moved: FloatArray, shared: float = 0.0, together: bool = True
) -> list[pk.Measurements]:
    """Positions of three targets, the last one `moved`, and the error that rows of a pose share."""
    rng = np.random.default_rng(seed)
    true, q = with_errors(robot, 0.3, rng), robot.inverse(hexapod_poses(robot, COUNT, rng))
    motion = pk.screw.from_pose(true.forward(q).pose)
    places = TARGETS + np.outer([0, 0, 1], moved)
    seen = motion[:, None, :3, 3] + np.einsum("nij,kj->nki", motion[:, :3, :3], places)
    seen += rng.normal(0, NOISE, seen.shape) + shared * rng.normal(0, NOISE, (COUNT, 1, 3))
    if not together:
        sets = zip(seen.transpose(1, 0, 2), TARGETS, strict=True)
        return [pk.Measurements(q, values, "position", target=target) for values, target in sets]
    rows = np.repeat(q, 3, axis=0)
    names = ("north", "south", "west")
    data = pk.Measurements(
        rows, seen.reshape(-1, 3), "position",
        target=TARGETS,
        target_index=np.tile([0, 1, 2], COUNT),
        target_names=names,
    )  # fmt: skip
    return [data]


def displacement(found: pk.Identification) -> DisplacedTarget:
    test = displaced_target(found)
    assert test is not None
    return test


@pytest.mark.parametrize("together", [True, False])
def test_a_badly_seated_reflector_is_named(hexapod: pk.Robot, together: bool) -> None:
    """In files of their own sets have noises of their own, and that of the bad one hides it."""
    moved = np.array([0.3, -0.2, 0.1])
    found = pk.identify(hexapod, read(hexapod, 1, moved, together=together), holdout=0.25)
    assert found.holdout_rms < 1.2 * found.holdout_expected  # which shows nothing
    assert found.verdict.state == "doubtful"
    name = "west" if together else "(-60, -80, 20)"
    assert found.verdict.reasons[0].startswith(f"target {name} ")


def test_its_displacement_is_found_where_nothing_else_takes_it_up(hexapod: pk.Robot) -> None:
    moved = np.array([0.3, -0.2, 0.1])
    data = read(hexapod, 2, moved)
    rng = np.random.default_rng(2)
    test = displacement(pk.identify(with_errors(hexapod, 0.3, rng), data, free="offset*"))
    assert test.name == "west" and not test.also
    assert (np.abs(test.shift - moved) < 4 * np.array(test.stderr)).all()
    assert max(test.stderr) < NOISE
    # what it explains of the squares is what is gone where the target is where it should be
    (there,) = data
    assert there.target is not None
    right = dataclasses.replace(there, target=there.target + np.outer([0, 0, 1], moved))
    before, after = (
        pk.identify(with_errors(hexapod, 0.3, np.random.default_rng(2)), each, free="offset*").rms
        for each in (there, right)
    )
    assert test.share == pytest.approx(1.0 - (after / before) ** 2, abs=0.02)


def test_of_two_targets_it_cannot_be_told_which_one_moved(hexapod: pk.Robot) -> None:
    """Where the platform is found along, one moved one way is the other moved the other way."""
    (whole,) = read(hexapod, 4, np.array([0.3, -0.2, 0.1]))
    assert whole.target_index is not None
    test = displacement(pk.identify(hexapod, whole.select(np.flatnonzero(whole.target_index))))
    assert test.found and {test.name, *test.also} == {"south", "west"}
    told = displacement(pk.identify(hexapod, whole))
    assert told.name == "west" and not told.also


@pytest.mark.parametrize("kind", ["pose", "orientation"])
def test_poses_read_beside_targets_do_not_hide_which_one_moved(
    hexapod: pk.Robot, kind: str
) -> None:
    """The same machine read by another instrument, which knows no target."""
    moved = np.array([0.3, -0.2, 0.1])
    true = with_errors(hexapod, 0.3, np.random.default_rng(5))
    q = hexapod.inverse(hexapod_poses(hexapod, COUNT, np.random.default_rng(6)))
    beside = pk.VirtualMachine(true, NOISE, angle_noise=1e-5, seed=7).measure(q, kind)
    test = displacement(pk.identify(hexapod, [*read(hexapod, 5, moved), beside]))
    assert test.found and test.name == "west"
    assert (np.abs(test.shift - moved) < 4 * np.array(test.stderr)).all()


@pytest.mark.parametrize(("chance", "share"), [(0.5, 0.9), (1e-9, 0.1), (0.5, 0.1), (1e-9, 0.9)])
def test_a_displacement_is_large_where_it_is_sure_and_most_of_what_is_left(
    chance: float, share: float
) -> None:
    test = DisplacedTarget("west", (0.3, 0.0, 0.0), (0.01, 0.01, 0.01), chance, share, ())
    assert test.found == (chance < 0.01)
    assert test.large == (chance < 0.01 and share > 0.5)


@pytest.mark.parametrize("shared", [0.0, 3.0])
def test_of_sound_calibrations_hardly_any_is_said_to_have_one(
    hexapod: pk.Robot, shared: float
) -> None:
    """At 1 % more than 3 of 40 are one in 1200; errors that a pose shares are none."""
    still = np.zeros(3)
    tests = [displacement(pk.identify(hexapod, read(hexapod, s, still, shared))) for s in range(40)]
    assert sum(test.found for test in tests) <= 3


def test_targets_that_are_found_along_and_a_single_one_are_not_tested(hexapod: pk.Robot) -> None:
    still = np.zeros(3)
    (one, *_), whole = read(hexapod, 3, still, together=False), read(hexapod, 3, still)
    assert displaced_target(pk.identify(hexapod, one)) is None
    assert displaced_target(pk.identify(hexapod, whole, "offset*", unknown="target")) is None
