"""What is called the misfit before a calibration is that of the machine alone.

Of a machine that is as it was designed the readings then miss by their noise, whatever else about
them is unknown, and wherever the search for it begins.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import pkmcal as pk
from pkmcal.readings import Distance, Touch

from ..simulated import with_errors
from .cases import CASES, NOISE, TIP, Case

FRAME = ("x", "y", "z", "alpha", "beta", "gamma")
WRONG = np.array([25.0, -15.0, -40.0])  # mm, that points are stated beside where they are

# What can be unknown, where that is more than the cases of a kind have
MORE: Mapping[str, Mapping[str, str]] = {
    "distance": {"target": "unknown", "attachment": "unknown"},
    "relative-distance": {"target": "unknown", "attachment": "unknown"},
    "height": {"frame": "unknown", "target": "unknown"},
    "orientation": {"frame": "unknown", "target": "unknown"},
    "tilt": {"frame": "unknown"},
    **{f"touch {artefact}": {"target": "unknown"} for artefact in ("point", "line", "plane")},
    "touch sphere": {"target": "unknown"},
}
READ = [case for case in CASES if case.name != "closure"]


def beside(measured: pk.Measurements) -> pk.Measurements:
    """The measurements with every point that is stated at another place than it is."""
    changes: dict[str, Any] = {}
    if measured.target is not None:
        places, index = np.unique(measured.targets, axis=0, return_inverse=True)
        changes["target"] = places + WRONG
        changes["target_index"] = index.reshape(-1)
        if len(places) == 1:
            changes = {"target": places[0] + WRONG}
    instrument = measured.instrument
    if isinstance(instrument, Distance):
        changes["kind"] = dataclasses.replace(instrument, attachment=TIP - WRONG)
    return dataclasses.replace(measured, **changes)


@pytest.mark.parametrize("case", READ, ids=lambda case: case.name)
def test_a_machine_as_it_was_designed_is_off_by_the_noise(case: Case) -> None:
    robot = pk.load(case.machine)
    unknown: Any = {**case.unknown, **MORE.get(case.name, {})}
    measured = case.measured(robot, case.rows, 4, NOISE)
    if "target" in unknown:
        measured = beside(measured)
    free = "offset*" if "offset1" in robot.geometry.names else None
    found = pk.identify(robot, measured, free, prior=1e-6, unknown=unknown)
    assert found.rms_before < 1.03 * found.rms
    assert found.rms < 1.1 * NOISE * np.sqrt(len(measured.components))
    # "before", the first of the history and the values at the start are of one state
    if not found.fit.uncertainty.mixed:  # else of poses that are fitted as well
        assert found.history[0] == pytest.approx(found.rms_before, rel=1e-12)
    values = found.fit.parameters.reported(found.fit.start.theta)
    np.testing.assert_array_equal(found.start, values[found.columns])


@pytest.mark.parametrize("case", [c for c in READ if "pixel" in c.name], ids=lambda case: case.name)
def test_of_a_machine_as_it_was_designed_the_lens_is_not_doubted(case: Case) -> None:
    """Another lens that fits worse was named where corners are far less off than 0.3 px."""
    robot = pk.load(case.machine)
    for seed in range(2):
        measured = case.measured(robot, case.rows, seed, NOISE)
        found = pk.identify(robot, measured, "offset*", unknown=case.unknown)
        said = [each.check for each in found.verdict.said if each.level != "remark"]
        assert "doubtful-readings" not in said


@pytest.mark.filterwarnings("ignore")  # of a machine that is held
@pytest.mark.parametrize("noise", [0.02, None])
def test_closures_before_are_those_of_the_frame_that_the_table_says(noise: float | None) -> None:
    """Held at the values of the column "start", a fit leaves what is called before."""
    robot, rng = pk.load("hexapod"), np.random.default_rng(0)
    names = robot.geometry.match(["base*", "offset*"])
    true = robot.replace({n: robot.geometry[n] + 0.3 * rng.normal() for n in names})
    q = robot.inverse(pk.sample_poses(robot, 30, seed=1, share=0.5))
    base = pk.screw.from_pose(np.array([[100.0, 200, 50, 0.3, 0.1, -0.4]]))
    read = pk.screw.to_pose(base @ pk.screw.from_pose(true.forward(q).pose))
    read += rng.normal(size=read.shape) * [*[0.02] * 3, *[5e-5] * 3]
    sigma = [*[0.02] * 3, *[5e-5] * 3]
    m = pk.Measurements(q, read, "pose", sigma=sigma, actuator_sigma=noise)
    found = pk.identify(robot, m, names, unknown="frame")
    assert found.free[-6:] == tuple(f"frame.{each}" for each in FRAME)
    frame = pk.screw.from_pose(found.start[None, -6:])
    there = pk.screw.to_pose(np.linalg.inv(frame) @ pk.screw.from_pose(read))
    held = pk.Measurements(q, there, "pose", sigma=sigma, actuator_sigma=noise)
    alone = pk.identify(robot, held, "offset1", prior=1e-9)
    assert found.rms_before == pytest.approx(alone.rms_before, rel=1e-3)
    if noise is None:
        assert found.history[0] == pytest.approx(found.rms_before, rel=1e-12)
    else:
        assert found.closure_rms_before == pytest.approx(alone.closure_rms_before, rel=1e-3)


@pytest.mark.filterwarnings("ignore")  # errors that no free number explains
@pytest.mark.parametrize(
    ("machine", "sigma"),
    [("hexapod", 0.0), ("hexapod", 0.5), ("3rps", 0.5), ("linear-delta-6", 0.5), ("3r", 0.0)],
)
def test_before_is_what_tip_and_sockets_cannot_explain_of_touches(
    machine: str, sigma: float
) -> None:
    """At the nominal poses p + R tip - socket is linear in both: solved here by NumPy."""
    robot, rng = pk.load(machine), np.random.default_rng(5)
    true = with_errors(robot, sigma, rng) if sigma else robot
    if isinstance(robot, pk.SerialArm):
        q = rng.uniform(-1.0, 1.0, (60, 3))
    else:
        q = robot.inverse(pk.sample_poses(robot, 60, seed=3), match=True)
    names = np.array(["A", "B", "C"])[np.arange(60) % 3]
    places = {"A": [20.0, -40, 980], "B": [-60.0, 30, 1020], "C": [50.0, 70, 990]}
    measured = pk.VirtualMachine(true, NOISE, 2).measure(q, Touch(names, places=places), TIP)
    unstated = dataclasses.replace(measured, target=None)
    free = None if machine == "3r" else "offset*"
    found = pk.identify(robot, unstated, free, prior=0.5, unknown={"target": "unknown"})
    if isinstance(robot, pk.SerialArm):
        motion = robot.forward(q)
        turn, place = motion[:, :3, :3], motion[:, :3, 3]
    else:
        pose = robot.forward(q).pose
        turn, place = Rotation.from_euler("xyz", pose[:, 3:]).as_matrix(), pose[:, :3]
    lever = np.zeros((60, 3, 12))
    lever[:, :, :3] = turn
    for k, name in enumerate("ABC"):
        lever[names == name, :, 3 + 3 * k : 6 + 3 * k] = -np.eye(3)
    read = measured.values - place
    solved = np.linalg.lstsq(lever.reshape(180, 12), read.ravel(), rcond=1e-9)[0]
    left = read - lever @ solved
    assert found.rms_before == pytest.approx(np.sqrt((left**2).sum(axis=1).mean()), rel=0.03)
    if not sigma:
        assert found.rms_before < 2.0 * NOISE
