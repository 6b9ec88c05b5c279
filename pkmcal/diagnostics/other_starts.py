"""Check whether another start leads to other numbers that explain the readings as well."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from pkmcal.diagnostics.check import Check
from pkmcal.estimation.identifiability import listed
from pkmcal.estimation.other_starts import other_fits
from pkmcal.fitted.solution import Solution

_SURE = 9.0  # squares in units of the noise, by which readings tell two fits apart: 3 deviations


class AsGood(NamedTuple):
    """Another place of what was found, with which the fit is as good.

    Attributes
    ----------
    role : str
        What it is.
    here, there : mapping of str to float
        Its numbers as they were found, and those that are as good.
    moved : mapping of str to (float, float)
        Numbers of the machine that differ by more than their ±: as found, and with the other.
    """

    role: str
    here: dict[str, float]
    there: dict[str, float]
    moved: dict[str, tuple[float, float]]


def _as_good(found: Solution) -> Iterator[AsGood]:
    """Of each role the place that fits best, of those that fit as well."""
    fit, chosen = found.fit, found.fit.parameters
    names = chosen.names
    half = dict(zip(found.free, np.ptp(found.interval95, axis=1) / 2.0, strict=True))
    own = fit.estimate.evaluation.theta
    several = sorted(
        other_fits(fit.estimator, fit.estimate, fit.aligned), key=lambda other: other.more
    )
    said: set[tuple[str, str]] = set()
    for other in several:
        if other.more > _SURE or (other.role, other.name) in said:
            continue
        theta = other.estimate.evaluation.theta
        moved = {
            names[i]: (float(own[i]), float(theta[i]))
            for i in range(chosen.geometry.start, chosen.geometry.stop)
            if abs(theta[i] - own[i]) > half.get(names[i], np.inf)
        }
        if moved:
            said.add((other.role, other.name))
            columns = other.columns.ravel().tolist()
            here, there = ({names[i]: float(at[i]) for i in columns} for at in (own, theta))
            yield AsGood(other.role, here, there, moved)


def _say(found: Solution, other: AsGood) -> str:
    name, (here, there) = max(other.moved.items(), key=lambda each: abs(np.subtract(*each[1])))
    places = [", ".join(f"{k} {v:.4g}" for k, v in at.items()) for at in (other.here, other.there)]
    first = next(iter(other.here))
    return (
        f"two places of the {other.role} explain the readings equally well, {places[0]} and"
        f" {places[1]} (rad), and {listed(list(other.moved))} differ between them ({name}"
        f" {here:.3g} or {there:.3g}): state roughly which it is (--prior '{first}=value±σ',"
        f" prior={{{first!r}: (value, σ)}}), or measure poses that turn about other axes as well"
    )


CHECKS = (
    Check(
        name="other-start",
        about="another mounting, which the nominal machine does not rule out, fits as well",
        at_once=True, run=_as_good, say=_say,
    ),
)  # fmt: skip
