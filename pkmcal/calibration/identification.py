"""`Identification`: the result of a calibration."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pkmcal import arguments
from pkmcal.arms.arm import SerialArm
from pkmcal.arrays import FloatArray, IntArray, as_rows, propagate
from pkmcal.calibration import summary
from pkmcal.calibration.fit import Fit
from pkmcal.calibration.fit_statistics import (
    Identifiability,
    Misfit,
    ParameterTable,
    Repeats,
    SearchRecord,
)
from pkmcal.calibration.holdout import HeldOut
from pkmcal.display import Table
from pkmcal.exceptions import ArgumentTypeError
from pkmcal.kinematics.robot import Robot
from pkmcal.measurements.calibratable import as_machine
from pkmcal.measurements.observation import predict
from pkmcal.result import Result

_STRONG = 0.95  # correlation worth a word
_UNIDENTIFIABLE = 1e-3  # mm a pose moves per mm along an unidentifiable combination

_NAMES = (  # of `to_dict`, in the order in which they are written
    "robot",
    "free",
    "units",
    "values",
    "start",
    "stderr",
    "covariance",
    "rank",
    "gap",
    "unidentifiable",
    "rms",
    "rms_before",
    "holdout_rms",
    "holdout_rms_before",
    "holdout_expected",
    "holdout_unreached",
    "holdout_off",
    "holdout_off_before",
    "chi2_per_dof",
    "dof",
    "noise",
    "repeatability",
    "lack_of_fit",
    "lack_of_fit_chance",
    "observability",
    "residuals",
    "rows",
    "outliers",
    "at_bounds",
    "converged",
    "evaluations",
    "history",
    "warnings",
)


@dataclass(frozen=True, eq=False, repr=False)
class Identification(Result):
    """What `identify` found. Arrays are in the order of `free`; mm and rad.

    Attributes
    ----------
    robot : Robot or SerialArm
        The machine with the identified geometry.
    table : ParameterTable
        The parameters, before and after.
    identifiability : Identifiability
        What the measurements alone determine.
    misfit : Misfit
        Residuals, and what they say of noise and outliers.
    holdout : HeldOut
        Errors of points that were not fitted.
    repeats : Repeats
        Pure error and lack of fit.
    search : SearchRecord
        How the least squares went.
    fit : Fit
        The least-squares problem itself, for reports and the bootstrap.
    warnings : tuple of str
        What looks wrong with measurements or result.
    """

    robot: Robot | SerialArm
    table: ParameterTable
    identifiability: Identifiability
    misfit: Misfit
    holdout: HeldOut
    repeats: Repeats
    search: SearchRecord
    fit: Fit
    warnings: tuple[str, ...] = ()

    @property
    def free(self) -> tuple[str, ...]:
        """Names (n,): numbers of the geometry, then of an unknown frame and unknown targets."""
        return self.table.free

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of each parameter: "mm", "rad" or "1" (a ratio)."""
        return self.table.units

    @property
    def values(self) -> FloatArray:
        """Identified values (n,)."""
        return self.table.values

    @property
    def start(self) -> FloatArray:
        """Values (n,) before the calibration."""
        return self.table.start

    @property
    def stderr(self) -> FloatArray:
        """Standard deviations (n,); inf where neither measurements nor prior determine."""
        return self.table.stderr

    @property
    def covariance(self) -> FloatArray:
        """Covariance (n, n) with stderr² on its diagonal; NaN beside an infinite variance.

        Scaled by the residual only where no sigma was given.
        """
        return self.table.covariance

    @property
    def rank(self) -> int:
        """Number of combinations that the measurements alone determine, without prior."""
        return self.identifiability.rank

    @property
    def gap(self) -> float:
        """Singular value of the last identifiable combination over the next; inf if none."""
        return self.identifiability.gap

    @property
    def unidentifiable(self) -> tuple[str, ...]:
        """Combinations that change no measured quantity, as "base1.x − platform1.x".

        They keep what they had, or follow the prior. Coefficients are in mm at the machine: an
        angle counts as its arc.
        """
        return self.identifiability.unidentifiable

    @property
    def rms(self) -> float:
        """√(Σ r²/N) over the N fitted points, mm.

        Unweighted; r is the distance of the measured from the predicted point, of a pose that of
        its position.
        """
        return self.misfit.rms

    @property
    def rms_before(self) -> float:
        """The same of the nominal machine, unknown frame and targets aligned with the readings."""
        return self.misfit.rms_before

    @property
    def holdout_rms(self) -> float:
        """`rms` of points that were held out; NaN where none were."""
        return self.holdout.rms

    @property
    def holdout_rms_before(self) -> float:
        """`rms_before` of points that were held out; NaN where none were."""
        return self.holdout.rms_before

    @property
    def holdout_expected(self) -> float:
        """What `holdout_rms` should be if noise and covariance are right."""
        return self.holdout.expected

    @property
    def holdout_unreached(self) -> str:
        """Which held-out rows failed and were left out, and why; empty where none."""
        return self.holdout.failures

    @property
    def holdout_off(self) -> FloatArray:
        """Distance of each held-out point from its prediction, mm; NaN where the row failed."""
        return self.holdout.off

    @property
    def holdout_off_before(self) -> FloatArray:
        """The same of the nominal machine."""
        return self.holdout.off_before

    @property
    def chi2_per_dof(self) -> float:
        """χ² per degree of freedom: about 1 if the noise is as stated; NaN without sigma."""
        return self.misfit.chi2_per_dof

    @property
    def dof(self) -> float:
        """Degrees of freedom: equations, those of the prior included, less parameters."""
        return self.misfit.dof

    @property
    def noise(self) -> tuple[float, ...]:
        """Estimated deviation of each set of measurements, mm; NaN where sigma was given."""
        return self.misfit.noise

    @property
    def repeatability(self) -> float:
        """Scatter of repeats about their mean, mm per coordinate; NaN without repeats."""
        return self.repeats.repeatability

    @property
    def lack_of_fit(self) -> float:
        """What the model misses at a pose beyond that scatter, mm per coordinate."""
        return self.repeats.lack_of_fit

    @property
    def lack_of_fit_chance(self) -> float:
        """p-value of the F test of lack of fit: small where the model misses something."""
        return self.repeats.lack_of_fit_chance

    @property
    def observability(self) -> dict[str, float]:
        """Indices O1 … O5 of the scaled Jacobian, over the identifiable combinations."""
        return self.identifiability.observability

    @property
    def residuals(self) -> tuple[FloatArray, ...]:
        """Measured less predicted (N, k) of the fitted rows of each set, mm and rad."""
        return self.misfit.residuals

    @property
    def rows(self) -> IntArray:
        """Numbers of the fitted rows, counted through all sets from 0."""
        return self.misfit.rows

    @property
    def outliers(self) -> tuple[int, ...]:
        """Rows that the others contradict, numbered likewise."""
        return self.misfit.outliers

    @property
    def at_bounds(self) -> tuple[str, ...]:
        """Parameters that ended at a bound."""
        return self.table.at_bounds

    @property
    def converged(self) -> bool:
        """Whether the least squares converged."""
        return self.search.converged

    @property
    def evaluations(self) -> int:
        """How often the forward kinematics of all rows were solved."""
        return self.search.evaluations

    @property
    def history(self) -> tuple[float, ...]:
        """Misfit rms in mm at the start and after each step of the search."""
        return self.search.history

    # the names that lmfit and scipy give ----------------------------------------------------------

    @property
    def success(self) -> bool:
        """`converged`."""
        return self.converged

    @property
    def nfev(self) -> int:
        """`evaluations`."""
        return self.evaluations

    @property
    def covar(self) -> FloatArray:
        """`covariance`."""
        return self.covariance

    @property
    def redchi(self) -> float:
        """`chi2_per_dof`."""
        return self.chi2_per_dof

    @property
    def params(self) -> dict[str, dict[str, float]]:
        """`parameters`."""
        return self.parameters

    # what follows from them -----------------------------------------------------------------------

    @property
    def parameters(self) -> dict[str, dict[str, float]]:
        """Value and standard deviation by name; mm and rad."""
        pairs = zip(self.free, self.values.tolist(), self.stderr.tolist(), strict=True)
        return {name: {"value": value, "stderr": stderr} for name, value, stderr in pairs}

    @property
    def correlation_matrix(self) -> FloatArray:
        """Correlations (n, n); NaN beside parameters that are not determined."""
        scale = np.where(np.isfinite(self.stderr) & (self.stderr > 0), self.stderr, np.nan)
        with np.errstate(invalid="ignore"):
            matrix: FloatArray = self.covariance / np.outer(scale, scale)
        return matrix

    @property
    def correlations(self) -> tuple[tuple[str, str, float], ...]:
        """Pairs of parameters whose correlation exceeds 0.95 either way, the strongest first."""
        matrix = self.correlation_matrix
        first, second = np.nonzero(np.triu(np.nan_to_num(np.abs(matrix)) > _STRONG, 1))
        pairs = [
            (self.free[i], self.free[j], float(matrix[i, j]))
            for i, j in zip(first, second, strict=True)
        ]
        return tuple(sorted(pairs, key=lambda pair: -abs(pair[2])))

    def accuracy(self, poses: ArrayLike, target: ArrayLike | None = None) -> FloatArray:
        """Standard deviation of a point of the identified machine at any pose.

        Parameters
        ----------
        poses : array_like (..., 6), for a serial arm (..., n)
            mm and rad; they need not have been measured. Of an arm its joint coordinates.
        target : array_like (3,), optional
            A point of the platform, mm; its origin by default.

        Returns
        -------
        ndarray (...)
            √trace(J C Jᵀ) in mm, the standard deviation of the predicted point, from the
            covariance C of the numbers of the geometry. inf where the point moves along with an
            unidentifiable combination.
        """
        place = np.zeros(3) if target is None else as_rows("target", target, 3)[0][0]
        chosen = self.fit.parameters
        machine = as_machine(self.robot)
        at, actuators, shape = machine.commanded(poses)
        by_numbers = machine.error_twists(at, actuators)[:, :, chosen.places]
        by_geometry = predict("position", at, place).by_twist @ by_numbers
        k = len(chosen.places)
        deviation = np.sqrt(propagate(by_geometry, self.fit.covariance[:k, :k]))
        undetermined = self.fit.undetermined() * chosen.scale[:, None]
        moved = np.linalg.norm(by_geometry @ undetermined[:k], axis=(1, 2))
        return np.where(moved < _UNIDENTIFIABLE, deviation, np.inf).reshape(shape)

    def to_dict(self) -> dict[str, Any]:
        """All attributes by name, as JSON files hold them."""
        return {name: getattr(self, name) for name in _NAMES}

    def plot(self, path: str | PathLike[str]) -> None:
        """Draw the residuals by row, over the workspace and as quantiles.

        Parameters
        ----------
        path : str or path
            A file that ends in ``.png`` or ``.svg``.

        Raises
        ------
        ValueError, OSError
            Another ending; a file that cannot be written.
        """
        from pkmcal.report import residual_figure

        residual_figure.write(self, arguments.path("path", path))

    def report(
        self, folder: str | PathLike[str], files: Mapping[str, bytes] | None = None
    ) -> list[Path]:
        """Write the whole calibration as ``report.html``, one file that needs nothing else.

        Beside it the same as data, ``report.json``, and the calibrated robot, ``robot.toml``.

        Parameters
        ----------
        folder : str or path
            An existing folder.
        files : mapping of str to bytes, optional
            What the calibration was made from, by name; their checksums are stated.

        Returns
        -------
        list of Path
            What was written.

        Raises
        ------
        OSError
            The folder cannot be written.
        """
        from pkmcal.report import report

        if files is not None and not isinstance(files, Mapping):
            raise ArgumentTypeError(
                f"files must map names to bytes, found {arguments.shown(files)}"
            )
        return report.write(self, arguments.path("folder", folder), files or {})

    def summary(self) -> str:
        """Everything a person should know, on one screen."""
        return str(self)

    def _parts(self) -> Iterator[str | Table]:
        count = len(self.rows)
        yield (
            f"{self.robot.name}: {len(self.free)} parameters from {count} measured"
            f" point{'s' if count > 1 else ''}"
        )
        yield summary.misfit_table(self.misfit, self.holdout)
        yield summary.quality(self.misfit, self.repeats, self.observability)
        yield from summary.limits(
            self.identifiability, len(self.free), self.correlations, self.outliers, self.at_bounds
        )
        if not self.converged:
            yield "not converged"
        yield ""
        yield summary.parameter_rows(self.table)
        yield from (summary.filled("warning: ", text) for text in self.warnings)

    def __repr__(self) -> str:
        return (
            f"<Identification: {self.robot.name}, rank {self.rank} of {len(self.free)},"
            f" rms {self.rms_before:.4g} -> {self.rms:.4g} mm>"
        )
