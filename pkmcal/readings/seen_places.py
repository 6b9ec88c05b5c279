"""Choice between the two places at which a flat board looks alike, by all pictures.

Of the true places M = F P T holds in every picture, with one frame and one tool; mirrored ones
contradict each other. From a few pictures drawn at random, each place chosen by chance, frame and
tool follow in closed form; all others then choose the nearer place. The draw with the least misfit
counts (M. A. Fischler and R. C. Bolles, Random sample consensus, Communications of the ACM 24
(1981) 381-395).
"""

from __future__ import annotations

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, IntArray
from pkmcal.core.poses import compose
from pkmcal.exceptions import ArgumentError
from pkmcal.readings import orientation, twists
from pkmcal.readings.board_poses import board_poses, facing, summed
from pkmcal.readings.hand_eye import of_frame_and_tool

_FEWEST = 4  # pictures, more of which tell that they are mirrored
_OFF, _FALLS = 0.1, 3.0  # rad by which mirrored pictures are off, and how many times less mirrored
_STRANGE = 0.05  # of the extent of a board in a picture, by which its corners are off at most
_MANY = 8  # corners of a picture that says whether it shows the board
_DRAWN = 5  # pictures of a draw
_DRAWS = 60
_ROUNDS = 10  # of choosing and laying in turn
_GROSS = 0.2  # rad, or share of the distance, beyond which a picture is off and no more


def tool_places(
    corner: FloatArray,
    pixel: FloatArray,
    picture: IntArray,
    lens: FloatArray,
    rides: bool,
    pose: FloatArray,
) -> FloatArray:
    """Pose (P, 6) of the tool in the frame of what stands, by each picture.

    Parameters
    ----------
    corner, pixel : ndarray (N, 3), (N, 2)
        Corners in axes of the board, mm, and where they are seen.
    picture : ndarray of int (N,)
        Of each, 0 … P - 1.
    lens : ndarray (9,)
        As in `board_poses`.
    rides : bool
        Whether the camera is the tool, not the board.
    pose : ndarray (P, 6)
        Of the nominal machine.

    Raises
    ------
    ValueError
        The pictures are mirrored, or do not belong to these poses.
    """
    if not len(pose):
        return np.empty((0, 6))
    places, behind = _agreed(corner, pixel, picture, lens, rides, pose)
    off = disagreement(places, pose) if len(pose) > _FEWEST else 0.0
    if off <= _OFF:
        return places
    mirrored = lens * np.where(np.arange(9) == 7, -1.0, 1.0)  # p2
    across = pixel * [-1, 1] + [2 * lens[2], 0]
    if behind:
        other, _ = _agreed(corner, across, picture, mirrored, rides, pose)
        otherwise = disagreement(other, pose)
        if otherwise * _FALLS < off:
            raise ArgumentError(
                f"measurements: the pictures are mirrored: where they show the board differs by"
                f" {np.degrees(off):.2g} deg from how the machine moves, and by"
                f" {np.degrees(otherwise):.2g} deg with left and right exchanged; take"
                " pictures without mirroring, or state u as the width less 1 less u"
            )
    many = np.bincount(picture) >= _MANY
    if many.sum() <= _FEWEST or disagreement(places[many], pose[many]) <= _OFF:
        return places
    trials = {"with the camera on the other of base and platform": (not rides, pose)}
    for how, rows in (("next", 1), ("previous", -1)):
        trials[f"with the actuators of the {how} picture"] = rides, np.roll(pose, -rows, axis=0)
    found = {
        how: disagreement(_agreed(corner, pixel, picture, lens, *trial)[0], trial[1])
        for how, trial in trials.items()
    }
    how = min(found, key=lambda each: found[each])
    fits = found[how] * _FALLS < off
    if fits or off > _GROSS:
        better = f", and by {np.degrees(found[how]):.2g} deg {how}" if fits else ""
        raise ArgumentError(
            f"measurements: where pictures show the board differs by {np.degrees(off):.2g} deg from"
            f" how the machine moves{better}: pictures and"
            " actuators have to belong together, row by row; check what the camera is on, and signs"
            " and units of the actuators"
        )
    return places


def _agreed(
    corner: FloatArray,
    pixel: FloatArray,
    picture: IntArray,
    lens: FloatArray,
    rides: bool,
    pose: FloatArray,
) -> tuple[FloatArray, bool]:
    """Return `tool_places`, and whether most pictures show the board from behind."""
    boards = board_poses(corner, pixel, lens, picture)
    _require_the_board(pixel, picture, boards.rms[:, 0])
    seen = np.where(boards.possible[:, :, None], boards.pose, np.nan)
    behind = bool(np.median(facing(boards)) < 0.0)
    if rides:
        seen = twists.inverse(seen.reshape(-1, 6)).reshape(seen.shape)
    return in_agreement(seen, pose), behind


def _require_the_board(pixel: FloatArray, picture: IntArray, off: FloatArray) -> None:
    """Refuse pictures that do not show the board: most corners are far from where it has them."""
    count = np.bincount(picture)
    middle = summed(pixel, picture) / count[:, None]
    away = np.linalg.norm(pixel - middle[picture], axis=1)
    extent = 2.0 * np.sqrt(np.bincount(picture, away**2) / count)
    many = count >= _MANY  # of fewer the search for their place may end elsewhere
    if not many.any():
        return
    off, extent = off[many], extent[many]
    share = np.where(np.isfinite(off), off, np.inf) / extent
    if np.median(share) > _STRANGE:
        typical = float(np.median(off[np.isfinite(off)])) if np.isfinite(off).any() else np.inf
        raise ArgumentError(
            f"measurements: corners of most pictures are not where the board has them"
            f" ({typical:.3g} px off, of boards of {np.median(extent):.3g} px): state the board"
            " that was printed, columns before rows, and the lens of these pictures"
        )


def in_agreement(seen: FloatArray, pose: FloatArray) -> FloatArray:
    """Choose of places (P, 2, 6) those (P, 6) that agree with poses (P, 6) of the platform.

    The second place is NaN where there is but one.
    """
    doubtful: BoolArray = np.asarray(np.isfinite(seen[:, 1]).all(axis=1))
    chosen = np.zeros(len(seen), dtype=np.intp)
    if not doubtful.any() or len(seen) < 3:
        return _taken(seen, chosen)
    random, known = np.random.default_rng(0), set[bytes]()
    best, least = chosen, np.inf
    for draw in range(_DRAWS):
        if draw:
            some = random.permutation(len(seen))[:_DRAWN]
            sides = random.integers(2, size=len(some)) * doubtful[some]
            off = _misfits(seen, pose, some, sides)
            chosen = np.nanargmin(off, axis=1)
        for _ in range(_ROUNDS):
            if chosen.tobytes() in known:  # an earlier draw went on from there
                break
            known.add(chosen.tobytes())
            off = _misfits(seen, pose, np.arange(len(seen)), chosen)
            before, chosen = chosen, np.nanargmin(off, axis=1)
            if np.array_equal(before, chosen):
                break
        misfit = float(np.minimum(np.nanmin(off, axis=1), _GROSS).sum())
        if misfit < least:
            best, least = chosen, misfit
    return _taken(seen, best)


def disagreement(seen: FloatArray, pose: FloatArray) -> float:
    """Return the median picture's distance from one frame and tool, by places (P, 6) of each.

    An angle, and a share of the distance added to it.
    """
    every = np.arange(len(seen))
    return float(np.median(_misfits(seen[:, None], pose, every, np.zeros_like(every))))


def _taken(seen: FloatArray, chosen: IntArray) -> FloatArray:
    taken: FloatArray = seen[np.arange(len(seen)), chosen]
    return taken


def _misfits(seen: FloatArray, pose: FloatArray, some: IntArray, sides: IntArray) -> FloatArray:
    """Return each picture's places' (P, k) misfits to the frame and tool of some of them."""
    frame, tool = of_frame_and_tool(seen[some, sides], pose[some])
    laid = compose(compose(frame, pose), tool)
    distance = float(np.median(np.linalg.norm(seen[:, 0, :3], axis=1)))
    off = np.full(seen.shape[:2], np.nan)
    for side in range(seen.shape[1]):
        known = np.isfinite(seen[:, side]).all(axis=1)
        turned = orientation.between(seen[known, side, 3:], laid[known, 3:])
        moved = seen[known, side, :3] - laid[known, :3]
        angle, way = (np.linalg.norm(each, axis=1) for each in (turned, moved))
        off[known, side] = angle + way / distance
    return off
