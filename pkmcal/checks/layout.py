"""Mistakes that show in where joints lie, in what limbs share, and against what the file states."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.checks.finding import Finding, named
from pkmcal.checks.joint_layout import (
    ALIKE,
    Joints,
    along_axis,
    joints,
    on_rails,
    size,
    slider_ways,
    traits,
)
from pkmcal.geometry.limb_kinds import KINDS
from pkmcal.kinematics.pulled import on_cables
from pkmcal.kinematics.robot import Robot

_SAME = 1e-9  # relative: the same number written twice
_WIDER = 1.05  # a platform so much wider than its base was meant to be the base
_FULL_TURN = 360.0
_CLOSE = 2e-3  # relative: within this a number is what is stated
_RATIOS = (
    (2.0, "the stated number is half of it: a radius, where a diameter is named?"),
    (0.5, "the stated number is twice it: a diameter, where a radius is named?"),
    (1e3, "the stated number is a thousandth of it: metres?"),
    (1e-3, "the stated number is a thousand times it: micrometres?"),
    (25.4, "the ratio is 25.4: inches?"),
    (180 / np.pi, "the ratio is 180/π: degrees and radians?"),
    (np.pi / 180, "the ratio is π/180: degrees and radians?"),
)


def angles_as_coordinates(robot: Robot) -> Iterator[Finding]:
    """Polar angles in degrees as both x and y, or as y beside a radius, or taken for radians."""
    base, platform = joints(robot)
    read: dict[str, FloatArray] = {}
    for side in (base, platform):
        x, y = side.points[:, 0], side.points[:, 1]
        within = float(np.abs(y).max()) <= _FULL_TURN and np.ptp(y) > 0
        if len(y) < 3 or not within:
            continue
        both = (np.abs(x - y) <= _SAME * np.abs(y)).all()
        beside_radius = np.ptp(x) <= _SAME * np.abs(x).max() and len(set(y.tolist())) == len(y) > 3
        if both or beside_radius:
            read[side.side] = y
    if read:
        yield _polar(robot, read)
    for side in (base, platform):
        turned = np.degrees(side.angles)
        spread = float(np.ptp(turned))
        off_axis = side.radii.min() > ALIKE * max(float(side.radii.max()), 1e-9)
        if side.side not in read and len(turned) >= 3 and off_axis and 0 < spread <= 2 * np.pi:
            again = ", ".join(f"{angle:.4g}" for angle in np.degrees(turned))
            yield Finding(
                "angle",
                tuple(range(1, len(turned) + 1)),
                f"all {side.side} joints lie within {spread:.3g} deg of each other, seen from the"
                " middle",
                f"were their angles in radians? They would be {again} deg; see angle under [units]",
            )


def _polar(robot: Robot, read: dict[str, FloatArray]) -> Finding:
    """The finding, with what the legs are once the numbers are read as polar angles."""
    shown = " and ".join(
        f"x = {side.points[0, 0]:.6g}, y = {side.points[0, 1]:.6g} … ({side.side})"
        for side in joints(robot)
        if side.side in read
    )
    what = f"joints on one line that are spread like angles: {shown}"
    advice = "read as polar angles, base = { radius = …, angle = …, z = … }"
    if len(read) == 2:
        turn = np.abs(np.mod(read["base"] - read["platform"] + 180, 360) - 180)
        what += f"; as angles base and platform are {turn.min():.6g} to {turn.max():.6g} deg apart"
        radii = _stated_radii(robot)
        if radii is not None:
            legs = _legs(robot, read, radii)
            advice += (
                f"; on circles of radius {radii[0]:.6g} and {radii[1]:.6g} mm all legs are"
                f" {legs.min():.8g} to {legs.max():.8g} mm at home"
            )
            if "length" in robot.model.stated:
                advice += f", and {robot.model.stated['length']:.6g} mm are stated"
    return Finding("angle", tuple(range(1, len(robot.model.limbs) + 1)), what, advice)


def _stated_radii(robot: Robot) -> tuple[float, float] | None:
    """Radii of both circles, from what is stated: of all readings the one that fits the legs."""
    stated = robot.model.stated
    options = []
    for side in ("base", "platform"):
        sizes = [stated[key] for key in (f"{side}_radius", f"{side}_diameter") if key in stated]
        options.append([size / part for size in sizes for part in (1.0, 2.0)])
    if not all(options):
        return None
    pairs = [(first, second) for first in options[0] for second in options[1]]
    length = stated.get("length")
    if length is None:
        return pairs[0]
    read = {side.side: side.points[:, 1] for side in joints(robot)}
    return min(pairs, key=lambda pair: abs(float(_legs(robot, read, pair).mean()) - length))


def _legs(robot: Robot, read: dict[str, FloatArray], radii: tuple[float, float]) -> FloatArray:
    """Distances between base and platform joints at home with polar angles (deg) and radii."""
    base, platform = (
        np.column_stack([
            radius * np.cos(np.radians(read[side.side])),
            radius * np.sin(np.radians(read[side.side])),
            side.points[:, 2],
        ])
        for side, radius in zip(joints(robot), radii, strict=True)
    )  # fmt: skip
    moved = platform + robot.own_home[:3]
    return np.asarray(np.linalg.norm(moved - base, axis=1))


def doubled(robot: Robot) -> Iterator[Finding]:
    """Limbs of the same joints, and joints that more than two limbs of a free platform share."""
    base, platform = joints(robot)
    room = 1e-3 * size(robot)
    count = len(robot.model.limbs)
    whole = [_points_of(robot, i) for i in range(count)]
    pairs = combinations(range(count), 2)
    ways = slider_ways(robot)
    crossing = np.linalg.norm(np.cross(ways[:, None], ways), axis=2) > ALIKE  # at a point of both
    copies = [
        (i, j)
        for i, j in pairs
        if whole[i].shape == whole[j].shape
        and float(np.linalg.norm(whole[i] - whole[j])) <= room
        and not crossing[i, j]
    ]
    for i, j in copies:
        place = ", ".join(f"{number:.6g}" for number in base.points[i])
        yield Finding(
            "double",
            (i + 1, j + 1),
            f"{named((i, j))} have the same joints; the base joint is at ({place}) mm",
            f"was limb {j + 1} copied from limb {i + 1} and not changed?",
        )
    if robot.model.map != "spatial" or on_cables(robot):
        return
    for side in (base, platform):
        near = np.linalg.norm(side.points[:, None] - side.points, axis=2) <= room
        if side.side == "base":
            near &= ~crossing
        shared = np.flatnonzero(near.sum(axis=1) > 2)
        if len(shared) and not copies:
            yield Finding(
                "double",
                tuple(int(i) + 1 for i in shared),
                f"{named(shared)} share one {side.side} joint",
                "no more than two limbs can: check these joints",
            )


def _points_of(robot: Robot, limb: int) -> FloatArray:
    """Coordinates of all points of a limb, those that a cable runs over included, and its parts."""
    base, platform = joints(robot)
    geometry, over = robot.geometry, f"over{limb + 1}."
    others = [geometry[name] for name in geometry.names if name.startswith(over)]
    parts = robot.model.limbs[limb].parts
    return np.concatenate([base.points[limb], platform.points[limb], others, parts])


def swapped(robot: Robot) -> Iterator[Finding]:
    """A platform that is wider than its base; of a planar machine if both are regular."""
    room = ALIKE * size(robot)
    sides = along_axis(robot)
    if robot.model.map == "planar" and not all(_has_circle(side, room) for side in sides):
        return  # arms reach in to platforms of any width
    base, platform = (float(np.median(side.radii)) for side in sides)
    if platform > _WIDER * base > room:
        yield Finding(
            "swapped",
            (),
            f"the platform joints are {platform:.6g} mm from the axis, those of the base"
            f" {base:.6g} mm",
            "were base and platform exchanged? Swap them if the platform is the smaller one",
        )


def opposite_order(robot: Robot) -> Iterator[Finding]:
    """Base joints counted one way round and platform joints another."""
    base, platform = along_axis(robot)
    room = ALIKE * size(robot)
    if min(base.radii.min(), platform.radii.min()) <= room:
        return
    below, above = base.senses(room), platform.senses(room)
    if below == above or below & above:
        return
    mirrored = bool(below and above)
    yield Finding(
        "order",
        (),
        f"seen from above, the base joints run {_way(below)} and the platform joints {_way(above)}",
        "one of the tables has a left-handed frame: turn the sign of its x or of its y"
        if mirrored
        else "were two joints exchanged? Joint 1 of the base and of the platform belong to limb 1",
    )


def _way(senses: frozenset[int]) -> str:
    if not senses:
        return "neither way round"
    return "counter-clockwise" if 1 in senses else "clockwise"


def off_circle(robot: Robot) -> Iterator[Finding]:
    """Joints that are off the circle of the others, each by itself: two alike are a design."""
    room = ALIKE * size(robot)
    for side, written in zip(along_axis(robot), joints(robot), strict=True):
        if side.side == "base" and on_rails(robot):
            continue
        found = side.circle(room)
        if found is None:
            continue
        centre, radius, on = found
        where = "" if not centre.any() else f" about ({centre[0]:.6g}, {centre[1]:.6g}) mm"
        distance = np.linalg.norm(side.points[:, :2] - centre, axis=1)
        alone = (np.abs(distance[:, None] - distance) <= room).sum(axis=1) == 1
        for i in np.flatnonzero(~on & alone).tolist():
            away = float(distance[i])
            yield Finding(
                "circle",
                (i + 1,),
                f"{side.side} joint {i + 1} is {abs(away - radius):.4g} mm off the circle of radius"
                f" {radius:.6g} mm{where} that {on.sum()} of {len(on)} {side.side} joints lie on",
                "check its x, y and z: ({:.6g}, {:.6g}, {:.6g}) mm".format(*written.points[i]),
            )


def unlike(robot: Robot) -> Iterator[Finding]:
    """Limbs that are unlike the others."""
    room = ALIKE * size(robot)
    circles = {f"{side.side} radius" for side in along_axis(robot) if _has_circle(side, room)}
    kinds = {KINDS[limb.kind].name for limb in robot.model.limbs}
    for trait in traits(robot):
        if trait.name in circles:  # `off_circle` reports it
            continue
        limbs, usual = trait.odd(room)
        if not limbs:
            continue
        values = ", ".join(f"{trait.values[i]:.6g}" for i in limbs)
        of_others = (
            f"{usual:.6g} {trait.unit} with the others"
            if np.isfinite(usual)
            else "unlike each other, where the others come in alike pairs"
            if len(limbs) > 1
            else "like no other, where the others come in alike groups"
        )
        same = " of the same kind" if len(kinds) == 1 else ""
        yield Finding(
            "alike",
            tuple(i + 1 for i in limbs),
            f"{trait.name}: {values} {trait.unit} in {named(limbs)}, {of_others}",
            f"limbs{same} are as a rule alike: check {named(limbs)}",
        )


def _has_circle(side: Joints, room: float) -> bool:
    return side.circle(room) is not None


def contradicted(robot: Robot) -> Iterator[Finding]:
    """Stated numbers that the geometry contradicts."""
    for name, stated in robot.model.stated.items():
        values, unit = _of_geometry(robot, name)
        off = ~(np.abs(values - stated) <= _CLOSE * abs(stated))
        if not off.any():
            continue
        factor = 180 / np.pi if unit == "rad" else 1.0
        shown = {"rad": " deg", "mm": " mm"}.get(unit, "")
        low, high = (float(end) * factor for end in (values[off].min(), values[off].max()))
        seen = f"{low:.6g}" if high - low < 1e-5 * abs(high) else f"{low:.6g} to {high:.6g}"
        which = f" in {named(np.flatnonzero(off))}" if 1 < len(values) != off.sum() else ""
        yield Finding(
            "stated",
            tuple(int(i) + 1 for i in np.flatnonzero(off)) if len(values) > 1 else (),
            f"{name} is {seen}{shown}{which}; {stated * factor:.6g}{shown} is stated",
            _reading(values[off], stated),
        )


def _reading(values: FloatArray, stated: float) -> str:
    for ratio, words in _RATIOS:
        if stated and (np.abs(values / stated - ratio) <= _CLOSE * ratio).all():
            return words
    return "the two contradict each other: measure, or ask where each number comes from"


def _of_geometry(robot: Robot, name: str) -> tuple[FloatArray, str]:
    """Return the geometry's numbers for a stated name, one or one a limb, and their unit."""
    geometry = robot.geometry
    if name in geometry:
        return np.array([geometry[name]]), geometry.units[geometry.names.index(name)]
    for side in joints(robot):
        if name == f"{side.side}_radius":
            return side.radii, "mm"
        if name == f"{side.side}_diameter":
            return 2 * side.radii, "mm"
    if name == "length":
        mine = [not KINDS[limb.kind].has_branch for limb in robot.model.limbs]
        return robot.feasible(robot.home).drive[mine], "mm"
    limbs = range(1, len(robot.model.limbs) + 1)
    own = [name.replace(".", f"{i}.") if "." in name else f"{name}{i}" for i in limbs]
    return np.array([geometry[each] for each in own if each in geometry]), "mm"
