"""Screws, arms and readings give the same bits on every ISA, and in every lane and tail.

What the core does with machines is in `test_core`, swarms are in `test_pso`, normal numbers in
`test_normals`.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import pkmcal as pk
from pkmcal import screw
from pkmcal.core import instruments, library, screws
from pkmcal.core.elimination import PoseEquations
from pkmcal.core.poses import (
    tpr2tps_jacobian,
    tpr2tps_lengths,
)
from pkmcal.core.screws import Arm
from pkmcal.kinematics.limb_residual import LimbResidual

from .. import generated

ISAS = range(library.lib.pkm_best_isa() + 1)
ROWS = 37
TAILS = [*(slice(0, n) for n in range(1, 18)), slice(3, ROWS), slice(0, ROWS)]
ELSEWHERE = {
    *("inverse", "forward", "jacobian", "forward_jacobian", "error_jacobian", "closure", "limbs"),
    *("rates", "motion", "compose", "invert", "compose_rates", "compose_twists", "normals"),
    *("swarm_start", "swarm_update_best", "swarm_move", "swarm_eq18"),
    *("forward_machines", "pose_errors", "stream"),
    *("chain_forward", "chain_inverse", "chain_closure", "chain_response", "chain_frames"),
}

rng = np.random.default_rng(20)
POSES = rng.uniform(-1, 1, (ROWS, 6)) * [300, 300, 300, 3, 1.5, 3]
OTHERS = POSES[::-1].copy()
TWISTS = np.hstack([rng.normal(0, 1, (ROWS, 3)), rng.normal(0, 300, (ROWS, 3))])
TWISTS[:9, :3] *= np.array([0, 1e-300, 1e-200, 1e-160, 1e-9, 1e-4, 1e-2, 30, 1e4])[:, None]
TWISTS[9, :3] = [np.pi, 0, 0]
MOTIONS = screws.exp(TWISTS, 0)
POINTS = rng.normal(0, 300, (ROWS, 3))
SIZE = np.array([140.0, 80, 200, 294.2, 384.7, 278.5])  # a ... f of the 2TPR&2TPS
FREE = np.array([0, 400, 0, 0]) + rng.uniform(-1, 1, (ROWS, 4)) * [20, 20, 0.1, 0.1]

ARM = pk.SerialArm(
    rng.normal(size=(7, 3)),
    rng.normal(0, 500, (7, 3)),
    screw.from_pose([800, 100, 500, 1, 2, 3]),
    kinds=["revolute", "revolute", "prismatic", "revolute", "prismatic", "revolute", "revolute"],
)
THETA = rng.uniform(-2, 2, (ROWS, 7))
ERRORS = rng.normal(0, 1, (ROWS, 7, 6)) * [1, 1, 1, 0.01, 0.01, 0.01]

Case = Callable[[int, slice], list[np.ndarray]]


def closed_forms(isa: int, part: slice, call: Callable[..., None], shape: tuple[int, ...]) -> list:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(library, "ISA", isa)
        out = np.empty((len(FREE[part]), *shape))
        call(SIZE, np.ascontiguousarray(FREE[part]), out)
    return [out]


def points(isa: int, part: slice) -> list[np.ndarray]:
    one_target = instruments.points(POSES[part], POINTS[0], isa)
    return [*instruments.points(POSES[part], POINTS[part], isa), *one_target]


def distances(isa: int, part: slice) -> list[np.ndarray]:
    ends = POINTS[::-1][part].copy()
    zero = POINTS[part, :1].copy()
    own = instruments.distances(POSES[part], POINTS[part], ends, zero, isa)
    return [*own, *instruments.distances(POSES[part], POINTS[0], POINTS[1], isa=isa)]


def between(isa: int, part: slice) -> list[np.ndarray]:
    own = instruments.between(POSES[part], OTHERS[part], POINTS[part], isa)
    return [*own, *instruments.between(POSES[part], OTHERS[part], POINTS[0], isa)]


def touched_points(isa: int, part: slice) -> list[np.ndarray]:
    own = instruments.touched_points(POSES[part], POINTS[part], isa)
    return [*own, *instruments.touched_points(POSES[0], POINTS[part], isa)]


def tilts(isa: int, part: slice) -> list[np.ndarray]:
    up = POINTS / np.linalg.norm(POINTS, axis=1, keepdims=True)
    own = instruments.tilts(POSES[part], OTHERS[part, 3:].copy(), up[part], isa)
    return [*own, *instruments.tilts(POSES[part], OTHERS[0, 3:].copy(), up[0], isa)]


def pixels(isa: int, part: slice) -> list[np.ndarray]:
    lens = np.tile([3478.0, 3470, 1200, 1000, -0.1, 0.08, 1e-3, -5e-4, 0.02], (ROWS, 1))
    size = POINTS[:, :1] * 1e-5
    own = instruments.pixels(POSES[part], POINTS[part], lens[part], size[part], isa)
    return [*own, *instruments.pixels(POSES[part], POINTS[part], lens[0], isa=isa)]


def closure_cost(isa: int, part: slice) -> list[np.ndarray]:
    robot = pk.load("rotary-delta")
    robot.machine.isa = isa
    at = robot.home + np.random.default_rng(21).uniform(-20, 20, (23, 6)) * [1, 1, 1, 0, 0, 0]
    cost = LimbResidual(robot, at, robot.inverse(at))
    values = cost.nominal + np.random.default_rng(22).normal(0, 0.01, (ROWS, len(cost.free)))
    return [cost(values[part])]


def spheres(isa: int, part: slice) -> list[np.ndarray]:
    """Of cranks, and of legs whose lengths are not all positive."""
    found = []
    for name, size in (("rotary-delta", 1.0), ("3rps", 900.0)):
        robot = pk.load(name)
        robot.machine.isa = isa
        q = size * np.random.default_rng(23).normal(1.0, 1.0, (ROWS, robot.n_actuators))
        found.append(robot.machine.spheres(robot.slots, q[part]))
    return found


def forward_loaded(isa: int, part: slice) -> list[np.ndarray]:
    """Of legs that give under a load, far enough that some rows want several steps."""
    robot = pk.load("hexapod").yielding({"offset*": 1 / 300.0})
    robot.machine.inner.isa = isa
    away = np.random.default_rng(25).uniform(-1, 1, (ROWS, 6)) * [100, 100, 100, 0.2, 0.2, 0.2]
    q = robot.rigid.inverse(robot.home + away)
    found = robot.forward(q[part], load=pk.Load(60.0, [5.0, 0.0, 90.0]))
    assert found.ok.all()
    return [found.pose, found.residual]


def work_at_anchors(isa: int, part: slice, name: str) -> list[np.ndarray]:
    """By the actuators' places and the numbers of limbs whose anchors move."""
    robot, draw = pk.load(name), np.random.default_rng(26)
    robot.machine.isa = isa
    q = robot.inverse(robot.home) + draw.uniform(-0.3, 0.3, (ROWS, robot.n_actuators))
    force = draw.normal(size=(ROWS, robot.machine.struct.limbs, 3))
    columns = robot.geometry.slot_index[::2].astype(np.int32)
    given = (q[part].copy(), force[part].copy(), columns)
    return [robot.machine.work_at_anchors(robot.slots, *given)]


def actuators_as_instruments(isa: int, part: slice, call: str) -> list[np.ndarray]:
    """Of cranks, and of legs with rows beside the sphere's; far poses, which some do not reach."""
    found = []
    for name in ("rotary-delta", "2tpr2tps-spatial", "3prs"):
        robot = pk.load(name)
        robot.machine.isa = isa
        draw = np.random.default_rng(24)
        pose = robot.home + draw.uniform(-1, 1, (ROWS, 6)) * [200, 200, 200, 1, 1, 1]
        if call == "moved":
            step = draw.uniform(-1, 1, (ROWS, robot.machine.m))
            found.append(robot.machine.moved(pose[part].copy(), step[part].copy()))
            found.append(robot.machine.step_twists(pose[part].copy()))
        else:
            q = robot.inverse(robot.home) + draw.uniform(-1, 1, (ROWS, robot.n_actuators))
            columns = robot.geometry.slot_index[::2].astype(np.int32)
            given = (robot.slots, pose[part].copy(), q[part].copy(), columns)
            found += [each for each in robot.machine.readings(*given) if each is not None]
    return found


def poses_of_equations(isa: int, part: slice, call: str) -> list[np.ndarray]:
    """Some with fewer equations than unknowns, some not finite; what is left in a row for each."""
    found: list[np.ndarray] = []
    for unknowns in (2, 6):
        draw = np.random.default_rng([33, unknowns])
        count, most = draw.integers(0, unknowns + 5, ROWS), unknowns + 5
        slopes = draw.normal(size=(ROWS, most, unknowns))
        slopes[2::5, 0, 0], slopes[::5, 0, -1], count[0] = np.nan, np.inf, 1
        columns = draw.normal(size=(ROWS, most, 3))
        order = np.flatnonzero(np.arange(most) < count[part, None])
        poses = PoseEquations(order, count[part], unknowns, isa)
        by_unknown, columns = (each[part].reshape(-1, each.shape[2]) for each in (slopes, columns))
        matrix, pull, cost = poses.normals(np.ascontiguousarray(columns[:, 0]), by_unknown)
        left, following = poses.left(by_unknown, columns)
        if call == "pose_normals":
            found += [matrix, pull, cost]
        elif call == "pose_triangle":
            found.append(poses.triangle(by_unknown))
        elif call == "pose_fit":
            residual = np.ascontiguousarray(columns[:, 0])
            *of_poses, rest = poses.fit(residual, by_unknown, np.full(len(cost), 0.1), 0.01, 1e-3)
            found += [*of_poses, _rows(rest[:, None], poses.left_of)]
        elif call == "pose_left":
            found += [following, _rows(left, poses.left_of)]
        else:
            found.append(_rows(poses.spread(by_unknown, left), count[part]))
    return [np.where(np.isnan(each), np.nan, each) for each in found]


def _rows(numbers: np.ndarray, count: np.ndarray) -> np.ndarray:
    """Numbers of poses one after another, in as many rows as there are poses."""
    wide = np.zeros((len(count), 16, numbers.shape[1]))
    for row, mine in zip(wide, np.split(numbers, np.cumsum(count)[:-1]), strict=True):
        row[: len(mine)] = mine
    return wide


def arm(isa: int, part: slice, call: str) -> list[np.ndarray]:
    """With links that all rows share, and with links of each row."""
    made = Arm(*ARM.core.arrays, isa)
    found = []
    for errors in (ERRORS[0], ERRORS[part]):
        links, theta = made.links(errors), THETA[part]
        if call == "links" and errors.ndim == 3:
            found.append(links.numbers)
        if call == "forward":
            found.append(made.forward(theta, links, 1))
        if call in ("jacobian", "error_jacobian"):
            found += [getattr(made, call)(theta, links, frame) for frame in range(3)]
    return found


def by_rows(call: Callable[..., np.ndarray], *given: np.ndarray) -> Case:
    return lambda isa, part: [call(*(rows[part] for rows in given), isa=isa)]


def law(call: str) -> Case:
    """Formulas of drive laws; the way's inverse has no number in some rows."""
    width = library.ROW_CALLS[call][0][0][0]
    given = 3.0 * np.random.default_rng(31).normal(size=(ROWS, width))
    return lambda isa, part: [*library.rows(call, given[part], isa=isa)]


def pulley(isa: int, part: slice) -> list[np.ndarray]:
    """Of ends outside of the wheels, and of some inside, which no cable leaves."""
    own = np.random.default_rng(32).uniform([10, -0.1, -0.1], [60, 0.1, 0.1], (ROWS, 3))
    frame = MOTIONS.reshape(ROWS, 4, 4)[:, :3, :3].reshape(ROWS, 9)
    return [*library.rows("pulley", own[part], frame[part], POINTS[part], isa=isa)]


def strand(isa: int, part: slice) -> list[np.ndarray]:
    return [*library.rows("strand", POINTS[part], isa=isa)]


CASES: dict[str, Case] = {
    "law_drive": law("law_drive"),
    "law_drive_inverse": law("law_drive_inverse"),
    "law_harmonic": law("law_harmonic"),
    "law_segment": law("law_segment"),
    "points": points,
    "seen_points": lambda isa, part: [*instruments.seen_points(POSES[0], POINTS[part], isa)],
    "distances": distances,
    "between": between,
    "touched_points": touched_points,
    "tilts": tilts,
    "pixels": pixels,
    "pulley": pulley,
    "strand": strand,
    "tpr2tps_lengths": lambda isa, part: closed_forms(isa, part, tpr2tps_lengths, (4,)),
    "tpr2tps_jacobian": lambda isa, part: closed_forms(isa, part, tpr2tps_jacobian, (4, 4)),
    "closure_cost": closure_cost,
    "spheres": spheres,
    "forward_loaded": forward_loaded,
    "slider_work": lambda isa, part: work_at_anchors(isa, part, "linear-delta"),
    "crank_work": lambda isa, part: work_at_anchors(isa, part, "rotary-delta"),
    "pose_normals": lambda isa, part: poses_of_equations(isa, part, "pose_normals"),
    "pose_triangle": lambda isa, part: poses_of_equations(isa, part, "pose_triangle"),
    "pose_fit": lambda isa, part: poses_of_equations(isa, part, "pose_fit"),
    "pose_left": lambda isa, part: poses_of_equations(isa, part, "pose_left"),
    "pose_spread": lambda isa, part: poses_of_equations(isa, part, "pose_spread"),
    "readings": lambda isa, part: actuators_as_instruments(isa, part, "readings"),
    "moved": lambda isa, part: actuators_as_instruments(isa, part, "moved"),
    "exp": by_rows(screws.exp, TWISTS),
    "log": by_rows(screws.log, MOTIONS),
    "adjoint": by_rows(screws.adjoint, MOTIONS),
    "motion_pose": by_rows(screws.pose, MOTIONS),
    "exp_jacobian": lambda isa, part: [screws.exp_jacobian(TWISTS[part], False, isa)],
    "log_jacobian": lambda isa, part: [screws.exp_jacobian(TWISTS[part], True, isa)],
    "joint_motions": by_rows(screws.joint_motions, ERRORS[:, 0].copy(), POINTS),
    "arm_links": lambda isa, part: arm(isa, part, "links"),
    "arm_forward": lambda isa, part: arm(isa, part, "forward"),
    "arm_jacobian": lambda isa, part: arm(isa, part, "jacobian"),
    "arm_error_jacobian": lambda isa, part: arm(isa, part, "error_jacobian"),
}


@pytest.mark.parametrize("call", CASES)
def test_bits_are_the_same_on_every_isa_and_in_every_tail(call: str) -> None:
    expected = CASES[call](0, slice(0, ROWS))
    assert expected and all(len(array) == ROWS for array in expected)
    for isa in ISAS:
        for part in TAILS:
            found = CASES[call](isa, part)
            for array, whole in zip(found, expected, strict=True):
                assert array.tobytes() == whole[part].tobytes()


@pytest.mark.parametrize("kind", generated.KINDS)
def test_angles_have_the_same_bits_near_anything(kind: str) -> None:
    """Shared cranks, turns and guesses of a machine with whatever limbs were drawn."""
    rng = np.random.default_rng([7, generated.KINDS.index(kind)])
    robot = generated.machine(kind, rng, errors=0.3)
    machine, slots = robot.machine, robot.slots
    at = np.ascontiguousarray(generated.poses(kind, robot, ROWS, rng))
    near = 10.0 * rng.normal(size=(ROWS, robot.n_actuators))

    def found(isa: int, part: slice) -> list[np.ndarray]:
        machine.isa = isa
        rows, about = at[part].copy(), near[part].copy()
        q = machine.inverse(slots, rows, about)
        both = machine.inverse(slots, rows), machine.inverse(slots, rows, near[0])
        forward = machine.forward(slots, q, robot.own_home, 1)
        return [q, *both, *machine.limbs(slots, rows), *forward]

    whole = found(0, slice(0, ROWS))
    for isa in ISAS:
        for part in TAILS:
            for one, other in zip(found(isa, part), whole, strict=True):
                assert np.array_equal(one, other[part], equal_nan=one.dtype.kind == "f")


@pytest.mark.parametrize("kind", generated.KINDS)
def test_machines_at_places_have_the_bits_of_each_alone(kind: str) -> None:
    """Whatever the number of machines and the ISA; some are so far off that they do not close."""
    rng = np.random.default_rng([11, generated.KINDS.index(kind)])
    robot = generated.machine(kind, rng, errors=0.3)
    machine = robot.machine
    guess = np.ascontiguousarray(generated.poses(kind, robot, 3, rng))
    q = np.ascontiguousarray(machine.inverse(robot.slots, guess))
    slots = robot.slots + rng.normal(size=(ROWS, *robot.slots.shape)) * 1e-3
    slots[5:9] += 30.0 * rng.normal(size=(4, *robot.slots.shape))
    slots[11, 0, 0] = np.nan
    alone = np.empty((3, ROWS, 6))
    for place, row in np.ndindex(3, ROWS):
        alone[place, row] = machine.forward(slots[row], q[place][None], guess[place][None], 1)[0][0]
    assert np.isfinite(alone[:, :5]).any()
    assert np.isnan(alone[:, 11]).all()
    for isa in ISAS:
        machine.isa = isa
        for part in TAILS:
            found = machine.forward_machines(slots[part].copy(), q, guess)
            np.testing.assert_array_equal(found, alone[:, part])


def test_every_call_that_is_compiled_for_each_isa_is_looked_at() -> None:
    for functions in library.FUNCTIONS:
        assert len(functions) > 20
        assert {*CASES} | ELSEWHERE == {*functions}
