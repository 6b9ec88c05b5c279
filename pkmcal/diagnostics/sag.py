"""Whether an arm sags: what sag gains where nothing was fitted, each pose left out in turn."""

from __future__ import annotations

from typing import NamedTuple

from pkmcal.diagnostics.check import Check, Remedy, at_most_one
from pkmcal.effects.effect import Changed
from pkmcal.effects.sag import Sag
from pkmcal.exceptions import ArgumentError
from pkmcal.fitted.fit import Fit
from pkmcal.fitted.left_out import Comparison, compared_by_poses
from pkmcal.fitted.solution import Solution
from pkmcal.kinematics.calibratable import ArmMachine, Calibratable

NUMBERS = ("sag", "compliance")  # with which the names of sag begin


class SagFinding(NamedTuple):
    """What sag gains.

    Attributes
    ----------
    effect : Sag or None
        What would help; None where the fit has it.
    comparison : Comparison
        The poses left out.
    """

    effect: Sag | None
    comparison: Comparison


def sag_that_helps(fit: Fit) -> SagFinding | None:
    """The sag of an arm that a fit lacks and that helps at poses left out; None where none does.

    First that of the main joints against none, then that of all joints against it.
    """
    machine = fit.parameters.robot
    if not isinstance(machine, ArmMachine) or _of_sag(fit):
        return None
    found, before = None, frozenset[str]()
    for effect in (Sag("main"), Sag("all")):
        changed = _on(effect, machine)
        if changed is None:
            break
        gained = compared_by_poses(fit, [changed], {*changed.free} - before)
        if gained is None or not gained.passes:
            break
        against_none = gained if not before else compared_by_poses(fit, [changed])
        if against_none is None:
            break
        found, before = SagFinding(effect, against_none), frozenset(changed.free)
    return found


def _on(effect: Sag, machine: Calibratable) -> Changed | None:
    """The effect on a machine; None where gravity turns none of its joints."""
    try:
        return effect.of_machine(machine)
    except ArgumentError:
        return None


def _of_sag(fit: Fit) -> list[str]:
    """Numbers of sag that were found."""
    own = fit.parameters.asked.of_effects
    return [
        name
        for name in fit.parameters.names
        if name.startswith(NUMBERS) and name.partition("@")[0] in own
    ]


def _found(found: Solution) -> SagFinding | None:
    fit = found.fit
    if not isinstance(fit.parameters.robot, ArmMachine):
        return None
    names = _of_sag(fit)
    if not names:
        return sag_that_helps(fit)
    gained = compared_by_poses(fit, lacking=names)
    return None if gained is None else SagFinding(None, gained)


def _say(found: Solution, finding: SagFinding) -> str:
    effect, gained = finding
    figures = f"{gained} ({len(gained.numbers)} numbers, t {gained.t:.2g})"
    if effect is not None:
        joints = sorted({name.partition(".")[0].removeprefix("sag") for name in gained.numbers})
        return (
            f"residuals follow the torque of gravity on joints {', '.join(joints)}: {figures} with"
            f" {Remedy('effects', (effect,))}"
        )
    if not gained.passes:
        return f"sag does not help beyond chance: {figures}; --effects none leaves it out"
    better = min(gained.before, gained.alone)
    return f"the arm sags: {figures}; a controller that holds no sag is left with {better:.3f} mm"


CHECKS = (
    Check(
        name="sag", about="joints of an arm that yield under its weight",
        levels=("remark",),
        run=lambda found: at_most_one(_found(found)),
        say=_say,
        remedies=lambda found, finding: (
            () if finding.effect is None else (Remedy("effects", (finding.effect,)),)
        ),
    ),
)  # fmt: skip
