"""A camera that sees a board: the pixels of its corners, two numbers each.

The camera stands and the board is on the platform, or the camera is on the platform and the board
stands. Either way what is seen follows from one chain, that of a pose reading: F P T, the base in
the frame of what stands, the platform's pose, what is mounted on the platform. Neither F nor T is
ever known; both are found.

A picture of many corners tells the pose better than the actuators set it: what drives and joints
scatter is then no noise of the corners, and is estimated beside it (`tells_actuators`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from typing import Any, ClassVar, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from pkmcal.arguments import instance, number, whole, word
from pkmcal.arrays import FloatArray, IntArray, as_rows, first_of_equal
from pkmcal.core import instruments, screws
from pkmcal.core.poses import NOWHERE, compose
from pkmcal.display import printable
from pkmcal.exceptions import ArgumentError
from pkmcal.files.csv_table import Table
from pkmcal.readings import rows, twists
from pkmcal.readings.alignment import Laid, Sighting, frame_of_poses
from pkmcal.readings.board_poses import mm_per_pixel, pictures_told
from pkmcal.readings.boards import Board
from pkmcal.readings.dependences import always
from pkmcal.readings.lens import (
    FOUND,
    LENS,
    Found,
    covariance_of_lens,
    numbers_of_lens,
    size_of_pictures,
)
from pkmcal.readings.lens_doubts import lens_doubts, pixels_outside
from pkmcal.readings.lens_files import read_lens, write_lens
from pkmcal.readings.measured import InFit, Measured
from pkmcal.readings.pictures import Picture, of_pictures_that_are_fitted, pictures
from pkmcal.readings.predicted import At, Lots, Predicted, Shared
from pkmcal.readings.reading import HeldNumbers, Reading, Sets, ShownPoints, Solve
from pkmcal.readings.seen_places import places_of_markers, tool_places
from pkmcal.readings.sight import visible
from pkmcal.readings.unknowns import PLACE, Dependence, Nature, Numbers, Start
from pkmcal.readings.unknowns import Found as Starts

Mount = Literal["base", "platform"]
_NO_SIZE = np.zeros(1)
_LARGEST = 0.1  # share by which a board's size may be stated to be unknown


def _dotted(*words: str) -> str:
    """Words that are not empty, with dots between."""
    return ".".join(filter(None, words))


def _names(m: Measured, rows_: IntArray) -> list[str]:
    """What messages call the pictures of rows (P,)."""
    if m.pose_name is not None:
        return [printable(m.pose_name[i]) for i in rows_.tolist()]
    return [f"that of row {i}" if m.group is None else str(m.group[i]) for i in rows_.tolist()]


@dataclass(frozen=True, eq=False)
class Camera(Reading):
    """Pixels of the corners of a board, a row for each corner: u right, v down.

    (0, 0) is the centre of the first pixel. Rows of one `group` are of one picture, or where none
    is stated rows at the same actuators.

    Attributes
    ----------
    corner : (3,) or (N, 3) array
        The corner of each row in axes of its board, mm; see `Board.at`.
    outward : (3,) or (N, 3) array, optional
        Of corners of tags, in axes of the board, the way from the middle of their tag; see
        `Board.outward_at`. Detectors put such corners out or in alike, which is then tested.
    on : {"base", "platform"}
        What the camera is fixed to; the board is on the other. On the base the unknown ``frame`` is
        the base in axes of the camera (z forward, x right, y down), ``tool`` the board on the
        platform; on the platform ``frame`` is the base in axes of the board, ``tool`` the camera.
    fx, fy, cx, cy : float
        Focal lengths and principal point, px.
    k1, k2, p1, p2, k3 : float
        Distortion, as OpenCV has it.
    width, height : int
        Of the pictures, px; 0: not known. A simulated camera sees nothing beyond them, nothing of a
        board that it sees at more than 60° or from behind.
    lens : {"none", "focal", "all"}
        What of the lens is to be found beside the machine, from these values on: "focal" is fx fy
        cx cy, "all" k1 k2 p1 p2 as well: ``lens.fx`` …. State a prior where it is known roughly.
    lens_sigma : (9,) or (9, 9) array, optional
        Standard deviations of the nine numbers, or their covariance, where the lens was calibrated
        before: it is then fitted along within these, where `lens` finds nothing of it.
    find_size : bool
        Whether the board may be larger than stated, by ``board.size`` (0.001: by 0.1 %).
    size_sigma : float
        Standard deviation of that share, where the board was measured or its printer is known
        (0.0005: 0.25 mm of 500): it is then fitted along within it, and all ± contain it.
    camera_name, board_name : str
        Which they are, where a calibration has several: the unknowns then are ``frame.left.x`` …,
        ``tool.board.plate.x`` …, ``lens.left.fx`` … and ``board.plate.size`` of the camera "left"
        and the board "plate". Each camera and board has measurements of its own; of a file with
        columns ``camera`` and ``board`` their rows are read.
    distance : float
        About how far what it sees is, mm, where no picture tells that, as of single markers: by it
        pixels are shown in mm. 0: as the machine's poses are apart.
    stands, carried : (6,) array
        Of a simulated camera: the true ``frame`` and ``tool``.

    Examples
    --------
    >>> import numpy as np
    >>> import pkmcal as pk
    >>> robot = pk.load("hexapod")
    >>> board = pk.readings.Board.chessboard(5, 4, square=30)
    >>> stands = [0, 0, 2500, np.pi, 0, 0]  # it looks down
    >>> carried = [0, 0, 0, np.pi, 0, 0]  # the board looks up
    >>> camera = pk.readings.Camera(
    ...     fx=3000, fy=3000, cx=1200, cy=1000, stands=stands, carried=carried
    ... )
    >>> q, seeing = camera.seeing(robot.inverse([[0, 0, 850, 0, 0, 0]]), board)
    >>> pk.VirtualMachine(robot, 0.0).measure(q, seeing).values[0].round(3)
    array([1200., 1000.])
    """

    corner: ArrayLike | None = None
    outward: ArrayLike | None = None
    on: Mount = "base"
    fx: float = 0.0
    fy: float = 0.0
    cx: float = 0.0
    cy: float = 0.0
    k1: float = 0.0
    k2: float = 0.0
    p1: float = 0.0
    p2: float = 0.0
    k3: float = 0.0
    width: int = 0
    height: int = 0
    lens: Found = "none"
    find_size: bool = False
    size_sigma: float = 0.0
    lens_sigma: ArrayLike | None = None
    board: Board | None = None
    camera_name: str = ""
    board_name: str = ""
    distance: float = 0.0
    stands: ArrayLike = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    carried: ArrayLike = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)

    name = "pixel"
    components = (("u", "px"), ("v", "px"))
    framed = True
    placed: ClassVar[bool] = False
    tells_actuators: ClassVar[bool] = True
    scaled_by: ClassVar[str] = "board"
    unknown_with_target = ("tool",)
    told_apart_by = "name the camera, or the board that stands (camera_name, board_name)"
    stated_by: ClassVar[Mapping[str, str]] = {
        "board*size": "size_sigma (--size-sigma) is the prior of a board's size, which is then"
        " fitted along, and find_size=True (--find-size) finds it from nothing: state one of both",
        "lens*": "lens_sigma, or deviations in the lens file, is the prior of a lens, which is then"
        " fitted along, and lens='focal' or 'all' (--lens) finds it: state one of both",
        "scale": "the board is the length that a camera sees: size_sigma (--size-sigma) states how"
        " well its size is known",
    }
    frame_order: ClassVar[int] = 5
    held = (
        HeldNumbers(
            "another focal length or middle of the lens",
            "--lens focal (lens='focal'), or calibrate the camera as it is, pictures this way up",
            "lens", (0, 1, 2, 3),
        ),
        HeldNumbers(
            "another distortion of the lens",
            "--lens all (lens='all'), or calibrate the camera as it is, pictures this way up",
            "lens", (4, 5, 6, 7),
        ),
        HeldNumbers(
            "a board of another size",
            "measure it, and --size-sigma (size_sigma=) or --find-size (find_size=True)",
            "size", (0,),
        ),
        HeldNumbers(
            "a detector that puts corners of tags further out, or in, than they are",
            "another way of refining corners, or a board of squares (charuco, chessboard)",
            "outward", (0,),
        ),
    )  # fmt: skip
    by_rows = ("lens", "size")
    own_points = ("corner", "outward")
    truth = ("stands", "carried")
    stated = ("board",)

    @staticmethod
    def from_file(path: str | PathLike[str], **others: Any) -> Camera:
        """The camera of a lens file: YAML or JSON of OpenCV, or ``camera_info`` of ROS.

        Parameters
        ----------
        path : str or path
            The file.
        **others
            Other attributes.

        Raises
        ------
        ValueError
            Not such a file, or a lens that nine numbers do not describe.
        """
        return Camera(**{**read_lens(path), **others})

    @property
    def file_name(self) -> str:
        """The name of the file that `write` makes of it, by the names of camera and board."""
        return "-".join(filter(None, ("camera", self.camera_name, self.board_name))) + ".yaml"

    def write(self, path: str | PathLike[str], comment: str = "") -> None:
        """Write lens and `motions` as a lens file, which OpenCV and `from_file` read.

        Parameters
        ----------
        path : str or path
            The file.
        comment : str
            Lines for its head, each with its ``#``.
        """
        size = self.width, self.height
        write_lens(path, self.lens_numbers(), size, self.motions, comment)

    def drawn(self) -> dict[str, Any]:
        """Tell a page where camera and board are, what the lens is and how large its pictures."""
        stands, carried = self.motions.values()
        places = [
            {"R": motion[:3, :3].ravel().tolist(), "p": motion[:3, 3].tolist()}
            for motion in (np.linalg.inv(stands), carried)
        ]
        corner = np.atleast_2d(np.asarray(self.corner, dtype=np.float64))
        (left, top, low), (right, bottom, high) = corner.min(axis=0), corner.max(axis=0)
        depth = 0.5 * float(low + high)
        lens = self.lens_numbers()
        camera, board = places if self.on == "base" else places[::-1]
        return {
            "name": self.camera_name or "camera",
            "rides": self.on == "platform",
            "camera": camera,
            "board": board,
            "corners": [
                [float(x), float(y), depth]
                for x, y in ((left, top), (right, top), (right, bottom), (left, bottom))
            ],
            "lens": lens.tolist(),
            "size": [*size_of_pictures(lens, (self.width, self.height))],
        }

    @property
    def motions(self) -> Mapping[str, FloatArray]:
        """Motions (4, 4), mm, of a camera whose place is known, by the frames they lead between.

        Of a camera on the base ``base_to_camera`` and ``board_to_platform``, of one on the platform
        ``base_to_board`` and ``camera_to_platform``, which others call hand-eye calibration.
        """
        stands = "camera" if self.on == "base" else "board"
        names = f"base_to_{stands}", f"{self._carried}_to_platform"
        places = np.array([self.stands, self.carried], dtype=np.float64)
        return dict(zip(names, screws.frames(places), strict=True))

    def seeing(self, q: ArrayLike, board: Board) -> tuple[FloatArray, Camera]:
        """Actuators (N, n) and the camera for pictures that show a whole board.

        Parameters
        ----------
        q : (P, n) array
            Actuators of each picture, mm or rad.
        board : Board
            What it sees there.
        """
        pictures = np.atleast_2d(rows.numbers("q", q))
        count = len(board.ids)
        every = np.tile(board.ids, len(pictures))
        return np.repeat(pictures, count, axis=0), self._before(board, every)

    def _before(self, board: Board, ids: IntArray) -> Camera:
        """The camera before corners (N,) of a board."""
        return self.with_fields({"corner": board.at(ids), "outward": board.outward_at(ids)})

    def of_poses(self, q: FloatArray) -> tuple[FloatArray, Camera]:
        """A picture at each: rows of all corners of its board, where they are not stated."""
        if self.board is None or self.corner is not None:
            return q, self
        rows_, seeing = self.seeing(q, self.board)
        return rows_, seeing.with_fields({"board": None})

    def required(self, q: FloatArray) -> tuple[FloatArray, Camera]:
        """What is printed has to be in the picture whole, or detectors miss its outer corners."""
        if self.board is None or self.corner is not None:
            return q, self
        seen = self.board.outline
        return self.seeing(q, Board.points(range(len(seen)), seen))

    # the model ------------------------------------------------------------------------------------

    @property
    def frame_name(self) -> str:
        """The name of what stands."""
        return self.camera_name if self.on == "base" else self.board_name

    @property
    def shown_points(self) -> ShownPoints:
        """The corners."""
        places = np.asarray(self.corner, dtype=np.float64)
        return ShownPoints(places, self.on == "platform", "corners of the board")

    @property
    def stands_by(self) -> str:
        """The camera or the board."""
        return "board" if self._carried == "camera" else "camera"

    def frame(self, seen: Sighting) -> Laid:
        """The frame in which the tool is where pictures show it."""
        return frame_of_poses(seen)

    def predict(self, at: At, **numbers: FloatArray) -> Predicted:
        """Pixels of corners with a board, or camera, at `tool` (N, 6) from `tool_origin` (N, 6)."""
        places = [at.pose, *(numbers[name] for name in ("tool_origin", "tool") if name in numbers)]
        shape = len(at.pose), 6
        first = first_of_equal(np.hstack([np.broadcast_to(each, shape) for each in places]))
        of = np.repeat(np.arange(len(first)), np.diff(first, append=len(at.pose)))
        return self.shared(at, Lots(of, first), **numbers).of_rows()

    def lots(self, m: Measured) -> IntArray:
        """Rows in lots, one for each picture."""
        return self._pictures(m)

    def not_apart(self, m: Measured, fitted: Measured) -> str:
        """Corners of a picture are not apart from its other ones."""
        return of_pictures_that_are_fitted(
            m.actuators, self._corners(len(m)),
            fitted.actuators, fitted.instrument._corners(len(fitted)),
        )  # fmt: skip

    def shared(
        self,
        at: At,
        lots: Lots,
        tool: FloatArray = NOWHERE,
        tool_origin: FloatArray = NOWHERE,
        corner: FloatArray | None = None,
        lens: FloatArray | None = None,
        size: FloatArray = _NO_SIZE,
        **numbers: FloatArray,
    ) -> Shared:
        """Return `predict` through the motion of each picture's board before the camera."""
        count = len(at.pose)
        frame = NOWHERE if at.frame is None else at.frame
        pose, origin, within = (
            np.ascontiguousarray(np.broadcast_to(each, (count, 6))[lots.first])
            for each in (at.pose, tool_origin, tool)
        )
        outer, near = screws.frames(np.stack([at.origin, frame]))
        base = outer @ near
        to_mounting = base @ screws.frames(pose) @ screws.frames(origin)
        board, to_board = to_mounting @ screws.frames(within), None
        if self.on == "platform":
            board = np.linalg.inv(board)
            to_board = -twists.adjoint(board)
        seen, by_motion, by_lens, by_size, depth = instruments.pixels(
            screws.pose(np.ascontiguousarray(board).reshape(-1, 16))[lots.of],
            self._corners(count) if corner is None else corner,
            self.lens_numbers() if lens is None else lens,
            size,
        )
        seen[~(depth > 0)] = np.nan
        own = {"lens": by_lens, "size": by_size[:, :, None]}
        if self.outward is not None:
            out = np.broadcast_to(np.asarray(self.outward, dtype=np.float64), (count, 3))
            moved = by_motion[:, :, 3:] @ (board[lots.of, :3, :3] @ out[:, :, None])
            length = np.linalg.norm(moved, axis=1, keepdims=True)
            own["outward"] = moved / np.where(length > 0.0, length, 1.0)  # px
        of_pose = twists.adjoint(base[None]) @ twists.at_base(pose)
        of_tool = twists.adjoint(to_mounting) @ twists.twists_of_numbers(within)
        of_frame = None
        if at.frame is not None:
            of_frame = twists.adjoint(outer[None]) @ twists.twists_of_numbers(at.frame[None])
            of_frame = np.broadcast_to(of_frame, of_pose.shape)
        if to_board is not None:
            of_pose, of_tool = to_board @ of_pose, to_board @ of_tool
            of_frame = None if of_frame is None else to_board @ of_frame
        return Shared(
            seen,
            lots,
            by_motion,
            of_pose,
            {"tool": of_tool},
            own,
            of_frame,
        )

    def dependences(self, data: InFit) -> Iterator[Dependence]:
        """Return what is on the platform, the lens, and the size of the board."""
        m = data.measured
        count, every = len(m), np.zeros(len(m), dtype=np.intp)
        things = [self._carried_thing] * count
        nature = Nature("platform", pose=True)
        yield always("tool", "tool", PLACE, things, data.starts, nature=nature)
        yield Dependence("corner", "corner", self._corners(count), {}, every)
        lens = np.tile(self.lens_numbers(), (count, 1))
        known = None if self.lens != "none" else self._lens_known()
        slots = FOUND[self.lens] if known is None else np.flatnonzero(np.diagonal(known)).tolist()
        found = {self.camera_name: self._lens_found(m, slots, known)} if slots else {}
        role = "lens" if known is None else "lens as stated"
        yield Dependence("lens", role, lens, found, every, Nature(alone=True))
        if self.find_size or self.size_sigma:
            extent = float(np.abs(self._corners(count)).max(initial=1.0))
            own = Numbers(
                (_dotted("board", self.board_name, "size"),), ("1",),
                np.zeros(1, dtype=np.intp), np.zeros(1), np.array([1.0 / extent]),
                None if self.find_size else np.array([[float(self.size_sigma) ** 2]]),
            )  # fmt: skip
            role = "size" if self.find_size else "size as stated"
            sizes = {self.board_name: own}
            yield Dependence("size", role, np.zeros((count, 1)), sizes, every)

    def as_found(self, numbers: Mapping[str, float]) -> Camera:
        """The camera where it is, with its lens, before a board of its size."""

        def place(stem: str) -> FloatArray:
            return np.array([numbers[f"{stem}.{axis}"] for axis, _ in PLACE])

        stem = _dotted("lens", self.camera_name)
        lens = {name: numbers.get(f"{stem}.{name}", getattr(self, name)) for name in LENS}
        size = 1.0 + numbers.get(_dotted("board", self.board_name, "size"), 0.0)
        found: dict[str, Any] = {
            "lens": "none",
            "lens_sigma": None,
            "find_size": False,
            "size_sigma": 0.0,
            "stands": place(_dotted("frame", self.frame_name)),
            "carried": place(_dotted("tool", self._carried_thing)),
        }
        if self.corner is not None:
            found["corner"] = np.asarray(self.corner, dtype=np.float64) * size
        return self.with_fields(found | lens)

    def pictures(self, m: Measured, pose: FloatArray, off: FloatArray) -> list[Picture]:
        """Tell where each picture shows the board, and where the machine says that it is."""
        lots = Lots(np.arange(len(pose)), np.arange(len(pose)))
        at = At(pose, frame=np.asarray(self.stands, dtype=np.float64))
        shared = self.shared(at, lots, tool=np.asarray(self.carried, dtype=np.float64))
        motion, corner = self._boards(pose), self._corners(len(m))
        return pictures(self._pictures(m), motion, corner, shared.by_motion, off, self.fx)

    def _boards(self, pose: FloatArray) -> FloatArray:
        """Boards (N, 4, 4) in axes of a camera whose place is known."""
        stands, carried = self.motions.values()
        board: FloatArray = stands @ screws.frames(np.ascontiguousarray(pose)) @ carried
        return board if self.on == "base" else np.asarray(np.linalg.inv(board), dtype=np.float64)

    def starts(self, machine: Any, sets: Sets, found: Starts) -> None:
        """Start at the platform; `places_seen` finds the place together with the frame."""
        for data, _ in sets:
            thing = data.measured.instrument._carried_thing
            found["tool", thing] = Start(tuple(range(6)), np.zeros(6))

    def places_seen(self, m: Measured, pose: FloatArray) -> FloatArray:
        """Pose (N, 6) of the tool in the frame, by the whole picture of each of its first rows.

        Of both places at which a small flat board looks alike that of which several pictures and
        the machine's poses (N, 6) agree; NaN in all other rows. Of markers that are one point each
        all pictures together tell where the camera is, as if they were at the platform's origin.
        """
        used, number = self._pictures_told(m)
        if not len(used):
            corner, lens, rides = self._corners(len(m)), self.lens_numbers(), self.on == "platform"
            return places_of_markers(corner, m.values, lens, rides, pose, self._called(m))
        seen = self._corners(len(m))[used], m.values[used], number
        first = np.unique(number, return_index=True)[1]
        shown = used[first]
        places = tool_places(
            *seen, self.lens_numbers(), self.on == "platform", pose[shown], _names(m, shown)
        )
        found = np.full((len(m), 6), np.nan)
        found[shown] = places
        return found

    def _called(self, m: Measured) -> str:
        """What messages call these measurements among those of other cameras and boards."""
        named = {"camera": self.camera_name, "board": self.board_name}
        which = " and ".join(f"{what} {printable(name)!r}" for what, name in named.items() if name)
        if not which:
            return "measurements"
        count = int(np.isfinite(m.values).all(axis=1).sum())
        return f"measurements of {which}, {count} row{'s' * (count != 1)}"

    def doubts(self, m: Measured) -> Iterator[str]:
        """Pixels outside of pictures, lenses of other pictures, boards seen from behind."""
        used, number = self._pictures_told(m)
        size = self.width, self.height
        yield from pixels_outside(m.values, size)
        if not len(used) or self.lens != "none":
            return
        corner = self._corners(len(m))[used]
        yield from lens_doubts(corner, m.values[used], self.lens_numbers(), number, size)

    def _pictures_told(self, m: Measured) -> tuple[IntArray, IntArray]:
        """Rows (n,) of pictures that tell where a board is, and which picture each is of (n,)."""
        return pictures_told(self._corners(len(m)), m.values, self._pictures(m))

    def arguments(self, m: Measured) -> dict[str, FloatArray]:
        """Return the mountings, as a simulation was told."""
        return {"tool": as_rows("carried", self.carried, 6)[0][0]}

    def simulated(self, m: Measured, solve: Solve) -> FloatArray:
        """NaN of corners that the camera does not see: see `sight.visible`."""
        stands = as_rows("stands", self.stands, 6)[0][0]
        at = At(solve(m.actuators, "q").pose, frame=stands)
        seen = self.predict(at, **self.arguments(m)).values
        size = (self.width, self.height)
        seen[
            ~visible(self._boards(at.pose), self._corners(len(m)), seen, self.lens_numbers(), size)
        ] = np.nan
        return seen

    # units ----------------------------------------------------------------------------------------

    def mm(self, m: Measured, length: float) -> FloatArray:
        """A pixel across the line of sight at the board: the median of the pictures (2,).

        Of pictures that do not tell it, at the `distance`, or as far away as the machine is large.
        """
        told = self._told_sizes(m)
        focal = max(self.fx, self.fy)
        size = float(np.median(told)) if len(told) else (self.distance or length) / focal
        return np.full(2, size)

    def _told_sizes(self, m: Measured) -> FloatArray:
        """The sizes of a pixel, mm, of the pictures that tell it."""
        corner, picture = self._corners(len(m)), self._pictures(m)
        known = np.flatnonzero(np.isfinite(m.values).all(axis=1))
        sizes = mm_per_pixel(corner[known], m.values[known], picture[known])
        told: FloatArray = sizes[np.isfinite(sizes)]
        return told

    def with_sizes(self, m: Measured, poses: Callable[[], FloatArray]) -> Camera:
        """The camera with the `distance` at which poses are apart as its pictures show them."""
        if self.distance or len(self._told_sizes(m)):
            return self
        pose = poses()
        known = np.flatnonzero(np.isfinite(m.values).all(axis=1) & np.isfinite(pose).all(axis=1))
        at = np.column_stack([self._corners(len(m)), np.zeros((len(m), 3))])[known]
        places = compose(np.ascontiguousarray(pose[known]), at)[:, :3]
        if not len(places):
            return self
        (size,) = mm_per_pixel(places, m.values[known], np.zeros(len(known), dtype=np.intp))
        distance = float(size) * max(self.fx, self.fy)
        return self.with_fields({"distance": distance}) if np.isfinite(distance) else self

    # rows -----------------------------------------------------------------------------------------

    def of_rows(
        self, values: Any, actuators: FloatArray, targets: int | None
    ) -> tuple[Camera, ArrayLike | None]:
        """Check lens, mounting and corners."""
        word("on", self.on, get_args(Mount))
        word("lens", self.lens, tuple(FOUND))
        for side in ("width", "height"):
            whole(side, getattr(self, side), 0)
        number("distance", self.distance, least=0.0)
        for name in ("camera_name", "board_name"):
            instance(name, getattr(self, name), str)
        if self.corner is None:
            raise ArgumentError(
                "corner: pixels need the corner that each row shows: its place on the board, as"
                " Board.at has it"
            )
        numbers = rows.numbers("lens", self.lens_numbers())
        if not (numbers[:2] > 0).all():
            raise ArgumentError(
                f"fx and fy must be above 0 px; found {numbers[0]:g} and {numbers[1]:g}: read the"
                " lens file (Camera.from_file), or state about 1.2 times the width of the pictures"
                ' and lens="all"'
            )
        if self.lens_sigma is not None:
            covariance_of_lens(self.lens_sigma)
        self._check_size()
        own, read = super().of_rows(values, actuators, targets)
        return own, read

    def _check_size(self) -> None:
        """Refuse a deviation of the board's size that is none, or beside one that is found."""
        sigma = number("size_sigma", self.size_sigma, least=0.0)
        if sigma > _LARGEST:
            raise ArgumentError(
                "size_sigma: a share of the size of the board, such as 0.001, which"
                f" is 0.1 %, and at most {_LARGEST:g}; found {sigma:g}"
            )
        if sigma and self.find_size:
            raise ArgumentError(
                "size_sigma: find_size=True finds the board's size from nothing; state one of both"
            )

    @property
    def _carried(self) -> Literal["board", "camera"]:
        """The one of camera and board that is on the platform."""
        return "board" if self.on == "base" else "camera"

    @property
    def _carried_thing(self) -> str:
        """The name among tools of what is on the platform."""
        name = self.board_name if self._carried == "board" else self.camera_name
        return _dotted(self._carried, name)

    def _corners(self, count: int) -> FloatArray:
        return np.array(np.broadcast_to(np.asarray(self.corner, dtype=np.float64), (count, 3)))

    def lens_numbers(self) -> FloatArray:
        """The nine numbers (9,), in the order of `LENS`."""
        return np.array([getattr(self, name) for name in LENS], dtype=np.float64)

    def _lens_found(self, m: Measured, slots: Sequence[int], known: FloatArray | None) -> Numbers:
        """Numbers of the lens that are found, or fitted along as they are known (9, 9)."""
        mm, stem = float(self.mm(m, 1000.0)[0]), _dotted("lens", self.camera_name)
        return numbers_of_lens(stem, self.lens_numbers(), tuple(slots), m.values, mm, known)

    def _lens_known(self) -> FloatArray | None:
        """Covariance (9, 9) of the lens; None where it is exact."""
        known = None if self.lens_sigma is None else covariance_of_lens(self.lens_sigma)
        return known if known is not None and known.any() else None

    def _pictures(self, m: Measured) -> IntArray:
        """Return the picture of each row, (N,), counted from 0."""
        if m.group is not None:
            return np.unique(m.group, return_inverse=True)[1].reshape(-1)
        return np.unique(m.actuators, axis=0, return_inverse=True)[1].reshape(-1)

    # tables ---------------------------------------------------------------------------------------

    def rows_of(self, table: Table) -> IntArray | None:
        """Rows of this camera and this board, by columns ``camera`` and ``board``."""
        if not {"u", "v"} <= table.columns.keys():
            return None
        return rows.of_names(table, {"camera": self.camera_name, "board": self.board_name})

    def found_in(self, table: Table) -> list[str]:
        """Return where pixels are found in a table: columns u and v."""
        return ["u, v"] if {"u", "v"} <= table.columns.keys() else []

    def names(self, table: Table) -> set[str]:
        """Pixels, and the numbers of corners."""
        return {"u", "v"} | ({"corner", "camera", "board"} if "u" in table.columns else set())

    def read(self, table: Table, units: Any) -> Camera:
        """Corners by their numbers on the board that is given, where the file has numbers."""
        if "corner" not in table.columns:
            return self
        if self.board is None:
            raise table.header_error(
                "column 'corner': state the board and the lens of the camera, as --camera FILE"
                " --board BOARD (kind=pkmcal.readings.Camera(board=Board.parse(...), ...))"
            )
        ids = table.integers("corner")
        wrong = np.flatnonzero(self.board.strange(ids))
        if len(wrong):
            raise table.cell_error(
                "corner",
                int(wrong[0]),
                f"{self.board.counted}; found {ids[wrong[0]]}: state the board that was printed,"
                " its columns before its rows",
            )
        return self._before(self.board, ids).with_fields({"board": None})
