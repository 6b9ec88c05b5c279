"""Statements of all checks about one calibration; some keep silent beside others."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, MutableMapping, Sequence
from graphlib import CycleError, TopologicalSorter
from typing import Any, get_args

from pkmcal.arguments import instance, kind, shown
from pkmcal.diagnostics.check import Check, Level, Remedy, Said
from pkmcal.display import LONGEST, printable
from pkmcal.exceptions import ArgumentError, ArgumentTypeError, named_failures
from pkmcal.fitted.solution import Solution

_LEVELS: tuple[Level, ...] = get_args(Level)


Findings = MutableMapping[str, tuple[Any, ...]]  # those that were made, by the names of checks


def findings_of(found: Solution, check: Check[Any], findings: Findings) -> tuple[Any, ...]:
    """The findings of a check about a calibration, also those that are not worth a word.

    They are made once: others that ask find them in `findings`.
    """
    if check.name not in findings:
        with named_failures(check.run, f"{check.name}: run", "it is given the calibration"):
            seen = check.run(found)
            if isinstance(seen, str) or not isinstance(seen, Iterable):
                raise ArgumentTypeError(
                    f"{check.name}: run must return its findings, [] of none; found {kind(seen)}"
                )
            findings[check.name] = tuple(seen)
    return findings[check.name]


def statements(
    found: Solution, checks: Sequence[Check[Any]], findings: Findings
) -> tuple[Said, ...]:
    """The statements of checks about a calibration, in the order of the checks.

    `Check.unless` says in which order their findings are made; those go to `findings`.
    """
    return tuple(said for each in checks for said in _said_by(each, found, checks, findings))


def _said_by(
    check: Check[Any], found: Solution, checks: Sequence[Check[Any]], findings: Findings
) -> Iterator[Said]:
    for other in check.unless:
        for one in meant(checks, check, other):
            if any(other in (s.check, s.level) for s in _said_by(one, found, checks, findings)):
                return
    for finding in findings_of(found, check, findings):
        level = _asked(found, check, "level_of", finding, check.levels[0])
        if level is None:
            continue
        if level not in check.levels:
            levels = ", ".join(check.levels)
            raise ArgumentError(f"{check.name}: level_of must say {levels} or None; said {level!r}")
        said = _asked(found, check, "say", finding)
        said = instance(f"{check.name}: what say returns", said, str)
        text = printable(said, LONGEST)
        yield Said(check.name, level, text, finding, _remedies(found, check, finding))


def _asked(
    found: Solution, check: Check[Any], member: str, finding: Any, without: Any = None
) -> Any:
    """What a function of a check says of a finding; `without`: where it has none."""
    if (function := getattr(check, member)) is None:
        return without
    given = f"it is given the calibration and what run found: {shown(finding)}"
    with named_failures(function, f"{check.name}: {member}", given):
        return function(found, finding)


def _remedies(found: Solution, check: Check[Any], finding: Any) -> tuple[Remedy, ...]:
    several = _asked(found, check, "remedies", finding, ())
    if not isinstance(several, tuple) or not all(isinstance(each, Remedy) for each in several):
        raise ArgumentTypeError(
            f"{check.name}: remedies must return a tuple, as in (pkmcal.Remedy('drop', rows),);"
            f" found {kind(several)}"
        )
    return several


def meant(checks: Iterable[Check[Any]], check: Check[Any], other: str) -> list[Check[Any]]:
    """The checks that an entry of `unless` means: one by its name, or those of a level."""
    return [one for one in checks if one is not check and other in (one.name, *one.levels)]


def verified(checks: Sequence[Check[Any]]) -> tuple[Check[Any], ...]:
    """The checks, if their names, levels and `unless` agree.

    Raises
    ------
    ValueError
        A name that two checks have; an `unless` that names no check and no level; checks that wait
        for each other; one that is made at once and waits for one that is not; several levels, and
        nothing that says which.
    TypeError
        No checks, or one alone.
    """
    if isinstance(checks, Check) or not isinstance(checks, Iterable):
        one = "the check alone" if isinstance(checks, Check) else kind(checks)
        raise ArgumentTypeError(f"checks must be several, (*pkmcal.CHECKS, yours); found {one}")
    checks = tuple(instance("checks: each", check, Check) for check in checks)
    names = [check.name for check in checks]
    graph: dict[str, set[str]] = {}
    for check in checks:
        if names.count(check.name) > 1:
            raise ArgumentError(f"{check.name}: two checks have this name")
        if unknown := sorted(set(check.unless) - {*names, *_LEVELS}):
            raise ArgumentError(f"{check.name}: unless names no check: {', '.join(unknown)}")
        if strange := sorted(set(check.levels) - {*_LEVELS}):
            known = ", ".join(_LEVELS)
            raise ArgumentError(f"{check.name}: levels are of {known}; found {', '.join(strange)}")
        if not check.levels:
            raise ArgumentError(f"{check.name}: levels are of {', '.join(_LEVELS)}; found none")
        if len(check.levels) > 1 and check.level_of is None:
            raise ArgumentError(f"{check.name}: level_of must say which of {check.levels} it is")
        before = [one for other in check.unless for one in meant(checks, check, other)]
        if slow := [one.name for one in before if check.at_once and not one.at_once]:
            raise ArgumentError(f"{check.name}: made at once, it cannot wait for {', '.join(slow)}")
        graph[check.name] = {one.name for one in before}
    try:
        tuple(TopologicalSorter(graph).static_order())
    except CycleError as error:
        circle = ", ".join(dict.fromkeys(error.args[1]))
        raise ArgumentError(f"unless: checks wait for each other: {circle}") from None
    return tuple(checks)
