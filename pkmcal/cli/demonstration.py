"""`pkmcal demo`: a simulated machine is measured, identified and commanded with less error."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from pkmcal import display
from pkmcal.arguments import checked_seed
from pkmcal.arrays import FloatArray, rms
from pkmcal.calibration.identification import Identification
from pkmcal.calibration.identify import identify
from pkmcal.cli.options import Force, Json, Seed
from pkmcal.cli.output import say
from pkmcal.cli.progress import progress
from pkmcal.files import provenance
from pkmcal.files.atomic import write_whole
from pkmcal.jobs.inputs import Inputs
from pkmcal.jobs.output import Output, seal
from pkmcal.kinematics.robot import Robot
from pkmcal.loading import load
from pkmcal.measurements.measurements import Measurements
from pkmcal.measurements.virtual_machine import VirtualMachine
from pkmcal.report.as_json import as_json
from pkmcal.report.drawing import BLUE, FAINT, ORANGE, empty_figure, encoded, in_context
from pkmcal.result import Result

MACHINE = "2tpr2tps"
SIGMA = 0.5  # mm, of each of its 28 errors
NOISE = 0.02  # mm, of each coordinate the tracker reads
MEASURED, CHECKED = 30, 100  # poses
REFLECTORS = ((0.0, 100.0, 0.0), (0.0, -100.0, 0.0))  # on the platform, mm: one tells no tilt

# Where poses are drawn: y and z in mm, alpha and beta in degrees
_LOWEST = np.array([-80.0, 330.0, -20.0, -20.0])
_HIGHEST = np.array([80.0, 450.0, 20.0, 20.0])
FILES = {
    "measured.csv": "measurements by the tracker",
    "checked.csv": f"the same at the {CHECKED} other poses",
    "corrected.csv": "corrected leg lengths for these poses",
    "error.png": "the error of each pose before and after",
    "robot.toml": "the calibrated machine",
    "report.json": "all results as data",
    "report.html": "the report, which moves the machine: open it in a browser",
}
_MARGIN = 5.0  # mm that a leg keeps from the ends of its stroke, for its errors


def demo(
    out: Annotated[Path, typer.Option(metavar="DIR", help="Where the files go.")] = Path(
        "pkmcal-demo"
    ),
    seed: Seed = 1,
    force: Force = False,
    json: Json = False,
) -> int:
    """Calibrate a simulated machine from beginning to end.

    A 2TPR&2TPS with 28 unknown errors is measured by a tracker, identified, and sent to poses
    that were not measured; its error there before and after is printed. The report that it writes
    shows the machine and moves it.

    Example: pkmcal demo --seed 7 --out my-demo
    """
    output = Output(out, list(FILES), Inputs(), force)
    with progress("demonstration"):
        result = demonstrate(seed)
        with output.draft() as draft:
            result.write(draft)
    if json:
        say(as_json(result, schema="demo"))
    else:
        listed = [[str(out / name), what] for name, what in FILES.items()]
        say(f"{result}\n\n{display.Table(['file', 'content'], listed, left=2)}")
    return 0 if result.trusted else 1


@dataclass(frozen=True, eq=False, repr=False)
class Demonstration(Result):
    """Result of `demonstrate`; poses are x y z in mm and alpha beta gamma in rad.

    Attributes
    ----------
    seed : int
        Of errors, poses and noise.
    true_robot : Robot
        The machine with its errors, which the identification does not know.
    measured : Measurements
        Measurements by the tracker.
    checked : Measurements
        The same at `poses`, which are held out.
    identification : Identification
        The result of the identification.
    poses : ndarray (M, 6)
        Where the machine was to go; none of these was measured.
    ideal, corrected : ndarray (M, n)
        Leg lengths in mm by the nominal and by the identified geometry.
    before, after : ndarray (M,)
        Distance in mm from where the machine went with these.
    tilt_before, tilt_after : ndarray (M,)
        The same of its orientation, rad.
    expected : float
        Root mean square of `after` that the covariance of the identification predicts, mm.
    """

    seed: int
    true_robot: Robot
    measured: Measurements
    checked: Measurements
    identification: Identification
    poses: FloatArray
    ideal: FloatArray
    corrected: FloatArray
    before: FloatArray
    after: FloatArray
    tilt_before: FloatArray
    tilt_after: FloatArray
    expected: float

    @property
    def trusted(self) -> bool:
        """True if the calibration converged as expected."""
        found = self.identification
        return found.converged and not found.warnings and rms(self.after) < 2 * self.expected

    def _parts(self) -> Iterator[str | display.Table]:
        found = self.identification
        yield "\n".join([
            f"{self.true_robot.name} with {len(found.free)} unknown errors of its geometry,"
            f" sigma {SIGMA} mm (simulated, seed {self.seed})",
            f"measured    {MEASURED} tilted poses within the strokes, two reflectors at each, by a"
            f" tracker good to {NOISE} mm a coordinate",
            f"identified  misfit {found.rms_before:.3f} -> {found.rms:.3f} mm rms; rank"
            f" {found.rank} of {len(found.free)} parameters",
            f"commanded   {len(self.poses)} other poses, by leg lengths of the identified geometry",
            "",
            "distance from the commanded position at these other poses",
        ])  # fmt: skip
        rows = [
            [name, *(f"{value:.3f}" for value in (error.mean(), rms(error), error.max()))]
            for name, error in (("before", self.before), ("after", self.after))
        ]
        yield display.Table(["[mm]", "mean", "rms", "largest"], rows, left=1)
        gone = 100 * (1 - self.after.mean() / self.before.mean())
        yield (
            f"The mean falls by {gone:.1f} %. Expected: rms {self.expected:.3f} mm; the noise of"
            f" one measured point is {NOISE * np.sqrt(3):.3f} mm."
        )
        tilts = (f"{np.degrees(rms(tilt)):.3f}" for tilt in (self.tilt_before, self.tilt_after))
        yield (
            f"Orientation error {' -> '.join(tilts)} deg rms: positions of two points determine it,"
            " those of one do not."
        )

    def write(self, folder: Path) -> None:
        """Write measurements and results, the `FILES`, to an existing folder."""
        measured, checked, corrected, picture, *_ = (folder / name for name in FILES)
        machine = Inputs()
        machine.robot(MACHINE)
        for readings, file in ((self.measured, measured), (self.checked, checked)):
            readings.write(file, machine.comment())
        read = machine.contents() | {file.name: seal(file) for file in (measured, checked)}
        write_whole(corrected, provenance.comment(read) + _commands(self))
        write_whole(picture, _figure(self))
        self.identification.report(folder, read)


def demonstrate(seed: int = 1) -> Demonstration:
    """Calibrate the 2TPR&2TPS of the paper with 28 errors drawn at random.

    Parameters
    ----------
    seed : int
        Of errors, poses and noise.

    Returns
    -------
    Demonstration
        Its `str` is the story; `write` makes the files.

    Examples
    --------
    >>> result = demonstrate()
    >>> result.identification.rank, bool(result.after.max() < 0.1 * result.before.max())
    (26, True)
    """
    random = np.random.default_rng(checked_seed(seed))
    nominal = load(MACHINE)
    free = nominal.model.free
    drawn = dict(zip(free, random.normal(0.0, SIGMA, len(free)), strict=True))
    true = nominal.replace({name: nominal.geometry[name] + error for name, error in drawn.items()})

    machine = VirtualMachine(true, noise=NOISE, seed=int(random.integers(2**32)))
    measured = _both(machine, nominal.inverse(_poses(random, nominal, MEASURED)))
    poses = _poses(random, nominal, CHECKED)
    checked = _both(machine, nominal.inverse(poses))
    found = identify(nominal, measured, prior=SIGMA, holdout=checked)

    assert isinstance(found.robot, Robot)  # as was given
    ideal, corrected = nominal.inverse(poses), found.robot.inverse(poses)
    off = [true.forward(q).pose - poses for q in (ideal, corrected)]
    before, after = (np.linalg.norm(error[:, :3], axis=1) for error in off)
    tilt_before, tilt_after = (np.linalg.norm(error[:, 3:], axis=1) for error in off)
    return Demonstration(
        seed=seed,
        true_robot=true,
        measured=measured,
        checked=checked,
        identification=found,
        poses=poses,
        ideal=ideal,
        corrected=corrected,
        before=before,
        after=after,
        tilt_before=tilt_before,
        tilt_after=tilt_after,
        expected=rms(found.accuracy(poses)),
    )


def _both(machine: VirtualMachine, q: FloatArray) -> Measurements:
    """Measure both reflectors at each row of coordinates."""
    rows = np.repeat(q, len(REFLECTORS), axis=0)
    return machine.measure(rows, target=np.tile(REFLECTORS, (len(q), 1)))


def _poses(random: np.random.Generator, robot: Robot, count: int) -> FloatArray:
    """Poses that the machine reaches within its strokes: x = z tan beta, gamma = 0 (eq. 7)."""
    drawn = random.uniform(_LOWEST, _HIGHEST, (20 * count, 4)).round(1)
    (y, z), (alpha, beta) = drawn[:, :2].T, np.radians(drawn[:, 2:]).T
    poses: FloatArray = np.stack([z * np.tan(beta), y, z, alpha, beta, 0.0 * y], axis=1)
    shortest, longest = np.transpose([limb.stroke for limb in robot.model.limbs])
    q = robot.inverse(poses)
    reached = ((q > shortest + _MARGIN) & (q < longest - _MARGIN)).all(axis=1)
    kept: FloatArray = poses[reached][:count]
    return kept


def _commands(result: Demonstration) -> str:
    """Poses with the leg lengths that lead to them, as CSV."""
    n = result.corrected.shape[1]
    text = io.StringIO()
    text.write("# q: leg lengths by the identified geometry; dq: by how much they were corrected\n")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([
        *("x [mm]", "y [mm]", "z [mm]", "alpha [deg]", "beta [deg]", "gamma [deg]"),
        *(f"q{i + 1} [mm]" for i in range(n)),
        *(f"dq{i + 1} [mm]" for i in range(n)),
    ])  # fmt: skip
    poses = np.concatenate([result.poses[:, :3], np.degrees(result.poses[:, 3:])], axis=1)
    rows = np.concatenate([poses, result.corrected, result.corrected - result.ideal], axis=1)
    writer.writerows([display.fixed(float(value), 4) for value in row] for row in rows)
    return text.getvalue()


@in_context
def _figure(result: Demonstration) -> bytes:
    """Draw the error of each pose before and after, as PNG."""
    figure = empty_figure(7.5, 4.0)
    axes = figure.subplots()
    number = np.arange(1, len(result.poses) + 1)
    axes.semilogy(number, result.before, "o", ms=4, color=ORANGE, label="before")
    axes.semilogy(number, result.after, "o", ms=4, color=BLUE, label="after")
    noise = NOISE * np.sqrt(3)
    axes.axhline(noise, color=FAINT, lw=1, ls="--", label="noise of one measured point")
    axes.set(
        title=f"{result.true_robot.name}: error at poses that were not measured",
        xlabel="pose",
        ylabel="distance from the\ncommanded position [mm]",
        xlim=(0, len(number) + 1),
    )
    axes.yaxis.set_major_formatter("{x:g}")
    axes.grid(axis="y")
    figure.legend(loc="outside lower center", ncols=3)
    return encoded(figure, "png")
