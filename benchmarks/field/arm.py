"""A FANUC R-2000iC and a laser tracker: pkmcal, pybotics, SciPy by hand.

The last two begin at the modified Denavit–Hartenberg numbers of the arm as drawn. Where the tracker
stands and where the reflectors sit is found by all.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from importlib.util import find_spec

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

import pkmcal as pk
from benchmarks.field.case import ROOT, Clock, Scored, scored
from pkmcal.arrays import FloatArray, IntArray

FOLDER = ROOT / "examples" / "fanuc-r2000ic"
REFLECTORS = 3
Errors = Callable[[IntArray], tuple[float, FloatArray]]
Fit = Callable[[FloatArray, FloatArray], Callable[[FloatArray], FloatArray]]


def nominal() -> FloatArray:
    """Return alpha, a, theta, d (6, 4) of each joint, rad and mm, as drawn."""
    dh = pk.load(FOLDER / "robot.toml").dh("modified")
    return np.column_stack([dh.alpha, dh.a, dh.theta, dh.d])


def chain(links: FloatArray, joints: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return rotations (N, 3, 3) and places (N, 3) of the flange."""
    n = len(joints)
    turned, place = np.tile(np.eye(3), (n, 1, 1)), np.zeros((n, 3))
    for (alpha, a, theta, d), q in zip(links, joints.T, strict=True):
        c, s = np.cos(theta + q), np.sin(theta + q)
        ca, sa = np.cos(alpha), np.sin(alpha)
        place = place + turned @ np.array([a, -sa * d, ca * d])
        link = np.array(
            [[c, -s, 0 * c], [ca * s, ca * c, 0 * c - sa], [sa * s, sa * c, 0 * c + ca]]
        )
        turned = turned @ link.transpose(2, 0, 1)
    return turned, place


def seen(numbers: FloatArray, joints: FloatArray) -> FloatArray:
    """Return reflectors (N, k, 3) in the tracker's frame: 24 numbers, 6 of the frame, 3 k."""
    turned, place = chain(numbers[:24].reshape(6, 4), joints)
    where = place[:, None] + np.einsum("nij,kj->nki", turned, numbers[30:].reshape(-1, 3))
    return where @ Rotation.from_rotvec(numbers[27:30]).as_matrix().T + numbers[24:27]


def start(joints: FloatArray, reflectors: FloatArray) -> FloatArray:
    """Return nominal numbers with a frame that takes the flange's places to the reflectors."""
    _, place = chain(nominal(), joints)
    mean = reflectors.mean(axis=1)
    turned, _ = Rotation.align_vectors(mean - mean.mean(axis=0), place - place.mean(axis=0))
    origin = mean.mean(axis=0) - turned.apply(place).mean(axis=0)
    targets = np.zeros(3 * reflectors.shape[1])
    return np.concatenate([nominal().ravel(), origin, turned.as_rotvec(), targets])


def by_scipy(joints: FloatArray, reflectors: FloatArray) -> Callable[[FloatArray], FloatArray]:
    """Fit all numbers at once; derivatives by differences."""
    best = least_squares(
        lambda numbers: (seen(numbers, joints) - reflectors).ravel(),
        start(joints, reflectors),
        method="lm",
        x_scale="jac",
    )
    return lambda q: seen(best.x, q)


def by_pybotics(joints: FloatArray, reflectors: FloatArray) -> Callable[[FloatArray], FloatArray]:
    """Fit pybotics' chain, frame and tool, one reflector.

    Its own fitness, `optimize_accuracy`, is the distance of each row, whose derivatives jump where
    a row is met: with it, 18 poses were still 2 mm off after 100 s. Components are fitted instead.
    """
    from pybotics.geometry import vector_2_matrix
    from pybotics.optimization import OptimizationHandler
    from pybotics.robot import Robot

    first = start(joints, reflectors)
    robot = Robot.from_parameters(first[:24].reshape(6, 4))
    angles = Rotation.from_rotvec(first[27:30]).as_euler("XYZ")
    robot.world_frame = vector_2_matrix([*first[24:27], *angles])
    handler = OptimizationHandler(
        robot, kinematic_chain_mask=True, tool_mask=[True] * 3 + [False] * 3, world_mask=True
    )

    def seen_by(numbers: FloatArray, q: FloatArray) -> FloatArray:
        handler.apply_optimization_vector(numbers)
        return np.array([handler.robot.fk(row)[:3, 3] for row in q])

    best = least_squares(
        lambda numbers: (seen_by(numbers, joints) - reflectors[:, 0]).ravel(),
        handler.generate_optimization_vector(),
        method="lm",
        x_scale="jac",
    )
    return lambda q: seen_by(best.x, q)[:, None]


def rows() -> Iterator[Scored]:
    """Yield the rows of the table: distances of reflectors at poses that were left out."""
    m = pk.read_measurements(FOLDER / "tracker.csv")
    arm = pk.load(FOLDER / "robot.toml")
    joints, reflectors = m.actuators[::REFLECTORS], m.values.reshape(-1, REFLECTORS, 3)
    pose = m.pose_index[::REFLECTORS]
    mean = np.array([reflectors[pose == each, :1].mean(axis=0) for each in np.unique(pose)])
    once = joints[np.unique(pose, return_index=True)[1]]

    def ours(name: str, measured: pk.Measurements, poses: IntArray, **asked: object) -> Scored:
        each = len(measured) // len(poses)
        found = pk.identify(arm, measured, unknown=["frame", "target"], **asked)

        def errors(left_out: IntArray) -> tuple[float, FloatArray]:
            mask = np.repeat(left_out, each)
            with Clock() as clock:
                found = pk.identify(
                    arm, measured.select(~mask), holdout=measured.select(mask),
                    unknown=["frame", "target"], **asked,
                )  # fmt: skip
            return clock.seconds, np.full(int(mask.sum()), found.holdout_rms)

        tool = "pkmcal with sag" if asked else "pkmcal"
        return scored(name, tool, "mm", poses, errors, says=found.verdict.state)

    def theirs(fit: Fit, joints: FloatArray, places: FloatArray) -> Errors:
        def errors(left_out: IntArray) -> tuple[float, FloatArray]:
            with Clock() as clock:
                predict = fit(joints[~left_out], places[~left_out])
            off = predict(joints[left_out]) - places[left_out]
            return clock.seconds, np.linalg.norm(off, axis=2).ravel()

        return errors

    name = "FANUC arm, laser tracker, 24 poses, 3 reflectors"
    yield ours(name, m, pose)
    yield ours(name, m, pose, effects=[pk.Sag()])
    yield scored(name, "SciPy by hand", "mm", pose, theirs(by_scipy, joints, reflectors))
    name, each = "FANUC arm, 1 reflector, mean of 10 repeats", np.arange(len(once))
    means = pk.Measurements(once, mean[:, 0], "position")
    yield ours(name, means, each)
    yield scored(name, "SciPy by hand", "mm", each, theirs(by_scipy, once, mean))
    if find_spec("pybotics"):
        yield scored(name, "pybotics", "mm", each, theirs(by_pybotics, once, mean))
