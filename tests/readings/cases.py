"""A case for every registered kind of reading, and for readings outside of the package.

``READING=mine.py pytest tests/readings`` also tries a kind of one's own: the file's `CASE` is a
mapping of the arguments of `Case`.
"""

from __future__ import annotations

import os
import runpy
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

import pkmcal as pk
from pkmcal.readings import (
    Angle,
    Between,
    Board,
    Camera,
    Closure,
    Distance,
    Height,
    Orientation,
    Pose,
    Position,
    Reading,
    RelativeDistance,
    Tilt,
    Touch,
)
from pkmcal.readings.touches import TOUCHES

from ..simulated import hexapod_poses
from .own import Loop, Spot

NOISE, ROWS = 0.02, 60
TIP = np.array([40.0, -30.0, 120.0])
POSTS = np.array([[1500.0, 200, 100], [-300, -1200, 900], [100, 300, -1500]])
NAMES = np.array(["A", "B", "C"])
PLACES = {"A": [20.0, -40, 980], "B": [-60.0, 30, 1020], "C": [50.0, 70, 990]}

Drawn = tuple[np.ndarray, Reading]  # actuators, and the instrument that reads there
Draw = Callable[[pk.Robot, int, np.random.Generator], Drawn]


@dataclass(frozen=True)
class Case:
    """How rows of a kind are drawn, and what of them can be unknown."""

    name: str
    draw: Draw
    target: np.ndarray | None = None
    unknown: Mapping[str, str] = field(default_factory=dict)
    machine: str = "hexapod"
    own: Reading | None = None  # what has to be handed to read_measurements
    rows: int = ROWS  # that tell all that is unknown
    frame: tuple[float, ...] = (400, -200, 90, 0.4, -0.7, 2.0)  # in which derivatives are compared

    def measured(self, robot: pk.Robot, rows: int, seed: int, noise: float) -> pk.Measurements:
        """Rows of a machine."""
        rng = np.random.default_rng(seed)
        q, instrument = self.draw(robot, rows, rng)
        target = self.target
        if target is not None and target.ndim == 2:
            target = target[np.arange(rows) % len(target)]
        return pk.VirtualMachine(robot, noise, seed).measure(q, instrument, target)


def at_poses(make: Callable[[int], Reading]) -> Draw:
    """The instrument, at poses drawn all over the workspace."""

    def draw(robot: pk.Robot, rows: int, rng: np.random.Generator) -> Drawn:
        return robot.inverse(hexapod_poses(robot, rows, rng)), make(rows)

    return draw


def two_places(robot: pk.Robot, rows: int, rng: np.random.Generator) -> Drawn:
    q, other = (robot.inverse(hexapod_poses(robot, rows, rng)) for _ in range(2))
    return q, Between(other)


def joint(robot: pk.Robot, rows: int, rng: np.random.Generator) -> Drawn:
    poses = pk.sample_poses(robot, rows, seed=int(rng.integers(2**32)))
    return robot.inverse(poses), Angle("limb1.joint2")


def touches(artefact: str) -> Draw:
    """Touches of three artefacts; lines along and planes across z, spheres of 30 mm."""

    def draw(robot: pk.Robot, rows: int, rng: np.random.Generator) -> Drawn:
        names = NAMES[np.arange(rows) % 3]
        at = np.array([PLACES[name] for name in names])
        free = {"point": [0, 0, 0], "line": [0, 0, 1], "plane": [1, 1, 0], "sphere": [0, 0, 0]}
        at = at + rng.uniform(-60, 60, (rows, 3)) * free[artefact]
        if artefact == "sphere":
            away = rng.normal(size=(rows, 3))
            at += 30.0 * away / np.linalg.norm(away, axis=1)[:, None]
        angles = rng.uniform(-0.25, 0.25, (rows, 3))
        poses = np.hstack([at - Rotation.from_euler("xyz", angles).apply(TIP), angles])
        beside = {"point": [], "sphere": [30.0]}.get(artefact, [0.0, 0.0, 0.0])
        places = {name: [*place, *beside] for name, place in PLACES.items()}
        return robot.inverse(poses), Touch(names, artefact, places=places)  # type: ignore[arg-type]

    return draw


BOARD = Board.chessboard(4, 3, 40)
LENS = {"fx": 3000.0, "fy": 2990.0, "cx": 1220.0, "cy": 1020.0, "k1": -0.1, "k2": 0.08, "p1": 1e-3}
STANDS = {
    "base": {"stands": [-60, 80, 2300, 3.0, 0.1, 0.2], "carried": [-70, 40, 60, 3.09, -0.03, 0.1]},
    "platform": {
        "stands": [-30, 50, -2200, 0.05, 0.1, 0.3], "carried": [10, -15, 60, -0.03, 0.05, 0.6]
    },
}  # fmt: skip
LAID = {"base": (300, -200, 1900, 2.8, 0.4, 2), "platform": (200, -200, -1700, 0.3, -0.2, 2)}


def pictures(on: str) -> Draw:
    """Of a board on the platform, or by a camera there."""

    def draw(robot: pk.Robot, rows: int, rng: np.random.Generator) -> Drawn:
        count = -(-rows // len(BOARD.ids))
        camera = Camera(on=on, **LENS, **STANDS[on])  # type: ignore[arg-type]
        q, seeing = camera.seeing(robot.inverse(hexapod_poses(robot, count, rng)), BOARD)
        return q[:rows], seeing.select(np.arange(rows), False)

    return draw


def runs(rows: int) -> np.ndarray:
    return NAMES[np.arange(rows) % 3]


FRAME = {"frame": "unknown"}
MOUNTED = [0.1, -0.05, 1.3]
CASES = (
    Case("pose", at_poses(lambda _: Pose()), unknown={**FRAME, "target": "unknown"}),
    Case("position", at_poses(lambda _: Position()), TIP, {**FRAME, "target": "unknown"}),
    Case("height", at_poses(lambda _: Height()), TIP, FRAME),
    Case("distance", at_poses(lambda _: Distance(TIP)), POSTS),
    Case("closure", at_poses(lambda _: Closure())),
    Case("between", two_places, TIP, {"target": "unknown"}),
    Case("relative-distance", at_poses(lambda n: RelativeDistance(TIP, runs(n))), POSTS),
    Case("orientation", at_poses(lambda _: Orientation(MOUNTED)), unknown={"target": "unknown"}),
    Case("tilt", at_poses(lambda _: Tilt(MOUNTED))),
    Case("angle", joint, machine="agile-eye"),
    *(Case(f"touch {artefact}", touches(artefact), TIP) for artefact in TOUCHES),
    *(Case(f"pixel {on}", pictures(on), rows=300, frame=frame) for on, frame in LAID.items()),
    Case("loop", at_poses(lambda n: Loop(runs(n))), TIP, {"target": "unknown"}, own=Loop()),
    Case("spot", at_poses(lambda _: Spot()), TIP, own=Spot()),
)


def with_that_of(file: str | None, cases: tuple[Case, ...] = CASES) -> tuple[Case, ...]:
    """The cases, and that of a file."""
    return (*cases, Case(**runpy.run_path(file)["CASE"])) if file else cases


EVERY = with_that_of(os.environ.get("READING"))
