"""No row of a machine that nobody drew is silently wrong: inverse, forward, completed poses.

Rows by the million behind ``-m slow``; the judge is `twin_rows`, which knows nothing of the core.
"""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.core.library import POSE, STATUS

from . import generated, twin_rows

CLOSED = 1e-8  # mm
SHORTEST = 30.0  # mm, which no limb is shorter than
MATCHES = {  # of as many coordinates as the machine has degrees of freedom
    "tripod": [("z", "alpha", "beta"), ("x", "y", "gamma"), ("alpha", "beta", "gamma")],
    "pairs": [("x", "y", "z"), ("x", "y", "gamma"), ("z", "alpha", "beta")],
}
every = pytest.mark.parametrize("kind", generated.KINDS)


def missed(robot: pk.Robot, own: np.ndarray, q: np.ndarray) -> np.ndarray:
    """The largest closure of each row, mm."""
    return np.abs(twin_rows.closures(robot.model, own, q)).max(axis=1)


def determinant_sides(robot: pk.Robot, own: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Sign of the closures' determinant by differences of the twin, by a twist, (N,)."""
    columns = []
    for i in generated.FREE[generated.MAPS.get(robot.model.map, "six")]:
        step = np.zeros(6)
        step[i] = 1e-3 if i < 3 else 1e-5
        change = twin_rows.closures(robot.model, own + step, q)
        change -= twin_rows.closures(robot.model, own - step, q)
        columns.append(change / step[i] / (1.0 if i < 3 else robot.length))
    with np.errstate(invalid="ignore"):  # out of reach
        by_coordinates = np.linalg.det(np.stack(columns, axis=-1))
    return by_coordinates * np.sign(np.cos(own[:, 4]))  # cos β is that of α β γ by the turning


def judged(kind: str, seed: int, rows: int) -> Counter[str]:
    """Rows of one machine, by what became of them; what is wrong starts with "wrong"."""
    rng = np.random.default_rng([seed, generated.KINDS.index(kind)])
    robot = generated.machine(kind, rng, errors=rng.choice([0.0, 0.3]))
    found: Counter[str] = Counter()
    own = generated.poses(kind, robot, rows, rng)
    out = robot.frames.outward
    # there ...
    if kind in generated.CONSTRAINED:
        names = MATCHES[kind][rng.integers(3)]
        at = robot.complete(out(own), names)
        q = robot.inverse(out(own), names)
        known = np.isfinite(q).all(axis=1)
        kept = [POSE.index(name) for name in names]
        found["wrong: half known"] += int((known != np.isfinite(at).all(axis=1)).sum())
        off = at - out(own)
        off[:, 3:] = (off[:, 3:] + np.pi) % (2 * np.pi) - np.pi
        not_kept = np.abs(off)[known][:, kept].max(axis=1, initial=0.0) > 1e-6
        found["wrong: not kept"] += int(not_kept.sum())
        # no limb is on its other branch: at the pose its inverse is what was commanded
        other = robot.violation(at[known]) > 1e-3
        found["wrong: working mode"] += int(other.sum())
        own = robot.frames.inward(at)
    else:
        q = robot.inverse(out(own))
        known = np.isfinite(q).all(axis=1)
        if robot.violation(out(own[known])).max(initial=0.0) < CLOSED:
            lost = np.isnan(robot.complete(out(own[known]))).any(axis=1)
            lost[lost] = robot.forward(q[known][lost], out(own[known][lost])).ok  # not singular
            found["wrong: taken but not completed"] += int(lost.sum())
    found["out of reach"] += int((~known).sum())
    own, q = own[known], q[known]
    found["wrong: inverse"] += int((missed(robot, own, q) > CLOSED).sum())
    if kind not in generated.CONSTRAINED:
        half = robot.turns / 2 + 1e-9
        beyond = np.abs(q - generated.references(robot)) > half
        found["wrong: turn"] += int(beyond.any(axis=1).sum())
    # ... and back, by any turn of the actuators, from home, the pose or somewhere
    turns = np.where(np.isfinite(robot.turns), robot.turns, 0.0)
    sent = q + turns * rng.integers(-2, 3, q.shape)
    somewhere = own + generated.ROOM * rng.uniform(-3, 3, own.shape)
    guess: np.ndarray = (np.tile(robot.own_home, (len(own), 1)), own.copy(), somewhere)[
        rng.integers(3)
    ]
    solved = robot.forward(sent, out(guess))
    ok = solved.ok
    found.update(STATUS[code] for code in solved.status.tolist())
    there = robot.frames.inward(solved.pose[ok])
    more = robot.machine.rows > robot.machine.m
    bound = robot.closure_tolerance if more else CLOSED
    closes = missed(robot, there, sent[ok])
    # the core's residual is (d·d - ρ²)/(2ρ), the twin's e = ‖d‖ - ρ: they differ by e²/(2ρ)
    within = bound + (bound**2 / SHORTEST if more else 0.0) + CLOSED
    found["wrong: forward"] += int((~(closes <= within)).sum())
    if more:
        apart = np.abs(closes - solved.residual[ok])
        found["wrong: residual"] += int((apart > closes**2 / SHORTEST + CLOSED).sum())
    open_ones = solved.status == 5
    found["wrong: open"] += int((~(solved.residual[open_ones] > bound)).sum())
    found["wrong: half known"] += int(np.isfinite(solved.pose[~ok]).any(axis=1).sum())
    if kind in generated.SQUARE:
        fixed = np.setdiff1d(range(6), generated.FREE[kind])
        guess[:, fixed] = robot.own_home[fixed]  # what the map does not move is not looked at
        at_guess = robot.inverse(out(guess))
        sides = [
            determinant_sides(robot, *pair)
            for pair in ((guess[ok], at_guess[ok]), (there, sent[ok]))
        ]
        clear = np.isfinite(sides[0]) & (np.abs(sides).min(axis=0) > 1e-6)
        same = np.sign(sides[0]) == np.sign(sides[1])
        folded = np.abs(robot.inverse(out(there), near=sent[ok]) - sent[ok]) > 1e-6
        same &= ~folded.any(axis=1)
        found["wrong: side"] += int((same != solved.same_side[ok])[clear].sum())
    found["rows"] += rows
    return found


def campaign(kind: str, machines: int, rows: int, first: int = 0) -> Counter[str]:
    total: Counter[str] = Counter()
    for seed in range(first, first + machines):
        total += judged(kind, seed, rows)
    return total


@every
def test_no_row_of_generated_machines_is_silently_wrong(kind: str) -> None:
    counts = campaign(kind, machines=25, rows=100)
    print(kind, dict(counts))
    assert {words: n for words, n in counts.items() if words.startswith("wrong") and n} == {}
    assert counts["ok"] > 0.8 * (counts["rows"] - counts["out of reach"])


@pytest.mark.slow
@every
def test_no_row_of_a_million_of_generated_machines_is_silently_wrong(kind: str) -> None:
    counts = campaign(kind, machines=350, rows=500, first=1000)
    print(kind, dict(counts))
    assert {words: n for words, n in counts.items() if words.startswith("wrong") and n} == {}
    assert counts["rows"] * len(generated.KINDS) > 1_000_000
    assert counts["ok"] > 0.8 * (counts["rows"] - counts["out of reach"])
