"""What no reading ends is named as what it is: motions of all anchors apart from their growth."""

from __future__ import annotations

import numpy as np
import pytest

import pkmcal as pk
from tests.robots import made

CORNERS = np.array([[0.0, 0, 0], [2400, 1800, 0], [-300, 2300, 0], [2500, -400, 0]])
SCALE = "the common scale: all lengths and gains may grow by the same factor"


@pytest.mark.parametrize(
    ("read", "rank", "motions"),
    [
        ([], 8, ["along x and y and turned about z"]),
        ([(0, 0)], 9, ["moved along y:", "moved as one body in 1 more way"]),
        ([(0, 0), (0, 1)], 10, ["moved as one body in 1 way"]),
    ],
)
def test_anchors_that_grow_about_a_place_that_was_read_are_not_moved_as_one_body(
    read: list[tuple[int, int]], rank: int, motions: list[str]
) -> None:
    limbs = [{"kind": "cable", "base": a, "platform": [0.0, 0.0, 0.0]} for a in CORNERS]
    sled = made("xy", {"x": 1100.0, "y": 900.0}, limbs)
    rng = np.random.default_rng(0)
    free = [n for n in sled.geometry.match(["base*", "gain*"]) if not n.endswith("z")]
    true = sled.replace({n: sled.geometry[n] + rng.normal(0, 3) for n in free if "base" in n})
    at = sled.home + rng.uniform(-1, 1, (40, 6)) * [600, 500, 0, 0, 0, 0]
    q = true.inverse(at) + rng.normal(0, 0.2, (40, 4))
    seen = np.full((40, 3), np.nan)
    for row, axis in read:
        seen[row, axis] = at[row, axis]
    found = pk.identify(sled, pk.Measurements(q, seen, sigma=0.3, actuator_sigma=0.2), free)
    named = [text for text in found.gauges if "mirror" not in text]
    assert found.rank == rank and found.unidentifiable == ()
    assert SCALE in named and len(named) == len(motions) + 1
    assert all(words in text for words, text in zip(motions, named, strict=False))
