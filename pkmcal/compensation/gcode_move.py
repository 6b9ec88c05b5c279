"""A move of a program, as it was read."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from pkmcal.compensation.gcode_line import Word


class Extrusion(NamedTuple):
    """The E word of a move, where E was before, and whether the word counts from there.

    None where that is not known.
    """

    word: Word
    before: float | None
    relative: bool | None


class Feed(NamedTuple):
    """Feed by F, mm and deg a minute; 0 where none was stated.

    A change of units behind F changes neither, though one F cannot state both then.
    """

    lengths: float
    turns: float


NO_FEED = Feed(0.0, 0.0)


@dataclass(slots=True)
class Move:
    """A G0 or G1 with axis words.

    Attributes
    ----------
    line : int
        Its line, counted from 0.
    code : str
        G0 or G1.
    straight : bool
        Whether it goes along a line with its feed.
    start, target : tuple of float
        Of the axes, in mm and deg, absolute.
    known : bool
        Whether it is known where the move begins.
    fresh : tuple of float or None, or None
        Where the controller is before the first move, and before one behind homing or a macro;
        None of an axis of which that is not known. None if a move ended there.
    words : dict
        Its axis words by their letters.
    relative : bool
        G91.
    scale : float
        Mm of a unit of length.
    extrusion : Extrusion or None
        Its E word.
    feed : Feed
        The feed that is in force.
    feed_word : Word or None
        Its F word.
    per_turn : bool
        G95: the feed is of a turn of the spindle.
    begins_times : bool
        Whether G93 has to stand before it, where moves are to state their times.
    behind : str
        What acts behind it in its line.
    repeated : str
        Words that each of its parts has to state.
    carried : int
        Which of the loads of the program's tools the machine carries.
    """

    line: int
    code: str
    straight: bool
    start: tuple[float, ...]
    target: tuple[float, ...]
    known: bool
    fresh: tuple[float | None, ...] | None
    words: dict[str, Word]
    relative: bool
    scale: float
    extrusion: Extrusion | None
    feed: Feed
    feed_word: Word | None
    per_turn: bool
    begins_times: bool
    behind: str
    repeated: str
    carried: int
