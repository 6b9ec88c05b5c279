"""The parameter vector of a calibration: geometry, instrument frame, targets and attachments.

What one row depends on, its *numbers*, and what the search finds, the *parameters*, are the same
unless some numbers are of a session or set: see `sessions`.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, IntArray, held_once
from pkmcal.core.poses import compose, compose_rates
from pkmcal.estimation.fit_data import Dependence, FitData
from pkmcal.estimation.own_residuals import Residual, at_parameters, require_true, residual_name
from pkmcal.estimation.prior_functions import PriorFunction
from pkmcal.estimation.sessions import NONE, Scope, label
from pkmcal.estimation.smoothness import smoothness_rows
from pkmcal.estimation.uncertain_numbers import inverse_root
from pkmcal.geometry.stated_uncertainty import NOTHING, StatedUncertainty
from pkmcal.kinematics.calibratable import Calibratable
from pkmcal.readings.unknowns import Nature
from pkmcal.result import ReadOnly

Prior = float | Mapping[str, float | tuple[float, float]] | None
Known = Literal["known", "unknown"]
KNOWN: tuple[Known, ...] = ("known", "unknown")
Bounds = Mapping[str, tuple[float, float]] | None


@dataclass(frozen=True)
class Asked:
    """The arguments of `identify`, by the same names.

    Attributes
    ----------
    free, prior, bounds
        Of `identify`.
    per_session : tuple of str
        Names or wildcards.
    by_set : frozenset of str
        Roles of what each set has for itself.
    fix : tuple of str
        Names or wildcards of numbers of the geometry that are held.
    held_points : frozenset of (str, str)
        Unknown points that are held where the user puts them, by role and name.
    of_effects : mapping of str to float
        Numbers of the geometry that effects free beside `free`, and the standard deviation of what
        is known of each, where `prior` does not name it.
    uncertainty : StatedUncertainty
        How wrong numbers may be that are not free.
    uncertain_roles : frozenset of str
        What readings depend on and is fitted along, since nothing but an uncertainty is stated.
    residuals : tuple of callable
        Residuals that are functions of named numbers.
    """

    free: str | Sequence[str] | None = None
    prior: Prior = None
    bounds: Bounds = None
    per_session: tuple[str, ...] = ()
    by_set: frozenset[str] = frozenset()
    fix: tuple[str, ...] = ()
    held_points: frozenset[tuple[str, str]] = frozenset()
    of_effects: Mapping[str, float] = field(default_factory=dict)
    uncertainty: StatedUncertainty = NOTHING
    uncertain_roles: frozenset[str] = frozenset()
    residuals: tuple[Residual, ...] = ()


@dataclass(frozen=True, eq=False)
class Parameters(ReadOnly):
    """The parameter vector: numbers of the geometry first, then frames and what readings depend on.

    Attributes
    ----------
    names, units : tuple of str, n
        Units "mm", "rad" or "1".
    start : ndarray (n,)
        Present values.
    scale : ndarray (n,)
        What moves the machine by about 1 mm: 1 mm, 1 mm / length, 1 mm / travel.
    prior : ndarray (n,)
        Standard deviation around the present value; inf where there is none.
    lower, upper : ndarray (n,)
        Bounds; infinite where there are none.
    number_of : ndarray of int (n,)
        Which number of a row each parameter is.
    scope : tuple of str, m
        Of each number of a row, whether it is common to all.
    column : mapping
        The parameter that a number is, by the number and what stands behind its @.
    sessions : tuple of str
        For each of which some numbers were found; empty where all are common.
    places : ndarray of int
        Places in the geometry's values of the first numbers.
    nuisance : mapping of (str, str) to int
        First number of what is found beside the geometry, by role (`Dependence.role`) and name:
        of each frame (`FitData.frame`) and of each argument of readings and effects.
    natures : mapping of (str, str) to Nature
        What these are, as readings and effects say it.
    origin : mapping
        Where the six parameters of a frame or carried pose count from, by the first: the base in
        the instrument's frame, or the thing on the platform, is at this pose (6,) followed by them.
        Near it they are small, and their angles regular.
    robot : Calibratable
        The machine they belong to.
    asked : Asked
        What they were made of.
    functions : tuple of PriorFunction
        What is known of functions of numbers.
    residuals : tuple of callable
        What else is known: residuals that are functions of numbers by name.
    uncertain : ndarray of bool (n,)
        Numbers that are not looked for, and fitted along as their uncertainty is stated.
    spread : ndarray (u, u)
        Stated covariance of these.
    drawn : ndarray (s,) or None
        By how much functions of numbers, residuals and bends of tables of drive laws are off what
        is stated of them, in standard deviations, where that is not 0: in replicates of the
        bootstrap.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    start: FloatArray
    scale: FloatArray
    prior: FloatArray
    lower: FloatArray
    upper: FloatArray
    number_of: IntArray
    scope: tuple[Scope, ...]
    column: Mapping[tuple[int, str], int]
    sessions: tuple[str, ...]
    places: IntArray
    nuisance: Mapping[tuple[str, str], int]
    natures: Mapping[tuple[str, str], Nature]
    origin: Mapping[int, FloatArray]
    robot: Calibratable
    asked: Asked
    uncertain: BoolArray
    spread: FloatArray
    functions: tuple[PriorFunction, ...] = ()
    residuals: tuple[Residual, ...] = ()
    drawn: FloatArray | None = None

    def __len__(self) -> int:
        return len(self.names)

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Lower and upper bounds."""
        return self.lower, self.upper

    def prior_rows(self, theta: FloatArray) -> FloatArray:
        """A row (p, n) for each prior at `theta`: its scaled derivative over its deviation.

        First of free parameters, then of uncertain ones, of functions, of residuals, of bends of
        tables.
        """
        return np.vstack([self._of_parameters, self.off_functions(theta)[1] * self.scale])

    def prior_left(self, theta: FloatArray) -> FloatArray:
        """Return the prior's misfit (p,) at `theta`, in standard deviations."""
        left: FloatArray = self._of_parameters @ ((self.start - theta) / self.scale)
        drawn = 0.0 if self.drawn is None else self.drawn
        return np.concatenate([left, drawn - self.off_functions(theta)[0]])

    def off_functions(self, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return misfits of stated functions and bends (s,), in deviations, and by θ (s, n)."""
        rows, constant = self._smooth
        off: FloatArray = rows @ theta + constant
        for each in self.residuals[::-1]:
            values, slopes = at_parameters(
                each, self.by_name, self.rates_by_name, theta, self.scale
            )
            off, rows = np.concatenate([values, off]), np.vstack([slopes, rows])
        if not self.functions:
            return off, rows
        found = [each.at(theta, self.robot, self.places) for each in self.functions]
        sigma = np.array([each.sigma for each in self.functions])
        stated = np.array([each.value for each in self.functions])
        own = (np.array([value for value, _ in found]) - stated) / sigma
        by_theta = np.array([slope for _, slope in found]) / sigma[:, None]
        return np.concatenate([own, off]), np.vstack([by_theta, rows])

    def require_true_residuals(self, theta: FloatArray) -> None:
        """Refuse residuals whose derivatives are not those of their values."""
        for each in self.residuals:
            require_true(each, self.by_name, self.rates_by_name, theta, self.scale, self.names)

    @property
    def prior_names(self) -> list[str]:
        """Names of `prior_rows`, without those of uncertain numbers."""
        stated = [self.names[i] for i in self._stated]
        stated += [each.name for each in self.functions]
        for each in self.residuals:
            stated += [residual_name(each)] * len(
                at_parameters(each, self.by_name, self.rates_by_name, self.start, self.scale)[0]
            )
        return stated + [
            f"the smoothness at {self.names[np.abs(row).argmax()]}"
            for row in self._smooth[0] * self.scale
        ]

    @cached_property
    def _stated(self) -> IntArray:
        """Free parameters with a prior of their own."""
        return np.flatnonzero(np.isfinite(self.prior) & ~self.uncertain)

    @property
    def prior_of_uncertain(self) -> slice:
        """The part of `prior_rows` that is of uncertain numbers."""
        first = len(self._stated)
        return slice(first, first + len(self.spread))

    @cached_property
    def _of_parameters(self) -> FloatArray:
        sigma, stated = self.prior / self.scale, self._stated
        rows: FloatArray = np.eye(len(sigma))[stated] / sigma[stated, None]
        if not len(self.spread):
            return rows
        along = np.zeros((len(self.spread), len(sigma)))
        along[:, self.uncertain] = inverse_root(self.spread) * self.scale[self.uncertain]
        return np.vstack([rows, along])

    @cached_property
    def _smooth(self) -> tuple[FloatArray, FloatArray]:
        columns = [self.geometry_of(name) for name in self.sessions or (None,)]
        return smoothness_rows(self.robot, self.places, columns, len(self))

    @property
    def geometry(self) -> slice:
        """The parameters that are of the geometry: the first ones."""
        return slice(0, int(np.count_nonzero(self.number_of < len(self.places))))

    @cached_property
    def motions(self) -> tuple[int, ...]:
        """The first parameter of each frame and each carried pose."""
        numbers = [self.nuisance[key] for key, nature in self.natures.items() if nature.pose]
        if not numbers:
            return ()
        return tuple(np.flatnonzero(np.isin(self.number_of, numbers)).tolist())

    @cached_property
    def families(self) -> tuple[str, ...]:
        """The kind of each parameter (n,): its name without the limb, or its role beside these."""
        keys = {at: key for key, at in self.nuisance.items()}
        firsts, found = sorted(keys), list[str]()
        for name, number in zip(self.names, self.number_of.tolist(), strict=True):
            at = bisect_right(firsts, number) - 1
            key = keys[firsts[at]] if at >= 0 else ("", "")
            kind = re.sub(r"\d+", "", name.partition("@")[0])
            if (nature := self.natures.get(key)) is not None:
                role = key[0].partition(" ")[0]
                kind = f"{role}.{kind.rpartition('.')[2]}" if nature.alone else role
            found.append(kind)
        return tuple(found)

    def columns_of(self, datasets: Sequence[FitData]) -> tuple[IntArray, tuple[IntArray, ...]]:
        """Return the parameters of a row's numbers.

        Of each part (P, m), rows of one session and one set, with `NONE` where its rows have no
        such number; and the part of each row of each set.
        """
        place: dict[tuple[str, str], int] = {}
        part_of = []
        for data in datasets:
            session = data.measured.session if "session" in self.scope else None
            behind = data.set_name if "set" in self.scope else ""
            names, mine = [""], np.zeros(len(data.measured), dtype=np.intp)
            if session is not None:
                names, mine = (each.tolist() for each in np.unique(session, return_inverse=True))
            parts = [place.setdefault((name, behind), len(place)) for name in names]
            part_of.append(held_once(np.array(parts, dtype=np.intp)[mine]))
        columns = np.array([
            [
                self.column.get((number, label(scope, *part)), NONE)
                for number, scope in enumerate(self.scope)
            ]
            for part in place
        ])  # fmt: skip
        return columns, tuple(part_of)

    def geometry_of(self, session: str | None = None) -> IntArray:
        """Parameters (g,) of the geometry in a session; in the last one by default."""
        last = self.sessions[-1] if self.sessions else ""
        name = last if session is None else session
        columns = [
            self.column[number, label(self.scope[number], name, "")]
            for number in range(len(self.places))
        ]
        return np.array(columns, dtype=np.intp)

    def values_at(self, theta: FloatArray, columns: IntArray | None = None) -> FloatArray:
        """The geometry's values (p,) for `theta` (n,), of a machine whose numbers are `columns`.

        By default that of the last session.
        """
        values: FloatArray = self.robot.geometry.values.copy()
        values[self.places] = theta[self.geometry_of() if columns is None else columns]
        return values

    def by_name(self, theta: FloatArray) -> dict[str, float]:
        """Return all numbers at `theta` (n,) by name: the geometry's and the others.

        What each session has for itself is there by its name with the session alone.
        """
        robot = self.robot  # whose numbers may be tied to others
        values = robot.with_values(self.values_at(theta)).geometry.values
        found = dict(zip(robot.geometry.names, values.tolist(), strict=True))
        for place, scope in zip(self.places.tolist(), self.scope, strict=False):
            if scope != "common":
                del found[robot.geometry.names[place]]
        return found | dict(zip(self.names, self.reported(theta).tolist(), strict=True))

    def rates_by_name(self, theta: FloatArray) -> dict[str, FloatArray]:
        """Derivative (n,) of each of `by_name` by the parameters."""
        geometry, columns = self.robot.geometry, self.geometry_of()
        rates = np.eye(len(geometry.values))
        chain = self.robot.with_values(self.values_at(theta)).geometry.chain
        rates[: len(chain)] = chain
        by_theta = np.zeros((len(rates), len(self)))
        by_theta[:, columns] = rates[:, self.places]
        own = dict(zip(self.names, self.reported_rates(theta), strict=True))
        return dict(zip(geometry.names, by_theta, strict=True)) | own

    def unlaid(self, theta: FloatArray, own: BoolArray | None) -> tuple[Parameters, FloatArray]:
        """Count frames and tools that are to be laid anew from zero, and put them there.

        All that are not known but for an uncertainty; with `own` (n,) those of them.
        """
        free = ~self.uncertain if own is None else own & ~self.uncertain
        laid = [
            first
            for first in self.motions
            if free[first] and self.origin[first].any() and not self._states_place(first)
        ]
        if not laid:
            return self, theta
        theta = theta.copy()
        for first in laid:
            theta[first : first + 6] = 0.0
        return replace(self, origin={**self.origin, **dict.fromkeys(laid, np.zeros(6))}), theta

    def _states_place(self, first: int) -> bool:
        """Return whether a prior or a bound is stated of the frame or tool that begins there."""
        mine = slice(first, first + 6)
        return bool(np.isfinite([self.prior[mine], self.lower[mine], self.upper[mine]]).any())

    def aligned(
        self, theta: FloatArray, first: int, frame: FloatArray
    ) -> tuple[Parameters, FloatArray]:
        """Put a frame or carried pose at `frame` (6,) and count from there.

        Unless a prior or bound is stated. `first` is its first parameter.
        """
        mine, theta = slice(first, first + 6), theta.copy()
        stated = self._states_place(first)
        theta[mine] = frame if stated else 0.0
        origin = {**self.origin, first: np.zeros(6) if stated else frame}
        return replace(self, origin=origin), theta

    def reported(self, theta: FloatArray) -> FloatArray:
        """The parameters (n,) with the numbers of frames and carried poses counted from zero."""
        out: FloatArray = theta.copy()
        for first in self.motions:
            mine = slice(first, first + 6)
            out[mine] = compose(self.origin[first], np.ascontiguousarray(theta[None, mine]))[0]
        return out

    def reported_rates(self, theta: FloatArray) -> FloatArray:
        """Derivative (n, n) of `reported` to the parameters (n,)."""
        rates = np.eye(len(self))
        for first in self.motions:
            mine, nowhere = slice(first, first + 6), np.zeros(6)
            at, origin = np.ascontiguousarray(theta[None, mine]), self.origin[first]
            whole = compose(origin, at)
            rates[mine, mine] = compose_rates(origin, at, nowhere, whole)[0]
        return rates

    def numbers_of(self, dependence: Dependence) -> IntArray:
        """Numbers of an argument in each row, (N, w); `NONE` where one of it is given."""
        numbers = np.full(dependence.given.shape, NONE, dtype=np.intp)
        for i, (name, mine) in enumerate(dependence.estimated.items()):
            rows = np.flatnonzero(dependence.index == i)
            first = self.nuisance[dependence.role, name]
            numbers[rows[:, None], mine.slots] = first + np.arange(len(mine.slots))
        return numbers
