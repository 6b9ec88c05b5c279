"""What `identify` promises: truth recovered within its stated uncertainty, and honest figures."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.calibration.identify import identify
from pkmcal.core import instruments
from pkmcal.kinematics.robot import Robot
from pkmcal.measurements.measurements import Measurements
from pkmcal.measurements.virtual_machine import VirtualMachine

from .. import workspaces
from ..measurements.kinds import predict
from ..simulated import hexapod_poses, missed, tilted_poses, with_errors


def values(robot: Robot, names: tuple[str, ...]) -> np.ndarray:
    return np.array([robot.geometry[name] for name in names])


# --- the published machine ---------------------------------------------------------------------


def test_the_papers_machine_reaches_what_an_optimal_estimator_does(paper: Robot) -> None:
    off, inside = [], []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        true = with_errors(paper, 0.5, rng)
        measured = VirtualMachine(true, noise=0.02, seed=seed).measure(
            paper.inverse(tilted_poses(paper, 30, rng))
        )
        found = identify(paper, measured, prior=0.5)
        off.append(missed(found.robot, true, paper.inverse(tilted_poses(paper, 100, rng))).mean())
        inside.append(np.abs(found.values - values(true, found.free)) < 1.96 * found.stderr)
    assert np.mean(off) <= 0.019
    assert 0.92 <= np.mean(inside) <= 0.98


@pytest.mark.filterwarnings("ignore:the measurements contradict the prior")  # by chance
@pytest.mark.filterwarnings("ignore:.*look at the outliers:UserWarning")
def test_the_papers_machine_with_two_rows_off(paper: Robot) -> None:
    off = []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        true = with_errors(paper, 0.5, rng)
        q = paper.inverse(tilted_poses(paper, 30, rng))
        measured = VirtualMachine(true, noise=0.02, seed=seed).measure(q)
        odd = np.sort(rng.choice(30, 2, replace=False))
        push = rng.normal(size=(2, 3))
        wrong = measured.values.copy()
        wrong[odd] += 2.0 * push / np.linalg.norm(push, axis=1, keepdims=True)
        measured = dataclasses.replace(measured, values=wrong)
        for loss in ("linear", "huber", "cauchy"):
            found = identify(paper, measured, prior=0.5, loss=loss)
            assert found.outliers == tuple(odd)
        off.append(missed(found.robot, true, paper.inverse(tilted_poses(paper, 100, rng))).mean())
    assert np.mean(off) <= 0.021


@pytest.mark.filterwarnings("ignore:the measurements contradict the prior")  # by chance
def test_without_errors_no_row_is_an_outlier(paper: Robot) -> None:
    rng = np.random.default_rng(3)
    named = 0
    for seed in range(20):
        true = with_errors(paper, 0.5, rng)
        q = paper.inverse(tilted_poses(paper, 30, rng))
        measured = VirtualMachine(true, noise=0.02, seed=seed).measure(q)
        named += bool(identify(paper, measured, prior=0.5).outliers)
    assert named <= 2  # each has a chance of 0.01


# --- the hexapod -------------------------------------------------------------------------------


@pytest.mark.parametrize("sigma", [0.5, 5.0])
def test_noise_free_poses_give_the_truth_back(hexapod: Robot, sigma: float) -> None:
    rng = np.random.default_rng(11)
    true = with_errors(hexapod, sigma, rng)
    q = hexapod.inverse(hexapod_poses(hexapod, 40, rng))
    found = identify(hexapod, VirtualMachine(true, noise=0).measure(q, kind="pose"))
    assert found.rank == 42
    np.testing.assert_allclose(found.values, values(true, found.free), rtol=0, atol=1e-9)


def test_errors_are_within_the_stated_covariance(hexapod: Robot) -> None:
    squares, fit = [], []
    for seed in range(25):
        rng = np.random.default_rng(seed)
        true = with_errors(hexapod, 0.5 if seed else 5.0, rng)
        q = hexapod.inverse(hexapod_poses(hexapod, 40, rng))
        measured = VirtualMachine(true, noise=0.02, seed=seed).measure(q, kind="pose")
        found = identify(hexapod, measured)
        error = found.values - values(true, found.free)
        squares.append(error @ np.linalg.solve(found.covariance, error))
        fit.append(found.chi2_per_dof)
    # means of 25 chi squared with 42 degrees of freedom, and of chi2/dof with 198
    assert np.mean(squares) == pytest.approx(42, abs=4 * np.sqrt(2 * 42 / 25))
    assert np.mean(fit) == pytest.approx(1, abs=4 * np.sqrt(2 / 198 / 25))


def test_without_sigma_the_residual_scales_the_covariance(hexapod: Robot) -> None:
    rng = np.random.default_rng(12)
    q = hexapod.inverse(hexapod_poses(hexapod, 60, rng))
    true = hexapod.replace({"base1.x": 305.9, "offset2": -0.4})
    # of this seed x, y and z are not told apart by chance
    measured = VirtualMachine(true, noise=0.03, seed=2).measure(q)
    free = ["base1.*", "offset*"]
    stated = identify(hexapod, measured, free=free)
    unstated = identify(hexapod, dataclasses.replace(measured, sigma=None), free=free)
    np.testing.assert_allclose(unstated.values, stated.values, atol=1e-6)
    ratio = unstated.noise[0] / 0.03
    assert ratio**2 == pytest.approx(stated.chi2_per_dof, rel=1e-6)
    np.testing.assert_allclose(unstated.stderr, stated.stderr * ratio, rtol=1e-6)
    assert np.isnan(unstated.chi2_per_dof)


def test_noise_is_estimated_set_by_set_beside_a_prior(hexapod: Robot) -> None:
    rng = np.random.default_rng(13)
    true = with_errors(hexapod, 0.5, rng)
    machine = VirtualMachine(true, noise=0)
    points = machine.measure(hexapod.inverse(hexapod_poses(hexapod, 80, rng)))
    heights = machine.measure(hexapod.inverse(hexapod_poses(hexapod, 80, rng)), kind="height")
    noisy = [
        dataclasses.replace(m, values=m.values + rng.normal(0, s, m.values.shape))
        for m, s in ((points, 0.02), (heights, 0.2))
    ]
    found = identify(hexapod, noisy, prior=0.5)
    assert found.noise == pytest.approx((0.02, 0.2), rel=0.25)


def test_minimum_is_the_one_of_the_stated_cost(hexapod: Robot) -> None:
    """With everything at once: several kinds, covariances, a prior; no smaller cost nearby."""
    rng = np.random.default_rng(14)
    true = hexapod.replace({"base1.x": 305.9, "base4.x": -249.1, "offset2": -0.4})
    q = hexapod.inverse(hexapod_poses(hexapod, 15, rng))
    pose = true.forward(q).pose
    mixing = rng.normal(size=(15, 3, 3))
    covariance = 1e-4 * (mixing @ mixing.transpose(0, 2, 1) + 0.1 * np.eye(3))
    anchor = np.array([400.0, 300.0, -100.0])
    sets = [
        Measurements(q, pose[:, :3] + rng.normal(0, 0.02, (15, 3)), sigma=covariance),
        Measurements(
            q,
            np.linalg.norm(pose[:, :3] - anchor, axis=1) + rng.normal(0, 0.05, 15),
            "distance",
            sigma=0.05,
            target=anchor,
        ),
    ]
    found = identify(hexapod, sets, free=["base*.x", "offset*"], prior={"base*": 0.3, "offset*": 1})
    names = found.free
    sigma = np.where([name.startswith("base") for name in names], 0.3, 1.0)
    inverse = np.linalg.inv(covariance)

    def cost(theta: np.ndarray) -> float:
        at = hexapod.replace(dict(zip(names, theta, strict=True))).forward(q).pose
        off = sets[0].values - at[:, :3]
        far = (sets[1].values - np.linalg.norm(at[:, :3] - anchor, axis=1)) / 0.05
        return float(
            np.einsum("ni,nij,nj", off, inverse, off)
            + far @ far
            + np.sum(((theta - values(hexapod, names)) / sigma) ** 2)
        )

    least = cost(found.values)
    for direction in rng.normal(size=(30, len(names))):
        step = 0.05 * found.stderr * direction
        assert cost(found.values + step) > least
        assert cost(found.values - step) > least


def test_rows_out_of_reach_on_the_way_do_not_stop_the_search() -> None:
    robot = pk.load("3rrr-planar")
    for seed in (4, 18):  # the second runs into them
        true = with_errors(robot, 5.0, np.random.default_rng(seed))
        q = robot.inverse(workspaces.poses("3rrr-planar", 40, seed))
        found = identify(robot, VirtualMachine(true, noise=0.02).measure(q), prior=5.0)
        assert found.converged
        assert found.chi2_per_dof < 1.5


# --- frames, targets ---------------------------------------------------------------------------


def test_unknown_frame_and_targets_are_found(hexapod: Robot) -> None:
    rng = np.random.default_rng(15)
    true = hexapod.replace({f"offset{i}": 0.3 * i for i in range(1, 7)})
    q = np.repeat(hexapod.inverse(hexapod_poses(hexapod, 20, rng)), 2, axis=0)
    index = np.tile([0, 1], 20)
    targets = np.array([[60.0, 20.0, 30.0], [-50.0, 40.0, 25.0]])
    frame = np.array([2000.0, -3000.0, 500.0, 0.3, -0.5, 2.5])
    seen = predict("position", true.forward(q).pose, targets[index], frame=frame).values
    measured = Measurements(
        q, seen + rng.normal(0, 0.01, seen.shape), sigma=0.01, target_index=index
    )
    found = identify(hexapod, measured, free="offset*", unknown=["frame", "target"])
    assert found.free[6:] == (
        *(f"frame.{axis}" for axis in ("x", "y", "z", "alpha", "beta", "gamma")),
        *(f"target{i}.{axis}" for i in (1, 2) for axis in "xyz"),
    )
    truth = np.concatenate([0.3 * np.arange(1, 7), frame, targets.ravel()])
    assert np.abs((found.values - truth) / found.stderr).max() < 4
    assert found.rms < 0.02


def test_pose_measurements_in_an_unknown_frame(hexapod: Robot) -> None:
    rng = np.random.default_rng(16)
    true = hexapod.replace({"offset1": 0.4, "offset4": -0.3})
    q = hexapod.inverse(hexapod_poses(hexapod, 12, rng))
    frame = np.array([-900.0, 100.0, 2000.0, 3.0, 0.2, -1.0])
    seen = predict("pose", true.forward(q).pose, frame=frame).values
    found = identify(hexapod, Measurements(q, seen, "pose"), free="offset*", unknown="frame")
    np.testing.assert_allclose(found.values[6:], frame, atol=1e-7)
    np.testing.assert_allclose(found.values[:6], [0.4, 0, 0, -0.3, 0, 0], atol=1e-7)


# --- hold-out, accuracy, bounds, repeats -------------------------------------------------------


def test_held_out_points_are_off_by_what_is_expected(paper: Robot) -> None:
    off, expected = [], []
    for seed in range(10):
        rng = np.random.default_rng(seed)
        true = with_errors(paper, 0.5, rng)
        machine = VirtualMachine(true, noise=0.02, seed=seed)
        measured = machine.measure(paper.inverse(tilted_poses(paper, 60, rng)))
        found = identify(paper, measured, prior=0.5, holdout=0.25)
        assert len(found.rows) == 45
        assert found.holdout_rms_before > 10 * found.holdout_rms
        off.append(found.holdout_rms)
        expected.append(found.holdout_expected)
    assert np.mean(off) == pytest.approx(np.mean(expected), rel=0.1)


def test_other_measurements_can_be_held_out(paper: Robot) -> None:
    rng = np.random.default_rng(21)
    machine = VirtualMachine(with_errors(paper, 0.5, rng))
    fitted, other = (machine.measure(paper.inverse(tilted_poses(paper, n, rng))) for n in (30, 10))
    found = identify(paper, fitted, prior=0.5, holdout=other)
    at = found.robot.forward(other.actuators).pose[:, :3]
    rms = np.sqrt(np.mean(np.sum((other.values - at) ** 2, axis=1)))
    assert found.holdout_rms == pytest.approx(rms, rel=1e-9)
    assert len(found.rows) == 30


@pytest.mark.filterwarnings("ignore:the measurements contradict the prior")  # by chance
def test_predicted_accuracy_is_the_scatter_of_calibrations(paper: Robot) -> None:
    rng = np.random.default_rng(22)
    poses, elsewhere = tilted_poses(paper, 30, rng), tilted_poses(paper, 20, rng)
    q = paper.inverse(elsewhere)
    off = []
    for seed in range(40):
        true = with_errors(paper, 0.5, rng)
        measured = VirtualMachine(true, noise=0.02, seed=seed).measure(paper.inverse(poses))
        found = identify(paper, measured, prior=0.5)
        off.append(missed(found.robot, true, q))
    predicted = found.accuracy(elsewhere)
    assert np.sqrt(np.mean(np.square(off))) == pytest.approx(
        np.sqrt(np.mean(predicted**2)), rel=0.1
    )


@pytest.mark.parametrize("name", ["tricept", "delta-parallelograms"])
def test_accuracy_of_what_is_no_pose_is_that_where_the_machine_goes(name: str) -> None:
    """Both tilt as they move; x y z alone say where they are."""
    robot = pk.load(name)
    rng = np.random.default_rng(24)
    wrong = [{"mm": 0.3, "rad": 1e-3, "1": 0.0}[unit] for unit in robot.geometry.units]
    true = robot.replace(robot.geometry.values + wrong * rng.normal(size=len(wrong)))
    places = robot.home + np.array([80.0, 80.0, 80.0, 0.0, 0.0, 0.0]) * rng.uniform(-1, 1, (30, 6))
    q = robot.inverse(places, match=True)
    found = identify(robot, VirtualMachine(true, noise=0.02).measure(q, kind="pose"), prior=0.3)
    there = found.robot.complete(places)
    assert found.robot.violation(places).min() > 0.1
    assert np.abs(there - places)[:, :3].max() < 1e-6
    np.testing.assert_allclose(found.accuracy(places), found.accuracy(there), rtol=1e-6)


def test_accuracy_is_infinite_where_nothing_tells() -> None:
    robot = pk.load("examples/linear-delta/robot.toml")
    poses = np.zeros((20, 6))
    poses[:, :2] = np.random.default_rng(23).uniform(-80, 80, (20, 2))
    heights = VirtualMachine(robot).measure(robot.inverse(poses), kind="height")
    told = identify(robot, heights)
    turned = identify(robot, heights, free=[*robot.model.free, "angle3"])
    assert np.isfinite(told.accuracy(poses)).all()
    assert np.isinf(turned.accuracy(poses)).all()  # it may be turned about z
    assert np.isnan(told.accuracy([1e4, 0.0, 0.0, 0.0, 0.0, 0.0]))  # out of reach


def test_bounds_are_kept_and_named(paper: Robot) -> None:
    rng = np.random.default_rng(24)
    measured = VirtualMachine(paper.replace({"offset1": 0.5})).measure(
        paper.inverse(tilted_poses(paper, 30, rng))
    )
    found = identify(
        paper, measured, free="offset*", bounds={"offset1": (-0.2, 0.2), "offset2": (-9, 9)}
    )
    assert found.at_bounds == ("offset1",)
    assert found.values[0] == pytest.approx(0.2)
    assert found.converged
    # the others make the best of it: the same fit with that one number held
    held = identify(paper.replace({"offset1": 0.2}), measured, free=found.free[1:])
    np.testing.assert_allclose(found.values[1:], held.values, atol=1e-6)


def test_repeats_show_the_repeatability_and_stay_together(hexapod: Robot) -> None:
    rng = np.random.default_rng(25)
    q = np.repeat(hexapod.inverse(hexapod_poses(hexapod, 25, rng)), 4, axis=0)
    measured = VirtualMachine(hexapod, noise=0.03).measure(q)
    found = identify(hexapod, measured, free="offset*", holdout=0.2)
    assert found.repeatability == pytest.approx(0.03, rel=0.15)
    assert sorted(np.bincount(found.rows // 4, minlength=25).tolist()) == [0] * 5 + [4] * 20


@pytest.mark.filterwarnings("ignore:.*look at the outliers:UserWarning")
def test_rows_are_numbered_through_all_sets(hexapod: Robot) -> None:
    rng = np.random.default_rng(26)
    machine = VirtualMachine(hexapod)
    one, two = (machine.measure(hexapod.inverse(hexapod_poses(hexapod, 15, rng))) for _ in "12")
    wrong = two.values.copy()
    wrong[4] += [0.0, 1.0, 0.0]
    found = identify(hexapod, [one, dataclasses.replace(two, values=wrong)], free="offset*")
    assert found.outliers == (19,)


# --- gains, ties, the result -------------------------------------------------------------------


def test_gains_and_offsets_are_told_apart(hexapod: Robot) -> None:
    rng = np.random.default_rng(27)
    true = hexapod.replace({"gain2": 1.0004, "offset2": -0.3, "gain5": 0.9997})
    q = hexapod.inverse(hexapod_poses(hexapod, 25, rng))
    exact = VirtualMachine(true, noise=0).measure(q, kind="pose")
    found = identify(hexapod, exact, free=["gain*", "offset*"])
    np.testing.assert_allclose(found.values, values(true, found.free), atol=1e-9)


def test_tied_numbers_follow_their_parameter() -> None:
    robot = pk.load("examples/linear-delta/robot.toml")
    true = robot.replace({"radius": 171.2, "offset2": 625.4})
    poses = np.zeros((15, 6))
    poses[:, :2] = np.random.default_rng(28).uniform(-80, 80, (15, 2))
    exact = VirtualMachine(true, noise=0).measure(robot.inverse(poses), kind="height")
    found = identify(robot, exact)
    np.testing.assert_allclose(found.values, values(true, found.free), atol=1e-8)
    assert found.robot.geometry["base3.y"] == pytest.approx(171.2, abs=1e-8)


def test_result_reads_itself_out(paper: Robot) -> None:
    rng = np.random.default_rng(29)
    measured = VirtualMachine(with_errors(paper, 0.5, rng)).measure(
        paper.inverse(tilted_poses(paper, 40, rng))
    )
    found = identify(paper, measured, prior=0.5, holdout=0.25)
    text = str(found)
    assert text == found.summary()
    assert len(text.splitlines()) <= 29  # a verdict of two lines; 28 changes take two columns
    assert max(map(len, text.splitlines())) <= 100
    for word in ("rank 25 of 28", "held out", "expected", "chi²/dof", "  platform3.x"):
        assert word in text
    assert found.parameters["base1.x"]["value"] == found.robot.geometry["base1.x"]
    np.testing.assert_allclose(found.stderr**2, np.diagonal(found.covariance))
    assert all(abs(value) > 0.95 for _, _, value in found.correlations)
    with pytest.raises(AttributeError):
        found.rms = 0.0  # type: ignore[misc]


def test_the_robot_given_is_untouched(paper: Robot) -> None:
    before = paper.geometry.values.copy()
    q = paper.inverse(tilted_poses(paper, 5, np.random.default_rng(30)))
    identify(paper, VirtualMachine(paper).measure(q), free="offset*")
    np.testing.assert_array_equal(paper.geometry.values, before)


def test_a_machine_on_a_wall_is_calibrated_as_one_on_the_floor(paper: Robot) -> None:
    """With its base turned by 90 degrees about y, where the angles of its poses have no rates."""
    wall = np.array([500.0, 100.0, 900.0, 0.0, np.pi / 2, 0.0])
    hung = Robot(dataclasses.replace(paper.model, base_frame=wall))
    rng = np.random.default_rng(31)
    true = with_errors(paper, 0.5, rng)
    q = paper.inverse(tilted_poses(paper, 30, rng))
    measured = VirtualMachine(true).measure(q)
    seen, *_ = instruments.seen_points(wall, measured.values)
    there = identify(hung, dataclasses.replace(measured, values=seen), prior=0.5)
    here = identify(paper, measured, prior=0.5)
    np.testing.assert_allclose(there.values, here.values, atol=1e-6)
    np.testing.assert_allclose(there.stderr, here.stderr, rtol=1e-6)
    assert there.accuracy(hung.home) == pytest.approx(here.accuracy(paper.home), rel=1e-6)


@pytest.mark.parametrize("word", ["frame", "target", "attachment"])
def test_what_is_no_word_is_named(paper: Robot, word: str) -> None:
    measured = VirtualMachine(paper).measure(paper.inverse(paper.home[None]))
    with pytest.raises(ValueError, match=f"{word} must be one of known, unknown; found None"):
        identify(paper, measured, unknown={word: None})  # type: ignore[dict-item]
