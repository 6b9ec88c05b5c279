"""Arrays of results cannot be written to, so that what is stated of them stays true."""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Callable
from pickle import dumps, loads

import numpy as np
import pytest

import pkmcal as pk
from tests.driven import with_laws


@pytest.fixture(scope="module")
def results() -> dict[str, object]:
    robot = pk.load("hexapod")
    poses = pk.sample_poses(robot, 40, seed=1)
    true = pk.VirtualMachine(robot.replace({"offset1": 0.3}), noise=0.02)
    found = pk.identify(robot, true.measure(robot.inverse(poses)), "offset*", holdout=0.25)
    return {
        "identification": found,
        "measurements": true.measure(robot.inverse(poses)),
        "bootstrap": pk.bootstrap(found, 20),
        "plan": pk.plan_poses(robot, poses, 8, free="offset*"),
        "tolerance": pk.tolerance(robot, robot.home, 0.1, samples=500),
        "sensitivity": pk.sensitivity(robot, poses[:5], cases=["offset1"]),
        "compensation": pk.compensate(robot, poses[:5], poses[:5]),
        "workspace": pk.workspace(robot, {"x": (-50, 50, 3)}),
        "dexterity": pk.dexterity(robot, poses),
        "move": pk.trajectory.move(robot, poses[0], poses[1], duration=1.0),
    }


def test_no_array_of_a_result_can_be_written_to(results: dict[str, object]) -> None:
    for name, result in results.items():
        arrays = [key for key, value in vars(result).items() if isinstance(value, np.ndarray)]
        assert arrays, name
        for key in arrays:
            with pytest.raises(ValueError, match="read-only"):
                getattr(result, key)[...] = 0.0
    found = results["identification"]
    assert isinstance(found, pk.Identification)
    for key in ("values", "stderr", "covariance", "covar", "interval95", "correlation_matrix"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(found, key)[...] = 0.0


@pytest.mark.parametrize("again", [lambda it: it, copy.deepcopy, lambda it: loads(dumps(it))])
def test_what_a_calibration_states_cannot_be_written_to_nor_can_its_copies(
    results: dict[str, object], again: Callable[[object], object]
) -> None:
    found = again(results["identification"])
    assert isinstance(found, pk.Identification)
    end = found.fit.end
    arrays = [found.values, found.stderr, found.rows, found.read, *found.residuals, end.theta]
    arrays += [end.pose, end.actuators, end.status, *end.residuals, found.fit.covariance]
    estimate, tested = found.fit.estimate, found.fit.uncertainty.tested
    for each in (found.fit.parameters, estimate, estimate.state, estimate.state.fitted, tested):
        fields = [getattr(each, field.name) for field in dataclasses.fields(each)]
        own = [value for value in fields if isinstance(value, np.ndarray)]
        assert own, type(each)
        arrays += own
    for array in arrays:
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0
    said = str(found)
    found.observability["O1"] = 99.0
    found.parameters["offset1"]["value"] = 99.0
    assert str(found) == said and found.observability["O1"] != 99.0


def test_arrays_of_the_caller_stay_his(hexapod: pk.Robot) -> None:
    poses = pk.sample_poses(hexapod, 3, seed=1)
    kept = pk.tolerance(hexapod, poses, 0.1, samples=100)
    poses[0] = 0.0
    assert poses.flags.writeable and not kept.poses.flags.writeable
    solved = hexapod.forward(hexapod.inverse(hexapod.home)[None])
    again = hexapod.forward(hexapod.inverse(hexapod.home)[None], out=solved)
    assert np.shares_memory(again.pose, solved.pose)


@pytest.mark.parametrize("laws", [True, False])
@pytest.mark.parametrize("name", ["hexapod", "linear-delta", "linear-delta-6", "6-rus", "tricept"])
def test_rows_of_inverse_are_contiguous(name: str, laws: bool) -> None:
    """Whoever hands a row's pointer to C reads its numbers."""
    robot = pk.load(name)
    if laws:
        robot = with_laws(robot, np.random.default_rng(1))
    poses = robot.home + np.zeros((4, 6))
    for q in (robot.inverse(poses), robot.inverse(poses.reshape(2, 2, 6))):
        assert q.flags.c_contiguous and np.isfinite(q).all()


CALLS: dict[str, Callable[[pk.Robot, np.ndarray, np.ndarray], object]] = {
    "home": lambda robot, q, poses: robot.home,
    "forward": lambda robot, q, poses: robot.forward(q),
    "inverse": lambda robot, q, poses: robot.inverse(poses),
    "complete": lambda robot, q, poses: robot.complete(poses),
    "violation": lambda robot, q, poses: robot.violation(poses),
    "jacobian": lambda robot, q, poses: robot.jacobian(poses),
    "forward_jacobian": lambda robot, q, poses: robot.forward_jacobian(poses),
    "error_jacobian": lambda robot, q, poses: robot.error_jacobian(poses),
    "feasible": lambda robot, q, poses: robot.feasible(poses),
    "forward_all": lambda robot, q, poses: robot.forward_all(q[0]),
}


def arrays_of(result: object) -> dict[str, np.ndarray]:
    """Arrays of a result by name, also those that are computed when asked for."""
    if isinstance(result, np.ndarray):
        return {"": result}
    names = ["pose", "status", "iterations", "residual", "conditioning", "same_side", "ok"]
    names += ["poses", "certified", "conditioning", "stroke", "base_cone", "platform_cone"]
    found = {name: getattr(result, name, None) for name in names}
    return {name: value for name, value in found.items() if isinstance(value, np.ndarray)}


@pytest.mark.parametrize("call", CALLS)
@pytest.mark.parametrize("name", ["hexapod", "3rps", "linear-delta-6"])
def test_writing_to_what_a_call_returns_alters_nothing_else(name: str, call: str) -> None:
    """Neither the caller's arrays, nor what any call returns then: `out=` needs such arrays."""
    robot = pk.load(name)
    poses = robot.complete(pk.sample_poses(robot, 5, seed=1))
    q = robot.inverse(poses)
    given = poses.copy(), q.copy()
    before = {k: {n: a.copy() for n, a in arrays_of(f(robot, q, poses)).items()}
              for k, f in CALLS.items()}  # fmt: skip
    for array in arrays_of(CALLS[call](robot, q, poses)).values():
        if array.flags.writeable:
            array[...] = 77
    np.testing.assert_array_equal(poses, given[0])
    np.testing.assert_array_equal(q, given[1])
    for other, function in CALLS.items():
        for part, array in arrays_of(function(robot, q, poses)).items():
            np.testing.assert_array_equal(array, before[other][part], f"{other} {part}")
