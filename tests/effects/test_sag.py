"""Sag of arms and errors of their gears: found, judged by poses left out, refused where not there.

The arms that sag are bodies with joint springs: they rest where gravity's torques, by the masses,
and the springs agree (`weights.at_rest`), which the products do not know.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.arms.joint_laws import JointLaws, Term
from pkmcal.arms.joint_pulls import JointPulls
from pkmcal.arms.weights import at_rest, gravity_torques
from pkmcal.arrays import FloatArray
from pkmcal.calibration.rigid import rigid_arm
from pkmcal.diagnostics.sag import sag_that_helps
from pkmcal.diagnostics.waves import _alike, scan_waves
from pkmcal.fitted.left_out import compared_by_poses
from pkmcal.geometry.chain_joints import ERRORS
from pkmcal.kinematics.arm_machine import ArmMachine
from pkmcal.kinematics.calibratable import as_machine

AXES = [[0, 0, 1], [0, 1, 0], [0, 1, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0]]
POINTS = [[0, 0, 0], [0, 0, 290], [0, 0, 560], [0, 0, 630], [302, 0, 630], [374, 0, 630]]
ARM = pk.SerialArm(AXES, POINTS, [450, 0, 630, 0, 0, 0], name="six")
MASSES = np.array([3.0, 4.0, 3.5, 1.5, 0.8, 0.3])
CENTRES = np.array(
    [[0, 0, 200], [10, 20, 420], [50, 0, 620], [200, 0, 630], [320, 0, 640], [380, 10, 630]], float
)
SOFT = np.array([3.0, 5.0, 6.0, 20.0, 30.0, 30.0]) * 1e-8  # rad/(N mm)
TARGETS = np.array([[60.0, 40.0, 0.0], [60.0, -40.0, 10.0], [80.0, 0.0, 50.0]])
NOISE = 0.02
NOWHERE, FRAME = np.zeros(6), np.array([500.0, -200.0, 100.0, 0.1, -0.2, 2.0])
UNKNOWN = {"unknown": ["frame", "target"]}
pytestmark = pytest.mark.filterwarnings("ignore::pkmcal.CalibrationWarning")


def commands(count: int, seed: int) -> FloatArray:
    rng = np.random.default_rng(seed)
    return rng.uniform(-1, 1, (count, 6)) * [2.5, 1.0, 0.9, 2.0, 1.6, 2.5]


def built(seed: int) -> pk.SerialArm:
    rng = np.random.default_rng(seed + 1000)
    return ARM.replace(rng.normal(size=(6, 6)) * [0.3, 0.3, 0.3, 5e-4, 5e-4, 5e-4])


def measured(theta: FloatArray, true: pk.SerialArm, seed: int, soft: FloatArray | None = None,
             shared: float = 0.0, frame: FloatArray = FRAME) -> pk.Measurements:  # fmt: skip
    """Three targets at each pose of an arm with springs at its joints, in an unknown frame."""
    rng = np.random.default_rng(seed)
    rest = theta
    if soft is not None:
        rest = at_rest(lambda at: gravity_torques(true, at, MASSES, CENTRES), theta, soft)
    tool = pk.screw.from_pose(frame) @ true.forward(rest)
    points = np.einsum("nij,kj->nki", tool[:, :3, :3], TARGETS) + tool[:, None, :3, 3]
    points += rng.normal(0, NOISE, points.shape) + rng.normal(0, shared, (len(theta), 1, 3))
    return pk.Measurements(
        np.repeat(theta, 3, axis=0), points.reshape(-1, 3), "position", target=TARGETS,
        target_names=("A", "B", "C"), target_index=np.tile([0, 1, 2], len(theta)),
    )  # fmt: skip


def test_products_take_up_what_springs_and_weights_do() -> None:
    """The springs' arm is no arm of the model, and yet its sag is found to the noise."""
    theta, true = commands(60, 1), built(1)
    held = measured(commands(60, 2), true, 3, SOFT)
    m = measured(theta, true, 2, SOFT)
    rigid = pk.identify(ARM, m, holdout=held, **UNKNOWN)
    found = pk.identify(ARM, m, holdout=held, effects=[pk.Sag("all")], **UNKNOWN)
    assert rigid.holdout_rms > 2.5 * found.holdout_rms
    assert found.holdout_rms < 1.2 * np.sqrt(3) * NOISE
    assert 0.8 < found.holdout_rms / found.holdout_expected < 1.25


def test_the_found_arm_is_the_arm_with_springs() -> None:
    """Where it stands, in the base, at poses that were not measured."""
    true, theta = built(2), commands(100, 3)
    m = measured(commands(40, 4), true, 5, SOFT, frame=NOWHERE)
    found = pk.identify(ARM, m, effects=[pk.Sag("all")])
    rest = at_rest(lambda at: gravity_torques(true, at, MASSES, CENTRES), theta, SOFT)
    rigid = pk.identify(ARM, m).robot

    def off(arm: pk.SerialArm) -> float:
        away = (arm.forward(theta) - true.forward(rest))[:, :3, 3]
        return float(np.sqrt(np.mean(np.sum(away**2, axis=1))))

    assert off(found.robot) < 0.02 < 0.1 * off(rigid)


@pytest.mark.slow
def test_poses_left_out_by_the_linear_model_are_those_of_as_many_fits() -> None:
    theta, true = commands(14, 7), built(3)
    m = measured(theta, true, 8, SOFT)
    whole = pk.identify(ARM, m, prior=1.0, **UNKNOWN)
    changed = pk.Sag().of_machine(as_machine(ARM))
    quick = compared_by_poses(whole.fit, [changed])
    squares = np.zeros(2)
    for k in range(14):
        out = np.arange(42) // 3 == k
        for j, effects in enumerate(((), (pk.Sag(),))):
            found = pk.identify(ARM, m.select(~out), holdout=m.select(out), prior=1.0,
                                effects=effects, **UNKNOWN)  # fmt: skip
            squares[j] += found.holdout_rms**2
    np.testing.assert_allclose([quick.before, quick.after], np.sqrt(squares / 14), rtol=0.1)


def test_the_verdict_suggests_sag_with_the_gain_that_it_has() -> None:
    stiff = 0.2 * SOFT
    m = measured(commands(40, 11), built(4), 12, stiff)
    rigid = pk.identify(ARM, m, **UNKNOWN)
    (said,) = [each for each in rigid.verdict.said if "gravity" in each.text or "sag" in each.text]
    assert "error at poses left out" in said.text and "--effects sag" in said.text
    assert not [each for each in rigid.verdict.said if each.check == "causes"]  # said once
    found = pk.identify(ARM, m, effects="auto", **UNKNOWN)
    assert any("the arm sags" in text for text in found.verdict.remarks)
    held = measured(commands(100, 13), built(4), 14, stiff)
    before = pk.identify(ARM, m, holdout=held, **UNKNOWN).holdout_rms
    after = pk.identify(ARM, m, holdout=held, effects="auto", **UNKNOWN).holdout_rms
    assert after < 0.9 * before


def test_sag_that_moves_the_numbers_makes_a_result_doubtful() -> None:
    """By more than their ±: the intervals of the rigid arm miss the true numbers."""
    true = built(4)
    rigid = pk.identify(ARM, measured(commands(40, 11), true, 12, SOFT, frame=NOWHERE))
    (said,) = [each for each in rigid.verdict.said if each.check == "sag-lacking"]
    assert said.level == "doubt" and rigid.verdict.state == "doubtful"
    assert "times their ±" in said.text
    place = [int(name[5]) * 6 - 6 + ERRORS.index(name.split(".")[1]) for name in rigid.free]
    truth, (low, high) = true.joint_errors.reshape(-1)[place], rigid.interval95.T
    known = np.isfinite(low)
    assert np.mean((low <= truth) & (truth <= high), where=known) < 0.9


@pytest.mark.parametrize(
    ("effect", "size", "name", "option"),
    [
        (pk.Harmonics(1), 5e-4, "eccentric encoder", "--effects harmonics=1@1"),
        (pk.Coupling([(6, 4)]), 2e-3, "coupled joints", "--effects coupling=6.4"),
    ],
)
def test_errors_of_gears_are_named(
    effect: pk.Harmonics, size: float, name: str, option: str
) -> None:
    """Of joint 1 and the wrist, which gravity hardly turns."""
    named = 0
    for seed in range(3):
        arm = effect.of_machine(as_machine(built(seed))).machine.arm
        of = [of.partition(".")[0] in ("drive1", "drive6", "coupling6") for of in arm.laws.names]
        arm = arm.with_laws(arm.laws.with_values(size * np.array(of)))
        found = pk.identify(ARM, measured(commands(60, seed), arm, seed), **UNKNOWN)
        texts = [each.text for each in found.verdict.said if each.check == "causes"]
        named += any(name in text and option in text for text in texts)
    assert named == 3


@pytest.mark.parametrize(("joint", "alike"), [(2, True), (3, False)])
def test_an_eccentric_encoder_is_named_beside_the_sag_that_looks_like_it(
    joint: int, alike: bool
) -> None:
    """The weight of its own link turns joint 2 of an upright arm by a wave of its angle alone.

    That of joint 3 goes by the sum of both angles: there sag explains no wave of one joint.
    """
    said = []
    for seed in range(3):
        arm = pk.Harmonics(1, joints=joint).of_machine(as_machine(built(seed))).machine.arm
        arm = arm.with_laws(arm.laws.with_values(1e-3 * np.ones(len(arm.laws.names))))
        found = pk.identify(ARM, measured(commands(60, seed), arm, seed), **UNKNOWN)
        said += [each.text for each in found.verdict.said if each.check == "sag-lacking"]
        if not alike:
            said += [each.text for each in found.verdict.said if each.check == "causes"]
    assert sum(f"harmonics=1@{joint}" in each for each in said) == 3


def test_sag_of_several_joints_is_not_taken_for_a_wave_of_one() -> None:
    soft = pk.identify(ARM, measured(commands(60, 11), built(4), 12, SOFT, frame=NOWHERE))
    (said,) = [each for each in soft.verdict.said if each.check == "sag-lacking"]
    assert "harmonics" not in said.text


@pytest.mark.parametrize("shared", [0.0, 0.05])
def test_a_rigid_arm_is_not_said_to_sag(shared: float) -> None:
    for seed in range(2):
        m = measured(commands(24, 20 + seed), built(seed), seed, shared=shared)
        found = pk.identify(ARM, m, effects="auto", **UNKNOWN)
        assert not any(name.startswith("sag") for name in found.free)
        assert not any(said.check == "sag-lacking" for said in found.verdict.said)


@pytest.mark.parametrize("effect", [pk.Sag(), pk.Sag("all"), pk.Harmonics(1)], ids=repr)
def test_fewer_equations_than_numbers_are_said_whatever_effects_bring(effect: object) -> None:
    """Priors of an effect's own numbers are no prior of the arm's."""
    m = measured(commands(5, 40), built(6), 41)
    found = pk.identify(ARM, m, effects=[effect], **UNKNOWN)
    assert found.verdict.state != "calibrated"
    assert any(said.check == "too-few-rows" for said in found.verdict.said)


def test_numbers_of_waves_that_a_grid_confuses_are_mirrored_ones_too() -> None:
    """On a grid of 36 steps a turn cosines of k and of |k ± 36 m| have the same values."""
    theta = np.arange(36) * 2 * np.pi / 36
    named = [int(each) for each in _alike(160, 36)]
    assert named == [124, 128, 164, 196, 200]
    for waves in named:
        ours, theirs = np.cos(160 * theta), np.cos(waves * theta)
        np.testing.assert_allclose(ours, theirs, atol=1e-9)


def test_nothing_is_taken_unasked() -> None:
    m = measured(commands(24, 30), built(5), 31, SOFT)
    found = pk.identify(ARM, m, **UNKNOWN)
    assert found.robot.laws is None
    assert not any(name.startswith("sag") for name in found.free)


def test_outliers_of_a_rigid_arm_that_sags_are_none() -> None:
    """Rows that a rigid arm contradicts fit once joints yield."""
    theta = commands(80, 40)
    m = measured(theta, built(6), 41, 3.0 * SOFT)
    assert not pk.identify(ARM, m, effects=[pk.Sag("all")], **UNKNOWN).outliers


def test_tied_compliances_are_found_and_tell_another_payload() -> None:
    """With masses known, the springs themselves are found."""
    true = built(7)
    weighed = JointLaws(JointPulls(ARM.axes, ARM.points, ARM.kinds, masses=MASSES, centres=CENTRES))
    arm = ARM.with_laws(weighed)
    m = measured(commands(60, 50), true, 51, SOFT)
    found = pk.identify(arm, m, effects=[pk.Sag((2, 3, 5), tied=True)], **UNKNOWN)
    names = [f"compliance{i}" for i in (2, 3, 5)]
    values = np.array([found.parameters[name]["value"] for name in names])
    sigma = np.array([found.parameters[name]["stderr"] for name in names])
    assert (np.abs(values - SOFT[[1, 2, 4]]) < 4 * sigma + 0.05 * SOFT[[1, 2, 4]]).all()
    assert (sigma < 0.2 * SOFT[[1, 2, 4]]).all()


def carried(kg: FloatArray, seed: int, true: pk.SerialArm) -> pk.Measurements:
    """One target under payloads by row, of joints with springs that carry links and payload."""
    theta = np.tile(commands(len(kg) // 2, seed), (2, 1))
    at = np.array([450.0, 0.0, 670.0])
    total = MASSES[5] + kg
    centre = (MASSES[5] * CENTRES[5] + kg[:, None] * at) / total[:, None]
    rest = np.empty_like(theta)
    for i in range(len(kg)):
        masses, centres = np.append(MASSES[:5], total[i]), np.vstack([CENTRES[:5], centre[i]])
        rest[i] = at_rest(
            lambda q, m=masses, c=centres: gravity_torques(true, q, m, c), theta[i : i + 1], SOFT
        )[0]
    m = pk.VirtualMachine(true, NOISE, seed=seed).measure(rest, "position", TARGETS[0])
    return replace(m, actuators=theta, load=pk.Load(kg, centre=(0, 0, 40)).rows(kg.shape))


def test_compliances_of_joints_are_found_by_payloads_alone() -> None:
    """No mass of a link is known: products take up their weight, and another payload is told."""
    true, names = built(11), [f"compliance{i}" for i in range(2, 7)]
    m = carried(np.repeat([0.0, 5.0], 40), 1, true)
    found = pk.identify(ARM, m, effects=[pk.Sag("all"), pk.Elasticity("joint*")])
    values = np.array([found.parameters[name]["value"] for name in names])
    sigma = np.array([found.parameters[name]["stderr"] for name in names])
    assert (np.abs(values - SOFT[1:]) < 4 * sigma + 0.01 * SOFT[1:]).all()
    assert (sigma[:4] < 0.1 * SOFT[1:5]).all()
    assert "compliance1" in found.unidentifiable  # nothing turns it
    assert found.parameters["compliance1"]["value"] == 0.0
    held = carried(np.repeat([2.5, 9.0], 20), 2, true)
    again = pk.identify(ARM, m, effects=[pk.Sag("all"), pk.Elasticity("joint*")], holdout=held)
    assert again.holdout_rms < 1.3 * np.sqrt(3) * NOISE
    assert again.verdict.state == "calibrated"
    alone = pk.identify(ARM, m, effects=[pk.Sag("all")], holdout=held)
    assert alone.holdout_rms > 10 * again.holdout_rms
    (said,) = [each for each in alone.verdict.reasons if "residuals follow the loads" in each]
    assert "--effects 'elasticity=joint*'" in said


def test_a_prior_of_lengths_does_not_bind_compliances_of_joints() -> None:
    """As it does not bind those of limbs: a compliance is no length."""
    m, effects = carried(np.repeat([0.0, 5.0], 40), 1, built(11)), [pk.Elasticity("joint*")]
    free, tight = (pk.identify(ARM, m, effects=effects, prior=prior) for prior in (10.0, 0.3))
    for name in (f"compliance{i}" for i in range(2, 7)):
        one, other = free.parameters[name], tight.parameters[name]
        assert abs(one["value"] - other["value"]) < one["stderr"]


def test_advice_under_two_payloads_ends_with_all_that_yields() -> None:
    """Each advice taken in turn: none names waves that are not there, the last leaves nothing."""
    m = carried(np.repeat([0.0, 5.0], 40), 1, built(11))
    for begin in ((), (pk.Elasticity("joint*"), pk.Sag(2))):
        arguments: dict[str, Any] = {"effects": begin}
        for _ in range(4):
            found = pk.identify(ARM, m, **arguments)
            said = found.verdict.said
            remedies = [one for each in said for one in each.remedies if one.argument == "effects"]
            assert not any(each.check in ("waves", "causes") for each in said)
            if not remedies:
                break
            assert found.verdict.state == "doubtful"
            arguments = remedies[0].applied(arguments)
        options = {each.option for each in arguments["effects"]}
        assert options in ({"elasticity=joint*", name} for name in ("sag", "sag=all"))
        assert found.verdict.state == "calibrated"


def test_sag_of_all_joints_is_named_where_that_of_two_does_not_help() -> None:
    """A wrist that yields on an arm whose main joints do not."""
    wrist = np.array([0.0, 0.0, 0.0, 0.0, 400.0, 400.0]) * 1e-8
    m = measured(commands(40, 90), built(12), 91, wrist, frame=NOWHERE)
    (said,) = [each for each in pk.identify(ARM, m).verdict.said if each.check == "sag-lacking"]
    assert "--effects sag=all" in said.text and said.level == "doubt"


def test_numbers_move_by_sag_as_far_as_is_said() -> None:
    """By the linear model at the rigid arm's solution, as by another fit."""
    m = measured(commands(40, 11), built(4), 12, 0.2 * SOFT, frame=NOWHERE)
    rigid, soft = pk.identify(ARM, m), pk.identify(ARM, m, effects=[pk.Sag()])
    finding = sag_that_helps(rigid.fit)
    assert finding is not None and finding.effect == pk.Sag()
    known = [name for name in rigid.free if np.isfinite(rigid.parameters[name]["stderr"])]
    moved = [
        (soft.parameters[name]["value"] - rigid.parameters[name]["value"])
        / rigid.parameters[name]["stderr"]
        for name in known
    ]
    np.testing.assert_allclose(finding.comparison.shift, np.sqrt(np.mean(np.square(moved))), 0.02)


def test_sag_alone_may_be_found() -> None:
    """Of an arm whose errors are known: nothing else moves."""
    m = measured(commands(40, 11), ARM, 12, 0.2 * SOFT, frame=NOWHERE)
    found = pk.identify(ARM, m, fix="joint*", effects=[pk.Sag("all")])
    assert found.verdict.state == "calibrated"
    assert any("the arm sags" in each for each in found.verdict.remarks)


def test_the_arm_without_laws_is_the_better_of_two() -> None:
    m = measured(commands(40, 60), built(8), 61, SOFT)
    found = pk.identify(ARM, m, effects=[pk.Sag()], **UNKNOWN)
    better = rigid_arm(found)
    assert better is not None and better.arm.laws is None
    alone = pk.identify(ARM, m, **UNKNOWN).robot
    assert better.refitted == (better.comparison.before < better.comparison.alone)
    if better.refitted:
        np.testing.assert_allclose(better.arm.joint_errors, alone.joint_errors, atol=1e-6)
    assert rigid_arm(pk.identify(ARM, m, **UNKNOWN)) is None


def test_gears_are_found_with_their_waves() -> None:
    true = built(9).with_terms([Term(2, "cos", 2.0), Term(2, "sin", 2.0), Term(5, "coupling", 4)])
    numbers = np.array([4e-4, -3e-4, 2e-3])
    true = true.with_laws(true.laws.with_values(numbers))
    m = measured(commands(80, 70), true, 71)
    effects = [pk.Harmonics(2, joints=3), pk.Coupling([(6, 5)])]
    found = pk.identify(ARM, m, effects=effects, **UNKNOWN)
    names = ("drive3.cos2", "drive3.sin2", "coupling6.5")
    for name, value in zip(names, numbers, strict=True):
        own = found.parameters[name]
        assert abs(own["value"] - value) < 4 * own["stderr"] < abs(value)


def test_linked_axes_of_a_palletiser_are_found_and_undone(tmp_path: Path) -> None:
    """A forearm that keeps its angle as the upper arm turns, by a ratio that is a little off."""
    ARM.save(tmp_path / "arm.toml")
    head, *joints = (tmp_path / "arm.toml").read_text(encoding="utf-8").split("[[joint]]\n")
    joints[2] = "drive = { coupled = [{ joint = 2, by = -1.0 }] }\n" + joints[2]
    (tmp_path / "linked.toml").write_text("[[joint]]\n".join([head, *joints]), encoding="utf-8")
    linked = pk.load(tmp_path / "linked.toml")
    assert linked.joint_laws.names == ("coupling3.2",)
    ratio = -1.0003
    true = linked.replace(built(15).joint_errors)
    true = true.with_laws(true.laws.with_values(np.array([ratio])))
    theta = commands(80, 100)
    m = pk.VirtualMachine(true, NOISE, seed=101).measure(theta, "position", TARGETS[0])
    found = pk.identify(linked, m, effects=[pk.Coupling([(3, 2)])])
    own = found.parameters["coupling3.2"]
    assert abs(own["value"] - ratio) < 4 * own["stderr"] < 1e-4
    assert pk.identify(linked, m).rms > 1.4 * found.rms
    tool = found.robot.forward(theta)
    again = found.robot.inverse(tool, guess=theta + 1e-2)
    assert again.ok.all()
    np.testing.assert_allclose(found.robot.forward(again.theta), tool, atol=1e-9)


def test_backlash_is_found_from_where_joints_came() -> None:
    theta = commands(80, 80)
    way = np.random.default_rng(0).choice([-1.0, 1.0], theta.shape)
    true = built(10).with_terms([Term(1, "backlash")])
    true = true.with_laws(true.laws.with_values(np.array([8e-4])))
    plain = measured(theta, true.approaching(way), 81)
    m = replace(plain, approach=np.repeat(way, 3, axis=0))
    found = pk.identify(ARM, m, effects=[pk.Backlash(2)], **UNKNOWN)
    own = found.parameters["drive2.backlash"]
    assert abs(own["value"] - 8e-4) < 4 * own["stderr"] < 4e-4


def test_which_products_there_are_does_not_depend_on_what_was_measured() -> None:
    main, every = (pk.Sag(which).of_machine(ArmMachine(ARM)).free for which in ("main", "all"))
    assert tuple(main) == (
        "sag2.link2.x", "sag2.link2.z", "sag2.link3.x", "sag2.link3.z",
        "sag3.link3.x", "sag3.link3.z",
    )  # fmt: skip
    assert set(main) < set(every)
    assert not any(name.startswith("sag1") for name in every)  # gravity does not turn it


@pytest.mark.parametrize(
    "effect, machine, message",
    [
        (pk.Sag(), pk.load("hexapod"), "sag: .* is no serial arm"),
        (pk.Sag(1), ARM, "sag: gravity turns joints 2, 3, 4, 5, 6; found 1"),
        (pk.Sag("most"), ARM, 'joints are "main", "all" or numbers'),
        (pk.Sag(tied=True), ARM, "sag: tied needs masses"),
        (pk.Sag(turns=-1.0), ARM, "turns must be"),
        (pk.Harmonics([]), ARM, "waves: different numbers above 0"),
        (pk.Harmonics(1), pk.load("hexapod"), "harmonics: .* drive laws in the robot file"),
        (pk.Coupling([(5, 5)]), ARM, "joints: different ones"),
        (pk.Backlash(7), ARM, "joints: different ones, 1 to 6; found 7"),
    ],
)
def test_what_cannot_be_is_refused(effect: object, machine: object, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        effect.of_machine(as_machine(machine))


def test_waves_of_harmonic_drives_are_named_by_joint() -> None:
    """Twice the ratio, of amplitudes that were found on a real arm, once sag is modelled."""
    waves, sizes = (240.0, 242.0, 200.0), np.array([60.0, 60.0, 90.0]) * 1e-6
    true = built(1).with_terms([Term(i, "cos", k) for i, k in enumerate(waves)])
    true = true.with_laws(true.laws.with_values(sizes))
    m = measured(commands(250, 1), true, 2, SOFT, shared=0.02)
    found = pk.identify(ARM, m, effects=[pk.Sag("all")], unknown="frame")
    named = scan_waves(found)
    assert [(wave.joint, wave.waves) for wave in named] == [(1, 240), (2, 242), (3, 200)]
    np.testing.assert_allclose([wave.size for wave in named], sizes, rtol=0.5)
    assert any("--effects harmonics=200@3" in text for text in found.verdict.remarks)


def test_no_waves_are_named_where_there_are_none() -> None:
    m = measured(commands(120, 2), built(2), 3, SOFT, shared=0.03)
    assert not scan_waves(pk.identify(ARM, m, effects=[pk.Sag("all")], unknown="frame"))


def test_waves_that_a_regular_grid_cannot_tell_apart_are_said() -> None:
    """At steps of 10 deg 200 waves look like 20."""
    theta = commands(150, 4)
    theta[:, 2] = np.radians(10.0) * np.round(theta[:, 2] / np.radians(10.0))
    true = built(3).with_terms([Term(2, "cos", 200.0)])
    true = true.with_laws(true.laws.with_values(np.array([3e-4])))
    m = measured(theta, true, 5, SOFT)
    found = pk.identify(ARM, m, effects=[pk.Sag("all")], unknown="frame")
    (wave,) = scan_waves(found)
    assert wave.joint == 3
    alike = [(wave.waves + sign * 200 + 18) % 36 - 18 for sign in (-1, 1)]
    assert min(map(abs, alike)) <= 3  # which the joint's range does not tell apart
    assert wave.steps == pytest.approx(np.radians(10.0))
    assert any("look alike" in text for text in found.verdict.remarks)
