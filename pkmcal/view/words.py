"""Words of a page on a machine: its limbs, and the ways in which it moves."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np

from pkmcal.arms.arm import SerialArm
from pkmcal.arrays import FloatArray
from pkmcal.core.library import POSE
from pkmcal.geometry.chains import Chains
from pkmcal.geometry.limb_kinds import KINDS, LimbKind
from pkmcal.kinematics.robot import Robot
from pkmcal.kinematics.stiffness import stiffness

SYMBOLS = {"alpha": "α", "beta": "β", "gamma": "γ"}
_COUNTS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")
_SAG = 1e-6  # mm: less is rounding


def of_robot(robot: Robot) -> str:
    """Sentences about a parallel machine.

    Examples
    --------
    >>> import pkmcal as pk
    >>> of_robot(pk.load("hexapod"))[:62]
    'A platform on six legs of variable length (UPS). Six actuators'
    """
    limbs, moved = (
        (_listed([(_some(KINDS[kind], n), kind) for kind, n in _counted(robot)]), "it")
        if robot.model.chains is None
        else _of_chains(robot.model.chains)
    )
    n = robot.n_actuators
    ways = _ways(robot.moved, moved)
    return f"A platform on {limbs}. {_count(n).capitalize()} actuators {ways}."


def _of_chains(chains: Chains) -> tuple[str, str]:
    """Return the limbs that are chains, and what is moved by these and a tail."""
    own = [limb[: len(limb) - chains.tail] for limb in chains.limbs]
    letters = ["".join(_letter(j.kind, j.actuator) for j in limb) for limb in own]
    counted = Counter(letters).items()
    limbs = _listed([(f"{_count(n)} chain{'s' * (n > 1)} of joints", kind) for kind, n in counted])
    moved = "it"
    if chains.tail:
        last = "".join(_letter(j.kind, j.actuator) for j in chains.limbs[0][-chains.tail :])
        joints = "joint carries" if chains.tail == 1 else "joints carry"
        limbs += f"; behind it {_count(chains.tail)} more {joints} the tool ({last})"
        moved = "the tool"
    return f"{limbs}, underlined the joints that are driven", moved


def _listed(kinds: Sequence[tuple[str, str]]) -> str:
    """Return how many limbs of which kinds."""
    return " and ".join(f"{some} ({kind})" for some, kind in kinds)


def of_yielding(robot: Robot) -> str:
    """A sentence about what a page leaves out of a machine that yields; empty for a rigid one.

    Examples
    --------
    >>> import pkmcal as pk
    >>> of_yielding(pk.load("hexapod").yielding({"offset*": 5e-5}))[-54:]
    'way by 1 mm at 1.35e+03 N along its softest direction.'
    """
    if robot is robot.rigid:
        return ""
    home = robot.home
    off = robot.forward(robot.rigid.inverse(home), guess=home).pose[:3] - home[:3]
    sag = float(np.linalg.norm(off))
    softest = float(stiffness(robot, home).softest[1])
    sags = f"sags by {sag:.2g} mm under the load that its file states, and " if sag > _SAG else ""
    return (
        f" What yields is left out of its motions here: at home the machine {sags}gives way by 1 mm"
        f" at {softest:.3g} N along its softest direction."
    )


def of_arm(arm: SerialArm) -> str:
    """A sentence about a serial arm."""
    kinds = Counter(arm.kinds)
    joints = " and ".join(f"{_count(n)} {kind}" for kind, n in kinds.items())
    led = [f"joint {joint} follows joint {leader}" for joint, leader, _ in arm.followers.ratios]
    return (
        f"An arm of {joints} joint{'s' * (arm.n_joints > 1)}, one after the other"
        f"{': ' * bool(led)}{', '.join(led)}."
    )


def of_laws(arm: SerialArm, theta: FloatArray) -> str:
    """A sentence about laws of joints that a page leaves out; empty without any."""
    if arm.laws is None:
        return ""
    off = np.linalg.norm((arm.forward(theta) - arm.rigid.forward(theta))[:3, 3])
    return (
        " What joints add to their commands is left out here: where the arm is shown at first, its"
        f" tool is {off:.2g} mm from there."
    )


def _counted(robot: Robot) -> list[tuple[str, int]]:
    return list(Counter(limb.kind for limb in robot.model.limbs).items())


def _letter(kind: str, actuator: int | None) -> str:
    """An actuated joint is underlined."""
    return kind if actuator is None else kind + "\N{COMBINING LOW LINE}"


def _count(n: int) -> str:
    return _COUNTS[n] if n < len(_COUNTS) else str(n)


def _some(kind: LimbKind, n: int) -> str:
    return kind.what if n == 1 else f"{_count(n)} {kind.many}"


def _ways(moved: Sequence[str], what: str) -> str:
    lengths = [name for name in moved if name in POSE[:3]]
    angles = [name for name in moved if name in POSE[3:]]
    ways = []
    if lengths:
        ways.append(f"move {what} along {', '.join(lengths)}")
    if angles:
        about = ", ".join(POSE[POSE.index(name) - 3] for name in angles)
        letters = ", ".join(SYMBOLS[name] for name in angles)
        ways.append(f"turn {'it' if ways else what} about {about} ({letters})")
    return " and ".join(ways)
