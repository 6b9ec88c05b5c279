"""Components that a machine cannot change and that files state as exactly 0 say nothing wrong."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import pytest

import pkmcal as pk

from ..simulated import said_by
from ..sweeps import sweep

NOISE, TURNING = 0.02, 1e-4
STILL = {"rotary-delta": [3, 4, 5], "linear-delta": [3, 4, 5], "3rrr-planar": [2, 3, 4]}


def poses(name: str, seed: int, noisy: tuple[int, ...] = ()) -> tuple[pk.Robot, pk.Measurements]:
    """Poses with noise where the machine moves; elsewhere exactly 0, but for columns `noisy`."""
    robot, rng = pk.load(name), np.random.default_rng(seed)
    true = robot.replace({free: robot.geometry[free] + rng.normal(0, 0.1)
                          for free in robot.model.free if free.startswith("rod")})  # fmt: skip
    at = pk.sample_poses(robot, 45, seed=seed, share=0.5)
    q = robot.inverse(at)
    read = true.forward(q, guess=at).pose + rng.normal(0, 1, (45, 6)) * np.repeat(
        [NOISE, TURNING], 3
    )
    read[:, [k for k in STILL[name] if k not in noisy]] = 0.0
    return robot, pk.Measurements(q, read, "pose")


@sweep(
    "name, holdout, stated",
    product(STILL, [None, 0.25], [False, True]),
    quick=[("linear-delta", 0.25, False), ("3rrr-planar", None, True)],
)
def test_sound_machines_are_no_two_machines(name: str, holdout: float | None, stated: bool) -> None:
    """Of a delta with a hold-out it was an error of linear algebra, with sigma a false cause."""
    sigma: dict[str, Any] = {"sigma": [NOISE] * 3 + [TURNING] * 3} if stated else {}
    for seed in range(3):
        robot, m = poses(name, seed)
        m = pk.Measurements(m.actuators, m.values, "pose", **sigma)
        found = pk.identify(robot, m, holdout=holdout)
        assert "two-machines" not in {said.check for said in found.verdict.said}
        assert found.verdict.state != "not calibrated"


@sweep("column", [3, 4, 5], quick=[3])
def test_noise_about_zero_is_in_no_other_unit(column: int) -> None:
    """Angles that are noise alone get smaller in milliradians, whatever they are."""
    for seed in range(2):
        robot, m = poses("rotary-delta", seed, noisy=(column,))
        sigma = [NOISE] * 3 + [TURNING] * 3
        found = pk.identify(robot, pk.Measurements(m.actuators, m.values, "pose", sigma=sigma))
        assert not said_by(found, "other-reading")


def test_a_plane_whose_height_is_exactly_zero_is_calibrated_from_noisy_angles() -> None:
    """It was refused as a singular matrix."""
    robot, m = poses("3rrr-planar", 1, noisy=(3, 4))
    assert pk.identify(robot, m).verdict.state in ("calibrated", "doubtful")


def planar(name: str, seed: int, stated: bool, share: float = 0.4) -> tuple[pk.Robot, Any]:
    """Places in a plane that a camera read in a frame of its own, of a machine with errors."""
    robot, rng = pk.load(name), np.random.default_rng(seed)
    units = dict(zip(robot.geometry.names, robot.geometry.units, strict=True))
    small = {"mm": 0.2, "rad": 6e-4, "1": 0.0}
    true = robot.replace({free: robot.geometry[free] + small[units[free]] * rng.normal()
                          for free in robot.model.free})  # fmt: skip
    poses = pk.sample_poses(robot, 45, seed=int(rng.integers(1_000_000)), share=share)
    q = robot.inverse(poses)
    read = true.forward(q, guess=poses).pose[:, :3].copy()
    read[:, :2] += rng.normal([5.0, 3.0], NOISE, (45, 2))
    read[:, 2] = 0.0
    return robot, pk.Measurements(q, read, "position", sigma=NOISE if stated else None)


@sweep(
    "name, stated",
    product(["3rrr-planar", "five-bar"], [False, True]),
    quick=[("3rrr-planar", True), ("five-bar", False)],
)
def test_a_plane_in_an_unknown_frame_is_calibrated(name: str, stated: bool) -> None:
    """Its height is met exactly by three numbers of the frame, and told no noise of the others."""
    for seed in range(2):
        robot, m = planar(name, seed, stated)
        found = pk.identify(robot, m, unknown="frame")
        assert found.rank >= len(robot.model.free)
        assert found.rms == pytest.approx(NOISE * np.sqrt(2.0), rel=0.35)
        said = said_by(found, "nothing-determined", "two-machines", "sides")
        assert not [each for each in said.values() if each.level != "remark"]


def test_a_search_with_other_weights_that_leaves_rows_unsolved_is_not_taken() -> None:
    """It was an error of linear algebra."""
    robot, m = planar("3rrr-planar", 4, False, 0.6)
    with pytest.warns(pk.CalibrationWarning, match="another assembly mode"):
        found = pk.identify(robot, m, unknown="frame")
    assert np.isfinite(found.values).all()


@sweep("name", ["3rrr-planar", "five-bar"], quick=["five-bar"])
def test_a_height_that_is_exactly_zero_is_no_evidence_for_held_out_points(name: str) -> None:
    """It counted as a third of the equations, and the tests had too many degrees of freedom."""
    for seed in range(2):
        robot, m = planar(name, seed, stated=False)
        without = m.values.copy()
        without[:, 2] = np.nan
        with_zeros, alone = (
            pk.identify(robot, pk.Measurements(m.actuators, values - [5.0, 3.0, 0.0], "position"),
                        holdout=0.25)
            for values in (m.values, without)
        )  # fmt: skip
        assert with_zeros.holdout_rms == pytest.approx(alone.holdout_rms, rel=1e-4)
        assert with_zeros.holdout_expected == pytest.approx(alone.holdout_expected, rel=1e-3)
        assert with_zeros.holdout_test is not None and alone.holdout_test is not None
        assert with_zeros.holdout_test.chance == pytest.approx(alone.holdout_test.chance, rel=0.02)


@pytest.mark.filterwarnings("ignore:.*further than errors of a machine")
@sweep(
    "name, wrong",
    product([*STILL, "five-bar"], ["late", "two machines"]),
    quick=[("rotary-delta", "late"), ("five-bar", "two machines")],
)
def test_what_is_wrong_of_other_components_is_seen_beside_exact_zeros(
    name: str, wrong: str
) -> None:
    """Zeros whose noise is rounding were taken for a fit of which nothing but rounding is left."""
    rng = np.random.default_rng(4)
    robot = pk.load(name)
    units = dict(zip(robot.geometry.names, robot.geometry.units, strict=True))

    def read(at: np.ndarray) -> np.ndarray:
        sizes = {free: 0.2 if units[free] == "mm" else 6e-4 for free in robot.model.free}
        true = robot.replace({free: robot.geometry[free] + size * rng.normal()
                              for free, size in sizes.items()})  # fmt: skip
        return true.forward(robot.inverse(at), guess=at).pose + rng.normal(0, 1, at.shape) * (
            np.repeat([NOISE, TURNING], 3)
        )

    at = pk.sample_poses(robot, 45, seed=3, share=0.5)
    values = read(at)
    if wrong == "late":
        values[1:] += 4e-3 * (values[:-1] - values[1:])
    else:
        values[1::2] = read(at)[1::2]
    values[:, STILL.get(name, [2])] = 0.0
    kind = "position" if name == "five-bar" else "pose"
    values = values[:, :3] if kind == "position" else values
    found = pk.identify(robot, pk.Measurements(robot.inverse(at), values, kind), holdout=0.25)
    wanted = "late-readings" if wrong == "late" else "two-machines"
    assert said_by(found, wanted)[wanted].level == "doubt"


def test_places_that_a_machine_cannot_leave_are_no_error_of_linear_algebra() -> None:
    """A machine that turns about a point, and a table that shows it in tenths of a millimetre."""
    robot, rng = pk.load("agile-eye"), np.random.default_rng(2)
    true = robot.replace({name: robot.geometry[name] + rng.normal(0, 1e-3)
                          for name in robot.model.free})  # fmt: skip
    q = robot.inverse(pk.sample_poses(robot, 40, seed=3))
    seen = pk.VirtualMachine(true, noise=0.02, seed=4).measure(q, "position").values
    found = pk.identify(robot, pk.Measurements(q, np.round(seen, 1)), prior=0.5)
    assert found.verdict.state != "calibrated"
