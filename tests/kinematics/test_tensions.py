"""Tensions of cables: equilibrium written out in NumPy, hulls of anchors, scans of what is free."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial import Delaunay

import pkmcal as pk

ANCHORS = np.array([[-1500.0, -1000, 0], [1500, -1000, 0], [1400, 1100, 0], [-1450, 950, 0]])
SPATIAL = 'map = "spatial"\nhome = { z = 1000 }'


def machine(
    path: Path, pose: str, ends: list[tuple[Any, Any]], kind: str = "cable", more: str = "",
    head: str = "",
) -> pk.Robot:  # fmt: skip
    limbs = "".join(
        f'[[limb]]\nkind = "{kind}"\nbase = {np.asarray(a).tolist()}\n'
        f"platform = {np.asarray(b).tolist()}\n{more}"
        for a, b in ends
    )
    path.write_text(
        'name = "cables"\nunits = { length = "mm", angle = "deg" }\n'
        f"[pose]\n{pose}\n{head}" + limbs
    )
    return pk.load(path)


def block() -> list[tuple[np.ndarray, np.ndarray]]:
    corners = np.array(
        [[x, y, z] for z in (0.0, 2200) for x in (-1500.0, 1500) for y in (-1200.0, 1200)]
    )
    body = np.sign(corners - [0, 0, 1000.0]) * [120, 100, 90]
    body[:, 0] *= -1  # crossed, so that turns are held as well
    return list(zip(corners, body, strict=True))


@pytest.mark.parametrize("kind", ["cable", "pulley"])
def test_forces_and_torques_balance(tmp_path: Path, kind: str) -> None:
    """In the user's frames: base turned and shifted, tool off the platform's origin."""
    more = "radius = 40.0\nswivel = [0.0, 0.0, 1.0]\n" if kind == "pulley" else ""
    frames = (
        "[frames]\nbase = { x = 100, y = -50, z = 30, alpha = 20, beta = -10, gamma = 40 }\n"
        "tool = { z = 60, alpha = 15 }\n"
    )
    robot = machine(tmp_path / "a.toml", SPATIAL, block(), kind, more, frames)
    plain = machine(tmp_path / "b.toml", SPATIAL, block(), kind, more)
    own = np.array([[30.0, -60, 1050, 0.03, -0.02, 0.05], [200, 150, 900, 0.0, 0.04, -0.03]])
    base, tool = robot.model.base_frame, robot.model.tool_frame
    first, last = pk.screw.from_pose(base), pk.screw.from_pose(tool)
    poses = np.array([pk.screw.to_pose(first @ pk.screw.from_pose(p) @ last) for p in own])
    force, at = np.array([20.0, -15, -98.1]), np.array([5.0, -8, 12])
    found = pk.tensions(robot, poses, force, at=at, least=10.0)
    assert found.ok.all() and (found.tension >= 10.0 - 1e-6).all()
    for pose, straight, tension in zip(poses, own, found.tension, strict=True):
        directions = plain.limb_machine.limbs(plain.slots, straight[None])[1][0]
        turned = pk.screw.from_pose(base)[:3, :3]
        total, torque = force.copy(), np.zeros(3)
        acts = pk.screw.from_pose(pose) @ np.append(at, 1.0)
        torque += np.cross(acts[:3], force)
        for (_, end), direction, pull in zip(block(), directions, tension, strict=True):
            there = pk.screw.from_pose(base) @ pk.screw.from_pose(straight) @ np.append(end, 1.0)
            total -= pull * turned @ direction
            torque -= np.cross(there[:3], pull * turned @ direction)
        np.testing.assert_allclose(total, 0.0, atol=1e-6)
        np.testing.assert_allclose(torque, 0.0, atol=1e-3)


def test_three_hanging_cables_have_the_tensions_of_statics(tmp_path: Path) -> None:
    anchors = np.array([[1500.0, 0, 2000], [-800, 1200, 2100], [-700, -1300, 1900]])
    robot = machine(
        tmp_path / "three.toml", 'map = "translation"\nhome = { z = 500 }',
        [(a, np.zeros(3)) for a in anchors],
    )  # fmt: skip
    rng = np.random.default_rng(0)
    poses = np.zeros((60, 6))
    poses[:, :3] = rng.uniform([-1500, -1500, 0], [1500, 1500, 1800], (60, 3))
    found = pk.tensions(robot, poses, (0, 0, -50.0))
    for pose, ok, tension in zip(poses, found.ok, found.tension, strict=True):
        away = pose[:3] - anchors
        alone = np.linalg.solve((away / np.linalg.norm(away, axis=1)[:, None]).T, [0, 0, -50.0])
        assert ok == bool((alone >= 0).all())
        if ok:
            np.testing.assert_allclose(tension, alone, atol=1e-6)
    assert 5 < found.ok.sum() < 55


def test_a_point_on_belts_is_held_inside_their_hull(tmp_path: Path) -> None:
    robot = machine(
        tmp_path / "belts.toml", 'map = "xy"\nhome = { x = 0, y = 0 }',
        [(a, np.zeros(3)) for a in ANCHORS],
    )  # fmt: skip
    rng = np.random.default_rng(1)
    poses = np.zeros((200, 6))
    poses[:, :2] = rng.uniform([-2000, -1500], [2000, 1500], (200, 2))
    hull = Delaunay(ANCHORS[:, :2])
    inside = hull.find_simplex(poses[:, :2]) >= 0
    grown, shrunk = (Delaunay(ANCHORS[:, :2] * f) for f in (1.02, 0.98))
    sure = (grown.find_simplex(poses[:, :2]) >= 0) == (shrunk.find_simplex(poses[:, :2]) >= 0)
    found = pk.tensions(robot, poses, least=1.0)
    np.testing.assert_array_equal(found.ok[sure], inside[sure])
    assert 30 < inside.sum() < 170


def test_the_largest_tension_is_least(tmp_path: Path) -> None:
    """Against a scan of the two numbers that equilibrium leaves free."""
    robot = machine(
        tmp_path / "belts.toml", 'map = "xy"\nhome = { x = 0, y = 0 }',
        [(a, np.zeros(3)) for a in ANCHORS],
    )  # fmt: skip
    pose, force = np.array([300.0, -200, 0, 0, 0, 0]), np.array([12.0, -30, 0])
    found = pk.tensions(robot, pose, force, least=2.0)
    away = pose[:2] - ANCHORS[:, :2]
    slopes = (away / np.linalg.norm(away, axis=1)[:, None]).T
    first = np.linalg.pinv(slopes) @ force[:2]
    free = np.linalg.svd(slopes)[2][2:]
    a, b = np.meshgrid(np.linspace(-150, 150, 1201), np.linspace(-150, 150, 1201))
    each = first + a[..., None] * free[0] + b[..., None] * free[1]
    largest = each.max(axis=-1)[(each >= 2.0).all(axis=-1)].min()
    assert found.tension.max() <= largest + 1e-9
    assert found.tension.max() > largest - 0.5  # a step of the scan


def test_beyond_the_largest_tension_and_out_of_reach(tmp_path: Path) -> None:
    robot = machine(
        tmp_path / "two.toml", 'map = "xy"\nhome = { x = 0, y = -1000 }',
        [([-1000.0, 0, 0], np.zeros(3)), ([1000.0, 0, 0], np.zeros(3))],
    )  # fmt: skip
    # at an angle φ below level two cables carry 2 t sin φ
    low, high = np.array([0.0, -1000, 0, 0, 0, 0]), np.array([0.0, -50, 0, 0, 0, 0])
    found = pk.tensions(robot, [low, high, [0.0, 50, 0, 0, 0, 0]], (0, -100.0, 0), most=300.0)
    assert found.status.tolist() == [0, 2, 1]
    np.testing.assert_allclose(found.tension[0], 100.0 / 2 / np.sin(np.pi / 4))
    assert np.isnan(found.tension[1:]).all()
    assert "1 held, 1 not held by cables that pull, 1 beyond the largest tension" in str(found)
    pulleys = machine(
        tmp_path / "pulleys.toml", 'map = "translation"\nhome = { z = -500 }',
        [(a, np.zeros(3)) for a in ANCHORS], "pulley", "radius = 50.0\nswivel = [0, 0, 1]\n",
    )  # fmt: skip
    at_the_middle = [*(ANCHORS[0] + [50.0, 0, 0]), 0, 0, 0]
    assert pk.tensions(pulleys, at_the_middle, least=1.0).status == 3


def test_what_has_no_cables_is_refused() -> None:
    with pytest.raises(pk.ArgumentError, match="hexapod has no cables"):
        pk.tensions(pk.load("hexapod"), [0, 0, 850, 0, 0, 0])
    with pytest.raises(pk.ArgumentError, match="has no cables"):
        pk.tensions(pk.load("tricept"), [0, 0, 1000, 0, 0, 0])
    sled = pk.load("examples/belts/robot.toml")
    for more, said in (
        ({"force": (np.nan, 0, 0)}, "force must be finite, found"),
        ({"at": (np.inf, 0, 0)}, "at must be finite, found"),
    ):
        with pytest.raises(pk.ArgumentError, match=said):
            pk.tensions(sled, sled.home, **more)  # type: ignore[arg-type]
    with pytest.raises(pk.ArgumentError, match="least must be above 0 where no force acts"):
        pk.tensions(sled, [1500, 2500, 0, 0, 0, 0])
    with pytest.raises(pk.ArgumentError, match="most must be above 5"):
        pk.tensions(sled, sled.home, least=5.0, most=4.0)
