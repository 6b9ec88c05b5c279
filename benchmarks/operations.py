"""How many additions and multiplications forward kinematics needs, from the generated headers."""

from __future__ import annotations

import re
from typing import NamedTuple

from csrc.build import GENERATED

OPERATIONS = re.compile(
    r"operations: (\d+) \+, (\d+) \*, (\d+) /, (\d+) sqrt\s+\*/\s+INLINE void FN\((\w+)\)"
)


class Operations(NamedTuple):
    """Of one row; divisions and roots count as one."""

    floats: int
    doubles: int


def counts() -> dict[str, int]:
    """Operations of every generated function."""
    text = "".join(path.read_text() for path in sorted(GENERATED.glob("*.h")))
    return {name: sum(map(int, found)) for *found, name in OPERATIONS.findall(text)}


def factoring(m: int) -> int:
    """LU of an m x m system: a reciprocal, a column and an update for each pivot."""
    return sum(1 + left + 2 * left * left for left in range(m))


def substituting(m: int) -> int:
    """Forward and back, with the reciprocals at hand."""
    return 2 * m * (m - 1) + m


def hexapod_forward(iterations: int) -> Operations:
    """A row of a 6-UPS in csrc/quick.h: a prediction, Newton in floats, two chords in doubles.

    Not counted: the inverse at the shared guess, once a call; three arctangents and the checks of
    a row; conversions and moves.
    """
    of, m, limbs = counts(), 6, 6
    steps = iterations - 2
    frame, retract = of["map_spatial_frame"], of["map_spatial_retract"]
    row = 1 + of["sphere_row"] + of["map_spatial_pull"]  # 1: the length squared
    system = frame + limbs * row + factoring(m)
    prediction = 2 * m * limbs + m + retract
    step = substituting(m) + retract
    # R b + p - c as in limb_joint, then half of its square less the length's square
    residual = frame + limbs * (of["limb_joint"] + 8)
    loading = limbs * of["limb_drive"]
    unloading = frame + of["map_spatial_angles"]
    return Operations(
        prediction + (steps + 1) * system + steps * step + 2 * substituting(m) + 2 * limbs,
        loading + of["map_spatial_tidy"] + 3 * residual + 2 * retract + unloading,
    )
