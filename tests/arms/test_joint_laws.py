"""What joints add to their commands: sag, gears, couplings, backlash, and the keys of files."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pkmcal as pk
from pkmcal.arms.joint_laws import JointLaws, Term, sag_term
from pkmcal.arms.joint_pulls import Balancer, JointPulls
from pkmcal.arms.weights import gravity_products, gravity_torques
from pkmcal.kinematics.arm_machine import ArmMachine

AXES = [[0, 0, 1], [0, 1, 0], [0, 1, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0]]
POINTS = [[0, 0, 0], [0, 0, 290], [0, 0, 560], [0, 0, 630], [302, 0, 630], [374, 0, 630]]
HOME = [450, 0, 630, 0, 0, 0]
SIX = pk.SerialArm(AXES, POINTS, HOME, name="six")
MASSES = np.array([3.0, 4.0, 3.5, 1.5, 0.8, 0.3])
CENTRES = np.array(
    [[0, 0, 200], [10, 20, 420], [50, 0, 620], [200, 0, 630], [320, 0, 640], [380, 10, 630]], float
)
TERMS = {
    sag_term(1, 1, 0): 2e-3,
    sag_term(1, 2, 2): -1e-3,
    sag_term(2, 4, 0): 1e-3,
    sag_term(4, 5, 1): 7e-4,
    Term(0, "cos", 2.0): 1e-3,
    Term(2, "sin", 20.0): 3e-4,
    Term(4, "coupling", 3): 2e-2,
    Term(1, "backlash"): 1e-3,
    Term(2, "compliance"): 4e-8,
}


def lawful(arm: pk.SerialArm = SIX, seed: int = 0) -> pk.SerialArm:
    rng = np.random.default_rng(seed)
    pulls = JointPulls(arm.axes, arm.points, arm.kinds, masses=MASSES, centres=CENTRES)
    laws = JointLaws(pulls, TERMS)
    return arm.replace(rng.normal(size=(6, 6)) * [1, 1, 1, 3e-3, 3e-3, 3e-3]).with_laws(laws)


def loaded(rows: int = 8, seed: int = 0) -> pk.SerialArm:
    """With a balancer, and another load at the tool in each row."""
    rng = np.random.default_rng(seed)
    arm = lawful(seed=seed).yielding({2: 3e-8, 4: 2e-7, 6: 4e-7})
    balancer = Balancer((-80.0, 10.0, 250.0), (90.0, 0.0, 500.0), 12.0, 150.0)
    laws = arm.joint_laws
    arm = arm.with_laws(replace(laws, pulls=replace(laws.pulls, balancers={1: balancer})))
    load = pk.Load(
        rng.uniform(0, 9, rows), rng.normal(0, 60, (rows, 3)), rng.normal(0, 50, (rows, 3)),
        rng.normal(0, 9e3, (rows, 3)),
    )  # fmt: skip
    return arm.under(load)


def thetas(count: int = 8, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-1.5, 1.5, (count, 6))


def test_joints_stand_where_the_laws_say() -> None:
    """By the formulas of `weights`, which compute torques by another way, and by hand."""
    arm, theta, approach = lawful(), thetas(), np.ones(6)
    products = gravity_products(SIX, theta)
    torques = gravity_torques(SIX, theta, MASSES, CENTRES)
    moved = theta.copy()
    moved[:, 0] += 1e-3 * np.cos(2 * theta[:, 0])
    moved[:, 1] += 2e-3 * products[:, 1, 1, 0] - 1e-3 * products[:, 1, 2, 2] - 0.5e-3
    moved[:, 2] += 1e-3 * products[:, 2, 4, 0] + 3e-4 * np.sin(20 * theta[:, 2])
    moved[:, 2] += 4e-8 * torques[:, 2]
    moved[:, 4] += 7e-4 * products[:, 4, 5, 1] + 2e-2 * theta[:, 3]
    found = arm.approaching(approach).forward(theta)
    np.testing.assert_allclose(found, arm.rigid.forward(moved), rtol=0, atol=1e-9)


@pytest.mark.parametrize("arm", [lawful(), loaded(4)], ids=["lawful", "loaded"])
def test_the_jacobian_is_the_change_of_the_tool_with_the_commands(arm: pk.SerialArm) -> None:
    theta = thetas(4)
    by_joints, step = arm.jacobian(theta, frame="tip"), 1e-6
    for k in range(6):
        ends = [arm.forward(theta + sign * step * np.eye(6)[k]) for sign in (1, -1)]
        np.testing.assert_allclose(
            by_joints[:, :, k], _twist(*ends, arm.forward(theta)) / (2 * step), rtol=0, atol=2e-5
        )


def test_derivatives_by_all_numbers_are_those_of_the_tool() -> None:
    machine, theta = ArmMachine(lawful().approaching(np.ones(6))), thetas(3)
    values = machine.geometry.values
    assert len(values) == 36 + len(TERMS) == len(machine.geometry.names)
    by_numbers = machine.error_twists(theta, theta)
    for k, unit in enumerate(machine.geometry.units):
        step = {"mm": 1e-4, "rad": 1e-6, "1": 1e-6}.get(unit, 1e-11)
        change = step * np.eye(len(values))[k]
        ends = [machine.replace(values + sign * change).arm.forward(theta) for sign in (1, -1)]
        twist = _twist(*ends, machine.arm.forward(theta)) / (2 * step)
        scale = max(1.0, float(np.abs(twist).max()))
        np.testing.assert_allclose(by_numbers[:, :, k], twist, rtol=0, atol=3e-6 * scale)


def _twist(one: np.ndarray, other: np.ndarray, here: np.ndarray) -> np.ndarray:
    """Turning, then shift of the tool's origin, from another motion to one."""
    turn = np.tile(np.eye(4), (len(one), 1, 1))
    turn[:, :3, :3] = one[:, :3, :3] @ other[:, :3, :3].transpose(0, 2, 1)
    return np.hstack([pk.screw.log(turn)[:, :3], (one - other)[:, :3, 3]])


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 1000))
def test_the_inverse_leads_to_the_target_with_laws(seed: int) -> None:
    arm, theta = loaded(5, seed).approaching(np.tile([1, -1, 0, 1, 0, -1], (5, 1))), thetas(5, seed)
    target = arm.forward(theta)
    found = arm.inverse(target, guess=theta + 1e-2)
    good = found.ok
    assert good.mean() > 0.5
    assert np.abs(arm.forward(found.theta) - target)[good].max() < 1e-8


@pytest.mark.parametrize("arm", [lawful(), loaded().under(None)], ids=["lawful", "loaded"])
def test_files_keep_laws_to_the_last_bit(arm: pk.SerialArm, tmp_path: Path) -> None:
    arm.save(tmp_path / "arm.toml")
    again = pk.load(tmp_path / "arm.toml")
    assert again.laws.terms == arm.laws.terms
    assert again.laws.values.tobytes() == arm.laws.values.tobytes()
    assert again.forward(thetas()).tobytes() == arm.forward(thetas()).tobytes()
    again.save(tmp_path / "again.toml")
    assert (tmp_path / "again.toml").read_bytes() == (tmp_path / "arm.toml").read_bytes()


def test_an_arm_without_laws_is_as_it_was(tmp_path: Path) -> None:
    assert SIX.laws is None and SIX.rigid is SIX
    SIX.save(tmp_path / "arm.toml")
    assert "drive" not in (tmp_path / "arm.toml").read_text()
    none = SIX.with_laws(JointLaws(JointPulls(SIX.axes, SIX.points, SIX.kinds)))
    assert none.forward(thetas()).tobytes() == SIX.forward(thetas()).tobytes()
    assert none.jacobian(thetas()).tobytes() == SIX.jacobian(thetas()).tobytes()


def test_an_arm_with_its_errors_built_in_stands_where_it_stood() -> None:
    arm = lawful()
    np.testing.assert_allclose(arm.corrected().forward(thetas()), arm.forward(thetas()), atol=1e-9)


TEXT = """name = "two"
units = { length = "mm", angle = "deg" }
[tool]
home = { x = 500.0 }
[[joint]]
kind = "revolute"
axis = [0, 1, 0]
point = [0.0, 0.0, 0.0]
drive = %s
[[joint]]
kind = "%s"
axis = [0, 1, 0]
point = [300.0, 0.0, 0.0]
"""


def test_numbers_of_files_are_in_their_units(tmp_path: Path) -> None:
    drive = "{ sag = [{ link = 2, x = 0.1 }], coupled = [{ joint = 2, by = -1.0 }] }"
    (tmp_path / "arm.toml").write_text(TEXT % (drive, "revolute"))
    laws = pk.load(tmp_path / "arm.toml").laws
    assert laws.names == ("sag1.link2.x", "coupling1.2")
    np.testing.assert_allclose(laws.values, [np.radians(0.1), -1.0], rtol=1e-15)


@pytest.mark.parametrize(
    "drive, other, message",
    [
        (
            "{ sag = [{ link = 3, x = 0.1 }] }",
            "revolute",
            r"line 9: .*link: must be one beh",
        ),
        ("{ sags = 1 }", "revolute", "unknown key 'sags' of a joint's drive; did you mean 'sag'"),
        ("{ compliance = 1e-9 }", "revolute", "compliance1: needs the mass and the centre"),
        ("{ coupled = [{ joint = 1, by = 1 }] }", "revolute", "must be another one"),
        ("{ coupled = [{ joint = 2, by = 1 }] }", "prismatic", "both turn, or both slide"),
        ("{ harmonics = [{ k = -1.0, cos = 0.1 }] }", "revolute", "waves must be above 0"),
        ("{ sag = [{ link = 2, x = nan }] }", "revolute", "must be finite"),
    ],
)
def test_mistakes_in_files_are_named(tmp_path: Path, drive: str, other: str, message: str) -> None:
    (tmp_path / "arm.toml").write_text(TEXT % (drive, other))
    with pytest.raises(ValueError, match=message):
        pk.load(tmp_path / "arm.toml")


def test_gravity_of_a_file_turns_what_it_turns(tmp_path: Path) -> None:
    """On a wall the same arm sags about the axis that stood upright."""
    text = TEXT % ("{ sag = [{ link = 1, x = 0.1 }] }", "revolute")
    (tmp_path / "arm.toml").write_text(text.replace("[0, 1, 0]", "[0, 0, 1]"))
    (tmp_path / "wall.toml").write_text(
        "gravity = [0, 9.81, 0]\n" + (tmp_path / "arm.toml").read_text()
    )
    standing, hanging = pk.load(tmp_path / "arm.toml"), pk.load(tmp_path / "wall.toml")
    at = np.zeros(2)
    assert (standing.forward(at) == standing.rigid.forward(at)).all()
    assert hanging.forward(at)[1, 3] == pytest.approx(500 * np.sin(np.radians(0.1)), rel=1e-6)


def test_a_load_turns_joints_by_the_work_that_it_does() -> None:
    """τ = Jᵀw by the core's twists of a rigid arm, and rows by themselves."""
    rng, theta = np.random.default_rng(5), thetas(6)
    mass, centre = rng.uniform(0, 9, 6), rng.normal(0, 60, (6, 3))
    force, moment = rng.normal(0, 50, (6, 3)), rng.normal(0, 9e3, (6, 3))
    soft = np.array([2.0, 3.0, 4.0, 9.0, 8.0, 7.0]) * 1e-8
    plain = SIX.yielding(dict(enumerate(soft, 1)))
    weight = mass[:, None] * [0, 0, -9.80665]
    away = np.einsum("nij,nj->ni", SIX.forward(theta)[:, :3, :3], centre)
    wrench = np.hstack([moment + np.cross(away, weight), force + weight])
    torque = np.einsum("nki,nk->ni", SIX.jacobian(theta, frame="tip"), wrench)
    found = plain.under(pk.Load(mass, centre, force, moment))
    wanted = SIX.forward(theta + soft * torque)
    np.testing.assert_allclose(found.forward(theta), wanted, rtol=0, atol=1e-9)
    for i in range(6):
        one = plain.under(pk.Load(mass[i], centre[i], force[i], moment[i])).forward(theta[i])
        np.testing.assert_allclose(one, wanted[i], rtol=0, atol=1e-9)
    np.testing.assert_array_equal(plain.forward(theta), SIX.forward(theta))  # without masses


def test_a_balancer_turns_its_joint_by_the_energy_that_it_has() -> None:
    balancer = Balancer((-80.0, 10.0, 250.0), (90.0, 0.0, 500.0), 12.0, 150.0)
    pulls = JointPulls(SIX.axes, SIX.points, SIX.kinds, balancers={1: balancer})
    theta = np.zeros((7, 6))
    theta[:, 1] = np.linspace(-2, 2, 7)

    def energy(angle: np.ndarray) -> np.ndarray:
        turned = pk.SerialArm([AXES[1]], [POINTS[1]], [*balancer.link, 0, 0, 0])
        way = turned.forward(angle[:, None])[:, :3, 3] - balancer.base
        return 0.5 * balancer.rate * (np.linalg.norm(way, axis=1) - balancer.free) ** 2

    step = 1e-5
    slope = -(energy(theta[:, 1] + step) - energy(theta[:, 1] - step)) / (2 * step)
    laws = JointLaws(pulls, {}).weighing(np.zeros(6), SIX.points)
    arm = SIX.with_laws(laws).yielding({2: 1e-8})
    wanted = theta.copy()
    wanted[:, 1] += 1e-8 * slope
    np.testing.assert_allclose(arm.forward(theta), SIX.forward(wanted), rtol=0, atol=1e-7)


def test_stiffness_of_files_is_what_its_compliance_is(tmp_path: Path) -> None:
    """20 kN m/rad, in an arm of 2 kg with its centre 300 mm out: 5.88 N m turn it by 0.294 mrad."""
    one = """name = "one"
units = { length = "mm", angle = "deg" }
[tool]
home = { x = 600.0 }
[[joint]]
kind = "revolute"
axis = [0, 1, 0]
point = [0, 0, 0]
mass = 2.0
centre = [300, 0, 0]
"""
    (tmp_path / "arm.toml").write_text(one + "stiffness = 2.0e4\n")
    arm = pk.load(tmp_path / "arm.toml")
    assert arm.forward([0.0])[2, 3] == pytest.approx(-600 * 2 * 9.80665 * 0.3 / 2e4, rel=1e-6)
    again = one + "drive = { compliance = 5.0e-8 }\n"
    (tmp_path / "again.toml").write_text(again)
    np.testing.assert_array_equal(pk.load(tmp_path / "again.toml").forward([0]), arm.forward([0]))
    for wrong, message in (
        ("stiffness = -1.0", "stiffness: must be above 0"),
        ("stiffness = 2e4\ndrive = { compliance = 1e-8 }", "stiffness already"),
        ("balancer = {base = [0, 0, 1], link = [0, 0, 2], rate = -1, free = 0 }", "rate: must not"),
        ("balancer = { base = [0, 0, 1], link = [0, 0, 2] }", "rate"),
    ):
        (tmp_path / "wrong.toml").write_text(one + wrong)
        with pytest.raises(pk.FileError, match=message):
            pk.load(tmp_path / "wrong.toml")


@pytest.mark.parametrize("call", ["forward", "jacobian", "inverse"])
def test_loads_are_as_many_as_rows(call: str) -> None:
    arm, theta = loaded(rows=4), np.full((3, 6), 0.3)
    asked = SIX.forward(theta) if call == "inverse" else theta
    with pytest.raises(ValueError, match="load is of 4 rows, but 3 were asked for"):
        getattr(arm, call)(asked)


def test_stiffness_of_an_arm_is_what_small_forces_do_to_it() -> None:
    """Against differences of the arm under load; and one joint against its lever by hand."""
    arm = lawful().yielding({1: 2e-8, 2: 3e-8, 4: 2e-7, 5: 3e-7, 6: 4e-7}).replace(np.zeros((6, 6)))
    rng = np.random.default_rng(3)
    theta, at = rng.uniform(-1.2, 1.2, (4, 6)), np.array([20.0, -10.0, 60.0])
    load = pk.Load(4.0, (0.0, 10.0, 50.0))
    found = pk.stiffness(arm, theta, load=load, at=at).compliance
    here = arm.under(load).forward(theta)
    for k in range(3):
        force = np.eye(3)[k] * 1e-2
        lever = here[:, :3, :3] @ at
        moment = np.cross(lever, force)
        ends = [
            arm.under(pk.Load(np.full(4, 4.0), (0.0, 10.0, 50.0), sign * np.tile(force, (4, 1)),
                              sign * moment)).forward(theta)
            for sign in (1.0, -1.0)
        ]  # fmt: skip
        places = [each[:, :3, :3] @ at + each[:, :3, 3] for each in ends]
        moved = (places[0] - places[1]) / 2e-2
        np.testing.assert_allclose(found[:, 3:, 3 + k], moved, atol=0.02 * np.abs(moved).max())
    one = pk.SerialArm([[0, 1, 0]], [[0, 0, 0]], [600, 0, 0, 0, 0, 0]).yielding({1: 2e-8})
    assert pk.stiffness(one, [0.0]).along([0, 0, 1]) == pytest.approx(600.0**2 * 2e-8)
    with pytest.raises(ValueError, match="nothing of six yields"):
        pk.stiffness(SIX, theta)


def test_the_table_of_static_compliance_of_an_arm_is_that_of_forces_on_it() -> None:
    arm = pk.SerialArm([[0, 1, 0]], [[0, 0, 0]], [600, 0, 0, 0, 0, 0]).yielding({1: 2e-8})
    table = pk.compliance_table(arm, [0.3], rated=200.0)
    turned = 2e-8 * 600.0 * np.cos(0.3) * 200.0  # rad, about y: a force down turns by more
    np.testing.assert_allclose(
        table.displacement[4, 9], 600.0 * np.array([
            np.cos(0.3 - turned) - np.cos(0.3), 0.0, -np.sin(0.3 - turned) + np.sin(0.3)
        ]), atol=1e-9,
    )  # fmt: skip
    np.testing.assert_allclose(table.displacement[2:4], 0.0, atol=1e-12)


def test_a_stiffness_in_place_of_a_compliance_is_refused() -> None:
    with pytest.raises(ValueError, match=r"joint 1 is 400000.* its compliance is 2\.5e-09"):
        SIX.yielding({1: 4e5})
    with pytest.raises(ValueError, match=r"offset\* is 20000.* its compliance is 5e-05"):
        pk.load("hexapod").yielding({"offset*": 2e4})
