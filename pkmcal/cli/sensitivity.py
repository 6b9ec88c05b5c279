"""`pkmcal sensitivity`."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

import pkmcal as pk
from pkmcal.cli.options import Force, Json, ParallelRobot, Poses, Seed
from pkmcal.cli.output import say
from pkmcal.cli.progress import progress
from pkmcal.core.library import POSE
from pkmcal.error_model.sensitivity import STUDIES, Sensitivity, Study, study_cases
from pkmcal.exceptions import ArgumentError
from pkmcal.files.atomic import write_whole
from pkmcal.files.toml_table import LARGEST
from pkmcal.jobs.inputs import Inputs
from pkmcal.jobs.output import Output
from pkmcal.loading import load_parallel
from pkmcal.measurements.pose_csv import read_poses, write_poses
from pkmcal.report.as_json import as_json
from pkmcal.report.drawing import KINDS

_TITLES: dict[Study, str] = {
    "limb1": "one number of limb 1 in error",
    "offsets": "one zero length in error",
    "all-limbs": "the same error on all limbs",
}

_DRAWN = ("poses", "mean")  # figures of each study


def sensitivity(
    robot: ParallelRobot,
    poses: Poses = None,
    step: Annotated[
        float,
        typer.Option(
            metavar="MM", min=-LARGEST, max=LARGEST, help="The error in mm; of angles in mrad."
        ),
    ] = 1.0,
    seed: Seed = 0,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Where the files go.")] = Path(
        "pkmcal-sensitivity"
    ),
    force: Force = False,
    json: Json = False,
) -> int:
    """Show the pose error that an error of each number of the geometry causes.

    Three studies: the numbers of limb 1 one by one, the zero lengths, and each kind of number on
    all limbs together; of each a figure pose by pose and one of the means. Every error is solved
    exactly, beside its linear prediction. Exit code 1: some poses were not solved.

    Example: pkmcal sensitivity 2tpr2tps --out errors
    """
    read = Inputs()
    machine = load_parallel(read.robot(robot))
    at = (
        pk.sample_poses(machine, seed=seed)
        if poses is None
        else read_poses(read.file(poses), machine)
    )
    studies = {name: cases for name in STUDIES if (cases := study_cases(machine, name))}
    if not studies:
        raise ArgumentError(f"{robot}: no number of its geometry can be in error")
    output = Output(out, _names(studies), read, force)
    found = {
        name: pk.sensitivity(machine, at, step, cases=cases) for name, cases in studies.items()
    }
    with output.draft() as draft:
        _write(found, draft, read.comment())
    if json:
        say(as_json({name: _as_mapping(result) for name, result in found.items()}))
    else:
        for name, result in found.items():
            say(f"{_TITLES[name]}\n{result}\n")
        say("\n".join(str(path) for path in output.paths))
    return 0 if not any(result.n_failed.any() for result in found.values()) else 1


def _as_mapping(found: Sensitivity) -> dict[str, object]:
    names = ("cases", "step", "poses", "mean", "mean_linear", "exact", "linear", "failed")
    return {name: getattr(found, name) for name in names}


def _names(studies: Iterable[Study]) -> list[str]:
    """The files in the order in which they are listed."""
    figures = (f"{name}-{of}.{kind}" for name in studies for of in _DRAWN for kind in KINDS)
    return ["sensitivity.csv", "poses.csv", *figures]


def _write(found: dict[Study, Sensitivity], out: Path, head: str) -> None:
    """Write the table, the poses, and two figures of each study."""
    from pkmcal.report.drawing import write_both
    from pkmcal.report.error_figures import errors_by_pose, mean_errors

    first = next(iter(found.values()))
    write_whole(out / "sensitivity.csv", head + _table(found))
    write_poses(out / "poses.csv", first.poses, comment=head)
    with progress("figures") as moved:
        for k, (name, result) in enumerate(found.items()):
            moved(k, len(found))
            title = f"{result.robot.name}: {_TITLES[name]}, {result.step:g} mm"
            for of, draw in zip(_DRAWN, (errors_by_pose, mean_errors), strict=True):
                write_both(draw(result, title), out / f"{name}-{of}")


def _table(found: dict[Study, Sensitivity]) -> str:
    """Means of all studies as CSV."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    units = ["mm" if name in "xyz" else "deg" for name in POSE]
    writer.writerow([
        *("study", "error of"),
        *(f"{how} d{name} [{unit}]" for how in ("mean", "linear")
          for name, unit in zip(POSE, units, strict=True)),
    ])  # fmt: skip
    for name, result in found.items():
        for case, mean, linear in zip(result.cases, result.mean, result.mean_linear, strict=True):
            lengths_and_angles = (mean[:3], mean[3:], linear[:3], linear[3:])
            factors = (1.0, 180 / np.pi, 1.0, 180 / np.pi)
            sizes = np.concatenate([
                part * factor for part, factor in zip(lengths_and_angles, factors, strict=True)
            ])  # fmt: skip
            writer.writerow([name, case, *(f"{size:.6g}" for size in sizes)])
    return text.getvalue()
