"""What every kind of reading obeys, also one that is no part of the package."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2

import pkmcal as pk
from pkmcal.estimation.equations import Equations
from pkmcal.estimation.fit_data import FitData
from pkmcal.estimation.free_parameters import parameters
from pkmcal.estimation.own_classes import require_true
from pkmcal.estimation.parameters import Asked
from pkmcal.estimation.starts import with_starts
from pkmcal.readings import At, Height, Position, Predicted, Reading, Start, always
from pkmcal.readings.registry import KINDS, require_own_columns

from ..simulated import with_errors
from .cases import CASES, EVERY, NOISE, Case, with_that_of
from .own import Loop, Spot

SIGMA = 0.5  # mm; errors of the machine

CASE = pytest.mark.parametrize("case", EVERY, ids=[case.name for case in EVERY])
READING = pytest.mark.parametrize(
    "case", [c for c in EVERY if c.name != "closure"], ids=lambda case: case.name
)


def test_every_registered_kind_has_a_case() -> None:
    names = {case.name.partition(" ")[0] for case in CASES}
    assert {*KINDS} - names == {"touch-distance"}  # which `identify` makes of touches


@pytest.mark.parametrize("unknown", [False, True], ids=["known", "unknown"])
@READING
def test_derivatives_are_those_of_differences(case: Case, unknown: bool) -> None:
    """By the machine's numbers, through the pose; by the frame; by each argument of the reading."""
    robot, rows = pk.load(case.machine), 12
    measured = case.measured(robot, rows, 7, 3.0)
    measured = dataclasses.replace(measured, actuator_sigma=0.0)  # no pose moves by itself
    target = unknown and "target" in case.unknown
    (share,) = with_starts(robot, [FitData(measured, np.arange(rows), unknown, target, unknown)])
    free = None if case.machine != "hexapod" else ["base*", "offset*", "gain*"]
    chosen = parameters(robot, [share], Asked(free))
    equations = Equations.of([share], chosen)
    theta = chosen.start.copy()
    if share.frame is not None:
        frame = chosen.nuisance[share.frame]
        theta[frame : frame + 6] = case.frame
    require_true(equations.prediction, equations.at(theta), trusted=lambda of: False)
    (jacobian,) = equations.jacobian(equations.at(theta))
    columns = []
    for j, scale in enumerate(chosen.scale):
        step = np.eye(len(theta))[j] * 1e-3 * scale
        ends = [equations.at(theta + sign * step).residuals[0] for sign in (1, -1)]
        columns.append((ends[1] - ends[0]) / 2e-3)
    expected = np.stack(columns, axis=-1)
    atol = 2e-7 * np.abs(expected).max()
    np.testing.assert_allclose(jacobian * chosen.scale, expected, rtol=0, atol=atol)


@CASE
def test_columns_are_read_back_to_the_last_bit(case: Case, tmp_path: Path) -> None:
    measured = case.measured(pk.load(case.machine), 7, 3, NOISE)
    measured.write(tmp_path / "m.csv")
    again = pk.read_measurements(tmp_path / "m.csv", kind=case.own)
    assert again.kind == measured.kind and again.notes == ()
    assert again.values.tobytes() == measured.values.tobytes()
    assert again.actuators.tobytes() == measured.actuators.tobytes()
    for each in dataclasses.fields(measured.instrument):
        one, other = (getattr(m.instrument, each.name) for m in (measured, again))
        assert np.array_equal(one, other), each.name
    assert str(again) == str(measured)


@CASE
def test_rows_take_what_the_instrument_has_of_them_along(case: Case) -> None:
    measured = case.measured(pk.load(case.machine), 7, 3, NOISE)
    rows = [5, 2]
    part = measured.select(rows).instrument
    for name in (*part.per_row, *part.labels):
        whole, own = getattr(measured.instrument, name), getattr(part, name)
        assert (whole is None) == (own is None)
        if whole is not None:
            np.testing.assert_array_equal(own, whole[rows])


@CASE
def test_what_a_simulation_was_told_is_not_in_its_measurements(case: Case) -> None:
    measured = case.measured(pk.load(case.machine), 7, 3, NOISE)
    plain = {f.name: f.default for f in dataclasses.fields(measured.instrument)}
    for name in measured.instrument.truth:
        assert np.array_equal(getattr(measured.instrument, name), plain[name])


@pytest.mark.filterwarnings("ignore:the measurements contradict the prior")  # by chance
@READING
def test_all_its_unknowns_are_found_from_nothing_as_well_as_is_said(case: Case) -> None:
    """Errors of all numbers that are known here, by their covariance: chi-square distributed."""
    robot = pk.load(case.machine)
    true = with_errors(robot, SIGMA, np.random.default_rng(1))
    measured = case.measured(true, case.rows, 1, NOISE)
    found = pk.identify(robot, measured, prior=SIGMA, holdout=0.25, unknown=case.unknown)
    known = [i for i, name in enumerate(found.free) if name in robot.geometry.names]
    off = found.values[known] - [true.geometry[found.free[i]] for i in known]
    covariance = found.covariance[np.ix_(known, known)]
    distance = off @ np.linalg.solve(covariance, off)
    assert 1e-4 < chi2.cdf(distance, len(known)) < 1 - 1e-4
    assert found.holdout_rms == pytest.approx(found.holdout_expected, rel=0.6)
    assert found.verdict.state != "not calibrated", str(found.verdict)


@READING
def test_words(case: Case) -> None:
    measured = case.measured(pk.load(case.machine), 3, 3, NOISE)
    reading = measured.instrument
    assert reading.noun(3) in str(measured) and reading.noun(1) != reading.noun(2)
    assert type(reading).__doc__ and reading.name in measured.kind
    assert len(reading.mm(measured, 100.0)) == len(measured.units)


@pytest.mark.parametrize(
    "case", [c for c in CASES if c.name in ("tilt", "spot", "height")], ids=lambda case: case.name
)
def test_poses_are_planned_for_the_object(case: Case) -> None:
    robot = pk.load(case.machine)
    _, instrument = case.draw(robot, 1, np.random.default_rng(0))
    candidates = pk.sample_poses(robot, 40, seed=2)
    plan = pk.plan_poses(
        robot, candidates, 15, kind=instrument, target=case.target, prior=SIGMA, free="offset*"
    )
    assert plan.kinds == (instrument.name,) * 15 and plan.predicted < plan.at_random


def test_readings_with_entries_of_their_own_in_each_row_are_not_planned() -> None:
    robot = pk.load("hexapod")
    kind = pk.readings.RelativeDistance(run=["A"])
    with pytest.raises(pk.ArgumentError, match="kind: relative distances state run for every row"):
        pk.plan_poses(robot, pk.sample_poses(robot, 5), 3, kind=kind, target=[900.0, 0, 0])


def test_values_that_are_grossly_off_in_a_unit_of_ones_own_are_judged() -> None:
    spot = next(case for case in CASES if case.name == "spot")
    robot = pk.load(spot.machine)
    measured = spot.measured(robot, 30, 3, NOISE)
    wrong = dataclasses.replace(measured, values=measured.values * -3.0)
    with pytest.warns(pk.CalibrationWarning):
        found = pk.identify(robot, wrong, free="offset*", prior=SIGMA)
    assert found.verdict.state == "not calibrated"


@pytest.mark.parametrize("stated", [True, False], ids=["sigma", "no sigma"])
def test_a_worth_in_mm_of_each_row_is_that_of_all_rows_where_they_are_alike(
    stated: bool,
) -> None:
    """Statistics and words are the same to the last digits."""

    @dataclasses.dataclass(frozen=True, eq=False)
    class ByRow(Spot):
        def mm(self, m: Any, length: float) -> np.ndarray:
            return np.full((len(m), 2), self.pitch)

    robot = pk.load("hexapod")
    q = robot.inverse(pk.sample_poses(robot, 30, seed=1))
    true = robot.replace({"offset1": 0.4})
    measured = pk.VirtualMachine(true, noise=0.2, seed=0).measure(q, Spot(), [30.0, 0, 50])
    rows = measured if stated else dataclasses.replace(measured, sigma=None)
    one = pk.identify(robot, rows, "offset*")
    two = pk.identify(robot, dataclasses.replace(rows, kind=ByRow()), "offset*")
    np.testing.assert_allclose(two.values, one.values, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(two.stderr, one.stderr, rtol=1e-9)
    assert two.observability == pytest.approx(one.observability, rel=1e-9)
    assert str(two) == str(one)


def test_a_unit_of_which_nobody_says_what_it_is_worth_is_refused_by_name() -> None:
    class Plain(type(CASES[-1].own)):  # type: ignore[misc]
        mm = pk.readings.Reading.mm

    robot = pk.load("hexapod")
    measured = pk.VirtualMachine(robot, NOISE).measure(robot.inverse(robot.home), Plain())
    with pytest.raises(pk.ArgumentError, match="'spot' has to state in its method mm what one px"):
        pk.identify(robot, measured, free="offset*", prior=SIGMA)


def test_what_is_predicted_in_another_shape_is_named() -> None:
    spot = next(case for case in CASES if case.name == "spot")
    robot = pk.load(spot.machine)
    measured = spot.measured(robot, 10, 3, NOISE)
    wrong = (
        ({"values": np.zeros(10)}, r"'bad': values must be an array of shape \(10, 2\); found"),
        ({"by_twist": np.zeros((10, 6))}, r"'bad': by_twist must be an array of shape"),
        ({"by": {}}, "'centre' is estimated, but predict of 'bad'"),
        ({"by": {"centre": np.zeros((10, 2))}}, r"'bad': by\['centre'\] must be an array"),
    )
    for changes, message in wrong:

        @dataclasses.dataclass(frozen=True, eq=False)
        class Bad(Spot):
            name = "bad"
            different = changes

            def predict(self, at: At, **numbers: Any) -> Predicted:  # type: ignore[override]
                return dataclasses.replace(super().predict(at, **numbers), **self.different)

        other = dataclasses.replace(measured, kind=Bad())
        with pytest.raises(pk.ArgumentError, match=message):
            pk.identify(robot, other, free="offset*", prior=SIGMA)


def test_only_an_object_of_a_class_of_ones_own_is_taken_for_a_file(tmp_path: Path) -> None:
    spot = next(case for case in CASES if case.name == "spot")
    spot.measured(pk.load(spot.machine), 5, 3, NOISE).write(tmp_path / "m.csv")
    for wrong in ("height", Spot):
        with pytest.raises(pk.ArgumentTypeError, match=r"^kind must be a Reading"):
            pk.read_measurements(tmp_path / "m.csv", kind=wrong)  # type: ignore[arg-type]


OWN = """
from dataclasses import dataclass
import pkmcal as pk
from pkmcal.readings import Position, Reading

@dataclass(frozen=True, eq=False)
class Sideways(Reading):
    name, components = "sideways", (("across", "mm"), ("along", "mm"), ("up", "mm"))

    def predict(self, at, **numbers):
        return Position().predict(at)

def draw(robot, rows, rng):
    return robot.inverse(pk.sample_poses(robot, rows, seed=int(rng.integers(99)))), Sideways()

CASE = {"name": "sideways", "draw": draw, "own": Sideways(), "target": None}
"""


def test_a_kind_of_ones_own_is_tried_from_its_file(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(OWN)
    *_, case = with_that_of(str(tmp_path / "mine.py"))
    assert case.name == "sideways"
    test_columns_are_read_back_to_the_last_bit(case, tmp_path)
    test_derivatives_are_those_of_differences(case, False)


@dataclasses.dataclass(frozen=True, eq=False)
class String(Loop):
    """A string of which something is left out of the class or wrong."""

    wrong: str = ""

    name = "string"

    def predict(self, at: At, **numbers: Any) -> Any:  # type: ignore[override]
        found = super().predict(at, **numbers)
        return (found.values, found.by_twist) if self.wrong == "predict" else found

    def dependences(self, data: Any) -> Any:
        names = self.loop[:1] if self.wrong == "names" else self.loop
        made = always("zero", "loop", (("zero", "mm"),), list(names), data.starts)
        return {"depend": ("zero",), "none": None}.get(self.wrong, (made,))

    def starts(self, machine: Any, sets: Any, found: Any) -> None:
        if self.wrong != "starts":
            super().starts(machine, sets, found)
        changed = {
            "nan": ((0,), [np.nan]),
            "size": ((0, 1), [1.0]),
            "slots": ((3,), [1.0]),
        }
        if self.wrong in changed:
            found["loop", "A"] = Start(*changed[self.wrong])


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ("predict", r"predict of the class String must return Predicted; found tuple"),
        ("names", "zero: the dependence on it has 1 names .* each of 20 rows"),
        (
            "depend",
            r"dependences of the class String must return Iterator\[Dependence\]; found str",
        ),
        ("none", r"dependences of the class String must return Iterator\[Dependence\]; found None"),
        ("nan", "the search for loop.A.zero has a start that is no finite number"),
        ("size", r"Start: 2 slots \(0, 1\) need as many values; found shape \(1,\)"),
        ("slots", r"zero: the start of loop 'A' has slots \(3,\), and the argument 1 numbers"),
        ("starts", r"zero: the search for loop 'A' has no start: .* found\['loop', 'A'\]"),
    ],
)
def test_what_a_class_of_ones_own_leaves_out_is_named(wrong: str, message: str) -> None:
    robot = pk.load("hexapod")
    q = robot.inverse(pk.sample_poses(robot, 20, seed=1))
    with pytest.raises(pk.ArgumentError, match=message):
        measured = pk.VirtualMachine(robot, NOISE).measure(q, String(["A", "B"] * 10, wrong))
        pk.identify(robot, measured, "offset*")


def test_starts_that_need_poses_and_do_not_say_so_are_named() -> None:
    class Forgot(String):
        starts_by_pose = False

    robot = pk.load("hexapod")
    q = robot.inverse(pk.sample_poses(robot, 20, seed=1))
    measured = pk.VirtualMachine(robot, NOISE).measure(q, Forgot(["A"] * 20))
    with pytest.raises(
        pk.ArgumentError, match=r"starts of the class Forgot .* starts_by_pose = True"
    ):
        pk.identify(robot, measured, "offset*")


def test_a_class_without_name_or_components_or_with_those_of_other_columns_is_named() -> None:
    wrong: dict[str, tuple[dict[str, Any], str]] = {
        "name": ({"name": ""}, "Wrong has to state its name"),
        "components": ({"components": ()}, r"Wrong has to state its components .* found \(\)"),
        "pairs": ({"components": ("mm",)}, "Wrong has to state its components"),
        "time": ({"components": (("time", "s"),)}, "Wrong calls a column 'time'"),
        "q1": ({"components": (("q1", "mm"),)}, "Wrong calls a column 'q1'"),
        "label": ({"labels": ("thread",)}, r"labels of .* 'thread', which is no field .* loop"),
        "word": ({"labels": "loop"}, "labels of the class Wrong has to be a tuple of names"),
        "per row": ({"per_row": ("wire",)}, "per_row of the class Wrong names 'wire'"),
        "nouns": ({"nouns": ("loop",)}, "nouns of the class Wrong are one and several"),
        "turning": ({"turning": 0}, "turning of the class Wrong is the first of its last three"),
        "predict": ({"predict": pk.readings.Reading.predict}, "has no method predict"),
        "init": ({"__init__": lambda self, loop: None}, "Wrong has to be a dataclass"),
    }
    for members, message in wrong.values():
        reading = type("Wrong", (Loop,), {"name": "wrong", **members})(["A"] * 3)
        with pytest.raises((pk.ArgumentError, pk.ArgumentTypeError), match=message):
            pk.Measurements(np.ones((3, 6)), np.ones(3), reading)


def test_two_kinds_that_would_read_the_same_columns_are_refused() -> None:
    loop = Loop()
    other = type("Other", (Loop,), {"name": "other"})()
    with pytest.raises(TypeError, match="loop and other both read the columns length, loop"):
        require_own_columns((*KINDS.values(), loop, other))
    require_own_columns((*KINDS.values(), loop))


def test_a_kind_whose_files_would_be_taken_for_another_kind_is_not_written(tmp_path: Path) -> None:
    """Read back without it, its z would be a height, and the fit wrong without a word."""
    own = type("Doubled", (Height,), {"name": "doubled"})()
    measured = pk.Measurements(np.ones((3, 6)), np.ones(3), own)
    with pytest.raises(TypeError, match="height and doubled both read the columns z: names"):
        measured.write(tmp_path / "z.csv")
    assert not (tmp_path / "z.csv").exists()


def _failing(at: At, zero: Any, failure: str) -> Predicted:
    seen = Position().predict(at)
    values, by_twist = seen.values[:, 2:], seen.by_twist[:, 2:]
    if failure == "no by_twist":
        return Predicted(values)  # type: ignore[call-arg]
    return Predicted({"zero": values}["zerro"], by_twist)


@pytest.mark.parametrize(
    "failure, said",
    [
        ("no by_twist", r"TypeError: .* 'by_twist'; it is given at.* has to return Predicted"),
        ("a key", r"KeyError: 'zerro'; it is given at, zero and has to return Predicted"),
    ],
)
def test_a_predict_that_fails_is_named_with_what_it_is_given(failure: str, said: str) -> None:
    """Simulated and fitted: the class, what went wrong in it, and what it has to return."""
    members = {
        "name": "sunk",
        "components": (("sunk", "mm"),),
        "predict": lambda self, at, zero=0.0, **numbers: _failing(at, zero, failure),
        "arguments": lambda self, m: {"zero": np.zeros(len(m))},
    }
    own = dataclasses.dataclass(frozen=True, eq=False)(type("Sunk", (Reading,), members))()
    robot = pk.load("hexapod")
    q = robot.inverse(pk.sample_poses(robot, 12, seed=1))
    message = f"^kind: predict of the class Sunk failed with {said}"
    with pytest.raises(pk.ArgumentTypeError, match=message):
        pk.VirtualMachine(robot).measure(q, own)
    with pytest.raises(pk.ArgumentTypeError, match=message.split(", zero")[0]):
        pk.identify(robot, pk.Measurements(q, np.ones(12), own), "offset*")
