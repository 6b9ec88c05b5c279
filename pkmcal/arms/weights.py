"""Torques of gravity at the joints of an arm, by masses and by moments of its links.

The torque on joint i is that of all links behind it. A link moves with its joint, so that masses
and centres count as moments that are constant in the axes of the links.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from pkmcal.arms.serial_chain import SerialChain
from pkmcal.arrays import FloatArray, as_numbers, as_rows
from pkmcal.exceptions import ArgumentError
from pkmcal.geometry.elastic import GRAVITY

_MOST_STEPS = 60
_SETTLED = 1e-15  # rad and mm


def link_motions(arm: SerialChain, theta: ArrayLike) -> FloatArray:
    """Return the motion of each link from where it is at zero.

    Parameters
    ----------
    arm : SerialArm
        With its own joint errors.
    theta : array_like (..., n)
        Joint coordinates, rad and mm.

    Returns
    -------
    ndarray (..., n, 4, 4)
        Of the link behind each joint, mm.
    """
    rows, shape = as_rows("theta", theta, arm.n_joints)
    found = np.empty((len(rows), arm.n_joints, 4, 4))
    for k in range(arm.n_joints):
        part = SerialChain(
            arm.axes[: k + 1],
            arm.points[: k + 1],
            np.eye(4),
            kinds=arm.kinds[: k + 1],
            joint_errors=arm.joint_errors[: k + 1],
        )
        found[:, k] = part.forward(np.ascontiguousarray(rows[:, : k + 1]))
    return found.reshape(*shape, arm.n_joints, 4, 4)


def gravity_torques(
    arm: SerialChain,
    theta: ArrayLike,
    masses: ArrayLike,
    centres: ArrayLike,
    gravity: ArrayLike = GRAVITY,
) -> FloatArray:
    """Torques and forces of gravity about and along the joints.

    Parameters
    ----------
    arm, theta
        As for `link_motions`.
    masses : array_like (n,)
        Of the link behind each joint, kg.
    centres : array_like (n, 3)
        Their centres of mass with the arm at zero, in the base, mm.
    gravity : array_like (3,)
        m/s², in the axes of the base.

    Returns
    -------
    ndarray (..., n)
        N mm, of prismatic joints N; positive where gravity moves the joint forwards.

    Raises
    ------
    ValueError, TypeError
        A wrong shape, or no numbers.

    Examples
    --------
    A level arm of 2 kg, its centre 300 mm from the joint:

    >>> import pkmcal as pk
    >>> arm = pk.SerialArm([[0, 1, 0]], [[0, 0, 0]], [600, 0, 0, 0, 0, 0])
    >>> gravity_torques(arm, [0.0], [2.0], [[300.0, 0.0, 0.0]]).round(2)
    array([5883.99])
    """
    moved, axes, points = _at(arm, theta)
    weight = _each("masses", masses, (arm.n_joints,))[:, None] * _each("gravity", gravity, (3,))
    centre = _each("centres", centres, (arm.n_joints, 3))
    place = np.einsum("...lij,lj->...li", moved[..., :3, :3], centre) + moved[..., :3, 3]
    arm_of = place[..., None, :, :] - points[..., :, None, :]  # joint, link
    turning = np.cross(arm_of, weight)
    sliding = np.broadcast_to(weight, turning.shape)
    prismatic = np.array([kind == "prismatic" for kind in arm.kinds])
    pull = np.where(prismatic[:, None, None], sliding, turning)
    each = np.einsum("...ik,...ilk->...il", axes, pull) * _behind(arm.n_joints)
    return np.asarray(each.sum(axis=-1))


def gravity_products(
    arm: SerialChain, theta: ArrayLike, gravity: ArrayLike = GRAVITY
) -> FloatArray:
    """Torque of gravity's direction about each joint by a unit moment of each link.

    z_i·(R_l e × ĝ): what joint i gives is linear in these, whatever the masses are.

    Parameters
    ----------
    arm, theta, gravity
        As for `gravity_torques`; of gravity the direction alone counts.

    Returns
    -------
    ndarray (..., n, n, 3)
        Of joint i by link l along x, y, z of the base at zero; 0 for links before the joint, and
        for prismatic joints, whose force no moment changes.
    """
    moved, axes, _ = _at(arm, theta)
    direction = _each("gravity", gravity, (3,))
    size = float(np.linalg.norm(direction))
    if not size > 0.0:
        raise ArgumentError("gravity must have a direction, found 0 0 0")
    # z·(R e × ĝ) = e·Rᵀ(ĝ × z)
    turned = np.cross(direction / size, axes)
    found = np.einsum("...lkj,...ik->...ilj", moved[..., :3, :3], turned)
    turning = np.array([kind == "revolute" for kind in arm.kinds])
    return np.asarray(found * (_behind(arm.n_joints) * turning[:, None])[..., None])


def link_moments(arm: SerialChain, masses: ArrayLike, centres: ArrayLike) -> FloatArray:
    """Moments of the links, (n, 3) kg mm: of turning joints, gravity's torque is theirs.

    B_l = m_l (c_l - P_l) + (masses behind l) (P_{l+1} - P_l), with P the points of the joints:
    with `gravity_products` G and gravity g the torques are Σ_l G_{il}·B_l g.

    Parameters
    ----------
    arm : SerialArm
        Of turning joints, without joint errors.
    masses, centres : array_like
        As for `gravity_torques`.
    """
    if "prismatic" in arm.kinds:
        raise ArgumentError("arm: moments of links are those of arms with turning joints alone")
    if arm.joint_errors.any():
        raise ArgumentError("arm: moments of links are those of the arm without joint errors")
    mass = _each("masses", masses, (arm.n_joints,))
    points = arm.points
    behind = mass.sum() - np.cumsum(mass)
    found = mass[:, None] * (_each("centres", centres, (arm.n_joints, 3)) - points)
    found[:-1] += behind[:-1, None] * (points[1:] - points[:-1])
    return np.asarray(found)


def at_rest(
    torques: Callable[[FloatArray], FloatArray], theta: FloatArray, compliance: FloatArray
) -> FloatArray:
    """Solve θ = θ_motor + c τ(θ) for elastic joints at rest, (N, n); NaN where there is no rest.

    Parameters
    ----------
    torques : callable
        Torques and forces (N, n) at joint coordinates (N, n), such as `gravity_torques`.
    theta : ndarray (N, n)
        What the motors hold, rad and mm. The reverse is explicit: θ_motor = θ - c τ(θ).
    compliance : ndarray (n,)
        rad/(N mm), of prismatic joints mm/N.
    """
    found = theta
    for _ in range(_MOST_STEPS):
        again = theta + compliance * torques(found)
        change = np.abs(again - found).max(axis=1)
        found = again
        if not (change > _SETTLED).any():
            break
    scale = 1.0 + np.abs(found).max(axis=1)
    return np.where((change <= 8 * np.finfo(float).eps * scale)[:, None], found, np.nan)


def _at(arm: SerialChain, theta: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Motions of links (..., n, 4, 4), and where their joints' axes and points are (..., n, 3)."""
    moved = link_motions(arm, theta)
    axes = np.einsum("...lij,lj->...li", moved[..., :3, :3], arm.axes)
    points = np.einsum("...lij,lj->...li", moved[..., :3, :3], arm.points) + moved[..., :3, 3]
    return moved, axes, points


def _behind(n: int) -> FloatArray:
    """1 where link l (columns) is behind joint i (rows)."""
    return np.triu(np.ones((n, n)))


def _each(name: str, given: ArrayLike, shape: tuple[int, ...]) -> FloatArray:
    found = as_numbers(name, given, shape[-1]).astype(np.float64)
    if found.shape != shape or not np.isfinite(found).all():
        raise ArgumentError(f"{name} must be {shape} finite numbers, found {found.shape}")
    return found
