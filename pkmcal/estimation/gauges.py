"""Freedoms that no self-calibration can end: where the machine stands, how large it is.

Closures do not change when all anchors move as one body, or when every length and every gain grows
by the same factor. Such combinations of parameters are named by what they are, not by their
numbers.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray
from pkmcal.core.library import SLOTS
from pkmcal.estimation.chain_gauges import frame_motions
from pkmcal.estimation.equations import Equations
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.parameters import Parameters
from pkmcal.geometry.limb_kinds import KINDS
from pkmcal.kinematics.robot import Robot

MIRROR = "its mirror image fits as well: which of the two it is, the robot file says alone"
_OUTSIDE = 1e-6  # share of a motion outside what may move that does not count
_ALIKE = 1e-6  # share by which costs differ that are the same
_AXES = ("x", "y", "z")
_HOW = ("moved along", "turned about")
_SCALE = 6  # column of the motions that is the common scale
_SCALED = [SLOTS.index(name) for name in SLOTS if "tilt" not in name]  # gains too


@dataclass(frozen=True, eq=False)
class Gauges:
    """What may move without any reading noticing.

    Attributes
    ----------
    texts : tuple of str
        In words.
    rest : ndarray (n, d)
        The other unidentifiable combinations, scaled, orthonormal.
    """

    texts: tuple[str, ...]
    rest: FloatArray


def gauges(parameters: Parameters, unidentifiable: FloatArray) -> Gauges:
    """Tell motions of the base and the common scale from other unidentifiable combinations.

    Parameters
    ----------
    parameters : Parameters
        The parameter vector.
    unidentifiable : ndarray (n, d)
        Orthonormal columns, scaled.
    """
    robot = parameters.robot
    if not unidentifiable.shape[1] or not isinstance(robot, Robot):
        return Gauges((), unidentifiable)
    if robot.model.chains is not None:  # whose numbers are errors of joints, not places of points
        found, alone = frame_motions(parameters, robot, unidentifiable)
        rest = np.linalg.svd(found, full_matrices=True)[0][:, found.shape[1] :]
        return Gauges(tuple(_chain_texts(alone, found.shape[1])), unidentifiable @ rest)
    moves = _motions(robot)
    numbers = moves.reshape(-1, moves.shape[2])[robot.geometry.slot_index]
    chain = robot.geometry.chain[:, parameters.places]
    change = np.linalg.pinv(chain) @ numbers  # of the free numbers, as far as they can follow
    left = numbers - chain @ change
    own = parameters.geometry
    scaled = np.zeros((len(parameters), change.shape[1]))
    scaled[own] = change[parameters.number_of[own]] / parameters.scale[own, None]
    size = np.linalg.norm(scaled, axis=0)
    there = size > 0  # the machine has what would move, and some of it is free
    scaled, left = scaled[:, there] / size[there], left[:, there] / size[there]
    outside = scaled - unidentifiable @ (unidentifiable.T @ scaled)
    _, singular, rows = np.linalg.svd(np.vstack([left, outside]), full_matrices=False)
    free = rows[singular < _OUTSIDE].T  # combinations of motions
    if not free.shape[1]:
        return Gauges((), unidentifiable)
    span = np.linalg.qr(scaled @ free).Q
    inside = unidentifiable - span @ (span.T @ unidentifiable)
    left_over, _, _ = np.linalg.svd(inside, full_matrices=False)
    count = unidentifiable.shape[1] - span.shape[1]
    of_all = np.zeros((len(there), free.shape[1]))
    of_all[there] = free
    return Gauges(tuple(_texts(of_all)), left_over[:, :count])


def _motions(robot: Robot) -> FloatArray:
    """Changes of all numbers (*slots, 7): shifts and turns of the base, and the scale."""
    slots = robot.slots
    change = np.zeros((*slots.shape, 7))
    change[:, 0:3, 0:3] = np.eye(3)
    middle = slots[:, 0:3].mean(axis=0)
    turned = np.cross(np.eye(3)[None], (slots[:, 0:3] - middle)[:, None])  # (limbs, axis, xyz)
    if not any(KINDS[limb.kind].axes_of(limb.couple > 0) for limb in robot.model.limbs):
        change[:, 0:3, 3:6] = turned.transpose(0, 2, 1)
    if all(KINDS[limb.kind].actuator_unit == "mm" for limb in robot.model.limbs):
        change[:, _SCALED, _SCALE] = slots[:, _SCALED]
        for number, place in zip(robot.geometry.numbers, robot.geometry.slot_index, strict=True):
            spool = robot.model.limbs[number.limb].law
            turns = spool is not None and spool.spool  # gain and quadratic number turn a spool
            key = number.slot.removeprefix("drive.")
            if key != number.slot or key == "gain":
                grows = not (turns and key in ("gain", "quadratic"))
                change.reshape(-1, 7)[place, _SCALE] = slots.flat[place] * grows
    return change


def _texts(free: FloatArray) -> list[str]:
    """Motions (7, d) in words."""
    alone = [k for k in range(7) if np.linalg.norm(free[k]) > 1.0 - 1e-3]
    texts = []
    if len(alone) < free.shape[1]:  # turned about an anchor that is held, say
        held = free.shape[1] - len(alone)
        texts.append(f"the anchors may be moved as one body in {held} more way{'s' * (held > 1)}")
    if words := _moved(np.isin(np.arange(_SCALE), alone)):
        texts.insert(
            0, f"the base frame may be {words}: nothing that was measured says where it stands"
        )
    if _SCALE in alone:
        texts.append("the common scale: all lengths and gains may grow by the same factor")
    return texts


def _chain_texts(alone: BoolArray, count: int) -> list[str]:
    """Motions (12,) of base and platform in words, of `count` in all."""
    said = (
        ("the base frame may be {}: nothing that was measured says where it stands", alone[:6]),
        (
            "the platform's frame may be {}: nothing that was measured says where on the platform"
            " it is",
            alone[6:],
        ),
    )
    texts = [text.format(words) for text, these in said if (words := _moved(these))]
    more = count - int(alone.sum())
    if more > 0:
        texts.append(
            f"base or platform may be moved as one body in {more} more way{'s' * (more > 1)}"
        )
    return texts


def _moved(free: BoolArray) -> str:
    """Shifts and turns (6,) in words; empty where there are none."""
    names = [[_AXES[k % 3] for k in part if free[k]] for part in (range(3), range(3, 6))]
    words = [f"{how} {_listed(these)}" for how, these in zip(_HOW, names, strict=True) if these]
    return " and ".join(words)


def _listed(names: list[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def mirror_fits(equations: Equations, evaluation: Evaluation, noise: FloatArray) -> bool:
    """Whether the mirror image of a point platform's machine fits as well as the machine.

    All anchors and poses are reflected in a plane across x, y or z that keeps what is not free,
    and the poses are fitted there. No derivative sees this: both are minima, apart from each other.
    """
    robot, parameters = evaluation.robot, equations.parameters
    if not isinstance(robot, Robot) or not equations.closures.unknowns:
        return False
    joints = robot.slots[:, 3:6]
    if robot.model.map not in ("translation", "xy") or np.ptp(joints, axis=0).any():
        return False
    if any(name.startswith("base") and "@" in name for name in parameters.names):
        return False  # anchors of each session: not looked at
    cost = _cost(equations, evaluation, noise)
    for k, axis in enumerate(robot.coordinates):
        names = [f"base{i + 1}.{axis}" for i in range(len(robot.slots))]
        own = [parameters.names.index(n) if n in parameters.names else -1 for n in names]
        values, free = robot.slots[:, k], np.array(own) >= 0
        middle = float(values[~free].mean() if (~free).any() else values.mean())
        held_apart = bool((values[~free] != middle).any())
        if not free.any() or held_apart or not robot.frames.trivial:
            continue
        theta, pose = evaluation.theta.copy(), evaluation.pose.copy()
        theta[np.array(own)[free]] = 2.0 * middle - values[free]
        pose[:, k] = 2.0 * (middle - joints[0, k]) - pose[:, k]
        image = copy.copy(equations)
        image.start_from(np.arange(len(pose)), pose)
        there = image.at(theta, noise)
        if there.ok and _cost(image, there, noise) <= (1.0 + _ALIKE) * cost:
            return True
    return False


def _cost(equations: Equations, evaluation: Evaluation, noise: FloatArray) -> float:
    prior = equations.parameters.prior_left(evaluation.theta)
    return float((equations.residual(evaluation, noise) ** 2).sum() + prior @ prior)
