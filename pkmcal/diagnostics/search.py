"""Rank of the measurements, and how the search ended."""

from __future__ import annotations

import numpy as np

from pkmcal.diagnostics.check import Check, Level, Remedy, at_most_one
from pkmcal.diagnostics.linearity import Weak, beyond_linear
from pkmcal.estimation.held_coefficients import coefficients
from pkmcal.estimation.identifiability import listed
from pkmcal.fitted.solution import Solution

_LEAST_FREEDOM = 0.5  # degrees of freedom from which residuals show how good a fit is


def _nothing_determined(found: Solution) -> bool:
    return not found.fit.machine_combinations() and len(found.fit.parameters.places) > 0


def _too_few(found: Solution) -> tuple[str, ...]:
    """Name what there is too little of: poses, equations or freedom; and say so."""
    equations = found.fit.uncertainty.equations
    n, count = len(equations.parameters), int(equations.blocks.components.sum())
    read = equations.table.actuators
    if (read == read[0]).all() and len(equations.table.rows) > 1:
        return ("all rows have the same actuators: measure different poses",)
    # effects and stated uncertainties bring a prior for each of their own numbers
    own = sum(map(np.isfinite, found.fit.parameters.asked.of_effects.values()))
    own += len(found.nuisances)
    if count < n - own and len(found.fit.estimate.prior) <= own:
        return (
            f"{count} equations for {n} parameters: measure more poses, free fewer parameters or"
            " state a prior",
        )
    if found.dof < _LEAST_FREEDOM:
        return (
            f"{count} equations for {found.rank} identifiable combinations: no degrees of freedom"
            " are left to show how good the fit is; measure more poses",
        )
    return ()


def _kept(found: Solution) -> int:
    """Return the number of weak combinations that the search kept as they were."""
    state = found.fit.estimate.state
    return state.determined.rank - state.fitted.rank


def _kept_text(found: Solution, count: int) -> str:
    worst = found.fit.estimate.state.worst
    which = "combinations of parameters are" if count > 1 else "combination of parameters is"
    size = worst == found.fit.estimator.size
    why = "the machine's size" if size else "and the search did not end with them"
    return (
        f"{count} {which} determined to no better than {worst:.3g} mm, {why}, and kept as before:"
        " state a prior or measure more poses"
    )


def _weak(found: Solution) -> tuple[Weak, ...]:
    return at_most_one(beyond_linear(found.fit.estimate, found.fit.uncertainty))


def _level_of_weak(found: Solution, weak: Weak) -> Level:
    return "remark" if weak.assembled else "doubt"


def _undetermined(found: Solution) -> tuple[str, ...]:
    """Numbers of effects, by name, of which the measurements say nothing.

    Of the machine's own numbers that effects free, such as compliances, only if they say nothing
    of all: that of a joint which gravity does not turn has no influence. With a gauge they are
    known but for the scale of forces, which is said.
    """
    coefficient = {*coefficients(found.fit.equations.prediction.datasets)}
    freed = found.fit.parameters.asked.of_effects
    undetermined = [
        name
        for name, sigma in zip(found.free, found.stderr.tolist(), strict=True)
        if not np.isfinite(sigma)
    ]
    nothing = not found.gauges and freed.keys() <= {*undetermined}
    return tuple(
        name
        for name in undetermined
        if name.partition("@")[0] in coefficient or (nothing and name in freed)
    )


def _unread(found: Solution) -> tuple[str, ...]:
    """Numbers of readings, by name, of which each by itself changes nothing that was read."""
    freed = {*found.fit.start.robot.geometry.names}
    freed |= {*coefficients(found.fit.equations.prediction.datasets)}
    return tuple(
        name
        for name in found.free
        if name in found.unidentifiable and name.partition("@")[0] not in freed
    )


CHECKS = (
    Check(
        name="nothing-determined", about="the measurements determine no number of the machine",
        levels=("grave",), run=lambda found: at_most_one(_nothing_determined(found) or None),
        say=lambda found, _: (
            "these measurements determine no number of the machine, which is unchanged"
        ),
    ),
    Check(
        name="not-converged", about="the least squares did not converge", levels=("grave",),
        at_once=True, run=lambda found: () if found.converged else (found.evaluations,),
        say=lambda found, _: "the least squares did not converge",
    ),
    Check(
        name="at-bounds", about="numbers ended at a bound",
        run=lambda found: at_most_one(found.at_bounds or None),
        say=lambda found, names: (
            f"{listed(names)} ended at a bound: the fit would go further; widen the bound, or see"
            " what else is wrong"
        ),
        remedies=lambda found, names: (Remedy("bounds"),),
    ),
    Check(
        name="too-few-rows", about="one pose only, or no more equations than numbers", at_once=True,
        run=_too_few, say=lambda found, text: text,
    ),
    Check(
        name="weak-combinations",
        about="combinations of numbers are so weak that the search kept what they had",
        unless=("other-modes",), at_once=True,
        run=lambda found: at_most_one(_kept(found) or None), say=_kept_text,
        remedies=lambda found, _: (Remedy("prior"),),
    ),
    Check(
        name="undetermined-effect", about="numbers of effects that are not determined",
        unless=("grave",), run=lambda found: at_most_one(_undetermined(found) or None),
        say=lambda found, names: (
            f"{listed(names)} {'are' if len(names) > 1 else 'is'} not determined by these"
            " measurements: measure what the effect moves, or hold it"
        ),
        remedies=lambda found, names: (Remedy("fix", names),),
    ),
    Check(
        name="undetermined-reading", about="numbers of readings that are not determined",
        levels=("remark",), unless=("grave",),
        run=lambda found: at_most_one(_unread(found) or None),
        say=lambda found, names: (
            f"{listed(names)} {'are' if len(names) > 1 else 'is'} not determined by what was read;"
            " the machine's numbers do not depend on it"
        ),
    ),
    Check(
        name="beyond-linear",
        about="numbers are so uncertain that the machine is not linear over their ±",
        unless=("grave",), levels=("doubt", "remark"), run=_weak, level_of=_level_of_weak,
        say=lambda found, weak: str(weak),
        remedies=lambda found, weak: (Remedy("fix", weak.names), Remedy("prior")),
    ),
    Check(
        name="uninformative-poses",
        about="readings at some poses determine at most the poses themselves", levels=("remark",),
        run=lambda found: at_most_one(found.idle or None),
        say=lambda found, count: (
            f"{count} {'poses add' if count > 1 else 'pose adds'} nothing: the readings there"
            " determine at most the pose itself"
        ),
    ),
)  # fmt: skip
