"""Model, analyse, calibrate and compensate parallel kinematic machines."""

from __future__ import annotations

from typing import Any

from pkmcal import screw, trajectory
from pkmcal.arms.arm import SerialArm
from pkmcal.calibration.bootstrap import Bootstrap, bootstrap
from pkmcal.calibration.identification import Identification
from pkmcal.calibration.identify import identify
from pkmcal.calibration.plan_poses import Plan, plan_poses
from pkmcal.checks.check_geometry import GeometryCheck, check_geometry
from pkmcal.compensation.compensate import Compensation, compensate
from pkmcal.compensation.pso import SwarmResult, pso
from pkmcal.error_model.allocation import Allocation, allocate_tolerance
from pkmcal.error_model.sensitivity import Sensitivity, sensitivity
from pkmcal.error_model.tolerance import Tolerance, tolerance
from pkmcal.kinematics.dexterity import Dexterity, dexterity
from pkmcal.kinematics.forward import Forward
from pkmcal.kinematics.limits import Feasibility
from pkmcal.kinematics.robot import Robot
from pkmcal.kinematics.workspace import Workspace, sample_poses, workspace
from pkmcal.loading import load, machines
from pkmcal.measurements.measurement_csv import read_measurements
from pkmcal.measurements.measurements import Measurements
from pkmcal.measurements.tracker import Tracker
from pkmcal.measurements.virtual_machine import VirtualMachine
from pkmcal.modes.assemblies import Assemblies

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
