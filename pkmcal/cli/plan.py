"""`pkmcal plan`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from pkmcal.cli.camera_options import BoardSeen, CameraAt, CameraOn, Lens, LookAt
from pkmcal.cli.load_options import Yielding
from pkmcal.cli.options import Force, Free, Json, Prior, RobotOrArm, Seed
from pkmcal.cli.output import say
from pkmcal.cli.progress import progress
from pkmcal.jobs import planning
from pkmcal.jobs.inputs import Inputs
from pkmcal.jobs.output import Output
from pkmcal.jobs.plan import Planning
from pkmcal.jobs.planning import DRAWN
from pkmcal.report.as_json import as_json


def plan(
    context: typer.Context,
    robot: RobotOrArm,
    count: Annotated[
        int | None, typer.Option(metavar="N", help="How many poses; 30 by default.")
    ] = None,
    accuracy: Annotated[
        float | None,
        typer.Option(
            metavar="MM", help="Instead of --count: as few poses as reach this predicted error."
        ),
    ] = None,
    poses: Annotated[
        Path | None,
        typer.Option(
            metavar="CSV",
            help="Candidates, with columns such as 'y \\[mm]' and 'alpha \\[deg]'; by default"
            f" {DRAWN} are drawn in the workspace. Of an arm 'q1 \\[deg]' ….",
        ),
    ] = None,
    targets: Annotated[
        Path | None,
        typer.Option(metavar="CSV", help="Poses where accuracy counts; by default the candidates."),
    ] = None,
    direction: Annotated[
        str | None,
        typer.Option(
            metavar="X,Y,Z",
            help="Direction of the base in which the error counts: z for the height of a"
            " printer's nozzle over its bed. By default all directions; with --kind probe z.",
        ),
    ] = None,
    measured: Annotated[
        Path | None,
        typer.Option(
            metavar="CSV",
            help="Rows that were measured already: the plan adds poses to them. If they have no"
            " column sigma, their noise is that of --noise.",
        ),
    ] = None,
    criterion: Annotated[
        str, typer.Option(metavar="WORD", help="prediction, D or A: what is minimised.")
    ] = "prediction",
    kind: Annotated[
        str,
        typer.Option(
            metavar="KIND",
            help="What is measured: position, pose, height, distance, orientation, closure, pixel"
            " (pictures of a board) or probe (a printer's own, on its bed). For several kinds state"
            " how many poses each has: position=20,distance=10.",
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
            help="Noise of the instrument, one standard deviation; with several kinds of reading"
            " position=0.02,distance=0.005.",
        ),
    ] = "0.02",
    actuator_noise: Annotated[
        float | None,
        typer.Option(metavar="X", help="Noise of the actuators, mm or rad; closure needs it."),
    ] = None,
    travel_weight: Annotated[
        float,
        typer.Option(
            metavar="W",
            help="Weight of a short tour: with 0.5 a tour that is 10 % shorter makes up for a"
            " predicted error that is 5 % larger; with 0 its length does not count.",
        ),
    ] = 0.0,
    payloads: Annotated[
        str | None,
        typer.Option(
            metavar="MASS,MASS",
            help="Payloads that a machine that yields carries in turn, such as 0,100kg; by default"
            " the one of its file.",
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
    camera: Lens = None,
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
    gcode: Annotated[
        str | None,
        typer.Option(
            metavar="FIRMWARE",
            help="Also write a program in G-code that drives from pose to pose, for klipper,"
            " reprap, marlin or linuxcnc. Its ways stay within the limits of the machine; obstacles"
            " are not known.",
        ),
    ] = None,
    dwell: Annotated[
        float, typer.Option(metavar="S", help="How long the program waits at each pose.")
    ] = 5.0,
    safe_height: Annotated[
        float | None,
        typer.Option(
            metavar="Z",
            help="Height to which the program rises between poses, mm; by default it moves"
            " straight, with --kind probe it rises to 5 mm.",
        ),
    ] = None,
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
    return carried_out(Planning.of_options(context.params), out, force, json)


def carried_out(job: Planning, out: Path | None, force: bool, json: bool) -> int:
    """Plan, write, print, and return the exit code."""
    read = Inputs()
    sources = planning.read(job, read)
    output = None if out is None else Output(out, planning.files(job), read, force)
    with progress("choosing poses"):
        made = planning.planned(job, sources)
    written: list[Path] = []
    if output is not None:
        with output.draft() as draft:
            planning.write(job, made, draft, read.comment())
        written = output.paths
    if json:
        say(as_json(made, schema="plan"))
    else:
        say("\n".join([str(made), *([""] if written else []), *map(str, written)]))
    return 0 if np.isfinite(made.predicted) else 1
