"""Drive laws, which most controllers have no place for."""

from __future__ import annotations

from pkmcal.exceptions import ArgumentError
from pkmcal.geometry.laws import Law
from pkmcal.kinematics.robot import Robot


def require_plain_limbs(robot: Robot, holder: str) -> None:
    """Refuse a robot with drive laws, pulleys or tackles; `holder` is what has no place for them.

    Raises
    ------
    ValueError
        Naming the limb, and its law, pulley or tackle.
    """
    require_no_laws(robot, holder)
    require_no_pulleys(robot, holder)


def require_no_laws(robot: Robot, holder: str) -> None:
    """Refuse a robot with drive laws, naming the limb and its law."""
    for d, law in enumerate(robot.model.laws):
        if law is not None:
            raise ArgumentError(
                f"robot: limb {robot.model.limb_of_drive(d) + 1} of {robot.name} has a drive law"
                f" ({said(law)}), which {holder} cannot hold"
            )


def require_no_pulleys(robot: Robot, holder: str) -> None:
    """Refuse a robot with cables over pulleys or several points, naming the first."""
    for i in robot.model.pulleys:
        raise ArgumentError(
            f"robot: limb {i + 1} of {robot.name} runs over a pulley, which {holder} cannot hold"
        )
    require_no_tackles(robot, holder)


def require_no_tackles(robot: Robot, holder: str) -> None:
    """Refuse a robot with cables over several points, naming the first."""
    for i, limb in enumerate(robot.model.limbs):
        if limb.parts:
            raise ArgumentError(
                f"robot: limb {i + 1} of {robot.name} runs over several points, which {holder}"
                " cannot hold"
            )


def said(law: Law) -> str:
    """The kinds of numbers of a law, in words."""
    words = {
        "quadratic": law.quadratic,
        "spool": law.spool,
        "harmonics": law.harmonics,
        "table": law.table,
        "backlash": law.backlash,
        "stretch": law.stretch,
    }
    return ", ".join(word for word, has in words.items() if has)
