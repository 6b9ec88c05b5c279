"""Numbers of a robot file against what the file states beside them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.checks.finding import Finding, named
from pkmcal.checks.joint_layout import joints
from pkmcal.geometry.limb_kinds import KINDS
from pkmcal.kinematics.robot import Robot

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
    """What the geometry has for a stated name, and its unit: one number, or one a limb."""
    geometry = robot.geometry
    if name in geometry:
        return np.array([geometry[name]]), geometry.units[geometry.names.index(name)]
    for side in joints(robot):
        if name == f"{side.side}_radius":
            return side.radii, "mm"
        if name == f"{side.side}_diameter":
            return 2 * side.radii, "mm"
    if name == "length":
        mine = [KINDS[limb.kind].driver == "length" for limb in robot.model.limbs]
        return robot.feasible(robot.home).drive[mine], "mm"
    limbs = range(1, len(robot.model.limbs) + 1)
    own = [name.replace(".", f"{i}.") if "." in name else f"{name}{i}" for i in limbs]
    return np.array([geometry[each] for each in own if each in geometry]), "mm"
