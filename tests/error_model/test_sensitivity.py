"""Pose errors of erroneous geometries: laws that hold on every machine, and a second model."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pkmcal as pk
from pkmcal.error_model.sensitivity import STUDIES, own_names, study_cases

from .. import twin
from ..workspaces import WORKSPACE, poses

ROOT = Path(__file__).resolve().parents[2]
DELTA = ROOT / "examples" / "linear-delta" / "robot.toml"
CONSTRAINED = ("2tpr2tps-spatial", "3rps", "3prs", "linear-delta-6")
MACHINES = sorted(WORKSPACE)


@pytest.mark.parametrize("name", MACHINES)
def test_exact_error_is_that_of_solving_a_second_model_again(name: str) -> None:
    robot = pk.load(name)
    (pose,) = robot.complete(poses(name, 1))
    rng = np.random.default_rng(1)
    cases = list(rng.choice(own_names(robot), 3, replace=False))
    found = pk.sensitivity(robot, pose, step=0.7, cases=cases)
    q = robot.inverse(pose)
    for case, exact in zip(cases, found.exact, strict=True):
        unit = robot.geometry.units[robot.geometry.names.index(case)]
        error = 0.7 * {"mm": 1.0, "rad": 1e-3, "1": 1e-3}[unit]
        slots = robot.replace({case: robot.geometry[case] + error}).geometry.slots
        again = twin.forward(robot.model, q, slots, pose)
        np.testing.assert_allclose(exact, again - pose, atol=1e-8)


@pytest.mark.parametrize("name", MACHINES)
def test_linear_prediction_is_the_limit_of_the_exact_error(name: str) -> None:
    robot = pk.load(name)
    at = poses(name, 5)
    gaps = []
    for step in (0.02, 0.01):
        found = pk.sensitivity(robot, at, step)
        gaps.append(np.abs(found.exact - found.linear).max())
        assert gaps[-1] < 0.02 * np.abs(found.exact).max()
    assert gaps[1] < 0.3 * gaps[0] + 1e-10  # a quarter: the gap is of second order


@settings(max_examples=20)
@given(step=st.floats(-5.0, 5.0).filter(lambda s: abs(s) > 1e-3), axis=st.sampled_from("xyz"))
def test_all_base_joints_moved_alike_move_the_platform_alike(step: float, axis: str) -> None:
    robot = pk.load("hexapod")
    found = pk.sensitivity(robot, poses("hexapod", 4), step, cases=[f"base*.{axis}"])
    expected = np.zeros(6)
    expected["xyz".index(axis)] = step
    np.testing.assert_allclose(found.exact[0], np.tile(expected, (4, 1)), atol=1e-9)
    np.testing.assert_allclose(found.linear[0], np.tile(expected, (4, 1)), atol=1e-9)


def test_a_wildcard_puts_all_that_match_in_error_together() -> None:
    robot = pk.load("2tpr2tps")
    at = poses("2tpr2tps", 6)
    found = pk.sensitivity(robot, at, cases=["offset*", *(f"offset{i}" for i in range(1, 5))])
    np.testing.assert_allclose(found.linear[0], found.linear[1:].sum(axis=0), atol=1e-12)
    together = robot.replace({f"offset{i}": 1.0 for i in range(1, 5)})
    np.testing.assert_allclose(
        found["offset*"], together.forward(robot.inverse(at), guess=at).pose - at, atol=1e-9
    )


def test_an_error_of_a_parameter_is_that_of_all_it_ties() -> None:
    tied, untied = pk.load(DELTA), pk.load("linear-delta")
    at = tied.home + np.array([[30.0, -20, 15, 0, 0, 0], [0, 40, 0, 0, 0, 0]])
    found = pk.sensitivity(tied, at, 0.5, cases=["radius"])
    bigger = tied.replace({"radius": tied.geometry["radius"] + 0.5})
    assert (bigger.geometry.slots != tied.geometry.slots).sum() > 3
    alike = twin.forward(tied.model, tied.inverse(at[0]), bigger.geometry.slots, at[0])
    np.testing.assert_allclose(found.exact[0, 0], alike - at[0], atol=1e-8)
    assert untied.geometry.parameters == ()


def test_by_default_each_number_that_can_be_replaced_is_a_case() -> None:
    robot = pk.load(DELTA)
    found = pk.sensitivity(robot, robot.home)
    assert list(found.cases) == [
        name for name in robot.geometry.names if name in robot.geometry.match(["*"])
    ]
    assert "radius" in found.cases and "base1.x" not in found.cases


@pytest.mark.parametrize("shape", [(), (3,), (2, 2)])
def test_results_have_the_leading_shape_of_the_poses(shape: tuple[int, ...]) -> None:
    robot = pk.load("hexapod")
    at = poses("hexapod", int(np.prod(shape))).reshape(*shape, 6)
    found = pk.sensitivity(robot, at, cases=["offset1", "base*.z"])
    assert found.exact.shape == found.linear.shape == (2, *shape, 6)
    assert found.poses.shape == (*shape, 6)
    assert found.mean.shape == (2, 6)


def test_mean_is_that_of_the_sizes() -> None:
    robot = pk.load("2tpr2tps")
    found = pk.sensitivity(robot, poses("2tpr2tps", 9), cases=["offset1", "base2.y"])
    np.testing.assert_allclose(found.mean, np.abs(found.exact).mean(axis=1))
    np.testing.assert_allclose(found.mean_linear, np.abs(found.linear).mean(axis=1))


@pytest.mark.parametrize("name", CONSTRAINED)
def test_a_pose_off_the_closures_is_completed_first(name: str) -> None:
    robot = pk.load(name)
    off = robot.home + np.array([3.0, -2.0, 5.0, 0.05, 0.04, 0.02])
    found = pk.sensitivity(robot, off, 1e-6, cases=["offset1"])
    np.testing.assert_allclose(found.poses, robot.complete(off), atol=1e-8)
    assert np.abs(found.exact).max() < 1e-4


def test_a_pose_out_of_reach_is_nan_and_not_in_the_mean() -> None:
    robot = pk.load("linear-delta")
    at = poses("linear-delta", 3)
    far = np.concatenate([at, [[5000.0, 0, 0, 0, 0, 0]]])
    found = pk.sensitivity(robot, far, cases=["rod1"])
    assert np.isnan(found.exact[:, 3]).all() and np.isfinite(found.exact[:, :3]).all()
    np.testing.assert_array_equal(found.n_failed, [1])
    np.testing.assert_array_equal(found.failed, found.n_failed)  # the former name
    np.testing.assert_allclose(found.mean, pk.sensitivity(robot, at, cases=["rod1"]).mean)
    assert "not solved" in str(found)


@pytest.mark.parametrize("name", [*MACHINES, "examples/linear-delta/robot.toml"])
def test_every_study_has_cases_of_the_machine(name: str) -> None:
    robot = pk.load(ROOT / name if "/" in name else name)
    for study in STUDIES:
        cases = study_cases(robot, study)
        assert cases and robot.geometry.match(cases)


def test_studies_of_the_paper() -> None:
    robot = pk.load("2tpr2tps")
    branch = ["base1.x", "base1.y", "base1.z", "platform1.x", "platform1.y", "platform1.z"]
    assert study_cases(robot, "limb1") == ["offset1", *branch]
    assert study_cases(robot, "offsets") == ["offset1", "offset2", "offset3", "offset4"]
    alike = [name.replace("1", "*") for name in branch]
    assert study_cases(robot, "all-limbs") == ["offset*", *alike]


def test_the_table_has_a_line_for_each_case() -> None:
    robot = pk.load("2tpr2tps")
    lines = str(pk.sensitivity(robot, robot.home, cases=["offset1", "base*.y"])).splitlines()
    assert [line.split()[0] for line in lines[3:]] == ["offset1", "base*.y"]
    assert lines[4].split()[1:] == ["0.0000", "1.0000", "0.0000", "0.0000", "0.0000", "0.0000"]
    assert max(map(len, lines)) <= 100


@pytest.mark.parametrize(
    ("arguments", "error", "words"),
    [
        ({"cases": ["ofset1"]}, ValueError, "did you mean 'offset1'"),
        ({"cases": ["base1.x"], "step": 0.0}, ValueError, "step must not be 0, found 0"),
        ({"step": float("nan")}, ValueError, "step must be finite"),
        ({"step": "1"}, TypeError, "step must be a number"),
    ],
)
def test_what_is_wrong_is_named(arguments: dict[str, object], error: type, words: str) -> None:
    robot = pk.load("2tpr2tps")
    with pytest.raises(error, match=words):
        pk.sensitivity(robot, robot.home, **arguments)  # type: ignore[arg-type]


def test_a_tied_number_cannot_be_in_error_by_itself() -> None:
    robot = pk.load(DELTA)
    with pytest.raises(ValueError, match="driven by the parameter"):
        pk.sensitivity(robot, robot.home, cases=["base1.x"])


def test_poses_of_another_shape_are_refused() -> None:
    with pytest.raises(ValueError, match="poses must have shape"):
        pk.sensitivity(pk.load("hexapod"), [0.0, 0.0, 800.0])


def test_unknown_case_of_a_result_is_a_key_error() -> None:
    robot = pk.load("hexapod")
    with pytest.raises(KeyError, match="no case"):
        pk.sensitivity(robot, robot.home, cases=["offset1"])["offset2"]


def test_unknown_study_is_refused() -> None:
    with pytest.raises(ValueError, match="study must be one of"):
        study_cases(pk.load("hexapod"), "limb2")


def test_cases_are_one_name_or_several_but_not_none() -> None:
    robot = pk.load("2tpr2tps")
    assert pk.sensitivity(robot, robot.home, cases="offset*").cases == ("offset*",)
    with pytest.raises(ValueError, match="cases: name at least one number"):
        pk.sensitivity(robot, robot.home, cases=[])
    with pytest.raises(TypeError, match="cases must be a name or several, found 1"):
        pk.sensitivity(robot, robot.home, cases=[1])  # type: ignore[list-item]
    with pytest.raises(ValueError, match="poses must be at least one"):
        pk.sensitivity(robot, np.zeros((0, 6)))
