"""An exception anywhere leaves a result unaltered, to the last bit."""

from __future__ import annotations

import contextlib
import dataclasses
import pickle
import sys
from collections.abc import Callable, Iterator
from types import FrameType
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.diagnostics.linearity import beyond_linear
from pkmcal.estimation.estimator import Estimator
from pkmcal.estimation.mirror import mirror_fits
from pkmcal.estimation.mode_slips import in_other_modes, start_in_modes
from pkmcal.estimation.solving import solve

PLACES = 9  # at which each action is interrupted


def fitted(noisy: bool, free: str) -> pk.Identification:
    """A hexapod, whose poses have unknowns if its actuators are `noisy`."""
    robot = pk.load("hexapod")
    q = robot.inverse(pk.sample_poses(robot, 12, seed=3))
    readings = pk.VirtualMachine(robot.replace({"offset2": 0.3}), noise=0.01, seed=5).measure(q)
    if noisy:
        readings = dataclasses.replace(readings, actuator_sigma=np.full(q.shape, 0.02))
    return pk.identify(robot, readings, free=free)


def numbers(value: Any, path: str = "") -> Iterator[tuple[str, bytes]]:
    """All numbers that an object holds, but caches, by where they are."""
    if isinstance(value, np.ndarray) and value.dtype.kind in "fib":
        yield path, value.tobytes()
    elif isinstance(value, float | int | str):
        yield path, repr(value).encode()
    elif isinstance(value, tuple | list):
        for i, each in enumerate(value):
            yield from numbers(each, f"{path}[{i}]")
    elif type(value).__module__.startswith("pkmcal") and hasattr(value, "__dict__"):
        for name, each in vars(value).items():
            if name not in ("cache", "_cache"):
                yield from numbers(each, f"{path}.{name}")


class Interrupt:
    """Raises KeyboardInterrupt at the n-th call of a function of the package."""

    def __init__(self, at: int) -> None:
        self.left = at

    def __call__(self, frame: FrameType, event: str, argument: object) -> None:
        """Count calls, as a profiler does."""
        if event == "call" and "pkmcal" in frame.f_code.co_filename:
            self.left -= 1
            if self.left == 0:
                raise KeyboardInterrupt


def run(action: Callable[[], object], at: int) -> int:
    """Interrupt an action at a call; how many calls it still was from there."""
    counter = Interrupt(at)
    before = sys.getprofile()
    sys.setprofile(counter)
    try:
        action()
    finally:
        sys.setprofile(before)
    return at - counter.left


ACTIONS: dict[str, Callable[[pk.Identification], object]] = {
    "verdict": lambda found: dataclasses.replace(found).verdict,
    "linearity": lambda found: beyond_linear(found.fit.estimate, found.fit.uncertainty),
    "modes": lambda found: in_other_modes(found.fit.equations, found.fit.end),
    "start": lambda found: start_in_modes(found.fit.equations),
    "mirror": lambda found: mirror_fits(
        found.fit.uncertainty.equations,
        found.fit.estimate.evaluation,
        found.fit.estimate.state.noise,
    ),
    "another fit": lambda found: solve(
        Estimator.of(found.fit.uncertainty.equations, found.fit.estimate.evaluation, "cauchy")
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", ACTIONS)
@pytest.mark.parametrize(("noisy", "free"), [(False, "base*"), (True, "offset*")])
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # of a generator
@pytest.mark.filterwarnings("ignore::pkmcal.exceptions.CalibrationWarning")
def test_an_interrupted_action_alters_no_result(name: str, noisy: bool, free: str) -> None:
    found = fitted(noisy, free)
    twin = pickle.loads(pickle.dumps(found))
    calls = run(lambda: ACTIONS[name](twin), sys.maxsize)
    before = dict(numbers(found))
    assert len(before) > 100
    for at in np.unique(np.linspace(1, calls, PLACES).astype(int)).tolist():
        with contextlib.suppress(KeyboardInterrupt):
            run(lambda: ACTIONS[name](found), at)
        after = dict(numbers(found))
        assert {path: after.get(path) for path in before} == before
    assert str(found.verdict) == str(twin.verdict)
    equations, end = found.fit.uncertainty.equations, found.fit.estimate.evaluation
    others, there = twin.fit.uncertainty.equations, twin.fit.estimate.evaluation
    theta, noise = end.theta + 0.01, found.fit.estimate.state.noise
    np.testing.assert_array_equal(
        equations.at(theta, noise, end.states).pose, others.at(theta, noise, there.states).pose
    )
