"""Entries of a stated uncertainty that would change nothing are refused."""

from __future__ import annotations

from pkmcal.arguments import did_you_mean
from pkmcal.estimation.parameters import Parameters
from pkmcal.estimation.sessions import matches
from pkmcal.exceptions import ArgumentError
from pkmcal.geometry.stated_uncertainty import StatedUncertainty


def require_used(stated: StatedUncertainty, chosen: Parameters) -> None:
    """Refuse entries all of whose numbers are free, held or not there.

    Of a robot file they may be: it is read for calibrations of which each frees other numbers.

    Raises
    ------
    ValueError
        Such an entry; the message says what does state something of these numbers.
    """
    geometry, fixed = chosen.robot.geometry, chosen.asked.fix
    held = set(geometry.match(fixed, "fix")) if fixed else set[str]()
    pairs = [*zip(chosen.names, chosen.uncertain.tolist(), strict=True)]
    along, free = ([name for name, own in pairs if own == wanted] for wanted in (True, False))
    sigma = {**stated.common, **stated.own}
    for pattern in stated.patterns:
        found = any(matches(pattern, name) for name in free)
        if stated.of_geometry(pattern, geometry.names):
            meant = set(geometry.match(pattern, "uncertainty")) - held
            if not meant:
                raise ArgumentError(f"uncertainty: {pattern} is held as exact by fix: one of both")
            unused = meant <= {name.partition("@")[0] for name in free}
        else:
            unused = sigma.get(pattern, 0.0) > 0.0 and not any(
                matches(pattern, name) for name in along
            )
        if unused and found:
            raise ArgumentError(
                f"uncertainty: {pattern} is free or unknown, and looked for: what is known of it"
                " beforehand is a prior (prior=, --prior)"
            )
        if unused:
            raise ArgumentError(
                f"uncertainty: no reading of these measurements depends on {pattern}"
                f"{did_you_mean(pattern, chosen.names, listed=0)}"
            )
