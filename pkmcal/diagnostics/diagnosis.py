"""Statements of all checks about one calibration; some keep silent beside others."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, MutableMapping, Sequence
from graphlib import CycleError, TopologicalSorter
from typing import Any, get_args

from pkmcal.arguments import instance, kind
from pkmcal.diagnostics.check import Check, Level, Remedy, Said
from pkmcal.display import LONGEST, printable
from pkmcal.exceptions import ArgumentTypeError
from pkmcal.fitted.solution import Solution

_LEVELS: tuple[Level, ...] = get_args(Level)


class Diagnosis:
    """The findings of some checks, each made once and when it is asked for.

    Parameters
    ----------
    found : Solution
        The calibration.
    checks : sequence of Check
        In the order in which they speak; `Check.unless` says in which they are made.
    findings : mutable mapping of str to tuple
        Findings that were made already, by the names of their checks; others are added.
    """

    def __init__(
        self,
        found: Solution,
        checks: Sequence[Check[Any]],
        findings: MutableMapping[str, tuple[Any, ...]],
    ) -> None:
        self._found = found
        self._checks = {check.name: check for check in checks}
        self._findings = findings

    def findings(self, name: str) -> tuple[Any, ...]:
        """Return the findings of all checks, also those that are not worth a word."""
        if name not in self._findings:
            seen = self._checks[name].run(self._found)
            if isinstance(seen, str) or not isinstance(seen, Iterable):
                raise ArgumentTypeError(
                    f"{name}: run must return its findings, [] of none; found {kind(seen)}"
                )
            self._findings[name] = tuple(seen)
        return self._findings[name]

    def said(self) -> tuple[Said, ...]:
        """Return the statements of the checks, in their order."""
        return tuple(said for check in self._checks.values() for said in self._said_by(check))

    def _said_by(self, check: Check[Any]) -> Iterator[Said]:
        others = ((one, other) for other in check.unless for one in self._meant(check, other))
        if any(other in (said.check, said.level) for one, other in others for said in one):
            return
        found = self._found
        for finding in self.findings(check.name):
            level = check.levels[0] if check.level_of is None else check.level_of(found, finding)
            if level is None:
                continue
            if level not in check.levels:
                levels = ", ".join(check.levels)
                raise ValueError(
                    f"{check.name}: level_of must say {levels} or None; said {level!r}"
                )
            said = instance(f"{check.name}: what say returns", check.say(found, finding), str)
            text = printable(said, LONGEST)
            yield Said(check.name, level, text, finding, self._remedies(check, finding))

    def _remedies(self, check: Check[Any], finding: Any) -> tuple[Remedy, ...]:
        several = () if check.remedies is None else check.remedies(self._found, finding)
        if not isinstance(several, tuple) or not all(isinstance(each, Remedy) for each in several):
            raise ArgumentTypeError(
                f"{check.name}: remedies must return a tuple, as in (pkmcal.Remedy('drop', rows),);"
                f" found {kind(several)}"
            )
        return several

    def _meant(self, check: Check[Any], other: str) -> Iterator[Iterator[Said]]:
        for one in meant(self._checks.values(), check, other):
            yield self._said_by(one)


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
            raise ValueError(f"{check.name}: two checks have this name")
        if unknown := sorted(set(check.unless) - {*names, *_LEVELS}):
            raise ValueError(f"{check.name}: unless names no check: {', '.join(unknown)}")
        if strange := sorted(set(check.levels) - {*_LEVELS}):
            known = ", ".join(_LEVELS)
            raise ValueError(f"{check.name}: levels are of {known}; found {', '.join(strange)}")
        if not check.levels or (len(check.levels) > 1 and check.level_of is None):
            raise ValueError(f"{check.name}: level_of must say which of {check.levels} it is")
        before = [one for other in check.unless for one in meant(checks, check, other)]
        if slow := [one.name for one in before if check.at_once and not one.at_once]:
            raise ValueError(f"{check.name}: made at once, it cannot wait for {', '.join(slow)}")
        graph[check.name] = {one.name for one in before}
    try:
        tuple(TopologicalSorter(graph).static_order())
    except CycleError as error:
        circle = ", ".join(dict.fromkeys(error.args[1]))
        raise ValueError(f"unless: checks wait for each other: {circle}") from None
    return tuple(checks)
