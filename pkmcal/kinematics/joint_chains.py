"""The kinematics of chains of joints, as `pkmcal.kinematics.limb_kinematics` asks for them."""

from __future__ import annotations

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.core.chains import ChainMachine
from pkmcal.geometry.chains import Chains
from pkmcal.kinematics import chain_limits
from pkmcal.kinematics.kinematics import Kinematics
from pkmcal.kinematics.limits import Feasibility

_NONE = 1e-9  # of the largest: a singular value that is none


def limits(robot: Kinematics, own: FloatArray, q: FloatArray | None) -> Feasibility:
    """Compare joints with their limits, at coordinates (N, n) or at those of the inverse."""
    if q is None:
        q = robot.machine.inverse(robot.slots, own)
    machine, slots, at = robot.bare_at(own, q)
    assert isinstance(machine, ChainMachine)
    return chain_limits.feasibility(_chains(robot), machine, slots, own, at)


def transmission(robot: Kinematics, own: FloatArray, q: FloatArray, by_q: FloatArray) -> FloatArray:
    """Return the least share of an actuator's motion, at its arm, that moves a closure, (N,).

    Of a joint behind the platform the share that no other actuator makes.
    """
    chains, slopes = _chains(robot), np.abs(robot.machine.slopes(robot.slots, q))
    arms = slopes * [1.0 if joint.unit == "mm" else arm for joint, arm in chains.arms]
    least: FloatArray = (np.linalg.norm(by_q, axis=1) / arms).min(axis=1)
    return np.fmin(least, _of_tail(robot, own, q, slopes)) if chains.tail else least


def _of_tail(robot: Kinematics, own: FloatArray, q: FloatArray, slopes: FloatArray) -> FloatArray:
    """Return the least share of a tail joint's motion that no other actuator makes, (N,).

    With more than six actuators others can always do it, and this says nothing: infinite.
    """
    chains, machine = _chains(robot), robot.machine
    least = np.full(len(own), np.inf)
    if robot.n_actuators > own.shape[1]:
        return least
    arms = slopes * [1.0 if joint.unit == "mm" else robot.length for joint, _ in chains.arms]
    twists = machine.forward_jacobian(robot.slots, own, q, twists=True) / arms[:, None]
    twists[:, :3] *= robot.length
    for a in range(robot.n_actuators - chains.tail, robot.n_actuators):
        mine, others = twists[:, :, a], np.delete(twists, a, axis=2)
        axes, sigma, _ = np.linalg.svd(others, full_matrices=False)
        axes *= (sigma > _NONE * sigma[:, :1])[:, None]
        rest = mine - (axes @ (axes.swapaxes(1, 2) @ mine[..., None]))[..., 0]
        least = np.fmin(least, np.linalg.norm(rest, axis=1) / np.linalg.norm(mine, axis=1))
    return least


def lines(robot: Kinematics, own: FloatArray, q: FloatArray) -> list[FloatArray]:
    """Return the joints of each chain at coordinates (N, n), from the base to the platform."""
    machine, slots, at = robot.bare_at(own, q)
    assert isinstance(machine, ChainMachine)
    frames, chains = machine.frames(slots, np.ascontiguousarray(own), at)[1], _chains(robot)
    found, start = [], 0
    for limb, parts in zip(chains.limbs, chains.members, strict=True):
        first = np.cumsum([0, *(joint.parts for joint in limb[:-1])])
        found.append(frames[:, start + first, 9:])
        start += len(parts) + 1
    return found


def _chains(robot: Kinematics) -> Chains:
    """The joints of a machine whose limbs are chains."""
    assert robot.model.chains is not None
    return robot.model.chains
