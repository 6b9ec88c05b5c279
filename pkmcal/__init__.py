"""Model, analyse, calibrate and compensate parallel kinematic machines.

What is public is imported when it is first asked for: `import pkmcal` alone takes no time.
"""

from __future__ import annotations

from importlib import import_module

TYPE_CHECKING = False  # as of typing, which takes longer to import than all else here
if TYPE_CHECKING:  # the same names for type checkers and editors; a test compares both
    from typing import Any

    from pkmcal import export as export
    from pkmcal import readings as readings
    from pkmcal import screw as screw
    from pkmcal import trajectory as trajectory
    from pkmcal.arms.arm import SerialArm as SerialArm
    from pkmcal.arms.denavit_hartenberg import DHTable as DHTable
    from pkmcal.arms.inverse import ArmInverse as ArmInverse
    from pkmcal.calibration.anchors import LocatedAnchors as LocatedAnchors
    from pkmcal.calibration.anchors import locate_anchors as locate_anchors
    from pkmcal.calibration.bootstrap import Bootstrap as Bootstrap
    from pkmcal.calibration.bootstrap import bootstrap as bootstrap
    from pkmcal.calibration.identification import Identification as Identification
    from pkmcal.calibration.identify import identify as identify
    from pkmcal.checks.check_geometry import GeometryCheck as GeometryCheck
    from pkmcal.checks.check_geometry import check_geometry as check_geometry
    from pkmcal.checks.finding import Finding as Finding
    from pkmcal.compensation.compensate import Compensation as Compensation
    from pkmcal.compensation.compensate import compensate as compensate
    from pkmcal.compensation.correction_grid import CorrectionGrid as CorrectionGrid
    from pkmcal.compensation.correction_grid import correction_grid as correction_grid
    from pkmcal.compensation.program import CorrectedProgram as CorrectedProgram
    from pkmcal.compensation.program import compensate_program as compensate_program
    from pkmcal.compensation.pso import SwarmResult as SwarmResult
    from pkmcal.compensation.pso import pso as pso
    from pkmcal.controllers.comp_file import ScrewTable as ScrewTable
    from pkmcal.controllers.comp_file import import_comp_file as import_comp_file
    from pkmcal.controllers.import_printer import import_printer as import_printer
    from pkmcal.core.swarm import CONSTRICTION as CONSTRICTION
    from pkmcal.core.swarm import SwarmSettings as SwarmSettings
    from pkmcal.diagnostics.check import Check as Check
    from pkmcal.diagnostics.check import Remedy as Remedy
    from pkmcal.diagnostics.check import Said as Said
    from pkmcal.diagnostics.checks import CHECKS as CHECKS
    from pkmcal.diagnostics.drift import Drift as Drift
    from pkmcal.diagnostics.law_tests import LawTest as LawTest
    from pkmcal.diagnostics.measuring_order import MeasuringOrder as MeasuringOrder
    from pkmcal.diagnostics.moved import Moved as Moved
    from pkmcal.diagnostics.verdict import Verdict as Verdict
    from pkmcal.diagnostics.verdict import diagnose as diagnose
    from pkmcal.effects.elasticity import Elasticity as Elasticity
    from pkmcal.effects.expansion import Expansion as Expansion
    from pkmcal.effects.gears import Backlash as Backlash
    from pkmcal.effects.gears import Coupling as Coupling
    from pkmcal.effects.gears import Harmonics as Harmonics
    from pkmcal.effects.sag import Sag as Sag
    from pkmcal.error_model.allocation import Allocation as Allocation
    from pkmcal.error_model.allocation import allocate_tolerance as allocate_tolerance
    from pkmcal.error_model.sensitivity import Sensitivity as Sensitivity
    from pkmcal.error_model.sensitivity import sensitivity as sensitivity
    from pkmcal.error_model.sensitivity import study_cases as study_cases
    from pkmcal.error_model.tolerance import Tolerance as Tolerance
    from pkmcal.error_model.tolerance import tolerance as tolerance
    from pkmcal.exceptions import ArgumentError as ArgumentError
    from pkmcal.exceptions import ArgumentTypeError as ArgumentTypeError
    from pkmcal.exceptions import CalibrationWarning as CalibrationWarning
    from pkmcal.exceptions import Error as Error
    from pkmcal.exceptions import FileError as FileError
    from pkmcal.fitted.datum import Datum as Datum
    from pkmcal.fitted.distances import Distances as Distances
    from pkmcal.fitted.slack import SlackCable as SlackCable
    from pkmcal.geometry.carried import Load as Load
    from pkmcal.geometry.geometry import Geometry as Geometry
    from pkmcal.kinematics.dexterity import Dexterity as Dexterity
    from pkmcal.kinematics.dexterity import dexterity as dexterity
    from pkmcal.kinematics.forward import Forward as Forward
    from pkmcal.kinematics.limb_residual import LimbResidual as LimbResidual
    from pkmcal.kinematics.limits import Feasibility as Feasibility
    from pkmcal.kinematics.robot import Robot as Robot
    from pkmcal.kinematics.stiffness import ComplianceTable as ComplianceTable
    from pkmcal.kinematics.stiffness import Stiffness as Stiffness
    from pkmcal.kinematics.stiffness import compliance_table as compliance_table
    from pkmcal.kinematics.stiffness import stiffness as stiffness
    from pkmcal.kinematics.tensions import Tensions as Tensions
    from pkmcal.kinematics.tensions import tensions as tensions
    from pkmcal.kinematics.workspace import Workspace as Workspace
    from pkmcal.kinematics.workspace import sample_poses as sample_poses
    from pkmcal.kinematics.workspace import workspace as workspace
    from pkmcal.loading import load as load
    from pkmcal.loading import machines as machines
    from pkmcal.measurements.circular_test import CircularTest as CircularTest
    from pkmcal.measurements.circular_test import circular_test as circular_test
    from pkmcal.measurements.measurement_csv import read_measurements as read_measurements
    from pkmcal.measurements.measurements import Measurements as Measurements
    from pkmcal.measurements.pnp import from_pnp as from_pnp
    from pkmcal.measurements.probe import probed as probed
    from pkmcal.measurements.tracker import Tracker as Tracker
    from pkmcal.measurements.virtual_machine import VirtualMachine as VirtualMachine
    from pkmcal.modes.assemblies import Assemblies as Assemblies
    from pkmcal.modes.certificate import Certificate as Certificate
    from pkmcal.moves.events import Event as Event
    from pkmcal.moves.jumps import Jump as Jump
    from pkmcal.moves.move import Move as Move
    from pkmcal.moves.move import MoveSample as MoveSample
    from pkmcal.planning.next_pose import NextPose as NextPose
    from pkmcal.planning.next_pose import next_pose as next_pose
    from pkmcal.planning.plan_poses import Plan as Plan
    from pkmcal.planning.plan_poses import plan_poses as plan_poses
    from pkmcal.view.show import show as show
    from pkmcal.vision.detect import Detection as Detection
    from pkmcal.vision.detect import detect as detect
    from pkmcal.vision.printed import print_board as print_board

_HOMES = {
    "arms.arm": ("SerialArm",),
    "arms.denavit_hartenberg": ("DHTable",),
    "arms.inverse": ("ArmInverse",),
    "calibration.anchors": ("LocatedAnchors", "locate_anchors"),
    "calibration.bootstrap": ("Bootstrap", "bootstrap"),
    "fitted.datum": ("Datum",),
    "fitted.distances": ("Distances",),
    "diagnostics.check": ("Check", "Remedy", "Said"),
    "diagnostics.checks": ("CHECKS",),
    "diagnostics.drift": ("Drift",),
    "calibration.identification": ("Identification",),
    "calibration.identify": ("identify",),
    "diagnostics.law_tests": ("LawTest",),
    "diagnostics.measuring_order": ("MeasuringOrder",),
    "diagnostics.moved": ("Moved",),
    "planning.next_pose": ("NextPose", "next_pose"),
    "planning.plan_poses": ("Plan", "plan_poses"),
    "fitted.slack": ("SlackCable",),
    "diagnostics.verdict": ("Verdict", "diagnose"),
    "checks.check_geometry": ("GeometryCheck", "check_geometry"),
    "checks.finding": ("Finding",),
    "compensation.compensate": ("Compensation", "compensate"),
    "compensation.correction_grid": ("CorrectionGrid", "correction_grid"),
    "compensation.program": ("CorrectedProgram", "compensate_program"),
    "compensation.pso": ("SwarmResult", "pso"),
    "core.swarm": ("CONSTRICTION", "SwarmSettings"),
    "effects.elasticity": ("Elasticity",),
    "effects.expansion": ("Expansion",),
    "effects.gears": ("Backlash", "Coupling", "Harmonics"),
    "effects.sag": ("Sag",),
    "error_model.allocation": ("Allocation", "allocate_tolerance"),
    "error_model.sensitivity": ("Sensitivity", "sensitivity", "study_cases"),
    "error_model.tolerance": ("Tolerance", "tolerance"),
    "exceptions": (
        "ArgumentError",
        "ArgumentTypeError",
        "CalibrationWarning",
        "Error",
        "FileError",
    ),
    "controllers.comp_file": ("ScrewTable", "import_comp_file"),
    "controllers.import_printer": ("import_printer",),
    "geometry.carried": ("Load",),
    "geometry.geometry": ("Geometry",),
    "kinematics.dexterity": ("Dexterity", "dexterity"),
    "kinematics.forward": ("Forward",),
    "kinematics.limb_residual": ("LimbResidual",),
    "kinematics.limits": ("Feasibility",),
    "kinematics.robot": ("Robot",),
    "kinematics.stiffness": ("ComplianceTable", "Stiffness", "compliance_table", "stiffness"),
    "kinematics.tensions": ("Tensions", "tensions"),
    "kinematics.workspace": ("Workspace", "sample_poses", "workspace"),
    "loading": ("load", "machines"),
    "measurements.circular_test": ("CircularTest", "circular_test"),
    "measurements.measurement_csv": ("read_measurements",),
    "measurements.measurements": ("Measurements",),
    "measurements.pnp": ("from_pnp",),
    "measurements.probe": ("probed",),
    "measurements.tracker": ("Tracker",),
    "measurements.virtual_machine": ("VirtualMachine",),
    "modes.assemblies": ("Assemblies",),
    "modes.certificate": ("Certificate",),
    "moves.events": ("Event",),
    "moves.jumps": ("Jump",),
    "moves.move": ("Move", "MoveSample"),
    "view.show": ("show",),
    "vision.detect": ("Detection", "detect"),
    "vision.printed": ("print_board",),
}
_HOME_OF = {name: f"pkmcal.{home}" for home, names in _HOMES.items() for name in names}
_MODULES = ("export", "readings", "screw", "trajectory")

__all__ = sorted((*_HOME_OF, *_MODULES))


def __getattr__(name: str) -> Any:
    if name == "__version__":  # stated once, in pyproject.toml
        from importlib.metadata import PackageNotFoundError, version

        try:
            return version("pkmcal")
        except PackageNotFoundError:  # sources on a path
            return "not installed"
    if name in _MODULES:
        return import_module(f"pkmcal.{name}")
    if name not in _HOME_OF:
        raise AttributeError(f"module 'pkmcal' has no attribute {name!r}")
    found = getattr(import_module(_HOME_OF[name]), name)
    globals()[name] = found  # asked for once
    return found


def __dir__() -> list[str]:
    return list(__all__)
