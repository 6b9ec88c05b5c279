"""All checks of a calibration, in the order in which they speak.

Causes come before what else may look moved or of another size: a wrong lens makes both seem so.
"""

from __future__ import annotations

from pkmcal.diagnostics import (
    causes,
    course,
    elsewhere,
    families,
    gain,
    held_combinations,
    held_out,
    loads,
    machine,
    moved_instrument,
    near_copies,
    noise,
    other_starts,
    priors,
    readings,
    refitted_readings,
    regions,
    rounded,
    rows,
    sag,
    scale,
    search,
    sides,
    stated_points,
    units,
    waves,
)
from pkmcal.diagnostics.diagnosis import verified

CHECKS = verified((
    *held_out.CHECKS, *readings.CHECKS, *units.CHECKS, *refitted_readings.CHECKS,
    *families.CHECKS, *machine.CHECKS, *other_starts.CHECKS, *loads.CHECKS, *sag.CHECKS,
    *search.CHECKS, *held_combinations.CHECKS, *rows.CHECKS, *elsewhere.CHECKS,
    *near_copies.CHECKS, *rounded.CHECKS, *noise.CHECKS, *priors.CHECKS, *course.CHECKS,
    *causes.CHECKS, *moved_instrument.CHECKS, *stated_points.CHECKS, *scale.CHECKS,
    *sides.CHECKS, *regions.CHECKS, *gain.CHECKS, *waves.CHECKS,
))  # fmt: skip
AT_ONCE = tuple(check for check in CHECKS if check.at_once)
