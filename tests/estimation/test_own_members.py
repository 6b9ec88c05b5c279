"""What members of a class of a user's own state is compared with what it predicts, or refused."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, make_dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.arrays import FloatArray
from pkmcal.effects.effect import Moved
from pkmcal.files.csv_writer import WrittenColumn
from pkmcal.readings import At, Between, Position, Predicted, Reading, Start, always
from pkmcal.readings.unknowns import Dependence

ROBOT = pk.load("hexapod")
TRUE = ROBOT.replace({"offset1": 0.4, "offset4": -0.3})
Q = ROBOT.inverse(pk.sample_poses(ROBOT, 24, seed=1))
PLACES = TRUE.forward(Q).pose[:, :3]


@dataclass(frozen=True, eq=False)
class Up(Reading):
    """Height of the platform."""

    name = "up"
    components = (("up", "mm"),)

    def predict(self, at: At, **numbers: Any) -> Predicted:
        """As `Position` predicts it."""
        seen = Position().predict(at)
        return Predicted(seen.values[:, 2:], seen.by_twist[:, 2:])


def with_members(**members: Any) -> Reading:
    made: Any = dataclass(frozen=True, eq=False)(type("Mine", (Up,), {**members, "name": "mine"}))
    found: Reading = made()
    return found


def identified(kind: Reading) -> pk.Identification:
    return pk.identify(ROBOT, pk.Measurements(Q, PLACES[:, 2], kind, sigma=0.01), "offset*")


def predicting(change: Callable[[Predicted], Predicted]) -> Any:
    return lambda self, at, **numbers: change(Up().predict(at))


def _lost(found: Predicted) -> Predicted:
    by = found.by_twist.copy()
    by[3] = np.nan
    return replace(found, by_twist=by)


def _of_machine(self: Any, at: At, **numbers: Any) -> Predicted:
    """It reads the machine's first offset beside, and does not say so."""
    found = Up().predict(at)
    values = found.values.copy()
    assert at.machines is not None
    for machine, rows in at.machines():
        values[rows] += machine.geometry.values[machine.geometry.names.index("offset1")]
    return replace(found, values=values)


WRONG: dict[str, tuple[dict[str, Any], str]] = {
    "NaN in a row": ({"predict": predicting(_lost)}, "in row 3 it states nan of up, where the val"),
    "complex": (
        {"predict": predicting(lambda p: replace(p, values=p.values + 0j))},
        "values must be doubles; found complex128",
    ),
    "masked": (
        {"predict": predicting(lambda p: replace(p, values=np.ma.masked_array(p.values)))},
        "values must be an array of shape (24, 1); found MaskedArray",
    ),
    "by_frame": (
        {"predict": predicting(lambda p: replace(p, by_frame=p.by_twist))},
        "by_frame is given where `at` has no frame",
    ),
    "by_other": (
        {"predict": predicting(lambda p: replace(p, by_other=p.by_twist))},
        "by_other is given where `at` has no other",
    ),
    "by_difference": (
        {"by_difference": lambda self, derivative, residual: -derivative},
        "by_difference or difference of 'mine': by v z: in row",
    ),
    "difference": (
        {
            "difference": lambda self, values, predicted: predicted - values.reshape(-1, 1),
            "corrected": lambda self, predicted, residual: predicted - residual,
        },
        "by_twist, by v z: in row",
    ),
    "corrected": (
        {"corrected": lambda self, predicted, residual: predicted - residual},
        "corrected of 'mine' is not the inverse of its difference",
    ),
    "by_geometry": (
        {"by_geometry": lambda self, at, places: np.ones((len(at.pose), 1, len(places)))},
        "by_geometry of 'mine': by offset1, times its scale: in row",
    ),
    "by_geometry forgotten": (
        {"predict": _of_machine},
        "by_geometry of 'mine': None, by all numbers of the geometry together: in row",
    ),
    "shape of by_geometry": (
        {"by_geometry": lambda self, at, places: np.ones((3, 3))},
        "by_geometry of 'mine' must be an array of shape (24, 1, 6); found (3, 3)",
    ),
    "arcs": ({"arcs": lambda self, m, length: np.ones(3)}, "arcs of the class Mine must be an arr"),
    "arcs below 0": (
        {"arcs": lambda self, m, length: -np.ones(1)},
        "arcs of the class Mine must b",
    ),
    "lots": ({"lots": lambda self, m: np.zeros(3, int)}, "lots of the class Mine must be an array"),
    "subject": ({"subject": lambda self, n: np.zeros(3, int)}, "subject of the class Mine must be"),
    "property": ({"families": lambda self: ()}, "families of the class Mine must be a property"),
    "method": ({"mm": np.ones(1)}, "mm of the class Mine must be a method"),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_a_member_that_is_wrong_is_named(wrong: str) -> None:
    members, message = WRONG[wrong]
    with pytest.raises(pk.ArgumentError) as said:
        identified(with_members(**members))
    assert str(said.value).startswith("kind: ") and message in str(said.value)


def test_a_derivative_by_the_geometry_that_is_right_is_taken() -> None:
    """The offset that it reads beside is found with its own derivative."""

    def by_geometry(self: Any, at: At, places: Any) -> FloatArray:
        names = ROBOT.geometry.names
        found = np.zeros((len(at.pose), 1, len(places)))
        found[:, 0, [names[i] for i in places.tolist()].index("offset1")] = 1.0
        return found

    kind = with_members(predict=_of_machine, by_geometry=by_geometry)
    measured = pk.Measurements(Q, PLACES[:, 2] + 0.4, kind, sigma=0.01)
    found = pk.identify(ROBOT, measured, "offset*")
    np.testing.assert_allclose(found.values, [0.4, 0, 0, -0.3, 0, 0], atol=1e-6)


@pytest.mark.parametrize(
    "laid", [(np.zeros(6),), (np.zeros(3), {}), (np.zeros(6), [1])], ids=["one", "short", "list"]
)
def test_a_frame_of_another_form_is_named(laid: Any) -> None:
    def predict(self: Any, at: At, **numbers: Any) -> Predicted:
        seen = Position().predict(at)
        by = None if seen.by_frame is None else seen.by_frame[:, 2:]
        return Predicted(seen.values[:, 2:], seen.by_twist[:, 2:], by_frame=by)

    kind = with_members(framed=True, predict=predict, frame=lambda self, seen: laid)
    measured = pk.Measurements(Q, PLACES[:, 2], kind, sigma=0.01)
    with pytest.raises(pk.ArgumentError, match=r"^kind: frame of the class Mine"):
        pk.identify(ROBOT, measured, "offset*", unknown="frame")


@pytest.mark.parametrize("name", ["points", "names", "columns", "select", "other", "distances"])
def test_a_field_that_is_called_as_something_else_is_refused(name: str) -> None:
    made = make_dataclass("Mine", [(name, Any, None)], bases=(Up,), frozen=True, eq=False)
    with pytest.raises(pk.ArgumentError, match=f"a field of the class Mine is called '{name}'"):
        pk.Measurements(Q, PLACES[:, 2], made(), sigma=0.01)


def test_a_field_of_a_class_of_the_package_keeps_its_meaning() -> None:
    @dataclass(frozen=True, eq=False)
    class Mine(Between):
        name = "mine"
        components = (("apart", "mm"),)

    there = np.roll(Q, 1, axis=0)
    apart = np.linalg.norm(PLACES - np.roll(PLACES, 1, axis=0), axis=1)
    measured = pk.Measurements(Q, apart, Mine(other=there), sigma=0.01)
    assert pk.identify(ROBOT, measured, ["offset1", "offset4"]).verdict.state == "calibrated"


@dataclass(frozen=True)
class Growing:
    """Places on the platform grow with the carried mass; the derivative is so many times it."""

    factor: float | None
    mass: Any = None
    name: str = "growing"

    def dependences(self, measured: Any) -> Iterator[Dependence]:
        """One coefficient, in ppm."""
        starts = {("grow", ""): Start((0,), np.zeros(1))}
        yield always("soft", "grow", (("rate", "ppm"),), [""] * len(measured), starts, [1000.0])

    def of_rows(self, measured: Any) -> Growing:
        """By the carried mass."""
        return replace(self, mass=measured.load[:, 0])

    def moved(self, machine: Any, pose: Any, q: Any, rows: Any, numbers: Any) -> Moved:
        """Growth alone."""
        rate, still = self.mass[rows] * 1e-6, np.zeros((len(rows), 6, 1))
        by = {} if self.factor is None else {"soft": self.factor * rate[:, None]}
        return Moved(still[:, :, 0], {"soft": still}, rate * numbers["soft"][rows, 0], by)


@pytest.mark.parametrize("factor", [1.0, 0.5, -1.0, None])
def test_the_derivative_of_growth_is_compared_with_the_growth(factor: float | None) -> None:
    """A wrong factor gave a wrong standard deviation, without a word."""
    target, load = np.array([200.0, 100, 50]), np.zeros((24, 10))
    load[:, 0] = np.linspace(0.0, 20.0, 24)
    motion = pk.screw.from_pose(TRUE.forward(Q).pose)
    grown = target * (1.0 + load[:, :1] * 20e-6)
    places = np.einsum("nij,nj->ni", motion[:, :3, :3], grown) + motion[:, :3, 3]
    measured = pk.Measurements(Q, places, sigma=0.001, target=target, load=load)
    if factor == 1.0:
        found = pk.identify(ROBOT, measured, "offset*", effects=[Growing(factor)])
        assert found.values[-1] == pytest.approx(20.0, abs=1e-4)
        return
    with pytest.raises(pk.ArgumentError, match=r"growth_by\['soft'\], by number 0: in row 23"):
        pk.identify(ROBOT, measured, "offset*", effects=[Growing(factor)])


def test_a_derivative_of_an_effect_that_is_lost_in_a_row_is_named() -> None:
    class Lost(Growing):
        def moved(self, *given: Any) -> Moved:
            found = super().moved(*given)
            by = found.by["soft"].copy()
            by[3] = np.nan
            return found._replace(by={"soft": by})

        def of_rows(self, measured: Any) -> Growing:
            return Lost(1.0, measured.load[:, 0])

    measured = pk.Measurements(Q, PLACES, sigma=0.01, load=np.ones((24, 10)))
    with pytest.raises(pk.ArgumentError, match=r"moved of Lost: by\['soft'\].* in row 3 it states"):
        pk.identify(ROBOT, measured, "offset*", effects=[Lost(1.0)])


def _refused(call: Callable[[], object]) -> str:
    with pytest.raises(pk.ArgumentError) as said:
        call()
    return str(said.value)


def _fails(*given: Any, **named: Any) -> Any:
    raise RuntimeError("sensor off")


def _misses_its_file(*given: Any, **named: Any) -> Any:
    with open("/no/such/table") as file:
        return file.read()


class Called:
    """An object that is called, in the place of a method."""

    def __init__(self, call: Callable[..., Any]) -> None:
        self.call = call

    def __call__(self, at: At, **numbers: Any) -> Any:
        return self.call(at, **numbers)


FORMS: dict[str, Callable[[Callable[..., Any]], Any]] = {
    "static": staticmethod,
    "class": lambda call: classmethod(lambda cls, at, **numbers: call(at, **numbers)),
    "object": Called,
    "partial": lambda call: partial(call),
}


@pytest.mark.parametrize("form", FORMS)
def test_predict_in_any_form_is_named_where_it_fails(form: str) -> None:
    fails = with_members(predict=FORMS[form](_fails))
    said = _refused(lambda: identified(fails))
    assert said.startswith("kind: predict of the class Mine failed with RuntimeError: sensor off")
    works = with_members(predict=FORMS[form](lambda at, **numbers: Up().predict(at)))
    np.testing.assert_array_equal(identified(works).values, identified(with_members()).values)


def test_a_file_that_a_member_or_a_residual_misses_is_an_error_of_that() -> None:
    said = _refused(lambda: identified(with_members(predict=_misses_its_file)))
    assert said.startswith("kind: predict of the class Mine failed with FileNotFoundError: [Errno")
    measured = pk.Measurements(Q, PLACES)
    said = _refused(lambda: pk.identify(ROBOT, measured, "offset*", residuals=[_misses_its_file]))
    assert said.startswith("residuals: _misses_its_file failed with FileNotFoundError: [Errno")


def _short(*given: Any) -> Iterator[WrittenColumn]:
    yield WrittenColumn("short", "", np.zeros(3))


@pytest.mark.parametrize("method", ["columns", "value_columns"])
def test_a_column_without_a_cell_for_each_row_is_named(method: str, tmp_path: Path) -> None:
    measured = pk.Measurements(Q, PLACES[:, 2], with_members(**{method: _short}))
    for call in (lambda: measured.write(tmp_path / "m.csv"), lambda: str(measured)):
        assert _refused(call) == (
            "kind: the class Mine writes the column 'short' with shape (3,): one cell for each of"
            " 24 rows is needed"
        )
    assert not list(tmp_path.iterdir())


def test_differences_of_large_values_are_rounded_as_these_are() -> None:
    """A scale that counts from far away: its last bit is no error of a derivative."""
    far = 2e11  # mm, of which the last bit is 3e-5 mm

    def predict(self: Any, at: At, **numbers: Any) -> Predicted:
        seen = Up().predict(at)
        return replace(seen, values=seen.values + far)

    kind = with_members(predict=predict)
    found = pk.identify(ROBOT, pk.Measurements(Q, PLACES[:, 2] + far, kind, sigma=0.01), "offset*")
    near = identified(with_members())
    np.testing.assert_allclose(found.values, near.values, atol=1e-4)

    def wrong(self: Any, at: At, **numbers: Any) -> Predicted:
        seen = predict(self, at)
        return replace(seen, by_twist=100.0 * seen.by_twist)

    measured = pk.Measurements(Q, PLACES[:, 2] + far, with_members(predict=wrong), sigma=0.01)
    assert "the derivative is wrong" in _refused(lambda: pk.identify(ROBOT, measured, "offset*"))
