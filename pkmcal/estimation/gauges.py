"""Freedoms that no self-calibration can end: where the machine stands, how large it is.

Closures do not change when all that stands on the base moves as one body, axes included, nor when
all that is on the platform does, nor when every length and every gain grows by the same factor.
Where tensions balance a load, or weights a machine that yields, nor when all forces grow by the
same factor and stretch and compliances fall by it.
Such combinations of parameters are named by what they are, not by their numbers.
"""

from __future__ import annotations

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.core.library import AXES, SLOTS
from pkmcal.estimation.chain_gauges import frame_motions
from pkmcal.estimation.elastic_gauges import MOTIONS, elastic_motions
from pkmcal.estimation.parameters import Parameters
from pkmcal.geometry.limb_kinds import KINDS
from pkmcal.geometry.load import AT, CELL, FORCE
from pkmcal.kinematics.calibratable import as_parallel
from pkmcal.kinematics.robot import Robot
from pkmcal.screw import from_pose

_OUTSIDE = 1e-6  # share of a motion outside what may move that does not count
_AXES = ("x", "y", "z")
_BASE, _SCALE, _PLATFORM = 0, 6, 7  # first columns of the motions: shifts, turns; the common scale
_FORCES = 13  # the scale of forces
_MIXED = 1e-3  # of a motion: what is none of its own
_OFFSET = SLOTS.index("offset")
_SCALED = [SLOTS.index(name) for name in SLOTS if "tilt" not in name]  # gains too


def gauges(
    parameters: Parameters, unidentifiable: FloatArray
) -> tuple[tuple[str, ...], FloatArray]:
    """Tell motions of the base and the common scale from other unidentifiable combinations.

    `unidentifiable` (n, d) has orthonormal columns, scaled.

    Returns
    -------
    texts : tuple of str
        What may move without any reading noticing, in words.
    rest : ndarray (n, e)
        The other unidentifiable combinations.
    """
    robot = as_parallel(parameters.robot)
    if not unidentifiable.shape[1] or robot is None:
        return (), unidentifiable
    if not robot.model.closed_form:  # whose numbers are errors of joints, not places of points
        found, free = frame_motions(parameters, robot, unidentifiable)
        rest = np.linalg.svd(found, full_matrices=True)[0][:, found.shape[1] :]
        of_all = np.pad(np.insert(free, _SCALE, 0.0, axis=0), ((0, 1), (0, 0)))
        return tuple(_texts(of_all)), unidentifiable @ rest
    moves = _motions(robot)
    beside = _swivel_zeros(parameters, robot) | _of_load(parameters, robot)
    numbers = moves.reshape(-1, moves.shape[2])[robot.geometry.slot_index]
    chain = robot.geometry.chain[:, parameters.places]
    change = np.linalg.pinv(chain) @ numbers  # of the free numbers, as far as they can follow
    left = numbers - chain @ change
    own = parameters.geometry
    scaled = np.zeros((len(parameters), change.shape[1]))
    scaled[own] = change[parameters.number_of[own]] / parameters.scale[own, None]
    for i, turned in beside.items():
        scaled[i] = turned / parameters.scale[i]
    size = np.linalg.norm(scaled, axis=0)
    there = size > 0  # the machine has what would move, and some of it is free
    scaled, left = scaled[:, there] / size[there], left[:, there] / size[there]
    outside = scaled - unidentifiable @ (unidentifiable.T @ scaled)
    _, singular, rows = np.linalg.svd(np.vstack([left, outside]), full_matrices=False)
    free = rows[singular < _OUTSIDE].T  # combinations of motions
    if not free.shape[1]:
        return (), unidentifiable
    span = np.linalg.qr(scaled @ free).Q
    inside = unidentifiable - span @ (span.T @ unidentifiable)
    left_over, _, _ = np.linalg.svd(inside, full_matrices=False)
    count = unidentifiable.shape[1] - span.shape[1]
    of_all = np.zeros((len(there), free.shape[1]))
    of_all[there] = free
    return tuple(_texts(of_all, robot.model.elastic is not None)), left_over[:, :count]


def _motions(robot: Robot) -> FloatArray:
    """Changes of all numbers (*slots, 14): shifts and turns of the base, the scale, the platform's.

    And the scale of forces, where tensions balance a load or something yields. Turns are about the
    mean of the base's points, and of the platform's.
    """
    slots, limbs = robot.slots, robot.model.limbs
    balanced = robot.model.balanced_load is not None
    change = np.zeros((*slots.shape, MOTIONS))
    over = range(len(SLOTS), robot.model.own_width, 3)
    of_base = [0, *over]  # the first of the three numbers of each point
    middle = slots[:, 0:3].mean(axis=0)
    for i, limb in enumerate(limbs):
        for first in of_base[: max(1, len(limb.parts))]:
            _move(change[i], slots[i], first, _BASE, middle)
        _move(change[i], slots[i], 3, _PLATFORM, slots[:, 3:6].mean(axis=0))
        for axis, tilts in _tilts(robot, i).items():
            columns = _PLATFORM if axis == "platform" else _BASE
            change[i][[SLOTS.index(name) for name in AXES[axis]], columns + 3 : columns + 6] = (
                tilts[:2]
            )
            driver = KINDS[limb.kind].driver
            if axis == "base" and driver.turns:  # a turn of the circle is a change of the zero
                radius = slots[i, SLOTS.index(driver.lengths[driver.arm])]
                change[i, _OFFSET, 3:6] = tilts[2] * (radius if driver.unit == "mm" else 1.0)
    if all(KINDS[limb.kind].actuator_unit == "mm" for limb in limbs):
        lengths = [*_SCALED, *range(len(SLOTS), robot.model.own_width)]
        change[:, lengths, _SCALE] = slots[:, lengths]
        for number, place in zip(robot.geometry.numbers, robot.geometry.slot_index, strict=True):
            spool = limbs[number.limb].law
            turns = spool is not None and spool.spool  # gain and quadratic number turn a spool
            key = number.slot.removeprefix("drive.")
            if key != number.slot or key == "gain":
                grows = not (turns and key in ("gain", "quadratic"))
                change.reshape(-1, MOTIONS)[place, _SCALE] = slots.flat[place] * grows
            if key == "stretch":  # of no length
                change.reshape(-1, MOTIONS)[place, _SCALE] = 0.0
                change.reshape(-1, MOTIONS)[place, _FORCES] = -slots.flat[place] * balanced
    if robot.model.elastic is not None:
        for place, moved in elastic_motions(robot, _PLATFORM, _SCALE, _FORCES).items():
            change.reshape(-1, MOTIONS)[place] = moved
    return change


def _move(
    change: FloatArray, numbers: FloatArray, first: int, columns: int, middle: FloatArray
) -> None:
    """Shift and turn the point of a limb whose coordinates begin at a number."""
    place = slice(first, first + 3)
    change[place, columns : columns + 3] = np.eye(3)
    change[place, columns + 3 : columns + 6] = np.cross(np.eye(3), numbers[place] - middle).T


def _tilts(robot: Robot, i: int) -> dict[str, FloatArray]:
    """Return each limb axis' tilts and turn about itself, by turns about x, y and z."""
    limb, found = robot.model.limbs[i], {}
    for axis in KINDS[limb.kind].axes_of(limb.couple > 0):
        tilt1, tilt2 = (robot.slots[i, SLOTS.index(name)] for name in AXES[axis])
        tilted = from_pose(np.array([0.0, 0.0, 0.0, -tilt1, -tilt2, 0.0]))[:3, :3].T
        frame = limb.frames[axis] @ tilted
        by_tilts = np.array([[np.cos(tilt2), 0, 0], [0, 1, 0], [np.sin(tilt2), 0, 1]])
        found[axis] = np.linalg.solve(by_tilts, frame.T)
    return found


def _swivel_zeros(parameters: Parameters, robot: Robot) -> dict[int, FloatArray]:
    """Return derivatives of the zeros of swivel angles by the motions, by parameter."""
    found = {}
    pulleys = {f"swivel{i + 1}": i for i in robot.model.pulleys}
    for key, nature in parameters.natures.items():
        if nature.joint and key[1] in pulleys:
            for k in np.flatnonzero(parameters.number_of == parameters.nuisance[key]).tolist():
                found[k] = np.zeros(MOTIONS)
                found[k][3:6] = _tilts(robot, pulleys[key[1]])["base"][2]
    return found


def _of_load(parameters: Parameters, robot: Robot) -> dict[int, FloatArray]:
    """Return derivatives by the motions of load numbers that tensions balance, by parameter."""
    load, middle = robot.model.balanced_load, robot.slots[:, 3:6].mean(axis=0)
    if load is None:
        return {}
    frames = [robot.model.base_frame, robot.model.tool_frame]
    base, tool = (np.eye(4) if frame is None else from_pose(frame) for frame in frames)
    by = {name: np.zeros(MOTIONS) for name in load.units}
    force = np.array(load.force) @ base[:3, :3]  # in the machine's own frame
    turned = base[:3, :3] @ np.cross(np.eye(3), force).T
    # the tool is where the platform's frame is, seen from the user's
    at = np.array(load.at) @ tool[:3, :3].T + tool[:3, 3]
    moved = np.zeros((6, MOTIONS))
    _move(moved, np.concatenate([np.zeros(3), at]), 3, _PLATFORM, middle)
    moved[3:, _SCALE] = at
    for k, axis in enumerate("xyz"):
        by[f"{FORCE}.{axis}"][3:6] = turned[k]
        by[f"{FORCE}.{axis}"][_FORCES] = load.force[k]
        by[f"{AT}.{axis}"][:] = tool[:3, k] @ moved[3:]
    for j, gain in enumerate(load.cells):
        by[f"{CELL}{j + 1}"][_FORCES] = -gain
    return {k: by[own] for k, own in enumerate(parameters.names) if own in by}


def _texts(free: FloatArray, yields: bool = False) -> list[str]:
    """Motions (14, d) in words."""
    alone = [k for k in range(MOTIONS) if np.linalg.norm(free[k]) > 1.0 - _MIXED]
    texts = []
    for first, moves, where in (
        (_BASE, "the base frame may be", "nothing that was measured says where it stands"),
        (_PLATFORM, "the platform's frame may be", "nothing that was measured says where it is"),
    ):
        shifts = [_AXES[k - first] for k in alone if first <= k < first + 3]
        turns = [_AXES[k - first - 3] for k in alone if first + 3 <= k < first + 6]
        words = [f"moved along {_listed(shifts)}"] if shifts else []
        words += [f"turned about {_listed(turns)}"] if turns else []
        if words:
            texts.append(f"{moves} {' and '.join(words)}: {where}")
    rest = free.copy()
    rest[alone] = 0.0
    grows = bool(np.linalg.norm(rest[_SCALE]) > _MIXED)  # about a place that was read, say
    held, more = free.shape[1] - len(alone) - grows, " more" if alone else ""
    if held:  # turned about an anchor that is held, say
        what = "the anchors may be moved as one body"
        if np.linalg.norm(rest[_PLATFORM:]) > _MIXED:
            what = "the anchors and the platform's joints may be moved together"
        texts.append(f"{what} in {held}{more} way{'s' * (held > 1)}")
    if grows or _SCALE in alone:
        texts.append("the common scale: all lengths and gains may grow by the same factor")
    if _FORCES in alone and yields:
        texts.append(
            "the scale of forces: all weights and forces may be s times what they are, compliances"
            " falling by it; state a payload, a mass or a stiffness"
        )
    elif _FORCES in alone:
        texts.append(
            "the scale of forces: the load and all tensions may grow by the same factor, stretch"
            " and gains of load cells falling by it"
        )
    return texts


def _listed(names: list[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
