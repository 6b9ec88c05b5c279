"""Where something is chosen, rounding does not choose.

Inputs that differ in their last bit, and linear algebra libraries that sum in another order, lead
to the same choice: of poses to measure, of the combinations that are named, of outliers, of the
order of assembly modes. OpenBLAS has kernels for several processors; its variable
``OPENBLAS_CORETYPE`` takes those that this processor can run.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.arms.inputs import joint_frames
from pkmcal.geometry.chain_joints import across
from pkmcal.geometry.limbs import Cone
from pkmcal.kinematics.independent import independent_numbers
from pkmcal.modes.find import frames_of
from pkmcal.planning.optimal_design import CRITERIA
from pkmcal.readings.alignment import PointPairs, of_points
from pkmcal.statistics.shifts import shifted

from .robots import made, ring
from .workspaces import CHAINS, WORKSPACE, poses

KERNELS = {  # and what a processor needs for them
    "Nehalem": "sse4_2",
    "Sandybridge": "avx",
    "Haswell": "avx2",
    "Zen": "avx2",
    "SkylakeX": "avx512f",
}
SEEDS = range(1, 3)
MACHINES = (*WORKSPACE, "3r")
SYMMETRIC = ("agile-eye", "tripteron", "eclipse", "rbt-6t03p", "linear-delta-6")


def moved(numbers: np.ndarray, seed: int) -> np.ndarray:
    """Each number by one unit in the last place, up or down; not at all for seed 0."""
    if seed == 0:
        return numbers
    ends = np.random.default_rng(seed).choice([-np.inf, np.inf], numbers.shape)
    return np.nextafter(numbers, ends)


def places(name: str, count: int) -> np.ndarray:
    """Candidates to measure: poses, of the arm joint coordinates."""
    if name == "3r":
        return np.random.default_rng(0).uniform(-1.7, 1.7, (count, 3))
    return pk.sample_poses(pk.load(name), count)


def plan(name: str, criterion: Any, count: int, seed: int, weight: float = 0.0) -> list[int]:
    candidates = moved(places(name, 40), seed)
    found = pk.plan_poses(
        pk.load(name), candidates, count, criterion=criterion, kind="pose", travel_weight=weight
    )
    return found.indices.tolist()


def statements(name: str, seed: int) -> list[Any]:
    """What a calibration of all numbers, with one bad row, says in words and row numbers."""
    robot = pk.load(name)
    q = moved(np.asarray(pk.plan_poses(robot, places(name, 60), 50, kind="pose").actuators), seed)
    measured = pk.VirtualMachine(robot, 0.01).measure(q, "pose")
    values = measured.values.copy()
    values[[7, 20], 0] += 3.0
    pattern = "joint*" if name == "3r" else ["base*", "platform*", "offset*"]
    found = pk.identify(robot, pk.Measurements(q, values, "pose", sigma=measured.sigma), pattern)
    pairs = [(a, b) for a, b, value in found.correlations if abs(value) > 0.9999]
    return [found.rank, list(found.unidentifiable), list(found.outliers), pairs]


def modes(name: str, seed: int) -> list[list[float]]:
    """R and p of all assembly modes at home, where symmetric machines have them in pairs."""
    robot = pk.load(name)
    found = robot.forward_all(moved(robot.inverse(robot.home), seed))
    return (frames_of(found.poses).round(6) + 0.0).tolist()


@pytest.mark.parametrize("criterion", CRITERIA)
@pytest.mark.parametrize("name", MACHINES)
def test_the_last_bit_of_the_candidates_does_not_choose_a_plan(name: str, criterion: str) -> None:
    for count in (4, 10):  # too few to identify everything, and enough
        plans = [plan(name, criterion, count, seed) for seed in (0, *SEEDS)]
        assert all(other == plans[0] for other in plans[1:])


@pytest.mark.parametrize("name", MACHINES)
def test_the_last_bit_of_the_candidates_does_not_choose_a_tour(name: str) -> None:
    plans = [plan(name, "prediction", 8, seed, weight=0.5) for seed in (0, *SEEDS)]
    assert all(other == plans[0] for other in plans[1:])


@pytest.mark.filterwarnings("ignore::pkmcal.exceptions.CalibrationWarning")
@pytest.mark.parametrize("name", ["hexapod", "3rps", "2tpr2tps", "rotary-delta", "3r"])
def test_the_last_bit_of_the_actuators_does_not_change_what_is_said(name: str) -> None:
    said = [statements(name, seed) for seed in (0, *SEEDS)]
    assert said[0][2] == [7, 20]
    assert all(other == said[0] for other in said[1:])


@pytest.mark.parametrize("name", WORKSPACE)
def test_the_last_bit_of_the_actuators_does_not_order_assembly_modes(name: str) -> None:
    found = modes(name, 0)
    for seed in SEEDS:
        np.testing.assert_allclose(modes(name, seed), found, atol=2e-6)


@pytest.mark.parametrize("name", WORKSPACE)
def test_the_last_bit_does_not_send_forward_kinematics_elsewhere(name: str) -> None:
    robot = pk.load(name)
    q = robot.inverse(pk.sample_poses(robot, 200, share=0.9))
    solved = [robot.forward(moved(q, seed)) for seed in (0, *SEEDS)]
    for other in solved[1:]:
        np.testing.assert_array_equal(other.status, solved[0].status)
        frames = frames_of(other.pose) - frames_of(solved[0].pose)
        sure = solved[0].conditioning > 1e-4
        assert np.abs(frames[sure]).max() < 1e-6


@pytest.mark.parametrize("spread", [(1, 0, 0), (1, 1, 0), (1, 1, 1)], ids=["line", "plane", "all"])
def test_the_last_bit_does_not_turn_the_frame_of_an_instrument(spread: Any) -> None:
    rng = np.random.default_rng(0)
    point = rng.normal(size=(20, 3)) * spread * 100.0
    frame = np.array([300.0, -200.0, 100.0, 0.3, -0.4, 0.5])
    motion = frames_of(frame[None])[0]
    values = point @ motion[:9].reshape(3, 3).T + motion[9:]
    known, turns = np.full(20, -1), np.tile(np.eye(3), (20, 1, 1))

    def found(seed: int) -> np.ndarray:
        pairs = PointPairs(moved(values, seed), point, turns, known)
        return frames_of(of_points(pairs)[0][None])[0]

    for seed in SEEDS:
        np.testing.assert_allclose(found(seed), found(0), atol=1e-3)


DIRECTIONS = [  # where coordinate axes are equally far, or nearly
    np.array(sign) * way
    for way in ([1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 1, 1], [1, 0, 1], [1, 1, 0], [1, 1, 1],
                [2, 1, 1], [1, 2, 1], [1, 1, 2], [3, 4, 0], [0, 3, 4])
    for sign in ([1, 1, 1], [1, -1, 1], [-1, 1, -1], [-1, -1, -1])
]  # fmt: skip


def axes_of(robot: pk.Robot | pk.SerialArm, seed: int) -> np.ndarray:
    """The axes (k, 3, 3) across each direction of a machine, moved by the last bit."""
    if isinstance(robot, pk.SerialArm):
        return joint_frames(moved(np.asarray(robot.axes), seed))
    if robot.model.chains is not None:
        ways = [part.axis for part in robot.model.chains.parts.values()]
        return np.array([np.column_stack(across(moved(way, seed))) for way in ways])
    ways = [frame[:, 2] for limb in robot.model.limbs for frame in limb.frames.values()]
    return np.array([frame_along(moved(way, seed)) for way in ways])


def frame_along(way: np.ndarray) -> np.ndarray:
    """The axes of a slider along a direction, as a robot file states it."""
    limbs = [
        {"kind": "PUS", "base": ring(160.0, angle), "platform": [0, 0, 0], "slider": way}
        | {"rod": 340.0, "branch": -1}
        for angle in (210.0, 330.0, 90.0)
    ]
    return made("translation", {"z": 100.0}, limbs).model.limbs[0].frames["base"]


@pytest.mark.parametrize("name", pk.machines())
def test_the_last_bit_does_not_choose_the_axes_of_a_machine(name: str) -> None:
    robot = pk.load(name)
    for seed in SEEDS:
        np.testing.assert_allclose(axes_of(robot, seed), axes_of(robot, 0), atol=1e-12)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_last_bit_does_not_choose_axes_where_coordinate_axes_are_alike(seed: int) -> None:
    rng = np.random.default_rng(seed)
    ways = [
        *DIRECTIONS,
        *(rng.permuted([[a, a, b]], axis=1)[0] for a, b in rng.normal(size=(40, 2))),
    ]
    for way in np.array(ways):
        unit = way / np.linalg.norm(way)
        tiny = unit + 1e-15 * rng.normal(size=3)  # as cosines of 90 degrees have it
        for find in (frame_along, lambda d: joint_frames(d[None])[0], lambda d: across(d)[0]):
            expected = find(unit)
            for other in (moved(unit, seed), tiny):
                np.testing.assert_allclose(find(other), expected, atol=1e-11)


def independent_sets(names: tuple[str, ...], seed: int) -> list[list[str]]:
    robots = [pk.load(name) for name in names]
    found = []
    for robot in robots:
        values, own = robot.geometry.values, ~robot.geometry.tied
        changed = np.where(own, moved(values, seed), values)
        found.append(list(independent_numbers(robot.replace(changed))))
    return found


def test_the_last_bit_does_not_choose_which_numbers_are_independent() -> None:
    expected = independent_sets(SYMMETRIC, 0)
    for seed in SEEDS:
        assert independent_sets(SYMMETRIC, seed) == expected


@pytest.mark.parametrize("few", [True, False])
def test_the_last_bit_does_not_name_what_shifted(few: bool) -> None:
    """Two numbers that do the same: the first is named, the other could be it as well."""
    rng = np.random.default_rng(0)
    count = 10 if few else 60
    jacobian = rng.normal(size=(count, 3))
    rows, axes, y = np.arange(count), np.eye(4), rng.normal(size=2 * count)
    y[count:] += 20 * jacobian[:, 1]
    for seed in (0, *SEEDS):
        twins = moved(np.column_stack([jacobian, jacobian[:, 1]]), seed)
        found = shifted(
            (twins, y[:count], rows),
            (twins, y[count:], rows),
            axes,
            [axes[:, [k]] for k in range(4)],
        )
        assert (found[0].candidate, found[0].also) == (1, (3,))


@pytest.mark.parametrize("name", ["hexapod", "linear-delta", "6-rus", "3rps"])
def test_the_last_bit_does_not_order_what_errors_add(name: str) -> None:
    """At home symmetric machines have shares that are equal."""
    robot = pk.load(name)

    def order(seed: int) -> list[str]:
        home = robot.home
        home[:3] = moved(home[:3], seed)
        printed = str(pk.tolerance(robot, home, 0.01, samples=1000))
        return [line.split()[0] for line in printed.partition("share of")[2].splitlines()[2:]]

    names = order(0)
    assert len(names) > 10
    assert all(order(seed) == names for seed in SEEDS)


def choices() -> str:
    """Everything above that goes through the linear algebra library, in one text."""
    plans = [plan(name, c, 10, 0) for name in ("3r", "2tpr2tps", "hexapod") for c in CRITERIA]
    said = [statements(name, 0) for name in ("hexapod", "2tpr2tps", "3r")]
    free = independent_sets(SYMMETRIC, 0)
    return json.dumps([plans, said, free, modes("hexapod", 0), modes("3rps", 0)])


def _kernels() -> list[str]:
    try:
        flags = set(
            Path("/proc/cpuinfo").read_text().split("flags", 1)[1].split("\n", 1)[0].split()
        )
    except (OSError, IndexError):
        return []
    return [kernel for kernel, needed in KERNELS.items() if needed in flags]


@pytest.mark.skipif(len(_kernels()) < 2, reason="the kernels of this processor are not known")
def test_choices_are_the_same_with_every_kernel_of_the_linear_algebra_library() -> None:
    root = Path(__file__).parents[1]
    paths = os.pathsep.join([str(root), *filter(None, [os.environ.get("PYTHONPATH")])])
    program = "from tests.test_choices import choices; print(choices())"
    found = {}
    for kernel in _kernels():
        ran = subprocess.run(
            [sys.executable, "-c", program],
            env={**os.environ, "OPENBLAS_CORETYPE": kernel, "PYTHONPATH": paths},
            cwd=root,
            capture_output=True,
            text=True,
            check=True,
        )
        found[kernel] = ran.stdout
    assert len(set(found.values())) == 1, {kernel: hash(text) for kernel, text in found.items()}


LIMITED = (*WORKSPACE, *CHAINS)


def limited(robot: pk.Robot, at: np.ndarray) -> pk.Robot:
    """The machine with strokes and cones whose ends are those of these poses."""
    there = robot.feasible(at)
    low, high = there.drive.min(axis=0), there.drive.max(axis=0)
    if robot.model.chains is None:
        limbs = []
        for i, limb in enumerate(robot.model.limbs):
            cones = {}
            for side in ("base_cone", "platform_cone"):
                axis = (np.array([0.0, 0.0, 1.0]) if getattr(limb, side) is None
                        else getattr(limb, side).axis)  # fmt: skip
                wide = replace(limb, **{side: Cone(axis, np.pi)})
                model = replace(robot.model, limbs=(*robot.model.limbs[:i], wide,
                                                    *robot.model.limbs[i + 1 :]))  # fmt: skip
                margin = getattr(pk.Robot(model).feasible(at), f"{side}_margin")[:, i]
                cones[side] = Cone(axis, float((np.pi - margin).max()))
            limbs.append(replace(limb, stroke=(low[i], high[i]), **cones))
        return pk.Robot(replace(robot.model, limbs=tuple(limbs)))
    chains = robot.model.chains
    joints = []
    for limb in chains.limbs:
        made_of = []
        for joint in limb:
            if joint.actuator is None:
                made_of.append(replace(joint, stroke=None, cone=None))
                continue
            drive = robot.machine.drives(robot.slots, robot.inverse(at))[:, joint.actuator]
            made_of.append(replace(joint, stroke=(drive.min(), drive.max())))
        joints.append(tuple(made_of))
    return pk.Robot(replace(robot.model, chains=replace(chains, limbs=tuple(joints))))


@pytest.mark.parametrize("name", LIMITED)
def test_the_last_bit_does_not_move_a_pose_across_a_limit(name: str) -> None:
    robot = pk.load(name)
    at = pk.sample_poses(robot, 12) if name in CHAINS else poses(name, 12)
    at = robot.forward(robot.inverse(at, True if robot.model.match else None)).pose
    tight = limited(robot, at)
    q = tight.inverse(at)
    there = tight.feasible(at)
    least = np.abs(there.stroke_margin).min(axis=0)
    assert ((least < 1e-9) == (there.drive != 0).any(axis=0)).all()  # each driven limb's limit
    for seed in (0, *SEEDS):
        assert tight.feasible(moved(at, seed)).ok.all()
        assert tight.feasible(tight.forward(moved(q, seed), guess=at).pose).ok.all()
        modes = tight.forward_all(moved(q[seed], seed))
        assert modes.feasible[modes.nearest(at[seed])]
    by = "A" if robot.model.map == "spherical" else "prediction"  # its origin stays where it is
    plans = [pk.plan_poses(tight, moved(at, seed), 4, kind="pose", criterion=by).indices.tolist()
             for seed in (0, *SEEDS)]  # fmt: skip
    assert all(plan == plans[0] for plan in plans)
