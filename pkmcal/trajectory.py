"""Trajectories: laws in time, and moves of a machine along them."""

from pkmcal.events import Event
from pkmcal.law import JerkLimited, Polynomial, cubic, jerk_limited, quintic
from pkmcal.move import Move, MoveSample, move

__all__ = [
    "Event",
    "JerkLimited",
    "Move",
    "MoveSample",
    "Polynomial",
    "cubic",
    "jerk_limited",
    "move",
    "quintic",
]
