"""Robot files: TOML in, `Model` out, and back to the last bit."""

from __future__ import annotations

import functools
import os
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from pkmcal import arguments
from pkmcal.arguments import did_you_mean
from pkmcal.arrays import FloatArray, Unit
from pkmcal.core.library import COORDINATE_UNITS, MAPS, MAX_LIMBS, POSE
from pkmcal.exceptions import ArgumentTypeError, FileError
from pkmcal.files import reading
from pkmcal.files.atomic import write_whole
from pkmcal.files.toml_lines import Source
from pkmcal.files.toml_table import ANGLE_UNITS, LENGTH_UNITS, Table, Units, shown
from pkmcal.geometry.box import read_box
from pkmcal.geometry.controller import read_controller
from pkmcal.geometry.geometry import Geometry
from pkmcal.geometry.limb_kinds import KINDS
from pkmcal.geometry.limbs import CHAIN, Limb
from pkmcal.geometry.load import CableLoad, read_load
from pkmcal.geometry.model import Model
from pkmcal.geometry.probe_offset import read_probe
from pkmcal.geometry.robot_file_chains import chain_limbs, read_chains
from pkmcal.geometry.robot_file_elastic import TOP as TOP_ELASTIC
from pkmcal.geometry.robot_file_elastic import read_elastic
from pkmcal.geometry.robot_file_laws import refuse_turning
from pkmcal.geometry.robot_file_limbs import Limbs, Parameters, read_limbs
from pkmcal.geometry.robot_file_writer import text_of
from pkmcal.geometry.stated_uncertainty import read_uncertainty

# What a data sheet states beside single numbers: of the circles of the joints, and of the legs at
# home, which a machine with length limbs has.
STATED_SIZES = ("base_radius", "base_diameter", "platform_radius", "platform_diameter", "length")
INDEPENDENT = "independent"  # the default free set of a file that names none: found when loaded
TOP = (
    "name", "units", "closure_tolerance", "frames", "pose", "workspace", "load", "probe",
    "controller", "parameters", "calibration", "uncertainty", "stated", "limb", "tail",
    *TOP_ELASTIC,
)  # fmt: skip


_BUILTIN = resources.files("pkmcal") / "builtin"


def builtin_names(folder: str = "machines") -> tuple[str, ...]:
    """Names of the built-in machines; of the serial arms with the folder "arms"."""
    found = (_BUILTIN / folder).iterdir()
    names = (entry.name for entry in found)
    return tuple(sorted(name[: -len(".toml")] for name in names if name.endswith(".toml")))


def is_built_in(robot: str) -> bool:
    """Return whether this is the name of a built-in machine."""
    return robot in _builtin()


@functools.cache
def _builtin() -> dict[str, Any]:
    return {
        name: _BUILTIN / folder / f"{name}.toml"
        for folder in ("machines", "arms")
        for name in builtin_names(folder)
    }


def read(robot: str | os.PathLike[str]) -> Model:
    """Read a robot file or a built-in machine.

    Parameters
    ----------
    robot : str or path
        The name of a built-in machine, or a file.

    Returns
    -------
    Model
        What the file says, in mm and rad.

    Raises
    ------
    ValueError
        An unknown name, or a mistake in the file: one line with the file, its line, the table,
        the key and what was found.
    FileNotFoundError
        No such file.
    TypeError
        `robot` is neither text nor a path.

    Examples
    --------
    >>> read("hexapod").map
    'spatial'
    """
    content, place, file = located(robot)
    return parse(Source(content, place), file)


def located(robot: str | os.PathLike[str]) -> tuple[bytes, str, str | None]:
    """Content of a file or a built-in machine, how messages call it, and its path.

    Raises as `read` does, where there is no such file.
    """
    if not isinstance(robot, str | os.PathLike):
        raise ArgumentTypeError(f"robot must be a name or a path, found {robot!r}")
    known = _builtin()
    if isinstance(robot, str) and robot in known:
        return known[robot].read_bytes(), f"built-in machine {robot}", None
    path = Path(robot)
    if path.is_dir():
        raise FileError(f"{path}: this is a folder, not a robot file")
    named = isinstance(robot, str) and path.name == robot and not path.suffix
    if named and not path.exists():
        raise FileError(f"unknown machine {robot!r}{did_you_mean(robot, known, listed=len(known))}")
    return reading.content(robot, reading.MOST_ROBOT), str(path), str(path)


def write(model: Model, path: str | os.PathLike[str], comment: str = "") -> None:
    """Write a robot file in mm and rad, which `read` reads back to the last bit.

    The file is complete or untouched.

    Parameters
    ----------
    model : Model
        The robot.
    path : str or path
        Where to write; an existing file is replaced.
    comment : str
        Lines for its head, each with its ``#``.

    Raises
    ------
    OSError
        The folder does not exist or cannot be written.
    """
    write_whole(path, arguments.comment(comment) + text_of(model))


def parse(source: Source, file: str | None) -> Model:
    """Make a model of what a robot file says."""
    top = Table(source.data, source)
    top.only(TOP)
    top.units = read_units(top)
    parameters = Parameters(_section(top, "parameters"))
    described = top.tables("limb", "a robot")
    if len(described) > MAX_LIMBS:
        described[MAX_LIMBS].fail("", f"a robot has at most {MAX_LIMBS} limbs")
    pose = top.table("pose")
    pose.only(("map", "home", "match"))
    pose_map = pose.choice("map", MAPS, "pose map")
    home = _read_pose(pose, "home", MAPS[pose_map], f"the map {pose_map}")
    chains = None
    tail = top.tables("tail", "a robot with a tail") if "tail" in top else []
    if tail or any(table.data.get("kind") == CHAIN for table in described):
        chains, own = read_chains(described, tail, parameters, pose_map, home)
        limbs = Limbs(chain_limbs(chains), list(chains.numbers), own, chains.blank)
    else:
        limbs = read_limbs(described, parameters)
        _check_rows(pose, pose_map, limbs.limbs)
    elastic, limbs = read_elastic(top, described, limbs, parameters)
    values = parameters.finish([number.name for number in limbs.numbers])
    units = parameters.ordered_units()
    load = _read_load(top, limbs.limbs)
    if load is not None:
        units, values = units | load.units, values | load.numbers
    geometry = Geometry(limbs.numbers, units, limbs.values | values, limbs.blank)
    frames = _section(top, "frames")
    frames.only(("base", "tool"))
    model = Model(
        name=top.text("name"),
        map=pose_map,
        home=home,
        match=_read_match(pose),
        limbs=limbs.limbs,
        chains=chains,
        geometry=geometry,
        free=_read_free(_section(top, "calibration"), geometry),
        stated=_read_stated(_section(top, "stated"), geometry, limbs.limbs),
        uncertainty=read_uncertainty(_section(top, "uncertainty"), geometry),
        base_frame=_read_pose(frames, "base", POSE) if "base" in frames else None,
        tool_frame=_read_pose(frames, "tool", POSE) if "tool" in frames else None,
        closure_tolerance=_read_tolerance(top),
        workspace=read_box(_section(top, "workspace")),
        load=load,
        probe=read_probe(top.table("probe")) if "probe" in top else None,
        controller=read_controller(top.table("controller")) if "controller" in top else None,
        elastic=elastic,
        file=file,
    )
    refuse_turning(model, described)
    return model


def _read_tolerance(top: Table) -> float | None:
    if "closure_tolerance" not in top:
        return None
    found = top.number("closure_tolerance", "mm")
    if not found > 0.0:
        top.fail("closure_tolerance", f"must be positive, found {top['closure_tolerance']!r}")
    return found


def _read_load(top: Table, limbs: tuple[Limb, ...]) -> CableLoad | None:
    if "load" not in top:
        return None
    if not any(limb.kind in KINDS and KINDS[limb.kind].cable for limb in limbs):
        top.fail("load", "is what cables have to hold, and the robot has none")
    return read_load(top.table("load"), 1 + max(limb.actuator for limb in limbs))


def _section(top: Table, key: str) -> Table:
    """A table that may be left out."""
    return top.table(key) if key in top else Table({}, top.source, (key,), top.units)


def read_units(top: Table) -> Units:
    """The units that a file states."""
    table = top.table("units")
    table.only(("length", "angle"))
    length = table.choice("length", LENGTH_UNITS, "unit of length")
    angle = table.choice("angle", ANGLE_UNITS, "unit of angle")
    return Units(LENGTH_UNITS[length], ANGLE_UNITS[angle])


def _check_rows(pose: Table, pose_map: str, limbs: tuple[Limb, ...]) -> None:
    rows = sum(1 + len(KINDS[limb.kind].all_rows(limb.couple > 0.0)) for limb in limbs)
    if rows < (free := len(MAPS[pose_map])):
        pose.fail("map", f"{pose_map} has {free} free coordinates, but the limbs close only {rows}")


def _read_pose(table: Table, key: str, known: tuple[str, ...], owner: str = "") -> FloatArray:
    pose = table.table(key) if key in table or known[0] in "xyz" else Table({}, table.source)
    pose.only(known, owner)
    found = np.array([pose.number(name, COORDINATE_UNITS[name], 0.0) for name in POSE])
    found.flags.writeable = False
    return found


def _read_match(pose: Table) -> tuple[str, ...] | None:
    if "match" not in pose:
        return None
    names = pose.texts("match")
    for name in names:
        if name not in POSE:
            pose.fail("match", f"{name!r} is no coordinate{did_you_mean(name, POSE)}")
    if not names or len(set(names)) < len(names):
        pose.fail("match", f"must name some coordinates once each, found {shown(names)}")
    return tuple(names)


def _read_free(table: Table, geometry: Geometry) -> tuple[str, ...]:
    table.only(("free",))
    if table.data.get("free", INDEPENDENT) == INDEPENDENT:
        return ()
    patterns = table.texts("free")
    try:
        return tuple(geometry.match(patterns))
    except ValueError as error:
        table.fail("free", str(error))


def _read_stated(table: Table, geometry: Geometry, limbs: tuple[Limb, ...]) -> Mapping[str, float]:
    units: dict[str, Unit] = dict(zip(geometry.names, geometry.units, strict=True))
    for limb in limbs:
        if limb.kind not in KINDS:
            continue
        for _, name, unit in KINDS[limb.kind].numbers("", limb.couple > 0.0):
            if unit == "mm":
                units.setdefault(name, unit)
    for name in STATED_SIZES:
        units.setdefault(name, "mm")
    stated = {}
    for name, value in table.flat():
        if name not in units:
            known = did_you_mean(name, units)
            table.fail("", f"the robot has no number {name!r}{known}", at=name)
        stated[name] = table.as_number(name, value, units[name])
    return stated
