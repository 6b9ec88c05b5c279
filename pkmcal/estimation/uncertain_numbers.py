"""Numbers that are not looked for and are not exact: they are fitted along, near where they are.

Their stated deviations are a prior about their present values. Numbers with a `common` deviation
are wrong by the same amount: their errors have a covariance, and it is its inverse root that the
equations of this prior have.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.effects.stated import BY_UNCERTAINTY
from pkmcal.estimation.fit_data import FRAME, PLACE, FitData
from pkmcal.estimation.sessions import matches
from pkmcal.estimation.starts import with_starts
from pkmcal.geometry.stated_uncertainty import StatedUncertainty
from pkmcal.kinematics.calibratable import Calibratable

_ALIKE = 1e-4  # of a common deviation, by which numbers without one of their own may differ
_UNKNOWN = (FRAME, "target", "attachment")  # words of `identify`


def uncertain_names(
    stated: StatedUncertainty, robot: Calibratable, others: Iterable[str]
) -> list[str]:
    """Numbers of the geometry that are uncertain and are none of `others`, in its order.

    Raises
    ------
    ValueError
        A name that the geometry has not, or that another number drives.
    """
    geometry, found = robot.geometry, set[str]()
    for pattern in stated.patterns:
        if stated.of_geometry(pattern, geometry.names):
            found.update(geometry.match(pattern, "uncertainty"))
    found -= {*others}
    names = [name for name in geometry.names if name in found]
    sigma = np.sqrt(np.diagonal(spread(stated, names)))
    return [name for name, own in zip(names, sigma, strict=True) if own > 0.0]


def spread(stated: StatedUncertainty, names: Sequence[str]) -> FloatArray:
    """Covariance (u, u) of the errors of numbers by their names, mm, rad and 1."""
    own = own_deviations(stated, names)
    shared = np.zeros((len(names), len(names)))
    groups: dict[tuple[str, str], list[int]] = {}
    common = np.zeros(len(names))
    for i, name in enumerate(names):
        pattern, common[i] = _last(stated.common, name)
        if _last(stated.consider, name)[1] > 0.0:  # allowed for otherwise
            own[i] = common[i] = 0.0
        groups.setdefault((pattern, stated.alike(name)), []).append(i)
    for (pattern, _), mine in groups.items():
        if pattern:
            shared[np.ix_(mine, mine)] = np.outer(common[mine], common[mine])
    own = np.where((own == 0.0) & (common > 0.0), _ALIKE * common, own)
    found: FloatArray = np.diag(own**2) + shared
    return found


def own_deviations(stated: StatedUncertainty, names: Sequence[str]) -> FloatArray:
    """Deviations (u,) of numbers by themselves, without what they have in common."""
    return np.array([_last(stated.own, name)[1] for name in names]).reshape(len(names))


def inverse_root(covariance: FloatArray) -> FloatArray:
    """The symmetric root (u, u) of the inverse of a covariance, whatever units its numbers have."""
    sigma = np.sqrt(np.diagonal(covariance))
    value, axes = np.linalg.eigh(covariance / np.outer(sigma, sigma))
    found: FloatArray = (axes / np.sqrt(value)) @ axes.T / sigma
    return found


def uncertain_sets(
    robot: Calibratable, datasets: Sequence[FitData], stated: StatedUncertainty
) -> tuple[list[FitData], frozenset[str]]:
    """Sets whose frame and points are fitted along where they are uncertain, and these roles.

    What `identify` was asked to find in some set is none of them.
    """
    names, sets = robot.geometry.names, list(datasets)
    either = {**stated.own, **stated.common}
    beside = [each for each in either if either[each] > 0.0 and not stated.of_geometry(each, names)]
    roles = set[str]()
    for word in _UNKNOWN:
        flag = f"unknown_{word}"
        if any(getattr(data, flag) for data in datasets):
            continue
        for i, data in enumerate(sets):
            if not any(pattern.startswith(data.roles(word)) for pattern in beside):
                continue
            (other,) = with_starts(robot, [replace(data, **{flag: True})])  # type: ignore[arg-type]
            known, found = _estimated(data), _estimated(other).items()
            new = {role: own for role, own in found if own != known.get(role)}
            if any(_last(either, name)[1] > 0.0 for own in new.values() for name in own):
                sets[i] = other
                roles |= {*new}
    for name, effect in BY_UNCERTAINTY.items():
        if name in beside and not any(each.name == name for each in sets[0].effects):
            sets = [replace(data, effects=(*data.effects, effect)) for data in sets]
            roles.add(name)
    return sets, frozenset(roles)


def _estimated(data: FitData) -> dict[str, list[str]]:
    """Names of what is estimated beside the geometry, by role."""
    found: dict[str, list[str]] = {}
    if data.framed:
        found[FRAME] = [f"{FRAME}.{axis}" for axis, _ in PLACE]
    for each in data.dependences():
        for own in each.estimated.values():
            found.setdefault(each.role, []).extend(own.names)
    return found


def _last(entries: Mapping[str, float], name: str) -> tuple[str, float]:
    """The last entry that means a number: its pattern and deviation; "" and 0 without."""
    for pattern in reversed([*entries]):
        if matches(pattern, name):
            return pattern, entries[pattern]
    return "", 0.0
