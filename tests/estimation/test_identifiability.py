"""Identifiability: ranks of the published machine, and combinations as sums."""

from __future__ import annotations

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.calibration.asked import ROLES
from pkmcal.calibration.identify import identify
from pkmcal.estimation.datasets import as_fit_data
from pkmcal.estimation.free_parameters import parameters
from pkmcal.estimation.identifiability import (
    as_sum,
    decompose,
    listed,
    observability,
    sparse_basis,
)
from pkmcal.estimation.parameters import Asked
from pkmcal.measurements.virtual_machine import VirtualMachine

from ..simulated import tilted_poses

# The ranks of the 28 error columns at 30 poses, tilted or with alpha = beta = 0 as published.
RANKS = [
    ("pose", True, 26),
    ("position", True, 25),
    ("height", True, 24),
    ("pose", False, 14),
    ("position", False, 13),
    ("height", False, 9),
]


@pytest.mark.filterwarnings("ignore:.*the machine's size:UserWarning")
@pytest.mark.parametrize(("kind", "tilted", "rank"), RANKS)
def test_rank_of_the_28_errors(kind: str, tilted: bool, rank: int) -> None:
    robot = pk.load("2tpr2tps")
    poses = tilted_poses(robot, 40, np.random.default_rng(4))
    if not tilted:
        poses[:, [0, 3, 4]] = 0.0
    poses = poses[robot.feasible(poses).ok][:30]
    found = identify(robot, VirtualMachine(robot).measure(robot.inverse(poses), kind=kind))
    assert found.rank == rank
    assert found.gap > 1e6
    assert len(found.unidentifiable) == 28 - rank


def test_unidentifiable_combinations_move_no_measured_point() -> None:
    robot = pk.load("2tpr2tps")
    poses = tilted_poses(robot, 30, np.random.default_rng(5))
    q = robot.inverse(poses)
    found = identify(robot, VirtualMachine(robot).measure(q))
    assert "platform3.x" in found.unidentifiable
    assert "platform4.x" in found.unidentifiable
    moved = robot.replace({"platform3.x": 5e-4, "platform4.x": -7e-4})  # mm; to first order
    np.testing.assert_allclose(moved.forward(q).pose, robot.forward(q).pose, atol=1e-8)


def test_a_turned_delta_is_named_by_its_towers() -> None:
    robot = pk.load("examples/linear-delta/robot.toml")
    rng = np.random.default_rng(6)
    poses = np.zeros((20, 6))
    poses[:, :2], poses[:, 2] = rng.uniform(-80, 80, (20, 2)), 10.0
    measured = VirtualMachine(robot).measure(robot.inverse(poses), kind="height")
    found = identify(robot, measured, free=[*robot.model.free, "angle3"])
    assert found.unidentifiable == ("angle1 + … + angle3",)
    unknown = dict(zip(found.free, np.isinf(found.stderr), strict=True))
    assert [name for name, inf in unknown.items() if inf] == ["angle1", "angle2", "angle3"]


def test_a_base_moved_with_the_frame_is_named() -> None:
    robot = pk.load("hexapod")
    rng = np.random.default_rng(7)
    poses = robot.home + rng.uniform(-1, 1, (30, 6)) * [100, 100, 80, 0.3, 0.3, 0.3]
    measured = VirtualMachine(robot).measure(robot.inverse(poses), kind="pose")
    found = identify(robot, measured, free=["base*.x"], unknown="frame")
    assert found.rank == 11
    assert found.unidentifiable == ("base1.x + … + base6.x − frame.x",)


def test_what_is_unidentifiable_keeps_its_value() -> None:
    robot = pk.load("2tpr2tps")
    poses = tilted_poses(robot, 30, np.random.default_rng(8))
    true = robot.replace({"offset1": 0.4, "platform3.x": 0.5})
    found = identify(robot, VirtualMachine(true, noise=0).measure(robot.inverse(poses)))
    values = dict(zip(found.free, found.values, strict=True))
    assert values["platform3.x"] == pytest.approx(0.0, abs=1e-12)
    # the smallest change that explains the measurements is no larger than the true one
    assert np.linalg.norm(found.values - found.start) <= np.hypot(0.4, 0.5)


def test_what_nothing_reads_is_no_part_of_what_is_read() -> None:
    """Not even by rounding: it keeps its value to the last bit."""
    rng = np.random.default_rng(0)
    jacobian = rng.normal(size=(9, 5))
    jacobian[:, 2] = 0.0
    singular, basis = decompose(jacobian[:4], jacobian[4:])
    assert (basis[2, :4] == 0.0).all() and basis[2, 4] == 1.0 and singular[4] == 0.0
    np.testing.assert_allclose(basis.T @ basis, np.eye(5), atol=1e-14)
    read = np.delete(jacobian, 2, axis=1)
    np.testing.assert_allclose(singular[:4] ** 2, np.linalg.eigvalsh(read.T @ read)[::-1])
    assert decompose(np.zeros((3, 2)))[0].tolist() == [0.0, 0.0]


def test_observability_indices_of_known_singular_values() -> None:
    rng = np.random.default_rng(9)
    left, _ = np.linalg.qr(rng.normal(size=(20, 3)))
    right, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    found = observability(left @ np.diag([8.0, 4.0, 2.0]) @ right.T, poses=16, rank=3)
    assert found == pytest.approx({"O1": 1.0, "O2": 0.25, "O3": 2.0, "O4": 0.5, "O5": 8 / 7})


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ([1, 0, 0, 0], "base1.x"),
        ([1, 1, 1, 0], "base1.x + … + base3.x"),
        ([1, 1, -1, 0], "base1.x + base2.x − base3.x"),
        ([-1, -1, -1, 1], "offset1 − base1.x − … − base3.x"),
        ([1, 0, -0.5, 0.25], "base1.x − 0.5 base3.x + 0.25 offset1"),
        ([0.004, 1, 0.1234, 0.5], "base2.x + 0.5 offset1 + 0.12 base3.x"),
    ],
)
def test_combinations_as_sums(values: list[float], text: str) -> None:
    names = ["base1.x", "base2.x", "base3.x", "offset1"]
    assert as_sum(np.array(values), names, ["mm"] * 4, np.ones(4)) == text


def test_coefficients_of_many_are_printed_and_angles_among_lengths_are_told() -> None:
    names = [*(f"base{i}.x" for i in range(1, 9)), "frame.gamma"]
    units, scale = ["mm"] * 8 + ["rad"], np.array([*[1.0] * 8, 1 / 250])
    values = np.array([1, -0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.25])
    assert as_sum(values, names, units, scale) == (
        "base1.x − 0.9 base2.x + 0.8 base3.x + 0.7 base4.x + 0.6 base5.x + 0.5 base6.x"
        " + 0.4 base7.x + 0.3 base8.x + 0.25 frame.gamma (angles as arcs at 250 mm)"
    )
    assert "arcs" not in as_sum(np.array([0.0] * 8 + [1.0]), names, units, scale)
    many = 0.02 + np.linspace(0.98, 0.0, 30)
    text = as_sum(many, [f"n{2 * i}" for i in range(30)], ["mm"] * 30, np.ones(30))
    assert text.endswith(f" + … (6 more, of at most {many[24]:.2g})")


def test_no_combination_is_named_twice() -> None:
    """Of a 3-RPS whose frame and target are unknown twelve are open, and all are independent."""
    robot = pk.load("3rps")
    q = robot.inverse(pk.sample_poses(robot, 40), match=True)
    measured = pk.VirtualMachine(robot, 0.01).measure(q)
    found = pk.identify(robot, measured, unknown=["frame", "target"])
    open_ones = found.fit.estimate.state.measured.unidentifiable
    basis = sparse_basis(open_ones, found.fit.parameters.families)
    basis /= np.linalg.norm(basis, axis=0)
    assert np.linalg.svd(basis)[1][-1] > 0.1 and basis.shape[1] == len(found.free) - found.rank
    np.testing.assert_allclose(open_ones @ (open_ones.T @ basis), basis, atol=1e-9)
    assert len(set(found.unidentifiable)) == len(found.unidentifiable)


def test_names_that_count_on_are_shortened() -> None:
    names = ["base1.z", "base2.z", "base3.z", "base4.z", "rod1", "rod3"]
    assert listed(names) == "base1.z … base4.z, rod1, rod3"


def test_sparse_basis_spans_the_same_combinations() -> None:
    rng = np.random.default_rng(10)
    families = [
        f"{point}.{axis}" for point in ("base", "platform") for _ in (1, 2) for axis in "xy"
    ]
    open_ones, _ = np.linalg.qr(rng.normal(size=(8, 3)))
    basis = sparse_basis(open_ones, families)
    assert basis.shape == (8, 3)
    np.testing.assert_allclose(open_ones @ (open_ones.T @ basis), basis, atol=1e-9)
    assert np.linalg.matrix_rank(basis) == 3


def test_numbers_of_one_set_up_are_one_kind_however_many_they_are() -> None:
    """With an offset six touched places rise, or a base joint moves."""
    families = ["offset", "base.x", *["touch"] * 6]
    risen, moved = [1.0, 0, *[1] * 6], [1.0, 1, *[0] * 6]
    basis = sparse_basis(np.linalg.qr(np.column_stack([risen, moved])).Q, families)
    assert sorted(map(tuple, np.abs(basis.T).round(9))) == sorted(map(tuple, [risen, moved]))


@pytest.mark.parametrize("names", [None, ("A", "B", "C")], ids=["numbered", "named"])
@pytest.mark.parametrize("unknown", ["target", "attachment"])
def test_points_are_of_one_kind_however_they_are_called(
    unknown: str, names: tuple[str, ...] | None
) -> None:
    robot = pk.load("hexapod")
    q = robot.inverse(pk.sample_poses(robot, 60, seed=1))
    ends = np.array([[900.0, 0, 0], [-500.0, 800, 0], [-400.0, -800, 50]])
    carried = pk.readings.Distance(np.eye(3) * 60.0)
    measured = pk.Measurements(
        q, np.full(60, 900.0), carried, target=ends, target_index=np.arange(60) % 3,
        target_names=names,
    )  # fmt: skip
    said = {each: "unknown" if each == unknown else "known" for each in ROLES}
    data = as_fit_data(robot, measured, said, False)
    chosen = parameters(robot, data, Asked("base*"))
    kinds = {
        "target": ("anchor",) * 3,
        "attachment": ("attachment.x", "attachment.y", "attachment.z"),
    }
    assert chosen.families[:6] == ("base.x", "base.y", "base.z") * 2
    assert chosen.families[18:] == kinds[unknown] * 3
