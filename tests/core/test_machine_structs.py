"""Structs of machines of limbs: what is no machine is refused, as much as there is room for is not."""

from __future__ import annotations

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.core.library import DRIVERS, ROWS, ffi, lib, pointer

from .. import robots, twin
from ..workspaces import WORKSPACE

every = pytest.mark.parametrize("name", WORKSPACE)
MOST = lib.PKM_MAX_LIMBS


def crowded() -> tuple[pk.Robot, list[pk.Robot]]:
    """A hexapod with as many legs as there is room for, and one of each six of them."""
    legs = [
        {"kind": "UPS", "base": robots.ring(300.0 + k, 97.0 * k, 2.0 * k)}
        | {"platform": robots.ring(100.0, 61.0 * k, -10.0), "offset": 0.1 * k}
        for k in range(MOST)
    ]
    sixes = [legs[k : k + 6] for k in range(0, MOST, 6)]
    return (
        robots.made("spatial", {"z": 800.0}, legs),
        [robots.made("spatial", {"z": 800.0}, six) for six in sixes],
    )


@every
def test_the_core_refuses_limbs_that_are_none(name: str) -> None:
    struct = pk.load(name).machine.struct  # type: ignore[union-attr]
    rows = lib.pkm_closure_count(struct)
    assert rows > 0
    wrong = {
        "driver": (-1, len(DRIVERS), 99),
        "actuator": (-1, struct.actuators, 99),
        "rows": (1 << len(ROWS), -1),
    }
    for field, values in wrong.items():
        array = getattr(struct, field)
        for i in range(struct.limbs):
            before = array[i]
            for value in values:
                array[i] = value
                assert lib.pkm_closure_count(struct) == 0, (field, i, value)
            array[i] = before
    assert lib.pkm_closure_count(struct) == rows


@every
def test_a_machine_that_is_prepared_again_is_the_same(name: str) -> None:
    robot = pk.load(name)
    assert isinstance(robot, pk.Robot)
    struct, slots, home = robot.machine.struct, robot.slots, robot.own_home
    before = bytes(ffi.buffer(struct))
    assert lib.pkm_prepare(struct, pointer(slots), pointer(home)) == 0
    assert bytes(ffi.buffer(struct)) == before


def test_rows_are_put_in_order_up_to_the_last_that_there_is_room_for() -> None:
    robot, _ = crowded()
    struct = robot.machine.struct
    for i in range(MOST):
        struct.rows[i] = 1
    assert lib.pkm_prepare(struct, pointer(robot.slots), pointer(robot.own_home)) == 0
    assert list(struct.order) == list(range(lib.PKM_MAX_ROWS))
    assert list(struct.sharing) == [1.0] * MOST


def test_angles_without_a_stroke_are_told_about_home() -> None:
    """Of unlike cranks: each by its own."""
    unlike = [{"crank": 200.0 + 30.0 * k, "rod": 500.0 - 20.0 * k} for k in range(3)]
    robot = robots.rotary_delta(*unlike)
    q = robot.machine.reference(robot.slots)
    np.testing.assert_allclose(twin.closures(robot.model, robot.home, q), 0.0, atol=1e-9)
    assert len(set(q.round(3))) == 3


def test_a_machine_of_as_many_limbs_as_there_is_room_for_is_that_of_six_at_a_time() -> None:
    robot, sixes = crowded()
    rng = np.random.default_rng(3)
    at = robot.home + rng.uniform(-1.0, 1.0, (9, 6)) * [50, 50, 50, 0.1, 0.1, 0.1]
    q, of = robot.inverse(at), [slice(k, k + 6) for k in range(0, MOST, 6)]
    speed = rng.normal(size=(9, 6))
    legs = [six.jacobian(at) for six in sixes]
    moved = np.concatenate([leg @ speed[:, :, None] for leg in legs], axis=1)[..., 0]
    bend = rng.normal(size=moved.shape)
    motion = robot.machine.motion(robot.slots, at, q, moved, bend)[0]
    rates = robot.machine.rates(robot.slots, motion, q)
    read = robot.machine.readings(robot.slots, at, q + 0.1)[0]
    cost = robot.machine.closure_cost(robot.slots[None], at, q + 0.1)[0]
    for k, six in zip(of, sixes, strict=True):
        machine, slots = six.machine, six.slots
        np.testing.assert_array_equal(six.inverse(at), q[:, k])
        np.testing.assert_array_equal(machine.limbs(slots, at)[0], robot.drives(q)[:, k])
        np.testing.assert_array_equal(machine.rates(slots, motion, q[:, k])[0], rates[0][:, k])
        np.testing.assert_array_equal(machine.readings(slots, at, q[:, k] + 0.1)[0], read[:, k])
        cost -= machine.closure_cost(slots[None], at, q[:, k] + 0.1)[0]
    np.testing.assert_array_equal(robot.jacobian(at), np.concatenate(legs, axis=1))
    np.testing.assert_allclose(rates[0], moved, atol=1e-4)  # by differences
    np.testing.assert_allclose(cost, 0.0, atol=1e-9)
    found = robot.forward(q)
    np.testing.assert_allclose(found.pose, at, atol=1e-9)
    assert robot.machine.spheres(robot.slots, q).shape == (9, MOST, lib.PKM_SPHERE)
    assert robot.error_jacobian(at).shape[-1] == len(robot.geometry)
