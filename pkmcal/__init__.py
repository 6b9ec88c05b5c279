"""Model, analyse, calibrate and compensate parallel kinematic machines."""

from __future__ import annotations

from typing import Any

from pkmcal import screw, trajectory
from pkmcal.allocation import Allocation, allocate_tolerance
from pkmcal.assemblies import Assemblies
from pkmcal.bootstrap import Bootstrap, bootstrap
from pkmcal.check_geometry import GeometryCheck, check_geometry
from pkmcal.compensate import Compensation, compensate
from pkmcal.feasible import Feasibility
from pkmcal.forward import Forward
from pkmcal.identification import Identification
from pkmcal.identify import identify
from pkmcal.loading import load, machines
from pkmcal.measurement_csv import read_measurements
from pkmcal.measurements import Measurements
from pkmcal.plan import Plan, plan_poses
from pkmcal.pso import SwarmResult, pso
from pkmcal.robot import Robot
from pkmcal.sensitivity import Sensitivity, sensitivity
from pkmcal.serial import SerialArm
from pkmcal.tolerance import Tolerance, tolerance
from pkmcal.tracker import Tracker
from pkmcal.virtual import VirtualMachine
from pkmcal.workspace import Dexterity, Workspace, dexterity, sample_poses, workspace

__all__ = [
    "Allocation",
    "Assemblies",
    "Bootstrap",
    "Compensation",
    "Dexterity",
    "Feasibility",
    "Forward",
    "GeometryCheck",
    "Identification",
    "Measurements",
    "Plan",
    "Robot",
    "Sensitivity",
    "SerialArm",
    "SwarmResult",
    "Tolerance",
    "Tracker",
    "VirtualMachine",
    "Workspace",
    "allocate_tolerance",
    "bootstrap",
    "check_geometry",
    "compensate",
    "dexterity",
    "identify",
    "load",
    "machines",
    "plan_poses",
    "pso",
    "read_measurements",
    "sample_poses",
    "screw",
    "sensitivity",
    "tolerance",
    "trajectory",
    "workspace",
]


def __getattr__(name: str) -> Any:
    if name == "__version__":  # stated once, in pyproject.toml
        from importlib.metadata import version

        return version("pkmcal")
    raise AttributeError(f"module 'pkmcal' has no attribute {name!r}")
