"""Trajectories: laws in time, and moves of a machine along them."""

from pkmcal.moves.events import Event
from pkmcal.moves.jumps import Jump
from pkmcal.moves.move import Move, MoveSample, move
from pkmcal.moves.time_laws import JerkLimited, Polynomial, cubic, jerk_limited, quintic

__all__ = [
    "Event",
    "JerkLimited",
    "Jump",
    "Move",
    "MoveSample",
    "Polynomial",
    "cubic",
    "jerk_limited",
    "move",
    "quintic",
]
