"""Mirror images: reflected by hand, a machine that fits as well is found from there."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.estimation.mirror import _mirror
from tests.robots import made

CORNERS = np.array([[0.0, 0, 0], [2400, 1800, 0], [-300, 2300, 0], [2500, -400, 0]])
ROOM = np.array([[0.0, -1597, -120], [1550, 900, -120], [-1370, 790, -60], [0, 0, 2355]])
FRAME = {"base": {"x": 100.0, "y": -50.0, "z": 30.0, "alpha": 0.4, "gamma": 0.7}}
MIRROR = "its mirror image fits as well: which of the two it is, the robot file says alone"


def points(map: str, anchors: np.ndarray, home: dict[str, float], **sections: Any) -> pk.Robot:
    limbs = [{"kind": "cable", "base": a, "platform": [0.0, 0.0, 0.0]} for a in anchors]
    return made(map, home, limbs, **sections)


def eight(thick: float) -> pk.Robot:
    """A platform on eight cables; its joints are in a plane that is tilted, if it is not thick."""
    tilt = pk.screw.from_pose([0, 0, 0, 0.3, -0.2, 0.1])[:3, :3]
    limbs: list[dict[str, Any]] = []
    for i in range(8):
        turn = np.pi * i / 4 + 0.3 * (i % 2)
        base = [2500 * np.cos(turn), 2000 * np.sin(turn), 2600.0 if i % 2 else 40.0 * i]
        there = turn + 0.4 * (i % 3)
        flat = [150 * np.cos(there), 150 * np.sin(there), thick * (-1) ** i]
        limbs.append({"kind": "cable", "base": base, "platform": tilt @ flat})
    return made("spatial", {"z": 1200.0}, limbs)


def log(
    robot: pk.Robot, spread: list[float], wrong: Any = "base*", rows: int = 25
) -> tuple[np.ndarray, np.ndarray]:
    """Poses of a machine with errors, and noisy readings of its actuators."""
    rng = np.random.default_rng(1)
    names = robot.geometry.match(wrong)
    true = robot.replace({n: robot.geometry[n] + rng.normal(0, 3) for n in names})
    own = robot.frames.inward(robot.home[None]) + rng.uniform(-1, 1, (rows, 6)) * spread
    poses = robot.frames.outward(own)
    return poses, true.inverse(poses) + rng.normal(0, 0.2, (rows, robot.n_actuators))


def fitted(robot: pk.Robot, q: np.ndarray, free: Any, read: Any = None, kind: str = "closure"):
    sigma = None if read is None else 0.2
    rows = pk.Measurements(q, read, kind, sigma=sigma, actuator_sigma=0.2)  # type: ignore[arg-type]
    return pk.identify(robot, rows, free)


def test_a_mirror_through_two_anchors_that_are_held() -> None:
    """They lie on a line across no axis: the others are reflected in it."""
    robot = points("xy", CORNERS, {"x": 1100.0, "y": 900.0})
    free = ["base3.x", "base3.y", "base4.x", "base4.y"]
    _, q = log(robot, [600, 500, 0, 0, 0, 0], free[1:])
    found = fitted(robot, q, free)
    assert found.gauges == (MIRROR,)
    along = np.array([0.8, 0.6])
    across = found.robot.slots[2:, :2]
    image = 2 * np.outer(across @ along, along) - across
    other = robot.replace(dict(zip(free, image.reshape(-1), strict=True)))
    again = fitted(other, q, free)
    np.testing.assert_allclose(again.values, image.reshape(-1), atol=1e-5)
    assert again.closure_rms == pytest.approx(found.closure_rms, rel=1e-8)
    assert fitted(robot, q, free[1:]).gauges == ()  # base3.x is held: no mirror keeps it


def test_a_mirror_of_a_machine_whose_base_is_turned() -> None:
    robot = points("translation", ROOM, {"z": 600.0}, frames=FRAME)
    poses, q = log(robot, [500, 500, 500, 0, 0, 0])
    assert MIRROR in fitted(robot, q, "base*").gauges
    read = poses[:, :3] + np.random.default_rng(3).normal(0, 0.2, (len(q), 3))
    assert MIRROR not in fitted(robot, q, "base*", read, "position").gauges


def test_points_of_tackles_are_reflected_too() -> None:
    lines = [(0, 1, [1, 1]), (1, 2, [1, 2]), (2, 3, [1, 2]), (3, 0, [2, 1])]
    limbs = [
        {"kind": "tackle", "base": CORNERS[a], "over": [CORNERS[b] + [30, 20, 0]], "parts": n,
         "platform": [0.0, 0.0, 0.0]}
        for a, b, n in lines
    ]  # fmt: skip
    robot = made("xy", {"x": 900.0, "y": 800.0}, limbs)
    bases = [n for n in robot.geometry.match("base*") if not n.endswith("z")]
    overs = [n for n in robot.geometry.match("over*") if not n.endswith("z")]
    _, q = log(robot, [500, 500, 0, 0, 0, 0], bases, rows=60)
    assert MIRROR in fitted(robot, q, bases + overs).gauges
    assert MIRROR not in fitted(robot, q, bases).gauges


def test_a_platform_whose_joints_are_in_a_plane_is_its_own_mirror_image() -> None:
    """One with depth is not, unless its joints are found as well."""
    flat, solid = eight(0.0), eight(60.0)
    spread = [700, 600, 500, 0.15, 0.15, 0.15]
    assert MIRROR in fitted(flat, log(flat, spread)[1], "base*").gauges
    _, q = log(solid, spread, rows=80)
    assert MIRROR not in fitted(solid, q, "base*").gauges
    assert MIRROR in fitted(solid, q, ["base*", "platform*"]).gauges


def test_a_mirror_keeps_what_is_held_and_nothing_else_of_a_plane_beside_the_origin() -> None:
    """Twice is once: a mirror image of a mirror image is where it was."""
    points = {"base1": np.array([5.0, 1, 2]), "base2": np.array([5.0, 8, -3]),
              "base3": np.array([-40.0, 0, 7])}  # fmt: skip
    free = ("base1.y", "base1.z", "base2.y", "base3.x", "base3.y", "base3.z")
    mirror = _mirror(points, free, np.array([1.0, 0, 0]), 1e-6)
    assert mirror is not None
    image = {name: mirror[:3, :3] @ place + mirror[:3, 3] for name, place in points.items()}
    np.testing.assert_allclose(image["base1"], points["base1"], atol=1e-12)
    np.testing.assert_allclose(image["base2"], points["base2"], atol=1e-12)
    np.testing.assert_allclose(image["base3"], [50.0, 0, 7], atol=1e-12)
    np.testing.assert_allclose(mirror @ mirror, np.eye(4), atol=1e-12)
    assert _mirror(points, free[:3], np.array([1.0, 0, 0]), 1e-6) is None  # base3.x is held too
