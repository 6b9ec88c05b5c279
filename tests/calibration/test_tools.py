"""The pose of what was measured on the platform is not known: it is found along."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import pkmcal as pk
from pkmcal.arrays import FloatArray
from pkmcal.estimation.equations import Equations
from pkmcal.estimation.fit_data import FitData
from pkmcal.estimation.free_parameters import parameters
from pkmcal.estimation.parameters import Asked
from pkmcal.estimation.starts import with_starts
from pkmcal.kinematics.robot import Robot
from pkmcal.measurements.measurements import Measurements
from pkmcal.readings.hand_eye import of_frame_and_tool, of_tool, turned_alike

from ..simulated import hexapod_poses

TOOLS = {
    "slightly turned": [12.0, -30.0, 80.0, 0.05, -0.1, 0.2],
    "across": [40.0, 20.0, -60.0, 0.3, np.pi / 2, -0.4],  # where its angles have no rates
    "upside down": [0.0, 0.0, 100.0, np.pi, 0.0, 1.0],
}
STANDS = [[900.0, -400.0, 250.0, 0.2, -0.4, 2.5], [-300.0, 700.0, 50.0, -2.0, 0.6, 0.3]]


def carried(measured: Measurements, frame: list[float] | None, tool: list[float]) -> Measurements:
    """Poses of a tool on the platform, as an instrument reads them in whose frame the base is."""
    motions = pk.screw.from_pose(measured.values) @ pk.screw.from_pose(tool)
    if frame is not None:
        motions = pk.screw.from_pose(frame) @ motions
    return dataclasses.replace(measured, values=pk.screw.to_pose(motions))


def off(found: FloatArray, true: list[float]) -> FloatArray:
    """How far two poses are apart, mm and rad."""
    between = np.linalg.inv(pk.screw.from_pose(found)) @ pk.screw.from_pose(np.array(true))
    return np.abs(pk.screw.to_pose(between))


def read(hexapod: Robot, true: Robot, seed: int, count: int = 25) -> Measurements:
    rng = np.random.default_rng(seed)
    q = hexapod.inverse(hexapod_poses(hexapod, count, rng))
    return pk.VirtualMachine(true, 0.02, seed).measure(q, "pose")


@pytest.mark.parametrize("tool", TOOLS.values(), ids=TOOLS)
def test_closed_forms_find_frame_and_tool(hexapod: Robot, tool: list[float]) -> None:
    poses = hexapod_poses(hexapod, 12, np.random.default_rng(1))
    exact = Measurements(poses, poses, "pose")
    assert off(of_tool(carried(exact, None, tool).values, poses), tool).max() < 1e-9
    frame, own = of_frame_and_tool(carried(exact, STANDS[0], tool).values, poses)
    assert off(own, tool).max() < 1e-6 and off(frame, STANDS[0]).max() < 1e-6


def test_a_tool_that_poses_do_not_tell_stays_unturned() -> None:
    """Poses that never turn: any turning of the tool can be one of the frame."""
    poses = np.zeros((8, 6))
    poses[:, :3] = np.random.default_rng(2).uniform(-100, 100, (8, 3))
    exact = Measurements(poses, poses, "pose")
    frame, tool = of_frame_and_tool(carried(exact, STANDS[0], [0.0] * 6).values, poses)
    assert off(tool, [0.0] * 6).max() < 1e-9 and off(frame, STANDS[0]).max() < 1e-9


@pytest.mark.parametrize(
    ("count", "turning", "noise", "odd"),
    [
        (30, 0.3, 1e-3, 0),
        (30, 0.3, 0.1, 0),
        (5, 0.3, 1e-3, 2),
        (30, 1.5, 1e-3, 9),
    ],
)
def test_frame_and_tool_are_turned_as_if_the_best_of_each_were_taken_in_turn(
    count: int, turning: float, noise: float, odd: int
) -> None:
    """Which takes hundreds of rounds; also beside poses that are of something else."""
    random = np.random.default_rng(1)

    def drawn(count: int, most: float) -> FloatArray:
        turned: FloatArray = Rotation.from_rotvec(
            random.uniform(-most, most, (count, 3))
        ).as_matrix()
        return turned

    for _ in range(3):
        p, (frame, tool) = drawn(count, turning), drawn(2, 3.0)
        m = frame @ p @ tool @ drawn(count, noise)
        m[:odd] = drawn(odd, 3.0) @ m[:odd]
        start = tool.T @ drawn(1, 0.3)[0]
        one, other = turned_alike(m, p, start)
        back = start
        for _ in range(700):
            turn = Rotation.from_matrix((m @ back @ p.transpose(0, 2, 1)).sum(axis=0)).as_matrix()
            back = Rotation.from_matrix((m.transpose(0, 2, 1) @ turn @ p).sum(axis=0)).as_matrix()
        for right, found in ((turn, one), (back, other)):
            np.testing.assert_allclose(found, right, atol=1e-7)


@pytest.mark.parametrize("framed", [False, True], ids=["frame known", "frame unknown"])
@pytest.mark.parametrize("tool", TOOLS.values(), ids=TOOLS)
def test_a_tool_is_found_without_a_start_near_it(
    hexapod: Robot, tool: list[float], framed: bool
) -> None:
    true = hexapod.replace({"base1.x": hexapod.geometry["base1.x"] + 0.8, "offset2": 0.5})
    seen = carried(read(hexapod, true, 3), STANDS[0] if framed else None, tool)
    found = pk.identify(
        hexapod, seen, ["base1.x", "offset2"], holdout=0.2,
        unknown=["frame", "target"] if framed else "target",
    )  # fmt: skip
    names = [f"tool.{c}" for c in ("x", "y", "z", "alpha", "beta", "gamma")]
    mine = [found.free.index(name) for name in names]
    assert found.free[-6:] == tuple(names)
    assert 0.6 < found.chi2_per_dof < 1.4 and found.verdict.state == "calibrated"
    far = off(found.values[mine], tool)
    assert far[:3].max() < 0.5 and far[3:].max() < 1e-3
    for name in ("base1.x", "offset2"):
        place = found.free.index(name)
        assert abs(found.values[place] - true.geometry[name]) < 4 * found.stderr[place]
    if framed:
        at = [found.free.index(f"frame.{c}") for c in ("x", "y", "z", "alpha", "beta", "gamma")]
        assert off(found.values[at], STANDS[0])[:3].max() < 0.5


def test_one_tool_for_two_frames_or_one_a_session(hexapod: Robot) -> None:
    tool = TOOLS["across"]
    sets = [
        dataclasses.replace(carried(read(hexapod, hexapod, 5 + k), stand, tool), session=day)
        for k, (stand, day) in enumerate(zip(STANDS, ("monday", "thursday"), strict=True))
    ]
    common = pk.identify(
        hexapod, sets, "offset1", unknown=["frame", "target"], per_session="frame*"
    )
    assert len(common.free) == 1 + 12 + 6 and 0.6 < common.chi2_per_dof < 1.4
    each = pk.identify(
        hexapod, sets, "offset1", unknown=["frame", "target"],
        per_session=["frame*", "tool*"],
    )  # fmt: skip
    assert "tool.x@monday" in each.free and "tool.gamma@thursday" in each.free
    assert 0.6 < each.chi2_per_dof < 1.4
    held = pk.identify(
        hexapod, sets[0], "offset1", unknown=["frame", "target"], holdout=sets[1],
        per_session="frame*",
    )  # fmt: skip
    assert len(held.holdout_parameters) == 6 and not held.holdout_contradicts


@pytest.mark.parametrize("framed", [False, True])
def test_derivatives_by_a_tool_are_those_of_differences(hexapod: Robot, framed: bool) -> None:
    seen = carried(read(hexapod, hexapod, 4, count=6), None, TOOLS["slightly turned"])
    (data,) = with_starts(hexapod, [FitData(seen, np.arange(6), framed, True)])
    equations = Equations.of([data], parameters(hexapod, [data], Asked("offset1")))
    first = equations.parameters.motions[-1]
    origin = dict(equations.parameters.origin) | {first: np.array(TOOLS["across"])}
    equations = equations.with_parameters(dataclasses.replace(equations.parameters, origin=origin))
    rng = np.random.default_rng(0)
    at = equations.parameters.start + 0.1 * rng.standard_normal(len(equations.parameters))
    (jacobian,) = equations.jacobian(equations.at(at))
    for j in range(len(at)):
        step = np.zeros(len(at))
        step[j] = 1e-5
        low, high = (equations.at(at + s).residuals[0] for s in (-step, step))
        np.testing.assert_allclose((low - high) / 2e-5, jacobian[:, :, j], atol=2e-5)
