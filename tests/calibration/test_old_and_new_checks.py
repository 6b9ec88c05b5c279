"""For one commit: the list of checks says what the branches before it say."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.calibration.identification import Identification
from pkmcal.diagnostics.checks import AT_ONCE, CHECKS
from pkmcal.diagnostics.diagnosis import Diagnosis
from pkmcal.kinematics.robot import Robot

from ..simulated import hexapod_poses, with_errors

SEARCH = "the least squares did not converge"  # once, where it was a reason and a warning


def agree(found: Identification) -> None:
    """Judge one result both ways. The intended differences: no convergence is said once, in one
    sentence; remedies are written as option and argument; remarks are in the order of the list."""
    said = Diagnosis(found, CHECKS, {}).said()
    at_once = [each.text for each in Diagnosis(found, AT_ONCE, {}).said()]
    old = [text for text in found.warnings if not text.startswith(SEARCH)]
    assert sorted(map(plain, at_once_without(at_once))) == sorted(map(plain, old))
    verdict = found.verdict
    by = {level: [plain(each.text) for each in said if each.level == level] for level in
          ("grave", "doubt", "remark")}  # fmt: skip
    state = "not calibrated" if by["grave"] else "doubtful" if by["doubt"] else "calibrated"
    assert state == verdict.state
    reasons = [plain(text) for text in verdict.reasons if not text.startswith(SEARCH)]
    if state != "calibrated":
        new = [text for text in by["grave"] + by["doubt"] if not text.startswith(SEARCH)]
        assert sorted(new) == sorted(reasons)
    assert sorted(by["remark"]) == sorted(map(plain, verdict.remarks))


def at_once_without(texts: list[str]) -> list[str]:
    return [text for text in texts if not text.startswith(SEARCH)]


def plain(text: str) -> str:
    """A sentence whichever way it writes what to do."""
    return text.replace("--drop-slack (drop='slack')", "slack='drop' (--drop-slack)")


def scenes(robot: Robot) -> Iterator[tuple[str, dict[str, Any], Callable[[Any], Any]]]:
    """Names, arguments of `identify`, and what is done to good measurements."""

    def gross(m: Any) -> Any:
        values = m.values.copy()
        values[[3, 11]] += 5.0
        return replace(m, values=values)

    def drifting(m: Any) -> Any:
        again = pk.join_measurements if False else m
        return replace(again, values=m.values + np.linspace(0, 0.4, len(m))[:, None])

    def copied(m: Any) -> Any:
        return m.select(np.r_[np.arange(len(m)), 0, 1, 2])

    def scaled(m: Any) -> Any:
        return replace(m, values=m.values / 25.4)

    same: Callable[[Any], Any] = lambda m: m  # noqa: E731
    offsets = {"free": "offset*"}
    yield "good", {}, same
    yield "held out", {"holdout": 0.3}, same
    yield "gross", {}, gross
    yield "gross held out", {"holdout": 0.3}, gross
    yield "without them", {"drop": "outliers", "holdout": 0.3}, gross
    yield "robust", {"loss": "cauchy"}, gross
    yield "drift", offsets, drifting
    yield "drift held out", offsets | {"holdout": 0.2}, drifting
    yield "copies", {}, copied
    yield "inches", {}, scaled
    yield "small sigma", {}, lambda m: replace(m, sigma=np.full(m.values.shape, 1e-3))
    yield "large sigma", {}, lambda m: replace(m, sigma=np.full(m.values.shape, 1.0))
    yield "few", offsets, lambda m: m.select(slice(0, 3))
    yield "fewer", {}, lambda m: m.select(slice(0, 5))
    yield "one pose", offsets, lambda m: m.select([0, 0, 0])
    yield "tight prior", {"prior": 1e-4}, same
    yield "at a bound", offsets | {"bounds": {"offset1": (-1e-3, 1e-3)}}, same
    yield "exchanged", offsets, lambda m: replace(m, actuators=m.actuators[:, [1, 0, 2, 3, 4, 5]])
    yield "shifted", offsets, lambda m: replace(m, values=np.roll(m.values, 1, axis=0))
    yield "unknown target", {"target": "unknown", "frame": "unknown"}, same


@pytest.mark.parametrize("seed", range(2))
def test_both_judge_alike(seed: int) -> None:
    robot = pk.load("hexapod")
    rng = np.random.default_rng(seed)
    true = with_errors(robot, 0.5, rng)
    q = robot.inverse(hexapod_poses(robot, 40, rng))
    measured = pk.VirtualMachine(true, noise=0.02, seed=seed).measure(q)
    states = set()
    for name, arguments, done in scenes(robot):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                found = pk.identify(robot, done(measured), **arguments)
            except pk.Error:
                continue
            agree(found)
        states.add((name, found.verdict.state))
    assert len({state for _, state in states}) == 3 and len(states) > 15
