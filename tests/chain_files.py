"""Robot files of chains for tests: machines of reference digits, and other limbs as chains."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

import pkmcal as pk
from pkmcal import Robot
from pkmcal.geometry.chain_joints import ERRORS
from pkmcal.geometry.limb_kinds import KINDS

FloatArray = NDArray[np.float64]

_LEG_ON_LEG = """\
name = "a leg on a leg"
units = { length = "mm", angle = "deg" }
[pose]
map = "planar"
home = { y = 300.0 }
[[limb]]
kind = "chain"
joints = [
  { kind = "R", at = [0.0, 0.0], share = "boom"BOOM },
  { kind = "P"SLIDE },
  { kind = "R", at = [-30.0, 280.0] },
]
[[limb]]
kind = "chain"
joints = [
  { share = "boom" },
  { kind = "R", at = [60.0, 20.0] },
  { kind = "P", actuator = 2 },
  { kind = "R", at = [40.0, 290.0] },
]
[[limb]]
kind = "chain"
joints = [
  { kind = "R", at = [400.0, 50.0] },
  { kind = "P", actuator = 3 },
  { kind = "R", at = [50.0, 310.0] },
]
"""
BOOMS = ("passive", "driven")


def leg_on_leg(boom: str) -> str:
    """A planar machine's file: a leg hinged to the boom of another, which nothing or q1 turns."""
    on_boom, on_slide = ("", ", actuator = 1") if boom == "passive" else (", actuator = 1", "")
    return _LEG_ON_LEG.replace("BOOM", on_boom).replace("SLIDE", on_slide)


def described(machine: dict[str, Any]) -> str:
    """A robot file of joints given one by one, every axis on its own; q counts from home."""
    users = [sum(j in limb for limb in machine["limbs"]) for j in range(len(machine["joints"]))]
    home = np.array(machine["home"])[:3, 3]
    free = {"spatial": "xyz", "planar": "xy", "spherical": ""}[machine["group"]]
    place = ", ".join(f"{c} = {float(home['xyz'.index(c)])!r}" for c in free)
    lines = [f'name = "{machine["name"]}"', 'units = { length = "mm", angle = "rad" }', "[pose]"]
    lines += [f'map = "{machine["group"]}"', f"home = {{ {place} }}"]
    for limb in machine["limbs"]:
        lines += ["[[limb]]", 'kind = "chain"', "joints = ["]
        for j in limb:
            joint = machine["joints"][j]
            said = f'kind = "{joint["kind"]}", at = {joint["point"]}, axis = {joint["axis"]}'
            if joint["actuator"] >= 0:
                said += f", actuator = {joint['actuator'] + 1}"
            if users[j] > 1:
                said += f', share = "joint{j}"'
            lines.append(f"  {{ {said} }},")
        lines.append("]")
    return "\n".join(lines) + "\n"


def all_errors(machine: dict[str, Any], robot: Robot) -> dict[str, float]:
    """Its errors by their public names."""
    found = {}
    for i, limb in enumerate(machine["limbs"]):
        for k, j in enumerate(limb, 1):
            for name in (f"limb{i + 1}.joint{k}", f"joint{j}"):
                for error, value in zip(ERRORS, machine["errors"][j], strict=True):
                    if f"{name}.{error}" in robot.geometry:
                        found[f"{name}.{error}"] = value
        for error, value in zip(ERRORS, machine["platform_errors"][i], strict=True):
            if f"limb{i + 1}.platform.{error}" in robot.geometry:
                found[f"limb{i + 1}.platform.{error}"] = value
    return found


def as_chains(robot: Robot) -> str:
    """The robot file of the same machine with its limbs as chains, actuators reading the same."""
    home, q = robot.home, robot.inverse(robot.home)
    places = pk.screw.from_pose(home)
    lines = ['name = "chains"', 'units = { length = "mm", angle = "rad" }', "[pose]"]
    free = ", ".join(
        f"{name} = {float(home[i])!r}"
        for i, name in enumerate(("x", "y", "z", "alpha", "beta", "gamma"))
        if name in robot.coordinates
    )
    lines += [f'map = "{robot.model.map}"', f"home = {{ {free} }}"]
    for i, limb in enumerate(robot.model.limbs):
        base, platform = (
            np.array([robot.geometry[f"{side}{i + 1}.{c}"] for c in "xyz"])
            for side in ("base", "platform")
        )
        tip = (places @ [*platform, 1.0])[:3]
        drive = f"actuator = {limb.actuator + 1}, home_value = {float(q[limb.actuator])!r}"
        joints = []
        kind, frame = KINDS[limb.kind], limb.frame
        if kind.driver.name == "length":
            first = '"R", axis = ' + str(frame[:, 2].tolist()) if limb.kind == "RPS" else '"U"'
            joints += [f"kind = {first}, at = {base.tolist()}", f'kind = "P", {drive}']
        elif kind.driver.name == "slider":
            carriage = base + q[limb.actuator] * frame[:, 2]
            axis = frame[:, 2].tolist()
            joints.append(f'kind = "P", at = {base.tolist()}, axis = {axis}, {drive}')
            swings = '"U"'
            if limb.kind == "PRS":
                swings = '"R", axis = ' + str(limb.frames["hinge"][:, 2].tolist())
            joints.append(f"kind = {swings}, at = {carriage.tolist()}")
        else:
            joint = "R" if robot.model.map == "planar" else "U"
            end = base + robot.geometry[f"crank{i + 1}"] * crank_direction(robot, i, q)
            axis = frame[:, 2].tolist()
            joints.append(f'kind = "R", at = {base.tolist()}, axis = {axis}, {drive}')
            joints.append(f'kind = "{joint}", at = {end.tolist()}')
        last = "R" if robot.model.map == "planar" else "S"
        joints.append(f'kind = "{last}", at = {tip.tolist()}')
        lines += ["[[limb]]", 'kind = "chain"', "joints = ["]
        lines += [f"  {{ {joint} }}," for joint in joints] + ["]"]
    return "\n".join(lines) + "\n"


def crank_direction(robot: Robot, limb: int, q: FloatArray) -> FloatArray:
    """From the crank's axis to its end at coordinates (n,)."""
    model = robot.model.limbs[limb]
    e1, e2, _ = model.frame.T
    angle = q[model.actuator]
    return np.asarray(np.cos(angle) * e1 + np.sin(angle) * e2)


def same_errors(robot: Robot, limb_errors: dict[str, float]) -> dict[str, float]:
    """Errors of base, platform, offset, rod and crank as errors of the joints of `as_chains`."""
    q = robot.inverse(robot.home)
    found: dict[str, float] = {}

    def add(name: str, value: float) -> None:
        found[name] = found.get(name, 0.0) + float(value)

    for i, limb in enumerate(robot.model.limbs):
        kind = KINDS[limb.kind]
        n = f"limb{i + 1}"
        for c in "xyz":
            add(f"{n}.joint1.d{c}", limb_errors.get(f"base{i + 1}.{c}", 0.0))
            add(f"{n}.platform.d{c}", limb_errors.get(f"platform{i + 1}.{c}", 0.0))
        if f"offset{i + 1}" in limb_errors:
            add(f"offset{limb.actuator + 1}", limb_errors[f"offset{i + 1}"])
        if kind.driver.name == "length":
            continue
        base, platform = (
            np.array([robot.geometry[f"{side}{i + 1}.{c}"] for c in "xyz"])
            for side in ("base", "platform")
        )
        tip = (pk.screw.from_pose(robot.home) @ [*platform, 1.0])[:3]
        if kind.driver.name == "slider":
            start = base + q[limb.actuator] * limb.frame[:, 2]
        else:
            way = crank_direction(robot, i, q)
            start = base + robot.geometry[f"crank{i + 1}"] * way
            for c, part in zip("xyz", way, strict=True):
                add(f"{n}.joint2.d{c}", part * limb_errors.get(f"crank{i + 1}", 0.0))
        rod = (tip - start) / np.linalg.norm(tip - start)
        for c, part in zip("xyz", rod, strict=True):
            add(f"{n}.joint3.d{c}", part * limb_errors.get(f"rod{i + 1}", 0.0))
    return found


DRAWN = {  # kinds of joints from the base on, the actuated one with a star
    "spatial": ("UP*S", "P*US", "R*US", "R*RRRRR", "P*RUU", "R*RRS", "UP*UR", "P*CUR", "R*PCU"),
    "planar": ("R*RR", "RP*R", "P*RR"),
    "spherical": ("R*RR",),
}
_SIZE = 500.0  # mm


def drawn(map: str, rng: np.random.Generator) -> str:
    """The robot file of a machine of random chains, one actuator each."""
    way = {"spatial": np.ones(3), "planar": np.array([1.0, 1.0, 0.0]), "spherical": np.zeros(3)}[
        map
    ]
    home = way * _SIZE * rng.uniform(-1, 1, 3)
    place = ", ".join(f"{c} = {h!r}" for c, h in zip("xyz", home.tolist(), strict=True) if h)
    lines = [f'name = "drawn"\nunits = {{ length = "mm", angle = "rad" }}\n[pose]\nmap = "{map}"']
    lines += [f"home = {{ {place} }}"] * bool(place)
    limbs = {"spatial": 6, "planar": 3, "spherical": 3}[map]
    for limb in range(limbs):
        word = str(rng.choice(DRAWN[map]))
        kinds = [word[i] for i in range(len(word)) if word[i] != "*"]
        actuated = word.index("*") - 1
        end = home + way * rng.uniform(-0.4, 0.4, 3) * _SIZE
        start = end - _direction(rng, way) * rng.uniform(0.8, 1.5) * _SIZE
        lines += ["[[limb]]", 'kind = "chain"', "joints = ["]
        for k, kind in enumerate(kinds):
            at = start + (end - start) * k / (len(kinds) - 1)
            if 0 < k < len(kinds) - 1:
                at = at + _direction(rng, way) * 0.3 * _SIZE
            said = [f'kind = "{kind}"', f"at = {at.tolist()}"]
            across = way if map == "planar" else np.ones(3)
            if kind in "RPC":
                planar = map == "planar" and kind == "R"
                axis = np.array([0.0, 0.0, 1.0]) if planar else _direction(rng, across)
                said.append(f"axis = {axis.tolist()}")
            if kind == "U":
                one = _direction(rng, across)
                other = np.cross(one, _direction(rng, across))
                said.append(f"axes = [{one.tolist()}, {(other / np.linalg.norm(other)).tolist()}]")
            if k == actuated:
                said.append(f"actuator = {limb + 1}")
            lines.append("  { " + ", ".join(said) + " },")
        lines.append("]")
    return "\n".join(lines) + "\n"


def _direction(rng: np.random.Generator, way: FloatArray) -> FloatArray:
    found = rng.normal(size=3) * (way if way.any() else np.ones(3))
    return np.asarray(found / np.linalg.norm(found))


def delta_of_hinges(angles: tuple[float, ...]) -> str:
    """An H4: four vertical carriages of two rods each, two hinges for four rods each."""
    radius, end, height, apart = 220.0, 50.0, -400.0, 25.0
    lines = [
        'name = "H4"\nunits = { length = "mm", angle = "rad" }\n[pose]\nmap = "spatial"',
        f'home = {{ z = {height} }}\nmatch = ["x", "y", "z", "gamma"]',
    ]
    for n, angle in enumerate(np.radians(angles), 1):
        out, across = (
            np.array([np.cos(angle), np.sin(angle), 0.0]),
            np.array([-np.sin(angle), np.cos(angle), 0.0]),
        )
        hinge, y = ("one", 50.0) if n < 3 else ("other", -50.0)
        for side in (-1, 1):
            base, tip = radius * out + side * apart * across, end * out + side * apart * across
            tip[2] = height
            carriage, turned = f'share = "carriage{n}"', f'share = "{hinge}"'
            if side < 0:
                at = (radius * out).tolist()
                carriage += f', kind = "P", at = {at}, axis = [0, 0, 1], actuator = {n}'
            if side < 0 and n in (1, 3):
                turned += f', kind = "R", at = [0, {y}, {height}], axis = [0, 0, 1]'
            rod = f'{{ kind = "U", at = {base.tolist()} }}, {{ kind = "S", at = {tip.tolist()} }}'
            lines.append('[[limb]]\nkind = "chain"')
            lines.append(f"joints = [ {{ {carriage} }}, {rod}, {{ {turned} }} ]")
    return "\n".join(lines) + "\n"
