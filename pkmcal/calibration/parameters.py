"""The parameter vector of a calibration: geometry, instrument frame, targets and attachments.

What one row depends on, its *numbers*, and what the search finds, the *parameters*, are the same
unless some numbers are found anew in each session or set: see `sessions`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from pkmcal.arguments import did_you_mean
from pkmcal.arrays import FloatArray, IntArray, mm_per_unit
from pkmcal.calibration.fit_data import Dependence, FitData, Numbers
from pkmcal.calibration.sessions import NONE, Scope, Spread, label, matches, scopes
from pkmcal.calibration.smoothness import smoothness_rows
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


@dataclass(frozen=True)
class Asked:
    """What `identify` was asked for: its arguments of the same names.

    Attributes
    ----------
    free, prior, bounds
        Of `identify`.
    per_session : tuple of str
        Names or wildcards.
    by_set : frozenset of str
        Of "frame", "target", "attachment" and "anchor", what each set has for itself.
    fix : tuple of str
        Names or wildcards of numbers of the geometry that are held.
    held_points : frozenset of (str, str)
        Unknown points that are held where the user puts them, by role and name.
    """

    free: str | Sequence[str] | None = None
    prior: Prior = None
    bounds: Bounds = None
    per_session: tuple[str, ...] = ()
    by_set: frozenset[str] = frozenset()
    fix: tuple[str, ...] = ()
    held_points: frozenset[tuple[str, str]] = frozenset()


@dataclass(frozen=True, eq=False)
class Parameters:
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
    frame : int or None
        Number of frame.x; None where the frame is known.
    found_along : mapping
        First number of each point, zero or artefact that is found along, by role
        (`Dependence.role`) and name.
    origin : mapping
        Where the six parameters of a frame or tool count from, by the first: the base in the
        instrument's frame, or the tool on the platform, is at this pose (6,) followed by them. Near
        it they are small, and their angles regular.
    robot : Calibratable
        The machine they belong to.
    asked : Asked
        What they were made of.
    bent : ndarray (s,) or None
        By how much tables of drive laws bend, in standard deviations, where that is not 0.
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
    frame: int | None
    found_along: Mapping[tuple[str, str], int]
    origin: Mapping[int, FloatArray]
    robot: Calibratable
    asked: Asked
    bent: FloatArray | None = None

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
        return np.vstack([rows, self._smooth[0] * self.scale])

    def prior_left(self, theta: FloatArray) -> FloatArray:
        """What the prior misses (p,) at `theta`, in standard deviations."""
        own = len(self.prior_rows) - len(self._smooth[1])
        left: FloatArray = self.prior_rows[:own] @ ((self.start - theta) / self.scale)
        return np.concatenate([left, (0.0 if self.bent is None else self.bent) - self.bends(theta)])

    def bends(self, theta: FloatArray) -> FloatArray:
        """How far tables of drive laws bend (s,), in standard deviations."""
        rows, constant = self._smooth
        found: FloatArray = rows @ theta + constant
        return found

    @cached_property
    def _smooth(self) -> tuple[FloatArray, FloatArray]:
        columns = [self.geometry_of(name) for name in self.sessions or (None,)]
        return smoothness_rows(self.robot, self.places, columns, len(self))

    @property
    def geometry(self) -> slice:
        """The parameters that are of the geometry: the first ones."""
        return slice(0, int(np.count_nonzero(self.number_of < len(self.places))))

    @property
    def motions(self) -> tuple[int, ...]:
        """The first parameter of each frame and each tool."""
        numbers = [n for n in (self.frame, self.found_along.get(("tool", ""))) if n is not None]
        return tuple(np.flatnonzero(np.isin(self.number_of, numbers)).tolist())

    def spread(self, datasets: Sequence[FitData]) -> Spread:
        """Which parameters hold in the rows of these sets."""
        place: dict[tuple[str, str], int] = {}
        part_of = []
        for data in datasets:
            session = data.measured.session if "session" in self.scope else None
            behind = data.set_name if "set" in self.scope else ""
            names, mine = [""], np.zeros(len(data.measured), dtype=np.intp)
            if session is not None:
                names, mine = (each.tolist() for each in np.unique(session, return_inverse=True))
            parts = [place.setdefault((name, behind), len(place)) for name in names]
            part_of.append(np.array(parts, dtype=np.intp)[mine])
        columns = np.array([
            [
                self.column.get((number, label(scope, *part)), NONE)
                for number, scope in enumerate(self.scope)
            ]
            for part in place
        ])  # fmt: skip
        return Spread(columns, tuple(part_of), len(self))

    def geometry_of(self, session: str | None = None) -> IntArray:
        """Parameters (g,) of the geometry in a session; in the last one by default."""
        last = self.sessions[-1] if self.sessions else ""
        name = last if session is None else session
        return np.array([
            self.column[number, label(self.scope[number], name, "")]
            for number in range(len(self.places))
        ])  # fmt: skip

    def values_at(self, theta: FloatArray, columns: IntArray | None = None) -> FloatArray:
        """The geometry's values (p,) for `theta` (n,), of a machine whose numbers are `columns`.

        By default that of the last session.
        """
        values: FloatArray = self.robot.geometry.values.copy()
        values[self.places] = theta[self.geometry_of() if columns is None else columns]
        return values

    def aligned(
        self, theta: FloatArray, first: int, frame: FloatArray
    ) -> tuple[Parameters, FloatArray]:
        """Put a frame or tool at `frame` (6,) and count from there.

        Unless a prior or bound is stated. `first` is its first parameter.
        """
        mine, theta = slice(first, first + 6), theta.copy()
        stated = np.isfinite([self.prior[mine], self.lower[mine], self.upper[mine]]).any()
        theta[mine] = frame if stated else 0.0
        origin = {**self.origin, first: np.zeros(6) if stated else frame}
        return replace(self, origin=origin), theta

    def reported(self, theta: FloatArray) -> FloatArray:
        """The parameters (n,) with the numbers of frames and tools counted from zero."""
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
        for i, (name, mine) in enumerate(dependence.sought.items()):
            rows = np.flatnonzero(dependence.index == i)
            first = self.found_along[dependence.role, name]
            numbers[rows[:, None], mine.slots] = first + np.arange(len(mine.slots))
        return numbers


def parameters(
    robot: Calibratable, datasets: Sequence[FitData], asked: Asked, like: Parameters | None = None
) -> Parameters:
    """The parameters of a calibration.

    Parameters
    ----------
    robot : Calibratable
        The machine.
    datasets : sequence of FitData
        What is fitted; or, with `like`, held out.
    asked : Asked
        The arguments of `identify`.
    like : Parameters, optional
        Of the fit, where `datasets` are held out: those of the same names are the same.

    Raises
    ------
    ValueError, TypeError
        An unknown or tied name, nothing free, a prior or a bound that does not fit.
    """
    row = _numbers_of_a_row(robot, datasets, asked)
    blocks = [("frame", slice(row.frame, row.frame + 6))] if row.frame is not None else []
    blocks += [
        (role, slice(first, first + row.width[role, name]))
        for (role, name), first in row.found_along.items()
    ]
    scope = scopes(row.names, blocks, asked.per_session, asked.by_set)
    entries = _entries(row, scope, blocks, datasets, asked.held_points)
    number_of = np.array([number for number, _ in entries], dtype=np.intp)
    names = tuple(row.names[j] + (f"@{behind}" if behind else "") for j, behind in entries)
    units = tuple(row.units[j] for j in number_of)
    travel = max(_travel(robot, data.measured) for data in datasets)
    of_unit = {"mm": 1.0, "rad": 1.0 / robot.length, "1": 1.0 / travel}
    of_unit |= {"1/mm": 1.0 / travel**2, "1/rad": robot.length / travel**2}
    of_unit["1/mm2"] = of_unit["1/mm"] / robot.length
    scale = np.array([of_unit[unit] for unit in units])
    if like is not None:
        known = dict(zip(like.names, like.scale.tolist(), strict=True))
        scale = np.array([known.get(n, own) for n, own in zip(names, scale.tolist(), strict=True)])
    values = np.array(row.start, dtype=np.float64)[number_of]
    count = int(np.count_nonzero(number_of < len(row.places)))
    lower, upper = _bounds(asked.bounds, names, values, strict=like is None)
    made = Parameters(
        names=names,
        units=units,
        start=values,
        scale=scale,
        prior=_prior(asked.prior, names, scale, count, strict=like is None),
        lower=lower,
        upper=upper,
        number_of=number_of,
        scope=tuple(scope),
        column={entry: c for c, entry in enumerate(entries)},
        sessions=_sessions(datasets) if "session" in scope else (),
        places=row.places,
        frame=row.frame,
        found_along=row.found_along,
        origin={},
        robot=robot,
        asked=asked,
    )
    return replace(made, origin={first: np.zeros(6) for first in made.motions})


@dataclass(frozen=True, eq=False)
class _Row:
    """The numbers that a row depends on; see `Parameters`."""

    names: list[str]
    units: list[str]
    start: list[float]
    places: IntArray
    frame: int | None
    found_along: dict[tuple[str, str], int]
    width: dict[tuple[str, str], int]


def _numbers_of_a_row(robot: Calibratable, datasets: Sequence[FitData], asked: Asked) -> _Row:
    geometry, free = robot.geometry, asked.free
    if free is None:
        free = robot.model.free
        if not free:
            raise ArgumentError(f"free: {robot.name} declares no free parameters, name some")
    chosen = geometry.match(free, "free")
    if not chosen:
        raise ArgumentError("free: name at least one parameter")
    if asked.fix:
        held = geometry.match(asked.fix, "fix")
        chosen = [name for name in chosen if name not in held]
        if not chosen:
            raise ArgumentError("fix: no parameter is left free")
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
        for name, mine in dependence.sought.items():
            if (role, name) in found_along:
                if not np.array_equal(known[role, name].start, mine.start):
                    raise ArgumentError(
                        f"{role}: {role} {name} starts at different places in different"
                        " measurements; give different targets different target_names"
                    )
                continue
            found_along[role, name], known[role, name] = len(names), mine
            names += mine.names
            units += mine.units
            start += mine.start.tolist()
    width = {key: len(mine.names) for key, mine in known.items()}
    return _Row(names, units, start, places, frame, found_along, width)


def _sessions(datasets: Sequence[FitData]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(name for data in datasets for name in data.measured.sessions))


def _entries(
    row: _Row,
    scope: Sequence[Scope],
    blocks: Sequence[tuple[str, slice]],
    datasets: Sequence[FitData],
    held: frozenset[tuple[str, str]],
) -> list[tuple[int, str]]:
    """The parameters: the number of a row that each is, and what stands behind the @ of its name.

    Those of the geometry session by session, behind what is common. Points that are held are none.
    """
    own = range(len(row.places))
    found = [(j, "") for j in own if scope[j] == "common"]
    found += [(j, name) for name in _sessions(datasets) for j in own if scope[j] == "session"]
    of_point = {first: (role, name) for (role, name), first in row.found_along.items()}
    for _, block in blocks:
        kind, point = scope[block.start], of_point.get(block.start)
        if point in held:
            continue
        behind = dict.fromkeys(
            label(kind, session, data.set_name)
            for data in datasets
            for session in _where_read(data, point)
        )
        found += [(j, each) for each in behind for j in range(block.start, block.stop)]
    return found


def _where_read(data: FitData, point: tuple[str, str] | None) -> tuple[str, ...]:
    """The sessions in which a set has readings of a point, or of the frame (None)."""
    if point is None:
        return (data.measured.sessions or ("",)) if data.framed else ()
    role, name = point
    for each in data.dependences():
        if each.role == role and name in each.sought:
            mine = each.index == list(each.sought).index(name)
            if mine.any():
                session = data.measured.session
                return ("",) if session is None else tuple(dict.fromkeys(session[mine].tolist()))
    return ()


def _travel(robot: Calibratable, measured: Measurements) -> float:
    """Largest actuator coordinate, mm; an angle counts as its arc."""
    arcs = measured.actuators * mm_per_unit(robot.actuator_units, robot.length)
    return max(1.0, float(np.abs(arcs).max()))


def _matching(argument: str, pattern: object, names: Sequence[str], strict: bool) -> list[int]:
    if not isinstance(pattern, str):
        raise ArgumentTypeError(f"{argument}: names must be str, found {pattern!r}")
    hits = [i for i, name in enumerate(names) if matches(pattern, name)]
    if strict and not hits:
        raise ArgumentError(
            f"{argument}: no free parameter matches {pattern!r}{did_you_mean(pattern, names)}"
        )
    return hits


def _prior(
    prior: Prior, names: Sequence[str], scale: FloatArray, of_machine: int, strict: bool
) -> FloatArray:
    sigma = np.full(len(names), np.inf)
    if prior is None:
        return sigma
    if isinstance(prior, Mapping):
        for pattern, value in prior.items():
            hits = _matching("prior", pattern, names, strict)
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
    bounds: Bounds, names: Sequence[str], start: FloatArray, strict: bool
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
        except (TypeError, ValueError, OverflowError):
            raise ArgumentError(
                f"bounds of {pattern} must be (lower, upper); found {pair!r}"
            ) from None
        for i in _matching("bounds", pattern, names, strict):
            if not low <= start[i] <= high or not low < high:
                raise ArgumentError(
                    f"bounds of {names[i]} must enclose its present value {start[i]:.9g};"
                    f" found {low:g} to {high:g}"
                )
            lower[i], upper[i] = low, high
    return lower, upper
