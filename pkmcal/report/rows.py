"""Every row of a calibration: its name, its place, and how far off it is before and after."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, IntArray
from pkmcal.calibration.identification import Identification
from pkmcal.estimation import misfits
from pkmcal.estimation.equations import Equations
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.fitted.instruments import Use, parts_of
from pkmcal.fitted.row_names import name_of
from pkmcal.report.residual_vectors import measured_places, residual_vectors


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows of a calibration, the fitted ones first.

    Attributes
    ----------
    row : ndarray of int (N,)
        Numbers of the rows, through all files; of another file that is held out its own.
    name : tuple of str
        Line of the file, pose and target.
    use : tuple of {"fitted", "held out", "left out"}
        What became of each.
    at : ndarray (N, 3)
        The measured point in the robot's base frame, mm, by the identified machine.
    before, after : ndarray (N, 3)
        Residuals as vectors in the base frame, mm; NaN of angles, and where nothing was read.
    off_before, off : ndarray (N,)
        Distances from what was measured, mm; NaN as above.
    outlier : ndarray of bool (N,)
        Whether the others contradict it.
    """

    row: IntArray
    name: tuple[str, ...]
    use: tuple[Use, ...]
    at: FloatArray
    before: FloatArray
    after: FloatArray
    off_before: FloatArray
    off: FloatArray
    outlier: BoolArray


def rows(found: Identification) -> Rows:
    """List every row of a calibration; rows that are left out or held out have residuals, too.

    Examples
    --------
    >>> import pkmcal as pk
    >>> robot = pk.load("hexapod")
    >>> measured = pk.VirtualMachine(robot, noise=0.01).measure(
    ...     robot.inverse(pk.sample_poses(robot, 20))
    ... )
    >>> listed = rows(pk.identify(robot, measured, free=["offset1"], drop=[4]))
    >>> len(listed.row), listed.name[-1], listed.use[-1], bool(listed.off[-1] < 0.1)
    (20, 'row 4', 'left out', True)
    """
    parts = list(_parts(found))

    def joined(name: str) -> FloatArray:
        return np.concatenate([getattr(part, name) for part in parts])

    return Rows(
        joined("row").astype(np.intp),
        tuple(name for part in parts for name in part.name),
        tuple(use for part in parts for use in part.use),
        joined("at"),
        joined("before"),
        joined("after"),
        joined("off_before"),
        joined("off"),
        joined("outlier").astype(bool),
    )


def _parts(found: Identification) -> Iterator[Rows]:
    for equations, start, end, use, odd in parts_of(found):
        yield _rows(equations, start, end, use, odd)


def _rows(
    equations: Equations, start: Evaluation, end: Evaluation, use: Use, odd: tuple[int, ...]
) -> Rows:
    datasets = equations.prediction.datasets
    numbers = equations.table.rows
    return Rows(
        numbers,
        tuple(name_of(data, i) for data in datasets for i in range(len(data.rows))),
        (use,) * len(numbers),
        measured_places(equations, end),
        residual_vectors(equations, start),
        residual_vectors(equations, end),
        misfits.distances(equations, start),
        misfits.distances(equations, end),
        np.isin(numbers, odd),
    )
