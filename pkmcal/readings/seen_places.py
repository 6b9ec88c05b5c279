"""Choice between the two places at which a flat board looks alike, by all pictures.

Of the true places M = F P T holds in every picture, with one frame and one tool; mirrored ones
contradict each other. From a few pictures drawn at random, each place chosen by chance, frame and
tool follow in closed form; all others then choose the nearer place. The draw with the least misfit
counts (M. A. Fischler and R. C. Bolles, Random sample consensus, Communications of the ACM 24
(1981) 381-395).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, IntArray
from pkmcal.core.poses import compose
from pkmcal.exceptions import ArgumentError, FitError
from pkmcal.readings import orientation, twists
from pkmcal.readings.board_poses import board_poses, facing, pictures_told, summed
from pkmcal.readings.hand_eye import of_frame_and_tool
from pkmcal.readings.numberings import across, half_turn

_FEWEST = 4  # pictures, more of which tell that they are mirrored
_OFF, _FALLS = 0.1, 3.0  # rad by which mirrored pictures are off, and how many times less mirrored
_MIRRORED = "with left and right exchanged"
_STRANGE = 0.05  # of the extent of a board in a picture, by which its corners are off at most
_MANY = 8  # corners of a picture that says whether it shows the board
_DRAWN = 5  # pictures of a draw
_DRAWS, _FEW_DRAWS = 60, 20  # the latter where nothing but the cause hangs on them
_ROUNDS = 10  # of choosing and laying in turn
_GROSS = 0.2  # rad, or share of the distance, beyond which a picture is off and no more
_ODD, _TIMES = 0.02, 10.0  # the same, and times the median, by which a picture is of another row
_LOOSE = 0.025  # the same, from which places tell whether most pictures are off
_MOST = 10.0  # times by which a step makes a board smaller
_LISTED = 6  # pictures
_ASTRAY = 0.3  # share of the way between pictures, by which most are off their places at most


def tool_places(
    corner: FloatArray,
    pixel: FloatArray,
    picture: IntArray,
    lens: FloatArray,
    rides: bool,
    pose: FloatArray,
    names: Sequence[str],
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
    names : sequence of str, P
        Of the pictures.

    Raises
    ------
    ValueError
        The pictures are mirrored, exchanged, numbered from either end, or do not belong to these
        poses.
    """
    if not len(pose):
        return np.empty((0, 6))
    places, behind = _agreed(corner, pixel, picture, lens, rides, pose)
    odd = _require_own_poses(places, pose, names)
    sound = np.isin(np.arange(len(pose)), odd, invert=True)
    off, astray = _contradictions(places[sound], pose[sound])
    if off <= _OFF and not astray:  # the fit names the few that are odd, and can leave them out
        return np.where(sound[:, None], places, np.nan)
    if len(odd):
        off, astray = _contradictions(places, pose)
    mirrored = across(pixel, lens[2]), picture, lens * np.where(np.arange(9) == 7, -1.0, 1.0)  # p2
    if behind:
        other, _ = _agreed(corner, *mirrored, rides, pose)
        otherwise = disagreement(other, pose)
        if otherwise * _FALLS < off:
            raise ArgumentError(
                f"measurements: the pictures are mirrored: where they show the board differs by"
                f" {np.degrees(off):.2g} deg from how the machine moves, and by"
                f" {np.degrees(otherwise):.2g} deg {_MIRRORED}; take"
                " pictures without mirroring, or state u as the width less 1 less u"
            )
    many = np.bincount(picture) >= _MANY
    if many.sum() <= _FEWEST or not (astray or disagreement(places[many], pose[many]) > _OFF):
        return places
    half = half_turn(corner)
    if half is not None:
        laid, turned = _numbered(corner, pixel, picture, lens, rides, pose, half)
        _require_one_numbering(off, disagreement(laid, pose), turned, names)
    trials = {"with the camera on the other of base and platform": (not rides, pose)}
    for how, rows in (("next", 1), ("previous", -1)):
        trials[f"with the actuators of the {how} picture"] = rides, np.roll(pose, -rows, axis=0)
    found = {
        how: disagreement(_agreed(corner, pixel, picture, lens, *trial)[0], trial[1])
        for how, trial in trials.items()
    }
    times = _times_larger(places, pose)
    larger = places * np.repeat([times, 1.0], 3)
    found[f"with a board {times:.4g} times as large"] = disagreement(larger, pose)
    if half is not None:
        laid, _ = _numbered(across(corner, half[0] / 2), *mirrored, rides, pose, half)
        found[_MIRRORED] = disagreement(laid, pose)
    how = min(found, key=lambda each: found[each])
    fits = found[how] * _FALLS < off
    if how == _MIRRORED and fits and found[how] <= _OFF:  # from the front, or it had been behind
        raise FitError(
            "the pictures are mirrored, or actuators are exchanged of a machine that is its own"
            f" mirror image: where pictures show the board differs by {np.degrees(off):.2g} deg"
            f" from how the machine moves, and by {np.degrees(found[how]):.2g} deg {how}; take"
            " pictures without mirroring, or mirror them and find corners again"
        )
    if fits or off > _GROSS or astray:
        better = f", and by {np.degrees(found[how]):.2g} deg {how}" if fits else ""
        if len(odd):
            which = ", ".join(names[i] for i in odd[:_LISTED]) + (
                " …" if len(odd) > _LISTED else ""
            )
            better = f", for {len(odd)} of {len(pose)} do not agree with the others: {which},"
            better += " which you may leave out"
        text = (
            f"where pictures show the board differs by {np.degrees(off):.2g} deg from"
            f" how the machine moves{better}: pictures and"
            " actuators have to belong together, row by row; check what the camera is on, signs and"
            " units of the actuators, the size of the board in mm, and the lens"
        )
        if fits and not len(odd):  # nothing else has to be tried
            raise ArgumentError(f"measurements: {text}")
        raise FitError(text)
    return places


def places_of_markers(
    corner: FloatArray,
    pixel: FloatArray,
    lens: FloatArray,
    rides: bool,
    pose: FloatArray,
    called: str = "measurements",
) -> FloatArray:
    """Pose (N, 6) of a board of too few corners in the frame of a camera that stands.

    Corners (N, 3) that the machine moves about are seen, by all pictures, as those of one board as
    large as its workspace, where they are taken to be on the platform in its own axes. NaN where
    nothing is seen.

    Raises
    ------
    ValueError
        The camera rides, or places are too few or nearly in a line.
    """
    seen = np.flatnonzero(np.isfinite(pixel).all(axis=1) & np.isfinite(pose).all(axis=1))
    about = compose(pose[seen], np.column_stack([corner[seen], np.zeros((len(seen), 3))]))[:, :3]
    together = np.zeros(len(seen), dtype=np.intp)
    told = pictures_told(about, pixel[seen], together)[0] if len(seen) and not rides else seen[:0]
    if not len(told):
        raise ArgumentError(
            f"{called}: no picture shows four corners of a board that are not in a line, and"
            " single markers tell where a camera is only if it stands and sees them at six places"
            " or more: state the corners of a marker as a board, apriltags:1x1,TAG,GAP, or, where"
            " other cameras and boards are left, leave these rows out"
        )
    boards = board_poses(about, pixel[seen], lens, together)
    places = np.full((len(pose), 6), np.nan)
    places[seen] = compose(np.tile(boards.pose[:, 0], (len(seen), 1)), pose[seen])
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
    seen, behind = _seen(corner, pixel, picture, lens)
    return in_agreement(_of_tool(seen, rides), pose), behind


def _numbered(
    corner: FloatArray,
    pixel: FloatArray,
    picture: IntArray,
    lens: FloatArray,
    rides: bool,
    pose: FloatArray,
    half: FloatArray,
) -> tuple[FloatArray, IntArray]:
    """Return `tool_places`, each numbered from the end that fits, and the fewer of one end."""
    seen, _ = _seen(corner, pixel, picture, lens)
    turned = compose(seen.reshape(-1, 6), half).reshape(seen.shape)
    either = _of_tool(np.stack([seen, turned], axis=2).reshape(len(seen), 4, 6), rides)
    chosen = _chosen(either, pose, _FEW_DRAWS)
    ends = [np.flatnonzero(chosen % 2 == end) for end in (1, 0)]
    return _taken(either, chosen), min(ends, key=len)


def _seen(
    corner: FloatArray, pixel: FloatArray, picture: IntArray, lens: FloatArray
) -> tuple[FloatArray, bool]:
    """Places (P, 2, 6) of the board in axes of the camera, and whether most show its back."""
    boards = board_poses(corner, pixel, lens, picture)
    _require_the_board(pixel, picture, boards.rms[:, 0])
    behind = bool(np.median(facing(boards)) < 0.0)
    return np.where(boards.possible[:, :, None], boards.pose, np.nan), behind


def _of_tool(seen: FloatArray, rides: bool) -> FloatArray:
    return twists.inverse(seen.reshape(-1, 6)).reshape(seen.shape) if rides else seen


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
    return _taken(seen, _chosen(seen, pose))


def _chosen(seen: FloatArray, pose: FloatArray, draws: int = _DRAWS) -> IntArray:
    """Which (P,) of places (P, k, 6) agree: those of the second half may be NaN."""
    possible: BoolArray = np.asarray(np.isfinite(seen).all(axis=2))
    half = seen.shape[1] // 2
    chosen = np.zeros(len(seen), dtype=np.intp)
    if not possible[:, 1:].any() or len(seen) < 3:
        return chosen
    random, known = np.random.default_rng(0), set[bytes]()
    best, least = chosen, np.inf
    for draw in range(draws):
        if draw:
            some = random.permutation(len(seen))[:_DRAWN]
            sides = random.integers(seen.shape[1], size=len(some))
            sides -= half * ~possible[some, sides]
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
    return best


def disagreement(seen: FloatArray, pose: FloatArray) -> float:
    """Return the median picture's distance from one frame and tool, by places (P, 6) of each.

    An angle, and a share of the distance added to it. Of poses that the machine reaches.
    """
    every = np.arange(len(seen))
    off = _misfits(seen[:, None], pose, every, np.zeros_like(every))
    return float(np.nanmedian(off)) if np.isfinite(off).any() else np.inf


def _require_one_numbering(
    off: float, otherwise: float, turned: IntArray, names: Sequence[str]
) -> None:
    """Refuse pictures of which some number the corners of a board from its other end."""
    if len(turned) and otherwise <= _OFF and otherwise * _FALLS < off:
        which = ", ".join(names[i] for i in turned[:_LISTED]) + " …" * (len(turned) > _LISTED)
        raise ArgumentError(
            f"measurements: {len(turned)} of {len(names)} pictures number corners from the other"
            " end of the board than the rest, for it looks alike when it is turned by 180 deg:"
            f" {which}; where pictures show the board differs by {np.degrees(off):.2g} deg from how"
            f" the machine moves, and by {np.degrees(otherwise):.2g} deg with these turned: number"
            " their corners from the other end, or print a ChArUco board, a chessboard with an odd"
            " and an even side, or dots of which one is larger"
        )


def _contradictions(seen: FloatArray, pose: FloatArray) -> tuple[float, bool]:
    """Return `disagreement` and `_astray`; none of so few pictures that they tell nothing."""
    off = disagreement(seen, pose) if len(pose) > _FEWEST else 0.0
    return off, off > _LOOSE and _astray(seen, pose)


def _times_larger(seen: FloatArray, pose: FloatArray) -> float:
    """By what the lengths of the places (P, 6) at which pictures show the board would fit best."""
    known = np.isfinite(seen).all(axis=1) & np.isfinite(pose).all(axis=1)
    place, times = seen[known, :3] - seen[known, :3].mean(axis=0), 1.0
    for _ in range(_ROUNDS):
        frame, tool = of_frame_and_tool(seen[known] * np.repeat([times, 1.0], 3), pose[known])
        laid = compose(compose(frame, pose[known]), tool)[:, :3]
        laid = laid - laid.mean(axis=0)
        times = max(float((place * laid).sum() / (place**2).sum()), times / _MOST)
    return times


def _astray(seen: FloatArray, pose: FloatArray) -> bool:
    """Whether most pictures are off by much of the way between them, as of a machine mirrored.

    Of one that does not turn, and of a camera far away, `disagreement` says little.
    """
    frame, tool = of_frame_and_tool(seen, pose)
    place, laid = seen[:, :3], compose(compose(frame, pose), tool)[:, :3]
    off = np.linalg.norm(place - laid, axis=1)
    ways = np.linalg.norm(place - np.median(place, axis=0), axis=1)
    return bool(np.nanmedian(off) > _ASTRAY * np.median(ways))


def _require_own_poses(seen: FloatArray, pose: FloatArray, names: Sequence[str]) -> IntArray:
    """Refuse pictures that are exchanged: each shows the board where another's pose has it.

    Returns those that are off where most agree: none where more than a quarter is.
    """
    some = np.isfinite(seen).all(axis=1) & np.isfinite(pose).all(axis=1)
    if some.sum() < 2 * _FEWEST:
        return np.empty(0, dtype=np.intp)
    laid, off = pose, np.empty(0)
    for _ in range(_ROUNDS):  # of laying the better half
        frame, tool = of_frame_and_tool(seen[some], pose[some])
        laid = compose(compose(frame, pose), tool)
        off = _apart(seen, laid)
        before, some = some, off <= np.nanmedian(off)
        if np.array_equal(before, some):
            break
    most = max(_ODD, _TIMES * float(np.nanmedian(off)))
    odd = np.flatnonzero(off > most)
    if not 1 <= len(odd) <= len(seen) / 4:
        return odd[:0]
    each = np.stack([_apart(seen, laid[np.full(len(seen), other)])[odd] for other in odd], axis=1)
    of, least = each.argmin(axis=1), each.min(axis=1)
    own = of == np.arange(len(odd))
    if np.array_equal(np.sort(of), np.arange(len(odd))) and not own.any() and (least <= most).all():
        pairs = zip(odd.tolist(), odd[of].tolist(), strict=True)
        which = ", ".join(f"{names[i]} shows {names[k]}" for i, k in pairs)
        raise ArgumentError(
            "measurements: pictures are exchanged: by where the actuators say that the machine was"
            f" {which} ({np.degrees(np.median(off[odd])):.2g} deg off as given,"
            f" {np.degrees(np.median(least)):.2g} deg so): name them as their actuators are"
        )
    return odd


def _apart(seen: FloatArray, laid: FloatArray) -> FloatArray:
    """How far places (P, 6) are from others: an angle, and a share of the distance; or NaN."""
    known = np.isfinite(seen).all(axis=1) & np.isfinite(laid).all(axis=1)
    turned = orientation.between(seen[known, 3:], laid[known, 3:])
    moved, distance = seen[:, :3] - laid[:, :3], np.linalg.norm(seen[:, :3], axis=1)
    off = np.full(len(seen), np.nan)
    way = np.linalg.norm(moved[known], axis=1) / np.median(distance[known])
    off[known] = np.linalg.norm(turned, axis=1) + way
    return off


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
