"""The start of a calibration: equations at the nominal machine, frames aligned to readings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from pkmcal.estimation.equations import Equations
from pkmcal.estimation.estimator import Estimator
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.fit_data import FitData
from pkmcal.estimation.loss import LossName
from pkmcal.estimation.mode_slips import start_in_modes
from pkmcal.estimation.parameters import Parameters
from pkmcal.estimation.pose_minima import in_least_minima
from pkmcal.exceptions import FitError, UnreachedError


def begun(
    datasets: Sequence[FitData], chosen: Parameters, unread: int
) -> tuple[Equations, Evaluation]:
    """The equations, and where those with exact actuators start."""
    equations = Equations.of(datasets, chosen, unread)
    exact = equations.with_exact_actuators()
    start = start_in_modes(exact)
    _, own = equations.begin(start)
    better = in_least_minima(equations.with_parameters(start.parameters).fewest, own)
    if better is not own:
        start = exact.start(states=better.onward)
    if start.ok:  # what it began with is needed of rows that failed alone, and takes memory
        start = replace(start, begun=start.states)
    return equations.with_parameters(start.parameters), start


def estimator_at(equations: Equations, start: Evaluation, loss: LossName) -> Estimator:
    """The estimator at its start, which is that with exact actuators.

    Raises
    ------
    ValueError
        Rows that were not reached; `UnreachedError` of those whose actuators alone were.
    """
    if not start.ok and not equations.machines.unknowns:
        raise FitError(equations.failures(start))
    equations, own = equations.begin(start)
    if not own.ok:
        failed = equations.failures(own)
        if not start.ok:
            raise FitError(failed)
        raise UnreachedError(failed, equations.unreached(own))
    return Estimator.of(equations, own, loss)
