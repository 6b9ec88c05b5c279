"""How far a calibration by a camera is off at other poses, and how often what it states holds.

Machines with errors of 0.3 mm are seen by a camera of 2448 x 2048 pixels, 12 mm and 0.1 px of noise
on a board of 10 x 5 corners: from beside the machine, or from its platform. Some read their
actuators with an error of 10 µm that a picture shares; some see markers or points in place of the
board; of some the lens is found, or stated with its covariance; some boards are larger than stated
or have corners elsewhere, and "doubted" counts the verdicts. "Elsewhere" are 40 other poses,
compared after the best motions of base and platform: what no camera without a datum tells is not
counted.

    python -m benchmarks.bench_camera [RUNS [SCENARIO ...]]
    python -m benchmarks.bench_camera time

"time" prints what 5000 corners in 100 pictures take of a processor: finding where each picture has
the board, one evaluation with derivatives, the search for 42 numbers and the frames, and all of
`identify`.
"""

from __future__ import annotations

import sys
import time
import warnings
from dataclasses import dataclass, replace
from typing import Any, Literal, NamedTuple

import numpy as np

import pkmcal as pk
from pkmcal.arrays import FloatArray, IntArray
from pkmcal.estimation.compression import CompressedPrediction
from pkmcal.estimation.estimator import Estimator
from pkmcal.jobs.planned_camera import looking
from pkmcal.readings import Board, Camera
from pkmcal.readings.board_poses import unbent

LENS = {
    "fx": 3478.0, "fy": 3478.0, "cx": 1223.5, "cy": 1023.5,
    "k1": -0.10, "k2": 0.08, "p1": 4e-4, "p2": -3e-4, "k3": -0.02, "width": 2448, "height": 2048,
}  # fmt: skip
NOISE, ELSEWHERE = 0.1, 40  # px; poses
DRAWN_BY = {"mm": 0.3, "rad": 1e-3, "1": 1e-4}  # errors of machines, by unit
_FEWEST = 30  # of the poses elsewhere that machine and drawing both have to reach
_TIMED = 7  # runs, of which the quickest counts
_DRAWN = 20  # poses a picture, of which those are taken that show the whole board
JOINTS = ("base*", "platform*", "offset*")
LENS_SIGMA = (5.0, 5.0, 3.0, 3.0, 4e-3, 2e-2, 2e-4, 2e-4, 0.0)  # of lenses that are stated so
STRAIGHT = dict.fromkeys(("k1", "k2", "p1", "p2", "k3"), 0.0)
Seen = Literal["board", "markers", "points"]
SPREAD = 90.0  # mm from the middle of the platform to markers and points


@dataclass(frozen=True)
class Scenario:
    """A machine, a camera and how it looks.

    Attributes
    ----------
    pictures : int
        How many are taken.
    machine : str
        Which.
    free : sequence of str
        What is looked for.
    eye, at : (3,) tuple
        Where a camera stands, and a point in the middle of its pictures, mm. A camera that rides
        looks at a board 700 mm above that point.
    pitch : float
        Between corners, mm.
    share : float
        Of the workspace that poses are in.
    actuators : float
        Standard deviation of what actuators are off in a picture, mm.
    lens : str
        What of the lens is found as well; "stated": nothing, but the lens is off by what its
        covariance says.
    on : str
        What the camera is on.
    seen : str
        One board, four markers whose places are unknown, or four points, of two cameras.
    rectified : bool
        Whether pixels are those of pictures whose distortion was undone.
    larger, strewn : float
        Standard deviations by which a board is larger than stated, a share, and by which each of
        its corners is elsewhere in its plane, mm.
    size_sigma : float
        What is stated of the size.
    """

    pictures: int = 30
    machine: str = "hexapod"
    free: tuple[str, ...] = JOINTS
    eye: tuple[float, float, float] = (500, -600, 2000)
    at: tuple[float, float, float] = (0, 0, 800)
    pitch: float = 20.0
    share: float = 0.3
    actuators: float = 0.0
    lens: Literal["none", "focal", "all", "stated"] = "none"
    on: Literal["base", "platform"] = "base"
    seen: Seen = "board"
    rectified: bool = False
    larger: float = 0.0
    strewn: float = 0.0
    size_sigma: float = 0.0


DELTA = Scenario(
    machine="linear-delta", free=(*JOINTS, "rod*", "slider*"), eye=(150, -200, 500), at=(0, 0, 60),
    pitch=6, share=0.9,
)  # fmt: skip
SCENARIOS = {
    "hexapod, 15 pictures": Scenario(15),
    "hexapod": Scenario(),
    "hexapod, 100 pictures": Scenario(100),
    "hexapod, focal lengths free": Scenario(lens="focal"),
    "hexapod, camera rides": Scenario(on="platform"),
    "hexapod, legs of 10 um": Scenario(actuators=0.01),
    "linear delta": DELTA,
    "3-RPS": Scenario(
        machine="3rps", free=(*JOINTS, "normal*"), eye=(500, -500, 3000), at=(0, 0, 1800), share=0.5
    ),
    "hexapod, lens found": Scenario(lens="all"),
    "hexapod, lens with covariance": Scenario(lens="stated"),
    "hexapod, rectified pictures": Scenario(rectified=True),
    "hexapod, board 0.05 % off": Scenario(larger=5e-4),
    "hexapod, board 0.05 % off, said": Scenario(larger=5e-4, size_sigma=5e-4),
    "hexapod, corners 0.05 mm off": Scenario(strewn=0.05),
    "hexapod, four markers": Scenario(seen="markers"),
    "hexapod, four points": Scenario(seen="points"),
    "3-PRS, whole": Scenario(
        machine="3prs",
        free=(*JOINTS, "rod*", "slider*", "normal*"),
        eye=(400, -400, 1700),
        at=(0, 0, 750),
        pitch=12,
        share=0.6,
    ),
}


class Tally(NamedTuple):
    """Of one calibration: rms off and stated elsewhere, mm; share inside ±; what it took; verdict."""

    off: float
    stated: float
    inside: float
    actuators: float
    seconds: float
    doubted: bool


def instruments(scenario: Scenario) -> list[tuple[Camera, Board]]:
    """Each camera, mounted, with each thing it sees."""
    grid = Board.chessboard(10, 5, scenario.pitch)
    board = Board.points(grid.ids.tolist(), grid.places - grid.places.mean(axis=0))
    eye, at = np.array(scenario.eye), np.array(scenario.at)
    stands = pk.screw.to_pose(looking(eye, at))
    carried: tuple[float, ...] = (10, -15, 20, np.pi + 0.03, -0.02, 0.3)
    if scenario.on == "platform":
        x, y, z = scenario.at
        board_at = pk.screw.from_pose(np.array([x + 40, y - 30, z + 700, 0.05, -0.04, 0.2]))
        stands, carried = pk.screw.to_pose(np.linalg.inv(board_at)), (20, -10, 30, 0.02, -0.03, 0.4)
    found = "none" if scenario.lens == "stated" else scenario.lens
    camera = Camera(**LENS, on=scenario.on, lens=found, stands=stands, carried=carried)  # type: ignore[arg-type]
    if scenario.seen == "board":
        return [(camera, board)]
    markers = scenario.seen == "markers"
    each = Board.apriltags(1, 1, 50, 10) if markers else Board.points([0], np.zeros((1, 3)))
    cameras = {"": camera}
    if not markers:
        other = pk.screw.to_pose(looking(eye * [-1, 0.3, 1], at))
        cameras = {"left": camera, "right": replace(camera, stands=other)}
    turns = np.pi * (0.25 + 0.5 * np.arange(4))
    return [
        (
            replace(
                one, camera_name=name, board_name=f"m{i + 1}",
                carried=(
                    SPREAD * np.cos(turn), SPREAD * np.sin(turn), 15.0 + 8.0 * i,
                    np.pi + 0.1 * np.cos(turn), 0.1 * np.sin(turn), 0.3 * i,
                ),
            ),
            each,
        )
        for name, one in cameras.items()
        for i, turn in enumerate(turns)
    ]  # fmt: skip


def measured(
    scenario: Scenario, random: np.random.Generator
) -> tuple[pk.Robot, list[pk.Measurements]] | None:
    """A machine with errors and its pictures, those that show everything; None: broken."""
    robot = pk.load(scenario.machine)
    geometry = robot.geometry
    units = dict(zip(geometry.names, geometry.units, strict=True))
    unit = {n: DRAWN_BY[units[n]] for n in geometry.match(scenario.free)}
    true = robot.replace({n: geometry[n] + random.normal(0.0, s) for n, s in unit.items()})
    poses = pk.sample_poses(robot, _DRAWN * scenario.pictures, seed=0, share=scenario.share)
    q = robot.inverse(poses)
    at = q + random.normal(0.0, 1.0, q.shape) * scenario.actuators
    machine = pk.VirtualMachine(true, NOISE, int(random.integers(2**31)))
    sets, whole = [], np.ones(len(q), dtype=bool)
    for camera, board in instruments(scenario):
        seen = machine.measure(*camera.seeing(at, board))
        whole &= np.isfinite(seen.values).all(axis=1).reshape(len(q), -1).all(axis=1)
        sets.append(seen)
    taken = np.flatnonzero(whole)[: scenario.pictures]
    if len(taken) < scenario.pictures:
        return None
    return true, [_pictures(scenario, seen, q, taken, random) for seen in sets]


def _pictures(
    scenario: Scenario, seen: pk.Measurements, q: FloatArray, taken: IntArray,
    random: np.random.Generator,
) -> pk.Measurements:  # fmt: skip
    """Those that are taken, with the lens as it is stated."""
    corners = len(seen) // len(q)
    own = seen.select((taken[:, None] * corners + np.arange(corners)).ravel())
    camera, values = own.instrument, own.values
    if scenario.rectified:
        lens = camera.lens_numbers()
        values = unbent(values, np.tile(lens, (len(values), 1))) * lens[:2] + lens[2:4]
        camera = replace(camera, **STRAIGHT)
    if scenario.lens == "stated":
        off = zip(camera.lens_numbers() + random.normal(0.0, LENS_SIGMA), LENS, strict=False)
        camera = replace(camera, **{n: each for each, n in off}, lens_sigma=LENS_SIGMA)
    if scenario.larger or scenario.strewn:
        off = random.normal(0.0, scenario.strewn, (corners, 3)) * [1.0, 1.0, 0.0]
        places = np.asarray(camera.corner) / (1.0 + random.normal(0.0, scenario.larger))
        camera = replace(camera, corner=places + np.tile(off, (len(taken), 1)))
    camera = replace(camera, size_sigma=scenario.size_sigma)
    return pk.Measurements(
        np.repeat(q[taken], corners, axis=0), values, camera,
        group=np.repeat(np.arange(len(taken)), corners),
    )  # fmt: skip


def elsewhere(
    scenario: Scenario, true: pk.Robot, found: pk.Identification
) -> tuple[FloatArray, FloatArray] | None:
    """What places (40, 3) are off and their standard deviations, after the best motions.

    The true machine is moved onto the one that was found, in whose axes the deviations are: of a
    machine whose frames pictures hardly tell the two stand centimetres apart.
    """
    poses = pk.sample_poses(true, ELSEWHERE, seed=77, share=scenario.share)
    q = pk.load(scenario.machine).inverse(poses)
    right, mine = true.forward(q).pose, found.robot.forward(q).pose
    reached = np.isfinite(right).all(axis=1) & np.isfinite(mine).all(axis=1)
    if reached.sum() < _FEWEST:
        return None
    q, right, mine = q[reached], right[reached], mine[reached]
    names = list(found.robot.geometry.names)
    of = [i for i, name in enumerate(found.free) if name in names]
    rates = found.robot.error_twists(mine, q)[:, :, [names.index(found.free[i]) for i in of]]
    weights = np.repeat([found.robot.length, 1.0], 3)
    at, wanted = pk.screw.from_pose(right), pk.screw.from_pose(mine)
    for _ in range(5):
        off, motions = _differences(at, wanted, weights)
        left, size, _ = directions = np.linalg.svd(motions, full_matrices=False)
        told = size > 1e-9 * size[0]
        left = left[:, told]
        step = -(directions[2][told].T @ ((left.T @ off.ravel()) / size[told]))
        at = pk.screw.exp(step[:6]) @ at @ pk.screw.exp(step[6:])
    off = off.ravel() - left @ (left.T @ off.ravel())
    rates = (rates * weights[:, None]).reshape(len(off), -1)
    rates -= left @ (left.T @ rates)
    variance = np.einsum("ij,jk,ik->i", rates, found.covariance[np.ix_(of, of)], rates)
    return off.reshape(-1, 6)[:, 3:], np.sqrt(variance).reshape(-1, 6)[:, 3:]


def _differences(
    at: FloatArray, wanted: FloatArray, weights: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Twists (n, 6) at the platform from `wanted`, and by motions of base and platform (6 n, 12)."""
    turned = at[:, :3, :3] @ wanted[:, :3, :3].transpose(0, 2, 1)
    axis = np.stack(
        [turned[:, i, j] - turned[:, j, i] for i, j in ((2, 1), (0, 2), (1, 0))], axis=1
    )
    off = np.hstack([0.5 * axis, at[:, :3, 3] - wanted[:, :3, 3]]) * weights
    motions = np.zeros((len(at), 6, 12))
    motions[:, :3, :3] = motions[:, 3:, 3:6] = np.eye(3)
    motions[:, 3:, :3] = -np.cross(at[:, :3, 3, None], np.eye(3)[None], axisa=1, axisb=1, axisc=1)
    motions[:, :3, 6:9] = motions[:, 3:, 9:] = at[:, :3, :3]
    return off, (motions * weights[:, None]).reshape(-1, 12)


def run(scenario: Scenario, seed: int) -> Tally | None:
    """One machine; None where poses are out of its reach."""
    drawn = measured(scenario, np.random.default_rng(seed))
    if drawn is None:
        return None
    true, pictures = drawn
    start = time.process_time()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = pk.identify(pk.load(scenario.machine), pictures, scenario.free, fix="datum")
    seconds = time.process_time() - start
    compared = elsewhere(scenario, true, found)
    if compared is None:
        return None
    off, sd = compared
    rms, stated = (float(np.sqrt((each**2).sum(axis=1).mean())) for each in (off, sd))
    inside = float((np.abs(off) < 1.96 * sd).mean())
    doubted = found.verdict.state != "calibrated"
    return Tally(rms, stated, inside, float(found.actuator_noise), seconds, doubted)


def took() -> None:
    """Print the least processor time of several runs, ms: of evaluations, a search, a calibration."""
    scenario = SCENARIOS["hexapod, 100 pictures"]
    drawn = measured(scenario, np.random.default_rng(3))
    assert drawn is not None
    robot, (pictures,) = pk.load(scenario.machine), drawn[1]
    for name, sigma in (("exact actuators", np.zeros(6)), ("their scatter estimated", None)):
        least = dict[str, float]()
        for _ in range(_TIMED):
            timed, start = Timed(), time.process_time()
            with timed, warnings.catch_warnings():
                warnings.simplefilter("ignore")
                pk.identify(
                    robot, replace(pictures, actuator_sigma=sigma), scenario.free, fix="datum"
                )
            whole = {**timed.mean(), "identify": time.process_time() - start}
            least = {each: min(took, least.get(each, took)) for each, took in whole.items()}
        print(f"{name}: " + ", ".join(f"{each} {1e3 * ms:.2f} ms" for each, ms in least.items()))


class Timed:
    """Processor time of evaluations and searches while it is entered."""

    watched = (
        (Camera, "places_seen", "places of the pictures"),
        (CompressedPrediction, "of_set", "evaluation"),
        (Estimator, "best", "search"),
    )

    def __enter__(self) -> None:
        self.spent: dict[str, list[float]] = {name: [] for *_, name in self.watched}
        self.before = [getattr(kind, method) for kind, method, _ in self.watched]
        for (kind, method, name), function in zip(self.watched, self.before, strict=True):
            setattr(kind, method, self._timing(function, self.spent[name]))

    def __exit__(self, *_: object) -> None:
        for (kind, method, _name), function in zip(self.watched, self.before, strict=True):
            setattr(kind, method, function)

    @staticmethod
    def _timing(function: Any, spent: list[float]) -> Any:
        def called(*arguments: Any) -> Any:
            start = time.process_time()
            found = function(*arguments)
            spent.append(time.process_time() - start)
            return found

        return called

    def mean(self) -> dict[str, float]:
        """Seconds of one of each."""
        return {name: float(np.mean(each)) for name, each in self.spent.items() if each}


def main(words: list[str]) -> None:
    """Print a line a scenario."""
    if words == ["time"]:
        return took()
    count = int(words[0]) if words else 20
    for name in words[1:] or SCENARIOS:
        tried = [run(SCENARIOS[name], seed) for seed in range(count)]
        done = [each for each in tried if each is not None]
        off, stated, inside, actuators, seconds, doubted = np.array(done, dtype=np.float64).T
        error, promise = np.sqrt(np.mean(off**2)), np.sqrt(np.mean(stated**2))
        print(
            f"{name:30s} {len(done):3d} of {count} runs: off {error:.4f} mm, stated {promise:.4f},"
            f" off/stated {error / promise:.2f}, inside {100 * inside.mean():.1f} %, actuators"
            f" {np.median(actuators):.4f} mm, {np.median(seconds):.1f} s, doubted {doubted.sum():.0f}",
            flush=True,
        )


if __name__ == "__main__":
    main(sys.argv[1:])
