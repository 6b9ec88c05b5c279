"""Screws and serial arms: a row is right or NaN as a whole, whatever went in, in any layout."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal import screw

from .test_never_silently_wrong import STRANGE, salted

ROWS = 2_000
ARM = pk.SerialArm(
    [[0, 0, 1], [1, 0, 0], [0, 1, 0], [1, 1, 0]],
    [[0, 0, 0], [0, 0, 520], [0, 350, 520], [0, 600, 520]],
    [0, 800, 520, 0.1, 0.2, 0.3],
    kinds=["revolute", "revolute", "prismatic", "revolute"],
)
FRAMES = ("space", "body", "tip")

# Name, function of rows, and what the rows are.
OF_THETA: dict[str, Callable[[Any], np.ndarray]] = {
    "forward": ARM.forward,
    **{f"jacobian {f}": lambda rows, f=f: ARM.jacobian(rows, frame=f) for f in FRAMES},
    **{f"error_jacobian {f}": lambda rows, f=f: ARM.error_jacobian(rows, frame=f) for f in FRAMES},
}
OF_SIX: dict[str, Callable[[Any], np.ndarray]] = {
    "exp": screw.exp,
    "exp_jacobian": screw.exp_jacobian,
    "log_jacobian": screw.log_jacobian,
    "from_pose": screw.from_pose,
}
OF_MOTIONS: dict[str, Callable[[Any], np.ndarray]] = {
    "log": screw.log,
    "adjoint": screw.adjoint,
    "to_pose": screw.to_pose,
    "inverse": lambda rows: ARM.inverse(rows, parts="position").residual,
}
CALLS = OF_THETA | OF_SIX | OF_MOTIONS
each_call = pytest.mark.parametrize("call", CALLS)


def rows_of(call: str, count: int, seed: int = 0) -> np.ndarray:
    """Rows that the call takes: coordinates (N, 4), twists or poses (N, 6), motions (N, 4, 4)."""
    rng = np.random.default_rng(seed)
    if call in OF_THETA:
        return rng.uniform(-1, 1, (count, 4)) * [3, 3, 200, 3]
    six = rng.uniform(-1, 1, (count, 6))
    return screw.exp(six) if call in OF_MOTIONS else six


def whole_or_nan(found: np.ndarray) -> np.ndarray:
    """Which rows are known, after a look that the others are NaN."""
    finite = np.isfinite(found.reshape(len(found), -1))
    known: np.ndarray = finite.all(axis=1)
    assert np.isnan(found[~known]).all()
    return known


@pytest.mark.parametrize("call", OF_THETA | OF_SIX)
def test_a_row_is_known_as_a_whole_or_not_at_all(call: str) -> None:
    rows = salted(rows_of(call, ROWS), 0.1, np.random.default_rng(1))
    known = whole_or_nan(CALLS[call](rows))
    assert 0.3 < known.mean() < 1.0
    assert not known[~np.isfinite(rows).all(axis=1)].any()
    # and its neighbours do not matter to it
    assert np.array_equal(CALLS[call](rows[known]), CALLS[call](rows)[known])


@pytest.mark.parametrize("call", OF_THETA)
def test_derivatives_are_known_where_the_tool_is(call: str) -> None:
    rows = salted(rows_of(call, ROWS), 0.2, np.random.default_rng(2))
    tool = np.isfinite(ARM.forward(rows)).all(axis=(1, 2))
    assert np.array_equal(whole_or_nan(OF_THETA[call](rows)), tool)


@pytest.mark.parametrize("call", ["log", "adjoint", "to_pose"])
def test_a_motion_to_a_strange_place_is_known_as_a_whole_or_not_at_all(call: str) -> None:
    rows = rows_of(call, ROWS)
    rows[:, :3, 3] = salted(rows[:, :3, 3], 0.2, np.random.default_rng(3))
    known = whole_or_nan(CALLS[call](rows))
    assert 0.3 < known.mean() < 1.0
    assert not known[~np.isfinite(rows).all(axis=(1, 2))].any()


def test_a_strange_target_is_not_reached_and_says_so() -> None:
    for number in [*STRANGE[np.abs(STRANGE) > 1e4].tolist(), np.nan]:
        for place in range(3):
            target = ARM.forward(rows_of("forward", 3))
            target[1, place, 3] = number
            found = ARM.inverse(target, guess=rows_of("forward", 3))
            assert found.status.tolist() == [0, 1 if np.isfinite(number) else 4, 0]
            assert np.isnan(found.theta[1]).all() and np.isfinite(found.theta[[0, 2]]).all()


@pytest.mark.parametrize("number", STRANGE)
@pytest.mark.parametrize("place", range(6))
def test_a_strange_joint_error_is_right_or_refused(number: float, place: int) -> None:
    errors = np.zeros((4, 6))
    errors[1, place] = number
    given = dict(zip(("dx", "dy", "dz", "dphi", "dtheta", "dpsi"), errors[1], strict=True))
    if not np.isfinite(number):
        with pytest.raises(ValueError, match="joint_errors must be finite"):
            ARM.forward(np.zeros(4), errors)
        with pytest.raises(ValueError, match="must be finite"):
            screw.joint_error(**given)
        return
    for call in (ARM.forward, ARM.jacobian, ARM.error_jacobian):
        found = call(np.zeros((1, 4)), errors)
        assert whole_or_nan(found).all() or abs(number) > 1e4
    try:
        error = screw.joint_error(**given)
    except ValueError as refused:
        assert "too large" in str(refused) and abs(number) > 1e4
    else:
        assert np.isfinite(error.twist).all() and np.isfinite(error.magnitude)


# --- arrays -------------------------------------------------------------------------------------


@each_call
def test_the_layout_of_an_array_does_not_matter(call: str) -> None:
    rows = rows_of(call, 12)
    expected = CALLS[call](rows)
    read_only = rows.copy()
    read_only.flags.writeable = False
    unaligned = np.frombuffer(b"\0" + rows.tobytes(), dtype=np.uint8)[1:].view("f8")
    for same in (
        *(np.repeat(rows, 2, axis=0)[::2], np.repeat(rows, 3, axis=-1)[..., ::3], read_only),
        *(unaligned.reshape(rows.shape), np.asfortranarray(rows), rows[::-1].copy()[::-1]),
        *(rows.astype(">f8"), rows.astype(np.longdouble), rows.tolist(), rows.view(np.recarray)),
    ):
        kept = np.array(same)
        assert CALLS[call](same).tobytes() == expected.tobytes()
        assert np.array_equal(kept, np.array(same))  # arguments are not written to
    shaped = CALLS[call](rows.reshape(3, 4, *rows.shape[1:]))
    assert shaped.tobytes() == expected.tobytes() and shaped.shape == (3, 4, *expected.shape[1:])
    assert CALLS[call](rows[3]).tobytes() == expected[3].tobytes()


@each_call
@pytest.mark.parametrize("dtype", ["f4", ">f4", "i4", ">i8"])
def test_other_numbers_are_taken_for_what_they_are(call: str, dtype: str) -> None:
    rows = rows_of(call, 12)
    if dtype[-2] == "i":
        rows = np.round(rows)
    if call in OF_MOTIONS:
        rows = np.tile(np.eye(4), (12, 1, 1))
        rows[:, 0, 3] = np.arange(12)
    rows = rows.astype(dtype)
    assert CALLS[call](rows).tobytes() == CALLS[call](rows.astype("f8")).tobytes()


@each_call
@pytest.mark.parametrize("shape", [(0,), (3, 0), (0, 3)])
def test_an_empty_batch_gives_empty_arrays(call: str, shape: tuple[int, ...]) -> None:
    rows = rows_of(call, 1)
    one, empty = CALLS[call](rows[0]), CALLS[call](np.empty((*shape, *rows.shape[1:])))
    assert empty.shape == shape + one.shape and empty.dtype == one.dtype


@each_call
@pytest.mark.parametrize(
    "wrong", [None, "abc", np.ones((2, 6), dtype=bool), np.ones((2, 6), dtype=complex), [["a"] * 6]]
)
def test_what_is_no_number_is_refused_by_name(call: str, wrong: Any) -> None:
    with pytest.raises(TypeError, match=r"^(theta|twist|pose|motion|target) must be .* found"):
        CALLS[call](wrong)


@each_call
@pytest.mark.parametrize("wrong", [1.0, [], [1.0] * 5, np.zeros((6, 7)), np.zeros((3, 0))])
def test_a_wrong_shape_is_refused_by_name(call: str, wrong: Any) -> None:
    with pytest.raises(ValueError, match=r"^(theta|twist|pose|motion|target) must have shape"):
        CALLS[call](wrong)


@each_call
def test_a_ragged_list_is_refused_by_name(call: str) -> None:
    with pytest.raises(ValueError, match=r"^(theta|twist|pose|motion|target) must have shape"):
        CALLS[call]([[1.0] * 6, [1.0] * 5])
