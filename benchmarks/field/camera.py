"""An arm with a ChArUco board before a camera that stands, 16 pictures: pkmcal and OpenCV.

The flange's poses are held, as OpenCV's hand-eye does; frame of the camera and board on the flange
are found from all pictures but those left out, whose corners are then predicted.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from scipy.spatial.transform import Rotation

import pkmcal as pk
from benchmarks.field.case import DATA, Clock, Scored, scored
from pkmcal.arrays import FloatArray, IntArray
from pkmcal.readings import Board, Camera

FOLDER = DATA / "charuco"
BOARD = "charuco:5x7,36.195,18.256,6X6_250"
SQUARE, ACROSS = 36.195, 4  # mm; inner corners in a row of the board
LEAST = 6  # corners of a picture


def flange_poses() -> dict[str, FloatArray]:
    """Return the pose of the flange (4, 4), mm, of each picture."""
    table = np.genfromtxt(
        FOLDER / "poses.csv", delimiter=",", skip_header=1, dtype=None, encoding="utf-8"
    )
    poses = {}
    for name, x, y, z, *quaternion in table:
        poses[name] = np.eye(4)
        poses[name][:3, :3] = Rotation.from_quat(quaternion, scalar_first=True).as_matrix()
        poses[name][:3, 3] = x, y, z
    return poses


def measured() -> tuple[pk.SerialArm, pk.Measurements]:
    """Return six axes that are the pose of the flange, and the corners."""
    arm = pk.SerialArm(
        np.vstack([np.eye(3)] * 2), np.repeat([[600.0] * 3, [0.0] * 3], 3, axis=0), np.eye(4),
        kinds=["prismatic"] * 3 + ["revolute"] * 3,
    )  # fmt: skip
    lines = ["image,q1 [mm],q2 [mm],q3 [mm],q4 [rad],q5 [rad],q6 [rad]"]
    for name, pose in flange_poses().items():
        angles = Rotation.from_matrix(pose[:3, :3]).as_euler("XYZ")
        lines.append(",".join([name, *map(repr, map(float, (*pose[:3, 3], *angles)))]))
    with TemporaryDirectory() as folder:
        joints = Path(folder) / "joints.csv"
        joints.write_text("\n".join(lines) + "\n", encoding="utf-8")
        camera = Camera.from_file(FOLDER / "lens.yaml", board=Board.parse(BOARD))
        m = pk.read_measurements(FOLDER / "pixels.csv", arm, controller=joints, kind=camera)
    many = np.flatnonzero(np.bincount(m.group)[m.group] >= LEAST)
    return arm, replace(m.select(many), actuator_sigma=0.0)


Picture = tuple[FloatArray, FloatArray, FloatArray]  # flange, points of the board, corners in px


def pictures(m: pk.Measurements) -> list[Picture]:
    """Return the flange's pose, the points of the board and the corners of each picture."""
    table = np.genfromtxt(
        FOLDER / "pixels.csv", delimiter=",", skip_header=1, dtype=None, encoding="utf-8"
    )
    poses, found = flange_poses(), []
    for name in dict.fromkeys(row[0] for row in table):
        rows = [row for row in table if row[0] == name]
        if len(rows) < LEAST:
            continue
        corner = np.array([row[1] for row in rows])
        points = SQUARE * np.column_stack([corner % ACROSS, corner // ACROSS, 0 * corner])
        found.append((poses[name], points, np.array([[row[2], row[3]] for row in rows])))
    assert sum(len(corners) for *_, corners in found) == len(m)
    return found


def matrix(turned: FloatArray, place: FloatArray) -> FloatArray:
    made = np.eye(4)
    made[:3, :3], made[:3, 3] = turned, np.ravel(place)
    return made


def by_opencv(seen: list[Picture], lens: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Place the board before each picture, then solve the equation of hand and eye.

    Returns
    -------
    tuple of ndarray (4, 4)
        Base in the camera's axes, and board in the flange's: board in camera = first @ flange @
        second.
    """
    import cv2

    boards = []
    for _, points, corners in seen:
        _, rotation, place = cv2.solvePnP(points, corners, lens, None)
        boards.append(matrix(cv2.Rodrigues(rotation)[0], place))
    flanges = [pose for pose, *_ in seen]
    # with the flange in the place of its "base to gripper" the camera that stands is its gripper's
    turned, place, camera, origin = cv2.calibrateRobotWorldHandEye(
        [each[:3, :3] for each in boards], [each[:3, 3] for each in boards],
        [each[:3, :3] for each in flanges], [each[:3, 3] for each in flanges],
    )  # fmt: skip
    return matrix(camera, origin), np.linalg.inv(matrix(turned, place))


def rows() -> Iterator[Scored]:
    """Yield the rows of the table: distances of corners in pictures that were left out, px."""
    if not FOLDER.exists():
        return
    arm, m = measured()
    groups = np.unique(m.group, return_inverse=True)[1]
    each = np.arange(groups.max() + 1)
    name = f"ChArUco board on an arm's flange, {len(each)} pictures"

    def ours(left_out: IntArray) -> tuple[float, FloatArray]:
        mask = left_out[groups]
        with Clock() as clock:
            found = pk.identify(arm, m.select(~mask), free=[], holdout=m.select(mask))
        return clock.seconds, np.full(int(mask.sum()), found.holdout_families[0].rms)

    says = pk.identify(arm, m, free=[]).verdict.state
    yield scored(name, "pkmcal, flange held", "px", each, ours, says=says)
    if not find_spec("cv2"):
        return
    import cv2

    seen, camera = pictures(m), m.instrument
    lens = np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1.0]])

    def theirs(left_out: IntArray) -> tuple[float, FloatArray]:
        with Clock() as clock:
            base, board = by_opencv([seen[i] for i in np.flatnonzero(~left_out)], lens)
        off = []
        for i in np.flatnonzero(left_out):
            flange, points, corners = seen[i]
            pose = base @ flange @ board
            turned = cv2.Rodrigues(pose[:3, :3])[0]
            there = cv2.projectPoints(points, turned, pose[:3, 3], lens, None)[0].reshape(-1, 2)
            off.append(np.linalg.norm(there - corners, axis=1))
        return clock.seconds, np.concatenate(off)

    if hasattr(cv2, "calibrateRobotWorldHandEye"):  # OpenCV 5.0 has it not
        yield scored(name, "OpenCV, world and hand-eye", "px", each, theirs)
