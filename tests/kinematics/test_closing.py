"""Closures that contradict each other, poses that keep what was matched, homes that do not fit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.core.library import POSE

from .. import dietmaier, generated, twin_rows
from ..robots import linear_delta
from ..workspaces import CHAINS

MACHINES = [name for name in pk.machines() if name not in ("rbt-6t03p-printed", *CHAINS)]
PARALLEL = [name for name in MACHINES if isinstance(pk.load(name), pk.Robot)]


def redundant(seed: int, **changes: float) -> tuple[pk.Robot, np.random.Generator]:
    rng = np.random.default_rng(seed)
    return generated.machine("redundant", rng).replace(changes), rng


# more rows than coordinates -----------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(5))
def test_actuators_that_contradict_each_other_do_not_close(seed: int) -> None:
    robot, rng = redundant(seed)
    at = robot.frames.outward(generated.poses("redundant", robot, 60, rng))
    at = at[np.isfinite(robot.inverse(at)).all(axis=1)]
    q = robot.inverse(at)
    push = np.where(np.isfinite(robot.turns), 0.5, 100.0)  # rad or mm, to and fro
    q[::2] += push * rng.choice([-1, 1], q[::2].shape)
    found = robot.forward(q, guess=at)
    open_ones, ok = found.status == 5, found.ok
    assert open_ones[::2].any() and not open_ones[1::2].any()
    assert (found.residual[open_ones] > robot.closure_tolerance).all()
    assert (found.residual[ok] <= robot.closure_tolerance).all()
    assert np.isnan(found.pose[open_ones]).all()
    assert "does not close" in found.failures() and "does not close" in str(found)
    missed = twin_rows.closures(robot.model, robot.frames.inward(found.pose[ok]), q[ok])
    np.testing.assert_allclose(found.residual[ok], np.abs(missed).max(axis=1), rtol=0.02, atol=1e-9)


def test_the_bound_is_that_of_the_robot_file_and_is_kept_in_it(tmp_path) -> None:
    robot, _ = redundant(1)
    assert robot.closure_tolerance == pytest.approx(2e-3 * robot.machine.struct.size)
    assert robot.model.closure_tolerance is None
    q = robot.inverse(robot.home)
    missed = robot.closing(q, robot.home)
    assert missed is robot  # it misses nothing
    path = tmp_path / "robot.toml"
    robot.save(path)
    text = path.read_text().replace("[pose]", "closure_tolerance = 0.25\n\n[pose]", 1)
    path.write_text(text)
    stated = pk.load(path)
    assert stated.closure_tolerance == 0.25
    stated.save(path)
    assert pk.load(path).closure_tolerance == 0.25
    path.write_text(text.replace("= 0.25", "= 0.0"))
    with pytest.raises(pk.FileError, match=r"closure_tolerance.*positive"):
        pk.load(path)


@pytest.mark.parametrize("seed", range(3))
def test_an_identified_machine_carries_what_it_misses(seed: int) -> None:
    """Free numbers that cannot explain the true errors leave closures open."""
    robot, rng = redundant(seed)
    robot = pk.Robot(replace(robot.model, closure_tolerance=0.1))
    values = robot.geometry.values.copy()
    names = robot.geometry.names
    points = [i for i, name in enumerate(names) if name.startswith(("base", "platform"))]
    values[points] += rng.normal(0.0, 1.0, len(points))
    real = robot.replace(values)
    at = robot.frames.outward(generated.poses("redundant", robot, 40, rng))
    at = at[np.isfinite(real.inverse(at)).all(axis=1)]
    q = real.inverse(at)
    assert (robot.forward(q, guess=at).status == 5).any()  # the nominal machine cannot be there
    found = pk.identify(robot, pk.Measurements(q, at, "pose"), free="offset1")
    assert found.robot.closure_tolerance > 0.2
    assert found.robot.forward(q, guess=at).ok.all()


# completed poses ----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", PARALLEL)
def test_a_completed_pose_keeps_what_is_matched_or_is_nan(name: str) -> None:
    robot, rng = pk.load(name), np.random.default_rng(1)
    free = [POSE.index(each) for each in robot.coordinates]
    freedom = len(free) + robot.n_actuators - robot.machine.rows
    spread = np.where(np.isin(range(6), free), [20, 20, 20, 0.2, 0.2, 0.2], 0.0)
    finite = 0
    for _ in range(12):
        kept = sorted(rng.choice(free, freedom, replace=False).tolist())
        wanted = robot.home + rng.uniform(-1, 1, (100, 6)) * spread
        names = tuple(POSE[i] for i in kept)
        found, q = robot.complete(wanted, names), robot.inverse(wanted, names)
        known = np.isfinite(found).all(axis=1)
        assert np.array_equal(known, np.isfinite(q).all(axis=1))
        assert np.abs(found - wanted)[known][:, kept].max(initial=0.0) < 2e-6
        missed = np.abs(twin_rows.closures(robot.model, found[known], q[known]))
        assert missed.max(initial=0.0) < 1e-8
        finite += int(known.sum())
    declared = robot.complete(robot.home + rng.uniform(-1, 1, (100, 6)) * spread / 4)
    assert np.isfinite(declared).all() and finite > 0


def test_an_angle_beyond_a_right_angle_is_kept_as_it_was_asked_for() -> None:
    robot = pk.load("hexapod")
    wanted = [0, 0, 850, 0.1, np.radians(100.0), 0.2]
    found = robot.complete(wanted)
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-8)


# homes that do not fit ----------------------------------------------------------------------------


@pytest.mark.parametrize("factor", [1.0, 0.1, 0.01, 1e-3])
def test_modes_of_a_geometry_that_was_replaced_are_certified_at_its_own_scale(
    factor: float,
) -> None:
    points = {
        name: factor * value
        for name, value in dietmaier.hexapod().geometry.items()
        if name.startswith(("base", "platform"))
    }
    modes = pk.load("hexapod").replace(points).forward_all(factor * np.array(dietmaier.LENGTHS))
    assert len(modes) == 40 and modes.certified.all() and modes.complete


def test_a_home_that_the_geometry_cannot_take_is_said() -> None:
    robot = linear_delta().replace({f"rod{i}": 40.0 for i in (1, 2, 3)})
    found = robot.forward([0.0, 0.0, 0.0])
    assert not found.ok and "does not reach the guess, by default the home pose" in found.failures()
    with pytest.raises(ValueError, match="home breaks a limit: limb 1: reach broken"):
        pk.sample_poses(robot)
    assert "reach the guess" not in linear_delta().forward([1e4, 0.0, 0.0]).failures()
