"""Planned poses: better than random ones, within limits, for the targets that are named."""

from __future__ import annotations

import json
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import pkmcal as pk
from pkmcal.kinematics.robot import Robot
from pkmcal.measurements.pose_csv import write_poses
from pkmcal.planning.plan_poses import Plan

from ..simulated import missed, with_errors


@pytest.fixture(scope="module")
def candidates(hexapod: Robot) -> np.ndarray:
    return pk.sample_poses(hexapod, 200)


@pytest.fixture(scope="module")
def twenty(hexapod: Robot, candidates: np.ndarray) -> Plan:
    return pk.plan_poses(hexapod, candidates, 20, kind="pose")


def test_twenty_planned_poses_predict_less_than_thirty_random_ones(
    hexapod: Robot, candidates: np.ndarray, twenty: Plan
) -> None:
    thirty = pk.plan_poses(hexapod, candidates, 30, kind="pose")
    assert twenty.predicted < thirty.at_random < twenty.at_random
    assert thirty.predicted < twenty.predicted
    assert twenty.all_candidates < thirty.predicted


def test_twenty_planned_poses_calibrate_better_than_thirty_random_ones(
    hexapod: Robot, candidates: np.ndarray, twenty: Plan
) -> None:
    every = hexapod.inverse(candidates)
    squares: dict[str, list[float]] = {"planned": [], "random": []}
    for seed in range(40):
        rng = np.random.default_rng(seed)
        true = with_errors(hexapod, 0.5, rng)
        at = every[true.forward(every).ok]
        drawn = rng.permutation(at)[:30]
        for name, q in (("planned", twenty.actuators), ("random", drawn)):
            measured = pk.VirtualMachine(true, seed=seed).measure(q, kind="pose")
            found = pk.identify(hexapod, measured)
            squares[name].append(np.mean(missed(found.robot, true, at) ** 2))
    assert np.mean(squares["planned"]) < np.mean(squares["random"])
    # and as well as was predicted
    assert np.sqrt(np.mean(squares["planned"])) == pytest.approx(twenty.predicted, rel=0.15)


def test_prediction_is_that_of_the_calibration(hexapod: Robot, twenty: Plan) -> None:
    measured = pk.VirtualMachine(hexapod).measure(twenty.actuators, kind="pose")
    found = pk.identify(hexapod, measured)
    elsewhere = pk.sample_poses(hexapod, 50, seed=3)
    plan = pk.plan_poses(hexapod, twenty.poses, 20, targets=elsewhere, kind="pose")
    rms = np.sqrt(np.mean(found.accuracy(elsewhere) ** 2))
    assert plan.predicted == pytest.approx(rms, rel=0.01)
    np.testing.assert_array_equal(plan.indices, range(20))


def test_fewest_poses_for_an_accuracy(hexapod: Robot, candidates: np.ndarray) -> None:
    few = pk.plan_poses(hexapod, candidates, accuracy=0.03, kind="pose")
    assert few.predicted <= 0.03
    assert pk.plan_poses(hexapod, candidates, len(few) - 1, kind="pose").predicted > 0.03
    finer = pk.plan_poses(hexapod, candidates, accuracy=0.015, kind="pose")
    assert len(finer) > len(few)


def test_candidates_beside_a_singularity_are_left_out(
    hexapod: Robot,
) -> None:
    extreme = pk.sample_poses(hexapod, 200, share=0.9)
    plan = pk.plan_poses(hexapod, extreme, 20, prior=0.5)
    lost, lost_of_all = 0, 0
    for seed in range(50):
        true = with_errors(hexapod, 0.5, np.random.default_rng(seed))
        lost += np.count_nonzero(~true.forward(plan.actuators, guess=plan.poses).ok)
        every = true.forward(hexapod.inverse(extreme), guess=extreme)
        lost_of_all += np.count_nonzero(~every.ok)
    assert plan.left_out > 0
    assert lost <= 5 and lost_of_all > 100  # of 1000 and of 10 000


def test_targets_are_where_the_machine_becomes_accurate(
    hexapod: Robot, candidates: np.ndarray
) -> None:
    corner = candidates[candidates[:, 0] > 200]
    there = pk.plan_poses(hexapod, candidates, 15, targets=corner, prior=1.0)
    anywhere = pk.plan_poses(hexapod, candidates, 15, prior=1.0)
    measured = pk.VirtualMachine(hexapod).measure(anywhere.actuators)
    found = pk.identify(hexapod, measured, prior=1.0)
    assert there.predicted < np.sqrt(np.mean(found.accuracy(corner) ** 2))


def test_determinant_and_variances_are_least_by_their_own_criteria(
    hexapod: Robot, candidates: np.ndarray
) -> None:
    free = ["offset*", "base*.z"]
    plans = {
        name: pk.plan_poses(hexapod, candidates, 12, criterion=name, free=free)
        for name in ("prediction", "D", "A")
    }
    covariance = {
        name: pk.identify(
            hexapod, pk.VirtualMachine(hexapod).measure(plan.actuators), free=free
        ).covariance
        for name, plan in plans.items()
    }
    assert min(plans, key=lambda name: np.linalg.det(covariance[name])) == "D"
    assert min(plans, key=lambda name: np.trace(covariance[name])) == "A"
    assert min(plans, key=lambda name: plans[name].predicted) == "prediction"


def test_candidates_beyond_limits_are_left_out() -> None:
    robot = pk.load("2tpr2tps")
    good = pk.sample_poses(robot, 30)
    bad = good + np.array([0, 0, 400, 0, 0, 0])
    plan = pk.plan_poses(robot, np.concatenate([bad, good]), 12, prior=0.5)
    assert plan.left_out == 30 and (plan.indices >= 30).all()
    assert robot.feasible(plan.poses).ok.all()
    np.testing.assert_allclose(robot.inverse(plan.poses), plan.actuators, atol=1e-9)
    assert "30 candidates left out" in str(plan)


def test_poses_that_closures_do_not_allow_are_completed() -> None:
    robot = pk.load("2tpr2tps")
    poses = pk.sample_poses(robot, 30)
    poses[:, 0] = 0.0  # x follows from z and beta
    plan = pk.plan_poses(robot, poses, 12, prior=0.5)
    assert np.abs(plan.poses[:, 0] - plan.poses[:, 2] * np.tan(plan.poses[:, 4])).max() < 1e-9


def test_what_is_unknown_of_the_instrument_is_found_along(hexapod: Robot) -> None:
    poses = pk.sample_poses(hexapod, 60)
    two = [[100, 0, 30], [-80, 60, 30]]
    options: dict[str, Any] = {"count": 15, "free": "offset*", "target": two}
    known = pk.plan_poses(hexapod, poses, **options)
    frame = pk.plan_poses(hexapod, poses, unknown="frame", **options)
    both = pk.plan_poses(hexapod, poses, unknown=["frame", "target"], **options)
    assert frame.parameters[6:] == tuple(f"frame.{x}" for x in ("x", "y", "z", "alpha", "beta",
                                                                "gamma"))  # fmt: skip
    assert both.parameters[12:] == tuple(f"target{i}.{x}" for i in "12" for x in "xyz")
    assert known.predicted < frame.predicted < both.predicted


def test_too_few_poses_are_said_to_tell_too_little(hexapod: Robot, candidates: np.ndarray) -> None:
    plan = pk.plan_poses(hexapod, candidates, 5, kind="pose")
    assert plan.predicted == float("inf")
    assert "too few to identify all of them" in str(plan)


def test_a_plan_pickles(twenty: Plan) -> None:
    again = pickle.loads(pickle.dumps(twenty))
    assert str(again) == str(twenty)
    np.testing.assert_array_equal(
        again.robot.inverse(again.poses), twenty.robot.inverse(twenty.poses)
    )


ARM = pk.SerialArm.from_dh(
    a=[312, 1075, 225, 0, 0, 0],
    alpha=np.radians([-90, 0, -90, 90, -90, 0]),
    d=[670, 0, 0, 1280, 0, 215],
    theta=np.radians([0, -90, 0, 0, 0, 0]),
    name="six joints",
)


def test_a_plan_of_an_arm_is_of_joint_coordinates_and_calibrates_as_predicted() -> None:
    rng = np.random.default_rng(0)
    offered, aims = rng.uniform(-2, 2, (200, 6)), rng.uniform(-2, 2, (100, 6))
    plan = pk.plan_poses(ARM, offered, 25, targets=aims)
    assert plan.robot is ARM and plan.left_out == 0
    np.testing.assert_array_equal(plan.actuators, offered[plan.indices])
    np.testing.assert_allclose(plan.poses, pk.screw.to_pose(ARM.forward(plan.actuators)))
    assert plan.all_candidates < plan.predicted < plan.at_random
    off = []
    for seed in range(30):
        errors = np.random.default_rng(seed).normal(size=(6, 6))
        true = ARM.replace(errors * [0.5, 0.5, 0.5, 5e-4, 5e-4, 5e-4])
        found = pk.identify(ARM, pk.VirtualMachine(true, seed=seed).measure(plan.actuators))
        assert isinstance(found.robot, pk.SerialArm)
        off.append((found.robot.forward(aims) - true.forward(aims))[:, :3, 3])
    rms = np.sqrt(np.mean(np.sum(np.square(off), axis=2)))
    assert rms == pytest.approx(plan.predicted, rel=0.15)


def test_a_plan_of_an_arm_shows_what_to_command() -> None:
    arm = pk.SerialArm(
        [[0, 0, 1], [1, 0, 0], [0, 0, 1]],
        [[0, 0, 0], [300, 0, 0], [400, 0, 0]],
        [450, 0, 0, 0, 0, 0],
        kinds=["revolute", "prismatic", "revolute"],
    )
    offered = np.random.default_rng(0).uniform(-1, 1, (30, 3)) * [2, 100, 2]
    lines = str(pk.plan_poses(arm, offered, 1, free="joint1.dx", kind="pose")).splitlines()
    assert lines[2].split() == ["candidate", "q1", "[deg]", "q2", "[mm]", "q3", "[deg]"]
    index, *shown = lines[3].split()
    q = offered[int(index)] * [180 / np.pi, 1, 180 / np.pi]
    np.testing.assert_allclose([float(cell) for cell in shown], q, atol=5.1e-4)


@pytest.mark.parametrize("name", ["candidates", "targets"])
def test_mistakes_in_a_plan_of_an_arm_are_named(name: str) -> None:
    given = {"candidates": np.zeros((5, 6)), "targets": np.zeros((5, 6))}
    with pytest.raises(ValueError, match=rf"{name} must have shape \(..., 6\)"):
        pk.plan_poses(ARM, count=3, **{**given, name: np.zeros((5, 7))})
    far = np.full((1, 6), 1e9)  # more than can be reduced to a turn
    with pytest.raises(ValueError, match=f"{name}: "):
        pk.plan_poses(ARM, count=3, **{**given, name: far})


def test_plan_is_read_by_a_person(twenty: Plan) -> None:
    lines = str(twenty).splitlines()
    assert lines[0].startswith("hexapod: measure 20 poses for 42 parameters")
    assert lines[1].startswith(f"predicted error {twenty.predicted:.3g} mm rms; 20 poses at random")
    assert len(lines) == 23 and max(map(len, lines)) <= 100


BAD: list[tuple[dict[str, Any], str]] = [
    ({}, "give either count, how many poses, or accuracy"),
    ({"count": 5, "accuracy": 0.1}, "give either count"),
    ({"count": 0}, r"count must be a whole number from 1 to \d+, the candidates, found 0"),
    ({"count": 201}, r"count must be a whole number from 1 to \d+"),
    ({"accuracy": 1e-6}, r"accuracy: all \d+ candidates together predict 0.0\d+ mm, found 1e-06"),
    ({"count": 5, "criterion": "E"}, "criterion must be one of prediction, D, A"),
    ({"count": 5, "criterion": "predicton"}, "did you mean 'prediction'"),
    ({"count": 5, "unknown": "tool"}, "unknown must be one of frame, target; found 'tool'"),
    ({"count": 5, "noise": 0.0}, "noise must be above 0"),
    ({"count": 5, "targets": [[0, 0, 9e9, 0, 0, 0]]}, r"targets: .*\(row 0\)"),
    ({"count": 5, "free": "ofset1"}, "did you mean 'offset1'"),
    ({"count": 5, "kind": "heigth"}, "kind must be one of"),
    ({"count": 5, "free": "platform*", "unknown": "target"}, "candidates: not even all of them"),
]


@pytest.mark.parametrize(("options", "words"), BAD)
def test_bad_arguments_are_named(
    hexapod: Robot, candidates: np.ndarray, options: dict[str, Any], words: str
) -> None:
    with pytest.raises(ValueError, match=words):
        pk.plan_poses(hexapod, candidates, **options)


def test_no_candidate_within_limits_is_an_error(hexapod: Robot) -> None:
    with pytest.raises(ValueError, match="candidates: none of 2 is within the limits of hexapod"):
        pk.plan_poses(hexapod, [[0, 0, 5000, 0, 0, 0], [0, 0, 10, 0, 0, 0]], 1)
    with pytest.raises(TypeError, match="accuracy must be a number, found 'fine'"):
        pk.plan_poses(hexapod, hexapod.home[None], accuracy="fine")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"count must be a whole number .* found 2\.5"):
        pk.plan_poses(hexapod, hexapod.home[None], 2.5)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("odd", "message"),
    [
        ({"count": 8, "criterion": "E"}, "one of prediction, D, A; found 'E'$"),
        ({"accuracy": -1.0}, "accuracy must be above 0, found -1"),
        ({"accuracy": np.nan}, "accuracy must be finite, found nan"),
    ],
)
def test_odd_wishes_say_what_was_found(
    hexapod: Robot, candidates: np.ndarray, odd: Any, message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        pk.plan_poses(hexapod, candidates, **odd)


BELTS = Path(__file__).parents[2] / "examples" / "belts" / "robot.toml"
ANCHORS = ("base*.x", "base*.y")


@pytest.fixture(scope="module")
def places() -> np.ndarray:
    rng = np.random.default_rng(0)
    at = np.zeros((150, 6))
    at[:, :2] = rng.uniform([400, 300], [2600, 1800], (150, 2))
    return at


@pytest.mark.parametrize("free", [None, ANCHORS])
def test_a_machine_that_calibrates_itself_is_as_accurate_as_planned(
    places: np.ndarray, free: tuple[str, ...] | None
) -> None:
    """With all anchors free nothing says where it stands: its error is that in its own frame."""
    robot = pk.load(BELTS)
    plan = pk.plan_poses(robot, places, 12, kind="closure", actuator_noise=0.3, free=free)
    assert plan.own_frame == (free is not None) == ("own frame" in str(plan))
    assert plan.all_candidates < plan.predicted < plan.at_random
    names = robot.geometry.match(free or robot.model.free)
    there, squares = robot.inverse(places), []
    for seed in range(80):
        rng = np.random.default_rng(seed)
        true = robot.replace({n: robot.geometry[n] + rng.normal(0, 3) for n in names})
        read = true.inverse(plan.poses) + rng.normal(0, 0.3, plan.actuators.shape)
        measured = pk.Measurements(read, None, "closure", actuator_sigma=0.3)
        found = pk.identify(robot, measured, free).robot
        ends = [machine.forward(there).pose[:, :2] for machine in (found, true)]
        if plan.own_frame:
            ends = [np.column_stack([end - end.mean(axis=0), np.zeros(len(end))]) for end in ends]
            ends[0] = Rotation.align_vectors(ends[1], ends[0])[0].apply(ends[0])
        squares.append(np.mean(((ends[0] - ends[1]) ** 2).sum(axis=1)))
    assert np.sqrt(np.mean(squares)) == pytest.approx(plan.predicted, rel=0.15)


def test_what_belts_cannot_say_is_refused_or_needs_their_noise(places: np.ndarray) -> None:
    robot = pk.load(BELTS)
    with pytest.raises(ValueError, match=r"not even all of them identify base1\.x"):
        pk.plan_poses(
            robot, places, 12, kind="closure", actuator_noise=0.3, free=[*ANCHORS, "gain*"]
        )
    with pytest.raises(ValueError, match=r"actuator_noise: .* more actuators than ways to move"):
        pk.plan_poses(robot, places, 12)
    delta = pk.load("linear-delta")
    with pytest.raises(ValueError, match="alone say nothing of its geometry"):
        pk.plan_poses(delta, pk.sample_poses(delta, 30), 12, kind="closure", actuator_noise=0.1)


def test_noise_of_actuators_is_planned_with(hexapod: Robot, candidates: np.ndarray) -> None:
    """The same candidate twice is one; less is known where actuators are noisy, too."""
    twice = np.vstack([candidates[:40], candidates[:40]])
    exact, noisy = (
        pk.plan_poses(hexapod, twice, 25, kind="pose", noise=0.02, actuator_noise=sigma).predicted
        for sigma in (1e-9, 0.02)
    )
    none = pk.plan_poses(hexapod, twice, 25, kind="pose", noise=0.02).predicted
    assert exact == pytest.approx(none, rel=1e-6)
    assert noisy > 1.3 * none


@pytest.mark.parametrize("unknown", ["frame", ["frame", "target"]])
def test_heights_of_a_planar_machine_tell_nothing_whatever_is_unknown(unknown: Any) -> None:
    """In a tilted frame they would, but nothing tilts it; to know less never helps."""
    robot = pk.load("3rrr-planar")
    poses = pk.sample_poses(robot, 40, seed=0, share=0.6)

    def predicted(unknown: Any) -> float:
        plan = pk.plan_poses(robot, poses, 12, kind="height", prior=5.0, unknown=unknown)
        return plan.predicted

    assert predicted(unknown) == pytest.approx(predicted(()), rel=1e-6)


@pytest.mark.parametrize("name", ["3rrr-planar", "five-bar"])
def test_measurements_that_no_parameter_moves_are_refused(name: str) -> None:
    """Heights of a machine that moves in a plane."""
    robot = pk.load(name)
    with pytest.raises(ValueError, match=r"candidates: .* depends on no parameter"):
        pk.plan_poses(robot, pk.sample_poses(robot, 20), 10, kind="height", free="offset*")


# --- several kinds -------------------------------------------------------------------------------

KINDS: dict[Any, int] = {"position": 12, "distance": 9}
POINTS: dict[Any, Any] = {"position": [40.0, 0.0, 60.0], "distance": [0.0, 0.0, -300.0]}
NOISE: dict[Any, float] = {"position": 0.02, "distance": 0.005}


@pytest.fixture(scope="module")
def mixed(hexapod: Robot, candidates: np.ndarray) -> Plan:
    return pk.plan_poses(hexapod, candidates, kind=KINDS, target=POINTS, noise=NOISE, prior=0.5)  # type: ignore[arg-type]


def test_a_plan_of_two_kinds_has_so_many_of_each(hexapod: Robot, mixed: Plan) -> None:
    assert [mixed.kinds.count(kind) for kind in KINDS] == [12, 9]
    assert mixed.all_candidates < mixed.predicted < mixed.at_random
    assert "measure" in str(mixed) and "distance" in str(mixed)


def test_its_prediction_is_that_of_a_calibration_by_both(
    hexapod: Robot, candidates: np.ndarray, mixed: Plan
) -> None:
    kinds = np.array(mixed.kinds)
    sets = [
        pk.VirtualMachine(hexapod, NOISE[kind]).measure(
            mixed.actuators[kinds == kind], kind, POINTS[kind]
        )
        for kind in KINDS
    ]
    found = pk.identify(hexapod, sets, prior=0.5)
    aims = candidates[np.isfinite(found.accuracy(candidates))]
    again = pk.plan_poses(
        hexapod, candidates, targets=aims, kind=KINDS, target=POINTS, noise=NOISE, prior=0.5
    )
    rms = np.sqrt(np.mean(found.accuracy(aims) ** 2))
    assert again.predicted == pytest.approx(rms, rel=0.02)


def test_no_exchange_within_a_kind_is_left_that_gains(
    hexapod: Robot, candidates: np.ndarray, mixed: Plan
) -> None:
    """Distances add to positions alone, and better chosen ones more than others."""
    alone = pk.plan_poses(hexapod, candidates, 12, target=POINTS["position"], noise=0.02, prior=0.5)
    assert mixed.predicted < alone.predicted


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ({"kind": {"position": 3}, "count": 3}, "kind: a mapping says how many"),
        ({"kind": {}}, "kind: a mapping says how many"),
        ({"kind": {"position": 0}}, "kind must be a whole number from 1"),
        ({"kind": {"positions": 3}}, "kind must be one of"),
        ({"kind": {"position": 3}, "noise": {"pose": 1.0}}, "noise: the plan has position"),
        ({"kind": {"position": 3, "pose": 2}, "noise": {"pose": 1.0}}, "noise: of position not"),
    ],
)
def test_what_several_kinds_do_not_take(
    words: dict[str, Any], message: str, hexapod: Robot, candidates: np.ndarray
) -> None:
    with pytest.raises(pk.ArgumentError, match=message):
        pk.plan_poses(hexapod, candidates[:10], free="offset*", **words)


def test_poses_at_which_cables_would_have_to_push_are_not_proposed(
    run: Any, tmp_path: Path
) -> None:
    """Belts in a plane hold a point where it lies between their ends, whatever they weigh."""
    sled = pk.load(Path(__file__).parents[2] / "examples" / "belts" / "robot.toml")
    x, y = np.meshgrid([500.0, 1500.0, 2500.0], [300.0, 1000.0, 1700.0])
    between = np.c_[x.ravel(), y.ravel(), np.zeros((9, 4))]
    beside = between[:3] + np.array([0.0, 5000.0, 0.0, 0.0, 0.0, 0.0])
    given: dict[str, Any] = {"kind": "closure", "actuator_noise": 0.5}
    places = np.concatenate([beside, between])
    plan = pk.plan_poses(sled, places, 9, **given)
    assert sorted(plan.indices.tolist()) == [*range(3, 12)]
    assert plan.unpulled == plan.left_out == 3
    write_poses(tmp_path / "places.csv", places)
    said = run(
        "plan", BELTS, "--poses", tmp_path / "places.csv", "--kind", "closure",
        "--actuator-noise", 0.5, "--count", 9, "--json",
    )  # fmt: skip
    assert json.loads(said.stdout)["unpulled"] == 3


@pytest.mark.parametrize(
    ("asked", "named"), [({"count": 6}, "criterion"), ({"accuracy": 0.1}, "accuracy")]
)
def test_an_error_that_is_always_nothing_chooses_no_poses(
    asked: dict[str, float], named: str
) -> None:
    """The platform of a spherical machine turns about its origin, whatever the errors."""
    robot = pk.load("agile-eye")
    candidates = pk.sample_poses(robot, 12, seed=1)
    with pytest.raises(pk.ArgumentError, match=f"{named}: nothing that is free moves the origin"):
        pk.plan_poses(robot, candidates, kind="orientation", prior=0.3, **asked)
    plan = pk.plan_poses(robot, candidates, 6, kind="orientation", prior=0.3, criterion="A")
    assert len(plan) == 6
