"""What a class of readings leaves out or states wrongly is named when it is first used."""

from __future__ import annotations

import dataclasses
import inspect
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.files.csv_writer import WrittenColumn
from pkmcal.readings import At, Height, Position, Predicted, Reading
from pkmcal.readings.registry import KINDS, as_reading, registered

from .own import Loop

ROBOT = pk.load("hexapod")
Q = ROBOT.inverse(pk.sample_poses(ROBOT, 20, seed=1))


def height(at: At) -> Predicted:
    seen = Position().predict(at)
    return Predicted(seen.values[:, 2:], seen.by_twist[:, 2:])


def made(*, fields: tuple[str, ...] = (), **members: Any) -> type[Reading]:
    """A class of readings of how high the platform is, with other members."""
    plain = {
        "name": "level",
        "components": (("level", "mm"),),
        "predict": lambda self, at, **numbers: height(at),
        "__module__": __name__,
    }
    declared = {"__annotations__": dict.fromkeys(fields, Any), **dict.fromkeys(fields)}
    of = type("Level", (Reading,), {**plain, **declared, **members})
    return dataclasses.dataclass(frozen=True, eq=False)(of)


def identified(kind: Reading, **options: Any) -> pk.Identification:
    values = ROBOT.forward(Q).pose[:, 2]
    return pk.identify(ROBOT, pk.Measurements(Q, values, kind), "offset1", **options)


def test_the_class_of_these_tests_is_whole() -> None:
    assert identified(made()()).free == ("offset1",)


@pytest.mark.parametrize(
    ("classes", "message"),
    [
        ((made(), type("Other", (made(),), {})), "the classes Level and Other have one name"),
        ((made(name=""),), "pkmcal.readings: the class Level has to state its name"),
        ((made(components=()),), "pkmcal.readings: the class Level has to state its components"),
        (
            (made(), made(name="two")),
            "kinds level and two both read the columns level",
        ),
        (
            (dataclasses.make_dataclass("Needs", ["of"], bases=(made(),), frozen=True),),
            "each field of the class Needs needs a default",
        ),
    ],
)
def test_classes_of_the_package_are_looked_at_when_it_is_imported(
    classes: tuple[type[Reading], ...], message: str
) -> None:
    with pytest.raises(TypeError, match=message):
        registered(classes)


def test_a_word_means_the_class_that_states_it() -> None:
    assert registered([made(), Height]).keys() == {"height", "level"}
    assert list(KINDS) == sorted(KINDS)


def test_a_class_of_ones_own_cannot_have_the_name_of_a_kind() -> None:
    """Its files and its verdicts would be those of the kind."""
    with pytest.raises(TypeError, match="Level has the name of a kind of pkmcal, 'position'"):
        pk.Measurements(Q, np.ones(20), made(name="position")())
    assert as_reading(Position()) is not None


@pytest.mark.parametrize(
    ("members", "message"),
    [
        ({"point": "table"}, "point of the class Level must be one of 'platform', 'base', ''"),
        ({"framed": 1}, "framed of the class Level must be such as False; found 1"),
        ({"starts_by_pose": "yes"}, "starts_by_pose of the class Level must be such as False"),
        ({"frame_order": "first"}, "frame_order of the class Level must be such as 9"),
        ({"held": "zero"}, r"held of the class Level must be such as \(\)"),
        ({"turning": "x"}, "turning of the class Level is the first of its last three components"),
        (
            {"components": (("level", "mm"), ("level", "mm"))},
            "Level has two components of one name, 'level': a file has a column for each",
        ),
        *(
            ({"components": (("level", unit),)}, "Level has to state the unit of 'level' as the")
            for unit in ("", " ", "1", "[mm]", "m\nm")
        ),
    ],
)
def test_a_member_of_another_class_is_named(members: dict[str, Any], message: str) -> None:
    with pytest.raises(TypeError, match=message):
        identified(made(**members)())


@pytest.mark.parametrize("unit", ["ratio", "%", "mm/m", "V", "1/K"])
def test_any_other_unit_is_read_back(unit: str, tmp_path: Path) -> None:
    kind = made(components=(("level", unit),), mm=lambda self, m, length: np.ones(1))()
    given = pk.Measurements(Q, np.linspace(0.0, 1.0, 20), kind, sigma=0.1)
    given.write(tmp_path / "a.csv")
    again = pk.read_measurements(tmp_path / "a.csv", ROBOT, kind=kind)
    np.testing.assert_array_equal(again.values, given.values)
    assert again.sigma is not None and (again.sigma == 0.1).all()


def test_two_columns_of_one_name_are_not_written(tmp_path: Path) -> None:
    kind = made(
        columns=lambda self, units: iter([WrittenColumn("level", "", np.arange(20.0))]),
        read=lambda self, table, units: self,
    )()
    with pytest.raises(TypeError, match="two columns would be called 'level'"):
        pk.Measurements(Q, np.ones(20), kind).write(tmp_path / "a.csv")
    assert not (tmp_path / "a.csv").exists()


def test_a_reading_in_a_frame_has_a_derivative_by_it() -> None:
    with pytest.raises(pk.ArgumentError, match=r"by_frame is missing, .* states framed = True"):
        identified(made(framed=True)(), unknown={"frame": "unknown"})


@pytest.mark.parametrize("given", [[1.0] * 19, "long", 3.0, [[1.0], [2.0, 3.0]] * 10])
def test_a_field_of_every_row_has_an_entry_for_each(given: Any) -> None:
    of = made(fields=("current",), per_row=("current",))
    with pytest.raises(pk.ArgumentError, match="current must have an entry for each of 20 rows"):
        identified(of(current=given))  # type: ignore[call-arg]


def test_a_field_of_every_row_that_no_column_states_is_not_lost_in_a_file(tmp_path: Path) -> None:
    of = made(fields=("current",), per_row=("current",))
    measured = pk.Measurements(Q, np.ones(20), of(current=np.arange(20.0)))  # type: ignore[call-arg]
    assert measured.select([3]).instrument.current.tolist() == [3.0]  # type: ignore[attr-defined]
    with pytest.raises(pk.ArgumentError, match=r"current of 'level' has .* and no column"):
        measured.write(tmp_path / "m.csv")
    assert not (tmp_path / "m.csv").exists()


@pytest.mark.parametrize(
    ("members", "message"),
    [
        (
            {"found_in": lambda self, table: None},
            r"found_in of .* Level must return list\[str\]; f",
        ),
        (
            {"found_in": lambda self, table: "level"},
            r"found_in of .* Level must return list\[str\]",
        ),
        ({"found_in": lambda self, table: table.level}, "found_in of .* Level failed with Attrib"),
        (
            {"names": lambda self, table: None},
            r"names of .* Level must return set\[str\]; found No",
        ),
        (
            {"names": lambda self, table: {1}},
            r"names of .* must return set\[str\]; found int in it",
        ),
    ],
)
def test_a_method_that_finds_no_columns_is_named(
    members: dict[str, Any], message: str, tmp_path: Path
) -> None:
    (tmp_path / "m.csv").write_text("q1 [mm],level [mm]\n1,2\n")
    with pytest.raises(pk.ArgumentTypeError, match=f"^kind: {message}"):
        pk.read_measurements(tmp_path / "m.csv", kind=made(**members)())


@pytest.mark.parametrize(
    ("worth", "message"),
    [
        (None, "must return FloatArray; found NoneType"),
        (np.ones(2), r"must be an array of shape \(1,\); found \(2,\)"),
        (np.ones((3, 1)), r"must be an array of shape \(20, 1\); found \(3, 1\)"),
        (np.zeros(1), "must be positive"),
        (np.array([np.nan]), "must be positive"),
    ],
)
def test_what_a_unit_is_worth_is_a_length_for_each_component(worth: Any, message: str) -> None:
    with pytest.raises(pk.ArgumentError, match=f"^kind: mm of the class Level {message}"):
        identified(made(mm=lambda self, m, length: worth)())


def test_a_reading_that_gives_no_number_is_named() -> None:
    def nothing(self: Any, at: At, **numbers: Any) -> Predicted:
        seen = height(at)
        return dataclasses.replace(seen, values=np.nan * seen.values)

    with pytest.raises(pk.ArgumentError, match=r"row 0 .*: predict of the class Level gives NaN"):
        identified(made(predict=nothing)())


class Failing(Loop):
    """A loop whose starts fail, whatever they are given."""

    name = "failing"

    def starts(self, machine: Any, sets: Any, found: Any) -> None:
        found["loop", "A"] = {"no": 1}["start"]


@pytest.mark.parametrize("by_pose", [True, False])
def test_starts_that_fail_for_another_reason_are_not_said_to_need_poses(by_pose: bool) -> None:
    kind = type("Failing", (Failing,), {"starts_by_pose": by_pose, "__module__": __name__})
    measured = pk.Measurements(Q, np.ones(20), kind(["A"] * 20))
    with pytest.raises(
        pk.ArgumentTypeError, match="starts of the class Failing failed with KeyErr"
    ) as said:
        pk.identify(ROBOT, measured, "offset1")
    assert "starts_by_pose" not in str(said.value)


def test_a_start_that_is_none_is_named() -> None:
    def starts(self: Any, machine: Any, sets: Any, found: Any) -> None:
        found["loop", "A"] = 3.0

    kind = type("Bare", (Failing,), {"starts": starts, "__module__": __name__})
    measured = pk.Measurements(Q, np.ones(20), kind(["A"] * 20))
    with pytest.raises(pk.ArgumentTypeError, match=r"found\[\('loop', 'A'\)\] must be a Start"):
        pk.identify(ROBOT, measured, "offset1")


METHODS = {
    name: member
    for name, member in vars(Reading).items()
    if not name.startswith("_") and (callable(member) or isinstance(member, property))
}


def with_method(name: str, method: Any) -> Reading:
    """A loop with another method, or another property."""
    like = METHODS[name]
    member = property(method) if isinstance(like, property) else method
    return type("Own", (Loop,), {"name": "own", name: member, "__module__": __name__})(["A"] * 20)


@pytest.mark.parametrize("name", METHODS)
def test_whatever_fails_in_a_class_of_ones_own_is_named_with_its_class(name: str) -> None:
    def fails(self: Any, *given: Any, **named: Any) -> Any:
        return {}["key"]

    reading = with_method(name, fails)
    with pytest.raises(
        pk.ArgumentTypeError, match=f"^kind: {name} of the class Own failed with Key"
    ):
        asked = getattr(reading, name)
        asked(*range(len(inspect.signature(METHODS[name]).parameters) - 1))


@pytest.mark.parametrize(
    "name", [n for n in METHODS if n not in ("starts", "follows_pose", "write")]
)
def test_what_a_method_returns_is_of_the_class_that_is_declared(name: str) -> None:
    reading = with_method(name, lambda self, *given, **named: 3)
    with pytest.raises(pk.ArgumentTypeError, match=f"^kind: {name} of the class Own must return "):
        asked = getattr(reading, name)
        asked(*range(len(inspect.signature(METHODS[name]).parameters) - 1))
