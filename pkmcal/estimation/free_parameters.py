"""Which numbers of a calibration are parameters: what is free, of which sessions and sets.

And with which start, prior and bounds, by the names that the user states.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pkmcal.arguments import did_you_mean, shown
from pkmcal.arrays import FloatArray, IntArray, mm_per_unit
from pkmcal.estimation.fit_data import PLACE, FitData, Numbers
from pkmcal.estimation.parameters import Asked, Bounds, Parameters, Prior
from pkmcal.estimation.prior_functions import is_function, prior_functions
from pkmcal.estimation.sessions import Scope, label, matches, scopes
from pkmcal.exceptions import ArgumentError, ArgumentTypeError
from pkmcal.geometry.load import is_of_load
from pkmcal.kinematics.calibratable import Calibratable
from pkmcal.kinematics.robot import Robot
from pkmcal.measurements.measurements import Measurements

_LEAST_PRIOR, _MOST_PRIOR = 1e-15, 1e15  # mm or rad, whose squares are numbers


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
    pull = max(_pull(robot, data.measured) for data in datasets)
    of_unit |= {"1/N": 1.0 / travel / pull, "N": pull / robot.length}
    scale = np.array([
        _scale(of_unit, names[i], unit) if row.scale[j] is None else row.scale[j]
        for i, (j, unit) in enumerate(zip(number_of.tolist(), units, strict=True))
    ])  # fmt: skip
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
    made = replace(made, origin={first: np.zeros(6) for first in made.motions})
    if not isinstance(asked.prior, Mapping):
        return made
    start = dict(zip(names, zip(values.tolist(), units, strict=True), strict=True))
    columns = {session: made.geometry_of(session) for session in made.sessions or ("",)}
    given = (asked.prior, robot, start, row.places, columns)
    return replace(made, functions=prior_functions(*given, strict=like is None))


def _scale(of_unit: Mapping[str, float], name: str, unit: str) -> float:
    if unit not in of_unit:
        raise ArgumentError(
            f"{name}: its reading has to state by which change, in {unit}, it moves readings as"
            " much as 1 mm of the machine does (the scale of its numbers)"
        )
    return of_unit[unit]


@dataclass(frozen=True, eq=False)
class _Row:
    """The numbers that a row depends on; see `Parameters`."""

    names: list[str]
    units: list[str]
    start: list[float]
    scale: list[float | None]
    places: IntArray
    frame: int | None
    found_along: dict[tuple[str, str], int]
    width: dict[tuple[str, str], int]


def _numbers_of_a_row(robot: Calibratable, datasets: Sequence[FitData], asked: Asked) -> _Row:
    geometry, free = robot.geometry, asked.free
    if free is None:
        free = robot.model.free
        if not free:
            stems = dict.fromkeys(re.sub(r"[0-9].*", "*", name) for name in geometry.names)
            raise ArgumentError(
                f"free: {robot.name} declares no free parameters, name some of {', '.join(stems)};"
                " or state them in its file: [calibration] free = [...]"
            )
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
    scale: list[float | None] = [None] * len(start)
    frame = None
    if any(data.framed for data in datasets):
        frame = len(names)
        names += [f"frame.{axis}" for axis, _ in PLACE]
        units += [unit for _, unit in PLACE]
        start += [0.0] * 6
        scale += [None] * 6
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
            scale += [None] * len(mine.start) if mine.scale is None else mine.scale.tolist()
    width = {key: len(mine.names) for key, mine in known.items()}
    return _Row(names, units, start, scale, places, frame, found_along, width)


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


def _pull(robot: Calibratable, measured: Measurements) -> float:
    """Largest force that is known, N: of tensions, and of a load that they balance."""
    load = robot.model.balanced_load if isinstance(robot, Robot) else None
    forces = [1.0] if load is None else [1.0, *load.force]
    if measured.tension is not None:
        forces.append(float(np.nanmax(np.abs(measured.tension), initial=0.0)))
    return float(np.abs(forces).max())


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
            if is_function(pattern, value):
                continue
            hits = _matching("prior", pattern, names, strict)
            sigma[hits] = _positive(f"prior of {pattern}", value)
    else:
        sigma[:of_machine] = _positive("prior", prior) * scale[:of_machine]
        sigma[[is_of_load(name) for name in names]] = np.inf  # forces are no lengths
    return sigma


def _positive(what: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float | np.integer | np.floating):
        raise ArgumentTypeError(f"{what} must be a number, a standard deviation; found {value!r}")
    if not value > 0:
        raise ArgumentError(f"{what} must be positive; found {value}")
    if not (_LEAST_PRIOR <= value <= _MOST_PRIOR or value == np.inf):
        raise ArgumentError(
            f"{what} must lie between {_LEAST_PRIOR:g} and {_MOST_PRIOR:g}, or be inf; found"
            f" {shown(value)}"
        )
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
