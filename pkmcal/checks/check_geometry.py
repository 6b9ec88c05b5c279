"""What robot files get wrong: limbs that are not alike, wrong units, strokes, singular machines."""

from __future__ import annotations

from dataclasses import dataclass

from pkmcal.arguments import instance
from pkmcal.arms.arm import SerialArm
from pkmcal.checks.arm import ARM_CHECKS
from pkmcal.checks.finding import Finding
from pkmcal.checks.function import singular, unreachable, wrong_unit
from pkmcal.checks.layout import (
    angles_as_coordinates,
    contradicted,
    doubled,
    off_circle,
    opposite_order,
    swapped,
    unlike,
)
from pkmcal.kinematics.robot import Robot

CHECKS = (
    angles_as_coordinates,
    wrong_unit,
    doubled,
    swapped,
    opposite_order,
    off_circle,
    unlike,
    unreachable,
    singular,
    contradicted,
)


@dataclass(frozen=True, eq=False)
class GeometryCheck:
    """What `check_geometry` found.

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
        """Whether nothing was found."""
        return not self.findings

    @property
    def kinds(self) -> tuple[str, ...]:
        """The kinds of findings, each once."""
        return tuple(dict.fromkeys(finding.kind for finding in self.findings))

    def __str__(self) -> str:
        count = len(self.findings)
        if not count:
            return f"{self.robot.name}: nothing found"
        lines = [f"{self.robot.name}: {count} finding{'s' if count > 1 else ''}"]
        wide = max(len(finding.kind) for finding in self.findings)
        for finding in self.findings:
            lines.append(f"{finding.kind:{wide}}  {finding.what}")
            lines.append(f"{'':{wide}}  -> {finding.suggestion}")
        return "\n".join(lines)


def check_geometry(robot: Robot | SerialArm) -> GeometryCheck:
    """Look for mistakes that tables of a machine's geometry have.

    Parameters
    ----------
    robot : Robot or SerialArm
        The machine.

    Returns
    -------
    GeometryCheck
        ``.ok`` where nothing was found; ``print`` shows each finding with a suggestion. Its kinds:

        ========  ==========================================================================
        angle     polar angles used as x and y, or angles in another unit
        unit      lengths in another unit than the rest
        double    limbs that are one another's copy
        swapped   base and platform exchanged
        order     base and platform joints counted in opposite senses: a mirrored frame
        circle    joints off the circle that the others lie on
        alike     limbs that are unlike the others
        stroke    home, or a stroke's ends, that the inverse kinematics cannot use
        singular  home, or every pose, is singular; affinely similar base and platform
        stated    numbers that contradict what the robot file states
        ========  ==========================================================================

    Raises
    ------
    TypeError
        `robot` is no machine.

    Notes
    -----
    Limbs count as alike within 3 % of the base's radius, so that a calibrated machine, which has
    errors of manufacture, raises no alarm; a slip smaller than that is not seen.

    Of a serial arm less can be told: lengths and joint errors in another unit (unit, angle), and
    neighbouring joints on one axis (double), where ``Finding.limbs`` counts joints.

    Examples
    --------
    >>> import pkmcal as pk
    >>> print(pk.check_geometry(pk.load("hexapod")))
    hexapod: nothing found
    >>> pk.check_geometry(pk.load("rbt-6t03p-printed")).findings[0].kind
    'angle'
    """
    if isinstance(robot, SerialArm):
        found = [finding for check in ARM_CHECKS for finding in check(robot)]
    else:
        instance("robot", robot, Robot, " or SerialArm")
        found = [finding for check in CHECKS for finding in check(robot)]
    return GeometryCheck(robot, tuple(found))
