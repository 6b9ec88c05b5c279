"""What check says of strokes and axes of chains, of homes beside singularities, and of tackles."""

from __future__ import annotations

import numpy as np
import pytest

import pkmcal as pk
from tests.checks.test_chains import planar, turn
from tests.robots import made


def five_bar(stroke: list[float]) -> pk.Robot:
    return planar(
        [turn(-100, 0, 1, stroke=stroke), turn(-208, 144), turn(0, 300)],
        [turn(100, 0, 2), turn(208, 144)],
    )


@pytest.mark.parametrize(("ends", "doubted"), [(60.0, True), (-13.0, True), (1.0, False)])
def test_strokes_of_turning_joints_beyond_two_turns_are_degrees(ends: float, doubted: bool) -> None:
    found = pk.check_geometry(five_bar(sorted([-ends / 2, ends])))
    said = [each for each in found.findings if each.kind == "angle"]
    assert bool(said) == doubted
    if said:
        assert said[0].limbs == (1,) and f"is {abs(ends):.6g} in degrees?" in said[0].suggestion


def legs(tilt: float) -> pk.Robot:
    """A hexapod of chains whose first U has its second axis `tilt` rad off the leg."""
    hexapod = pk.load("hexapod")
    slots, tables = hexapod.geometry.slots, []
    for i in range(6):
        base, platform = slots[i, :3], slots[i, 3:6] + hexapod.home[:3]
        rod = (platform - base) / np.linalg.norm(platform - base)
        first = np.cross(rod, [1.0, 0.0, 0.0])
        first /= np.linalg.norm(first)
        across = np.cross(rod, first)
        second = np.cos(tilt) * rod + np.sin(tilt) * across if i == 0 else across
        tables.append({
            "kind": "chain",
            "joints": [
                {"kind": "U", "at": base.tolist(), "axes": [first.tolist(), second.tolist()]},
                {"kind": "P", "axis": rod.tolist(), "at": base.tolist(), "actuator": i + 1},
                {"kind": "S", "at": platform.tolist()},
            ],
        })  # fmt: skip
    home = dict(zip(("x", "y", "z"), hexapod.home[:3].tolist(), strict=True))
    return made("spatial", home, tables)


def test_an_axis_of_a_u_along_its_rod_is_named() -> None:
    assert pk.check_geometry(legs(np.pi / 2)).ok
    found = pk.check_geometry(legs(1e-3))
    (said,) = (each for each in found.findings if each.kind == "axis")
    assert said.limbs == (1,) and "second axis of the U limb1.joint1" in said.what


@pytest.mark.parametrize(("which", "axis"), [(0, "first"), (1, "second")])
def test_an_axis_exactly_along_the_rod_is_named_where_the_machine_is_refused(
    which: int, axis: str
) -> None:
    """A U at the platform's end, of limb 3 of a tripod; the S at the base lets the rod turn."""
    tables = []
    for i, angle in enumerate(np.radians([10, 130, 250])):
        way = np.array([np.cos(angle), np.sin(angle), 0.0])
        base, platform = 400.0 * way, 150.0 * way + [0.0, 0.0, 600.0]
        rod = (platform - base) / np.linalg.norm(platform - base)
        side = np.array([-way[1], way[0], 0.0])
        axes = [np.cross(side, rod), side]
        if i == 2:
            axes[which] = rod
        tables.append({
            "kind": "chain",
            "joints": [
                {"kind": "S", "at": base.tolist()},
                {"kind": "P", "axis": rod.tolist(), "at": base.tolist(), "actuator": i + 1},
                {"kind": "U", "at": platform.tolist(), "axes": [each.tolist() for each in axes]},
            ],
        })  # fmt: skip
    with pytest.raises(ValueError, match=rf"limb 3 can move .*: the {axis} axis of the U limb3.j"):
        made("spatial", {"z": 600.0}, tables)


def similar(share: float) -> pk.Robot:
    """A planar machine of four legs whose platform is its base made smaller, but for a share."""
    base = np.array([(-500.0, -400), (520, -380), (480, 420), (-510, 390)])
    platform = 0.17 * base + share * np.array([(60, -40), (-50, 70), (40, 60), (-70, -30)])
    home = np.array([10.0, 20.0])
    legs = [
        [turn(*foot), {"kind": "P", "actuator": k + 1}, turn(*(home + end))]
        for k, (foot, end) in enumerate(zip(base.tolist(), platform, strict=True))
    ]
    tables = [{"kind": "chain", "joints": leg} for leg in legs]
    return made("planar", {"x": 10.0, "y": 20.0}, tables)


def test_a_home_beside_a_singularity_is_named() -> None:
    """Legs that meet nearly in one point cannot hold the platform from turning about it."""
    (said,) = pk.check_geometry(similar(0.1)).findings
    assert said.kind == "singular" and "home is beside a singularity" in said.what
    assert pk.check_geometry(similar(2.0)).ok


def tackles(over: list[list[float]], parts: list[list[int]]) -> pk.Robot:
    """Winches whose cables all begin at one anchor."""
    limbs = [
        {"kind": "tackle", "base": [0.0, 0.0, 0.0], "over": [point], "parts": each,
         "platform": [0.0, 0.0, 0.0]}
        for point, each in zip(over, parts, strict=True)
    ]  # fmt: skip
    return made("xy", {"x": 1900.0, "y": 1300.0}, limbs)


def test_winches_that_share_an_anchor_are_no_copies() -> None:
    far, up = [4000.0, 0.0, 0.0], [0.0, 3000.0, 0.0]
    assert "double" not in pk.check_geometry(tackles([far, up], [[1, 1], [1, 1]])).kinds
    assert "double" in pk.check_geometry(tackles([up, up], [[1, 1], [1, 1]])).kinds


def test_a_limb_that_only_another_one_determines_is_named_with_its_own_line() -> None:
    """A hinge of two limbs: the second leaves its elbow to move, though the first holds the hinge.

    It is limb 2 of 3, not the last, and there is no S in the plane that could be a U.
    """
    shared = turn(-208, 144, share="elbow")
    parallel = {"kind": "P", "axis": [1, 0, 0]}
    with pytest.raises(ValueError, match=r"limb 2 can move") as caught:
        planar(
            [turn(-100, 0, 1), shared, turn(0, 300)],
            [{**parallel, "at": [100.0, 0.0]}, {**parallel, "at": [100.0, 300.0]}, shared],
            [turn(100, 0, 2), turn(208, 144)],
        )
    assert "[[limb]] 2" in str(caught.value) and "a U" not in str(caught.value)
    assert "determined by itself" in str(caught.value)
