"""Model, analyse, calibrate and compensate parallel kinematic machines."""

from __future__ import annotations

from pkmcal.robot import Forward, Robot, load, machines

__version__ = "0.1.0"
__all__ = ["Forward", "Robot", "load", "machines"]
