"""Arguments of single kinds that were replaced by instruments go on working, with a warning."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.measurements.former import OF_MEASURE, OF_MEASUREMENTS
from pkmcal.readings import (
    Angle,
    Between,
    Distance,
    Orientation,
    Reading,
    RelativeDistance,
    Tilt,
    Touch,
)

Q = np.arange(8.0).reshape(2, 4) + 400.0
NAMES, KNOWN, POST = ["A", "B"], {("A", "B"): 50.0}, [900.0, 0, 0]

GIVEN: dict[str, tuple[str, Any, dict[str, Any], Reading]] = {
    "attachment": ("distance", [1.0, 2.0], {"target": POST}, Distance([1, 2, 3])),
    "other": ("between", [1.0, 2.0], {}, Between(Q + 1)),
    "run": ("relative-distance", [1.0, 2.0], {"target": POST}, RelativeDistance(run=NAMES)),
    "touched": ("touch", None, {}, Touch(NAMES)),
    "artefact": ("touch", NAMES, {}, Touch(artefact="sphere")),
    "touch_distances": ("touch", NAMES, {}, Touch(distances=KNOWN)),
    "joint": ("angle", [0.1, 0.2], {}, Angle("limb1.joint2")),
}


def same(one: pk.Measurements, other: pk.Measurements) -> None:
    assert one.values.tobytes() == other.values.tobytes() and str(one) == str(other)
    for each in dataclasses.fields(one.instrument):
        a, b = (getattr(m.instrument, each.name) for m in (one, other))
        assert np.array_equal(a, b), each.name


@pytest.mark.parametrize("name", OF_MEASUREMENTS)
def test_former_arguments_of_measurements_are_those_of_the_instrument(name: str) -> None:
    kind, values, beside, instrument = GIVEN[name]
    given = getattr(instrument, OF_MEASUREMENTS[name])
    new = pk.Measurements(Q, values, instrument, **beside)
    with pytest.warns(DeprecationWarning, match=rf"{name}=….* is now kind=pkmcal.readings"):
        former = pk.Measurements(Q, values, kind, **beside, **{name: given})  # type: ignore[arg-type]
    same(former, new)
    with pytest.warns(DeprecationWarning):
        changed = dataclasses.replace(new, **{name: given})
    same(changed, new)
    kept = getattr(new, name)
    assert np.array_equal(kept, getattr(new.instrument, OF_MEASUREMENTS[name]))


MACHINE = {"angle": "agile-eye"}
SIMULATED: dict[str, tuple[str, Any, Reading]] = {
    "attachment": ("distance", POST, Distance([1, 2, 3])),
    "other": ("between", None, Between([[880.0] * 6, [881.0] * 6])),
    "run": ("relative-distance", POST, RelativeDistance(run=NAMES)),
    "joint": ("angle", None, Angle("limb1.joint2")),
    "mounting": ("tilt", None, Tilt([0.1, 0.2, 0.3])),
}


@pytest.mark.parametrize("name", SIMULATED)
def test_former_arguments_of_measure_are_those_of_the_instrument(name: str) -> None:
    kind, target, instrument = SIMULATED[name]
    robot = pk.load(MACHINE.get(kind, "hexapod"))
    q = np.repeat(robot.inverse(robot.home)[None], 2, axis=0)
    given = getattr(instrument, OF_MEASURE[name])
    new = pk.VirtualMachine(robot, 0.01, 3).measure(q, instrument, target)
    with pytest.warns(DeprecationWarning, match=rf"{name}=….* is now kind=pkmcal.readings"):
        former = pk.VirtualMachine(robot, 0.01, 3).measure(
            q,
            kind,  # type: ignore[arg-type]
            target,
            **{name: given},
        )
    same(former, new)


def test_former_arguments_of_simulated_touches_go_together() -> None:
    robot = pk.load("hexapod")
    q = np.repeat(robot.inverse(robot.home)[None], 2, axis=0)
    places = {"A": [0, 0, 900, 10], "B": [5, 0, 900, 11]}
    new = pk.VirtualMachine(robot, 0.01, 3).measure(q, Touch(NAMES, "sphere", places=places))
    with pytest.warns(DeprecationWarning, match="touches=…"):
        former = pk.VirtualMachine(robot, 0.01, 3).measure(
            q, "touch", touches=NAMES, touched=places, artefact="sphere"
        )
    same(former, new)


@pytest.mark.parametrize("name", ["mounting", "artefact", "touched"])
def test_what_another_kind_has_is_refused_by_name(name: str) -> None:
    robot = pk.load("hexapod")
    with pytest.raises(pk.ArgumentError, match=f"^{name}: goes with values of kind"):
        pk.VirtualMachine(robot, 0.01, 3).measure(robot.inverse(robot.home), **{name: "line"})


def test_arguments_that_never_were_are_refused_by_name() -> None:
    with pytest.raises(TypeError, match="'tempratures'; did you mean 'temperature'"):
        pk.Measurements(Q, [1.0, 2.0], "height", tempratures=20.0)
    with pytest.raises(TypeError, match=r"unexpected argument 'runs'$"):  # not a former one
        pk.Measurements(Q, [1.0, 2.0], "height", runs=NAMES)
    with pytest.raises(TypeError, match=r"measure.*unexpected argument 'group'"):
        pk.VirtualMachine(pk.load("hexapod")).measure(np.full(6, 880.0), group=[1])


def test_an_instrument_of_the_caller_is_not_changed() -> None:
    mine = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
    instrument = Distance(mine)
    m = pk.Measurements(Q, [1.0, 2.0], instrument, target=POST)
    mine[0] = 0.0
    assert m.attachments[0].tolist() == [1.0, 2.0, 3.0] and instrument.attachment is mine
    assert Orientation().mounting == (0.0, 0.0, 0.0)
