"""Tests for loads that show in residuals, and for compliances that are not believable."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from typing import NamedTuple

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.diagnostics.check import Check, Level, Remedy, at_most_one
from pkmcal.diagnostics.columns import of_rows
from pkmcal.display import chance_text
from pkmcal.effects.elasticity import Elasticity
from pkmcal.exceptions import ArgumentError
from pkmcal.fitted.fit import Fit
from pkmcal.fitted.solution import Solution
from pkmcal.geometry.carried import Load
from pkmcal.geometry.elastic import COMPLIANCE
from pkmcal.kinematics.calibratable import Calibratable
from pkmcal.readings.predicted import Predicted
from pkmcal.statistics.score_test import Columns, score_test

CHANCE = 0.01  # below which residuals follow the loads
_UNSURE = 0.2  # share of a compliance that its standard deviation exceeds where loads are alike
_OF_LEGS, _OF_JOINTS = Elasticity("offset*"), Elasticity("joint*")


class IgnoredLoads(NamedTuple):
    """Loads of rows of a machine of which nothing yields.

    Attributes
    ----------
    chance : float
        Of residuals that follow the loads as much by accident; NaN where that cannot be tested.
    """

    chance: float


def _ignored(found: Solution) -> tuple[IgnoredLoads, ...]:
    fit, robot = found.fit, found.fit.parameters.robot
    if robot.yields:
        return ()
    if not any(m.load is not None and m.load.any() for m in fit.equations.table.sets):
        return ()
    sure = fit.uncertainty
    if sure.mixed or sure.rounded:
        return (IgnoredLoads(float("nan")),)
    with suppress(ArgumentError):  # limbs without such numbers, or with shared forces
        score = score_test(sure.fit, _by_compliances(fit, robot))
        return (IgnoredLoads(float("nan") if score is None else score.chance),)
    return (IgnoredLoads(float("nan")),)


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
        moved: FloatArray = seen.by_twist[rows] @ twists[..., places]
        return moved

    return of_rows(fit, change)


def _ignored_level(found: Solution, seen: IgnoredLoads) -> Level:
    return "doubt" if seen.chance < CHANCE else "remark"


def _ignored_text(found: Solution, seen: IgnoredLoads) -> str:
    masses = np.hstack([m.load[:, 0] for m in found.fit.equations.table.sets if m.load is not None])
    least, most = masses.min(), masses.max()
    carried = "loads of the rows" if not most else f"loads of the rows, {least:g} to {most:g} kg,"
    if seen.chance < CHANCE:
        numbers = _of_loads(found.fit.parameters.robot).numbers
        return (
            f"residuals follow the {carried} ({chance_text(seen.chance)}): the machine yields; find"
            f" its compliances, --effects 'elasticity={numbers}' (effects=[pk.Elasticity"
            f"('{numbers}')])"
        )
    return f"the {carried} are not taken into account: nothing of the machine yields"


def _compliances(found: Solution) -> Iterator[tuple[str, float, float]]:
    """Estimated compliances of limbs and joints: names, values, deviations."""
    for name, value, sigma in zip(found.free, found.values, found.stderr, strict=True):
        if name.startswith(COMPLIANCE.removesuffix(".")):
            yield name, float(value), float(sigma)


def _alike(found: Solution) -> tuple[float, ...]:
    """Largest relative deviation of a compliance where all rows carried alike."""
    loads = [m.load for m in found.fit.equations.table.sets]
    stated = np.vstack([each for each in loads if each is not None] or [np.zeros((1, 10))])
    alike = all(each is None for each in loads) or all(each is not None for each in loads)
    unsure = [sigma / abs(value) for _, value, sigma in _compliances(found) if value]
    if not unsure or not alike or (stated != stated[0]).any():
        return ()
    return (max(unsure),) if max(unsure) > _UNSURE else ()


def _negative(found: Solution) -> tuple[tuple[str, float, float], ...]:
    """The compliance that is most clearly below 0."""
    below = [each for each in _compliances(found) if each[1] < -2.0 * each[2]]
    return at_most_one(min(below, key=lambda each: each[1] / each[2]) if below else None)


CHECKS = (
    Check(
        name="ignored-loads", about="rows state loads, and nothing of the machine yields",
        levels=("doubt", "remark"), run=_ignored, level_of=_ignored_level, say=_ignored_text,
        remedies=lambda found, seen: (Remedy("effects", (_of_loads(found.fit.parameters.robot),)),),
    ),
    Check(
        name="negative-compliance", about="a compliance is below 0, as of no spring",
        run=_negative,
        say=lambda found, seen: (
            f"{seen[0]} is {seen[1]:.3g} ± {seen[2]:.2g}, below 0: something else than a spring"
            " moves with the loads, the controller corrects sag itself, or a load has a wrong sign"
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
