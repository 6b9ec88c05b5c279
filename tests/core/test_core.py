"""The compiled core from Python: the arrays it takes, and bits that do not depend on the way."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import tracemalloc
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.arrays import as_rows
from pkmcal.core import library, machine
from pkmcal.core import poses as core_poses
from pkmcal.core.library import ISAS, MOST_THREADS, SLOTS, ffi, in_threads, lib

from .. import robots
from ..workspaces import WORKSPACE, poses

AVAILABLE = range(lib.pkm_best_isa() + 1)
every = pytest.mark.parametrize("name", WORKSPACE)
FOUND = ("pose", "status", "iterations", "residual")


def on(isa: int, name: str) -> pk.Robot:
    robot = pk.load(name)
    robot.machine.isa = isa
    return robot


def same_bits(one: np.ndarray, other: np.ndarray) -> bool:
    return one.shape == other.shape and one.tobytes() == other.tobytes()


def hard_rows(name: str, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Coordinates and guesses of which some need Newton's safe way, and some cannot be solved."""
    rng = np.random.default_rng(8)
    at = poses(name, count, seed=8)
    q = pk.load(name).inverse(at)
    q += rng.normal(0.0, 0.1, q.shape) * np.abs(q).mean() * rng.integers(0, 2, (count, 1))
    q[5 % count], q[17 % count], q[23 % count, 0] = np.nan, -q[17 % count], 1e300
    return q, at + rng.uniform(-1, 1, at.shape) * [100, 100, 100, 0.8, 0.8, 0.8]


# the same bits however it runs --------------------------------------------------------------------


@every
@pytest.mark.parametrize("guessed", [False, True], ids=["one guess", "a guess a row"])
def test_forward_gives_the_same_bits_on_every_isa_and_in_every_lane_and_tail(
    name: str, guessed: bool
) -> None:
    q, guess = hard_rows(name, 203)
    start = guess if guessed else guess[0]
    expected = on(0, name).forward(q, start, threads=1)
    assert {0, 4} <= set(expected.status) and expected.iterations.max() > 5  # Newton's, too
    for isa in AVAILABLE:
        robot = on(isa, name)
        parts = [slice(0, n) for n in (*range(1, 41), 203)] + [slice(k, 203) for k in range(1, 20)]
        for part in parts:
            found = robot.forward(q[part], start[part] if guessed else start, threads=1)
            for field in FOUND:
                assert same_bits(getattr(found, field), getattr(expected, field)[part])
        for threads in (2, 3, 7):
            found = robot.forward(q, start, threads)
            for field in FOUND:
                assert same_bits(getattr(found, field), getattr(expected, field))


@every
def test_the_other_calls_give_the_same_bits_on_every_isa_and_in_every_tail(name: str) -> None:
    at = poses(name, 203, seed=9)
    q = on(0, name).inverse(at)
    speed, bend = np.random.default_rng(9).normal(size=(2, *q.shape))
    motion = on(0, name).machine.motion(on(0, name).slots, at, q, speed, bend)[0]
    expected: dict[str, np.ndarray] = {}
    for isa in AVAILABLE:
        robot = on(isa, name)
        slots, machine = robot.slots, robot.machine
        calls: dict[str, Callable[[slice], Any]] = {
            "inverse": lambda part, r=robot: r.inverse(at[part]),
            "jacobian": lambda part, r=robot: r.jacobian(at[part]),
            "forward_jacobian": lambda part, r=robot: r.forward_jacobian(at[part]),
            "error_jacobian": lambda part, r=robot: r.error_jacobian(at[part]),
            "error_twists": lambda part, r=robot: r.error_twists(at[part]),
            "closure": lambda part, m=machine, s=slots: m.closure(s, at[part], q[part]),
            "limbs": lambda part, m=machine, s=slots: m.limbs(s, at[part]),
            "rates": lambda part, m=machine, s=slots: m.rates(s, motion[part], q[part]),
            "motion": lambda part, m=machine, s=slots: m.motion(
                s, at[part], q[part], speed[part], bend[part]
            ),
        }
        for call, run in calls.items():
            for part in [slice(0, 203), *(slice(0, n) for n in range(1, 18)), slice(3, 203)]:
                arrays = run(part)
                for k, array in enumerate(arrays if isinstance(arrays, tuple) else (arrays,)):
                    whole = expected.setdefault(f"{call} {k}", array)
                    assert same_bits(array, whole[part]), call


def test_poses_are_composed_and_inverted_with_the_same_bits_on_every_isa(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    a, b = np.random.default_rng(10).uniform(-2.0, 2.0, (2, 41, 6))
    found = []
    for isa in AVAILABLE:
        monkeypatch.setattr(library, "ISA", isa)
        composed = core_poses.compose(a, b)
        for n in range(1, 18):
            assert same_bits(core_poses.compose(a[:n], b[:n]), composed[:n])
        rates = core_poses.compose_rates(
            a[0], b, a[1], core_poses.compose(core_poses.compose(a[0], b), a[1])
        )
        arrays = [
            composed,
            core_poses.compose(a[0], b),
            core_poses.compose(a, b[0]),
            core_poses.invert(a[0]),
            rates,
        ]
        arrays.append(core_poses.compose_twists(a[0], b, a[1]))
        found.append(b"".join(array.tobytes() for array in arrays))
    assert len(set(found)) == 1


@every
def test_one_guess_and_the_same_guess_in_every_row_lead_to_the_same_poses(name: str) -> None:
    robot = pk.load(name)
    q = robot.inverse(poses(name, 500, seed=11))
    one, each = robot.forward(q), robot.forward(q, np.broadcast_to(robot.home, (500, 6)))
    assert np.array_equal(one.status, each.status) and one.ok.all()
    np.testing.assert_allclose(one.pose, each.pose, rtol=0, atol=1e-9)


@every
def test_a_geometry_in_every_row_is_as_many_robots(name: str) -> None:
    robot, rng = pk.load(name), np.random.default_rng(12)
    at = poses(name, 21, seed=12)
    q = robot.inverse(at)
    values = robot.geometry.values + rng.normal(0.0, 1e-3, (len(at), len(robot.geometry)))
    robots = [robot.replace(each) for each in values]
    slots = np.array([each.geometry.slots for each in robots])
    for isa in AVAILABLE:
        machine = on(isa, name).machine
        for guess in (robot.home, at):
            pose, status, _, residual = machine.forward(slots, q, guess, threads=1)
            assert not status.any() and residual.max() < 1e-9
            alone = [
                each.forward(row, start).pose
                for each, row, start in zip(
                    robots, q, np.broadcast_to(guess, at.shape), strict=True
                )
            ]
            np.testing.assert_allclose(pose, alone, rtol=0, atol=1e-9)
            two = machine.forward(slots, q, guess, threads=2)[0]
            assert same_bits(two, pose)


def test_an_isa_can_be_forced_and_a_wrong_name_is_named() -> None:
    print_isa = "import pkmcal.core.library as c; print(c.ISAS[c.ISA])"
    for isa in AVAILABLE:
        done = run(print_isa, PKMCAL_ISA=ISAS[isa])
        assert done.stdout.strip() == ISAS[isa]
    assert run(print_isa, PKMCAL_ISA="").stdout.strip() == ISAS[lib.pkm_best_isa()]
    wrong = run(print_isa, PKMCAL_ISA="sse9")
    assert "PKMCAL_ISA must be one of base, avx2, avx512, found 'sse9'" in wrong.stderr


def test_an_isa_the_processor_has_not_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(library, "lib", SimpleNamespace(pkm_best_isa=lambda: 0))
    monkeypatch.setenv("PKMCAL_ISA", "avx2")
    with pytest.raises(ValueError, match="PKMCAL_ISA=avx2: this processor has no avx2"):
        library._default_isa()


def run(code: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, env=os.environ | environment
    )


def test_the_core_refuses_an_isa_a_machine_and_columns_it_does_not_have() -> None:
    robot = pk.load("hexapod")
    machine, pose, q = robot.machine, robot.home[None], robot.inverse(robot.home)[None]
    for columns in ([-1], [6 * len(SLOTS)], [3, 3], [4, 2]):
        with pytest.raises(ValueError, match="refused"):
            machine.error_jacobian(robot.slots, pose, q, np.array(columns, dtype=np.int32))
    machine.isa = 3
    with pytest.raises(ValueError, match="has no ISA"):
        machine.forward(robot.slots, q, robot.home, None)


def test_errors_go_to_their_places_and_nowhere_else() -> None:
    ideal, slots = np.arange(5.0), np.tile(np.arange(5.0), (2, 1))
    errors = np.array([[0.5, -0.25], [1.0, 2.0]])
    machine.with_errors(errors, np.array([4, 0], dtype=np.int32), ideal, slots)
    np.testing.assert_array_equal(slots, [[-0.25, 1, 2, 3, 4.5], [2, 1, 2, 3, 5]])
    for place in (-1, 5):
        with pytest.raises(ValueError, match="refused"):
            machine.with_errors(errors, np.array([0, place], dtype=np.int32), ideal, slots)


def test_threads_are_limited_whatever_is_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    started: list[int] = []
    begin = threading.Thread.start
    monkeypatch.setattr(
        threading.Thread, "start", lambda thread: (started.append(1), begin(thread))[1]
    )
    done = np.zeros(100_000, dtype=int)

    def run(start: int, stop: int) -> None:
        done[start:stop] += 1

    in_threads(run, len(done), 10**9)
    assert 1 < len(started) < MOST_THREADS
    assert (done == 1).all()


@pytest.mark.parametrize("order", [[99], [-1], [1, 1], [2**31 - 1], [0, 1, 2, 3, 4, 6]])
def test_the_core_refuses_a_machine_whose_order_of_elimination_is_none(order: list[int]) -> None:
    """It indexes what a call writes: one that is not a permutation wrote beyond it."""
    robot = pk.load("hexapod")
    machine, pose, q = robot.machine, robot.home[None], robot.inverse(robot.home)[None]
    assert lib.pkm_prepared(machine.struct) == machine.rows == 6
    for row, place in enumerate(order):
        machine.struct.order[row] = place
    assert lib.pkm_prepared(machine.struct) == 0
    for refused in (
        lambda: machine.inverse(robot.slots, pose),
        lambda: machine.forward(robot.slots, q, robot.home, None),
        lambda: machine.jacobian(robot.slots, pose),
    ):
        with pytest.raises(ValueError, match="refused"):
            refused()


@every
def test_rows_are_eliminated_by_their_largest_pivots_at_home(name: str) -> None:
    machine = (robot := pk.load(name)).machine
    home = robot.own_home[None]
    by_step = machine.closure(robot.slots, home, machine.inverse(robot.slots, home)).by_step[0]
    order = list(machine.struct.order[0 : machine.rows])
    A = by_step[np.argsort(order)]
    for c in range(machine.m):
        factors = A[c + 1 :, c] / A[c, c]
        assert np.abs(factors).max(initial=0.0) < 1.0 + 1e-9  # equal pivots: either may be first
        A[c + 1 :] -= factors[:, None] * A[c]


def test_the_core_takes_a_machine_with_as_many_rows_as_it_has_room_for() -> None:
    """More of them than an int has bits."""
    limb = {"kind": "UPS", "base": [300.0, 0.0, 0.0], "platform": [100.0, 0.0, -10.0]}
    turned = [
        limb | {"base": robots.ring(300.0, 15.0 * k), "platform": robots.ring(100.0, 14.0 * k)}
        for k in range(lib.PKM_MAX_LIMBS)
    ]
    struct = robots.made("spatial", {"z": 800.0}, turned).machine.struct
    assert lib.pkm_prepared(struct) == lib.PKM_MAX_LIMBS
    for i in range(lib.PKM_MAX_LIMBS):  # a row more each
        struct.rows[i] = 1
    for row in range(lib.PKM_MAX_ROWS):
        struct.order[row] = row
    assert lib.pkm_closure_count(struct) == lib.pkm_prepared(struct) == lib.PKM_MAX_ROWS
    struct.order[40] = 8  # 40 less the bits of an int
    assert lib.pkm_prepared(struct) == 0


@pytest.mark.parametrize("many", ["particles", "dims"])
def test_the_core_refuses_a_swarm_whose_size_is_no_number(many: str) -> None:
    swarm = ffi.new("pkm_swarm *", {"particles": 8, "dims": 2})
    assert lib.pkm_swarm_size(swarm) == 3 * 2 * 8 + 6 * 8 + 2 + 1
    for count in (0, -1, 2**31 - 1):
        setattr(swarm, many, count)
        assert lib.pkm_swarm_size(swarm) == 0


# importing ----------------------------------------------------------------------------------------


def test_a_robot_needs_numpy_and_the_core_alone() -> None:
    code = (
        "import pkmcal, sys; robot = pkmcal.load('hexapod');"
        "robot.forward(robot.inverse(robot.home));"
        "print(*sorted({name.split('.')[0] for name in sys.modules}))"
    )
    loaded = set(run(code).stdout.split())
    assert "numpy" in loaded
    assert not loaded & {"sympy", "scipy", "matplotlib", "typer", "rich", "dask", "mpmath"}


@pytest.mark.parametrize("call", ["inverse", "forward", "jacobian", "error_jacobian"])
def test_a_batch_needs_its_inputs_its_outputs_and_no_more(call: str) -> None:
    robot = pk.load("hexapod")
    more = []
    for count in (1_000, 10_000):
        rows = argument(robot, call, count)
        given = (rows, robot.inverse(rows)) if call == "error_jacobian" else (rows,)
        tracemalloc.start()
        found = getattr(robot, call)(*given)
        most = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        fields = [getattr(found, name) for name in FOUND] if call == "forward" else [found]
        more.append(most - sum(field.nbytes for field in fields))
    assert max(more) < 20_000  # bytes; one more copy of the rows would be 48 a row


# arrays -------------------------------------------------------------------------------------------

CALLS = ("inverse", "forward", "jacobian", "forward_jacobian", "error_jacobian")
CALLS += ("complete", "violation", "feasible")
each_call = pytest.mark.parametrize("call", CALLS)


def argument(robot: pk.Robot, call: str, count: int) -> np.ndarray:
    """Rows that the call takes."""
    at = poses("hexapod", count, seed=13)
    return robot.inverse(at) if call == "forward" else at


def numbers(robot: pk.Robot, call: str, rows: Any) -> np.ndarray:
    """What the call returns, as one array."""
    found = getattr(robot, call)(rows)
    return {"forward": lambda: found.pose, "feasible": lambda: found.drive}.get(
        call, lambda: found
    )()


def test_what_the_core_reads_is_aligned() -> None:
    whole = np.arange(72.0)
    shifted = np.frombuffer(b"\0" + whole.tobytes(), dtype=np.uint8)[1:].view("f8").reshape(12, 6)
    assert not shifted.flags.aligned
    rows, _ = as_rows("q", shifted, 6)
    assert rows.flags.aligned and np.array_equal(rows.ravel(), whole)


@each_call
def test_the_layout_of_an_array_does_not_matter(call: str) -> None:
    robot = pk.load("hexapod")
    rows = argument(robot, call, 12)
    expected = numbers(robot, call, rows)
    every_other = np.repeat(rows, 2, axis=0)[::2]
    columns = np.repeat(rows, 3, axis=1)[:, ::3]
    read_only = rows.copy()
    read_only.flags.writeable = False
    unaligned = np.frombuffer(b"\0" + rows.tobytes(), dtype=np.uint8)[1:].view("f8").reshape(12, 6)
    assert not every_other.flags.c_contiguous and not unaligned.flags.aligned
    for same in (
        *(
            every_other,
            columns,
            read_only,
            unaligned,
            np.asfortranarray(rows),
            rows[::-1].copy()[::-1],
        ),
        *(rows.astype(">f8"), rows.astype("<f8"), rows.astype(np.longdouble), rows.tolist()),
        *(rows.view(np.recarray), [tuple(row) for row in rows]),
    ):
        kept = np.array(same)
        assert same_bits(numbers(robot, call, same), expected)
        assert np.array_equal(kept, np.array(same))  # arguments are not written to
    for shape in ((3, 4), (2, 1, 6), (12, 1)):
        shaped = numbers(robot, call, rows.reshape(*shape, 6))
        assert shaped.shape == shape + expected.shape[1:]
        assert same_bits(shaped.reshape(expected.shape), expected)
    assert same_bits(numbers(robot, call, rows[3]), expected[3])
    assert same_bits(numbers(robot, call, np.broadcast_to(rows[3], (5, 6)))[4], expected[3])


@each_call
@pytest.mark.parametrize("dtype", ["f4", ">f4", "f2", "i4", ">i8", "u2"])
def test_other_numbers_are_taken_for_what_they_are(call: str, dtype: str) -> None:
    robot = pk.load("hexapod")
    rows = argument(robot, call, 12)
    if call != "forward" and dtype[-2] in "iu":
        rows = np.round(np.abs(rows) * [1, 1, 1, 0, 0, 0])
    rows = rows.astype(dtype)
    assert same_bits(numbers(robot, call, rows), numbers(robot, call, rows.astype(np.float64)))


@pytest.mark.parametrize("shape", [(0,), (3, 0), (0, 3)])
@each_call
def test_an_empty_batch_gives_empty_arrays(call: str, shape: tuple[int, ...]) -> None:
    robot = pk.load("linear-delta")  # n, m and 6 differ from each other: 3, 3 and 6
    width = robot.n_actuators if call == "forward" else 6
    one = numbers(robot, call, np.zeros(width))
    empty = numbers(robot, call, np.zeros((*shape, width)))
    assert empty.shape == shape + one.shape and empty.dtype == one.dtype


@pytest.mark.parametrize("shape", [(0,), (3, 0), (0, 3)])
def test_forward_of_an_empty_batch_has_empty_fields(shape: tuple[int, ...]) -> None:
    robot = pk.load("hexapod")
    for guess in (None, robot.home, np.zeros((*shape, 6))):
        found = robot.forward(np.zeros((*shape, 6)), guess, threads=2)
        for field in ("status", "iterations", "residual", "ok", "conditioning", "same_side"):
            assert getattr(found, field).shape == shape
        assert found.failures() == "" and str(found)


@each_call
@pytest.mark.parametrize(
    "wrong",
    [
        np.ones((2, 6), dtype=bool),
        np.ones((2, 6), dtype=object),
        np.ones((2, 6), dtype=complex),
        np.full((2, 6), "1.0"),
        np.zeros((2, 6), dtype="M8[s]"),
        np.zeros((2, 6), dtype="V8"),
        None,
        "hexapod",
        [["a"] * 6],
    ],
    ids=["bool", "object", "complex", "text", "dates", "void", "None", "a name", "letters"],
)
def test_what_is_no_number_is_refused_by_name(call: str, wrong: Any) -> None:
    robot = pk.load("hexapod")
    with pytest.raises(
        TypeError, match=f"^{'q' if call == 'forward' else 'pose'} must be .* found"
    ):
        getattr(robot, call)(wrong)


@each_call
@pytest.mark.parametrize("wrong", [1.0, [], [1.0] * 5, np.zeros((6, 7)), np.zeros((6, 0))])
def test_a_wrong_shape_is_refused_by_name(call: str, wrong: Any) -> None:
    robot = pk.load("hexapod")
    with pytest.raises(
        ValueError, match=f"^{'q' if call == 'forward' else 'pose'} must have shape"
    ):
        getattr(robot, call)(wrong)


@each_call
def test_a_ragged_list_is_refused_by_name(call: str) -> None:
    robot = pk.load("hexapod")
    with pytest.raises(ValueError, match="^q " if call == "forward" else "^pose "):
        getattr(robot, call)([[1.0] * 6, [1.0] * 5])


@pytest.mark.parametrize("shape", [(2, 6), (5, 1, 6), (3, 5, 6), (5, 5)])
def test_a_guess_of_another_shape_is_refused_by_name(shape: tuple[int, ...]) -> None:
    robot = pk.load("hexapod")
    with pytest.raises(ValueError, match=r"^guess "):
        robot.forward(np.ones((5, 6)), guess=np.zeros(shape))


@pytest.mark.parametrize("shape", [(6,), (1, 6), (4, 6), (3, 1, 6), (1, 4, 6), (3, 4, 6)])
def test_a_guess_is_broadcast_to_the_batch(shape: tuple[int, ...]) -> None:
    robot, rng = pk.load("hexapod"), np.random.default_rng(14)
    at = poses("hexapod", 12, seed=14).reshape(3, 4, 6)
    guess = robot.home + rng.uniform(-0.1, 0.1, shape)
    q, full = robot.inverse(at), np.broadcast_to(guess, (3, 4, 6))
    found = robot.forward(q, guess)
    assert found.pose.shape == (3, 4, 6)
    np.testing.assert_allclose(found.pose, robot.forward(q, full).pose, rtol=0, atol=1e-9)
    assert found.same_side.all()


@pytest.mark.parametrize("threads", [0, -1, 1.0, True, "2", [1]])
def test_threads_are_a_whole_number(threads: Any) -> None:
    robot = pk.load("hexapod")
    with pytest.raises(ValueError, match="threads must be a whole number from 1 or None, found"):
        robot.forward(np.zeros((5, 6)), threads=threads)
