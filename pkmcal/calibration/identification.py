"""`Identification`: the result of a calibration."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from pkmcal import arguments
from pkmcal.arrays import FloatArray, as_rows, propagate
from pkmcal.calibration import summary
from pkmcal.core.instruments import points
from pkmcal.diagnostics.breakeven import Breakeven, breakeven, in_words
from pkmcal.diagnostics.checks import AT_ONCE, CHECKS
from pkmcal.diagnostics.diagnosis import findings_of, statements
from pkmcal.diagnostics.drift import Drift
from pkmcal.diagnostics.law_tests import LawTest, law_tests
from pkmcal.diagnostics.measuring_order import MeasuringOrder
from pkmcal.diagnostics.moved import Moved
from pkmcal.diagnostics.verdict import Verdict, diagnose
from pkmcal.display import Table, changed
from pkmcal.effects.expansion import in_words as heat_in_words
from pkmcal.exceptions import ArgumentError, ArgumentTypeError
from pkmcal.fitted.held_numbers import considered_places
from pkmcal.fitted.instruments import CalibratedPicture, pictures
from pkmcal.fitted.instruments import instruments as instruments_of
from pkmcal.fitted.machine_accuracy import UNDETERMINED, machine_accuracy, measured_places
from pkmcal.fitted.row_names import row_names
from pkmcal.fitted.solution import Machine, Solution
from pkmcal.kinematics.calibratable import as_machine, as_parallel
from pkmcal.readings.reading import Reading
from pkmcal.result import Result

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_STRONG = 0.95  # correlation worth a word
_TIED_DECIMALS = 9  # decimals to which correlations differ that are not equal


class Identification(Solution[Machine], Result):
    """The result of `identify`. Arrays are in the order of `free`; mm and rad.

    Its numbers are attributes that its base classes describe: `Solution`, and `HeldOut` for points
    that were not fitted.
    """

    @cached_property
    def _findings(self) -> dict[str, tuple[Any, ...]]:
        """Findings of the checks by name; each is computed when it is first asked for."""
        return {}

    @cached_property
    def warnings(self) -> tuple[str, ...]:
        """Warnings of `identify` about measurements or result."""
        return tuple(each.text for each in statements(self, AT_ONCE, self._findings))

    @cached_property
    def verdict(self) -> Verdict:
        """The verdict: can the result be believed? State, reasons and remarks.

        A robust fit is made beside a linear one where some rows seem to carry it, and what moved is
        looked for where held-out points contradict the fit.
        """
        return diagnose(self, CHECKS, self._findings)

    def _finding(self, name: str) -> Any:
        """The finding of the check of this name; None where it has none."""
        check = next(each for each in CHECKS if each.name == name)
        return next(iter(findings_of(self, check, self._findings)), None)

    @property
    def moved(self) -> tuple[Moved, ...]:
        """Parameters that moved between the fitted measurements and others that were held out.

        Empty where nothing did: where the points held out were drawn from the same measurements,
        and where they do not contradict a fit of several spare equations.
        """
        return self._finding("moved") or ()

    @property
    def drift(self) -> Drift | None:
        """Test of drift of repeated poses; None where too few were repeated."""
        found: Drift | None = self._finding("drift")
        return found

    @property
    def measuring_order(self) -> MeasuringOrder | None:
        """Test of residuals against the order of measuring; None where there are too few."""
        found: MeasuringOrder | None = self._finding("measuring-order")
        return found

    @cached_property
    def breakeven(self) -> tuple[Breakeven, ...]:
        """Errors of held numbers at which the standard deviations are double.

        Of lengths, angles and ratios; without those whose uncertainty is stated.
        """
        return breakeven(self.fit)

    @cached_property
    def law_tests(self) -> tuple[LawTest, ...]:
        """F tests of the free numbers of drive laws, one of each kind, against 0.

        Nothing is said of kinds with a prior, or that the measurements do not determine.
        """
        robot = as_parallel(self.fit.parameters.robot)
        if robot is None:
            return ()
        prior = np.asarray(self.fit.estimate.prior.any(axis=0))[self.columns]
        return law_tests(robot.geometry, self, self.fit.uncertainty, prior)

    @property
    def parameters(self) -> dict[str, dict[str, float]]:
        """Value and standard deviation by name; mm and rad."""
        pairs = zip(self.free, self.values.tolist(), self.stderr.tolist(), strict=True)
        return {name: {"value": value, "stderr": stderr} for name, value, stderr in pairs}

    @property
    def params(self) -> dict[str, dict[str, float]]:
        """`parameters`, as lmfit calls them."""
        return self.parameters

    @property
    def correlations(self) -> tuple[tuple[str, str, float], ...]:
        """Pairs of parameters whose correlation exceeds 0.95 either way, the strongest first."""
        matrix = self.correlation_matrix
        first, second = np.nonzero(np.triu(np.nan_to_num(np.abs(matrix)) > _STRONG, 1))
        pairs = [
            (self.free[i], self.free[j], float(matrix[i, j]))
            for i, j in zip(first, second, strict=True)
        ]
        return tuple(sorted(pairs, key=lambda pair: -round(abs(pair[2]), _TIED_DECIMALS)))

    def _columns(self) -> dict[str, Any]:
        """The parameters: value, deviation and change of each."""
        return {
            "name": self.free,
            "unit": self.units,
            "value": self.values,
            "stderr": self.stderr,
            "start": self.start,
            "change": np.array([*map(changed, self.values, self.start, self.units)]),
        }

    @cached_property
    def instruments(self) -> tuple[Reading, ...]:
        """The instrument of each set as it was found: a camera with its lens where it is.

        Of sessions that of the last row's.
        """
        equations, theta = self.fit.equations, self.fit.end.theta
        sets = range(len(equations.table.sets))
        return tuple([*instruments_of(equations, theta, i)][-1][1] for i in sets)

    @cached_property
    def pictures(self) -> tuple[CalibratedPicture, ...]:
        """Pictures of boards beside the calibration; empty without a camera."""
        return tuple(pictures(self))

    def _by_itself(self) -> FloatArray:
        """Standard deviation of the platform at the measured poses but for its frames, mm (N,)."""
        places = measured_places(self.fit)
        return machine_accuracy(self.fit, places, places)

    def robot_of(self, session: str) -> Machine:
        """The machine with the numbers that it had in a session.

        Parameters
        ----------
        session : str
            One of `sessions`, or one that was held out.

        Raises
        ------
        ValueError
            Another name.
        """
        if session not in self.robots:
            known = ", ".join(map(repr, self.robots)) or "per_session found none"
            raise ArgumentError(f"session: expected one of {known}; found {session!r}")
        return self.robots[session]

    def accuracy(
        self,
        poses: ArrayLike,
        target: ArrayLike | None = None,
        *,
        session: str | None = None,
    ) -> FloatArray:
        """Standard deviation of a point of the identified machine at any pose.

        Parameters
        ----------
        poses : array_like (..., 6), for a serial arm (..., n)
            mm and rad; they need not have been measured. Of a pose that the machine cannot take,
            the coordinates that its file declares are kept (`Robot.complete`). Of an arm its joint
            coordinates.
        target : array_like (3,), optional
            A point of the platform, mm; its origin by default.
        session : str, optional
            One of `sessions`; by default the last, whose machine `robot` is.

        Returns
        -------
        ndarray (...)
            √trace(J C Jᵀ) in mm, the standard deviation of the predicted point, from the
            covariance C of the numbers of the geometry. inf where the point moves along with an
            unidentifiable combination, NaN where the machine has no such pose.
        """
        place = np.zeros(3) if target is None else as_rows("target", target, 3)[0][0]
        chosen = self.fit.parameters
        if session is not None and session not in self.sessions:
            raise ArgumentError(
                f"session: expected one of {', '.join(map(repr, self.sessions)) or 'none'}; found"
                f" {session!r}"
            )
        machine = as_machine(self.robot if session is None else self.robots[session])
        at, actuators, shape = machine.commanded(poses)
        by_numbers = machine.error_twists(at, actuators)[:, :, chosen.places]
        by_geometry = points(at, place)[1] @ by_numbers
        own = chosen.geometry_of(session)
        variance = propagate(by_geometry, self.fit.covariance[np.ix_(own, own)])
        sure = self.fit.uncertainty
        if sure.considered is not None:  # what they move by themselves is no more independent
            follow = sure.reported[own] @ sure.considered
            places, root = considered_places(chosen)
            alone = machine.error_twists(at, actuators)[:, :, places]
            moved_by = points(at, place)[1] @ alone @ root - by_geometry @ follow
            variance += (moved_by**2).sum(axis=(1, 2)) - ((by_geometry @ follow) ** 2).sum(
                axis=(1, 2)
            )
        deviation = np.sqrt(variance)
        undetermined = self.fit.undetermined() * chosen.scale[:, None]
        moved = np.linalg.norm(by_geometry @ undetermined[own], axis=(1, 2))
        return np.where(moved < UNDETERMINED, deviation, np.inf).reshape(shape)

    def plot(self, path: str | PathLike[str] | None = None) -> Figure:
        """Draw the residuals by row, over the workspace and as quantiles.

        Parameters
        ----------
        path : str or path, optional
            A file that ends in ``.png`` or ``.svg``, to be written.

        Returns
        -------
        matplotlib.figure.Figure
            The figure, which notebooks show.

        Raises
        ------
        ValueError, OSError
            Another ending; a file that cannot be written.
        """
        from pkmcal.report import drawing, residual_figure

        figure = residual_figure.residuals(self)
        figure.set_facecolor("white")  # a notebook may be dark, and the texts are
        if path is not None:
            drawing.write(figure, arguments.path("path", path))
        return figure

    def report(
        self,
        folder: str | PathLike[str],
        files: Mapping[str, bytes] | None = None,
        *,
        certificate: str | PathLike[str] | None = None,
        pdf: bool = False,
    ) -> list[Path]:
        """Write the whole calibration as ``report.html``, one file that needs nothing else.

        Beside it the same as data, ``report.json``, and the calibrated robot, ``robot.toml``.

        Parameters
        ----------
        folder : str or path
            An existing folder.
        files : mapping of str to bytes, optional
            What the calibration was made from, by name; their checksums are stated.
        certificate : str or path, optional
            A TOML file with machine, serial, customer, operator, date, instrument, temperature and
            method: the report then begins with a certificate that states the expanded uncertainty
            with its budget, and has room for signatures.
        pdf : bool
            Whether ``report.pdf`` is printed as well, on A4, by a Chromium that is installed.

        Returns
        -------
        list of Path
            What was written.

        Raises
        ------
        ValueError
            A mistake in the file of the certificate; no Chromium for the PDF; one that prints
            nothing, when the other files have been written.
        OSError
            The folder cannot be written.
        """
        from pkmcal.report import certificate as certificates
        from pkmcal.report import report

        if files is not None and not isinstance(files, Mapping):
            raise ArgumentTypeError(
                f"files must map names to bytes, found {arguments.shown(files)}"
            )
        stated = None if certificate is None else certificates.read(certificate)
        place, with_pdf = arguments.path("folder", folder), arguments.flag("pdf", pdf)
        return report.write(self, place, files or {}, stated, with_pdf=with_pdf)

    def summary(self) -> str:
        """Everything a person should know, on one screen."""
        return str(self)

    def _parts(self) -> Iterator[str | Table]:
        verdict = self.verdict
        yield summary.filled("", str(verdict))
        yield from (summary.filled("  also: ", text) for text in verdict.reasons[1:])
        yield from summary.notes(verdict.remarks)
        yield f"{self.robot.name}: {len(self.free)} parameters from {summary.counts(self.read)}"
        if self.sessions:
            yield summary.sessions(self.sessions)
        if heat := heat_in_words(
            self.fit.equations.table.sets, self.expansion, self.fit.parameters.robot
        ):
            yield summary.filled("", heat)
        yield summary.misfit_table(self)
        yield summary.quality(self)
        if self.pictures:
            yield summary.pictures(self.pictures)
            yield summary.by_itself(self._by_itself())
        datasets, chosen = self.fit.equations.prediction.datasets, self.fit.parameters
        framed = len(self.free) > len(chosen.places) or chosen.robot.kind == "arm"
        if self.datum.names:
            yield summary.filled("", str(self.datum))
        yield from summary.limits(
            self,
            len(self.free),
            self.correlations,
            row_names(datasets, self.outliers),
            self.outliers,
            frames=framed and not self.datum.names and not np.isfinite(self.stderr).all(),
        )
        yield from (summary.filled("", str(test)) for test in self.law_tests)
        if self.at_bounds:
            yield summary.bounds(self.at_bounds)
        if self.nuisances:
            yield summary.fitted_along(self.nuisances)
        if doubled := in_words(self.breakeven):
            yield summary.filled("", doubled)
        yield ""
        yield from summary.parameter_rows(self)
        if self.holdout_own:
            yield ""
            yield summary.own_numbers(self)

    def __repr__(self) -> str:
        return (
            f"<Identification: {self.robot.name}, rank {self.rank} of {len(self.free)},"
            f" rms {self.rms_before:.4g} -> {self.rms:.4g} mm>"
        )
