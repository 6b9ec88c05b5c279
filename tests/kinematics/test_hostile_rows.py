"""Numbers that are none, infinite, huge or denormal in some rows: no words of NumPy's, nothing
half known, and the rows beside them to the last bit as without them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import pkmcal as pk

from .. import generated
from ..driven import with_laws
from ..workspaces import CHAINS, WORKSPACE

HOSTILE = np.array([np.nan, np.inf, -np.inf, 1e308, -1e308, 5e-324, 1e154, 1e16, 1e5, -0.0])
DIRTY, ROWS = [1, 3, 4, 7], 9

Call = Callable[[pk.Robot, np.ndarray, np.ndarray], np.ndarray]
CALLS: dict[str, Call] = {
    "inverse": lambda r, p, q: r.inverse(p),
    "inverse, matched": lambda r, p, q: r.inverse(p, True),
    "inverse, near": lambda r, p, q: r.inverse(p, near=q),
    "nearest_turns": lambda r, p, q: r.nearest_turns(q),
    "forward": lambda r, p, q: r.forward(q).pose,
    "forward, guess": lambda r, p, q: r.forward(q, guess=p).pose,
    "same_side": lambda r, p, q: r.forward(q, guess=p).same_side,
    "conditioning": lambda r, p, q: r.forward(q).conditioning,
    "jacobian": lambda r, p, q: r.jacobian(p),
    "forward_jacobian": lambda r, p, q: r.forward_jacobian(p),
    "error_jacobian": lambda r, p, q: r.error_jacobian(p, q),
    "error_twists": lambda r, p, q: r.error_twists(p),
    "actuator_twists": lambda r, p, q: r.actuator_twists(p, q),
    "complete": lambda r, p, q: r.complete(p),
    "violation": lambda r, p, q: r.violation(p),
    "feasible": lambda r, p, q: r.feasible(p).ok,
    "feasible, actuators": lambda r, p, q: r.feasible(p, q).ok,
    "dexterity": lambda r, p, q: pk.dexterity(r, p).manipulability,
}
ANGLES_STAY = ("nearest_turns", "same_side", "feasible", "feasible, actuators")


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("name", "laws"),
    [(name, False) for name in (*sorted({*WORKSPACE, *CHAINS}), *generated.KINDS)]
    + [(name, True) for name in ("five-bar", "2tpr2tps", *generated.KINDS)],
)
def test_hostile_rows_are_unknown_and_leave_others_alone(name: str, laws: bool) -> None:
    rng = np.random.default_rng([laws, 41])
    robot = generated.machine(name, rng) if name in generated.KINDS else pk.load(name)
    if laws:
        robot = with_laws(robot, rng)
    clean = np.tile(robot.home, (ROWS, 1)), np.tile(robot.inverse(robot.home), (ROWS, 1))
    dirty = tuple(each.copy() for each in clean)
    for each in dirty:
        for row in DIRTY:
            each[row, rng.integers(each.shape[1])] = rng.choice(HOSTILE)
        each[DIRTY[0]] = rng.choice(HOSTILE, each.shape[1])
    others = np.setdiff1d(np.arange(ROWS), DIRTY)
    for call, function in CALLS.items():
        found, alone = function(robot, *dirty), function(robot, *clean)
        assert np.array_equal(found[others], alone[others], equal_nan=True), call
        if call not in ANGLES_STAY:
            unknown = np.isnan(found.reshape(ROWS, -1))
            assert (unknown.any(axis=1) == unknown.all(axis=1)).all(), call
