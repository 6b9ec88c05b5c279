"""A kind of a user's own is served as those of the package are, whatever its numbers are called.

Each copies a kind of the package under other names of arguments, roles and numbers: the estimator,
which knows what these state of themselves, has to find the same.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.readings import (
    Dependence,
    Distance,
    Nature,
    Pose,
    Position,
    Start,
    Touch,
    always,
    point,
)

from ..simulated import hexapod_poses, with_errors

FOOT = np.array([40.0, -30.0, 120.0])
ENDS = np.array([[900.0, 0, 0], [-500.0, 800, 0], [-400.0, -800, 50]])
ROBOT = pk.load("hexapod")
TRUE = with_errors(ROBOT, 0.5, np.random.default_rng(1))


@dataclass(frozen=True, eq=False)
class Foot(Position):
    """A position whose point is called a foot."""

    name = "foot"
    components = (("u", "mm"), ("v", "mm"), ("w", "mm"))
    unknown_with_target = ("foot",)

    def predict(self, at: Any, foot: Any = (0.0, 0.0, 0.0), **numbers: Any) -> Any:
        seen = super().predict(at, target=np.asarray(foot))
        return dataclasses.replace(seen, by={"foot": seen.by["target"]})

    def dependences(self, data: Any) -> Iterator[Dependence]:
        yield point(data.measured, "foot", "foot", data.unknown_target)

    def arguments(self, m: Any) -> Any:
        return {"foot": m.targets}


@dataclass(frozen=True, eq=False)
class Flange(Pose):
    """A pose of something on the platform that is called a plate."""

    name = "flange"
    components = tuple((f"flange.{name}", unit) for name, unit in Pose.components)
    unknown_with_target = ("plate",)

    def predict(self, at: Any, plate: Any = None, plate_origin: Any = None, **numbers: Any) -> Any:
        if plate is None:
            return super().predict(at)
        seen = super().predict(at, tool=plate, tool_origin=plate_origin)
        return dataclasses.replace(seen, by={"plate": seen.by["tool"]})

    def dependences(self, data: Any) -> Iterator[Dependence]:
        if data.unknown_target:
            names, nature = [""] * len(data.measured), Nature("platform", pose=True)
            numbers = [(name.partition(".")[2], unit) for name, unit in self.components]
            yield always("plate", "plate", numbers, names, data.starts, nature=nature)

    def starts(self, machine: Any, sets: Any, found: Any) -> None:
        if any(data.unknown_target for data, _ in sets):
            found["plate", ""] = Start(tuple(range(6)), np.zeros(6))


@dataclass(frozen=True, eq=False)
class Wire(Distance):
    """A distance whose ends have other names."""

    name = "wire"
    components = (("pulled", "mm"),)
    unknown_with_target = ("post",)
    unknown_with_attachment = ("eye",)

    def predict(self, at: Any, eye: Any = (0, 0, 0), post: Any = (0, 0, 0), **numbers: Any) -> Any:
        seen = super().predict(at, target=np.asarray(eye), anchor=np.asarray(post))
        return dataclasses.replace(seen, by={"eye": seen.by["target"], "post": seen.by["anchor"]})

    def dependences(self, data: Any) -> Iterator[Dependence]:
        for each, own in zip(super().dependences(data), ("eye", "post"), strict=True):
            named = {
                name: dataclasses.replace(
                    numbers, names=tuple(n.replace(each.role, own) for n in numbers.names)
                )
                for name, numbers in each.estimated.items()
            }
            yield dataclasses.replace(each, argument=own, role=own, estimated=named)

    def reach(self, pose: Any, numbers: Any) -> Any:
        return super().reach(pose, {"target": numbers["eye"], "anchor": numbers["post"]})

    def arguments(self, m: Any) -> Any:
        found = super().arguments(m)
        return {"eye": found["target"], "post": found["anchor"]}


def rows(own: Any, count: int, seed: int = 2) -> pk.Measurements:
    q = ROBOT.inverse(hexapod_poses(ROBOT, count, np.random.default_rng(seed)))
    machine = pk.VirtualMachine(TRUE, 0.02, seed)
    if not isinstance(own, Distance):
        return machine.measure(q, own, FOOT if own.point else None)
    index = np.arange(count) % 3
    m = machine.measure(q, own, ENDS[index])
    return dataclasses.replace(m, target=ENDS, target_index=index)


APART = ["unknown", "unknown"]


@pytest.mark.filterwarnings("ignore:1 row fits another assembly mode")  # of both
@pytest.mark.parametrize(
    ("kind", "own", "words", "asked"),
    [
        (Position(), Foot(), {"target": "foot"}, {"unknown": {"target": APART, "frame": APART}}),
        (Position(), Foot(), {}, {"effects": pk.Expansion(2e-5)}),
        (Position(), Foot(), {"target": "foot"}, {"uncertainty": {"target*": 0.1}}),
        (Position(), Foot(), {"target": "foot"}, {"uncertainty": {"common": {"target*": 0.1}}}),
        (Pose(), Flange(), {"tool": "plate"}, {"unknown": {"target": APART, "frame": APART}}),
        (Pose(), Flange(), {"tool": "plate"}, {"uncertainty": {"tool*": 1e-2}}),
        (Distance(FOOT), Wire(FOOT), {"anchor": "post"}, {"unknown": {"target": APART}}),
        (Distance(FOOT), Wire(FOOT), {"attachment": "eye"}, {"unknown": "attachment"}),
        (Distance(FOOT), Wire(FOOT), {"anchor": "post"}, {"uncertainty": {"anchor*": 0.1}}),
        (Distance(FOOT), Wire(FOOT), {}, {"uncertainty": {"scale": 1e-4}}),
    ],
)
def test_names_of_ones_own_change_nothing(
    kind: Any, own: Any, words: dict[str, str], asked: dict[str, Any]
) -> None:
    def renamed(text: str) -> str:
        for theirs, mine in words.items():
            text = text.replace(theirs, mine)
        return text

    several = [rows(kind, 60, seed) for seed in (2, 3)]
    theirs = [dataclasses.replace(m, temperature=np.linspace(15.0, 30.0, 60)) for m in several]
    mine = [dataclasses.replace(m, instrument=own, kind=None) for m in theirs]
    one = pk.identify(ROBOT, theirs, prior=0.5, **asked)
    of_mine = dict(asked)
    if "uncertainty" in asked:
        of_mine["uncertainty"] = {
            renamed(name): {renamed(n): s for n, s in value.items()} if name == "common" else value
            for name, value in asked["uncertainty"].items()
        }
    other = pk.identify(ROBOT, mine, prior=0.5, **of_mine)
    assert other.free == tuple(renamed(name) for name in one.free)
    assert [n.name for n in other.nuisances] == [renamed(n.name) for n in one.nuisances]
    np.testing.assert_array_equal(other.values, one.values)
    np.testing.assert_array_equal(other.covariance, one.covariance)
    assert other.unidentifiable == tuple(renamed(each) for each in one.unidentifiable)


@dataclass(frozen=True, eq=False)
class Ring(Touch):
    """Touches of what is called a ring."""

    name = "ring"


def test_what_an_instrument_of_ones_own_states_beside_its_rows_is_read_with_them() -> None:
    rng = np.random.default_rng(4)
    names = np.array(["A", "B", "C"])[np.arange(60) % 3]
    places = {"A": [20.0, -40, 980], "B": [-60.0, 30, 1020], "C": [50.0, 70, 990]}
    angles = rng.uniform(-0.2, 0.2, (60, 3))
    turned = np.einsum(
        "nij,j->ni", pk.screw.from_pose(np.hstack([angles * 0, angles]))[:, :3, :3], FOOT
    )
    q = TRUE.inverse(np.hstack([np.array([places[n] for n in names]) - turned, angles]))
    known = {("A", "B"): float(np.linalg.norm(np.subtract(places["A"], places["B"])))}
    sets = [
        pk.Measurements(q, None, kind, target=FOOT)
        for kind in (Touch(names, distances=known), Ring(names, distances=known), Touch(names))
    ]
    one, other, without = (pk.identify(ROBOT, m, prior=0.5).values for m in sets)
    np.testing.assert_array_equal(one, other)
    assert not np.array_equal(one, without)


class Blind(Position):
    """Does not say that its targets are points of the platform."""

    name = "blind"
    components = (("l", "mm"), ("m", "mm"), ("n", "mm"))

    def dependences(self, data: Any) -> Iterator[Dependence]:
        m = data.measured
        yield Dependence("target", "target", m.targets, {}, np.zeros(len(m), dtype=np.intp))


def test_targets_that_are_said_to_be_no_points_are_refused() -> None:
    """Thermal expansion would leave them where they are, without a word."""
    with pytest.raises(pk.ArgumentError, match=r"Blind: .*give nature=Nature\('platform'\)"):
        pk.identify(ROBOT, rows(Blind(), 12), effects=pk.Expansion(2e-5))


def test_two_classes_of_one_name_are_not_fitted_together() -> None:
    """Held-out rows, noise and checks would be those of the other."""
    other = type("Foot", (Foot,), {})
    with pytest.raises(
        pk.ArgumentError, match=r"test_newcomers\.Foot and .* have one name, 'foot'"
    ):
        pk.identify(ROBOT, [rows(Foot(), 12), rows(other(), 12)])
