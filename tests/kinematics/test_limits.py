"""Reach, strokes and joint cones: each limit broken alone, by the one limb that has it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.kinematics.limits import Feasibility

from .. import robots, twin
from ..workspaces import WORKSPACE, poses

LIMITS = Feasibility.LIMITS
MACHINES: dict[str, tuple[Callable[..., pk.Robot], list[float]]] = {
    "length": (robots.hexapod, [30.0, -20.0, 790.0, 0.1, -0.15, 0.2]),
    "slider": (robots.linear_delta, [15.0, -25.0, 110.0, 0.0, 0.0, 0.0]),
    "crank": (robots.rotary_delta, [15.0, -25.0, -440.0, 0.0, 0.0, 0.0]),
}
LIMBS = [
    (kind, i) for kind, count in (("length", 6), ("slider", 3), ("crank", 3)) for i in range(count)
]
each_limb = pytest.mark.parametrize(("kind", "i"), LIMBS)
each_kind = pytest.mark.parametrize("kind", MACHINES)


def by_hand(robot: pk.Robot, pose: np.ndarray, i: int) -> tuple[float, np.ndarray, np.ndarray]:
    """Drive q~ of limb i, and the unit vector along it in base and in platform axes."""
    n = twin.numbers(robot.model, None)[i]
    limb = robot.model.limbs[i]
    q = twin.limb_inverse(limb, n, pose)
    anchor, _ = twin.driver(limb, n, q)
    along = pose[:3] + twin.rotation(pose) @ twin.platform_point(n) - anchor
    along = along / np.linalg.norm(along)
    return n["gain"] * q + n["offset"], along, twin.rotation(pose).T @ along


def only(kept: Feasibility, limit: str, limb: int) -> bool:
    """Whether of all limits of all limbs this one alone is broken."""
    expected = {name: np.ones(kept.reach.shape, dtype=bool) for name in LIMITS}
    expected[limit][..., limb] = False
    return all(np.array_equal(getattr(kept, name), expected[name]) for name in LIMITS)


def machine(kind: str, i: int, **change: Any) -> pk.Robot:
    """The machine whose limb i has something more."""
    make, _ = MACHINES[kind]
    return make(*[{}] * i, change)


@each_kind
def test_a_machine_without_limits_keeps_them_where_it_reaches(kind: str) -> None:
    make, pose = MACHINES[kind]
    robot = make()
    kept = robot.feasible(pose)
    assert kept.ok and kept.ok.shape == () and kept.broken() == []
    for i in range(len(robot.model.limbs)):
        assert kept.drive[i] == pytest.approx(by_hand(robot, np.array(pose), i)[0], abs=1e-10)


@each_limb
@pytest.mark.parametrize("end", [0, 1], ids=["low", "high"])
def test_a_stroke_is_broken_by_the_limb_that_has_it(kind: str, i: int, end: int) -> None:
    pose = np.array(MACHINES[kind][1])
    drive = by_hand(machine(kind, i), pose, i)[0]
    for beyond, breaks in ((1e-6, True), (-1e-6, False)):
        low, high = (drive + beyond, drive + 1.0) if end == 0 else (drive - 1.0, drive - beyond)
        robot = machine(kind, i, stroke=[low, high])
        kept = robot.feasible(pose)
        assert only(kept, "stroke", i) if breaks else kept.ok
        if breaks:
            assert kept.broken() == [f"limb {i + 1}: stroke broken in rows 0"]


@each_limb
def test_a_pose_at_the_end_of_a_stroke_keeps_it(kind: str, i: int) -> None:
    pose = np.array(MACHINES[kind][1])
    drive = float(machine(kind, i).feasible(pose).drive[i])
    for stroke in ([drive, drive + 1.0], [drive - 1.0, drive]):
        assert machine(kind, i, stroke=stroke).feasible(pose).ok


@each_limb
@pytest.mark.parametrize("cone", ["base_cone", "platform_cone"])
def test_a_cone_is_broken_by_the_limb_that_has_it(kind: str, i: int, cone: str) -> None:
    pose = np.array(MACHINES[kind][1])
    _, on_base, on_platform = by_hand(machine(kind, i), pose, i)
    along = on_base if cone == "base_cone" else on_platform
    across = np.cross(along, [0.6, 0.0, 0.8])
    across /= np.linalg.norm(across)
    for angle in (1e-3, 0.4, 1.2, 2.5):  # the axis is so far from the limb
        axis = np.cos(angle) * along + np.sin(angle) * across
        robot = machine(kind, i, **{cone: {"axis": 3.0 * axis, "angle": angle - 1e-8}})
        assert only(robot.feasible(pose), cone, i)
        assert machine(kind, i, **{cone: {"axis": axis, "angle": angle + 1e-8}}).feasible(pose).ok


def test_a_base_cone_is_seen_in_base_axes_and_a_platform_cone_in_the_platforms() -> None:
    """The same direction for both: a platform that turns leaves one cone and not the other."""
    pose = robots.hexapod().home
    _, on_base, on_platform = by_hand(robots.hexapod(), pose, 0)
    assert np.allclose(on_base, on_platform)
    cone = {"axis": on_base, "angle": 0.25}
    pose[3] = 0.3
    assert robots.hexapod({"base_cone": cone}).feasible(pose).ok
    assert only(robots.hexapod({"platform_cone": cone}).feasible(pose), "platform_cone", 0)


@pytest.mark.parametrize(
    ("kind", "change"), [("slider", {"rod": 90.0}), ("crank", {"rod": 200.0, "crank": 100.0})]
)
def test_a_rod_that_is_too_short_does_not_reach(kind: str, change: dict[str, float]) -> None:
    pose = np.array(MACHINES[kind][1])
    for i in range(3):
        robot = machine(
            kind, i, **change, stroke=[-1e4, 1e4], base_cone=wide(), platform_cone=wide()
        )
        kept = robot.feasible(pose)
        assert not kept.ok and kept.reach.tolist() == [limb != i for limb in range(3)]
        assert np.isnan(kept.drive).tolist() == [limb == i for limb in range(3)]
        assert np.isnan(robot.inverse(pose)).all()
        others = [limb for limb in range(3) if limb != i]
        assert kept.stroke[others].all() and kept.base_cone[others].all()
        assert kept.broken()[0] == f"limb {i + 1}: reach broken in rows 0"


def wide() -> dict[str, Any]:
    return {"axis": [0.0, 0.0, 1.0], "angle": 3.1}


def test_a_stroke_counts_the_drive_and_not_the_command() -> None:
    """q~ = gain q + offset is limited, whatever the actuator's own zero and scale."""
    pose = np.array(MACHINES["length"][1])
    drive = by_hand(robots.hexapod(), pose, 2)[0]
    for stroke, ok in (([drive - 1.0, drive + 1.0], True), ([drive + 0.5, drive + 1.0], False)):
        robot = machine("length", 2, offset=300.0, gain=-0.5, stroke=stroke)
        kept = robot.feasible(pose)
        assert robot.inverse(pose)[2] == pytest.approx((drive - 300.0) / -0.5)
        assert kept.drive[2] == pytest.approx(drive) and bool(kept.ok) is ok


def test_limits_do_not_matter_to_inverse_and_forward() -> None:
    pose = np.array(MACHINES["length"][1])
    tight = machine("length", 1, stroke=[1.0, 2.0], base_cone={"axis": [1, 0, 0], "angle": 0.01})
    assert not tight.feasible(pose).ok
    assert np.array_equal(tight.inverse(pose), robots.hexapod().inverse(pose))
    assert tight.forward(tight.inverse(pose)).ok


def test_a_batch_is_judged_row_by_row_in_its_shape() -> None:
    robot = robots.hexapod({"stroke": [700.0, 860.0]}, {}, {"stroke": [10.0, 870.0]})
    at = np.tile(robot.home, (2, 3, 1))
    at[0, 1, 2], at[1, 2, 2], at[1, 0, 2] = 850.0, 900.0, 5e3
    at[0, 2, 0] = np.nan
    kept = robot.feasible(at)
    lengths = np.array([[by_hand(robot, p, i)[0] for i in range(6)] for p in at.reshape(-1, 6)])
    np.testing.assert_allclose(kept.drive.reshape(6, 6), lengths, rtol=1e-14)
    expected = np.ones((6, 6), dtype=bool)
    expected[:, 0] = (lengths[:, 0] >= 700.0) & (lengths[:, 0] <= 860.0)
    expected[:, 2] = (lengths[:, 2] >= 10.0) & (lengths[:, 2] <= 870.0)
    assert np.array_equal(kept.stroke.reshape(6, 6), expected)
    assert kept.ok.shape == (2, 3) and np.array_equal(kept.ok.ravel(), expected.all(axis=1))
    assert 0 < kept.ok.sum() < 6
    assert not kept.reach[0, 2].any() and kept.reach[1].all()
    assert str(kept).splitlines()[0] == f"{int(kept.ok.sum())} of 6 poses keep all limits"


def test_rows_that_break_a_limit_are_listed_up_to_five() -> None:
    robot = robots.hexapod({}, {"stroke": [1.0, 2.0]})
    assert robot.feasible(np.tile(robot.home, (7, 1))).broken() == [
        "limb 2: stroke broken in rows 0, 1, 2, 3, 4, …"
    ]


def test_the_2tpr2tps_breaks_the_papers_strokes_and_cones() -> None:
    """Legs of 300 to 520 mm, and universal joints that swing by 60 degrees."""
    robot = pk.load("2tpr2tps")
    high, low = robot.feasible([0, 0, 530, 0, 0, 0]), robot.feasible([0, 0, 230, 0, 0, 0])
    assert (high.stroke == [False, False, False, False]).all() and high.base_cone.all()
    reach = np.hypot(154.2, 152.35)  # of legs 1 and 2, sideways
    assert low.drive[0] == pytest.approx(np.hypot(reach, 230.0))
    assert low.stroke.tolist() == [True, True, False, False] and low.base_cone.all()
    flat = robot.feasible([0, 0, 0.99 * reach / np.tan(np.radians(60)), 0, 0, 0])
    assert flat.base_cone.tolist() == [False, False, True, True]
    flat = robot.feasible([0, 0, 1.01 * reach / np.tan(np.radians(60)), 0, 0, 0])
    assert flat.base_cone.all()


@pytest.mark.parametrize("name", WORKSPACE)
def test_drives_are_those_of_the_inverse(name: str) -> None:
    robot, at = pk.load(name), poses(name, 20, seed=50)
    q, drive = robot.inverse(at), robot.feasible(at).drive
    actuators = [limb.actuator for limb in robot.model.limbs]
    np.testing.assert_allclose(drive, q[:, actuators], rtol=0, atol=1e-9)
