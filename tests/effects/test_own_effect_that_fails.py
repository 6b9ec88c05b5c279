"""What fails in an effect of one's own, or is left out of it, is named."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.effects.effect import Changed, Moved
from pkmcal.readings import Dependence, Start, always
from pkmcal.readings.unknowns import Nature, Numbers

from .test_own_effect import START, TARGET, Sinking

ROBOT = pk.load("hexapod")
Q = ROBOT.inverse(pk.sample_poses(ROBOT, 20, seed=2))
MEASURED = pk.Measurements(Q, ROBOT.forward(Q).pose[:, :3], target=TARGET)


def refused(effect: Any, **options: Any) -> str:
    with pytest.raises(pk.ArgumentError) as said:
        pk.identify(ROBOT, MEASURED, "offset1", effects=[effect], **options)
    return str(said.value)


def with_method(name: str, method: Callable[..., Any]) -> Any:
    return type("Bad", (Sinking,), {name: method, "__module__": __name__})()


def _fails(*given: Any) -> Any:
    return {}["current"]


@pytest.mark.parametrize("fix", [None, "sink.rate"], ids=["free", "held"])
@pytest.mark.parametrize("name", ["of_rows", "dependences", "moved"])
def test_a_method_that_fails_is_named(name: str, fix: str | None) -> None:
    start = "Bad: " if name == "dependences" else "effects: "
    said = refused(with_method(name, _fails), fix=fix or ())
    assert said.startswith(start) and f"{name}" in said and "KeyError: 'current'" in said
    if name == "moved":
        assert "numbers (by name: target, sink) and has to return Moved(twist, by)" in said


def _unlocked(measured: Any) -> None:
    measured.values.setflags(write=True)
    measured.values[0] = 9.0


@pytest.mark.parametrize(
    "alter",
    [
        _unlocked,
        lambda measured: object.__setattr__(measured, "values", measured.values + 1.0),
        lambda measured: vars(measured).update(values=None),
    ],
    ids=["in place", "another array", "none"],
)
def test_an_effect_that_alters_what_was_measured_is_refused(alter: Callable[[Any], None]) -> None:
    def of_rows(self: Any, measured: Any) -> Any:
        alter(measured)
        return self

    before = MEASURED.values.copy()
    said = refused(with_method("of_rows", of_rows))
    assert said.startswith("effects: of_rows of Bad alters values of the measurements")
    np.testing.assert_array_equal(MEASURED.values, before)


def test_a_generator_that_fails_on_its_way_is_named() -> None:
    def dependences(self: Any, measured: Any) -> Any:
        yield from Sinking().dependences(measured)
        raise IndexError("late")

    said = refused(with_method("dependences", dependences))
    assert said == "Bad: dependences failed with IndexError: late"


def test_a_derivative_that_an_effect_forgot_is_not_that_of_the_reading() -> None:
    def moved(self: Any, machine: Any, pose: Any, q: Any, rows: Any, numbers: Any) -> Moved:
        return Moved(np.zeros((len(rows), 6)))

    said = refused(with_method("moved", moved))
    assert said.startswith("effects: 'sink' is estimated, but moved of 'sinking' gives no deriv")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"by": None}, "by must have the derivative by each argument by its name"),
        ({"by": {"sink": np.zeros((20, 6, 2))}}, "moved of 'sinking': by['sink'] must be an array"),
        ({"by": {"sink": np.zeros((20, 6))}}, "by['sink'] must be an array of shape (20, 6, 1)"),
        ({"growth": np.zeros(19)}, "growth must be an array of shape (20,)"),
        ({"growth": np.zeros(20), "growth_by": {"sink": np.zeros(20)}}, "growth_by['sink'] must"),
        ({"growth": np.zeros(20), "growth_by": 3}, "growth_by must have the derivative"),
    ],
)
def test_what_moved_returns_in_another_shape_is_named(
    changes: dict[str, Any], message: str
) -> None:
    def moved(self: Any, *given: Any) -> Moved:
        return Sinking().moved(*given)._replace(**changes)

    said = refused(with_method("moved", moved))
    assert said.startswith("effects: ") and message in said


def test_an_effect_that_gives_no_number_is_named() -> None:
    def moved(self: Any, *given: Any) -> Moved:
        found = Sinking().moved(*given)
        return found._replace(twist=np.nan * found.twist)

    assert refused(with_method("moved", moved)).endswith("moved of sinking gives NaN")


CHANGED: dict[str, tuple[Any, str]] = {
    "machine": (Changed("soft", 3, {}), "Changed of 'soft': machine must be a Robot or SerialArm"),
    "free": (Changed("soft", ROBOT, "offset1"), "free must be deviations of numbers by their"),  # type: ignore[arg-type]
    "name": (Changed("soft", ROBOT, {"spring": 1.0}), "free names 'spring', and the machine has"),
    "negative": (Changed("soft", ROBOT, {"offset1": -1.0}), "deviation of offset1 must be above 0"),
    "word": (Changed("soft", ROBOT, {"offset1": "big"}), "deviation of offset1 must be above 0"),  # type: ignore[dict-item]
    "no name": (Changed(None, ROBOT, {}), "name of Changed must be a word, found None"),  # type: ignore[arg-type]
}


@pytest.mark.parametrize("wrong", CHANGED)
def test_a_changed_machine_is_a_machine_with_numbers_of_its_own(wrong: str) -> None:
    returned, message = CHANGED[wrong]
    stated = type("Soft", (), {"of_machine": lambda self, machine: returned})()
    said = refused(stated)
    assert said.startswith("effects: ") and message in said


def test_of_machine_that_fails_is_named() -> None:
    said = refused(type("Soft", (), {"of_machine": _fails, "__module__": __name__})())
    assert said.startswith("effects: of_machine of Soft failed with KeyError: 'current'")


NUMBERS = (("rate", "mm"),)
NAMES = [""] * 20
STARTS = {("sink", ""): Start((0,), np.array([START]))}


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"numbers": ("rate", "mm")}, "sink: numbers must be names with units"),
        ({"numbers": ("rate",)}, "sink: numbers must be names with units"),
        ({"names": None}, "sink: names must be a sequence with one for each row"),
        ({"names": "abc"}, "sink: names must be a sequence with one for each row"),
        ({"names": [""] * 19}, "the dependence on it has 19 names"),
        ({"scale": [1.0, 2.0]}, "sink: scale must have one number for each of 1"),
        ({"scale": 1.0}, "sink: scale must have one number for each of 1"),
        ({"starts": {}}, "the search for sink '' has no start"),
    ],
)
def test_what_always_is_given_in_another_form_is_named(given: dict[str, Any], message: str) -> None:
    whole = {"numbers": NUMBERS, "names": NAMES, "starts": STARTS, **given}

    def dependences(self: Any, measured: Any) -> Any:
        yield always("sink", "sink", **whole)

    assert message in refused(with_method("dependences", dependences))


def test_numbers_and_dependences_have_as_many_entries_as_they_state() -> None:
    one = Numbers(("sink.rate",), ("mm",), np.array([0]), np.array([0.0]))
    for changes in ({"units": ()}, {"start": np.zeros(2)}, {"scale": np.ones(3)}):
        with pytest.raises(pk.ArgumentError, match=r"^Numbers: as many of each are needed; found"):
            dataclasses.replace(one, **changes)
    with pytest.raises(pk.ArgumentError, match=r"sink: given numbers must have shape \(N, w\)"):
        Dependence("sink", "sink", np.zeros(20), {"": one}, np.zeros(20, dtype=np.intp))


ONE = Numbers(("sink.rate",), ("mm",), np.array([0]), np.array([0.0]))
NONE_OF_TOOL = "the role 'tool' is that of poses on the platform, whose nature is Nature("


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"role": "frame"}, "the role 'frame' is that of the frames of instruments; give 'sink'"),
        ({"role": "residual"}, "the role 'residual' is that of numbers that residuals bring"),
        ({"role": "tool"}, NONE_OF_TOOL),
        ({"argument": "sink_origin"}, "an argument cannot be called 'sink_origin'"),
        ({"nature": Nature("table")}, "body of its nature must be 'platform' or 'base' or ''"),
        ({"nature": Nature("base", pose=True)}, "body of its nature must be 'platform'; found"),
        ({"nature": Nature("platform")}, "sink: a point of the platform has 3 numbers"),
        ({"nature": Nature("platform", pose=True)}, "sink: a pose of the platform has 6 numbers"),
        ({"nature": "platform"}, "sink: nature must be a Nature(…); found str"),
        ({"argument": "at"}, "an argument cannot be called 'at'"),
        ({"index": np.full(20, 1)}, "sink: index says which of 1 numbers each row has"),
        ({"index": np.full(20, -1)}, "from 0 to 0; found -1 in row 0"),
        ({"index": np.zeros(20)}, "sink: index must be whole numbers"),
        ({"role": None}, "Dependence: role must be a word; found None"),
        ({"estimated": None}, "sink: estimated must have Numbers(…) by the names"),
        ({"estimated": {"": 3}}, "sink: estimated must have Numbers(…) by the names"),
        ({"given": [["a"]] * 20}, "sink: given must be numbers"),
        ({"given": [[1.0], [1.0, 2.0]]}, "sink: given must be an array"),
        ({"given": np.zeros((20, 0))}, "numbers '' have slots [0], and the argument 0 numbers"),
    ],
)
def test_dependences_that_mean_something_else_are_refused(
    given: dict[str, Any], message: str
) -> None:
    """A number of the role of frames was not estimated, without a word."""
    whole = {
        "argument": "sink",
        "role": "sink",
        "given": np.zeros((20, 1)),
        "estimated": {"": ONE},
        "index": np.zeros(20, dtype=np.intp),
    }

    def dependences(self: Any, measured: Any) -> Any:
        yield Dependence(**{**whole, **given})

    assert message in refused(with_method("dependences", dependences))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"slots": np.array([-1])}, "slots must be different numbers from 0; found [-1]"),
        ({"slots": ["a"]}, "slots must be whole numbers"),
        ({"start": ["here"]}, "start must be numbers"),
        ({"scale": np.zeros(1)}, "scale must be positive; found [0.0]"),
        ({"scale": [np.nan]}, "scale must be positive"),
        ({"spread": np.array([[-1.0]])}, "spread must be the covariance (1, 1)"),
        ({"spread": np.ones(1)}, "spread must be the covariance (1, 1)"),
        ({"units": (None,)}, "units must be words; found (None,)"),
    ],
)
def test_numbers_that_cannot_be_estimated_are_refused(
    changes: dict[str, Any], message: str
) -> None:
    with pytest.raises(pk.ArgumentError) as said:
        dataclasses.replace(ONE, **changes)
    assert str(said.value).startswith("Numbers ") and message in str(said.value)


def test_numbers_in_lists_are_those_of_arrays() -> None:
    listed = Numbers(("sink.rate",), ("mm",), [0], [0.0], [1.0])  # type: ignore[arg-type]
    assert [each.dtype for each in (listed.slots, listed.start)] == [np.intp, np.float64]


def test_numbers_that_moved_is_given_cannot_be_written() -> None:
    """What it wrote was what the machine of the next session was given."""

    def moved(self: Any, machine: Any, pose: Any, q: Any, rows: Any, numbers: Any) -> Moved:
        rate = numbers["sink"]
        rate *= 0.5
        return Sinking().moved(machine, pose, q, rows, numbers)

    said = refused(with_method("moved", moved))
    assert said.startswith("effects: moved of Bad failed with ValueError: output array is read-onl")
