"""Structs of machines of chains: the core counts their rows, and refuses what is none."""

from __future__ import annotations

from collections.abc import Callable, Iterable
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
    """Each entry of each array, below what is there, the first above it, and far above."""
    machine = machine_of(name)
    struct, layout = machine.struct, machine.layout
    joints, numbers = range(len(layout.place)), struct.numbers
    above: dict[str, tuple[Iterable[int], int]] = {
        "first": (range(len(layout.first)), len(layout.member) + 11),
        "member": (range(len(layout.member)), struct.joints),
        "end_place": (range(len(layout.ball)), numbers - 2),
        "ball_place": (np.flatnonzero(layout.ball), numbers - 2),
        "actuator": (joints, struct.actuators),
        "coordinate": (joints, struct.passive),
        "place": (joints, numbers - 5),
        "drive_place": (range(len(layout.drive_place)), numbers - 1),
    }
    for field, (entries, first) in above.items():
        array = getattr(struct, field)
        for k in entries:
            before = array[int(k)]
            for wrong in (-2, first, 10_000):
                array[int(k)] = wrong
                assert lib.pkm_chain_count(struct) == 0, (field, k, wrong)
            array[int(k)] = before
    assert lib.pkm_chain_count(struct) > 0


class Drawn:
    """A struct of chains that end rigidly: joints driven (d), passive (p), passive and shared (s)."""

    def __init__(self, *chains: str) -> None:
        kinds, integers = "".join(chains), "int32_t[]"
        places = {each: np.flatnonzero(np.array(list(kinds)) == each) for each in "dsp"}
        actuator, coordinate = np.full((2, len(kinds)), -1)
        actuator[places["d"]] = range(kinds.count("d"))
        coordinate[np.concatenate([places["s"], places["p"]])] = range(len(kinds) - kinds.count("d"))
        self.struct = ffi.new("pkm_chains *")
        self.struct.map, self.struct.length = 0, 1.0
        self.struct.chains, self.struct.joints = len(chains), len(kinds)
        self.struct.actuators = self.struct.tail = kinds.count("d")
        self.struct.passive = len(kinds) - kinds.count("d")
        self.struct.shared, self.struct.numbers = kinds.count("s"), lib.PKM_MAX_NUMBERS
        self._arrays = {
            "first": ffi.new(integers, [0, *np.cumsum([len(each) for each in chains]).tolist()]),
            "member": ffi.new(integers, list(range(len(kinds))) + [0] * 8),
            "actuator": ffi.new(integers, actuator.tolist()),
            "coordinate": ffi.new(integers, coordinate.tolist()),
        }
        for each in ("ball", "end_place", "ball_place", "place", "drive_place"):
            self._arrays[each] = ffi.new(integers, len(kinds))
        for field, array in self._arrays.items():
            setattr(self.struct, field, array)

    @property
    def rows(self) -> int:
        found: int = lib.pkm_chain_count(self.struct)
        return found


def test_the_core_takes_as_many_joints_and_actuators_as_it_has_room_for_and_no_more() -> None:
    chain = "dppppp"  # which leaves a row
    most = lib.PKM_MAX_JOINTS // len(chain)
    assert Drawn(*[chain] * most).rows == most
    assert Drawn(*[chain] * most, chain).rows == Drawn(*[chain] * most, "d").rows == 0
    assert lib.PKM_MAX_LIMBS == 4 * 6
    assert Drawn(*["dddd"] * 6).rows == lib.PKM_MAX_CHAIN_ROWS
    assert Drawn(*["dddd"] * 5, "ddddd").rows == 0
    assert Drawn(*["d" * lib.PKM_MAX_CHAIN] * 2, *["d"] * 4).rows == lib.PKM_MAX_CHAIN_ROWS
    assert Drawn(*["d" * lib.PKM_MAX_CHAIN] * 2, "d" * 5).rows == 0


def test_a_passive_joint_that_is_not_shared_is_in_one_chain() -> None:
    for joint in range(1, 6):
        one = Drawn(*["dppppp"] * 8)
        assert one.rows == 8
        one.struct.first[8] += 1  # the last chain has one joint more, the first chain's
        one.struct.member[48] = joint
        assert one.rows == 0
    one.struct.member[48] = 0  # driven: in as many as there are
    assert one.rows == 8


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


def test_rows_of_chains_tell_all_free_coordinates_and_shared_joints() -> None:
    one = "dppppp"  # which leaves a row
    assert Drawn(*[one] * 6).rows == 6
    assert Drawn(*[one] * 5).rows == 0
    assert Drawn("dspppp", *[one] * 5).rows == 7  # of which the shared joint's own row is one
    assert Drawn("dspppp", *[one] * 4).rows == 0


def test_the_last_places_that_there_are_may_be_taken() -> None:
    drawn = Drawn(*["dppppp"] * 6)
    for place, of in (("place", 6), ("end_place", 6), ("drive_place", 2)):
        getattr(drawn.struct, place)[0] = lib.PKM_MAX_NUMBERS - of
        assert drawn.rows == 6
        getattr(drawn.struct, place)[0] += 1
        assert drawn.rows == 0
        getattr(drawn.struct, place)[0] = 0
    drawn.struct.ball[0] = 1  # which leaves no row: it takes three passive joints less
    assert drawn.rows == 0
    ball = Drawn("dpp", *["dppppp"] * 5)
    ball.struct.ball[0] = 1
    for place in ("end_place", "ball_place"):
        getattr(ball.struct, place)[0] = lib.PKM_MAX_NUMBERS - 3
        assert ball.rows == 6
        getattr(ball.struct, place)[0] += 1
        assert ball.rows == 0
        getattr(ball.struct, place)[0] = 0
