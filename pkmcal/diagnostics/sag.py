"""Test of sag of an arm: its gain where nothing was fitted, each pose left out in turn."""

from __future__ import annotations

from typing import NamedTuple

from pkmcal.diagnostics.cause_columns import ratios_of_followers, waves_a_turn
from pkmcal.diagnostics.causes import HARMFUL, SURE
from pkmcal.diagnostics.check import Check, Remedy, at_most_one
from pkmcal.effects.effect import Changed
from pkmcal.effects.gears import Harmonics
from pkmcal.effects.sag import Sag
from pkmcal.exceptions import ArgumentError
from pkmcal.fitted.fit import Fit
from pkmcal.fitted.left_out import Comparison, compared_by_poses, effect_columns
from pkmcal.fitted.solution import Solution
from pkmcal.kinematics.calibratable import Calibratable
from pkmcal.statistics.causes import causes
from pkmcal.statistics.score_test import Columns, beside

NUMBERS = ("sag", "compliance")  # with which the names of sag begin


class LackingSag(NamedTuple):
    """Sag that a fit lacks, and what looks like it.

    Attributes
    ----------
    effect : Sag
        What would help.
    comparison : Comparison
        The poses left out.
    wave : Harmonics or None
        A wave a turn of one joint beside which sag explains nothing: an eccentric encoder makes the
        wave that the weight of the joint's own link does.
    more : bool
        Whether that wave explains what sag does not.
    """

    effect: Sag
    comparison: Comparison
    wave: Harmonics | None = None
    more: bool = False


def sag_that_helps(fit: Fit) -> LackingSag | None:
    """The sag of an arm that a fit lacks and that helps at poses left out; None where none does.

    First that of the main joints against what was fitted, then that of all joints against the
    better of both: main joints that explain nothing alone may do so with the others.
    """
    machine = fit.parameters.robot
    if machine.kind != "arm":
        return None
    found, before = None, {*fit.parameters.names}
    for effect in (Sag("main"), Sag("all")):
        changed = _on(effect, machine)
        lacking = set() if changed is None else {*changed.free} - before
        if changed is None or not lacking:
            continue
        gained = compared_by_poses(fit, [changed], lacking)
        if gained is None or not gained.passes:
            continue
        against_fit = gained if found is None else compared_by_poses(fit, [changed])
        if against_fit is not None:
            found, before = LackingSag(effect, against_fit), before | lacking
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


def _lacking(found: Solution) -> tuple[LackingSag, ...]:
    """Return the gain by sag that the fit lacks, and the wave that looks like it."""
    helps = sag_that_helps(found.fit)
    if helps is None:
        return ()
    columns = effect_columns(found.fit, [helps.effect.of_machine(found.fit.parameters.robot)])
    if columns is None:
        return (helps,)
    return () if _is_ratio(found, columns) else (_beside_waves(found, helps, columns),)


def _is_ratio(found: Solution, sag: Columns) -> bool:
    """Return whether one ratio by which a joint follows another one explains more than sag does."""
    fit, weighed = found.fit, found.weighed
    machine = fit.parameters.robot
    by_sag = beside(weighed.fit, weighed.columns(sag))
    for _, ratio in ratios_of_followers(machine):
        columns = effect_columns(fit, [ratio.of_machine(machine)])
        own = None if columns is None else beside(weighed.fit, weighed.columns(columns))
        if own is not None and own.chance < SURE and (by_sag is None or own.drop > by_sag.drop):
            score = own.score()
            if score is not None and score.chance < SURE:
                return True
    return False


def _beside_waves(found: Solution, helps: LackingSag, sag: Columns) -> LackingSag:
    """The gain by sag, and the wave a turn of one joint that explains all that sag does."""
    fit = found.fit
    machine = fit.parameters.robot
    by_wave = [
        (each, effect_columns(fit, [each.of_machine(machine)])) for each in waves_a_turn(machine)
    ]
    there = [(each, columns) for each, columns in by_wave if columns is not None]
    explained = causes(found.weighed, [sag, *(own for _, own in there)], SURE, 1)
    if not explained or explained[0].cause == 0 or 0 not in explained[0].spent:
        return helps
    (best,) = explained
    return helps._replace(wave=there[best.cause - 1][0], more=0 not in best.also)


def _in_it(found: Solution) -> tuple[Comparison, ...]:
    """Return the gain of the sag that was found."""
    names = _of_sag(found.fit)
    return at_most_one(compared_by_poses(found.fit, lacking=names) if names else None)


def _figures(gained: Comparison) -> str:
    return f"{gained} ({len(gained.numbers)} numbers, t {gained.t:.2g})"


def _say_lacking(found: Solution, lacking: LackingSag) -> str:
    gained, wave = lacking.comparison, lacking.wave
    joints = sorted({name.partition(".")[0].removeprefix("sag") for name in gained.numbers})
    harm = (
        f", and the numbers move by {gained.shift:.2g} times their ±" if gained.shift > 0.5 else ""
    )
    also = (
        f"; a wave a turn of joint {wave.joints}, as of an eccentric encoder or a tilted axis,"
        f" explains {'that and more' if lacking.more else 'as much'}: {Remedy('effects', (wave,))}"
        if wave is not None
        else ""
    )
    return (
        f"residuals follow the torque of gravity on joints {', '.join(joints)}: with"
        f" {Remedy('effects', (lacking.effect,))} {_figures(gained)}{harm}{also}"
    )


def _say_in_it(found: Solution, gained: Comparison) -> str:
    figures = _figures(gained)
    if not gained.passes:
        return f"sag does not help beyond chance: {figures}; --effects none leaves it out"
    better = min(gained.before, gained.alone)
    return (
        f"the arm sags: with its sag {figures}; a controller that holds no sag is left with"
        f" {better:.3f} mm"
    )


CHECKS = (
    Check(
        name="sag-lacking", about="joints of an arm yield under its weight, and nothing says so",
        levels=("doubt", "remark"),
        level_of=lambda found, lacking: (
            "doubt" if lacking.comparison.shift > HARMFUL else "remark"
        ),
        run=_lacking, say=_say_lacking,
        remedies=lambda found, finding: (Remedy("effects", (finding.effect,)),),
    ),
    Check(
        name="sag", about="whether sag of an arm that was found helps",
        levels=("remark",), run=_in_it, say=_say_in_it,
    ),
)  # fmt: skip
