"""Choice of the parameters of a calibration: what is free, in which sessions and sets.

And with which start; `priors_and_bounds` has what is stated of each by its name.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.estimation.fit_data import FRAME, PLACE, FitData, Numbers
from pkmcal.estimation.own_residuals import (
    ROLE,
    Residual,
    at_parameters,
    brought_numbers,
    residual_name,
)
from pkmcal.estimation.parameters import Asked, Parameters
from pkmcal.estimation.prior_functions import prior_functions
from pkmcal.estimation.priors_and_bounds import bounds_by_name, prior_deviations
from pkmcal.estimation.scales import unit_scales
from pkmcal.estimation.sessions import Scope, label, scopes
from pkmcal.estimation.uncertain_numbers import own_deviations, spread, uncertain_names
from pkmcal.exceptions import ArgumentError
from pkmcal.kinematics.calibratable import Calibratable
from pkmcal.readings.unknowns import Nature

Key = tuple[str, str]  # role and name of what is found beside the geometry
_EXACT = 1e-7  # mm that a number moves the machine by: what is stated to be less is exact as well


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
    geometry = robot.geometry
    free, along = _free_names(robot, asked)
    known = geometry.names
    places = np.array([known.index(name) for name in (*free, *along)], dtype=np.intp)
    beside, natures = _beside_geometry(datasets)
    beside |= _of_residuals(asked.residuals, geometry.names)
    ends = np.cumsum([len(places), *(len(each.names) for each in beside.values())]).tolist()
    blocks = dict(zip(beside, map(slice, ends, ends[1:]), strict=False))
    numbers = [known[i] for i in places.tolist()]
    numbers += [name for each in beside.values() for name in each.names]
    scope = scopes(numbers, blocks, asked.per_session, asked.by_set)
    entries = _entries(len(places), scope, blocks, datasets, asked.held_points)
    fitted_along = {*range(len(free), len(places))}
    beside_known = set[int]()
    for point, block in blocks.items():
        if point[0] in asked.uncertain_roles:
            fitted_along |= {*range(block.start, block.stop)}
        if beside[point].spread is not None:
            beside_known |= {*range(block.start, block.stop)}
    poses = [blocks[key] for key, nature in natures.items() if nature.pose]
    whole = {number for block in poses for number in range(block.start, block.stop)}
    entries = _without_exact(entries, numbers, fitted_along - beside_known, asked, whole)
    fitted_along |= beside_known
    number_of = np.array([number for number, _ in entries], dtype=np.intp)
    names = tuple(numbers[j] + (f"@{behind}" if behind else "") for j, behind in entries)
    uncertain = np.array([number in fitted_along for number, _ in entries], dtype=bool)
    units_of = geometry.units
    every = [units_of[i] for i in places.tolist()]
    every += [unit for each in beside.values() for unit in each.units]
    if not names:
        raise ArgumentError("free: name at least one parameter, nothing else is unknown")
    _refuse_twice(names)
    units = tuple(str(every[j]) for j in number_of)
    of_number = [np.full(len(places), np.nan)]  # where the unit says the scale
    of_number += [
        np.full(len(each.names), np.nan) if each.scale is None else each.scale
        for each in beside.values()
    ]
    of_unit = unit_scales(robot, [data.measured for data in datasets])
    scale = _scales(np.concatenate(of_number)[number_of], of_unit, names, units, like)
    along = [n for n, own in zip(names, uncertain, strict=True) if own]
    least = _EXACT * scale[uncertain]
    small = own_deviations(asked.uncertainty, along) < least
    of_uncertain = spread(asked.uncertainty, along) + np.diag(np.where(small, least, 0.0) ** 2)
    along_entries = [entry for entry, own in zip(entries, uncertain, strict=True) if own]
    for point, block in blocks.items():
        _add_known(of_uncertain, along_entries, block, beside[point].spread)
    starts = [geometry.values[places], *(each.start for each in beside.values())]
    values = np.concatenate(starts)[number_of]
    count = int(np.count_nonzero(number_of < len(places)))
    found = [n if not own else "" for n, own in zip(names, uncertain, strict=True)]
    lower, upper = bounds_by_name(asked.bounds, found, values, strict=like is None)
    prior = prior_deviations(asked, found, scale, count, strict=like is None)
    prior[uncertain] = np.sqrt(np.diagonal(of_uncertain))
    made = Parameters(
        names=names,
        units=units,
        start=values,
        scale=scale,
        prior=prior,
        lower=lower,
        upper=upper,
        number_of=number_of,
        scope=tuple(scope),
        column={entry: c for c, entry in enumerate(entries)},
        sessions=_sessions(datasets) if "session" in scope else (),
        places=places,
        nuisance={key: block.start for key, block in blocks.items()},
        natures=natures,
        origin={},
        robot=robot,
        asked=asked,
        uncertain=uncertain,
        spread=of_uncertain,
    )
    if made.motions:
        made = replace(made, origin={first: np.zeros(6) for first in made.motions})
    if like is None and asked.residuals:
        made = replace(made, residuals=asked.residuals)
        _require_dependence(made)
    if not isinstance(asked.prior, Mapping):
        return made
    start = dict(zip(names, zip(values.tolist(), units, strict=True), strict=True))
    columns = {session: made.geometry_of(session) for session in made.sessions or ("",)}
    moved = {names[first + k] for first in made.motions for k in range(len(PLACE))}
    given = (asked.prior, robot, start, places, columns, moved)
    return replace(made, functions=prior_functions(*given, strict=like is None))


def _add_known(
    spread: FloatArray,
    entries: Sequence[tuple[int, str]],
    block: slice,
    known: FloatArray | None,
) -> None:
    """Add what a reading itself knows of numbers to the covariance of uncertain ones (u, u)."""
    if known is None:
        return
    for behind in dict.fromkeys(behind for _, behind in entries):
        mine = [
            i for i, (j, own) in enumerate(entries)
            if own == behind and block.start <= j < block.stop
        ]  # fmt: skip
        slots = [entries[i][0] - block.start for i in mine]
        spread[np.ix_(mine, mine)] += known[np.ix_(slots, slots)]


def _refuse_twice(names: Sequence[str]) -> None:
    """Refuse two parameters of one name: what is said of one would be taken for the other."""
    for name, several in Counter(names).items():
        if several > 1:
            raise ArgumentError(
                f"{name}: {several} different parameters have this name; a reading or an effect"
                " has to give its numbers names that no others have"
            )


def _scales(
    scale: FloatArray,
    of_unit: Mapping[str, float],
    names: Sequence[str],
    units: Sequence[str],
    like: Parameters | None,
) -> FloatArray:
    """Complete scales (n,) by those of units where they are NaN; those of `like` come first."""
    for i in np.flatnonzero(np.isnan(scale)).tolist():
        scale[i] = _scale(of_unit, names[i], units[i])
    if like is None:
        return scale
    known = dict(zip(like.names, like.scale.tolist(), strict=True))
    return np.array([known.get(n, own) for n, own in zip(names, scale.tolist(), strict=True)])


def _scale(of_unit: Mapping[str, float], name: str, unit: str) -> float:
    if unit not in of_unit:
        raise ArgumentError(
            f"{name}: its reading has to state by which change, in {unit}, it moves readings as"
            " much as 1 mm of the machine does (the scale of its numbers)"
        )
    return of_unit[unit]


def _free_names(robot: Calibratable, asked: Asked) -> tuple[list[str], list[str]]:
    """Numbers of the geometry that are looked for, and those that are uncertain beside them.

    A number that is held is exact.
    """
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
    chosen = list(dict.fromkeys([*chosen, *asked.of_effects]))
    held = geometry.match(asked.fix, "fix") if asked.fix else []
    along = uncertain_names(asked.uncertainty, robot, (*chosen, *held))
    if held:
        chosen = [name for name in chosen if name not in held]
        if not chosen:
            raise ArgumentError("fix: no parameter is left free")
    return chosen, along


def _without_exact(
    entries: Sequence[tuple[int, str]],
    numbers: Sequence[str],
    fitted_along: set[int],
    asked: Asked,
    whole: set[int],
) -> list[tuple[int, str]]:
    """Parameters without those numbers of frames and points of which no uncertainty is stated.

    Numbers in `whole` are of poses, of which all six are stated or none.
    """
    kept = []
    for number, behind in entries:
        name = numbers[number] + (f"@{behind}" if behind else "")
        if number not in fitted_along or spread(asked.uncertainty, [name])[0, 0] > 0.0:
            kept.append((number, behind))
        elif number in whole:
            raise ArgumentError(
                f"uncertainty: {name} has none, and other numbers of {name.partition('.')[0]} have"
                " one: state all six"
            )
    return kept


def _beside_geometry(
    datasets: Sequence[FitData],
) -> tuple[dict[Key, Numbers], dict[Key, Nature]]:
    """The numbers to be found beside the geometry, by role and name: frames come first.

    And what they are.
    """
    found: dict[Key, Numbers] = {}
    natures: dict[Key, Nature] = {}
    for frame in (data.frame for data in datasets):
        if frame is not None:
            whose = ".".join(filter(None, frame))
            names, units = zip(*((f"{whose}.{axis}", unit) for axis, unit in PLACE), strict=True)
            found[frame] = Numbers(names, units, np.arange(6), np.zeros(6))
            natures[frame] = Nature(pose=True)
    for dependence in (each for data in datasets for each in data.dependences()):
        role = dependence.role
        for name, own in dependence.estimated.items():
            natures.setdefault((role, name), dependence.nature)
            known = found.setdefault((role, name), own)
            if (known.names, known.units) != (own.names, own.units):
                raise ArgumentError(
                    f"effects or kind: two of them have numbers of one role, {role!r}, that are not"
                    f" alike: {', '.join(known.names)} [{', '.join(known.units)}] and"
                    f" {', '.join(own.names)} [{', '.join(own.units)}]; give each a role of its own"
                )
            if not np.isfinite(own.start).all():
                raise ArgumentError(
                    f"{role}: the search for {', '.join(own.names)} has a start that is no finite"
                    " number"
                )
            if not np.array_equal(known.start, own.start):
                raise ArgumentError(
                    f"{role}: {role} {name} starts at different places in different"
                    " measurements; give different targets different target_names"
                )
    return found, natures


def _of_residuals(
    residuals: Sequence[Residual], known: Sequence[str]
) -> dict[tuple[str, str], Numbers]:
    """The numbers that residuals bring, one by one: each is common to all rows."""
    found: dict[tuple[str, str], Numbers] = {}
    for each in residuals:
        if (own := brought_numbers(each)) is None:
            continue
        for i, name in enumerate(own.names):
            if name in known or (ROLE, name) in found:
                raise ArgumentError(
                    f"residuals: {residual_name(each)} brings {name}, which there is already"
                )
            alone = slice(i, i + 1)
            found[ROLE, name] = Numbers(
                own.names[alone], own.units[alone], np.arange(1), own.start[alone]
            )
    return found


def _require_dependence(chosen: Parameters) -> None:
    """Refuse residuals that nothing free changes where the search begins."""
    for each in chosen.residuals:
        _, slopes = at_parameters(
            each, chosen.by_name, chosen.rates_by_name, chosen.start, chosen.scale
        )
        if not slopes.any(axis=1).all():
            raise ArgumentError(
                f"residuals: {residual_name(each)} does not change with any free number where the"
                " search begins"
            )


def _sessions(datasets: Sequence[FitData]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(name for data in datasets for name in data.measured.sessions))


def _entries(
    free: int,
    scope: Sequence[Scope],
    blocks: Mapping[tuple[str, str], slice],
    datasets: Sequence[FitData],
    held: frozenset[tuple[str, str]],
) -> list[tuple[int, str]]:
    """The parameters: the number of a row that each is, and what stands behind the @ of its name.

    Those of the geometry, `free` numbers, session by session, behind what is common. Points that
    are held are none.
    """
    own = range(free)
    found = [(j, "") for j in own if scope[j] == "common"]
    found += [(j, name) for name in _sessions(datasets) for j in own if scope[j] == "session"]
    for point, block in blocks.items():
        if point in held:
            continue
        if point[0] == ROLE:
            found += [(j, "") for j in range(block.start, block.stop)]
            continue
        kind = scope[block.start]
        behind = dict.fromkeys(
            label(kind, session, data.set_name)
            for data in datasets
            for session in _where_read(data, point)
        )
        found += [(j, each) for each in behind for j in range(block.start, block.stop)]
    return found


def _where_read(data: FitData, point: tuple[str, str]) -> tuple[str, ...]:
    """The sessions in which a set has readings of a point, or in a frame."""
    if point[0] == FRAME:
        return (data.measured.sessions or ("",)) if data.frame == point else ()
    role, name = point
    for each in data.dependences():
        if each.role == role and name in each.estimated:
            mine = each.index == list(each.estimated).index(name)
            if mine.any():
                session = data.measured.session
                return ("",) if session is None else tuple(dict.fromkeys(session[mine].tolist()))
    return ()
