"""Mistakes that show in what a machine can do: units, strokes and singularities."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.checks.finding import Finding, named
from pkmcal.checks.joint_layout import ALIKE, joints, size
from pkmcal.core.library import COORDINATE_UNITS, POSE, SLOTS
from pkmcal.display import displayed
from pkmcal.geometry.box import in_box
from pkmcal.geometry.limb_kinds import KINDS
from pkmcal.kinematics.complete import completed
from pkmcal.kinematics.dexterity import dexterity
from pkmcal.kinematics.limits import kept, margin_of
from pkmcal.kinematics.robot import Robot

_FULL_TURN = 2 * np.pi
_STEEP = 0.5  # rad: no axis is tilted so far from its reference by error
_APART = 60.0  # times: two lengths of one machine do not differ by more
_SMALLEST, _LARGEST = 0.01, 1e6  # mm: any machine is larger, or smaller
USUAL = (10.0, 1e5)  # mm: most are; micromachines and machines of cables are not
_FACTORS = ((1e3, "metres"), (25.4, "inches"), (1e-3, "micrometres"))
_NOISE, _SAME = 0.005, 1e-4  # of the largest length: errors of joints that are meant to be at 0
_STEPS = 40  # of a move to the end of a stroke
_POSES, _NEAR_HOME, _SPREAD = (
    200,
    60,
    0.2,
)  # drawn around home to look for a pose that is not singular
_SINGULAR = 1e-7  # conditioning: numerically none
_BESIDE, _FALL = 0.05, 0.5  # of the length, to which part conditioning must not fall so near home
_NEARLY = 1e-3
_AFFINE = 0.01  # of the base's size, by which joints may miss an affine image
_LENGTHS = {
    "base joints": ("base.x", "base.y", "base.z"),
    "platform joints": ("platform.x", "platform.y", "platform.z"),
    "rods": ("rod",),
    "cranks": ("crank",),
}


def wrong_unit(robot: Robot) -> Iterator[Finding]:
    """Angles beyond a full turn, and lengths out of all proportion to the others."""
    geometry = robot.geometry
    numbers = zip(geometry.names, geometry.values, geometry.units, strict=True)
    home = zip(
        [f"home {name}" for name in POSE], robot.own_home, COORDINATE_UNITS.values(), strict=True
    )
    for name, value, unit in (*numbers, *home):
        most = _STEEP if ".tilt" in name else _FULL_TURN
        if unit == "rad" and abs(value) > most:
            yield Finding(
                "angle",
                (),
                f"{name} is {value:.6g} rad, {np.degrees(value):.6g} deg",
                f"is {value:.6g} in degrees? See angle under [units]",
            )
    yield from _stroke_units(robot)
    sizes = _sizes(robot)
    if not sizes:  # all joints in one point, which `doubled` says
        return
    yield from whole_size(max(sizes.values()), (_SMALLEST, _LARGEST))
    middle = float(np.exp(np.median(np.log(list(sizes.values())))))
    found = False
    for name, value in sizes.items():
        ratio = value / middle
        if len(sizes) > 2 and not 1 / _APART <= ratio <= _APART:
            found = True
            yield Finding(
                "unit",
                (),
                f"{name}: {value:.4g} mm, where lengths of the machine are about {middle:.4g} mm",
                f"is it in {'metres' if ratio < 1 else 'micrometres'}?",
            )
    if not found:
        yield from _mended(robot)


def unusual_size(robot: Robot) -> str:
    """A remark on a machine whose size is rare, for the unit may be another; else empty."""
    largest = max(_sizes(robot).values(), default=USUAL[0])
    if USUAL[0] <= largest <= USUAL[1]:
        return ""
    likely = "metres" if largest < USUAL[0] else "micrometres"
    return (
        f"its largest length is {largest:.4g} mm, as few machines have: see length under [units] if"
        f" that is in {likely}"
    )


def whole_size(largest: float, within: tuple[float, float]) -> Iterator[Finding]:
    """A machine whose largest length, mm, is that of none; an arm whose axes meet has no length."""
    if largest and not within[0] <= largest <= within[1]:
        likely = "metres" if largest < within[0] else "micrometres"
        yield Finding(
            "unit",
            (),
            f"the largest length of the machine is {largest:.4g} mm",
            f"are the lengths in {likely}? See length under [units]",
        )


def _stroke_units(robot: Robot) -> Iterator[Finding]:
    for i, limb in enumerate(robot.model.limbs):
        low, high = limb.stroke or (0.0, 0.0)
        if KINDS[limb.kind].driver.turns and max(-low, high) > 2 * _FULL_TURN:
            yield Finding(
                "angle",
                (i + 1,),
                f"the stroke of limb {i + 1} runs to {np.degrees(high):.6g} deg",
                f"is {high:.6g} in degrees? See angle under [units]",
            )


def _sizes(robot: Robot) -> dict[str, float]:
    """The lengths of a machine that say how large it is, mm; those that are 0 are left out."""
    base, platform = joints(robot)
    slots = robot.geometry.slots
    cranks = [KINDS[limb.kind].driver.turns for limb in robot.model.limbs]
    ends = [
        max(map(abs, limb.stroke))
        for limb in robot.model.limbs
        if limb.stroke is not None and not KINDS[limb.kind].driver.turns
    ]
    sizes = {
        "base joints": float(np.linalg.norm(base.points, axis=1).max()),
        "platform joints": float(np.linalg.norm(platform.points, axis=1).max()),
        "home": float(np.linalg.norm(robot.own_home[:3])),
        "rods": float(slots[:, SLOTS.index("rod")].max()),
        "cranks": float(slots[cranks, SLOTS.index("crank")].max(initial=0.0)),
        "strokes": max(ends, default=0.0),
    }
    least = _NOISE * max(sizes.values())
    meant = {"base joints": _alike(base.points), "platform joints": _alike(platform.points)}
    return {
        name: value
        for name, value in sizes.items()
        if value > 1e-9 and (value > least or meant.get(name, True))
    }


def _alike(points: FloatArray) -> bool:
    """Return whether some joints are equally far from the origin, as in tables and not by error."""
    far = np.sort(np.linalg.norm(points, axis=1))
    return bool((np.diff(far) <= _SAME * far[1:]).any())


def _mended(robot: Robot) -> Iterator[Finding]:
    """Lengths of one kind in another unit, with which home would keep its limits as it does not."""
    if robot.feasible(robot.home).ok:
        return
    mended = []
    for name in _sizes(robot):
        for factor, unit in _FACTORS:
            slots, home, stroke = robot.slots.copy(), robot.own_home[None].copy(), 1.0
            if name in _LENGTHS:
                columns = [SLOTS.index(slot) for slot in _LENGTHS[name]]
                slots[:, columns] *= factor
            elif name == "home":
                home[:, :3] *= factor
            else:
                stroke = factor
            drive = robot.limb_machine.limbs(slots, home)[0][0]
            if _in_strokes(robot, drive, stroke):
                mended.append(f"the {name} in {unit}" if name != "home" else f"home in {unit}")
    if mended:
        broken = "; ".join(robot.feasible(robot.home).broken())
        yield Finding(
            "unit",
            (),
            f"home breaks limits ({broken}), and would keep them with {' or '.join(mended)}",
            "check the unit of these numbers",
        )


def _in_strokes(robot: Robot, drive: FloatArray, factor: float) -> bool:
    stated = False
    for value, limb in zip(drive, robot.model.limbs, strict=True):
        if limb.stroke is not None:
            stated = True
            low, high = limb.stroke
            margin = margin_of((factor * low, factor * high), value)
            if not kept(margin, KINDS[limb.kind].actuator_unit, robot.machine.struct.size):
                return False
    return bool(np.isfinite(drive).all()) and (stated or factor == 1.0)


def not_closed(robot: Robot) -> Iterator[Finding]:
    """Limbs whose constraints do not allow home: a normal or an axis that is another limb's."""
    own, _ = robot.own_rows(robot.home)
    actuators = robot.machine.inverse(robot.slots, own)
    missed = np.abs(robot.machine.closure(robot.slots, own, actuators).residual[0])
    limbs = robot.model.limbs
    rows = [1 + len(KINDS[limb.kind].all_rows(limb.couple > 0.0)) for limb in limbs]
    worst = np.maximum.reduceat(missed, np.cumsum([0, *rows[:-1]]))
    open_limbs = np.flatnonzero(worst > ALIKE * size(robot))  # NaN is `unreachable`
    if open_limbs.size:
        yield Finding(
            "home",
            tuple(int(i) + 1 for i in open_limbs),
            f"at home {named(open_limbs)} cannot close: {worst[open_limbs].max():.4g} mm missing",
            "check the axes of the limbs, their joints and the home pose",
        )


def outside_workspace(robot: Robot) -> Iterator[Finding]:
    """Home outside the box that the file states."""
    parts = []
    for name, ends in robot.model.workspace.items():
        if not in_box({name: ends}, robot.home):
            values = (float(robot.home[POSE.index(name)]), *ends)
            pairs = (displayed(value, COORDINATE_UNITS[name]) for value in values)
            home, low, high = (f"{number:.6g} {shown}" for number, shown in pairs)
            parts.append(f"{name} is {home}, the workspace {low} to {high}")
    if parts:
        yield Finding(
            "workspace",
            (),
            f"home is outside the workspace of the file: {'; '.join(parts)}",
            "check [workspace] and the home pose; both are in the base frame",
        )


def unreachable(robot: Robot) -> Iterator[Finding]:
    """Home out of reach or out of strokes, and ends of strokes that all limbs cannot go to."""
    home = robot.feasible(robot.home)
    drive = home.drive
    if not home.reach.all():
        limbs = np.flatnonzero(~home.reach)
        yield Finding(
            "stroke",
            tuple(int(i) + 1 for i in limbs),
            f"{named(limbs)} cannot reach home: the rod is too short or too long for its joints",
            "check rod, joints and the home pose",
        )
        return
    out = np.flatnonzero(~home.stroke)
    for i in out.tolist():
        low, high = robot.model.limbs[i].stroke or (0.0, 0.0)
        factor, unit = _shown(robot, i)
        yield Finding(
            "stroke",
            (i + 1,),
            f"at home limb {i + 1} is at {drive[i] * factor:.6g} {unit}, its stroke is"
            f" {low * factor:.6g} to {high * factor:.6g} {unit}",
            "check the stroke, the zero it counts from (offset), and the home pose",
        )
    if out.size or any(limb.stroke is None for limb in robot.model.limbs):
        return
    ends = np.array([limb.stroke or (0.0, 0.0) for limb in robot.model.limbs])
    for k, name in enumerate(("lower", "upper")):
        part = _reached(robot, ends[:, k])
        if part < 1.0:
            yield Finding(
                "stroke",
                (),
                f"all limbs together cannot go to the {name} ends of their strokes: the machine"
                f" comes {100 * part:.0f} % of the way from home",
                "part of the stroke is of no use there: check the strokes and the joints",
            )


def _shown(robot: Robot, limb: int) -> tuple[float, str]:
    crank = KINDS[robot.model.limbs[limb].kind].driver.turns
    return (180 / np.pi, "deg") if crank else (1.0, "mm")


def _reached(robot: Robot, ends: FloatArray) -> float:
    """Return the share of the way from home to the drives `ends` that can be followed."""
    start = robot.inverse(robot.home)
    goal = robot.machine.at_drives(robot.slots, ends[None])[0]
    pose = robot.home
    for k in range(1, _STEPS + 1):
        found = robot.forward(start + (goal - start) * k / _STEPS, guess=pose)
        if not found.ok:
            return (k - 1) / _STEPS
        pose = found.pose
    return 1.0


def turning(robot: Robot) -> Iterator[Finding]:
    """Drive laws without an inverse."""
    for limb, why in robot.model.doubts():
        yield Finding(
            "drive",
            (limb + 1,),
            f"the drive law of limb {limb + 1} has no inverse: {why}",
            "such numbers fit noise: free fewer, or hold them by a prior or a smoothness",
        )


def singular(robot: Robot) -> Iterator[Finding]:
    """Machines that are singular in every pose, or at home."""
    random = np.random.default_rng(0)
    scale = np.array([1.0, 1.0, 1.0, *[1.0 / robot.length] * 3]) * _SPREAD * robot.length
    free = [name in robot.moved for name in POSE]
    poses = robot.home + scale * free * random.uniform(-1, 1, (_POSES, 6))
    conditioning = dexterity(robot, completed(robot, np.vstack([robot.home, poses]))).conditioning
    seen = conditioning[np.isfinite(conditioning)]
    if not seen.size:
        return
    best, off = float(seen.max()), _affine_error(robot)
    affine = off is not None and off <= _AFFINE * size(robot)
    image = (
        f"; the platform joints are an affine image of the base joints to {off:.3g} mm"
        if affine
        else ""
    )
    if best < _SINGULAR or (affine and best < _NEARLY):
        every = "every one" if best < _SINGULAR else "near to singular in every one"
        yield Finding(
            "singular",
            (),
            f"singular in {every} of {seen.size} poses around home: conditioning {best:.1e} at"
            f" best{image}",
            "no actuator force holds such a machine: base and platform must not be similar, nor"
            " joints lie on one line"
            if affine or best < _SINGULAR
            else "check the joints",
        )
    elif conditioning[0] < _SINGULAR:
        yield Finding(
            "singular",
            (),
            f"home is singular: conditioning {conditioning[0]:.1e}, elsewhere up to {best:.3g}",
            "choose another home pose; forward() starts there",
        )
    else:
        yield from _beside(robot, poses, float(conditioning[0]))


def _beside(robot: Robot, poses: FloatArray, at_home: float) -> Iterator[Finding]:
    """A home so near to a singularity that the conditioning falls within a small step of it."""
    steps = _BESIDE / _SPREAD * (poses[:_NEAR_HOME] - robot.home)
    near = dexterity(robot, completed(robot, robot.home + steps)).conditioning
    near = near[np.isfinite(near)]
    if near.size and near.min() < _FALL * at_home:
        yield Finding(
            "singular",
            (),
            f"home is beside a singularity: conditioning {at_home:.3g}, and {near.min():.2g} within"
            f" {_BESIDE * robot.length:.3g} mm and {np.degrees(_BESIDE):.3g} deg of it",
            "choose a home further from it, or joints that are less alike on base and platform;"
            " near it rows end in other assembly modes and calibrations in other minima",
        )


def _affine_error(robot: Robot) -> float | None:
    """Return how far platform joints of a hexapod are from an affine image of its base joints."""
    if robot.model.map != "spatial" or len(robot.model.limbs) < 6 or robot.model.chains:
        return None
    base, platform = (side.points for side in joints(robot))
    system = np.column_stack([base, np.ones(len(base))])
    fitted = system @ np.linalg.lstsq(system, platform, rcond=None)[0]
    return float(np.abs(platform - fitted).max())
