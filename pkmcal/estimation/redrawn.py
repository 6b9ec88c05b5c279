"""The equations of other readings of the same poses: replicates of the bootstrap."""

from __future__ import annotations

from dataclasses import replace

from pkmcal.arrays import FloatArray
from pkmcal.estimation.equations import Equations
from pkmcal.estimation.evaluation import Evaluation


def redrawn(
    equations: Equations,
    at: Evaluation,
    noise: FloatArray,
    reduced: FloatArray,
    prior_centre: FloatArray,
    drawn: FloatArray | None = None,
) -> tuple[Equations, Evaluation]:
    """The equations of other readings, and evaluated where these have been drawn.

    `at` is where the machine is taken to be, and `reduced` (M,) are the residuals of the new
    readings there, as `Equations.residual`. `noise` (G,) is as in `Whitening`, `drawn` (s,) as in
    `Parameters`; `prior_centre` (n,) is another centre of the prior.
    """
    errors, machines = reduced, equations.machines
    if equations.system is not None:
        change, errors = equations.system.redrawn(at, noise, reduced)
        machines = machines.shifted(change)
    residuals = tuple(equations.whitening.unwhiten(errors, noise))
    predicted = equations.prediction.values(at)
    sets = tuple(
        replace(m, values=m.instrument.corrected(values, residual).reshape(m.values.shape))
        for m, values, residual in zip(equations.table.sets, predicted, residuals, strict=True)
    )
    parameters = replace(equations.parameters, start=prior_centre, drawn=drawn)
    prediction = replace(
        equations.prediction, table=replace(equations.table, sets=sets), parameters=parameters
    )
    other = replace(equations, prediction=prediction, machines=machines)
    if equations.machines.unknowns:
        return other, other.at(at.theta, noise, at)
    return other, replace(at, parameters=parameters, residuals=residuals, cache={})
