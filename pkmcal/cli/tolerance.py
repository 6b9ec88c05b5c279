"""`pkmcal tolerance`."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

import pkmcal as pk
from pkmcal.arrays import FloatArray
from pkmcal.cli.options import Force, Json, ParallelRobot, Poses, Seed
from pkmcal.cli.output import say
from pkmcal.cli.progress import progress
from pkmcal.error_model.sensitivity import own_names
from pkmcal.error_model.tolerance import Sigma, Tolerance
from pkmcal.exceptions import ArgumentError
from pkmcal.files.toml_table import LARGEST
from pkmcal.jobs.geometry_options import read_deviations
from pkmcal.jobs.inputs import Inputs
from pkmcal.jobs.output import Output
from pkmcal.kinematics.robot import Robot
from pkmcal.kinematics.workspace import reach
from pkmcal.loading import load_parallel
from pkmcal.measurements.pose_csv import read_poses, write_poses
from pkmcal.report.as_json import as_json
from pkmcal.report.drawing import KINDS

_CELLS = 40  # of a map, along each axis
_MACHINES = 2_000  # of a map: its colours are good to 3 %


def tolerance(
    robot: ParallelRobot,
    sigma: Annotated[
        list[str] | None,
        typer.Option(
            metavar="[NAME=]σ",
            help="Standard deviation of the errors: 'base*.z=0.1', 'slider*.tilt1=0.1deg'. Repeat"
            " it. Without a name, in mm, of every length.",
        ),
    ] = None,
    allowed: Annotated[
        float | None,
        typer.Option(
            metavar="MM",
            max=LARGEST,
            help="The inverse question: which sigma may each joint have, so that 99.7 % of the"
            " machines are within this distance at all poses?",
        ),
    ] = None,
    poses: Poses = None,
    samples: Annotated[
        int, typer.Option(metavar="N", min=2, max=10**9, help="How many machines are drawn.")
    ] = 100_000,
    seed: Seed = 0,
    map: Annotated[
        str | None,
        typer.Option(metavar="A,B", help="Draw a map over two coordinates: 'y,z'. With --sigma."),
    ] = None,
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="Where files go.")] = None,
    force: Force = False,
    json: Json = False,
) -> int:
    """Predict the pose error of machines whose geometry has random errors.

    Machines are solved exactly; beside them the linear propagation and the worst case. Exit code 1:
    some machines have no pose.

    Example: pkmcal tolerance 2tpr2tps --sigma 0.1 --samples 10000
    """
    if (allowed is None) == (not sigma):
        raise ArgumentError("tolerance takes --sigma or --allowed, one of the two")
    if map is not None and (out is None or allowed is not None):
        raise ArgumentError("--map is drawn for --sigma, into the folder of --out")
    read = Inputs()
    machine = load_parallel(read.robot(robot))
    at = (
        pk.sample_poses(machine, seed=seed)
        if poses is None
        else read_poses(read.file(poses), machine)
    )
    names = ["tolerance.csv", *([] if map is None else [f"map.{kind}" for kind in KINDS])]
    output = None if out is None else Output(out, names, read, force)
    deviations = read_deviations("--sigma", sigma or [], machine, own_names(machine))
    with ThreadPoolExecutor() as executor:
        if allowed is not None:
            with progress("tolerances"):
                shared = pk.allocate_tolerance(
                    machine, at, allowed, samples=samples, seed=seed, executor=executor
                )
            found, text = (
                shared.check,
                as_json(shared, schema="allocation") if json else str(shared),
            )
        else:
            assert deviations is not None
            with progress("machines x poses") as moved:
                found = pk.tolerance(
                    machine,
                    at,
                    deviations,
                    samples=samples,
                    seed=seed,
                    executor=executor,
                    progress=moved,
                )
            text = as_json(found, "position_share", schema="tolerance") if json else str(found)
        if output is not None:
            with output.draft() as draft:
                table = draft / "tolerance.csv"
                write_poses(table, found.poses, _columns(found), comment=read.comment())
                if map is not None and deviations is not None:
                    _draw_map(machine, map, deviations, seed, executor, draft)
    say(text)
    return 1 if found.n_failed.any() else 0


def _columns(found: Tolerance) -> dict[str, FloatArray]:
    """Return the columns beside each pose."""
    names = ("x", "y", "z", "alpha", "beta", "gamma")
    columns: dict[str, FloatArray] = {
        f"distance {word} [mm]": values
        for word, values in (
            ("rms", found.distance_rms),
            ("95 %", found.distance95),
            ("99.7 %", found.distance997),
        )
    }
    for word, values in (
        *(("mean", found.mean), ("std", found.std), ("linear std", found.linear_std)),
        ("worst case", found.worst_case),
    ):
        for k, name in enumerate(names):
            unit = "mm" if k < 3 else "deg"
            columns[f"{word} d{name} [{unit}]"] = values[:, k] * (1 if k < 3 else 180 / np.pi)
    return columns


def _draw_map(
    robot: Robot, axes: str, sigma: Sigma, seed: int, executor: ThreadPoolExecutor, out: Path
) -> None:
    from pkmcal.report.drawing import write_both
    from pkmcal.report.error_figures import tolerance_map

    names = [name.strip() for name in axes.split(",")]
    if len(names) != 2:
        raise ArgumentError(f"--map {axes}: expected two coordinates, such as y,z")
    ends = reach(robot)
    unknown = [name for name in names if name not in ends]
    if unknown:
        raise ArgumentError(f"--map {axes}: {unknown[0]!r} is not one of {', '.join(ends)}")
    grid = pk.workspace(robot, {name: (*ends[name], _CELLS) for name in names})
    with progress("map") as moved:
        found = pk.tolerance(
            robot,
            grid.poses,
            sigma,
            samples=_MACHINES,
            seed=seed,
            executor=executor,
            progress=moved,
        )
    write_both(tolerance_map(found, grid), out / "map")
