"""Start systems: what is stored solves what was derived, and the search finds it again."""

from __future__ import annotations

import json

import numpy as np
import pytest
from pkmcal.derive import modes

STORED = json.loads(modes.FILE.read_text(encoding="utf-8"))
FAMILIES = {family.name: family for family in modes.FAMILIES}


def stored(name: str) -> tuple[np.ndarray, np.ndarray]:
    limbs, states = (np.array(STORED[name][key]) @ [1, 1j] for key in ("limbs", "states"))
    return limbs, states


def test_every_family_is_stored_as_it_is_declared():
    assert list(STORED) == list(FAMILIES)
    for name, family in FAMILIES.items():
        assert STORED[name]["map"] == family.map
        assert [tuple(kinds) for kinds in STORED[name]["rows"]] == list(family.rows)
        assert [tuple(place) for place in STORED[name]["zero"]] == list(family.zero)


@pytest.mark.parametrize("name", FAMILIES)
def test_stored_solutions_close_and_differ(name):
    limbs, states = stored(name)
    system = modes.System(FAMILIES[name])
    numbers = np.broadcast_to(limbs.ravel(), (len(states), limbs.size))
    assert np.abs(system.rows(states.T, numbers.T)).max() < 1e-9
    assert len(modes.distinct(system, states)) == len(states)
    assert np.abs(np.linalg.det(system.by_state(states.T, numbers.T))).min() > 1e-6
    for limb, place in FAMILIES[name].zero:
        assert limbs[limb, place] == 0


@pytest.mark.parametrize(
    "name",
    [
        "delta",
        "planar",
        *(pytest.param(n, marks=pytest.mark.slow) for n in ("3rps", "3prs", "hexapod")),
    ],
)
def test_the_search_finds_the_stored_solutions_again(name, capsys):
    limbs, states = stored(name)
    again, found = modes.start_system(FAMILIES[name])
    assert f"{len(states)} solutions" in capsys.readouterr().out
    assert np.abs(again - limbs).max() < 1e-12
    system = modes.System(FAMILIES[name])
    assert len(found) == len(states)
    assert len(modes.distinct(system, np.concatenate([states, found]))) == len(states)
