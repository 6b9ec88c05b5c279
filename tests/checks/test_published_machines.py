"""Machines as they are published, of many layouts, have nothing to be found."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest

import pkmcal as pk

from ..mutations import VISIBLE, with_slots
from ..robots import made, ring

Z = [0.0, 0.0, 1.0]


def legs(base: Any, platform: Any, map: str = "spatial", **home: float) -> pk.Robot:
    pairs = zip(base, platform, strict=True)
    return made(map, home, [{"kind": "UPS", "base": b, "platform": p} for b, p in pairs])


def carriages(
    base: Any,
    platform: Any,
    ways: Any,
    rods: Sequence[float],
    branch: Sequence[int],
    map: str = "translation",
    **home: float,
) -> pk.Robot:
    limbs = [
        {"kind": "PUS", "base": b, "platform": p, "slider": w, "rod": rod, "branch": sign}
        for b, p, w, rod, sign in zip(base, platform, ways, rods, branch, strict=True)
    ]
    return made(map, home, limbs)


def rings(radius: float, angles: Sequence[float], z: float = 0.0) -> np.ndarray:
    return np.array([ring(radius, angle, z) for angle in angles])


def orthoglide(back: float = 0.0) -> pk.Robot:
    """Three sliders at right angles; where each counts from is a matter of its zero."""
    return carriages(-back * np.eye(3), np.zeros((3, 3)), np.eye(3), [310.0] * 3, [1] * 3, x=0.0)


def triaglide() -> pk.Robot:
    """Three rails side by side; the middle one drives from the other end."""
    base, platform = [[0, 200, 0], [0, 0, 0], [0, -200, 0]], [[0, 40, 0], [40, 0, 0], [0, -40, 0]]
    return carriages(base, platform, [[1, 0, 0]] * 3, [500.0] * 3, [1, -1, 1], z=-400.0)


def hexaglide() -> pk.Robot:
    """Six carriages on three rails side by side, two on each."""
    base = [[0, y, 0] for y in (250, -250, 250, -250, 0, 0)]
    platform = [[-80, 70, 0], [-80, -70, 0], [80, 30, 0], [80, -30, 0], [20, 90, 0], [-20, -90, 0]]
    rods, branch = [750.0] * 4 + [700.0] * 2, [1, 1, -1, -1, -1, 1]
    return carriages(base, platform, [[1, 0, 0]] * 6, rods, branch, "spatial", z=-600.0)


def linapod() -> pk.Robot:
    """Three columns with two carriages each, one above the other, and rods of two lengths."""
    base = rings(600.0, [-5, 5, 115, 125, 235, 245])
    platform = rings(120.0, [-40, 40, 80, 160, 200, 280])
    return carriages(base, platform, [Z] * 6, [900.0] * 6, [1] * 6, "spatial", z=-500.0)


def star() -> pk.Robot:
    """A delta whose carriages run outward, level (a star) or down at 45 degrees (Keops)."""
    ways = rings(1.0, [0, 120, 240])
    return carriages(0 * ways, 60 * ways, ways, [500.0] * 3, [1] * 3, z=-350.0)


def inclined() -> pk.Robot:
    ways = rings(np.sqrt(0.5), [0, 120, 240], -np.sqrt(0.5))
    base, platform = rings(100.0, [0, 120, 240]), rings(50.0, [0, 120, 240])
    return carriages(base, platform, ways, [400.0] * 3, [1] * 3, z=-500.0)


def three_upu() -> pk.Robot:
    """Tsai's, which keeps its orientation."""
    angles = [0, 120, 240]
    return legs(rings(300.0, angles), rings(150.0, angles), "translation", z=600.0)


def six_six() -> pk.Robot:
    base, platform = [20, 100, 140, 220, 260, 340], [42, 78, 162, 198, 282, 318]
    return legs(rings(500.0, base), rings(250.0, platform, -20.0), z=700.0)


def six_three() -> pk.Robot:
    platform = rings(500.0, [60, 60, 180, 180, 300, 300])
    return legs(rings(1000.0, [10, 110, 130, 230, 250, 350]), platform, z=1000.0)


def octahedral() -> pk.Robot:
    base = rings(1000.0, [0, 120, 120, 240, 240, 0])
    return legs(base, rings(500.0, [60, 60, 180, 180, 300, 300]), z=800.0)


def two_heights() -> pk.Robot:
    """Six columns, every other joint higher up."""
    angles, up = [30, 90, 150, 210, 270, 330], np.outer([0, 1, 0, 1, 0, 1], Z)
    return legs(
        rings(1500.0, angles) + 800 * up, rings(300.0, angles) + 200 * up, z=-1500.0, gamma=0.5
    )


def on_a_wall() -> pk.Robot:
    """A hexapod whose frame has x, not z, across its base."""
    turn = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])
    plain = six_six()
    slots = plain.geometry.slots
    return legs(slots[:, :3] @ turn.T, slots[:, 3:6] @ turn.T, x=700.0)


def innocenti() -> pk.Robot:
    """A planar 3-RPR with six assembly modes: its platform is the wider."""
    platform = [[0, 0, 0], [17.04, 0, 0], [20.84 * np.cos(0.8822), 20.84 * np.sin(0.8822), 0]]
    base = [[0, 0, 0], [15.91, 0, 0], [0, 10, 0]]
    return legs(base, platform, "planar", x=2.0, y=8.0, gamma=0.9)


def three_rps(size: float) -> pk.Robot:
    """Lee and Shah's, of any size: one of 0.16 mm was etched."""
    limbs = [
        {"kind": "RPS", "base": ring(0.4 * size, a), "platform": ring(0.25 * size, a)}
        | {"normal": ring(1.0, a + 90)}
        for a in (0, 120, 240)
    ]
    return made("spatial", {"z": 1.6 * size}, limbs, match=["z", "alpha", "beta"])


def cranks(base: Any, platform: Any, axes: Any, map: str, z: float) -> pk.Robot:
    limbs = [
        {"kind": "RUS", "base": b, "platform": p, "axis": a, "zero": np.cross(Z, a)}
        | {"crank": 200.0, "rod": 500.0, "branch": 1}
        for b, p, a in zip(base, platform, -np.asarray(axes), strict=True)
    ]
    return made(map, {"z": z}, limbs)


def hexa() -> pk.Robot:
    """Pierrot's: a delta with six cranks that turns as well."""
    base, turned = [-10, 10, 110, 130, 230, 250], [90, 90, 210, 210, 330, 330]
    platform = rings(60.0, [-30, 30, 90, 150, 210, 270])
    return cranks(rings(180.0, base), platform, rings(1.0, turned), "spatial", -450.0)


def delta() -> pk.Robot:
    angles = np.array([0, 120, 240])
    return cranks(rings(160.0, angles), rings(40.0, angles), rings(1.0, angles + 90), "translation",
                  -450.0)  # fmt: skip


PUBLISHED: dict[str, Callable[[], pk.Robot]] = {
    "orthoglide": orthoglide,
    "orthoglide counted from outside": lambda: orthoglide(310.0),
    "triaglide": triaglide,
    "hexaglide": hexaglide,
    "linapod": linapod,
    "star": star,
    "inclined delta": inclined,
    "3-UPU": three_upu,
    "6-6": six_six,
    "6-3": six_three,
    "3-3": octahedral,
    "two heights": two_heights,
    "on a wall": on_a_wall,
    "3-RPR of Innocenti": innocenti,
    "3-RPS of 0.16 mm": lambda: three_rps(0.1),
    "3-RPS of 1.6 m": lambda: three_rps(1e3),
    "3-RPS of 16 m": lambda: three_rps(1e4),
    "hexa": hexa,
    "delta": delta,
}


@pytest.mark.parametrize("name", PUBLISHED)
def test_nothing_is_found_in_published_machines(name: str) -> None:
    robot = PUBLISHED[name]()
    assert np.isfinite(robot.inverse(robot.home)).all()
    check = pk.check_geometry(robot)
    assert check.ok, str(check)


@pytest.mark.parametrize("name", PUBLISHED)
def test_nor_when_they_are_manufactured(name: str) -> None:
    """Every joint off by a two-thousandth of the machine."""
    robot, rng = PUBLISHED[name](), np.random.default_rng(1)
    slots = robot.geometry.slots
    reach = max(np.abs(slots[:, :6]).max(), robot.length)
    mm = np.array([unit == "mm" for unit in robot.geometry.units])
    for _ in range(3):
        errors = mm * rng.normal(0.0, 5e-4 * reach, len(mm))
        check = pk.check_geometry(robot.replace(robot.geometry.values + errors))
        assert check.ok, str(check)


# Where limbs are alike around an axis, one joint elsewhere is found.
ALIKE = ("linapod", "inclined delta", "3-UPU", "6-6", "6-3", "3-3", "two heights", "on a wall",
         "orthoglide counted from outside", "3-RPS of 1.6 m", "hexa", "delta")  # fmt: skip


@pytest.mark.parametrize("name", ALIKE)
def test_one_joint_elsewhere_is_found(name: str) -> None:
    robot = PUBLISHED[name]()
    base = robot.geometry.slots[:, :3]
    size = float(np.linalg.norm(base - base.mean(axis=0), axis=1).max())
    assert 3 * VISIBLE < 0.2
    for limb in range(len(base)):
        for axis in range(3):
            if name.startswith("orthoglide") and axis == limb:
                continue  # along the slider it is only where the slider counts from
            slots = robot.geometry.slots.copy()
            slots[limb, axis] += 0.2 * size
            assert not pk.check_geometry(with_slots(robot, slots)).ok, (limb, axis)


def test_a_copied_limb_is_found_among_crossing_sliders() -> None:
    slots = orthoglide(310.0).geometry.slots
    wrong = carriages(slots[[0, 0, 2], :3], slots[:, 3:6], np.eye(3)[[0, 0, 2]], [310.0] * 3,
                      [1] * 3, x=0.0)  # fmt: skip
    assert "double" in pk.check_geometry(wrong).kinds


def test_a_rare_size_is_remarked_on_where_nothing_is_found() -> None:
    small, plain = pk.check_geometry(three_rps(0.1)), pk.check_geometry(three_rps(1e3))
    assert small.ok and "largest length is 0.16 mm" in str(small) and "metres" in str(small)
    assert str(plain).endswith("no problems found")
    assert pk.check_geometry(three_rps(1e-3)).kinds == ("unit",)


# --- serial arms ---------------------------------------------------------------------------------

PUMA = {"a": [0, 431.8, 20.3, 0, 0, 0], "d": [0, 0, 150.05, 431.8, 0, 0], "theta": 0.0}


@pytest.mark.parametrize(
    ("convention", "twists"),
    [("standard", [90.0, 0, -90, 90, -90, 0]), ("modified", [0.0, -90, 0, 90, -90, 90])],
)
def test_twists_typed_in_degrees_are_found(convention: Any, twists: list[float]) -> None:
    good = pk.SerialArm.from_dh(**PUMA, alpha=np.radians(twists), convention=convention)
    assert pk.check_geometry(good).ok
    wrong = pk.SerialArm.from_dh(**PUMA, alpha=twists, convention=convention)
    check = pk.check_geometry(wrong)
    assert check.kinds == ("angle",) and len(check.findings) == 4
    assert "was 90 deg meant?" in check.findings[0].suggestion


@pytest.mark.parametrize("degrees", [15.0, 30, 45, 60, 90, 120, 135, 180])
def test_any_round_twist_in_degrees_is_found_and_in_radians_is_not(degrees: float) -> None:
    for twist, ok in ((degrees, False), (np.radians(degrees), True)):
        arm = pk.SerialArm.from_dh(a=[300, 200], alpha=[twist, 0], d=[0, 50])
        assert pk.check_geometry(arm).ok == ok
