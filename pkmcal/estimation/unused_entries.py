"""Entries of a stated uncertainty, or of a prior, that would change nothing are refused."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fnmatch import fnmatchcase

from pkmcal.arguments import did_you_mean
from pkmcal.estimation.fit_data import FitData
from pkmcal.estimation.parameters import Parameters, Prior
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


def refuse_stated_by_readings(
    prior: Prior, stated: StatedUncertainty, datasets: Sequence[FitData], names: Sequence[str]
) -> None:
    """Refuse what an instrument of all sets states itself, and what a prior of it is not about.

    Parameters
    ----------
    prior : float, mapping or None
        As `identify` takes it: of numbers that are looked for it is one.
    stated : StatedUncertainty
        The argument `uncertainty`.
    datasets : sequence of FitData
        The measurements.
    names : sequence of str
        Numbers of the geometry.

    Raises
    ------
    ValueError
        Such a name; the message says what states it.
    """
    words = [data.measured.instrument.stated_by for data in datasets]
    of_prior = prior if isinstance(prior, Mapping) else {}
    named = [name for name in of_prior if isinstance(name, str)]
    for argument, patterns in (("prior", named), ("uncertainty", stated.patterns)):
        for pattern in patterns:
            said = [next((by[own] for own in by if fnmatchcase(pattern, own)), "") for by in words]
            if not all(said):
                continue
            known = [*names, *(_looked_for(datasets) if argument == "prior" else ())]
            if not any(matches(pattern, name) for name in known):
                raise ArgumentError(f"{argument}: {pattern}: {said[0]}")


def _looked_for(datasets: Sequence[FitData]) -> Iterator[str]:
    """Names of the numbers beside the geometry of which readings know nothing."""
    for data in datasets:
        for dependence in data.dependences():
            for own in dependence.estimated.values():
                yield from own.names if own.spread is None else ()
