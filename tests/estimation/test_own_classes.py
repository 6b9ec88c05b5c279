"""What a class of a user's own says of itself is compared with what it predicts."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.arrays import FloatArray
from pkmcal.effects.effect import Moved
from pkmcal.readings import At, Predicted, Reading, Start, always
from pkmcal.readings.unknowns import Dependence

from ..effects.test_own_effect import RATE, Sinking, points
from ..readings.own import Loop

ROBOT = pk.load("hexapod")
Q = ROBOT.inverse(pk.sample_poses(ROBOT, 30, seed=1))
NAMES = ["A", "B"] * 15
Change = Callable[[Predicted], Predicted]

WRONG: dict[str, tuple[str, Change]] = {
    "sign": ("by_twist, by omega x", lambda p: replace(p, by_twist=-p.by_twist)),
    "turning forgotten": (
        "by_twist, by omega x",
        lambda p: replace(p, by_twist=p.by_twist * [0, 0, 0, 1, 1, 1]),
    ),
    "shift forgotten": (
        "by_twist, by v x",
        lambda p: replace(p, by_twist=p.by_twist * [1, 1, 1, 0, 0, 0]),
    ),
    "1 percent": ("by_twist, by omega x", lambda p: replace(p, by_twist=1.01 * p.by_twist)),
    "argument": (
        r"by\['zero'\], by number 0",
        lambda p: replace(p, by={**p.by, "zero": 0.0 * p.by["zero"]}),
    ),
}


def identified(kind: Reading, measured: pk.Measurements, **options: Any) -> pk.Identification:
    return pk.identify(ROBOT, replace(measured, kind=kind), "offset*", **options)


@pytest.fixture(scope="module")
def loops() -> pk.Measurements:
    """Of a machine with errors."""
    true = ROBOT.replace({"offset1": 0.4, "offset4": -0.3})
    return pk.VirtualMachine(true, noise=0.01, seed=0).measure(Q, Loop(NAMES), [30.0, 0, 50])


@pytest.mark.parametrize("wrong", WRONG)
def test_a_derivative_of_a_reading_that_its_values_contradict_is_refused(
    wrong: str, loops: pk.Measurements
) -> None:
    message, change = WRONG[wrong]

    class Bad(Loop):
        def predict(self, at: At, **numbers: Any) -> Predicted:  # type: ignore[override]
            return change(super().predict(at, **numbers))

    with pytest.raises(pk.ArgumentError, match=f"predict of 'loop': {message}: in row"):
        identified(Bad(NAMES), loops)


def test_a_kink_is_no_wrong_derivative() -> None:
    """A gauge that reads how far a point is from a plane on either side of it."""

    @dataclass(frozen=True, eq=False)
    class Away(Reading):
        name = "away"
        components = (("away", "mm"),)

        def predict(self, at: At, **numbers: Any) -> Predicted:
            seen = pk.readings.Position().predict(at)
            side = np.where(seen.values[:, :1] < 0.0, -1.0, 1.0)
            return Predicted(side * seen.values[:, :1], side[:, None] * seen.by_twist[:, :1])

    poses = pk.sample_poses(ROBOT, 30, seed=1)
    poses[:10, 0] = np.linspace(-5e-4, 5e-4, 10)
    measured = pk.VirtualMachine(ROBOT, noise=0.01, seed=1).measure(ROBOT.inverse(poses), Away())
    assert pk.identify(ROBOT, measured, "offset*").converged


def test_an_argument_that_predict_does_not_take_is_named(loops: pk.Measurements) -> None:
    """Instead of its default, silently."""

    class Typed(Loop):
        def arguments(self, m: Any) -> dict[str, Any]:
            return {"Target": m.targets}

    with pytest.raises(pk.ArgumentError, match="'Target' is no argument of predict, which ignor"):
        pk.VirtualMachine(ROBOT).measure(Q, Typed(NAMES), [30.0, 0, 50])

    class Depends(Loop):
        def dependences(self, data: Any) -> Iterator[Dependence]:
            for each in super().dependences(data):
                yield replace(each, argument="Target") if each.argument == "target" else each

    with pytest.raises(pk.ArgumentError, match="dependences of 'loop': 'Target' is no argument"):
        identified(Depends(NAMES), loops)


class Leaning(Sinking):
    """It sinks in proportion to a current of every row."""

    current: FloatArray | None = None

    def of_rows(self, measured: pk.Measurements) -> Any:
        return self if self.current is not None else OfRows(measured.beside["current"])

    def moved(self, machine: Any, pose: Any, actuators: Any, rows: Any, numbers: Any) -> Moved:
        assert self.current is not None
        return OfRows(self.current).moved(machine, pose, actuators, rows, numbers)


class OfRows:
    """It in some rows."""

    def __init__(self, current: FloatArray) -> None:
        self.current = current

    def moved(self, machine: Any, pose: Any, actuators: Any, rows: Any, numbers: Any) -> Moved:
        by = np.zeros((len(rows), 6, 1))
        by[:, 5, 0] = -self.current[rows]
        return Moved(by[:, :, 0] * numbers["sink"][rows], {"sink": by})


@pytest.fixture(scope="module")
def sunk() -> pk.Measurements:
    """Positions of a platform that sinks by a current, which stands beside them."""
    random = np.random.default_rng(4)
    current = random.uniform(0.0, 2.0, len(Q))
    seen = points(ROBOT, Q, 0.0) - RATE * current[:, None] * [0, 0, 1]
    seen += random.normal(0.0, 0.01, seen.shape)
    return pk.Measurements(
        Q, seen, target=[40.0, -25.0, 30.0], sigma=0.01, beside={"current": current}
    )


@pytest.mark.parametrize("options", [{}, {"holdout": 0.25}, {"drop": (3, 7)}])
def test_numbers_of_rows_follow_them(options: dict[str, Any], sunk: pk.Measurements) -> None:
    """Through files, rows that are held out or left out, and several sets."""
    found = pk.identify(ROBOT, sunk, "offset*", effects=[Leaning()], **options)
    assert abs(found.values[-1] - RATE) < 4 * found.stderr[-1] < 0.1
    halves = [sunk.select(slice(12)), sunk.select(slice(12, None))]
    if not options:
        again = pk.identify(ROBOT, halves, "offset*", effects=[Leaning()])
        np.testing.assert_allclose(again.values, found.values, atol=1e-9)


@pytest.mark.parametrize("options", [{}, {"holdout": 0.25}, {"drop": (3, 7)}])
def test_an_effect_with_numbers_of_rows_of_its_own_is_refused(
    options: dict[str, Any], sunk: pk.Measurements
) -> None:
    """It would take those of other rows as soon as one is left out."""
    held = Leaning()
    object.__setattr__(held, "current", sunk.beside["current"])
    with pytest.raises(pk.ArgumentError, match=r"^Leaning: row .* beside="):
        pk.identify(ROBOT, sunk, "offset*", effects=[held], **options)


def test_a_derivative_of_an_effect_that_its_motion_contradicts_is_refused(
    sunk: pk.Measurements,
) -> None:
    class Bad(Leaning):
        def of_rows(self, measured: pk.Measurements) -> Any:
            return Doubled(measured.beside["current"])

    class Doubled(OfRows):
        def moved(self, *given: Any) -> Moved:
            found = super().moved(*given)
            return found._replace(by={"sink": 2.0 * found.by["sink"]})

    with pytest.raises(pk.ArgumentError, match=r"moved of Doubled: by\['sink'\], by number 0: in"):
        pk.identify(ROBOT, sunk, "offset*", effects=[Bad()])


def renamed(name: str, unit: str = "mm") -> type[Reading]:
    """A kind with a component of this name."""

    class Own(Reading):
        components = ((name, unit),)

        def predict(self, at: At, **numbers: Any) -> Predicted:
            seen = pk.readings.Position().predict(at)
            return Predicted(seen.values[:, :1], seen.by_twist[:, :1])

    Own.name = "own"
    return dataclass(frozen=True, eq=False)(Own)


@pytest.mark.parametrize(("name", "unit"), [("z", "mm"), ("alpha", "rad"), ("x", "mm")])
def test_components_named_as_others_are_read_back_by_their_kind(
    name: str, unit: str, tmp_path: Path
) -> None:
    """Nothing is written that would be read as another kind where `kind=` is not stated."""
    kind, path = renamed(name, unit), tmp_path / "m.csv"
    measured = pk.VirtualMachine(ROBOT, noise=0.01, seed=1).measure(Q, kind())
    with pytest.raises(pk.ArgumentTypeError, match=f"both read the columns {name}"):
        measured.write(path)
    replace(measured, instrument=renamed("off", unit)()).write(path)
    path.write_text(path.read_text().replace("off", name))
    again = pk.read_measurements(path, ROBOT, kind=kind())
    assert again.kind == "own" and again.notes == ()
    np.testing.assert_array_equal(again.values, measured.values)


@pytest.mark.parametrize("name", ["load", "height", "limb1", "SIGMA.x"])
def test_components_that_files_read_as_something_else_are_refused(name: str) -> None:
    with pytest.raises(pk.ArgumentError, match="another name for"):
        pk.Measurements(Q, np.zeros(len(Q)), renamed(name)())


def test_a_file_of_an_unknown_reading_is_no_closure(tmp_path: Path) -> None:
    measured = pk.VirtualMachine(ROBOT).measure(Q, renamed("off")())
    measured.write(tmp_path / "m.csv")
    path = tmp_path / "m.csv"
    with pytest.raises(pk.FileError, match=r"'off' is unknown.* kind=…, .* --ignore 'off'"):
        pk.read_measurements(path, ROBOT)
    assert pk.read_measurements(path, ROBOT, ignore=["off", "sigma*"]).kind == "closure"


def test_numbers_of_less_than_double_precision_are_refused(loops: pk.Measurements) -> None:
    class Coarse(Loop):
        def predict(self, at: At, **numbers: Any) -> Predicted:  # type: ignore[override]
            found = super().predict(at, **numbers)
            return replace(found, values=found.values.astype(np.float32))

    with pytest.raises(pk.ArgumentError, match="values must be doubles; found float32"):
        identified(Coarse(NAMES), loops)


def test_a_number_of_a_reading_that_nothing_follows_is_named_by_the_verdict(
    loops: pk.Measurements,
) -> None:
    class Worn(Loop):
        def predict(self, at: At, wear: Any = 0.0, **numbers: Any) -> Predicted:  # type: ignore[override]
            seen = super().predict(at, **numbers)
            return replace(seen, by={**seen.by, "wear": np.zeros((len(seen.values), 1, 1))})

        def dependences(self, data: Any) -> Iterator[Dependence]:
            yield from super().dependences(data)
            start = {("wear", ""): Start((0,), np.zeros(1))}
            yield always("wear", "wear", (("depth", "mm"),), [""] * len(data.measured), start)

    sound = identified(Loop(NAMES), loops)
    found = identified(Worn(NAMES), loops)
    remark = "wear.depth is not determined by what was read; the machine's numbers do not depend"
    assert [each for each in found.verdict.remarks if each.startswith(remark)]
    assert found.verdict.state == sound.verdict.state == "calibrated"
    assert "undetermined-reading" not in [each.check for each in sound.verdict.said]
    np.testing.assert_allclose(found.values[:6], sound.values[:6], atol=1e-9)
