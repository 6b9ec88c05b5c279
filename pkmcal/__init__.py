"""Model, analyse, calibrate and compensate parallel kinematic machines."""

from __future__ import annotations

from typing import Any

from pkmcal.compensate import Compensation, compensate
from pkmcal.feasible import Feasibility
from pkmcal.forward import Forward
from pkmcal.identification import Identification
from pkmcal.identify import identify
from pkmcal.measurement_csv import read_measurements
from pkmcal.measurements import Measurements
from pkmcal.robot import Robot, load, machines
from pkmcal.virtual import VirtualMachine

__all__ = [
    "Compensation",
    "Feasibility",
    "Forward",
    "Identification",
    "Measurements",
    "Robot",
    "VirtualMachine",
    "compensate",
    "identify",
    "load",
    "machines",
    "read_measurements",
]


def __getattr__(name: str) -> Any:
    if name == "__version__":  # stated once, in pyproject.toml
        from importlib.metadata import version

        return version("pkmcal")
    raise AttributeError(f"module 'pkmcal' has no attribute {name!r}")
