"""An arm for a controller that holds no laws of its joints: no sag, no gears."""

from __future__ import annotations

from dataclasses import dataclass, replace

from pkmcal.arms.arm import SerialArm
from pkmcal.estimation.begin import begun, estimator_at
from pkmcal.estimation.free_parameters import parameters
from pkmcal.estimation.solving import solve
from pkmcal.fitted.left_out import Comparison, compared_by_poses
from pkmcal.fitted.solution import Solution
from pkmcal.kinematics.arm_machine import ArmMachine
from pkmcal.kinematics.calibratable import as_given


@dataclass(frozen=True)
class RigidArm:
    """The better of two arms without laws of joints, by poses left out.

    Attributes
    ----------
    arm : SerialArm
        With joint errors alone.
    refitted : bool
        Whether these were fitted without laws; else they are those of the fit with laws.
    comparison : Comparison or None
        What poses left out say; None where they can say nothing, and the refitted one is taken.
    """

    arm: SerialArm
    refitted: bool
    comparison: Comparison | None

    def __str__(self) -> str:
        how = "fitted without the laws of its joints" if self.refitted else "as fitted with laws"
        if self.comparison is None:
            return f"joint errors {how}"
        left = self.comparison.before if self.refitted else self.comparison.alone
        return (
            f"joint errors {how}: {left:.3f} mm at poses left out,"
            f" {self.comparison.after:.3f} mm with the laws, which it does not hold"
        )


def rigid_arm(found: Solution) -> RigidArm | None:
    """The arm of a calibration without the laws of its joints; None where it has none."""
    robot = found.robot
    if not isinstance(robot, SerialArm) or robot.laws is None:
        return None
    fit = found.fit
    laws = {*robot.laws.names}
    fitted = [name for name in fit.parameters.names if name.partition("@")[0] in laws]
    compared = compared_by_poses(fit, lacking=fitted) if fitted else None
    if compared is not None and compared.alone <= compared.before:
        return RigidArm(robot.rigid, False, compared)
    return RigidArm(_refitted(found), True, compared)


def _refitted(found: Solution) -> SerialArm:
    """The arm whose joint errors are fitted without laws."""
    chosen, equations = found.fit.parameters, found.fit.equations
    assert isinstance(chosen.robot, ArmMachine)
    machine = ArmMachine(chosen.robot.arm.rigid)
    own = [name for name in chosen.names if name in machine.geometry.names]
    asked = replace(chosen.asked, free=own, of_effects={})
    rigid = parameters(machine, equations.prediction.datasets, asked)
    whole, start = begun(equations.prediction.datasets, rigid, equations.missing)
    end = solve(estimator_at(whole, start, found.fit.estimate.state.loss))
    theta = end.evaluation.theta
    arm = as_given(machine.replace(rigid.values_at(theta)))
    assert isinstance(arm, SerialArm)
    return arm
