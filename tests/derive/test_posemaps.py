"""Proofs of the pose maps: their derivatives against differences of their frames, in 50 digits."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import mpmath as mp
import pytest
import sympy as sp
from pkmcal.derive import posemaps

FUNCTIONS = {f.name: f for f in posemaps.functions()}
DIGITS = 50
STEP = mp.mpf(10) ** -12  # of central differences, which are then good to 1e-24
POSES = {
    "spatial": ("12", "-25", "410", "0.3", "-0.4", "2.5"),
    "translation": ("12", "-25", "30", "0", "0", "0"),
    "planar": ("12", "-25", "0", "0", "0", "2.5"),
    "xy": ("12", "-25", "0", "0", "0", "0"),
    "2tpr2tps": ("0", "-25", "410", "0.3", "-0.4", "0"),
    "spherical": ("0", "0", "0", "0.3", "-0.4", "2.5"),
}
MAPS = [pose_map.name for pose_map in posemaps.MAPS]


@cache
def compiled(name: str, output: str) -> Callable[..., Any]:
    f = FUNCTIONS[name]
    vectors = [[sp.Symbol(f"{a.name}[{i}]", real=True) for i in range(a.size)] for a in f.inputs]
    return sp.lambdify(vectors, f.result(output), "mpmath")


def call(name: str, output: str, *arguments: Any) -> mp.matrix:
    return mp.matrix(compiled(name, output)(*map(list, arguments)))


def pose_of(name: str) -> mp.matrix:
    pose = mp.matrix(POSES[name])
    if name == "2tpr2tps":
        pose[0] = pose[2] * mp.tan(pose[4])  # eq. 7
    return pose


def free_indices(name: str) -> list[int]:
    (pose_map,) = (m for m in posemaps.MAPS if m.name == name)
    return [posemaps.POSE.index(coordinate) for coordinate in pose_map.free]


def frame(name: str, state: mp.matrix) -> tuple[mp.matrix, mp.matrix]:
    flat = list(call(f"map_{name}_frame", "R", state))
    return mp.matrix([flat[0:3], flat[3:6], flat[6:9]]), call(f"map_{name}_frame", "p", state)


def twist(name: str, state_at: Callable[[mp.mpf], mp.matrix]) -> tuple[mp.matrix, mp.matrix]:
    """(ω, v) of the frame at 0 along a path of states, by a central difference."""
    (R0, p0), (R1, p1) = frame(name, state_at(-STEP)), frame(name, state_at(STEP))
    spin = (R1 - R0) / (2 * STEP) * frame(name, state_at(mp.mpf(0)))[0].T
    return mp.matrix([spin[2, 1], spin[0, 2], spin[1, 0]]), (p1 - p0) / (2 * STEP)


def reported(name: str, state: mp.matrix) -> mp.matrix:
    """The pose x y z α β γ that a state is reported as."""
    return mp.matrix([*frame(name, state)[1], *call(f"map_{name}_angles", "angles", state)])


def moved(name: str, state: mp.matrix, step: mp.matrix) -> mp.matrix:
    return call(f"map_{name}_retract", "moved", state, step)


def unit(size: int, k: int) -> mp.matrix:
    return mp.matrix([int(i == k) for i in range(size)])


def dot(a: Any, b: Any) -> mp.mpf:
    return mp.fsum(x * y for x, y in zip(a, b, strict=True))


def assert_close(found: Any, expected: Any, tolerance: float = 1e-20) -> None:
    assert mp.norm(mp.matrix(found) - mp.matrix(expected), mp.inf) < tolerance


@pytest.fixture
def digits() -> Any:
    with mp.workdps(DIGITS):
        yield


WORDS = mp.matrix(["0.7", "-1.3", "0.4", "2.1", "-0.6", "1.9"])  # a covector (ω, v)


@pytest.mark.usefixtures("digits")
@pytest.mark.parametrize("name", MAPS)
def test_the_state_of_a_pose_has_the_frame_of_eq_1_and_reports_the_pose(name: str) -> None:
    pose = pose_of(name)
    state = call(f"map_{name}_from_pose", "state", pose)
    R_, p_ = frame(name, state)
    assert_close(list(R_), call("pose_frame", "R", pose))
    assert_close(p_, call("pose_frame", "p", pose))
    assert_close(reported(name, state), pose)


@pytest.mark.usefixtures("digits")
@pytest.mark.parametrize("name", MAPS)
def test_retract_by_nothing_changes_nothing_and_mends_a_state_off_its_manifold(name: str) -> None:
    state = call(f"map_{name}_from_pose", "state", pose_of(name))
    nothing = mp.zeros(len(free_indices(name)), 1)
    assert_close(moved(name, state, nothing), state)
    lengths = {"spatial": [slice(3, 7)], "planar": [slice(2, 4)]}
    lengths["2tpr2tps"] = [slice(2, 4), slice(4, 6)]
    for part in lengths.get(name, []):
        off = mp.matrix(state)
        for i in range(part.start, part.stop):
            off[i] *= 1 + mp.mpf("1e-6")
        assert_close(moved(name, off, nothing), state, 1e-20)


@pytest.mark.usefixtures("digits")
@pytest.mark.parametrize("name", MAPS)
def test_pull_is_the_tangent_of_retract(name: str) -> None:
    state = call(f"map_{name}_from_pose", "state", pose_of(name))
    row = call(f"map_{name}_pull", "row", state, WORDS[:3], WORDS[3:])
    for k in range(len(row)):
        spin, slide = twist(name, lambda t, k=k: moved(name, state, t * unit(len(row), k)))
        assert_close([row[k]], [dot(WORDS, [*spin, *slide])])


@pytest.mark.usefixtures("digits")
@pytest.mark.parametrize("name", MAPS)
def test_rates_are_those_of_the_reported_pose_along_a_step(name: str) -> None:
    state = call(f"map_{name}_from_pose", "state", pose_of(name))
    step = WORDS[: len(free_indices(name))]
    later, earlier = (reported(name, moved(name, state, t * step)) for t in (STEP, -STEP))
    expected = (later - earlier) / (2 * STEP)
    assert_close(call(f"map_{name}_rates", "pose", state, step), expected)


@pytest.mark.usefixtures("digits")
@pytest.mark.parametrize("name", MAPS)
def test_free_after_pull_differentiates_by_the_free_coordinates(name: str) -> None:
    pose = pose_of(name)
    state = call(f"map_{name}_from_pose", "state", pose)
    row = call(f"map_{name}_pull", "row", state, WORDS[:3], WORDS[3:])
    by_free = call(f"map_{name}_free", "out", state, row)
    for found, k in zip(by_free, free_indices(name), strict=True):

        def state_at(t: mp.mpf, k: int = k) -> mp.matrix:
            return call(f"map_{name}_from_pose", "state", pose + t * unit(6, k))

        spin, slide = twist(name, state_at)
        assert_close([found], [dot(WORDS, [*spin, *slide])])


@pytest.mark.usefixtures("digits")
@pytest.mark.parametrize("name", MAPS)
def test_velocity_is_that_of_the_state_along_a_step(name: str) -> None:
    state = call(f"map_{name}_from_pose", "state", pose_of(name))
    step = WORDS[: len(free_indices(name))]
    later, earlier = (moved(name, state, t * step) for t in (STEP, -STEP))
    expected = (later - earlier) / (2 * STEP)
    assert_close(call(f"map_{name}_velocity", "rate", state, step), expected)
