"""The parameter vector of a calibration: geometry, instrument frame, targets and attachments."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from typing import Literal

import numpy as np

from pkmcal.arguments import did_you_mean
from pkmcal.arrays import FloatArray, IntArray, mm_per_unit
from pkmcal.calibration.fit_data import Dependence, FitData, Numbers
from pkmcal.core.poses import compose, compose_rates
from pkmcal.exceptions import ArgumentError, ArgumentTypeError
from pkmcal.measurements.calibratable import Calibratable
from pkmcal.measurements.measurements import Measurements

Prior = float | Mapping[str, float] | None
Known = Literal["known", "unknown"]
KNOWN: tuple[Known, ...] = ("known", "unknown")
Bounds = Mapping[str, tuple[float, float]] | None

_FRAME = (
    ("x", "mm"), ("y", "mm"), ("z", "mm"), ("alpha", "rad"), ("beta", "rad"), ("gamma", "rad"),
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Parameters:
    """The parameter vector: numbers of the geometry first, then frame and what readings depend on.

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
    places : ndarray of int
        Places in the geometry's values of the first names.
    frame : int or None
        Column of frame.x; None where the frame is known.
    origin : ndarray (6,)
        Where the frame's six numbers count from: the base in the instrument's frame is at `origin`
        followed by them. Near it they are small, and their angles regular.
    found_along : mapping
        First column of the numbers of each point, zero or artefact that is found along, by role
        (`Dependence.role`) and name.
    robot : Calibratable
        The machine they belong to.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    start: FloatArray
    scale: FloatArray
    prior: FloatArray
    lower: FloatArray
    upper: FloatArray
    places: IntArray
    frame: int | None
    origin: FloatArray
    found_along: Mapping[tuple[str, str], int]
    robot: Calibratable

    def __len__(self) -> int:
        return len(self.names)

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Lower and upper bounds."""
        return self.lower, self.upper

    @property
    def prior_rows(self) -> FloatArray:
        """A row (p, n) for each parameter with a prior: one over its scaled deviation."""
        sigma = self.prior / self.scale
        stated = np.flatnonzero(np.isfinite(sigma))
        rows: FloatArray = np.eye(len(sigma))[stated] / sigma[stated, None]
        return rows

    def values_at(self, theta: FloatArray) -> FloatArray:
        """The geometry's values (p,) for `theta` (n,)."""
        values: FloatArray = self.robot.geometry.values.copy()
        values[self.places] = theta[: len(self.places)]
        return values

    def frame_at(self, theta: FloatArray) -> FloatArray | None:
        """Pose (6,) of the base counted from `origin`; None where the frame is known."""
        return None if self.frame is None else theta[self.frame : self.frame + 6]

    def aligned(self, theta: FloatArray, frame: FloatArray) -> tuple[Parameters, FloatArray]:
        """Put the base at `frame` (6,) and count from there, unless a prior or bound is stated."""
        assert self.frame is not None
        mine, theta = slice(self.frame, self.frame + 6), theta.copy()
        stated = np.isfinite([self.prior[mine], self.lower[mine], self.upper[mine]]).any()
        theta[mine] = frame if stated else 0.0
        return replace(self, origin=np.zeros(6) if stated else frame), theta

    def reported(self, theta: FloatArray) -> FloatArray:
        """The parameters (n,) with the frame's numbers counted from zero."""
        if self.frame is None:
            return theta
        out: FloatArray = theta.copy()
        mine = slice(self.frame, self.frame + 6)
        out[mine] = compose(self.origin, np.ascontiguousarray(theta[None, mine]))[0]
        return out

    def reported_rates(self, theta: FloatArray) -> FloatArray:
        """Derivative (n, n) of `reported` to the parameters (n,)."""
        rates = np.eye(len(self))
        if self.frame is not None:
            mine, nowhere = slice(self.frame, self.frame + 6), np.zeros(6)
            at = np.ascontiguousarray(theta[None, mine])
            whole = compose(self.origin, at)
            rates[mine, mine] = compose_rates(self.origin, at, nowhere, whole)[0]
        return rates

    def columns_of(self, dependence: Dependence) -> IntArray:
        """Columns of the argument of each row, (N, w); -1 where a number of it is given."""
        columns = np.full(dependence.given.shape, -1, dtype=np.intp)
        for i, (name, numbers) in enumerate(dependence.sought.items()):
            first = self.found_along.get((dependence.role, name))
            if first is None:
                known = did_you_mean(name, (other for _, other in self.found_along))
                role = dependence.role.partition(" ")[0]
                raise ArgumentError(f"holdout: {role} {name!r} was not fitted{known}")
            rows = np.flatnonzero(dependence.index == i)
            columns[rows[:, None], numbers.slots] = first + np.arange(len(numbers.slots))
        return columns


def parameters(
    robot: Calibratable,
    datasets: Sequence[FitData],
    free: str | Sequence[str] | None,
    prior: Prior,
    bounds: Bounds,
) -> Parameters:
    """The parameters of a calibration; the arguments are those of `identify`.

    Raises
    ------
    ValueError, TypeError
        An unknown or tied name, nothing free, a prior or a bound that does not fit.
    """
    geometry = robot.geometry
    if free is None:
        free = robot.model.free
        if not free:
            raise ArgumentError(f"free: {robot.name} declares no free parameters, name some")
    chosen = geometry.match(free, "free")
    if not chosen:
        raise ArgumentError("free: name at least one parameter")
    places = np.array([geometry.names.index(name) for name in chosen], dtype=np.intp)
    names, units = list(chosen), [str(geometry.units[i]) for i in places]
    start = list(geometry.values[places])
    frame = None
    if any(data.framed for data in datasets):
        frame = len(names)
        names += [f"frame.{axis}" for axis, _ in _FRAME]
        units += [unit for _, unit in _FRAME]
        start += [0.0] * 6
    found_along: dict[tuple[str, str], int] = {}
    known: dict[tuple[str, str], Numbers] = {}
    for dependence in (each for data in datasets for each in data.dependences()):
        role = dependence.role
        for name, numbers in dependence.sought.items():
            if (role, name) in found_along:
                if (known[role, name].start != numbers.start).any():
                    raise ArgumentError(
                        f"{role}: {role} {name} starts at different places in different"
                        " measurements; give different targets different target_names"
                    )
                continue
            found_along[role, name], known[role, name] = len(names), numbers
            names += numbers.names
            units += numbers.units
            start += list(numbers.start)
    travel = max(_travel(robot, data.measured) for data in datasets)
    of_unit = {"mm": 1.0, "rad": 1.0 / robot.length, "1": 1.0 / travel}
    scale = np.array([of_unit[unit] for unit in units])
    values = np.array(start, dtype=np.float64)
    lower, upper = _bounds(bounds, names, values)
    return Parameters(
        names=tuple(names),
        units=tuple(units),
        start=values,
        scale=scale,
        prior=_prior(prior, names, scale, len(chosen)),
        lower=lower,
        upper=upper,
        places=places,
        frame=frame,
        origin=np.zeros(6),
        found_along=found_along,
        robot=robot,
    )


def _travel(robot: Calibratable, measured: Measurements) -> float:
    """Largest actuator coordinate, mm; an angle counts as its arc."""
    arcs = measured.actuators * mm_per_unit(robot.actuator_units, robot.length)
    return max(1.0, float(np.abs(arcs).max()))


def _matching(argument: str, pattern: object, names: Sequence[str]) -> list[int]:
    if not isinstance(pattern, str):
        raise ArgumentTypeError(f"{argument}: names must be str, found {pattern!r}")
    hits = [i for i, name in enumerate(names) if fnmatchcase(name, pattern)]
    if not hits:
        raise ArgumentError(
            f"{argument}: no free parameter matches {pattern!r}{did_you_mean(pattern, names)}"
        )
    return hits


def _prior(prior: Prior, names: Sequence[str], scale: FloatArray, of_machine: int) -> FloatArray:
    sigma = np.full(len(names), np.inf)
    if prior is None:
        return sigma
    if isinstance(prior, Mapping):
        for pattern, value in prior.items():
            hits = _matching("prior", pattern, names)
            sigma[hits] = _positive(f"prior of {pattern}", value)
    else:
        sigma[:of_machine] = _positive("prior", prior) * scale[:of_machine]
    return sigma


def _positive(what: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float | np.integer | np.floating):
        raise ArgumentTypeError(f"{what} must be a number, a standard deviation; found {value!r}")
    if not value > 0:
        raise ArgumentError(f"{what} must be positive; found {value}")
    return float(value)


def _bounds(
    bounds: Bounds, names: Sequence[str], start: FloatArray
) -> tuple[FloatArray, FloatArray]:
    lower, upper = np.full(len(names), -np.inf), np.full(len(names), np.inf)
    if bounds is None:
        return lower, upper
    if not isinstance(bounds, Mapping):
        raise ArgumentTypeError(
            f"bounds must map names to (lower, upper); found {type(bounds).__name__}"
        )
    for pattern, pair in bounds.items():
        try:
            low, high = (float(end) for end in pair)
        except (TypeError, ValueError):
            raise ArgumentError(
                f"bounds of {pattern} must be (lower, upper); found {pair!r}"
            ) from None
        for i in _matching("bounds", pattern, names):
            if not low <= start[i] <= high or not low < high:
                raise ArgumentError(
                    f"bounds of {names[i]} must enclose its present value {start[i]:.9g};"
                    f" found {low:g} to {high:g}"
                )
            lower[i], upper[i] = low, high
    return lower, upper
