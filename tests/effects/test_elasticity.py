"""Compliances that a calibration finds, by loads that rows state."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.stats import binom, chi2

import pkmcal as pk
from pkmcal.arrays import FloatArray
from pkmcal.diagnostics.loads import _negative

NOISE = 0.01
MACHINES = [  # what yields, mm/N or rad/(N mm), and loads under which it sags by some 0.1 mm
    ("hexapod", "offset*", 1.5e-4, 800.0),
    ("linear-delta", "offset*", 1e-3, 300.0),
    ("linear-delta", "rod*", 8e-4, 300.0),
    ("rotary-delta", "offset*", 3e-8, 200.0),
    ("6-rus", "offset*", 2e-7, 300.0),
    ("2tpr2tps", "offset*", 2e-4, 800.0),
]


def pushed(count: int, force: float) -> pk.Load:
    """No load at the first half of the rows, a force downwards at the others."""
    down = np.zeros((count, 3))
    down[count // 2 :, 2] = -force
    return pk.Load(force=down)


def yielding(name: str, numbers: str, compliance: float) -> tuple[pk.Robot, pk.Robot]:
    """The nominal machine, and one with unlike compliances and other offsets."""
    robot = pk.load(name)
    limbs = len(robot.model.limbs)
    spread = np.linspace(0.8, 1.3, limbs)
    stem = numbers.removesuffix("*")
    soft = robot.yielding({f"{stem}{i + 1}": compliance * spread[i] for i in range(limbs)})
    angles = robot.geometry.units[robot.geometry.names.index("offset1")] == "rad"
    size = 1e-3 if angles else 0.2
    return robot, soft.replace({"offset1": soft.geometry["offset1"] + size})


def twice(robot: pk.Robot, count: int) -> FloatArray:
    """Actuators at poses of the workspace, each twice."""
    q = robot.inverse(pk.sample_poses(robot, count, seed=3), match=True)
    return np.vstack([q, q])


@pytest.mark.parametrize(("name", "numbers", "compliance", "force"), MACHINES)
def test_compliances_of_machines_of_every_kind_are_found_as_surely_as_stated(
    name: str, numbers: str, compliance: float, force: float
) -> None:
    robot, true = yielding(name, numbers, compliance)
    q = twice(robot, 25)
    rows = pk.VirtualMachine(true, NOISE, seed=1).measure(q, "pose", load=pushed(len(q), force))
    free = [each for each in robot.model.free if each.startswith("offset")]
    found = pk.identify(robot, rows, free=free, effects=[pk.Elasticity(numbers)])
    truth = np.array([true.geometry[each] for each in found.free])
    assert found.chi2_per_dof == pytest.approx(1.0, abs=5.0 * np.sqrt(2.0 / found.dof))
    off = found.values - truth
    assert off @ np.linalg.solve(found.covariance, off) < chi2.isf(1e-4, len(off))
    assert (found.stderr[len(free) :] / truth[len(free) :]).max() < 0.1
    assert found.verdict.state == "calibrated"


def test_the_search_ends_at_the_minimum_of_the_exact_model() -> None:
    """Its derivatives are of first order, its residuals are exact: SciPy finds the same."""
    robot, true = yielding("hexapod", "offset*", 1e-4)  # sags by 0.5 mm
    q = twice(robot, 12)
    load = pushed(len(q), 800.0)
    rows = pk.VirtualMachine(true, NOISE, seed=2).measure(q, "position", load=load)
    found = pk.identify(robot, rows, free="offset*", effects=[pk.Elasticity()])
    _, soft, freed = pk.Elasticity().of_machine(robot)
    names = [*(f"offset{i}" for i in range(1, 7)), *freed]

    def off(x: FloatArray) -> FloatArray:
        machine = soft.replace(dict(zip(names, x / scale, strict=True)))
        pose = machine.forward(q, load=load).pose
        return (pose[:, :3] - rows.values).ravel() / NOISE

    scale = np.r_[np.ones(6), np.full(6, 1e3)]
    start = np.array([true.geometry[each] for each in names]) * scale
    exact = least_squares(off, start, xtol=1e-14, ftol=1e-14, gtol=1e-10)
    assert found.free == tuple(names)
    off_by = np.abs(found.values - exact.x / scale)
    np.testing.assert_array_less(off_by, 0.02 * found.stderr)  # what first order leaves
    assert found.chi2_per_dof * found.dof <= 2.0 * exact.cost + 1e-3


def test_two_payloads_at_the_same_poses_tell_compliances_from_offsets_best() -> None:
    """None, one for all, two at half of the poses: relative deviations fall in this order."""
    robot = pk.load("hexapod")
    true = robot.yielding({"offset*": 1e-4})
    q = robot.inverse(pk.sample_poses(robot, 40, seed=5))
    free = [*robot.model.free]
    sure = {}
    for masses in ((1e-9,), (100.0,), (0.0, 100.0)):
        at = np.vstack([q[:: len(masses)]] * len(masses))
        load = pk.Load(mass=np.repeat(masses, len(at) // len(masses)))
        rows = pk.VirtualMachine(true, NOISE, seed=1).measure(at, "pose", load=load)
        found = pk.identify(robot, rows, free=free, effects=[pk.Elasticity()])
        of_compliances = found.stderr[len(free) :] / 1e-4
        sure[masses] = float(np.sqrt((of_compliances**2).mean()))
        said = [each for each in found.verdict.remarks if "another load" in each]
        assert bool(said) == (len(masses) == 1 and of_compliances.max() > 0.2)
    assert sure[0.0, 100.0] < 0.7 * sure[100.0,] < 0.1 * sure[1e-9,]


def test_scaled_forces_cannot_be_told_from_scaled_compliances(tmp_path: Path) -> None:
    robot = weighty(tmp_path)
    q = robot.rigid.inverse(pk.sample_poses(robot.rigid, 40, seed=4))
    free = [*robot.model.free, "compliance.*", "mass.platform"]
    alone = pk.VirtualMachine(robot, NOISE, seed=1).measure(q, "pose")
    found = pk.identify(robot, alone, free=free)
    assert found.rank == len(found.free) - 1
    assert [each.split(":")[0] for each in found.gauges] == ["the scale of forces"]
    rows = pk.VirtualMachine(robot, NOISE, seed=1).measure(q, "pose", load=pk.Load(mass=50.0))
    known = pk.identify(robot, [alone, rows], free=free)
    assert known.rank == len(known.free)
    assert known.gauges == ()
    off = known.values - [robot.geometry[each] for each in known.free]
    assert off @ np.linalg.solve(known.covariance, off) < chi2.isf(1e-4, len(off))


@pytest.mark.parametrize("scale", [0.5, 3.0])
def test_the_gauge_of_force_is_exact(tmp_path: Path, scale: float) -> None:
    """All compliances by s, all masses, rates and forces over s: every pose stays."""
    robot = weighty(tmp_path)
    changed = {}
    for name, unit in zip(robot.geometry.names, robot.geometry.units, strict=True):
        if name.startswith("compliance"):
            changed[name] = robot.geometry[name] * scale
        elif unit in ("kg", "N", "N mm", "N/mm"):
            changed[name] = robot.geometry[name] / scale
    poses = pk.sample_poses(robot.rigid, 10, seed=1)
    q = robot.rigid.inverse(poses)
    same = robot.replace(changed).forward(q, guess=poses).pose
    np.testing.assert_allclose(same, robot.forward(q, guess=poses).pose, atol=1e-11)


def weighty(folder: Path) -> pk.Robot:
    """A hexapod with a platform of 30 kg on legs that yield."""
    path = folder / "weighty.toml"
    pk.load("hexapod").save(path)
    table = '[compliance]\n"offset*" = 1e-4\n[platform]\nmass = 30.0\ncentre = [0.0, 0.0, 40.0]\n'
    path.write_text(path.read_text(encoding="utf-8") + table, encoding="utf-8")
    return pk.load(path)


def test_compliances_without_any_load_are_no_calibration() -> None:
    robot, _ = yielding("hexapod", "offset*", 1.5e-4)
    q = robot.inverse(pk.sample_poses(robot, 40, seed=3))
    rows = pk.VirtualMachine(robot, NOISE, seed=1).measure(q, "pose")
    found = pk.identify(robot, rows, free="offset*", effects=[pk.Elasticity("offset*")])
    assert found.verdict.state == "doubtful"
    (said,) = [each for each in found.verdict.said if each.check == "undetermined-effect"]
    assert "compliance.offset1" in said.text


def test_loads_that_nothing_follows_are_named_as_the_cause() -> None:
    robot, true = yielding("hexapod", "offset*", 1.5e-4)
    q = twice(robot, 25)
    load = pk.Load(mass=np.repeat([0.0, 80.0], 25))
    rows = pk.VirtualMachine(true, NOISE, seed=1).measure(q, "pose", load=load)
    with pytest.warns(pk.CalibrationWarning):
        found = pk.identify(robot, rows)
    assert found.verdict.state == "doubtful"
    assert "residuals follow the loads of the rows, 0 to 80 kg" in found.verdict.reasons[0]
    assert "--effects 'elasticity=offset*'" in found.verdict.reasons[0]


def test_loads_of_a_stiff_machine_are_only_mentioned() -> None:
    robot = pk.load("hexapod")
    q, said = twice(robot, 25), 0
    load = pk.Load(mass=np.repeat([0.0, 80.0], 25))
    for seed in range(12):
        rows = pk.VirtualMachine(robot, NOISE, seed=seed).measure(q, "pose", load=load)
        found = pk.identify(robot, rows, free="offset*")
        said += any("residuals follow the loads" in each for each in found.verdict.reasons)
        assert said or any("are not taken into account" in each for each in found.verdict.remarks)
    assert said <= 1  # at 1 %


def test_a_compliance_that_grows_along_the_leg_is_found() -> None:
    robot = pk.load("hexapod")
    soft = robot.yielding({"offset*": 1e-4}, per_length=True)
    grows = {f"compliance.offset{i}.per_length": 2e-7 for i in range(1, 7)}
    true = soft.replace(grows)
    q = twice(robot, 25)
    rows = pk.VirtualMachine(true, NOISE, seed=1).measure(q, "pose", load=pushed(len(q), 800.0))
    effect = pk.Elasticity("offset*", per_length=True)
    found = pk.identify(robot, rows, free="offset*", effects=[effect])
    truth = np.array([true.geometry[each] for each in found.free])
    off = found.values - truth
    assert off @ np.linalg.solve(found.covariance, off) < chi2.isf(1e-4, len(off))
    assert (found.stderr[-6:] < 2e-7 / 5.0).all()


def test_rows_of_noisy_actuators_find_the_same() -> None:
    """Where poses are unknowns of their own the closures carry the sag."""
    robot, true = yielding("hexapod", "offset*", 1.5e-4)
    q = twice(robot, 20)
    rows = pk.VirtualMachine(true, NOISE, seed=1).measure(q, "pose", load=pushed(len(q), 800.0))
    plain = pk.identify(robot, rows, free="offset*", effects=[pk.Elasticity()])
    noisy = replace(rows, actuator_sigma=1e-4)
    found = pk.identify(robot, noisy, free="offset*", effects=[pk.Elasticity()])
    np.testing.assert_array_less(np.abs(found.values - plain.values), 0.2 * plain.stderr)


def test_what_is_found_is_saved_and_predicts_rows_held_out(tmp_path: Path) -> None:
    robot, true = yielding("hexapod", "offset*", 1.5e-4)
    q = twice(robot, 30)
    rows = pk.VirtualMachine(true, NOISE, seed=1).measure(q, "pose", load=pushed(len(q), 800.0))
    found = pk.identify(robot, rows, effects=[pk.Elasticity()], holdout=0.3)
    assert found.holdout_rms < 1.5 * found.holdout_expected
    found.robot.save(tmp_path / "found.toml")
    again = pk.load(tmp_path / "found.toml")
    assert np.array_equal(again.geometry.values, found.robot.geometry.values)
    load = pk.Load(force=(0, 0, -500.0))
    np.testing.assert_array_equal(
        again.forward(q, load=load).pose, found.robot.forward(q, load=load).pose
    )


def test_a_compliance_below_zero_is_said_kept_and_checked(tmp_path: Path) -> None:
    """A force of the wrong sign: the machine seems to rise under what pulls it down."""
    robot, true = yielding("hexapod", "offset*", 1.5e-4)
    q = twice(robot, 20)
    rows = pk.VirtualMachine(true, NOISE, seed=1).measure(q, "pose", load=pushed(len(q), 800.0))
    wrong = replace(rows, load=-rows.load)
    found = pk.identify(robot, wrong, free="offset*", effects=[pk.Elasticity()])
    assert found.verdict.state == "doubtful"
    assert any(", below 0" in each for each in found.verdict.reasons)
    found.robot.save(tmp_path / "wrong.toml")
    again = pk.load(tmp_path / "wrong.toml")
    assert np.array_equal(again.geometry.values, found.robot.geometry.values)
    assert any("no spring" in each.what for each in pk.check_geometry(again).findings)


def test_a_compliance_of_0_is_called_negative_by_chance_alone() -> None:
    """The least of six that are tested, by their degrees of freedom: at 1 %."""
    rng, said, freedom = np.random.default_rng(0), 0, 12.0
    names = tuple(f"compliance.offset{i}" for i in range(1, 7))
    values = rng.standard_t(freedom, size=(4000, 6))
    for own in values:
        found = SimpleNamespace(
            free=names, values=own, stderr=np.ones(6), parameter_dof=np.full(6, freedom)
        )
        said += len(_negative(found))
    assert binom.ppf(1e-4, 4000, 0.01) <= said <= binom.ppf(1.0 - 1e-4, 4000, 0.01)


def test_loads_that_rows_follow_are_no_shift_of_readings() -> None:
    """All without a load first, then all with it: named once, as what it is."""
    robot, true = yielding("hexapod", "offset*", 1.5e-4)
    q = twice(robot, 25)
    load = pk.Load(mass=np.repeat([0.0, 80.0], 25))
    rows = pk.VirtualMachine(true, NOISE, seed=1).measure(q, "pose", load=load)
    with pytest.warns(pk.CalibrationWarning):
        found = pk.identify(robot, rows, free="offset*")
    said = {each.check for each in found.verdict.said}
    assert "follows-loads" in said
    assert not said & {"measuring-order", "late-readings", "two-machines", "causes"}


def test_without_loads_and_effects_the_estimate_has_the_same_bits() -> None:
    """Rows that state a load of nothing, of a machine that does not yield."""
    robot = pk.load("hexapod")
    q = twice(robot, 20)
    plain = pk.VirtualMachine(robot.replace({"offset2": 0.1}), NOISE, seed=1).measure(q, "pose")
    stated = replace(plain, load=pk.Load())
    one, other = (pk.identify(robot, each, free="offset*") for each in (plain, stated))
    np.testing.assert_array_equal(one.values, other.values)
    np.testing.assert_array_equal(one.stderr, other.stderr)


@pytest.mark.parametrize(
    ("effect", "message"),
    [
        (lambda: pk.Elasticity("gain*"), "gain1 is no length"),
        (lambda: pk.Elasticity("ofset*"), "matches 'ofset"),
        (lambda: pk.Elasticity(()), "numbers: name at least one"),
        (lambda: pk.Elasticity("base*", per_length=True), "base1.x has no way to grow by"),
    ],
)
def test_numbers_that_do_not_yield_are_refused_by_name(effect: object, message: str) -> None:
    robot = pk.load("hexapod")
    q = twice(robot, 10)
    rows = pk.VirtualMachine(robot, NOISE).measure(q, "pose")
    with pytest.raises(ValueError, match=message):
        pk.identify(robot, rows, effects=[effect()])  # type: ignore[operator]


def test_what_no_arm_has_and_an_effect_stated_twice_are_refused() -> None:
    arm = pk.load("3r")
    q = np.zeros((4, arm.n_joints)) + np.arange(4)[:, None] * 0.1
    rows = pk.Measurements(q, np.zeros((4, 3)), sigma=1.0)
    with pytest.raises(ValueError, match=r"no joint of the arm .* matches 'offset"):
        pk.identify(arm, rows, effects=[pk.Elasticity()])
    with pytest.raises(ValueError, match="per_length"):
        pk.identify(arm, rows, effects=[pk.Elasticity("joint*", per_length=True)])
    robot = pk.load("hexapod")
    rows = pk.VirtualMachine(robot, NOISE).measure(twice(robot, 10), "pose")
    with pytest.raises(ValueError, match="elasticity is stated more than once"):
        pk.identify(robot, rows, effects=[pk.Elasticity(), pk.Elasticity("base*")])
