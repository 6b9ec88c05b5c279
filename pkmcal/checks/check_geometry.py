"""Mistakes in robot files: limbs that differ, wrong units, unusable strokes, singular machines."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from pkmcal.arguments import instance
from pkmcal.arms.arm import SerialArm
from pkmcal.checks.arm import ARM_CHECKS
from pkmcal.checks.cables import not_pulled, said_of_cables
from pkmcal.checks.chains import CHAIN_CHECKS, surplus
from pkmcal.checks.finding import Finding
from pkmcal.checks.function import (
    not_closed,
    outside_workspace,
    singular,
    turning,
    unreachable,
    unusual_size,
    wrong_unit,
)
from pkmcal.checks.layout import (
    angles_as_coordinates,
    contradicted,
    doubled,
    off_circle,
    opposite_order,
    swapped,
    unlike,
)
from pkmcal.checks.loads import arm_sags, sags
from pkmcal.display import Table
from pkmcal.kinematics.pulled import on_cables
from pkmcal.kinematics.robot import Robot
from pkmcal.result import Result

CHECKS = (
    angles_as_coordinates,
    wrong_unit,
    doubled,
    swapped,
    opposite_order,
    off_circle,
    unlike,
    not_closed,
    outside_workspace,
    turning,
    unreachable,
    singular,
    contradicted,
)
# Anchors of cables stand where there is room for them, and platforms hang between crossed ones.
CABLE_CHECKS = (
    *(check for check in CHECKS if check not in (off_circle, unlike, opposite_order)),
    not_pulled,
)


@dataclass(frozen=True, eq=False, repr=False)
class GeometryCheck(Result):
    """Suspected mistakes of a machine's geometry.

    Attributes
    ----------
    robot : Robot or SerialArm
        The machine.
    findings : tuple of Finding
        Each with what was found, in numbers, and a suggestion.
    """

    robot: Robot | SerialArm
    findings: tuple[Finding, ...]

    @property
    def ok(self) -> bool:
        """True if no problems were found."""
        return not self.findings

    @property
    def kinds(self) -> tuple[str, ...]:
        """The kinds of findings, each once."""
        return tuple(dict.fromkeys(finding.kind for finding in self.findings))

    def _parts(self) -> Iterator[str | Table]:
        count = len(self.findings)
        if not count:
            yield f"{self.robot.name}: no problems found"
            if isinstance(self.robot, Robot) and (remark := _remark(self.robot)):
                yield remark
            return
        yield f"{self.robot.name}: {count} finding{'s' if count > 1 else ''}"
        rows = [
            row
            for finding in self.findings
            for row in ((finding.kind, finding.what), ("", f"-> {finding.suggestion}"))
        ]
        yield Table(["kind", "finding"], rows, left=2)


def check_geometry(robot: Robot | SerialArm) -> GeometryCheck:
    """Look for mistakes in the geometry of a machine.

    Parameters
    ----------
    robot : Robot or SerialArm
        The machine.

    Returns
    -------
    GeometryCheck
        ``.ok`` where no problems were found; ``print`` shows each finding. Its kinds:

        ========  ==========================================================================
        angle     polar angles used as x and y, or angles in another unit
        unit      lengths in another unit than the rest
        double    limbs that are one another's copy
        swapped   base and platform exchanged
        order     base and platform joints counted in opposite senses: a mirrored frame
        circle    joints off the circle that the others lie on
        alike     limbs that are unlike the others
        home      a home that the constraints of limbs do not allow
        stroke    home, or a stroke's ends, that the inverse kinematics cannot use
        singular  home, or every pose, is singular or nearly; affinely similar base and platform
        axis      an axis of a U along its rod
        drive     drive laws that may turn back within their stroke: they have no inverse
        tension   a home at which not all cables can pull
        load      a sag that no machine has: stiffness, masses or gravity in other units
        stated    numbers that contradict what the robot file states
        ========  ==========================================================================

    Raises
    ------
    TypeError
        `robot` is no machine.

    Notes
    -----
    Limbs count as alike within 3 % of the base's radius, so that a calibrated machine, which has
    errors of manufacture, raises no alarm; a slip smaller than that is not seen. A machine below
    10 mm or above 100 m is no finding, for there are such; where nothing else is found ``print``
    remarks on its size, since all of its lengths may be in another unit.

    Of a machine on cables alone joints may lie anywhere: circle, order and alike are not looked at.
    ``print`` says what its cables need to pull at home, and whether it can calibrate itself.

    Of a machine of chains it is checked that the platform stands still while its actuators do
    (mobility: what it can still do is named), that home values are the distances they seem to be
    (home), limits and singularities. Where the limbs close more than they need to, ``print``
    remarks on that.

    Of a serial arm fewer things can be checked: lengths, joint errors and Denavit–Hartenberg twists
    in another unit (unit, angle), neighbouring joints on one axis (double), and how far it sags
    (load), where ``Finding.limbs`` counts joints.

    Examples
    --------
    >>> import pkmcal as pk
    >>> print(pk.check_geometry(pk.load("hexapod")))
    hexapod: no problems found
    >>> pk.check_geometry(pk.load("rbt-6t03p-printed")).findings[0].kind
    'angle'
    """
    if isinstance(robot, SerialArm):
        found = [finding for check in (*ARM_CHECKS, arm_sags) for finding in check(robot)]
    else:
        instance("robot", robot, Robot, " or SerialArm")
        checks: Sequence[Callable[[Robot], Iterator[Finding]]] = CHECKS
        if not robot.model.closed_form:
            checks = CHAIN_CHECKS
        elif on_cables(robot):
            checks = CABLE_CHECKS
        found = [finding for check in checks for finding in check(robot.rigid)]
        found += sags(robot)
    return GeometryCheck(robot, tuple(found))


def _remark(robot: Robot) -> str:
    if not robot.model.closed_form:
        return surplus(robot)
    remarks = [unusual_size(robot), said_of_cables(robot) if on_cables(robot) else ""]
    return "; ".join(filter(None, remarks))
