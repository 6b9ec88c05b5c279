"""`pkmcal plan`."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from pkmcal.arguments import did_you_mean, word
from pkmcal.arms.arm import SerialArm
from pkmcal.arrays import FloatArray
from pkmcal.cli.camera_options import (
    BoardSeen,
    CameraAt,
    CameraOn,
    Lens,
    LookAt,
    planned_camera,
)
from pkmcal.cli.load_options import Yielding
from pkmcal.cli.options import Force, Free, Json, Prior, RobotOrArm, Seed
from pkmcal.cli.output import say
from pkmcal.cli.progress import progress
from pkmcal.core.library import COORDINATE_UNITS
from pkmcal.exceptions import ArgumentError
from pkmcal.files.number_text import typed
from pkmcal.geometry.box import Box
from pkmcal.jobs.effects_option import AUTO, OPTION, read_effects
from pkmcal.jobs.geometry_options import free_names, read_prior
from pkmcal.jobs.inputs import Inputs
from pkmcal.jobs.load_options import mass, yielding
from pkmcal.jobs.output import Output
from pkmcal.kinematics.calibratable import as_machine
from pkmcal.kinematics.reading_units import reading_units
from pkmcal.kinematics.robot import Robot
from pkmcal.kinematics.workspace import sample_poses
from pkmcal.loading import load
from pkmcal.measurements.command_csv import read_commands, write_commands
from pkmcal.measurements.pose_csv import read_poses, write_poses
from pkmcal.planning.optimal_design import CRITERIA
from pkmcal.planning.plan_poses import PLANNED, Plan, plan_poses
from pkmcal.planning.planned import UNKNOWN
from pkmcal.readings.registry import Kind
from pkmcal.report.as_json import as_json

_DRAWN, _SHARE = 500, 0.9  # candidates where none are given, and how far out they reach


def plan(
    robot: RobotOrArm,
    count: Annotated[
        int | None, typer.Option(metavar="N", help="How many poses; 30 by default.")
    ] = None,
    accuracy: Annotated[
        float | None,
        typer.Option(metavar="MM", help="Instead: as few as reach this predicted error."),
    ] = None,
    poses: Annotated[
        Path | None,
        typer.Option(
            metavar="CSV",
            help="Candidates, with columns such as 'y \\[mm]' and 'alpha \\[deg]'; by default"
            f" {_DRAWN} are drawn in the workspace. Of an arm 'q1 \\[deg]' ….",
        ),
    ] = None,
    targets: Annotated[
        Path | None,
        typer.Option(metavar="CSV", help="Poses where accuracy counts; by default the candidates."),
    ] = None,
    criterion: Annotated[
        str, typer.Option(metavar="WORD", help="prediction, D or A: what is minimised.")
    ] = "prediction",
    kind: Annotated[
        str,
        typer.Option(
            metavar="KIND",
            help="What is measured: position, pose, height, distance, orientation, closure or pixel"
            " (pictures of a board). Of several how many poses of each: position=20,distance=10.",
        ),
    ] = "position",
    target: Annotated[
        list[str] | None,
        typer.Option(
            metavar="[KIND=]X,Y,Z",
            help="The measured point of the platform, mm; of distances the fixed point of the base."
            " Repeat it for several points.",
        ),
    ] = None,
    noise: Annotated[
        str,
        typer.Option(
            metavar="MM",
            help="Of the instrument, one standard deviation; of several kinds also"
            " position=0.02,distance=0.005.",
        ),
    ] = "0.02",
    actuator_noise: Annotated[
        float | None,
        typer.Option(metavar="X", help="Of the actuators, mm or rad; closure needs it."),
    ] = None,
    travel_weight: Annotated[
        float,
        typer.Option(
            metavar="W",
            help="What a shorter tour is worth: of 0.5, one 10 % shorter is worth a predicted error"
            " 5 % larger. 0: nothing.",
        ),
    ] = 0.0,
    payloads: Annotated[
        str | None,
        typer.Option(
            metavar="MASS,MASS",
            help="What a machine that yields carries in turn, such as 0,100kg; of its file by"
            " default.",
        ),
    ] = None,
    effects: Annotated[
        list[str] | None,
        typer.Option(
            metavar="WORDS",
            help="What the calibration is to find as well, as pkmcal calibrate has it:"
            " elasticity=offset*, sag.",
        ),
    ] = None,
    compliance: Yielding = None,
    lens: Lens = None,
    camera_on: CameraOn = "base",
    board: BoardSeen = None,
    camera_at: CameraAt = None,
    look_at: LookAt = None,
    free: Free = None,
    prior: Prior = None,
    unknown: Annotated[
        list[str] | None,
        typer.Option(metavar="WORD", help="frame or target: identified too, as for calibrate."),
    ] = None,
    within: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=LO:HI",
            help="Where to stay, in mm and deg: 'z=0:300', of an arm 'q1=-90:90'; beside the"
            " \\[workspace] of the robot file and the limits of a URDF file. Repeat it, or"
            " separate with commas.",
        ),
    ] = None,
    seed: Seed = 0,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="Write poses.csv and commands.csv, the actuators, with targets."
        ),
    ] = None,
    force: Force = False,
    json: Json = False,
) -> int:
    """Choose the poses to measure for a calibration.

    To commands.csv add columns of what was measured there, and give it to calibrate.
    Exit code 1: these poses do not identify all parameters.

    Example: pkmcal plan hexapod --kind pose --count 20 --out plan
    """
    read = Inputs()
    machine: Robot | SerialArm = load(read.robot(robot))
    box = _box(machine, within or [])
    if isinstance(machine, Robot):
        machine = yielding(machine.within(box), compliance)
    seen = as_machine(machine)
    chosen = free_names(seen, free)
    candidates = _drawn(machine, box, seed) if poses is None else _places(machine, read.file(poses))
    used = None if targets is None else _places(machine, read.file(targets))
    kinds = _kinds(kind)
    several = isinstance(kinds, dict)
    if several and "pixel" in kinds:
        raise ArgumentError(f"--kind {kind}: pictures are planned by themselves")
    pictures = None
    if kinds == "pixel":
        pictures = planned_camera(lens, camera_on, board, camera_at, look_at)
    elif lens is not None or board is not None:
        raise ArgumentError("--camera, --board: they are of pictures; state --kind pixel")
    if several and (count is not None or accuracy is not None):
        raise ArgumentError(f"--kind {kind}: says how many poses, without --count and --accuracy")
    commands = [f"commands-{each}.csv" for each in kinds] if several else ["commands.csv"]
    names = ["poses.csv", *commands]
    output = None if out is None else Output(out, names, read, force)
    with progress("choosing poses"):
        made = plan_poses(
            machine,
            candidates,
            count=30 if count is None and accuracy is None and not several else count,
            accuracy=accuracy,
            targets=used,
            criterion=word("--criterion", criterion, CRITERIA),
            kind=kinds if pictures is None else pictures,
            target=_points(target or [], kinds),
            noise=_noise(noise, kinds),
            actuator_noise=actuator_noise,
            travel_weight=travel_weight,
            payloads=[]
            if payloads is None
            else [mass("--payloads", m) for m in payloads.split(",")],
            effects=_effects(effects or ["none"]),
            free=chosen or None,
            prior=read_prior(prior or [], seen, chosen),
            unknown=[word("--unknown", each, UNKNOWN) for each in unknown or ()],
        )
    written: list[Path] = []
    if output is not None:
        with output.draft() as draft:
            _write(made, draft, read.comment())
        written = output.paths
    if json:
        say(as_json(made, schema="plan"))
    else:
        say("\n".join([str(made), *([""] if written else []), *map(str, written)]))
    return 0 if np.isfinite(made.predicted) else 1


def _kinds(text: str) -> Kind | dict[Kind, int]:
    """One kind, or how many poses of each of several."""
    if "=" not in text:
        return word("--kind", text, PLANNED)
    found: dict[Kind, int] = {}
    for part in text.split(","):
        name, _, number = (each.strip() for each in part.partition("="))
        if not number.isdecimal():
            raise ArgumentError(f"--kind {text}: expected KIND=N, such as position=20,distance=10")
        found[word("--kind", name, PLANNED)] = int(number)
    return found


def _points(given: list[str], kinds: Kind | dict[Kind, int]) -> Any:
    """Points (k, 3) of all kinds, or by kind; None where none are given."""
    found: dict[str, list[list[float]]] = {}
    for text in given:
        name, equals, numbers = text.partition("=")
        try:
            point = [typed(each) for each in (numbers if equals else name).split(",")]
        except ValueError:
            point = []
        if len(point) != 3:
            raise ArgumentError(f"--target {text}: expected X,Y,Z in mm, or KIND=X,Y,Z")
        found.setdefault(
            _of_plan("--target", text, name.strip(), kinds) if equals else "", []
        ).append(point)
    return _by_kind("--target", found)


def _noise(text: str, kinds: Kind | dict[Kind, int]) -> Any:
    """Deviations of all kinds, or by kind."""
    found: dict[str, float] = {}
    for part in text.split(","):
        name, equals, number = (each.strip() for each in part.partition("="))
        try:
            value = typed(number if equals else name)
        except ValueError:
            raise ArgumentError(f"--noise {text}: expected a number, or KIND=NUMBER") from None
        found[_of_plan("--noise", text, name, kinds) if equals else ""] = value
    return _by_kind("--noise", found)


def _of_plan(option: str, text: str, name: str, kinds: Kind | dict[Kind, int]) -> str:
    known = [*kinds] if isinstance(kinds, dict) else [kinds]
    if name not in known:
        raise ArgumentError(f"{option} {text}: the plan has {', '.join(known)}; found {name!r}")
    return name


def _by_kind(option: str, found: dict[str, Any]) -> Any:
    """What is for all, or a mapping of kinds to what is theirs; None of nothing."""
    if "" in found and len(found) > 1:
        raise ArgumentError(f"{option}: one without a kind stands alone, for all")
    return found.get("", found or None)


def _box(machine: Robot | SerialArm, given: list[str]) -> Box:
    """Ends of coordinates, mm and rad, as ``--within`` states them.

    Raises
    ------
    ValueError
        No such coordinate, no numbers.
    """
    if isinstance(machine, SerialArm):
        units = {f"q{i + 1}": unit for i, unit in enumerate(machine.actuator_units)}
    else:
        units = COORDINATE_UNITS
    box = {}
    for text in (part.strip() for each in given for part in each.split(",")):
        name, _, ends = text.partition("=")
        low, _, high = ends.partition(":")
        if name.strip() not in units:
            known = did_you_mean(name.strip(), units)
            raise ArgumentError(f"--within {text}: {name.strip()!r} is no coordinate{known}")
        try:
            numbers = typed(low), typed(high)
        except ValueError:
            raise ArgumentError(f"--within {text}: expected NAME=LO:HI, such as z=0:300") from None
        if not numbers[0] < numbers[1]:
            raise ArgumentError(f"--within {text}: from {low.strip()} to {high.strip()} is nothing")
        factor = np.radians(1.0) if units[name.strip()] == "rad" else 1.0
        box[name.strip()] = (numbers[0] * factor, numbers[1] * factor)
    return box


def _drawn(machine: Robot | SerialArm, box: Box, seed: int) -> FloatArray:
    if not isinstance(machine, SerialArm):
        return sample_poses(machine, _DRAWN, seed, share=_SHARE)
    ends = machine.limits()
    for name, (low, high) in box.items():
        i = int(name[1:]) - 1
        ends[i] = max(low, ends[i, 0]), min(high, ends[i, 1])
    unknown = [f"q{i + 1}" for i in np.flatnonzero(~np.isfinite(ends).all(axis=1))]
    if unknown:
        raise ArgumentError(
            f"--poses: {machine.name} is a serial arm, and the limits of {', '.join(unknown)} are"
            f" not known: state them ('--within {unknown[0]}=-90:90'), or give a file of joint"
            " coordinates to choose from, with columns such as 'q1 [deg]'"
        )
    return np.random.default_rng(seed).uniform(ends[:, 0], ends[:, 1], (_DRAWN, len(ends)))


def _places(machine: Robot | SerialArm, path: PathLike[str]) -> FloatArray:
    """Poses of a file, or an arm's joint coordinates."""
    if isinstance(machine, SerialArm):
        return read_commands(path, machine.actuator_units)
    return read_poses(path, machine)


def _write(made: Plan, out: Path, head: str) -> None:
    kinds = list(dict.fromkeys(made.kinds))
    several = {"kind": made.kinds} if len(kinds) > 1 else {}
    carried = {} if made.load is None else {"payload [kg]": np.asarray(made.load.mass)}
    write_poses(out / "poses.csv", made.poses, {**several, **carried}, comment=head)
    for kind in kinds:
        points = made.target.get(kind, np.empty((1, 0)))
        own = np.array(made.kinds) == kind
        mine = made.actuators[own]
        at = np.tile(points, (len(mine), 1))
        write_commands(
            out / (f"commands-{kind}.csv" if several else "commands.csv"),
            reading_units(made.robot),
            np.repeat(mine, len(points), axis=0),
            {f"target.{axis} [mm]": place for axis, place in zip("xyz", at.T, strict=False)}
            | {name: np.repeat(kg[own], len(points)) for name, kg in carried.items()},
            comment=head,
        )


def _effects(given: Sequence[str]) -> list[Any]:
    """The effects that the calibration is to find as well."""
    read = read_effects(given)
    if isinstance(read, str):
        raise ArgumentError(f"{OPTION}: {AUTO} is decided by rows, which a plan has not yet")
    return read
