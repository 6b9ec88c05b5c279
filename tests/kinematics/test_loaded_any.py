"""Whatever yields, pulls and is asked for: rows are solved, or say that they are not."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pkmcal as pk
from pkmcal.core.library import GIVES_WAY

MACHINES = {
    "hexapod": "offset*", "rbt-6t03p": "rod*", "6-rus": "offset*", "linear-delta-6": "rod*",
    "2tpr2tps": "base*.x", "3prs": "offset*", "rotary-delta": "rod*",
}  # fmt: skip
ODD = st.sampled_from([0.0, -0.0, 1e-300, 1e9, -1e9, 1e300, np.nan, np.inf])
NEAR = st.floats(-1.0, 1.0)


@cache
def nominal(name: str) -> pk.Robot:
    return pk.load(name)


@st.composite
def asked(draw: st.DrawFn) -> tuple[pk.Robot, pk.Load, np.ndarray]:
    """A machine that yields a little or very much, loads by row, poses, some of them nowhere."""
    name = draw(st.sampled_from(sorted(MACHINES)))
    robot = nominal(name)
    angle = robot.actuator_units[0] == "rad" and MACHINES[name].startswith("offset")
    compliance = 10.0 ** draw(st.floats(-12.0, 2.0)) * (1e-4 if angle else 1.0)
    count = draw(st.integers(1, 5))
    size = 10.0 ** draw(st.floats(-3.0, 6.0))
    row = st.lists(NEAR, min_size=10, max_size=10)
    rows = np.array([draw(row) for _ in range(count)]) * [1, *[50] * 3, *[10] * 3, *[500] * 3]
    rows[:, 0] = np.abs(rows[:, 0])
    poses = robot.home + np.array([[draw(NEAR) for _ in range(6)] for _ in range(count)]) * (
        [60.0] * 3 + [0.3] * 3
    )
    for k in range(count):
        if draw(st.integers(0, 4)) == 0:
            poses[k, draw(st.integers(0, 5))] = draw(ODD)
    return robot.yielding({MACHINES[name]: compliance}), pk.Load.of_rows(rows * size), poses


@settings(max_examples=120, deadline=None)
@given(asked())
def test_rows_come_back_or_are_said_to_fail(case: tuple[pk.Robot, pk.Load, np.ndarray]) -> None:
    robot, load, poses = case
    machine = robot.under(load)
    at = machine.complete(poses)
    q = robot.inverse(at, load=load)
    held = np.isfinite(q).all(axis=1)
    assert not np.isinf(q).any()
    found = robot.forward(q, guess=np.where(np.isfinite(at), at, robot.home), load=load)
    assert (np.isfinite(found.pose).all(axis=1) == (found.status == 0)).all()
    assert np.isin(found.status, range(GIVES_WAY + 1)).all()
    assert (found.status[~held] != 0).all()
    back = robot.inverse(found.pose, near=q, load=load)
    both = found.ok & np.isfinite(back).all(axis=1)
    assert np.abs(back[both] - q[both]).max(initial=0.0) < 1e-7
    one = [k for k in range(len(at)) if held[k]][:1]
    for k in one:  # a row does not depend on those beside it
        alone = pk.Load.of_rows(load.rows((len(at),))[k])
        assert np.array_equal(robot.inverse(at[k], load=alone), q[k])


@settings(max_examples=60, deadline=None)
@given(st.sampled_from(sorted(MACHINES)), st.integers(0, 10**6), st.floats(-9.0, -5.0))
def test_what_a_force_does_is_reciprocal_and_costs_work(name: str, seed: int, power: float) -> None:
    """Maxwell and Betti: what i moves along j by a force is what j moves along i."""
    compliance = 10.0**power * (1e-4 if name == "6-rus" else 1.0)
    robot = nominal(name).yielding({MACHINES[name]: compliance})
    random = np.random.default_rng(seed)
    drawn = random.uniform(-1, 1, 6) * [20, 20, 20, 0.1, 0.1, 0.1]
    pose = robot.complete(robot.home + drawn)
    q = robot.inverse(pose)
    if not np.isfinite(q).all():
        return
    force = random.normal(size=(2, 3)) * 50.0
    small = 1.0 / max(1.0, np.abs(pk.stiffness(robot, pose).displacement(force[0])).max() * 1e4)
    ends = [
        robot.forward(q, guess=pose, load=pk.Load(force=sign * small * one)).pose[:3]
        for one in force
        for sign in (1, -1)
    ]
    moved = np.array([ends[0] - ends[1], ends[2] - ends[3]]) / (2 * small)
    size = np.sqrt(abs(moved[0] @ force[0] * (moved[1] @ force[1])))
    assert moved[0] @ force[0] > 0.0 and moved[1] @ force[1] > 0.0
    assert moved[0] @ force[1] == pytest.approx(moved[1] @ force[0], abs=2e-5 * size + 1e-9)
    known = pk.stiffness(robot, pose)
    for one, way in zip(force, moved, strict=True):
        assert known.displacement(one) == pytest.approx(way, abs=1e-4 * np.abs(way).max() + 1e-9)


@settings(max_examples=40, deadline=None)
@given(asked())
def test_stiffness_is_whole_or_not_a_number(case: tuple[pk.Robot, pk.Load, np.ndarray]) -> None:
    robot, load, poses = case
    found = pk.stiffness(robot, poses, load=pk.Load.of_rows(load.rows((len(poses),))[0]))
    finite = np.isfinite(found.compliance)
    assert (finite.all(axis=(1, 2)) == finite.any(axis=(1, 2))).all()
    known = found.compliance[finite.all(axis=(1, 2))]
    assert np.abs(known - known.swapaxes(1, 2)).max(initial=0.0) <= 1e-12 * np.abs(known).max(
        initial=1.0
    )
    direction, least = found.softest
    assert (np.isfinite(least) == np.isfinite(direction).all(axis=1)).all()
    assert str(found).startswith("stiffness at")
