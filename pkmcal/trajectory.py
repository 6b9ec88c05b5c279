"""Trajectories: laws in time, and moves of a machine along them."""

from pkmcal.law import JerkLimited, Law, Polynomial, cubic, jerk_limited, quintic
from pkmcal.move import Event, Move, MoveSample, move

__all__ = [
    "Event",
    "JerkLimited",
    "Law",
    "Move",
    "MoveSample",
    "Polynomial",
    "cubic",
    "jerk_limited",
    "move",
    "quintic",
]
