"""How well a calibration fits, under the flat names by which users read it."""

from __future__ import annotations

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.calibration.distances import Distances
from pkmcal.calibration.fit_statistics import Misfit, Repeats
from pkmcal.calibration.holdout import HeldOut


class MisfitNames:
    """The names of what `Misfit`, `Repeats` and `HeldOut` say."""

    misfit: Misfit
    holdout: HeldOut
    repeats: Repeats

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
    def closure_rms(self) -> float:
        """How far the machine's own closures disagree at the poses found, mm of the actuators.

        NaN where poses follow from the actuators exactly: as many closures as free coordinates, and
        no `Measurements.actuator_sigma`.
        """
        return self.misfit.closure_rms

    @property
    def closure_rms_before(self) -> float:
        """The same of the nominal machine."""
        return self.misfit.closure_rms_before

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
        """Estimated deviation of each set of measurements, mm; NaN where sigma was given.

        That of residuals: what a reading has of its own and what its pose shares, the model's error
        included. NaN, too, where no equations are left to show it.
        """
        return self.misfit.noise

    @property
    def component_noise(self) -> tuple[tuple[float, ...], ...]:
        """The same of each component, mm and rad.

        Components are told apart where the residuals call for it: lengths and angles, x y and z.
        """
        return self.misfit.component_noise

    @property
    def reading_noise(self) -> tuple[float, ...]:
        """What a single reading of each set has of its own, mm per coordinate."""
        return self.misfit.reading_noise

    @property
    def pose_noise(self) -> tuple[float, ...]:
        """What rows of one pose share beside it, mm per coordinate: pose and model errors."""
        return self.misfit.pose_noise

    @property
    def actuator_noise(self) -> float:
        """Estimated deviation of what the actuators read, mm; NaN where it was stated."""
        return self.misfit.actuator_noise

    @property
    def tension_noise(self) -> float:
        """Estimated deviation of what load cells read, N; NaN where it was stated."""
        return self.misfit.tension_noise

    @property
    def tension_rms(self) -> float:
        """How far tensions are off what load cells read, N; NaN where they are no unknowns."""
        return self.misfit.tension_rms

    @property
    def redundancy(self) -> tuple[float, ...]:
        """Degrees of freedom left in each set, then in load cells and closures if fitted.

        Equations less what poses and parameters took of them; a deviation estimated from r of them
        is itself good to 1/√(2 r) of it.
        """
        return self.misfit.redundancy

    @property
    def idle(self) -> int:
        """How many poses say nothing, for nothing is left when they are determined."""
        return self.misfit.idle

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
    def distances_before(self) -> Distances:
        """Rms, median and 95 % quantile of the nominal machine's distances to fitted points, mm."""
        return self.misfit.before

    @property
    def distances(self) -> Distances:
        """The same of the calibrated machine, and its rms without `outliers`."""
        return self.misfit.after

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
        """What `holdout_rms` should be if noise and covariance are right; NaN if not known."""
        return self.holdout.expected

    @property
    def holdout_contradicts(self) -> bool:
        """Whether the held-out points contradict the fit: by chance, by rms and by median."""
        return self.holdout.contradicts

    @property
    def holdout_chance(self) -> float:
        """p-value of `holdout_rms`: small where fit, noise or covariance are wrong; else NaN."""
        return self.holdout.chance

    @property
    def holdout_outliers(self) -> tuple[int, ...]:
        """Held-out rows further off than expected, numbered in what was given."""
        return self.holdout.odd

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
    def holdout_distances_before(self) -> Distances:
        """`distances_before` of the points held out."""
        return self.holdout.before

    @property
    def holdout_distances(self) -> Distances:
        """`distances` of the points held out; outliers are `holdout_outliers`."""
        return self.holdout.after
