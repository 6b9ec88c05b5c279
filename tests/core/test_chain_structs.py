"""Structs of machines of chains: the core counts their rows, and refuses what is none."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.core.chains import ChainMachine
from pkmcal.core.library import ffi, lib


def of_chains(name: str) -> bool:
    robot = pk.load(name)
    return isinstance(robot, pk.Robot) and isinstance(robot.machine, ChainMachine)


NAMES = [name for name in pk.machines() if of_chains(name)]


def machine_of(name: str) -> ChainMachine:
    machine = pk.load(name).machine  # type: ignore[union-attr]
    assert isinstance(machine, ChainMachine)
    return machine


@pytest.mark.parametrize("name", NAMES)
def test_the_core_counts_the_rows_of_every_machine_of_chains(name: str) -> None:
    machine = machine_of(name)
    assert lib.pkm_chain_count(machine.struct) == machine.layout.rows > 0


def counts(struct: Any) -> list[tuple[str, int]]:
    """Fields, and what none of them may say."""
    return [
        ("map", -1),
        ("map", 1),  # translation
        ("map", 5),  # xy
        ("map", 99),
        *((each, value) for each in ("chains", "joints", "actuators") for value in (0, -1, 1000)),
        *((each, value) for each in ("passive", "shared") for value in (-1, 1000)),
        ("tail", 0),
        ("tail", struct.actuators + 1),
        ("numbers", struct.numbers - 1),
        ("numbers", lib.PKM_MAX_NUMBERS + 1),
        ("length", 0.0),
        ("length", float("nan")),
    ]


@pytest.mark.parametrize("name", NAMES)
def test_the_core_refuses_counts_that_are_none(name: str) -> None:
    machine = machine_of(name)  # whose arrays the struct points to
    struct = machine.struct
    for field, value in counts(struct):
        before = getattr(struct, field)
        setattr(struct, field, value)
        assert lib.pkm_chain_count(struct) == 0, (field, value)
        setattr(struct, field, before)
    assert lib.pkm_chain_count(struct) > 0


@pytest.mark.parametrize("name", NAMES)
def test_the_core_refuses_places_that_are_none(name: str) -> None:
    """Each entry of each array, below what is there and above it."""
    machine = machine_of(name)
    struct, layout = machine.struct, machine.layout
    ends = {
        "first": range(len(layout.first)),
        "member": range(len(layout.member)),
        "end_place": range(len(layout.ball)),
        "ball_place": np.flatnonzero(layout.ball),
        "actuator": range(len(layout.place)),
        "coordinate": range(len(layout.place)),
        "place": range(len(layout.place)),
        "drive_place": range(len(layout.drive_place)),
    }
    for field, entries in ends.items():
        array = getattr(struct, field)
        for k in entries:
            before = array[int(k)]
            for wrong in (-2, 10_000):
                array[int(k)] = wrong
                assert lib.pkm_chain_count(struct) == 0, (field, k, wrong)
            array[int(k)] = before
    assert lib.pkm_chain_count(struct) > 0


def test_a_number_has_one_column_of_chains() -> None:
    """Of two the core filled one, and the other was 0."""
    robot = pk.load(NAMES[0])
    assert isinstance(robot, pk.Robot)
    pose, q = robot.home[None], robot.inverse(robot.home)[None]

    def errors(*columns: int) -> Callable[[], np.ndarray]:
        numbers = np.array(columns, dtype=np.int32)
        return lambda: robot.machine.error_jacobian(robot.slots, pose, q, numbers)

    assert errors()().shape == (1, 6, 0)
    both = errors(4, 1)()
    np.testing.assert_array_equal(both[..., 0], errors(4)()[..., 0])
    np.testing.assert_array_equal(both[..., 1], errors(1)()[..., 0])
    for refused in (errors(1, 1), errors(-1), errors(robot.slots.size)):
        with pytest.raises(ValueError, match="refused"):
            refused()


def test_more_columns_than_numbers_are_refused() -> None:
    machine = machine_of(NAMES[0])
    columns = np.zeros(5000, dtype=np.int32)
    given = (ffi.NULL, 0, ffi.NULL, ffi.NULL, ffi.from_buffer("int32_t[]", columns), 5000, 0)
    code = lib.pkm_base_chain_response(machine.struct, 0, *given, ffi.NULL)
    assert code == lib.PKM_BAD_COLUMN
