"""An effect of one's own, outside of the package, with a coefficient that is estimated."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.arrays import FloatArray, IntArray
from pkmcal.effects.effect import Moved
from pkmcal.readings.unknowns import Dependence, Numbers

RATE, NOISE, START = 0.8, 0.01, 0.0
TARGET = np.array([40.0, -25.0, 30.0])


def reach(actuators: FloatArray) -> FloatArray:
    """How far the first actuator is from the middle of its rows, in 100 mm (N,)."""
    away: FloatArray = (actuators[:, 0] - 800.0) / 100.0
    return away


@dataclass(frozen=True)
class Sinking:
    """The platform sinks, and tips about x, in proportion to the reach of the first actuator."""

    name: str = "sinking"
    argument: str = "sink"

    def dependences(self, measured: pk.Measurements) -> Iterator[Dependence]:
        """One coefficient for all rows, in mm."""
        n = len(measured)
        one = Numbers(("sink.rate",), ("mm",), np.array([0]), np.array([START]))
        yield Dependence(
            self.argument, "sink", np.zeros((n, 1)), {"": one}, np.zeros(n, dtype=np.intp)
        )

    def of_rows(self, measured: pk.Measurements) -> Sinking:
        """It needs nothing of the rows but their actuators."""
        return self

    def moved(
        self,
        machine: Any,
        pose: FloatArray,
        actuators: FloatArray,
        rows: IntArray,
        numbers: Mapping[str, FloatArray],
    ) -> Moved:
        """Proportional to its coefficient."""
        by = np.zeros((len(rows), 6, 1))
        by[:, 0, 0] = 1e-3 * reach(actuators)
        by[:, 5, 0] = -reach(actuators)
        return Moved(by[:, :, 0] * numbers[self.argument][rows], {self.argument: by})


def moved_pose(robot: pk.Robot, q: FloatArray, rate: float) -> FloatArray:
    """Poses of a machine that sinks: by its matrices, not by the package's derivatives."""
    motion = pk.screw.from_pose(robot.forward(q).pose)
    angle = 1e-3 * rate * reach(q)
    turn = np.tile(np.eye(4), (len(q), 1, 1))
    turn[:, 1, 1] = turn[:, 2, 2] = np.cos(angle)
    turn[:, 2, 1], turn[:, 1, 2] = np.sin(angle), -np.sin(angle)
    motion[:, :3, :3] = turn[:, :3, :3] @ motion[:, :3, :3]
    motion[:, 2, 3] -= rate * reach(q)
    return pk.screw.to_pose(motion)


def points(robot: pk.Robot, q: FloatArray, rate: float) -> FloatArray:
    """Where the target is (N, 3)."""
    motion = pk.screw.from_pose(moved_pose(robot, q, rate))
    return (motion @ np.r_[TARGET, 1.0])[:, :3]


@pytest.fixture(scope="module")
def machine() -> tuple[pk.Robot, pk.Robot, FloatArray]:
    """The nominal machine, the true one, and actuators."""
    robot = pk.load("hexapod")
    q = robot.inverse(pk.sample_poses(robot, 40, seed=2))
    return robot, robot.replace({"offset2": 0.3, "offset5": -0.2}), q


def measured(true: pk.Robot, q: FloatArray, seed: int) -> pk.Measurements:
    noise = np.random.default_rng(seed).normal(0.0, NOISE, (len(q), 3))
    return pk.Measurements(q, points(true, q, RATE) + noise, target=TARGET, sigma=NOISE)


def test_its_coefficient_is_estimated_as_surely_as_the_readings_allow(
    machine: tuple[pk.Robot, pk.Robot, FloatArray],
) -> None:
    """Deviations are those of the Cramér-Rao bound, by differences of the exact model."""
    robot, true, q = machine
    found = pk.identify(robot, measured(true, q, 0), free="offset*", effects=[Sinking()])
    assert found.free == (*(f"offset{i}" for i in range(1, 7)), "sink.rate")
    at, step = np.array([*found.values]), 1e-4

    def model(x: FloatArray) -> FloatArray:
        named = dict(zip(found.free[:6], x[:6], strict=True))
        return points(robot.replace(named), q, x[6]).ravel()

    slopes = [(model(at + e) - model(at - e)) / (2 * step) for e in step * np.eye(7)]
    information = np.array(slopes) @ np.array(slopes).T / NOISE**2
    bound = np.sqrt(np.diag(np.linalg.inv(information)))
    np.testing.assert_allclose(found.stderr, bound, rtol=2e-3)  # twists are of first order


def test_estimates_scatter_about_the_truth_as_stated(
    machine: tuple[pk.Robot, pk.Robot, FloatArray],
) -> None:
    robot, true, q = machine
    off = []
    for seed in range(25):
        found = pk.identify(robot, measured(true, q, seed), free="offset*", effects=[Sinking()])
        truth = [*(true.geometry[f"offset{i}"] for i in range(1, 7)), RATE]
        off.append((found.values - truth) / found.stderr)
        assert found.chi2_per_dof == pytest.approx(1.0, abs=5 * np.sqrt(2 / found.dof))
    off = np.array(off)
    assert np.abs(off.mean(axis=0)).max() < 4.0 / np.sqrt(len(off))
    assert np.mean(off**2) == pytest.approx(1.0, abs=4 * np.sqrt(2 / off.size))


def test_without_it_the_readings_contradict_the_geometry(
    machine: tuple[pk.Robot, pk.Robot, FloatArray],
) -> None:
    robot, true, q = machine
    with pytest.warns(pk.CalibrationWarning):
        assert pk.identify(robot, measured(true, q, 0), free="offset*").chi2_per_dof > 100.0


def test_rows_that_are_held_out_are_predicted_with_it(
    machine: tuple[pk.Robot, pk.Robot, FloatArray],
) -> None:
    robot, true, q = machine
    found = pk.identify(
        robot, measured(true, q, 1), free="offset*", effects=[Sinking()], holdout=0.25
    )
    assert found.holdout_rms < 1.5 * found.holdout_expected


def test_it_stands_beside_expansion(machine: tuple[pk.Robot, pk.Robot, FloatArray]) -> None:
    """At the reference temperature nothing has grown: the same estimate."""
    robot, true, q = machine
    alone = measured(true, q, 0)
    warm = replace(alone, temperature=np.full(len(q), 20.0))
    found = pk.identify(robot, warm, free="offset*", effects=[Sinking(), pk.Expansion(11.5e-6)])
    without = pk.identify(robot, alone, free="offset*", effects=[Sinking()])
    np.testing.assert_allclose(found.values, without.values, atol=1e-9)
    assert set(found.expansion.values()) == {11.5e-6}


def test_where_poses_have_unknowns_it_is_refused_by_name(
    machine: tuple[pk.Robot, pk.Robot, FloatArray],
) -> None:
    robot, true, q = machine
    noisy = replace(measured(true, q, 0), actuator_sigma=np.full(q.shape, 0.01))
    with pytest.raises(ValueError, match=r"^sinking: needs poses that follow from the actuators"):
        pk.identify(robot, noisy, free="offset*", effects=[Sinking()])


def test_arguments_of_one_name_are_refused(
    machine: tuple[pk.Robot, pk.Robot, FloatArray],
) -> None:
    robot, true, q = machine
    with pytest.raises(ValueError, match="effects: several arguments are called 'target'"):
        pk.identify(robot, measured(true, q, 0), effects=[Sinking(argument="target")])


def test_an_effect_that_gives_no_number_is_refused(
    machine: tuple[pk.Robot, pk.Robot, FloatArray],
) -> None:
    class Lost(Sinking):
        def of_rows(self, measured: Any) -> Any:
            return Rows(super().of_rows(measured))

    class Rows:
        def __init__(self, inner: Any) -> None:
            self.inner = inner

        def moved(self, *given: Any) -> Moved:
            found: Moved = self.inner.moved(*given)
            return found._replace(twist=np.full_like(found.twist, np.nan))

    robot, true, q = machine
    with pytest.raises(pk.ArgumentError, match=r"position: nothing finite .* row 0"):
        pk.identify(robot, measured(true, q, 1), free="offset*", effects=[Lost()])


def test_a_coefficient_that_is_held_by_name_stays_where_it_starts(
    machine: tuple[pk.Robot, pk.Robot, FloatArray],
) -> None:
    """As if the effect stated it: the same numbers of the machine, and no parameter."""

    class Stated(Sinking):
        def dependences(self, measured: pk.Measurements) -> Iterator[Dependence]:
            n = len(measured)
            yield Dependence(
                self.argument, "sink", np.full((n, 1), RATE), {}, np.zeros(n, dtype=np.intp)
            )

    class Begun(Sinking):
        def dependences(self, measured: pk.Measurements) -> Iterator[Dependence]:
            (each,) = super().dependences(measured)
            one = replace(each.estimated[""], start=np.array([RATE]))
            yield replace(each, estimated={"": one})

    robot, true, q = machine
    rows = measured(true, q, 0)
    stated = pk.identify(robot, rows, free="offset*", effects=[Stated()], holdout=0.25)
    for pattern in ("sink.rate", "sink*"):
        held = pk.identify(
            robot, rows, free="offset*", effects=[Begun()], fix=[pattern, "offset3"], holdout=0.25
        )
        assert held.free == tuple(f"offset{i}" for i in (1, 2, 4, 5, 6))
    held = pk.identify(robot, rows, free="offset*", effects=[Begun()], fix="sink*", holdout=0.25)
    np.testing.assert_allclose(held.values, stated.values, atol=1e-9)
    np.testing.assert_allclose(held.stderr, stated.stderr, rtol=1e-9)
    assert held.holdout_rms == pytest.approx(stated.holdout_rms, rel=1e-9)
    freed = pk.identify(robot, rows, free=["offset*", "sink.rate"], effects=[Sinking()])
    assert freed.free[-1] == "sink.rate"
    with pytest.raises(pk.ArgumentError, match=r"fix: .*'sink.rte'; did you mean 'sink.rate'"):
        pk.identify(robot, rows, free="offset*", effects=[Sinking()], fix="sink.rte")


def test_two_numbers_of_one_name_are_refused(
    machine: tuple[pk.Robot, pk.Robot, FloatArray],
) -> None:
    class Named(Sinking):
        def dependences(self, measured: pk.Measurements) -> Iterator[Dependence]:
            (each,) = super().dependences(measured)
            yield replace(each, estimated={"": replace(each.estimated[""], names=("offset2",))})

    robot, true, q = machine
    with pytest.raises(pk.ArgumentError, match=r"^offset2: 2 different parameters have this name"):
        pk.identify(robot, measured(true, q, 0), free="offset*", effects=[Named()])


def test_numbers_of_one_role_that_are_not_alike_are_refused(
    machine: tuple[pk.Robot, pk.Robot, FloatArray],
) -> None:
    """They were one number: two effects moved the platform by one coefficient."""

    class Turning(Sinking):
        def dependences(self, measured: pk.Measurements) -> Iterator[Dependence]:
            (each,) = super().dependences(measured)
            yield replace(each, estimated={"": replace(each.estimated[""], units=("rad",))})

    robot, true, q = machine
    effects = [Sinking(), Turning(name="turning", argument="turn")]
    with pytest.raises(pk.ArgumentError, match=r"one role, 'sink', that are not alike: .*\[mm\]"):
        pk.identify(robot, measured(true, q, 0), free="offset*", effects=effects)


def test_what_is_no_effect_is_named(machine: tuple[pk.Robot, pk.Robot, FloatArray]) -> None:
    class Still(Sinking):
        def of_rows(self, measured: Any) -> Any:
            return len(measured)

    class Half:
        name = "half"

        def of_rows(self, measured: Any) -> Any:
            return self

    robot, true, q = machine
    rows = measured(true, q, 0)
    for wrong, message in (
        (Sinking, r"the class Sinking; an object of it is needed: Sinking\(…\)"),
        ([Sinking], "the class Sinking"),
        (Half(), "an object of class Half has no dependences"),
        (Still(), "of_rows of Still must return an object with a method moved, .* found int"),
        (7, "expected such as"),
        (pk.readings.Position(), "expected such as"),
        ([7], "expected such as"),
    ):
        with pytest.raises(pk.ArgumentTypeError, match=f"^effects: .*{message}"):
            pk.identify(robot, rows, free="offset*", effects=wrong)  # type: ignore[arg-type]


def test_one_effect_stands_beside_the_former_expansion(
    machine: tuple[pk.Robot, pk.Robot, FloatArray],
) -> None:
    robot, true, q = machine
    warm = replace(measured(true, q, 0), temperature=np.full(len(q), 20.0))
    with pytest.warns(DeprecationWarning, match="expansion= will go"):
        found = pk.identify(  # type: ignore[call-arg]
            robot, warm, free="offset*", effects=Sinking(), expansion=11.5e-6
        )
    assert found.free[-1] == "sink.rate" and found.expansion
    with pytest.raises(pk.ArgumentError, match="expansion: not beside effects='auto'"):
        pk.identify(robot, warm, effects="auto", expansion=11.5e-6)  # type: ignore[call-arg]


def test_what_moves_in_another_shape_is_named(
    machine: tuple[pk.Robot, pk.Robot, FloatArray],
) -> None:
    robot, true, q = machine
    rows = measured(true, q, 0)
    n = len(q)
    wrong: tuple[tuple[Any, str], ...] = (
        (Moved(np.zeros((n, 3))), rf"moved of Bad: twist .* shape \({n}, 6\); found \({n}, 3\)"),
        (Moved(np.zeros((n, 6))), "'sink' is estimated, .* gives no derivative by it"),
        (Moved(np.zeros((n, 6)), {"sink": np.zeros((n, 6))}), r"by\['sink'\] must be an array"),
        (Moved(np.zeros((n, 6)), {"sink": np.zeros((n, 6, 2))}), r"by\['sink'\] must be an array"),
        (np.zeros((n, 6)), r"must return Moved\(…\); found ndarray"),
    )
    for returned, message in wrong:

        class Bad(Sinking):
            def of_rows(self, measured: Any) -> Any:
                return self

            def moved(self, *given: Any, found: Any = returned) -> Any:
                return found

        with pytest.raises(pk.Error, match=message):
            pk.identify(robot, rows, free="offset*", effects=[Bad()])


def test_a_coefficient_that_the_readings_do_not_see_is_no_calibration(
    machine: tuple[pk.Robot, pk.Robot, FloatArray],
) -> None:
    """A sensor of tilts sees how the platform tips, and not how it sinks."""

    class Straight(Sinking):
        def moved(self, *given: Any) -> Moved:
            found = super().moved(*given)
            for each in (found.twist, found.by[self.argument]):
                each[:, :3] = 0.0
            return found

    robot, _, q = machine
    tilts = pk.VirtualMachine(robot, 0.0, 1, angle_noise=1e-5).measure(q, "tilt")
    seen = pk.identify(robot, tilts, free=["base1.z", "base2.z"], effects=[Sinking()])
    assert np.isfinite(seen.stderr[seen.free.index("sink.rate")])
    assert "undetermined-effect" not in [each.check for each in seen.verdict.said]
    blind = pk.identify(robot, tilts, free=["base1.z", "base2.z"], effects=[Straight()])
    assert np.isinf(blind.stderr[blind.free.index("sink.rate")])
    (said,) = [each for each in blind.verdict.said if each.check == "undetermined-effect"]
    assert "sink.rate is not determined" in said.text and blind.verdict.state == "doubtful"
    again = pk.identify(
        robot, tilts, ["base1.z", "base2.z"], **said.remedies[0].applied({"effects": [Straight()]})
    )
    assert again.free[:2] == ("base1.z", "base2.z") and "sink.rate" not in again.free
    assert again.verdict.state == "calibrated"
