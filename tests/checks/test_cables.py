"""What check says of machines on cables."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from tests.robots import made

ORIGIN = [0.0, 0.0, 0.0]
PRINTER = [[0.0, -1597, -120], [1550.0, 900, -120], [-1370.0, 790, -120], [0.0, 0, 2355]]
HALL = [[1500.0, 0, 2000], [-800.0, 1200, 2100], [-700.0, -1300, 1900]]


def cables(anchors: Sequence[Sequence[float]], **more: Any) -> list[dict[str, object]]:
    return [{"kind": "cable", "base": list(a), "platform": ORIGIN, **more} for a in anchors]


def point(anchors: Sequence[Sequence[float]], z: float = 500.0, **more: Any) -> pk.Robot:
    return made("translation", {"z": z}, cables(anchors, **more))


def test_anchors_where_there_is_room_for_them_are_no_mistake() -> None:
    for robot in (point(PRINTER), point([*PRINTER, [-1500.0, 100, -110]]), point(HALL)):
        assert pk.check_geometry(robot).ok, robot
    pulleys = [
        {"kind": "pulley", "base": a, "platform": ORIGIN, "radius": 25.0, "swivel": [0, 0, 1]}
        for a in HALL
    ]
    assert pk.check_geometry(made("translation", {"z": 500.0}, pulleys)).ok
    legs = [limb | {"kind": "UPS"} for limb in cables(PRINTER)]
    assert "alike" in pk.check_geometry(made("translation", {"z": 500.0}, legs)).kinds


def test_it_says_what_holds_the_platform() -> None:
    """Of the printer an anchor is above and three are below; of the other all are above."""
    printer = str(pk.check_geometry(point(PRINTER)))
    assert "4 cables for 3 coordinates (x, y, z); at home they pull against each other" in printer
    assert "1 more than needed: it can calibrate itself by their readings" in printer
    hanging = str(pk.check_geometry(point(HALL)))
    assert "3 cables for 3 coordinates (x, y, z); at home they need a force along -z" in hanging
    assert "calibrate itself" not in hanging
    assert "need a force along +z" in str(pk.check_geometry(point(HALL, z=4000.0)))


def test_a_home_at_which_a_cable_would_have_to_push_is_found() -> None:
    aside = made("translation", {"x": 4000.0, "z": 1900.0}, cables(HALL))
    assert pk.check_geometry(aside).kinds == ("singular", "tension")  # and near the anchors' plane
    away = np.array([4000.0, 0, 1900]) - HALL
    alone = np.linalg.solve((away / np.linalg.norm(away, axis=1)[:, None]).T, np.eye(3))
    assert ((alone < 0).any(axis=0) & (alone > 0).any(axis=0)).all()  # of no axis either way
    # two pairs on one line, and home beside it: whatever pulls one pair lets the other go
    anchors = [[-1000.0, 0, 0], [1000.0, 0, 0], [900.0, 100, 2000], [-1000.0, 2000, 100]]
    twisted = made("translation", {"x": 2500.0, "y": -2000.0, "z": 400.0}, cables(anchors))
    (finding,) = [f for f in pk.check_geometry(twisted).findings if f.kind == "tension"]
    assert "not all cables can pull at once" in finding.what
    away = np.array([2500.0, -2000, 400]) - anchors
    slopes = (away / np.linalg.norm(away, axis=1)[:, None]).T
    for force in (*np.eye(3), *-np.eye(3)):  # one cable more than coordinates: t0 + s n
        t0, n = np.linalg.pinv(slopes) @ force, np.linalg.svd(slopes)[2][3]
        s = np.linspace(-1e4, 1e4, 200001)[:, None]
        assert not ((t0 + s * n) > 1e-3).all(axis=1).any()


@pytest.mark.parametrize(("place", "kind"), [("base", "unit"), ("double", "double")])
def test_slips_that_cables_share_with_legs_are_found(place: str, kind: str) -> None:
    limbs = cables(PRINTER)
    if place == "base":
        limbs = cables(PRINTER, stroke=[0.5, 5.0])  # in metres
    else:
        limbs[1] = dict(limbs[0])
    found = pk.check_geometry(made("translation", {"z": 500.0}, limbs))
    assert kind in found.kinds
