"""Doubts about readings by themselves, and poses that turn too little for what is free."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.diagnostics.check import Check, at_most_one
from pkmcal.fitted.instruments import instruments, parts_of
from pkmcal.fitted.solution import Solution
from pkmcal.readings import orientation

_ANGLES = ("alpha", "beta", "gamma")
_LITTLE = np.radians(1.5)  # of turning about the second axis, rms, below which the poses are alike
_FEW = 3  # poses
_WORSE = 4.0  # times what corners are off within pictures, at which the fit contradicts them


@dataclass(frozen=True)
class HardlyTurned:
    """Poses that hardly differ in how the machine is turned.

    Attributes
    ----------
    poses : int
        How many there are.
    about : tuple of float
        By how much they turn about three axes, the most first, rms, rad.
    """

    poses: int
    about: tuple[float, ...]


def hardly_turned(found: Solution) -> HardlyTurned | None:
    """Find whether the machine could turn, an instrument on it has to be placed, and it did not."""
    machine, end = found.fit.end.robot, found.fit.end
    if not {*_ANGLES} <= {*getattr(machine, "coordinates", _ANGLES)}:
        return None
    if getattr(machine, "n_actuators", 6) < 6:
        return None
    poses = [
        end.pose[np.unique(place)]
        for m, place in zip(
            found.fit.uncertainty.equations.table.sets,
            found.fit.uncertainty.equations.table.pose_of,
            strict=True,
        )
        if not m.instrument.placed
    ]
    if not poses:
        return None
    turned = np.concatenate(poses)[:, 3:]
    turned = turned[np.isfinite(turned).all(axis=1)]
    if len(turned) < _FEW:
        return None
    about = _spread(turned)
    return HardlyTurned(len(turned), tuple(about.tolist())) if about[1] < _LITTLE else None


def _spread(angles: FloatArray) -> FloatArray:
    """Return the rms spread of orientations (N, 3) about three axes, the largest first."""
    off = orientation.between(angles, np.repeat(angles[:1], len(angles), axis=0))
    size: FloatArray = np.linalg.svd(off - off.mean(axis=0), compute_uv=False)
    spread: FloatArray = size / np.sqrt(len(angles))
    return spread


def _text(found: Solution, seen: HardlyTurned) -> str:
    most, second = (float(np.degrees(each)) for each in seen.about[:2])
    how = (
        f"turn about one axis alone, within {second:.2g} deg rms about others"
        if seen.about[0] > _LITTLE
        else f"are all turned alike within {most:.2g} deg rms"
    )
    return (
        f"{seen.poses} poses {how}: they tell where the machine goes, not how it turns, and numbers"
        " that only this tells are worth little elsewhere; measure poses that are tilted by 10 deg"
        " and more about two axes"
    )


def _doubted(found: Solution) -> tuple[str, ...]:
    return tuple(
        text for m in found.fit.uncertainty.equations.table.sets for text in m.instrument.doubts(m)
    )


@dataclass(frozen=True)
class AtOdds:
    """Pictures that agree each with themselves, and not with what else was measured.

    Attributes
    ----------
    name : str
        Of their measurements.
    within, off : float
        How far corners are off where the board is best laid in each picture, the median, and what
        the fit finds of them as noise, px.
    """

    name: str
    within: float
    off: float


def _at_odds(found: Solution) -> tuple[AtOdds, ...]:
    """List pictures that the fit weighs little for what other measurements say."""
    equations, _, end, *_ = next(iter(parts_of(found)))
    sets = equations.prediction.datasets
    if len(sets) < 2:
        return ()
    odd = []
    for i, data in enumerate(sets):
        within = [
            picture.off
            for rows, instrument in instruments(equations, end.theta, i)
            for picture in instrument.pictures(
                data.measured.select(rows),
                end.pose[equations.table.pose_of[i][rows]],
                end.residuals[i][rows],
            )
            if np.isfinite(picture.off)
        ]
        if len(within) >= _FEW:
            best, off = float(np.median(within)), float(np.linalg.norm(found.component_noise[i]))
            if off > _WORSE * best:
                own = data.measured.instrument
                words = (getattr(own, word, "") for word in ("camera_name", "board_name"))
                name = ", ".join(filter(None, words)) or f"data set {data.set_name or i}"
                odd.append(AtOdds(name, best, off))
    return tuple(odd)


def _said_of(found: Solution, seen: AtOdds) -> str:
    return (
        f"pictures of {seen.name}: each fits its board within {seen.within:.2g} px, and all are"
        f" {seen.off:.2g} px off where other measurements say that the machine was: the lens, the"
        " board or the actuators of these pictures are others; they hardly count, and calibrated by"
        " themselves tell more"
    )


CHECKS = (
    Check(
        name="doubtful-readings", about="readings that contradict what is stated of the instrument",
        levels=("doubt",), run=_doubted, say=lambda found, text: text,
    ),
    Check(
        name="at-odds", about="pictures of one of several cameras that the other measurements"
        " contradict",
        levels=("doubt",), run=_at_odds, say=_said_of,
    ),
    Check(
        name="hardly-turned", about="poses that are turned alike, where it has to be found what is"
        " mounted on the platform",
        levels=("doubt",), run=lambda found: at_most_one(hardly_turned(found)), say=_text,
    ),
)  # fmt: skip
