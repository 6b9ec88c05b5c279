"""Check whether a calibration can be believed: the worst that any check says of it."""

from __future__ import annotations

from collections.abc import MutableMapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from pkmcal.arguments import instance
from pkmcal.diagnostics.check import Check, Said
from pkmcal.diagnostics.checks import CHECKS
from pkmcal.diagnostics.diagnosis import statements, verified
from pkmcal.diagnostics.gain import change
from pkmcal.fitted.solution import Solution

State = Literal["calibrated", "doubtful", "not calibrated"]


@dataclass(frozen=True)
class Verdict:
    """Return whether the result can be believed.

    Attributes
    ----------
    state : {"calibrated", "doubtful", "not calibrated"}
        "calibrated": nothing that was looked at speaks against it.
    reasons : tuple of str
        Why, the gravest first.
    remarks : tuple of str
        What one should know besides.
    said : tuple of Said
        What each check says: its sentence, the numbers behind it, and remedies as data.

    Examples
    --------
    >>> print(Verdict("doubtful", ("1 spare equation is too few",), ()))
    Doubtful: 1 spare equation is too few
    """

    state: State
    reasons: tuple[str, ...]
    remarks: tuple[str, ...]
    said: tuple[Said, ...] = ()

    def __str__(self) -> str:
        return f"{self.state.capitalize()}: {self.reasons[0]}"


def diagnose(
    found: Solution,
    checks: Sequence[Check[Any]] = CHECKS,
    findings: MutableMapping[str, tuple[Any, ...]] | None = None,
) -> Verdict:
    """Judge a calibration by a list of checks.

    Parameters
    ----------
    found : Identification
        The calibration.
    checks : sequence of Check
        The checks in the order in which they speak: `CHECKS`, and a user's own.
    findings : mutable mapping of str to tuple, optional
        Findings that are known already, by the names of their checks; others are added.

    Returns
    -------
    Verdict
        "not calibrated" where some check speaks of something grave, "doubtful" where one doubts.

    Raises
    ------
    TypeError
        No result of `identify`.
    ValueError
        Checks whose names, levels or `Check.unless` do not agree.

    Examples
    --------
    A check of one's own: a machine that is to be good to 0.1 mm.

    >>> import pkmcal as pk
    >>> coarse = pk.Check(
    ...     name="coarse",
    ...     about="the residuals are larger than 0.1 mm",
    ...     run=lambda found: [found.rms] if found.rms > 0.1 else [],
    ...     say=lambda found, rms: f"{rms:.2g} mm rms are more than the 0.1 mm that are allowed",
    ... )
    >>> robot = pk.load("hexapod")
    >>> q = robot.inverse(pk.sample_poses(robot, 20))
    >>> measured = pk.VirtualMachine(robot, noise=0.2, seed=0).measure(q)
    >>> found = pk.identify(robot, measured, "offset*")
    >>> pk.diagnose(found, (*pk.CHECKS, coarse)).said[-1].check
    'coarse'
    """
    instance("found", found, Solution, ", which `identify` returns")
    said = statements(found, verified(checks), {} if findings is None else findings)
    warned = {check.name for check in checks if check.at_once}
    grave = [each.text for each in said if each.level == "grave"]
    doubts = [each for each in said if each.level == "doubt"]
    doubts.sort(key=lambda each: each.check in warned)  # `identify` has said these already
    reasons = (*grave, *(each.text for each in doubts))
    remarks = tuple(each.text for each in said if each.level == "remark")
    if not reasons:
        return Verdict("calibrated", (change(found),), remarks, said)
    return Verdict("not calibrated" if grave else "doubtful", reasons, remarks, said)
