"""Numbers, points and poses that are larger, smaller or further away than a machine can be."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pkmcal.diagnostics.machine import CHECKS
from pkmcal.readings.registry import KINDS
from pkmcal.readings.unknowns import Nature

CHECK = {check.name: check for check in CHECKS}


def said(name: str, **fit: Any) -> list[str]:
    """What a check says of a calibration of which only some parts matter."""
    sure = {"free": fit.pop("free", ()), "interval95": fit.pop("interval95", np.zeros((0, 2)))}
    sure["columns"] = np.arange(len(sure["free"]))
    found: Any = SimpleNamespace(fit=SimpleNamespace(**fit), **sure)
    return [CHECK[name].say(found, finding) for finding in CHECK[name].run(found)]


def evaluated(places: np.ndarray) -> Any:
    """An evaluation at these places, with any orientations."""
    angles = 1e3 * np.random.default_rng(int(abs(places[0, 0]))).random((len(places), 3))
    return SimpleNamespace(pose=np.hstack([places, angles]))


TURNS = ["orientation", "tilt", "angle", "closure"]


@pytest.mark.parametrize("share", [-0.1, 0.015, 0.025, 0.3])
@pytest.mark.parametrize(
    "kinds", [["touch"], ["touch", "tilt"], ["touch", *TURNS], ["touch", "distance"], TURNS]
)
def test_poses_that_touch_closer_together_than_before_are_said(
    share: float, kinds: list[str]
) -> None:
    """Whether they all lie elsewhere, and what rows that touch nothing do, is no matter."""
    before = np.random.default_rng(6).normal(0, 100, (10 * len(kinds), 3))
    after = before * (1.0 - share) + [50.0, -20.0, 7.0]
    after[10:] = before[10:] * 0.5  # of the other sets
    sets = [SimpleNamespace(instrument=KINDS[kind]) for kind in kinds]
    places = np.split(np.arange(len(before)), len(kinds))
    equations: Any = SimpleNamespace(table=SimpleNamespace(sets=sets, pose_of=places))
    start, end = evaluated(before), evaluated(after)
    found = said("shrunk", equations=equations, start=start, end=end)
    alone = kinds[0] == "touch" and kinds[-1] != "distance"
    assert len(found) == (share > 0.02 and alone)
    assert all(f"lie {100 * share:.2g} % closer" in text for text in found)


@pytest.mark.parametrize("where", ["reach", "size", "geometry"])
def test_a_target_is_far_beyond_thrice_the_largest_of_reach_size_and_geometry(where: str) -> None:
    """From the platform's origin, and from where it was stated."""
    lengths = {"reach": 10.0, "size": 10.0, "geometry": 10.0} | {where: 200.0}
    places = np.array([[1.0, 0, 0], [0, -lengths["reach"], 0], [2.0, 0, 0]])
    geometry = SimpleNamespace(
        values=np.array([-lengths["geometry"], 500.0, 5.0]), units=("mm", "rad", "mm")
    )
    robot = SimpleNamespace(length=lengths["size"], geometry=geometry)
    for place, stated, far in (
        (590.0, 0.0, False),
        (610.0, 0.0, True),
        (-610.0, 0.0, True),
        (610.0, 100.0, False),  # it moved by less
        (0.0, 610.0, False),  # it is near now
    ):
        chosen: Any = SimpleNamespace(
            robot=robot,
            nuisance={("anchor", "9"): 0, ("target", "west"): 1, ("attachment", "2"): 2},
            natures={
                ("target", "west"): Nature("platform"),
                ("attachment", "2"): Nature("platform"),
            },
            number_of=np.array([0, -1, -1, 1, -1, -1, 2, -1, -1]),
            names=["anchor9.x", "", "", "targetwest.x@one", "", "", "attachment2.x", "", ""],
            start=np.array([0.0, 0, 0, 0, 0, stated, 0, 0, 0]),
        )
        end = evaluated(places)
        end.theta = np.array([1e6, 0, 0, 0, 0, place, 7e3, 0, 0])
        *found, last = said("distant-points", end=end, parameters=chosen)
        assert len(found) == far
        assert all(t.startswith("target west of one was found 610 mm") for t in found)
        assert last.startswith("attachment 2 was found 7e+03 mm")
        assert all("size (600 mm)" in text for text in found)


def test_numbers_that_moved_by_a_quarter_of_the_machine_are_named_but_loads_are_not() -> None:
    """In mm at the platform's size; what hangs on the platform may be anything."""
    names = ("base1.x", "gain2", "base3.z", "load.force.z", "load.at.x", "frame.x")
    moved = np.array([-99.0, 0.101, 101.0, 5e3, 5e3, 5e3])
    scale = np.array([1.0, 1e-3, 1.0, 1.0, 1.0, 1.0])  # of a gain per mm
    robot = SimpleNamespace(length=400.0)
    units = ("mm", "1", "mm", "N", "mm", "mm")
    chosen: Any = SimpleNamespace(
        names=names, units=units, scale=scale, geometry=slice(0, 5), robot=robot
    )
    start: Any = SimpleNamespace(theta=np.full(6, 7.0))
    end: Any = SimpleNamespace(theta=7.0 + moved)
    fit = {
        "parameters": chosen, "start": start, "estimate": SimpleNamespace(evaluation=end),
        "end": end, "equations": SimpleNamespace(parameters=chosen),
    }  # fmt: skip
    (text,) = said("implausible-changes", **fit)
    assert text.startswith("gain2, base3.z moved by up to 101 mm")
    end.theta = 7.0 + 0.9 * moved
    assert said("implausible-changes", **fit) == []


def test_numbers_that_are_hardly_told_are_not_named_and_others_are() -> None:
    """What is within its ± of a plausible change is no fault of a machine.

    Of numbers that are determined only together with others this holds of the part that is.
    """
    names = ("base1.x", "gain2", "offset3")
    chosen: Any = SimpleNamespace(
        names=names, units=("mm", "1", "mm"), scale=np.array([1.0, 1e-3, 1.0]),
        geometry=slice(0, 3), robot=SimpleNamespace(length=400.0),
    )  # fmt: skip
    moved = np.array([150.0, 0.15, -150.0])
    end: Any = SimpleNamespace(theta=moved)
    fit = {
        "parameters": chosen, "start": SimpleNamespace(theta=np.zeros(3)),
        "estimate": SimpleNamespace(evaluation=end), "free": names,
        "end": end, "equations": SimpleNamespace(parameters=chosen),
    }  # fmt: skip
    for half, told, named in (
        (49.0, 1e3, names), (51.0, 0.0, ()), (np.inf, 24.0, names), (np.inf, 27.0, ()),
    ):  # fmt: skip
        units = np.array([1.0, 1e-3, 1.0])
        ends = half * units[:, None]
        fit["uncertainty"] = SimpleNamespace(
            matrix=np.diag((told * units) ** 2), freedom=np.full(3, 1e6)
        )
        found = said("implausible-changes", interval95=moved[:, None] + ends * [-1, 1], **fit)
        assert [text.partition(" moved")[0] for text in found] == (
            [", ".join(named)] if named else []
        )
