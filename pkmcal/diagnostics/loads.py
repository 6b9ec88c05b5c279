"""Tests for loads that show in residuals, and for compliances that are not believable."""

from __future__ import annotations

from contextlib import suppress
from typing import NamedTuple

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.diagnostics.check import CHANCE, Check, Remedy, at_most_one
from pkmcal.diagnostics.columns import of_rows
from pkmcal.display import chance_text
from pkmcal.effects.elasticity import Elasticity
from pkmcal.exceptions import ArgumentError
from pkmcal.fitted.fit import Fit
from pkmcal.fitted.solution import Solution
from pkmcal.geometry.carried import Load
from pkmcal.geometry.elastic import COMPLIANCE, PER_LENGTH
from pkmcal.kinematics.calibratable import Calibratable
from pkmcal.readings.predicted import Predicted
from pkmcal.statistics.distributions import t_tail
from pkmcal.statistics.score_test import Columns, score_test

_UNSURE = 0.2  # share of a compliance that its standard deviation exceeds where loads are alike
_OF_LEGS, _OF_JOINTS = Elasticity("offset*"), Elasticity("joint*")


class FollowedLoads(NamedTuple):
    """Loads of the rows that the residuals follow, of a machine of which nothing yields.

    Attributes
    ----------
    chance : float
        Of residuals that follow the loads as much by accident.
    """

    chance: float


def _ignored(found: Solution) -> bool:
    """Return whether rows state loads, and nothing of the machine yields."""
    fit = found.fit
    loads = [m.load for m in fit.equations.table.sets]
    return not fit.parameters.robot.yields and any(
        load is not None and bool(load.any()) for load in loads
    )


def _followed(found: Solution) -> tuple[FollowedLoads, ...]:
    fit, sure = found.fit, found.fit.uncertainty
    if not _ignored(found) or sure.mixed or sure.rounded:
        return ()
    with suppress(ArgumentError):  # limbs without such numbers, or with shared forces
        score = score_test(sure.fit, _by_compliances(fit, fit.parameters.robot))
        if score is not None and score.chance < CHANCE:
            return (FollowedLoads(score.chance),)
    return ()


def _of_loads(robot: Calibratable) -> Elasticity:
    """Name what follows loads first in a machine: legs and screws, or joints of an arm."""
    return _OF_JOINTS if robot.kind == "arm" else _OF_LEGS


def _by_compliances(fit: Fit, robot: Calibratable) -> Columns:
    """Differentiate equations by compliances that are held at 0."""
    _, soft, freed = _of_loads(robot).of_machine(robot)
    places = [soft.geometry.names.index(name) for name in freed]
    table = fit.equations.table

    def change(i: int, rows: slice, seen: Predicted) -> FloatArray:
        place, load = table.pose_of[i][rows], table.sets[i].load
        carrying = soft if load is None else soft.under(Load.of_rows(load[rows]))
        twists = carrying.error_twists(fit.end.pose[place], table.actuators[place])
        moved: FloatArray = seen.by_twist @ twists[..., places]
        return moved

    return of_rows(fit, change)


def _carried(found: Solution) -> str:
    """The loads of the rows, in words."""
    masses = np.hstack([m.load[:, 0] for m in found.fit.equations.table.sets if m.load is not None])
    least, most = masses.min(), masses.max()
    return "loads of the rows" if not most else f"loads of the rows, {least:g} to {most:g} kg,"


def _followed_text(found: Solution, seen: FollowedLoads) -> str:
    numbers = _of_loads(found.fit.parameters.robot).numbers
    return (
        f"residuals follow the {_carried(found)} ({chance_text(seen.chance)}): the machine yields;"
        f" find its compliances, --effects 'elasticity={numbers}' (effects=[pk.Elasticity"
        f"('{numbers}')])"
    )


class _Compliance(NamedTuple):
    name: str
    value: float
    sigma: float
    freedom: float


def _compliances(found: Solution) -> list[_Compliance]:
    """Estimated compliances of limbs and joints; those that are determined, where any is."""
    of_each = zip(found.free, found.values, found.stderr, found.parameter_dof, strict=True)
    every = [
        _Compliance(name, *map(float, numbers))
        for name, *numbers in of_each
        if name.startswith(COMPLIANCE.removesuffix(".")) and not name.endswith(PER_LENGTH)
    ]
    return [each for each in every if np.isfinite(each.sigma)] or every


def _alike(found: Solution) -> tuple[float, ...]:
    """Largest relative deviation of a compliance where all rows carried alike."""
    loads = [m.load for m in found.fit.equations.table.sets]
    stated = np.vstack([each for each in loads if each is not None] or [np.zeros((1, 10))])
    alike = all(each is None for each in loads) or all(each is not None for each in loads)
    unsure = [each.sigma / abs(each.value) for each in _compliances(found) if each.value]
    if not unsure or not alike or (stated != stated[0]).any():
        return ()
    return (max(unsure),) if max(unsure) > _UNSURE else ()


def _negative(found: Solution) -> tuple[_Compliance, ...]:
    """The compliance that is most clearly below 0, if none at 0 would be so by chance."""
    known = [each for each in _compliances(found) if 0.0 < each.sigma < np.inf]
    below = [
        (0.5 * t_tail(each.value / each.sigma, each.freedom), each)
        for each in known
        if each.value < 0.0
    ]
    chance, least = min(below, key=lambda each: each[0]) if below else (1.0, None)
    return at_most_one(least if len(known) * chance < CHANCE else None)


CHECKS = (
    Check(
        name="follows-loads", about="residuals follow the loads of rows of a rigid machine",
        run=_followed, say=_followed_text,
        remedies=lambda found, seen: (Remedy("effects", (_of_loads(found.fit.parameters.robot),)),),
    ),
    Check(
        name="ignored-loads", about="rows state loads, and nothing of the machine yields",
        levels=("remark",), unless=("follows-loads",),
        run=lambda found: (None,) if _ignored(found) else (),
        say=lambda found, _: (
            f"the {_carried(found)} are not taken into account: nothing of the machine yields"
        ),
    ),
    Check(
        name="negative-compliance", about="a compliance is below 0, as of no spring",
        run=_negative,
        say=lambda found, seen: (
            f"{seen.name} is {seen.value:.3g} ± {seen.sigma:.2g}, below 0: something else than a"
            " spring moves with the loads, the controller corrects sag itself, or the sign of a"
            " load is wrong"
        ),
    ),
    Check(
        name="loads-alike", about="compliances are told from offsets by one load alone",
        levels=("remark",), run=_alike,
        say=lambda found, unsure: (
            "the load is the same in all rows: compliances are told from offsets only by how"
            f" forces change with the pose (± {100 * min(unsure, 9.99):.0f} %); measure the same"
            " poses with another load"
        ),
    ),
)  # fmt: skip
