"""All checks of a calibration, in the order in which they speak."""

from __future__ import annotations

from pkmcal.diagnostics import (
    causes,
    course,
    gain,
    held_out,
    machine,
    noise,
    priors,
    regions,
    rows,
    search,
    units,
)
from pkmcal.diagnostics.diagnosis import verified

CHECKS = verified((
    *held_out.CHECKS, *units.CHECKS, *machine.CHECKS, *search.CHECKS, *rows.CHECKS, *noise.CHECKS,
    *priors.CHECKS, *course.CHECKS, *causes.CHECKS, *regions.CHECKS, *gain.CHECKS,
))  # fmt: skip
AT_ONCE = tuple(check for check in CHECKS if check.at_once)
