"""Errors of actuators, which equations of a pose share, are not called those of two machines."""

from __future__ import annotations

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.diagnostics import two_machines

ROWS, WAVES = 100, 7
NOISE = np.array([0.02, 0.02, 0.02, 5e-5, 5e-5, 5e-5])  # mm, rad


def calibrated(kind: str, seed: int) -> pk.Identification:
    """An arm with errors of which actuators do not stand where they say, unstated."""
    rng = np.random.default_rng(seed)
    arm = pk.SerialArm.from_dh(
        a=[0, 300, 50, 0, 0, 0], d=[400, 0, 0, 350, 0, 80],
        alpha=[-np.pi / 2, 0, -np.pi / 2, np.pi / 2, -np.pi / 2, 0], theta=np.zeros(6),
    )  # fmt: skip
    q = rng.uniform(-1.0, 1.0, (ROWS, 6))
    true = arm.replace(0.1 * rng.normal(size=(6, 6)) * [1, 1, 1, 2e-3, 2e-3, 2e-3])
    at = q.copy()
    if kind == "waves of joints 1 and 5":
        at[:, [0, 4]] += 3e-3 * np.sin(WAVES * q[:, [0, 4]] + [0.3, 1.1])
    else:
        at += 1e-3 * rng.normal(size=q.shape)
    read = pk.screw.to_pose(true.forward(at)) + rng.normal(size=(ROWS, 6)) * NOISE
    return pk.identify(arm, pk.Measurements(q, read, "pose"))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("kind", ["waves of joints 1 and 5", "noise"])
def test_errors_of_actuators_are_no_second_machine(kind: str, seed: int) -> None:
    seen = two_machines.apart(calibrated(kind, seed))
    assert seen is None or not seen.found


def test_it_is_draws_of_one_machine_that_tell_them(monkeypatch: pytest.MonkeyPatch) -> None:
    """By the distribution of errors that are independent they were called so."""
    found = calibrated("waves of joints 1 and 5", 0)
    monkeypatch.setattr(two_machines, "_drawn_alike", lambda *given: iter(()))
    seen = two_machines.apart(found)
    assert seen is not None and seen.found
