"""Place of a printer's bed probe, as its firmware states it: `[probe]` of a robot file.

It touches the bed at the nozzle's x and y plus the first two numbers, and the nozzle is then the
third above the bed. Klipper's x_offset, y_offset and z_offset and RepRapFirmware's G31 X Y Z are
these numbers; Marlin's M851 has the other sign of z.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.files.toml_table import Table

LOWEST = -1.0  # mm: of a nozzle that triggers only when it presses on the bed
OTHER_SIGN = (
    "z is how high the nozzle is above the bed when the probe triggers, found {z:g} mm; it is -Z of"
    " Marlin's M851"
)


def read_probe(table: Table) -> FloatArray:
    """The offset (3,) of a table ``[probe]``, mm; z has no default, for it moves the whole bed."""
    table.only(("offset",))
    offset = table.table("offset")
    offset.only(("x", "y", "z"))
    x, y, z = offset.number("x", "mm", 0.0), offset.number("y", "mm", 0.0), offset.number("z", "mm")
    if z < LOWEST:
        offset.fail("z", OTHER_SIGN.format(z=z))
    found = np.array([x, y, z])
    found.flags.writeable = False
    return found


def probe_table(offset: Sequence[float] | FloatArray) -> dict[str, dict[str, float]]:
    """The table of an offset in mm."""
    return {"offset": dict(zip("xyz", map(float, offset), strict=True))}
