"""Limbs of other kinds beside chains: the same machine, whichever of its limbs are chains."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.exceptions import FileError
from pkmcal.geometry import robot_file
from tests.chain_files import as_chains
from tests.kinematics.test_chains import commands, loaded

NAMES = ("hexapod", "rbt-6t03p", "6-rus", "3rps", "3prs", "3rrr-planar", "linear-delta-6")
CONES = """
base_cone = { axis = [0.1, 0.2, 1.0], angle = 0.6 }
platform_cone = { axis = [0.2, -0.1, 0.9], angle = 0.8 }
"""


def limbs_of(text: str) -> tuple[str, list[str]]:
    head, *limbs = text.split("[[limb]]\n")
    return head, limbs


def written(robot: pk.Robot, folder: Path) -> tuple[str, list[str]]:
    """The robot file in mm and rad: what is above its limbs, without numbers' names, and these."""
    robot.save(folder / "written.toml")
    head, limbs = limbs_of((folder / "written.toml").read_text(encoding="utf-8"))
    return re.sub(r"\[(calibration|stated)\]\n(.+\n)*", "", head), limbs


def mixed(robot: pk.Robot, chains: set[int], folder: Path) -> pk.Robot:
    """The machine with some of its limbs as chains."""
    head, limbs = written(robot, folder)
    other = limbs_of(as_chains(robot))[1]
    chosen = [other[i] if i in chains else limb for i, limb in enumerate(limbs)]
    return loaded(head + "".join("[[limb]]\n" + limb for limb in chosen), folder)


@pytest.mark.parametrize("name", NAMES)
def test_any_limbs_of_a_machine_may_be_chains(name: str, tmp_path: Path) -> None:
    robot = pk.load(name)
    q = commands(robot, 60, share=0.5)
    pose = robot.forward(q).pose
    assert np.isfinite(pose).all()
    for chains in ({0}, {1, 2}):
        other = mixed(robot, chains, tmp_path)
        found = other.forward(q)
        assert other.model.chains is not None and found.ok.all()
        assert np.abs(found.pose - pose).max() < 1e-10
        assert np.abs(other.inverse(pose) - q).max() < 1e-9
        twists, exact = (each.actuator_twists(pose, q) for each in (other, robot))
        assert np.abs(twists - exact).max() < 1e-9 * np.abs(exact).max()


@pytest.mark.parametrize("name", ("hexapod", "rbt-6t03p", "6-rus"))
def test_numbers_of_a_limb_beside_chains_are_kept(name: str, tmp_path: Path) -> None:
    """Points, tilts, lengths, offsets and gains as the file states them."""
    robot = pk.load(name)
    rng = np.random.default_rng(1)
    sizes = {"mm": 1.0, "rad": 0.02, "1": 0.01}
    named = zip(robot.geometry.names, robot.geometry.units, strict=True)
    ideal = re.compile(r"(offset|gain)1|.*1\.tilt\d")  # what the chain of `as_chains` has not
    changes = {
        n: robot.geometry[n] + sizes[unit] * rng.uniform(-1, 1)
        for n, unit in named
        if not ideal.fullmatch(n)
    }
    robot = robot.replace(changes)
    q = commands(robot, 40, share=0.5)
    found, exact = mixed(robot, {0}, tmp_path).forward(q), robot.forward(q)
    assert found.ok.all() and exact.ok.all()
    assert np.abs(found.pose - exact.pose).max() < 1e-10


def test_limits_of_a_limb_beside_chains_are_kept(tmp_path: Path) -> None:
    """Strokes, and cones whose middle is not where the limb is at home."""
    robot = pk.load("rbt-6t03p")
    head, limbs = written(robot, tmp_path)
    middle = float(robot.inverse(robot.home)[0])
    stroke = f"stroke = [{middle - 20.0}, {middle + 25.0}]\n"
    bent = [re.sub(r"(stroke|\w+_cone) = .*\n", "", limb) for limb in limbs]
    bent = [CONES + stroke + limb for limb in bent]
    robot = loaded(head + "".join("[[limb]]\n" + limb for limb in bent), tmp_path)
    chain = limbs_of(as_chains(robot))[1][0]
    other = loaded(head + "".join("[[limb]]\n" + x for x in [chain, *bent[1:]]), tmp_path)
    q = commands(robot, 40)
    pose = robot.forward(q).pose
    a, b = robot.feasible(pose, q), other.feasible(pose, q)
    for margin in ("stroke_margin", "base_cone_margin", "platform_cone_margin"):
        one, two = (getattr(found, margin)[:, 1:] for found in (a, b))
        assert np.isfinite(one).all() and np.abs(one - two).max() < 1e-9
    assert 0 < a.stroke[:, 1:].mean() < 1
    other.save(tmp_path / "again.toml")
    again = pk.load(tmp_path / "again.toml").feasible(pose, q)
    assert again.base_cone_margin.tobytes() == b.base_cone_margin.tobytes()


def test_a_leg_that_keeps_to_a_plane_of_the_platform_is_u_p_r(tmp_path: Path) -> None:
    """The 2TPR&2TPS with its revolute legs as kinds with a couple length, beside its chains."""
    robot = pk.load("2tpr2tps-chains")
    head, limbs = limbs_of(robot_file.located("2tpr2tps-chains")[0].decode())
    legs = [
        f"""kind = "TPR"
actuator = {k}
base = [0.0, {base}, 0.0]
platform = [0.0, {platform}, 0.0]
universal = [0, 1, 0]
revolute = [1, 0, 0]
couple = 100.0
"""
        for k, base, platform in ((3, 139.25, 100.0), (4, -139.25, -100.0))
    ]
    other = loaded(head + "".join("[[limb]]\n" + x for x in limbs[:2] + legs), tmp_path)
    q = commands(robot, 20)
    found, exact = other.forward(q), robot.forward(q)
    assert exact.ok.all() and np.abs(found.pose - exact.pose).max() < 1e-9
    errors = {f"limb{i}.joint{k}.dy": 0.1 * i - 0.05 * k for i in (3, 4) for k in (1, 3)}
    errors |= {"limb3.joint1b.dphi": 1e-3, "limb4.platform.dpsi": -1e-3}
    found, exact = (each.replace(errors).forward(q) for each in (other, robot))
    assert np.abs(found.pose - exact.pose).max() < 1e-9


def test_a_leg_without_a_couple_is_s_p_r(tmp_path: Path) -> None:
    """Three of them hold a platform in space: all as kinds, and one written as its joints."""
    head = 'name = "3-SPR"\nunits = { length = "mm", angle = "deg" }\n[pose]\nmap = "spatial"\n'
    head += "home = { z = 600.0 }\n"
    kinds, chain = [], ""
    for i in range(3):
        c, s = (float(f(2 * np.pi * i / 3)) for f in (np.cos, np.sin))
        base, tip, axis = [150 * c, 150 * s, 0.0], [250 * c, 250 * s, 0.0], [-s, c, 0.0]
        place = f"base = {base}\nplatform = {tip}\nrevolute = {axis}\n"
        kinds.append(f'kind = "UPR"\nactuator = {i + 1}\n{place}')
        if i == 0:
            joints = f"""{{ kind = "S", at = {base} }},
{{ kind = "P", actuator = 1, home_value = {float(np.hypot(100, 600))!r} }},
{{ kind = "R", at = [{tip[0]}, {tip[1]}, 600.0], axis = {axis} }}"""
            chain = f'kind = "chain"\njoints = [\n{joints}]\n'
    robot = loaded(head + "".join("[[limb]]\n" + x for x in kinds), tmp_path)
    other = loaded(head + "".join("[[limb]]\n" + x for x in [chain, *kinds[1:]]), tmp_path)
    q = commands(robot, 40)
    found, exact = other.forward(q), robot.forward(q)
    assert robot.model.chains is None and found.ok.all() and exact.ok.all()
    assert np.abs(found.pose - exact.pose).max() < 1e-9


def test_drive_laws_of_a_limb_beside_chains_are_kept(tmp_path: Path) -> None:
    robot = pk.load("hexapod")
    head, limbs = written(robot, tmp_path)
    law = "drive = { quadratic = 1e-6, harmonics = [{ k = 0.5, cos = 0.2, sin = -0.1 }] }\n"
    bent = [limb if i == 0 else law + limb for i, limb in enumerate(limbs)]
    robot = loaded(head + "".join("[[limb]]\n" + limb for limb in bent), tmp_path)
    chain = limbs_of(as_chains(pk.load("hexapod")))[1][0]
    other = loaded(head + "".join("[[limb]]\n" + x for x in [chain, *bent[1:]]), tmp_path)
    q = commands(robot, 20, share=0.5)
    assert other.geometry["drive4.quadratic"] == 1e-6
    assert np.abs(other.forward(q).pose - robot.forward(q).pose).max() < 1e-10


PRS = """kind = "PRS"
actuator = 1
base = [200.0, 0.0, 0.0]
platform = [100.0, 0.0, 0.0]
slider = [0, 0, 1]
normal = [0, 1, 0]
rod = 500.0
branch = 1
"""
PULLEY = """kind = "pulley"
actuator = 1
base = [200.0, 0.0, 0.0]
platform = [100.0, 0.0, 0.0]
swivel = [0, 0, 1]
radius = 30.0
"""


@pytest.mark.parametrize(
    ("limb", "map", "said"),
    [
        (PRS.replace("actuator = 1\n", ""), "spatial", "'actuator' is missing"),
        (PRS.replace("500.0", "50.0"), "spatial", "does not reach the home pose"),
        (PRS.replace("[0, 1, 0]", "[0, 1, 0.1]"), "spatial", "misses its closures by"),
        (
            f"{PRS}[[limb]]\n{PRS}offset = 1.0",
            "spatial",
            "offset1 is 1 here and 0 in a limb before",
        ),
        (PRS, "planar", "list the joints of a limb PRS as a chain"),
        (PULLEY, "spatial", "it does not go beside chains"),
        (PRS, "spherical", "list the joints of a limb PRS as a chain"),
        (PRS + CONES, "spatial", "its R has it"),
        (PRS + "weights = [0.5]", "spatial", "joints yield by their `soft`"),
        (PRS.replace("[200.0", '["radius"'), "spatial", "defines no 'radius'"),
    ],
)
def test_what_no_chain_can_be_is_refused(limb: str, map: str, said: str, tmp_path: Path) -> None:
    home = {"spatial": "z = 600.0", "planar": "y = 300.0", "spherical": ""}[map]
    head = 'name = "mixed"\nunits = { length = "mm", angle = "deg" }\n[pose]\n'
    head += f'map = "{map}"\nhome = {{ {home} }}\n'
    chain = (
        'kind = "chain"\njoints = [{ kind = "R", at = [0, 0, 0], axis = [1, 0, 0], actuator = 2 }]'
    )
    with pytest.raises(FileError, match=re.escape(said)):
        loaded(f"{head}[[limb]]\n{limb}\n[[limb]]\n{chain}\n", tmp_path)
