"""Where cables pull, as plans, samples and grids take it: hulls of anchors, linear programs."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.optimize import linprog
from scipy.spatial import Delaunay

import pkmcal as pk
from pkmcal.geometry.load import CableLoad
from pkmcal.kinematics.pulled import load_of, pulled
from pkmcal.kinematics.tensions import can_pull
from tests.robots import made

FLAT = np.array([[-1500.0, -1000, 0], [1500, -1000, 0], [1400, 1100, 0], [-1450, 950, 0]])
ABOVE = np.array([[1500.0, 0, 2000], [-800.0, 1200, 2000], [-700.0, -1300, 2000]])
HOME = {"x": 20.0, "y": 10.0}


def cables(map: str, anchors: np.ndarray, home: dict[str, float], **sections: Any) -> pk.Robot:
    limbs = [{"kind": "cable", "base": a, "platform": [0.0, 0.0, 0.0]} for a in anchors]
    return made(map, home, limbs, **sections)


def eight(**sections: Any) -> pk.Robot:
    corners = np.array(
        [[x, y, z] for z in (0.0, 2200) for x in (-1500.0, 1500) for y in (-1200.0, 1200)]
    )
    body = np.sign(corners - [0, 0, 1000.0]) * [-120, 100, 90]
    limbs = [
        {"kind": "cable", "base": a, "platform": b} for a, b in zip(corners, body, strict=True)
    ]
    return made("spatial", {"z": 1000.0}, limbs, **sections)


def linear_program(robot: pk.Robot, pose: np.ndarray, load: CableLoad) -> bool:
    """Whether tensions within their bounds balance a force and its torque at a pose."""
    turn, shift = pk.screw.from_pose(pose)[:3, :3], pose[:3]
    ends = robot.slots[:, 3:6] @ turn.T
    along = robot.slots[:, :3] - ends - shift
    along /= np.linalg.norm(along, axis=1)[:, None]
    wrenches = np.vstack([along.T, np.cross(ends, along).T / 200.0])
    at, force = turn @ load.at, np.array(load.force)
    most = None if np.isinf(load.most) else load.most
    found = linprog(
        np.ones(len(ends)),
        A_eq=wrenches,
        b_eq=-np.concatenate([force, np.cross(at, force) / 200.0]),
        bounds=(load.least, most),
    )
    assert found.status in (0, 2)
    return bool(found.status == 0)


@pytest.mark.parametrize("most", [np.inf, 300.0])
def test_cables_can_pull_where_a_linear_program_has_a_solution(most: float) -> None:
    load = CableLoad((10.0, -5.0, -98.1), (5.0, -10.0, 15.0), 10.0, most)
    robot, rng = eight(), np.random.default_rng(0)
    drawn = rng.uniform(-1, 1, (120, 6)) * [1200, 900, 900, 0.3, 0.3, 0.3]
    poses = drawn + np.array([0, 0, 1100, 0, 0, 0])
    found = can_pull(robot, poses, load)
    assert found.tolist() == [linear_program(robot, pose, load) for pose in poses]
    assert 10 < found.sum() < 110
    said = pk.tensions(robot, poses, load.force, at=load.at, least=10.0, most=most)
    np.testing.assert_array_equal(said.ok, found)


def test_what_no_cable_pulls_on_is_no_matter_of_tension() -> None:
    hexapod = pk.load("hexapod")
    assert load_of(hexapod) is None
    assert pulled(hexapod, np.full((2, 6), np.nan)).all()


def test_poses_are_drawn_inside_the_hull_of_the_anchors() -> None:
    """Belts in a plane pull against each other there, and nowhere else."""
    robot = cables("xy", FLAT, HOME)
    hull = Delaunay(FLAT[:, :2])
    drawn = pk.sample_poses(robot, 200, share=1.0)
    assert (hull.find_simplex(drawn[:, :2]) >= 0).all()
    assert np.ptp(drawn[:, 0]) > 2000 and np.ptp(drawn[:, 1]) > 1500
    grid = pk.workspace(robot, {"x": (-2000, 2000, 41), "y": (-1500, 1500, 31)})
    inside = hull.find_simplex(grid.poses[..., :2]) >= 0
    np.testing.assert_array_equal(grid.inside, inside)
    np.testing.assert_array_equal(grid.pulled, inside)


def test_a_plan_leaves_out_where_some_cable_would_have_to_push() -> None:
    """A point hangs on three cables inside the triangle below their anchors."""
    robot = cables("translation", ABOVE, {"z": 800.0}, calibration={"free": ["base*.x"]})
    rng = np.random.default_rng(1)
    places = np.zeros((80, 6))
    places[:, :3] = rng.uniform([-1500, -1500, 300], [1500, 1500, 1500], (80, 3))
    below = Delaunay(ABOVE[:, :2]).find_simplex(places[:, :2]) >= 0
    plan = pk.plan_poses(robot, places, 10)
    assert below[plan.indices].all()
    assert plan.unpulled == (~below).sum() and plan.left_out >= plan.unpulled
    assert f"would have to push at {plan.unpulled} of those left out" in str(plan)
    all_inside = pk.plan_poses(robot, places[below], 10)
    assert all_inside.unpulled == 0 and "push" not in str(all_inside)
    with pytest.raises(ValueError, match=r"at \d+ some cable would have to push"):
        pk.plan_poses(robot, places[~below], 10)


def test_the_load_of_the_file_counts_instead() -> None:
    """Under a weight a platform hangs; what is heavy to one side pulls fewer places taut."""
    load = {"force": [0.0, 0.0, -98.1], "at": [40.0, 0.0, -30.0], "least": 5.0, "most": 400.0}
    stated, free = eight(load=load), eight()
    assert stated.model.load == CableLoad((0.0, 0.0, -98.1), (40.0, 0.0, -30.0), 5.0, 400.0)
    poses = pk.sample_poses(stated, 60, share=0.8)
    given: dict[str, Any] = {"at": [40, 0, -30], "least": 5.0, "most": 400.0}
    assert pk.tensions(stated, poses).ok.all()
    assert pk.tensions(free, poses, [0, 0, -98.1], **given).ok.all()
    light = pk.sample_poses(free, 60, share=0.8)
    assert not pk.tensions(free, light, [0, 0, -98.1], **given).ok.all()
    # what is given takes the place of what is stated, one by one
    np.testing.assert_array_equal(
        pk.tensions(stated, light, [0, 0, -9.81], at=[0, 0, 0]).tension,
        pk.tensions(free, light, [0, 0, -9.81], least=5.0, most=400.0).tension,
    )


def test_a_home_that_does_not_hold_the_load_is_said() -> None:
    lifted = cables("translation", ABOVE, {"z": 800.0}, load={"force": [0.0, 0.0, 5.0]})
    (finding,) = pk.check_geometry(lifted).findings
    assert finding.kind == "tension" and "under the load of the file" in finding.what
    with pytest.raises(ValueError, match="at home some cable would have to push"):
        pk.sample_poses(lifted, 5)
    hung = cables("translation", ABOVE, {"z": 800.0}, load={"force": [0.0, 0.0, -5.0]})
    assert "at home they hold the load of the file" in str(pk.check_geometry(hung))


def test_loads_are_written_and_read_back(tmp_path: Any) -> None:
    load = {"force": [0.1, 0.0, -98.1], "at": [1.0, 2.0, -3.0], "least": 0.1}
    robot = cables("translation", ABOVE, {"z": 800.0}, load=load)
    robot.save(tmp_path / "robot.toml")
    assert pk.load(tmp_path / "robot.toml").model.load == robot.model.load


@pytest.mark.parametrize(
    ("load", "message"),
    [
        ({"force": [0.0, 0.0, 0.0]}, "least must be above 0 where no force acts"),
        ({"least": -1.0}, "must not be negative"),
        ({"force": [0.0, 1.0]}, "must be three numbers"),
        ({"least": 5.0, "most": 4.0}, "must be above least, 5 N"),
        ({"mass": 5.0}, "'mass'"),
    ],
)
def test_what_is_no_load_is_refused(load: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        cables("translation", ABOVE, {"z": 800.0}, load=load)


def test_legs_hold_any_load() -> None:
    legs = [{"kind": "UPS", "base": a, "platform": [0.0, 0.0, 0.0]} for a in ABOVE]
    with pytest.raises(ValueError, match="the robot has none"):
        made("translation", {"z": 800.0}, legs, load={"force": [0.0, 0.0, -1.0]})
