"""Machines as the WebAssembly of the page has them in memory: little-endian, pointers of 4 bytes.

The structs of ``csrc/pkmcal.h`` and ``csrc/view/arms.c``, field by field. The page compares the
size, and a test compares its numbers with Python's.
"""

from __future__ import annotations

from struct import pack

import numpy as np

from pkmcal.arms.arm import SerialArm
from pkmcal.arrays import FloatArray
from pkmcal.core.chains import ChainMachine
from pkmcal.core.machine import Machine
from pkmcal.exceptions import ArgumentError

MOST_JOINTS = 32  # of a serial arm in csrc/view/arms.c
ARM_ERRORS = 8 * (1 + MOST_JOINTS * (1 + 9 + 3) + 16)  # where an arm's joint errors are, bytes
_ROOM = 32768  # bytes in csrc/view/view.h
_ARRAYS = (  # of pkm_chains, in its order
    "first", "member", "ball", "end_place", "ball_place", "end", "prismatic", "actuator",
    "coordinate", "place", "axes", "point", "soft", "drive_place", "zero",
)  # fmt: skip
_HEAD = 224  # bytes of pkm_chains


def limbs(machine: Machine, slots: FloatArray) -> bytes:
    """``pkm_machine`` and the geometry."""
    struct = machine.struct
    head = pack("<3i4x", struct.map, struct.limbs, struct.actuators)
    head += pack("<3d", struct.size, struct.length, struct.closure_tolerance)
    for name, kind in (
        *(("driver", "i"), ("rows", "i"), ("actuator", "i"), ("branch", "d"), ("angle", "i")),
        *(("near", "d"), ("frame", "d"), ("lever", "d"), ("weight", "d"), ("order", "i")),
        ("sharing", "d"),
    ):
        values = list(getattr(struct, name))
        head += pack(f"<{len(values)}{kind}", *values)
    return head + _doubles(slots)


def chains(machine: ChainMachine, slots: FloatArray) -> tuple[bytes, int]:
    """``pkm_chains`` with offsets as pointers, its arrays, the geometry; and where that is."""
    struct, layout = machine.struct, machine.layout
    head = pack(
        "<8i", struct.map, struct.chains, struct.joints, struct.actuators, struct.passive,
        struct.shared, struct.numbers, struct.tail,
    )  # fmt: skip
    head += pack("<3di4x", struct.size, struct.length, struct.closure_tolerance, struct.over)
    head += pack("<12d", *struct.home)
    body, places = b"", []
    for array in (*(getattr(layout, name) for name in _ARRAYS), slots):
        places.append(_HEAD + len(body))
        whole = np.issubdtype(array.dtype, np.integer)
        body += np.ascontiguousarray(array, dtype="<i4").tobytes() if whole else _doubles(array)
        body += bytes(-len(body) % 8)
    head += pack(f"<{len(_ARRAYS)}i4x", *places[:-1])
    assert len(head) == _HEAD
    if len(head + body) > _ROOM:
        raise ArgumentError(f"robot: its chains take {len(head + body)} bytes, at most {_ROOM}")
    return head + body, places[-1]


def arm(machine: SerialArm) -> bytes:
    """``arm_numbers``: all doubles, with room for `MOST_JOINTS` joints."""
    n = machine.n_joints
    if n > MOST_JOINTS:
        raise ArgumentError(f"robot: {n} joints, at most {MOST_JOINTS} can be shown")
    prismatic, axes, points, home = machine.core.arrays
    parts = [np.array([n]), _to_most(prismatic), _to_most(axes), _to_most(points), home]
    return b"".join(map(_doubles, [*parts, _to_most(machine.joint_errors)]))


def _to_most(rows: np.ndarray) -> FloatArray:
    """Rows of each joint, with zeros for those that it has not."""
    out = np.zeros((MOST_JOINTS, rows[0].size))
    out[: len(rows)] = rows.reshape(len(rows), -1)
    return out


def _doubles(array: np.ndarray) -> bytes:
    return np.ascontiguousarray(array, dtype="<f8").tobytes()
