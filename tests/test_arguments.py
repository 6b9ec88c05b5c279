"""A wrong argument of any public call is refused by its name, with what was found."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal import arguments, screw, trajectory

ROBOT, ARM, FLAT = pk.load("hexapod"), pk.load("3r"), pk.load("2tpr2tps")
POSES = ROBOT.home + [[20.0 * i, 5.0 * i**2, 0, 0, 0, 0] for i in range(8)]
Q = ROBOT.inverse(POSES)
MEASURED = pk.Measurements(Q, POSES, "pose", sigma=0.01)
FOUND = pk.identify(ROBOT, MEASURED, free="offset*")
YIELDING = ROBOT.yielding({"offset*": 1 / 20e3})
THETA = np.full((2, 3), 0.1)
TARGETS = ARM.forward(THETA)
AWAY = FLAT.home + np.array([0, 10, 0, 0, 0, 0])
MODES = FLAT.forward_all(FLAT.inverse(FLAT.home))

# What an argument may be wrong in, by what it should be.
NO_NUMBERS = [None, "abc", [[1.0], [1.0, 2.0]], np.full(6, 1j), object(), {}]
NO_NUMBER = [None, "abc", float("nan"), [1.0, 2.0], True, 10**400]
WRONG: dict[str, list[Any]] = {
    "numbers": NO_NUMBERS,
    "one or many": [each for each in NO_NUMBERS if each is not None],
    "number": NO_NUMBER,
    "positive": [*NO_NUMBER, 0.0, -1.0],
    "count": [None, "abc", 2.5, -1, True, [3], float("nan")],
    "word": [None, "nonsense", 3, ["nonsense"], {}, np.zeros(2)],
    "names": [3, 2.5, [3], np.zeros((2, 2)), "nonsense", ["nonsense"], object()],
    "robot": [None, "hexapod", 3, MEASURED],
    "parallel": [None, "hexapod", 3, ARM],
    "machine": [None, "hexapod", 3],
    "measurements": [None, 3, "abc", [3], [None]],
    "identification": [None, 3, ROBOT],
    "path": [None, 3, 2.5, ["abc"], object()],
    "files": [None, 3, 2.5, object(), [3], [None]],
    "comment": [3, ["# abc"], "abc", "# abc\nabc"],
    "function": [3, "abc", [abs]],
    "executor": [0, 3, "threads", ThreadPoolExecutor],
    "flag": [None, "yes", 1, 0.0],
    "text": [None, 3, ["abc"]],
    "by name": [3, "abc", [1.0], {"nonsense": 1.0}, {3: 1.0}],
    "one or by name": [0.0, "abc", [1.0], {"nonsense": 1.0}, {3: 1.0}, {"offset*": "abc"}],
    "changes": [None, "abc", [1.0], object(), np.full((2, 2), 1.0)],
}

# Each call with arguments that fit, and of which kind they are.
Call = tuple[Callable[..., Any], dict[str, Any], dict[str, str]]
PRINTER = Path(__file__).parents[1] / "examples" / "linear-delta" / "printer.cfg"
SCREW = Path(__file__).parent / "data" / "screw.comp"
BELTS = pk.load(Path(__file__).parents[1] / "examples" / "belts" / "robot.toml")
PLACES = np.random.default_rng(0).uniform(-200, 200, (12, 6)) * [1, 1, 0, 0, 0, 0]
ANGLES = np.linspace(0, 2 * np.pi, 60)
CIRCLE = 100.0 * np.column_stack([np.cos(ANGLES), np.sin(ANGLES)])
BOARD = pk.readings.Board.chessboard(4, 3, 10)
CALLS: dict[str, Call] = {
    "load": (pk.load, {"robot": "hexapod"}, {"robot": "path"}),
    "import_printer": (pk.import_printer, {"path": PRINTER}, {"path": "path"}),
    "import_comp_file": (pk.import_comp_file, {"path": SCREW}, {"path": "path"}),
    "detect": (
        pk.detect,
        {"images": "pictures", "board": BOARD},
        {"images": "files", "board": "robot", "camera": "robot", "progress": "function"},
    ),
    "print_board": (
        pk.print_board,
        {"board": BOARD, "path": "board.pdf"},
        {"board": "robot", "path": "path", "margin": "number"},
    ),
    "circular_test": (
        pk.circular_test,
        {"path": CIRCLE, "radius": 100.0},
        {"path": "numbers", "other": "numbers", "radius": "number"},
    ),
    "Robot": (pk.Robot, {"model": ROBOT.model}, {"model": "robot"}),
    **{
        name: (getattr(ROBOT, name), {"pose": POSES}, {"pose": "numbers"})
        for name in ("inverse", "jacobian", "forward_jacobian", "violation", "feasible")
    },
    "inverse, matched": (FLAT.inverse, {"pose": AWAY, "match": True}, {"match": "names"}),
    "complete": (
        FLAT.complete,
        {"pose": AWAY, "match": True},
        {"pose": "numbers", "match": "names"},
    ),
    "error_jacobian": (
        ROBOT.error_jacobian,
        {"pose": POSES, "actuators": Q},
        {"pose": "numbers", "actuators": "numbers"},
    ),
    "error_twists": (
        ROBOT.error_twists,
        {"pose": POSES, "actuators": Q},
        {"pose": "numbers", "actuators": "numbers"},
    ),
    "forward": (
        ROBOT.forward,
        {"q": Q, "guess": POSES, "threads": 1},
        {"q": "numbers", "guess": "numbers", "threads": "count"},
    ),
    "forward_all": (
        FLAT.forward_all,
        {"q": FLAT.inverse(AWAY), "starts": 10},
        {"q": "numbers", "starts": "count"},
    ),
    "rates": (
        ROBOT.rates,
        {"motion": np.stack([np.eye(4)] * 3), "near": ROBOT.inverse(ROBOT.home)},
        {"motion": "numbers", "near": "numbers"},
    ),
    "replace": (ROBOT.replace, {"changes": ROBOT.geometry.values}, {"changes": "changes"}),
    "Robot.save": (
        ROBOT.save,
        {"path": "robot.toml", "comment": "# of a test"},
        {"path": "path", "comment": "comment"},
    ),
    "nearest": (MODES.nearest, {"pose": AWAY}, {"pose": "numbers"}),
    "reached_from": (
        MODES.reached_from,
        {"pose": AWAY, "actuators": FLAT.inverse(AWAY), "steps": 3},
        {"pose": "numbers", "actuators": "numbers", "steps": "count"},
    ),
    "SerialArm": (
        pk.SerialArm,
        {
            "axes": ARM.axes,
            "points": ARM.points,
            "home": ARM.home,
            "kinds": "revolute",
            "name": "arm",
            "joint_errors": np.zeros((3, 6)),
        },
        {
            "axes": "numbers",
            "points": "numbers",
            "home": "numbers",
            "kinds": "names",
            "name": "text",
            "joint_errors": "numbers",
        },
    ),
    "from_dh": (
        pk.SerialArm.from_dh,
        {"a": [300.0, 200.0], "alpha": 0.0, "d": 0.0, "convention": "standard", "tool": np.eye(4)},
        {
            "a": "numbers",
            "alpha": "numbers",
            "d": "numbers",
            "convention": "word",
            "tool": "one or many",
        },
    ),
    "from_urdf": (pk.SerialArm.from_urdf, {"path": "arm.urdf"}, {"path": "path"}),
    "arm.forward": (
        ARM.forward,
        {"theta": THETA, "joint_errors": np.zeros((3, 6)), "threads": 1},
        {"theta": "numbers", "joint_errors": "numbers", "threads": "count"},
    ),
    "arm.jacobian": (
        ARM.jacobian,
        {"theta": THETA, "frame": "tip"},
        {"theta": "numbers", "frame": "word"},
    ),
    "arm.error_jacobian": (
        ARM.error_jacobian,
        {"theta": THETA, "frame": "tip"},
        {"theta": "numbers", "frame": "word"},
    ),
    "arm.inverse": (
        ARM.inverse,
        {"target": TARGETS, "guess": THETA, "parts": "pose"},
        {"target": "numbers", "guess": "numbers", "parts": "word"},
    ),
    "arm.replace": (
        ARM.replace,
        {"joint_errors": np.zeros((3, 6))},
        {"joint_errors": "one or many"},
    ),
    "arm.save": (
        ARM.save,
        {"path": "arm.toml", "comment": "# of a test"},
        {"path": "path", "comment": "comment"},
    ),
    "Load": (
        pk.Load,
        {"mass": 1.0, "centre": np.zeros(3), "force": np.ones(3), "moment": np.ones(3)},
        {"mass": "numbers", "centre": "numbers", "force": "numbers", "moment": "numbers"},
    ),
    "stiffness": (
        pk.stiffness,
        {"robot": YIELDING, "poses": POSES, "at": np.zeros(3)},
        {"robot": "machine", "poses": "numbers", "at": "numbers"},
    ),
    "compliance_table": (
        pk.compliance_table,
        {"robot": YIELDING, "pose": POSES[0], "rated": 500.0},
        {"robot": "machine", "pose": "numbers", "rated": "positive"},
    ),
    "sensitivity": (
        pk.sensitivity,
        {"robot": ROBOT, "poses": POSES, "step": 1.0, "cases": "offset*"},
        {"robot": "parallel", "poses": "numbers", "step": "number", "cases": "names"},
    ),
    "tolerance": (
        pk.tolerance,
        {
            "robot": ROBOT,
            "poses": POSES[:1],
            "sigma": 0.1,
            "samples": 10,
            "seed": 0,
            "executor": None,
            "progress": None,
        },
        {
            "robot": "parallel",
            "poses": "numbers",
            "sigma": "number",
            "samples": "count",
            "seed": "count",
            "executor": "executor",
            "progress": "function",
        },
    ),
    "allocate_tolerance": (
        pk.allocate_tolerance,
        {"robot": ROBOT, "poses": POSES[:1], "allowed": 0.1, "joints": ["base*"], "samples": 10},
        {
            "robot": "parallel",
            "poses": "numbers",
            "allowed": "positive",
            "joints": "names",
            "cost": "one or by name",
            "samples": "count",
            "seed": "count",
            "executor": "executor",
        },
    ),
    "Measurements": (
        pk.Measurements,
        {"actuators": Q, "values": POSES[:, :3], "kind": "position"},
        {
            "actuators": "numbers",
            "values": "numbers",
            "kind": "word",
            "sigma": "numbers",
            "target": "numbers",
            "target_index": "numbers",
            "actuator_units": "names",
        },
    ),
    "select": (MEASURED.select, {"rows": [0, 1]}, {"rows": "numbers"}),
    "split": (
        MEASURED.split,
        {"holdout": 0.5, "seed": 0},
        {"holdout": "positive", "seed": "count"},
    ),
    "write": (
        MEASURED.write,
        {"path": "probe.csv", "comment": "# of a test"},
        {"path": "path", "comment": "comment"},
    ),
    "probed": (
        pk.probed,
        {"robot": pk.load("linear-delta"), "points": [[0.0, 0.0, 0.2]], "offset": [0.0, 0.0, 0.0]},
        {"robot": "robot", "points": "numbers", "offset": "numbers"},
    ),
    "from_pnp": (
        pk.from_pnp,
        {
            "measurements": pk.Measurements([[500.0] * 6], [[0, 0, 900, 0, 0, 0]], "pose"),
            "focal": 1000.0,
            "board": (100.0, 80.0),
            "on": "base",
            "noise": 0.1,
        },
        {
            "measurements": "measurements",
            "focal": "number",
            "board": "numbers",
            "on": "word",
            "noise": "number",
        },
    ),
    "locate_anchors": (
        pk.locate_anchors,
        {"robot": BELTS, "actuators": BELTS.inverse(BELTS.home + PLACES)},
        {"robot": "robot", "actuators": "numbers"},
    ),
    "compensate_program": (
        pk.compensate_program,
        {
            "controller": pk.load("hexapod"),
            "calibrated": pk.load("hexapod"),
            "path": "a.gcode",
            "firmware": "marlin",
        },
        {"controller": "robot", "calibrated": "robot", "path": "path", "firmware": "word"},
    ),
    "read_measurements": (pk.read_measurements, {"path": "probe.csv"}, {"path": "path"}),
    "Tracker": (
        pk.Tracker,
        {"range": 0.01, "azimuth": 1e-5, "elevation": 1e-5, "position": (3000, 0, 0)},
        {
            "range": "positive",
            "azimuth": "positive",
            "elevation": "positive",
            "position": "numbers",
        },
    ),
    "covariance": (
        pk.Tracker(0.01, 1e-5, 1e-5, position=(3000, 0, 0)).covariance,
        {"points": POSES[:, :3]},
        {"points": "numbers"},
    ),
    "VirtualMachine": (
        pk.VirtualMachine,
        {"true_robot": ROBOT, "noise": 0.02, "seed": 0, "angle_noise": 1e-4},
        {"true_robot": "robot", "noise": "number", "seed": "count", "angle_noise": "number"},
    ),
    "measure": (
        pk.VirtualMachine(ROBOT).measure,
        {"q": Q, "kind": "position", "target": [0, 0, 50.0]},
        {"q": "numbers", "kind": "word", "target": "numbers"},
    ),
    "identify": (
        pk.identify,
        {"robot": ROBOT, "measurements": MEASURED, "free": "offset*"},
        {
            "robot": "robot",
            "measurements": "measurements",
            "free": "names",
            "prior": "one or by name",
            "loss": "names",
            "unknown": "names",
            "holdout": "positive",
            "bounds": "by name",
        },
    ),
    "accuracy": (
        FOUND.accuracy,
        {"poses": POSES, "target": [0, 0, 50.0]},
        {"poses": "numbers", "target": "numbers"},
    ),
    "plot": (FOUND.plot, {"path": "residuals.png"}, {"path": "path"}),
    "report": (
        FOUND.report,
        {"folder": "report", "pdf": False},
        {"folder": "path", "files": "text", "pdf": "flag"},
    ),
    "diagnose": (
        pk.diagnose,
        {"found": FOUND},
        {"found": "identification"},
    ),
    "bootstrap": (
        pk.bootstrap,
        {"found": FOUND, "replicates": 4, "seed": 0},
        {
            "found": "identification",
            "replicates": "count",
            "seed": "count",
            "executor": "executor",
        },
    ),
    "plan_poses": (
        pk.plan_poses,
        {"robot": ROBOT, "candidates": POSES, "count": 3, "free": "offset*"},
        {
            "robot": "robot",
            "candidates": "numbers",
            "count": "count",
            "targets": "numbers",
            "criterion": "word",
            "kind": "word",
            "target": "numbers",
            "noise": "positive",
            "free": "names",
            "prior": "one or by name",
            "unknown": "names",
            "travel_weight": "number",
        },
    ),
    "next_pose": (
        pk.next_pose,
        {"robot": ROBOT, "candidates": POSES, "free": "offset*"},
        {
            "robot": "robot",
            "candidates": "numbers",
            "targets": "numbers",
            "criterion": "word",
            "kind": "word",
            "target": "numbers",
            "noise": "positive",
            "free": "names",
            "prior": "one or by name",
            "unknown": "names",
        },
    ),
    "plan_poses, accuracy": (
        pk.plan_poses,
        {"robot": ROBOT, "candidates": POSES, "accuracy": 1.0, "free": "offset*"},
        {"accuracy": "positive"},
    ),
    "compensate": (
        pk.compensate,
        {"robot": ROBOT, "desired": POSES, "measured": POSES},
        {
            "robot": "parallel",
            "desired": "numbers",
            "measured": "numbers",
            "method": "word",
            "orientation": "word",
            "match": "names",
            "common": "flag",
            "passes": "count",
            "seed": "count",
            "bounds": "positive",
            "swarm": "identification",
        },
    ),
    "correction_grid": (
        pk.correction_grid,
        {"robot": ROBOT, "calibrated": ROBOT, "axes": {"x": [-10, 10]}},
        {"robot": "parallel", "calibrated": "parallel", "axes": "by name", "method": "word"},
    ),
    "pso": (
        pk.pso,
        {
            "objective": lambda x: (x**2).sum(axis=1),
            "lower": [-1.0],
            "upper": [1.0],
            "particles": 5,
            "iterations": 2,
        },
        {
            "objective": "function",
            "lower": "numbers",
            "upper": "numbers",
            "particles": "count",
            "iterations": "count",
            "inertia": "number",
            "cognitive": "number",
            "social": "number",
            "seed": "count",
            "patience": "count",
            "tolerance": "number",
            "progress": "function",
        },
    ),
    "study_cases": (
        pk.study_cases,
        {"robot": FLAT, "study": "offsets"},
        {"robot": "parallel", "study": "word"},
    ),
    "SwarmSettings": (
        pk.SwarmSettings,
        {"particles": 5},
        {
            "particles": "count",
            "iterations": "count",
            "inertia": "number",
            "cognitive": "number",
            "social": "number",
        },
    ),
    "LimbResidual": (
        pk.LimbResidual,
        {"robot": ROBOT, "poses": POSES, "actuators": Q, "free": "offset*"},
        {"robot": "parallel", "poses": "numbers", "actuators": "numbers", "free": "names"},
    ),
    "check_geometry": (pk.check_geometry, {"robot": ROBOT}, {"robot": "robot"}),
    "dexterity": (
        pk.dexterity,
        {"robot": ROBOT, "poses": POSES},
        {"robot": "parallel", "poses": "numbers"},
    ),
    "tensions": (
        pk.tensions,
        {"robot": BELTS, "poses": POSES, "force": [0, 0, -9.81], "at": [0, 0, 1], "least": 1.0},
        {
            "robot": "parallel",
            "poses": "numbers",
            "force": "numbers",
            "at": "numbers",
            "least": "number",
        },
    ),
    "workspace": (
        pk.workspace,
        {"robot": FLAT, "axes": {"y": (-10, 10, 3)}, "at": FLAT.home},
        {"robot": "parallel", "axes": "by name", "at": "numbers"},
    ),
    "sample_poses": (
        pk.sample_poses,
        {"robot": ROBOT, "count": 3, "seed": 0, "share": 0.5},
        {"robot": "parallel", "count": "count", "seed": "count", "share": "number"},
    ),
    "exp": (
        screw.exp,
        {"twist": [0, 0, 1.0, 0, 0, 0], "angle": 1.0},
        {"twist": "numbers", "angle": "numbers"},
    ),
    "log": (screw.log, {"motion": TARGETS}, {"motion": "numbers"}),
    "adjoint": (screw.adjoint, {"motion": TARGETS}, {"motion": "numbers"}),
    "to_pose": (screw.to_pose, {"motion": TARGETS}, {"motion": "numbers"}),
    "from_pose": (screw.from_pose, {"pose": POSES}, {"pose": "numbers"}),
    "joint_error": (screw.joint_error, {"dx": 0.1}, {"dx": "number", "dpsi": "number"}),
    "seen_from": (
        screw.joint_error(0.1).seen_from,
        {"frame": np.eye(4)},
        {"frame": "numbers"},
    ),
    **{
        law.__name__: (
            law,
            {"start": [0.0], "end": [1.0], "duration": 1.0},
            {"start": "numbers", "end": "numbers", "duration": "positive"},
        )
        for law in (trajectory.cubic, trajectory.quintic)
    },
    "sample": (trajectory.cubic(0.0, 1.0, 1.0).sample, {"t": 0.5}, {"t": "numbers"}),
    "jerk_limited": (
        trajectory.jerk_limited,
        {"start": [0.0], "end": [1.0], "velocity": 1.0, "acceleration": 1.0, "jerk": 1.0},
        {
            "start": "numbers",
            "end": "numbers",
            "velocity": "numbers",
            "acceleration": "numbers",
            "jerk": "numbers",
        },
    ),
    "move": (
        trajectory.move,
        {
            "robot": FLAT,
            "start": FLAT.home,
            "end": AWAY,
            "duration": 1.0,
            "law": "cubic",
            "space": "joint",
        },
        {
            "robot": "parallel",
            "start": "numbers",
            "end": "numbers",
            "duration": "positive",
            "law": "word",
            "space": "word",
            "velocity": "numbers",
            "acceleration": "numbers",
            "jerk": "numbers",
        },
    ),
}
NOT_HERE = {"path", "folder", "images"}  # files of these calls do not exist, or would be written
EVERY = [(name, argument) for name, (_, _, kinds) in CALLS.items() for argument in kinds]


@pytest.mark.parametrize(("name", "argument"), EVERY, ids=lambda each: str(each))
def test_a_wrong_argument_is_refused_by_name(name: str, argument: str) -> None:
    call, fitting, kinds = CALLS[name]
    optional = inspect.signature(call).parameters[argument].default is None
    for wrong in WRONG[kinds[argument]]:
        if wrong is None and optional:
            continue
        with pytest.raises((ValueError, TypeError)) as refused:
            call(**fitting | {argument: wrong})
        told = str(refused.value)
        first = re.split(r"\W+", told)[:5]
        assert argument in first or argument.rstrip("s") in first, (wrong, told)
        assert "found" in told or "known: " in told or "nonsense" in told, (wrong, told)


@pytest.mark.parametrize("name", [n for n, (_, f, _) in CALLS.items() if not NOT_HERE & set(f)])
def test_the_arguments_that_are_to_fit_do(name: str) -> None:
    call, fitting, _ = CALLS[name]
    call(**fitting)


def test_every_public_call_is_among_them() -> None:
    results = {  # made by calls, not by users
        *("Allocation", "ArmInverse", "Assemblies", "Bootstrap", "Certificate", "Compensation"),
        *("CircularTest", "Datum", "Drift", "LawTest", "ScrewTable", "SlackCable", "Tensions"),
        "Detection",
        "MeasuringOrder",
        *(
            "CorrectedProgram",
            "LocatedAnchors",
            "CorrectionGrid",
            "Dexterity",
            "Event",
            "Jump",
            "Feasibility",
            "Finding",
            "Forward",
        ),
        *("Geometry", "GeometryCheck", "Identification", "Move", "MoveSample", "Plan"),
        *(
            "ComplianceTable",
            "DHTable",
            "Distances",
            "Stiffness",
            "Moved",
            "Sensitivity",
            "Verdict",
            "SwarmResult",
            "Tolerance",
            "Workspace",
        ),
    }
    raised = {"ArgumentError", "ArgumentTypeError", "CalibrationWarning", "Error", "FileError"}
    records = {  # the calls that take them look at them
        *("Check", "Remedy", "Said"),
        *("Backlash", "Coupling", "Elasticity", "Expansion", "Harmonics", "Sag"),
    }
    no_calls = {
        "show",
        "machines",
        "CHECKS",
        "CONSTRICTION",
        "NextPose",  # `next_pose` makes it
        "export",
        "screw",
        "trajectory",
        "readings",
    }
    for name in set(pk.__all__) - results - raised - records - no_calls:
        assert name in CALLS, name
    checked = {call.__name__ for call, _, _ in CALLS.values()}
    for module in (screw, trajectory):
        public = getattr(module, "__all__", None) or [
            name
            for name, each in vars(module).items()
            if inspect.isfunction(each) and each.__module__ == module.__name__
        ]
        missing = {n for n in public if inspect.isfunction(getattr(module, n))} - checked
        assert not {name for name in missing if not name.startswith("_")} - ELSEWHERE, missing


# Tested row by row with the arms, or not for users.
ELSEWHERE = {"exp_jacobian", "log_jacobian", "at_points", "as_motions"}


def test_a_comment_cannot_spoil_the_file_that_it_heads(tmp_path: Path) -> None:
    place = tmp_path / "robot.toml"
    ROBOT.save(place, "# two\n\n# lines")
    assert pk.load(place).geometry.values.tolist() == ROBOT.geometry.values.tolist()
    with pytest.raises(ValueError, match="must start with #, found 'lines'"):
        ROBOT.save(tmp_path / "other.toml", "# two\nlines")
    assert not (tmp_path / "other.toml").exists()


def test_what_is_long_is_told_by_its_class() -> None:
    assert arguments.shown("abc") == "'abc'" and arguments.shown(np.zeros(9)).startswith("array")
    assert arguments.shown(np.zeros((99, 9))) == "ndarray"


def test_a_time_that_is_no_number_has_no_place() -> None:
    for law in (
        trajectory.cubic([0.0], [1.0], 2.0),
        trajectory.jerk_limited([0.0], [1.0], 1.0, 1.0, 1.0),
    ):
        found = np.array(law.sample([0.0, np.nan, 1.0]))
        assert np.isnan(found[:, 1]).all() and np.isfinite(found[:, [0, 2]]).all()


@pytest.mark.parametrize(
    ("call", "named"),
    [
        (lambda r: pk.workspace(r, {"x": ([1, 2], 10, 3)}), r"axes: x must be \(low, high"),
        (lambda r: pk.workspace(r, {"x": (-10, 10, 1e308)}), "axes: x must have at most"),
        (lambda r: pk.workspace(r, {"x": (-10, 10, 3)}, np.zeros((0, 6))), "at must have shape"),
        (lambda r: r.forward_all(r.inverse(r.home), starts=10**59), "starts must be a whole"),
        (lambda r: pk.correction_grid(r, r, {"x": [[1, 2], [3]]}), r"axes\['x'\] must have"),
        (lambda r: pk.VirtualMachine(r, noise=10**400), "noise must be finite"),
    ],
)
def test_numbers_beyond_reason_and_ragged_lists_are_refused_by_name(call, named) -> None:
    with pytest.raises(pk.Error, match=named):
        call(pk.load("hexapod"))


@pytest.mark.filterwarnings("error")
def test_a_scalar_of_single_precision_is_the_number_it_is() -> None:
    robot, given = pk.load("hexapod"), np.float32(0.1)
    one, other = (pk.sensitivity(robot, robot.home, step).linear for step in (given, float(given)))
    np.testing.assert_array_equal(one, other)
    assert (
        pk.VirtualMachine(robot, noise=given).measure(robot.inverse(robot.home)).sigma is not None
    )


def test_a_move_may_be_sampled_at_no_time() -> None:
    robot = pk.load("hexapod")
    end = robot.home + np.eye(6)[0]
    sampled = pk.trajectory.move(robot, robot.home, end, duration=1.0).sample([])
    assert sampled.pose.shape == (0, 6) and sampled.actuators.shape == (0, 6)


def test_what_is_masked_is_not_there() -> None:
    """Numbers under a mask are no numbers: their rows fail as rows with NaN do, or are refused."""
    robot = pk.load("hexapod")
    poses = np.ma.array(pk.sample_poses(robot, 3))
    poses[1, 2] = np.ma.masked
    given = poses.filled(np.nan)
    for call in (
        robot.inverse,
        lambda each: robot.forward(each + 900.0).pose,
        robot.violation,
        lambda each: robot.feasible(each).ok,
        lambda each: pk.screw.exp(each, 1.0),
        lambda each: pk.dexterity(robot, each).conditioning,
    ):
        np.testing.assert_array_equal(call(poses), call(given))
    whole = np.ma.array([[1, 2, 3, 4, 5, 6]], mask=[[1, 0, 0, 0, 0, 0]])
    assert np.isnan(robot.inverse(whole)).all()
    q = robot.inverse(pk.sample_poses(robot, 3))
    measured = pk.Measurements(q, poses[:, :3], "position", sigma=0.01)
    assert np.isnan(measured.values[1, 2]) and np.isfinite(measured.values).sum() == 8
    with pytest.raises(pk.ArgumentError, match="actuators must be finite"):
        pk.Measurements(np.ma.array(q, mask=q == q[0, 0]), given[:, :3], "position")
