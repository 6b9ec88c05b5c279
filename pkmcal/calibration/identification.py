"""The result of a calibration, and what a person should know about it."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pkmcal import arguments, display
from pkmcal.arrays import FloatArray, as_rows
from pkmcal.calibration.equations import Equations, Point
from pkmcal.calibration.estimator import Estimate
from pkmcal.calibration.identifiability import decompose
from pkmcal.exceptions import ArgumentTypeError
from pkmcal.kinematics.robot import Robot
from pkmcal.measurements.calibratable import as_machine
from pkmcal.measurements.lack_of_fit import SIGNIFICANT
from pkmcal.measurements.observation import predict

_STRONG = 0.95  # correlation worth a word
_UNTOLD = 1e-3  # mm a pose moves per mm along a combination that cannot be told
_WIDTH = 100  # columns of the summary


@dataclass(frozen=True, eq=False, repr=False)
class Identification:
    """What `identify` found. Arrays are in the order of `free`; mm and rad.

    Attributes
    ----------
    robot : Robot
        The machine with the identified geometry.
    free : tuple of str, n
        The parameters: numbers of the geometry, then an unknown frame's and unknown targets'.
    units : tuple of str, n
        "mm", "rad" or "1" (a ratio).
    values, start : ndarray (n,)
        Identified values, and what they were before.
    stderr : ndarray (n,)
        Standard deviations of `values`; inf where neither measurements nor prior tell.
    covariance : ndarray (n, n)
        Its diagonal is stderr². NaN beside an infinite variance. Scaled by the residual only where
        no sigma was given.
    rank : int
        Combinations of the parameters that the measurements tell, without any prior.
    gap : float
        Singular value of the last combination told over that of the first not told; inf where all
        are told.
    unidentifiable : tuple of str
        The combinations that they do not tell, in words. They keep what they had, or follow the
        prior. Shares are in mm at the machine: an angle counts as its arc.
    rms, rms_before : float
        √(Σ r²/N) over the N fitted points, unweighted, r the distance in mm; of poses that of
        their positions. Before: the machine as drawn, with an unknown frame and the unknown
        targets seen from it laid on the readings.
    holdout_rms, holdout_rms_before : float
        The same of points that were held out; NaN where none were.
    holdout_expected : float
        What `holdout_rms` should be if noise and covariance are right.
    holdout_unreached : str
        Which held-out rows the machine does not reach, and were left out; empty where none.
    holdout_off, holdout_off_before : ndarray
        Distance of each held-out point, mm; NaN where it is not reached.
    chi2_per_dof : float
        About 1 if the noise is as stated; NaN where no sigma was given.
    dof : float
        Equations, those of the prior included, less parameters.
    noise : tuple of float
        Of each set of measurements: its deviation in mm as estimated, NaN where sigma was given.
    repeatability : float
        Scatter of repeats about their mean, mm per coordinate; NaN without repeats.
    lack_of_fit : float
        What the model misses at a pose beyond that scatter, mm per coordinate; NaN without repeats.
    lack_of_fit_chance : float
        How likely that much would be if the model were right, by the F test; NaN without repeats.
    observability : dict of str to float
        O1 … O5 of the Jacobian in scaled parameters, over the combinations that are told.
    residuals : tuple of ndarray (N, k)
        Measured less predicted of the fitted rows of each set, mm and rad.
    rows : ndarray of int
        Numbers of the fitted rows, counted through all sets from 0.
    outliers : tuple of int
        Rows that the others contradict, numbered likewise.
    at_bounds : tuple of str
        Parameters that ended at a bound.
    converged : bool
        Whether the least squares did.
    evaluations : int
        How often the machine was solved for all rows.
    history : tuple of float
        Misfit rms in mm at the start and after each step of the search.
    warnings : tuple of str
        What looks wrong with measurements or result.
    """

    robot: Robot
    free: tuple[str, ...]
    units: tuple[str, ...]
    values: FloatArray
    start: FloatArray
    stderr: FloatArray
    covariance: FloatArray
    rank: int
    gap: float
    unidentifiable: tuple[str, ...]
    rms: float
    rms_before: float
    holdout_rms: float
    holdout_rms_before: float
    holdout_expected: float
    holdout_unreached: str
    holdout_off: FloatArray
    holdout_off_before: FloatArray
    chi2_per_dof: float
    dof: float
    noise: tuple[float, ...]
    repeatability: float
    lack_of_fit: float
    lack_of_fit_chance: float
    observability: dict[str, float]
    residuals: tuple[FloatArray, ...]
    rows: NDArray[np.intp]
    outliers: tuple[int, ...]
    at_bounds: tuple[str, ...]
    converged: bool
    evaluations: int
    history: tuple[float, ...]
    warnings: tuple[str, ...]
    _told: FloatArray  # covariance of what is determined, (n, n)
    _equations: Equations
    _start: Point
    _estimate: Estimate

    @property
    def parameters(self) -> dict[str, dict[str, float]]:
        """Value and standard deviation by name; mm and rad."""
        pairs = zip(self.free, self.values.tolist(), self.stderr.tolist(), strict=True)
        return {name: {"value": value, "stderr": stderr} for name, value, stderr in pairs}

    @property
    def correlations(self) -> tuple[tuple[str, str, float], ...]:
        """Pairs of parameters whose correlation exceeds 0.95 either way, the strongest first."""
        scale = np.where(np.isfinite(self.stderr) & (self.stderr > 0), self.stderr, np.nan)
        matrix = self.covariance / np.outer(scale, scale)
        with np.errstate(invalid="ignore"):
            first, second = np.nonzero(np.triu(np.abs(matrix) > _STRONG, 1))
        pairs = [
            (self.free[i], self.free[j], float(matrix[i, j]))
            for i, j in zip(first, second, strict=True)
        ]
        return tuple(sorted(pairs, key=lambda pair: -abs(pair[2])))

    def accuracy(self, poses: ArrayLike, target: ArrayLike | None = None) -> FloatArray:
        """How well the identified machine knows where it is, at any pose.

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
            covariance C of the numbers of the geometry. inf where the point moves along with a
            combination that cannot be told.
        """
        place = np.zeros(3) if target is None else as_rows("target", target, 3)[0][0]
        parameters = self._equations.parameters
        machine = as_machine(self.robot)
        at, actuators, shape = machine.visited(poses)
        by_numbers = machine.error_twists(at, actuators)[:, :, parameters.places]
        by_geometry = predict("position", at, place).by_twist @ by_numbers
        k = len(parameters.places)
        variance = np.einsum(
            "nij,jk,nik->n", by_geometry, self._told[:k, :k], by_geometry, optimize=True
        )
        undetermined = self._untold_here() * parameters.scale[:, None]
        untold = np.linalg.norm(by_geometry @ undetermined[:k], axis=(1, 2))
        known = np.where(untold < _UNTOLD, np.sqrt(variance), np.inf)
        return known.reshape(shape)

    def _untold_here(self) -> FloatArray:
        """Scaled combinations (n, d) that are not determined, at the identified geometry.

        `Estimate.setting` has them at the machine as drawn; they turn with its errors.
        """
        parameters = self._equations.parameters
        sigma = parameters.prior / parameters.scale
        stated = np.flatnonzero(np.isfinite(sigma))
        prior = np.eye(len(sigma))[stated] / sigma[stated, None]
        _, basis = decompose(np.vstack([self._estimate.jacobian, prior]))
        return basis[:, self._estimate.setting.determined.rank :]

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
        from pkmcal.report import drawing, residual_figure

        drawing.write(residual_figure.residuals(self), arguments.path("path", path))

    def report(
        self, folder: str | PathLike[str], files: Mapping[str, bytes] | None = None
    ) -> list[Path]:
        """Write the whole calibration as ``report.html``, one file that needs nothing else.

        Beside it the same as data, ``report.json``, and the calibrated robot, ``robot.toml``.

        Parameters
        ----------
        folder : str or path
            It is there.
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
        blocks = [self._quality(), self._limits(), _parameter_table(self)]
        if self.warnings:
            blocks.append("\n".join(_filled("warning: ", text) for text in self.warnings))
        return "\n".join(block for block in blocks if block)

    def __str__(self) -> str:
        return self.summary()

    def __repr__(self) -> str:
        return (
            f"<Identification of {self.robot.name}: rank {self.rank} of {len(self.free)},"
            f" rms {self.rms_before:.4g} -> {self.rms:.4g} mm>"
        )

    def _quality(self) -> str:
        count = len(self.rows)
        title = (
            f"{self.robot.name}: {len(self.free)} parameters from {count} measured"
            f" point{'s' if count > 1 else ''}"
        )
        rows = [["fitted", _short(self.rms_before), _short(self.rms), ""]]
        if np.isfinite(self.holdout_rms):
            pair = _short(self.holdout_rms_before), _short(self.holdout_rms)
            rows.append(["held out", *pair, f"expected {_short(self.holdout_expected)}"])
        lines = [
            title,
            str(display.Table(["rms [mm]", "before", "after", ""], rows, left=1)).rstrip(),
        ]
        facts = []
        if np.isfinite(self.chi2_per_dof):
            tolerance = np.sqrt(2 / self.dof)
            shown = (
                f"{self.chi2_per_dof:.2f}"
                if self.chi2_per_dof < 100
                else f"{self.chi2_per_dof:.2g}"
            )
            facts.append(f"chi²/dof {shown} (1 ± {tolerance:.2f} expected)")
        estimated = [_short(noise) for noise in self.noise if np.isfinite(noise)]
        if estimated:
            misfit = ", lack of fit included" if self.lack_of_fit_chance < SIGNIFICANT else ""
            facts.append(f"noise {', '.join(estimated)} mm, estimated from the residuals{misfit}")
        if np.isfinite(self.repeatability):
            facts.append(f"repeats scatter by {_short(self.repeatability)} mm")
        if self.lack_of_fit_chance < SIGNIFICANT:
            facts[-1] += f", lack of fit beyond that {_short(self.lack_of_fit)} mm"
        elif np.isfinite(self.lack_of_fit_chance):
            facts[-1] += f", no lack of fit beyond that (p {self.lack_of_fit_chance:.2g})"
        facts.append(" ".join(f"{key} {value:.2g}" for key, value in self.observability.items()))
        lines.append(_filled("", "; ".join(facts)))
        return "\n".join(line.rstrip() for line in "\n".join(lines).splitlines())

    def _limits(self) -> str:
        lines = []
        if self.rank < len(self.free):
            gap = f", gap {self.gap:.0e}" if np.isfinite(self.gap) else ""
            lines.append(f"rank {self.rank} of {len(self.free)}{gap}; not told by measurements:")
            lines += [_filled("  ", text) for text in self.unidentifiable[:4]]
            if len(self.unidentifiable) > 4:
                lines.append(f"  and {len(self.unidentifiable) - 4} more")
        strong = self.correlations
        if strong:
            shown = ", ".join(f"{a} / {b} {value:+.3f}" for a, b, value in strong[:3])
            more = f" and {len(strong) - 3} more" if len(strong) > 3 else ""
            lines.append(_filled("correlated: ", shown + more))
        if self.outliers:
            listed = ", ".join(map(str, self.outliers[:10]))
            more = f" and {len(self.outliers) - 10} more" if len(self.outliers) > 10 else ""
            lines.append(_filled("outliers: ", f"rows {listed}{more}"))
        if self.at_bounds:
            lines.append(_filled("at a bound: ", ", ".join(self.at_bounds)))
        if not self.converged:
            lines.append("not converged")
        return "\n".join(lines)


def _parameter_table(result: Identification) -> str:
    """The parameters in as many columns as one screen takes."""
    columns = 1 if len(result.free) <= 12 else 2 if len(result.free) <= 24 else 3
    heads = ["parameter", "value", "change"] if columns < 3 else ["parameter", "value"]
    cells = []
    for name, unit, value, sigma, start in zip(
        result.free, result.units, result.values, result.stderr, result.start, strict=True
    ):
        shown, shown_unit = display.displayed(float(value), unit)
        deviation, _ = display.displayed(float(sigma), unit)
        change, _ = display.displayed(float(value - start), unit)
        places = display.decimals(deviation) if np.isfinite(deviation) else 4
        label = f"{name} [{shown_unit}]" if shown_unit != "mm" else name
        told = display.with_uncertainty(shown, deviation)
        if not np.isfinite(deviation):
            told = f"{display.fixed(shown, places)} ± {deviation:g}"
        row = [label, told, display.fixed(change, places)]
        cells.append(row[: len(heads)])
    per_column = -(-len(cells) // columns)
    blocks = [
        str(display.Table(heads, cells[k : k + per_column], left=1)).splitlines()
        for k in range(0, len(cells), per_column)
    ]
    height = max(map(len, blocks))
    padded = [block + [" " * len(block[0])] * (height - len(block)) for block in blocks]
    lines = ["   ".join(parts).rstrip() for parts in zip(*padded, strict=True)]
    return "\n".join(["", *lines])


def _short(value: float) -> str:
    return f"{value:.3g}"


def _filled(lead: str, text: str) -> str:
    return textwrap.fill(lead + text, _WIDTH, subsequent_indent=" " * max(len(lead), 2))
