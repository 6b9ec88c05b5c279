"""The text of a robot file: what `read` makes of it is the model, to the last bit."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pkmcal.arrays import FloatArray
from pkmcal.core.library import AXES, MAPS, POSE
from pkmcal.geometry.controller import controller_table
from pkmcal.geometry.geometry import Geometry
from pkmcal.geometry.limb_kinds import KINDS
from pkmcal.geometry.limbs import Cone, Limb
from pkmcal.geometry.load import is_of_load, load_table
from pkmcal.geometry.model import Model
from pkmcal.geometry.probe_offset import probe_table
from pkmcal.geometry.robot_file_chain_writer import chain_tables, tail_tables
from pkmcal.geometry.robot_file_elastic_writer import elastic_tables, limb_masses
from pkmcal.geometry.robot_file_laws import law_table
from pkmcal.geometry.ties import LimbNumber

HEADER = "# A robot for pkmcal: lengths in mm, angles in rad.\n"


def text_of(model: Model) -> str:
    """The TOML text of a model, in mm and rad."""
    head: dict[str, Any] = {"name": model.name, "units": {"length": "mm", "angle": "rad"}}
    if model.closure_tolerance is not None:
        head["closure_tolerance"] = model.closure_tolerance
    of_elastic, tables, balancers = elastic_tables(model.elastic, model.geometry)
    head |= of_elastic
    blocks = [HEADER, lines(head)]
    blocks += [
        f"[{key}]\n{lines(table)}" for key, table in (_sections(model) | tables).items() if table
    ]
    tail: list[dict[str, Any]] = []
    if model.chains is not None:
        limbs = list(chain_tables(model.chains, model.geometry))
        tail = list(tail_tables(model.chains, model.geometry))
    else:
        limbs = [_limb(limb, i, model.geometry) for i, limb in enumerate(model.limbs)]
        if model.elastic is not None:
            for i, limb in enumerate(limbs):
                limb |= limb_masses(model.elastic, model.geometry, i)
    blocks += [f"[[limb]]\n{lines(limb)}" for limb in limbs]
    blocks += [f"[[tail]]\n{lines(joint)}" for joint in tail]
    blocks += [f"[[balancer]]\n{lines(balancer)}" for balancer in balancers]
    return "\n".join(blocks)


def lines(table: Mapping[str, Any]) -> str:
    """The keys of a table, each with its value on one line."""
    return "".join(f"{_key(key)} = {_value(value)}\n" for key, value in table.items())


def _key(key: str) -> str:
    import tomli_w

    return tomli_w.dumps({key: 0}).partition(" = ")[0]


def _value(value: object) -> str:
    """A value on one line: lists and tables within a table stay on theirs."""
    import tomli_w

    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{_key(key)} = {_value(value[key])}" for key in value) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(_value, value)) + "]"
    return tomli_w.dumps({"_": value}).removeprefix("_ = ").removesuffix("\n")


def _sections(model: Model) -> dict[str, Mapping[str, Any]]:
    geometry = model.geometry
    pose: dict[str, Any] = {
        "map": model.map,
        "home": _pose(model.home, MAPS[model.map]),
    }
    if model.match is not None:
        pose["match"] = list(model.match)
    frames = {"base": model.base_frame, "tool": model.tool_frame}
    return {
        "pose": pose,
        "frames": {k: _pose(v, POSE) for k, v in frames.items() if v is not None},
        "workspace": {name: list(ends) for name, ends in model.workspace.items()},
        "load": {} if model.load is None else load_table(model.load),
        "probe": {} if model.probe is None else probe_table(model.probe),
        "controller": {} if model.controller is None else controller_table(model.controller),
        "parameters": {
            name: geometry[name] for name in geometry.parameters if not is_of_load(name)
        },
        "calibration": {"free": list(model.free)} if model.free else {},
        "uncertainty": model.uncertainty.table(),
        "stated": model.stated,
    }


def _pose(pose: FloatArray, names: tuple[str, ...]) -> dict[str, float]:
    return {name: float(pose[POSE.index(name)]) for name in names}


def _limb(limb: Limb, i: int, geometry: Geometry) -> dict[str, Any]:
    kind = KINDS[limb.kind]
    couple = limb.couple > 0.0
    numbers = {number.slot: number for number in geometry.numbers if number.limb == i}

    def entry(slot: str) -> float | str:
        tie = numbers[slot].tie
        return geometry[numbers[slot].name] if tie is None else tie.terms[0].written

    data: dict[str, Any] = {
        "kind": limb.kind,
        "actuator": limb.actuator + 1,
        "base": _point("base", numbers, geometry),
        "platform": _point("platform", numbers, geometry),
    }
    if limb.parts:
        points = range(1, len(limb.parts))
        data["over"] = [_point(f"over{j}", numbers, geometry) for j in points]
        data["parts"] = list(limb.parts)
    for axis, key in kind.axes_of(couple).items():
        data[key] = limb.frames[axis][:, 2].tolist()
        data[f"{key}_tilt"] = [entry(slot) for slot in AXES[axis]]
    if kind.driver.has_zero:
        data["zero"] = limb.frame[:, 0].tolist()
    named = {**kind.driver.lengths, "offset": "offset", "gain": "gain"}
    data.update({key: entry(slot) for key, slot in named.items()})
    if limb.law is not None:
        unit = kind.actuator_unit
        data["drive"] = law_table(limb.law, unit, lambda name: entry(f"drive.{name}"))
    if couple:
        data["couple"] = limb.couple
    if limb.weights:
        data["weights"] = list(limb.weights)
    if kind.driver.carries:
        data["branch"] = limb.branch
    if limb.stroke is not None:
        data["stroke"] = list(limb.stroke)
    for key, cone in (("base_cone", limb.base_cone), ("platform_cone", limb.platform_cone)):
        if cone is not None:
            data[key] = _cone(cone)
    return data


def _point(
    point: str, numbers: Mapping[str, LimbNumber], geometry: Geometry
) -> list[float | str] | dict[str, float | str]:
    xyz = [numbers[f"{point}.{axis}"] for axis in "xyz"]
    entries = [geometry[n.name] if n.tie is None else n.tie.terms[0].written for n in xyz]
    tie = xyz[0].tie
    if tie is None or tie.rule == "equal":
        return entries
    radius, angle = tie.terms
    return {"radius": radius.written, "angle": angle.written, "z": entries[2]}


def _cone(cone: Cone) -> dict[str, Any]:
    return {"axis": cone.axis.tolist(), "angle": cone.angle}
