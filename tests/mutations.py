"""Good machines with one mistake put in, as tables of geometry have them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

import pkmcal as pk
from pkmcal.checks.joint_layout import ALIKE, size
from pkmcal.core.library import SLOTS
from pkmcal.geometry.limb_kinds import KINDS

Mutation = Callable[[pk.Robot, np.random.Generator], pk.Robot | None]
BASE, PLATFORM = slice(0, 3), slice(3, 6)
VISIBLE = 2 * ALIKE  # of the base's size: smaller slips are not asked for


def with_slots(robot: pk.Robot, slots: np.ndarray) -> pk.Robot:
    """The robot with other numbers, limb by limb in the order of SLOTS."""
    changes = {
        number.name: float(slots[number.limb, SLOTS.index(number.slot)])
        for number in robot.geometry.numbers
    }
    return robot.replace(changes)


def with_model(robot: pk.Robot, **changes: object) -> pk.Robot:
    return pk.Robot(replace(robot.model, **changes))


def _joint(robot: pk.Robot, rng: np.random.Generator) -> tuple[np.ndarray, int, slice]:
    side = BASE if robot.model.map == "translation" or rng.random() < 0.5 else PLATFORM
    return robot.geometry.slots.copy(), int(rng.integers(len(robot.model.limbs))), side


def sign(robot: pk.Robot, rng: np.random.Generator) -> pk.Robot | None:
    """The sign of x or y of one joint turned."""
    slots, limb, side = _joint(robot, rng)
    k = int(rng.integers(2))
    if abs(slots[limb, side][k]) < VISIBLE * size(robot):
        return None
    slots[limb, side.start + k] *= -1
    return with_slots(robot, slots)


def digits(robot: pk.Robot, rng: np.random.Generator) -> pk.Robot | None:
    """Two neighbouring digits of a coordinate exchanged."""
    for _ in range(20):
        slots, limb, side = _joint(robot, rng)
        k = side.start + int(rng.integers(2))
        text = list(f"{slots[limb, k]:.4f}")
        i = int(rng.integers(len(text) - 1))
        text[i], text[i + 1] = text[i + 1], text[i]
        if text[i].isdigit() and text[i + 1].isdigit():
            wrong = float("".join(text))
            if abs(wrong - slots[limb, k]) >= VISIBLE * size(robot):
                slots[limb, k] = wrong
                return with_slots(robot, slots)
    return None


def moved(robot: pk.Robot, rng: np.random.Generator) -> pk.Robot:
    """One joint off by a tenth of the machine's size."""
    slots, limb, side = _joint(robot, rng)
    way = rng.normal(size=2)
    slots[limb, side.start : side.start + 2] += 0.1 * size(robot) * way / np.linalg.norm(way)
    return with_slots(robot, slots)


def height(robot: pk.Robot, rng: np.random.Generator) -> pk.Robot:
    """One joint at another height by a tenth of the machine's size."""
    slots, limb, side = _joint(robot, rng)
    slots[limb, side.start + 2] += 0.1 * size(robot)
    return with_slots(robot, slots)


def copied(robot: pk.Robot, rng: np.random.Generator) -> pk.Robot:
    """One limb's joints those of another."""
    slots = robot.geometry.slots.copy()
    i, j = rng.choice(len(slots), 2, replace=False)
    slots[j, :6] = slots[i, :6]
    return with_slots(robot, slots)


def exchanged_rows(robot: pk.Robot, rng: np.random.Generator) -> pk.Robot:
    """The platform joints of two limbs exchanged."""
    slots = robot.geometry.slots.copy()
    i, j = rng.choice(len(slots), 2, replace=False)
    side = BASE if robot.model.map == "translation" else PLATFORM
    slots[[i, j], side] = slots[[j, i], side]
    return with_slots(robot, slots)


def swapped(robot: pk.Robot, rng: np.random.Generator) -> pk.Robot:
    """Base and platform joints exchanged."""
    slots = robot.geometry.slots.copy()
    slots[:, BASE], slots[:, PLATFORM] = slots[:, PLATFORM].copy(), slots[:, BASE].copy()
    return with_slots(robot, slots)


def mirrored(robot: pk.Robot, rng: np.random.Generator) -> pk.Robot:
    """The platform in a left-handed frame: x or y of all its joints with the other sign."""
    slots = robot.geometry.slots.copy()
    slots[:, PLATFORM.start + int(rng.integers(2))] *= -1
    return with_slots(robot, slots)


def metres(robot: pk.Robot, rng: np.random.Generator) -> pk.Robot:
    """The joints of base or platform in metres, or the rods."""
    slots = robot.geometry.slots.copy()
    rods = SLOTS.index("rod")
    sides = [BASE, PLATFORM] + ([slice(rods, rods + 1)] if slots[:, rods].any() else [])
    slots[:, sides[rng.integers(len(sides))]] *= 1e-3
    return with_slots(robot, slots)


def inches(robot: pk.Robot, rng: np.random.Generator) -> pk.Robot | None:
    """Strokes in inches."""
    return _strokes(robot, 1 / 25.4)


def stroke_in_metres(robot: pk.Robot, rng: np.random.Generator) -> pk.Robot | None:
    """Strokes in metres."""
    return _strokes(robot, 1e-3)


def _strokes(robot: pk.Robot, factor: float) -> pk.Robot | None:
    limbs = robot.model.limbs
    if any(limb.stroke is None for limb in limbs):
        return None
    low_high = [tuple(factor * end for end in limb.stroke or ()) for limb in limbs]
    made = tuple(
        replace(limb, stroke=(ends[0], ends[1])) for limb, ends in zip(limbs, low_high, strict=True)
    )
    return with_model(robot, limbs=made)


def stroke_of_one(robot: pk.Robot, rng: np.random.Generator) -> pk.Robot | None:
    """One limb's stroke from another zero."""
    limbs = list(robot.model.limbs)
    i = int(rng.integers(len(limbs)))
    if limbs[i].stroke is None:
        return None
    low, high = limbs[i].stroke or (0.0, 0.0)
    by = rng.choice([-1, 1]) * 0.3 * (high - low)
    limbs[i] = replace(limbs[i], stroke=(low + by, high + by))
    return with_model(robot, limbs=tuple(limbs))


def rod_of_one(robot: pk.Robot, rng: np.random.Generator) -> pk.Robot | None:
    """One rod longer by a tenth."""
    slots = robot.geometry.slots.copy()
    i, rod = int(rng.integers(len(slots))), SLOTS.index("rod")
    if not slots[i, rod]:
        return None
    slots[i, rod] *= 1.1
    return with_slots(robot, slots)


def degrees_as_coordinates(robot: pk.Robot, rng: np.random.Generator) -> pk.Robot:
    """The polar angles of the joints, in degrees, as their x and y: Table 1 of the RBT-6T03P."""
    slots = robot.geometry.slots.copy()
    for side in (BASE, PLATFORM):
        points = slots[:, side]
        angle = np.degrees(np.arctan2(points[:, 1], points[:, 0]))
        slots[:, side.start] = slots[:, side.start + 1] = angle
    return with_slots(robot, slots)


def radians_as_degrees(robot: pk.Robot, rng: np.random.Generator) -> pk.Robot:
    """The polar angles of the joints in radians where the file says degrees."""
    slots = robot.geometry.slots.copy()
    for side in (BASE, PLATFORM):
        x, y = slots[:, side.start].copy(), slots[:, side.start + 1].copy()
        radius, angle = np.hypot(x, y), np.radians(np.arctan2(y, x))
        slots[:, side.start] = radius * np.cos(angle)
        slots[:, side.start + 1] = radius * np.sin(angle)
    return with_slots(robot, slots)


def similar(robot: pk.Robot, rng: np.random.Generator) -> pk.Robot | None:
    """A platform similar to the base: a hexapod that is singular in every pose."""
    slots = robot.geometry.slots.copy()
    free = robot.model.map == "spatial" and len(slots) == 6
    if not free or any(KINDS[limb.kind].name != "UPS" for limb in robot.model.limbs):
        return None
    slots[:, PLATFORM] = rng.uniform(0.3, 0.8) * slots[:, BASE]
    return with_slots(robot, slots)


MUTATIONS: dict[str, Mutation] = {
    made.__name__: made
    for made in (
        sign, digits, moved, height, copied, exchanged_rows, swapped, mirrored, metres, inches,
        stroke_in_metres, stroke_of_one, rod_of_one, degrees_as_coordinates, radians_as_degrees,
        similar,
    )
}  # fmt: skip


def manufactured(robot: pk.Robot, rng: np.random.Generator, share: float) -> pk.Robot:
    """The machine with an error of manufacture in every length, `share` of its size as sigma."""
    geometry = robot.geometry
    lengths = np.array([unit == "mm" for unit in geometry.units])
    return robot.replace(
        geometry.values + lengths * rng.normal(0.0, share * size(robot), len(geometry))
    )
