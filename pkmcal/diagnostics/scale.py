"""The size of a machine, where one thing alone tells it: a board, printed larger or smaller."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.core import screws
from pkmcal.diagnostics.check import Check, at_most_one
from pkmcal.fitted.solution import Solution

_FEW = 5  # poses, of which a size is compared
_GROWN = 3e-3  # share by which a machine has become larger, from which on no part was made so badly
_ALIKE = 3.0  # times what else has changed in where the machine goes


@dataclass(frozen=True)
class Scale:
    """What a machine's size rests on.

    Attributes
    ----------
    by : str
        The one thing of stated size.
    found : bool
        Whether its size is found, not stated.
    grown : float
        How much larger the machine has become, all of it alike; 0.04: by 4 %.
    rest : float
        Change of where it goes beside that, as a share of its size.
    """

    by: str
    found: bool
    grown: float
    rest: float

    @property
    def doubtful(self) -> bool:
        """Whether the thing hardly has the size that is stated."""
        return self.found or abs(self.grown) > max(_GROWN, _ALIKE * self.rest)


def scale_by_one(found: Solution) -> Scale | None:
    """Find the one thing that tells how large the machine is; None where there are several."""
    machine = found.fit.end.robot
    by = {m.instrument.scaled_by for m in found.fit.uncertainty.equations.table.sets}
    if len(by) != 1 or "" in by:
        return None
    gains = [f"gain{i + 1}" for i, unit in enumerate(machine.actuator_units) if unit == "mm"]
    if not {*gains} <= {*found.free}:
        return None
    thing = by.pop()
    return Scale(
        thing, f"{thing}.size" in found.free, *_grown(found.fit.start.pose, found.fit.end.pose)
    )


def _grown(start: FloatArray, end: FloatArray) -> tuple[float, float]:
    """Growth of where poses (K, 6) lie, and what else has changed, as shares of their extent.

    Beside the growth the frames of base and platform may have moved.
    """
    known = np.isfinite(start).all(axis=1) & np.isfinite(end).all(axis=1)
    if known.sum() < _FEW:
        return 0.0, 0.0
    motion = screws.frames(np.ascontiguousarray(start[known]))
    place = motion[:, :3, 3] - motion[:, :3, 3].mean(axis=0)
    extent = float(np.sqrt((place**2).sum(axis=1).mean()))
    if extent == 0.0:
        return 0.0, 0.0
    turned = np.cross(np.eye(3)[None], place[:, None, :]).transpose(0, 2, 1)
    level = np.tile(np.eye(3), (len(place), 1, 1))
    rows = np.concatenate([place[:, :, None], turned, level, motion[:, :3, :3]], axis=2)
    rows, change = rows.reshape(-1, 10) / extent, (end - start)[known, :3].ravel() / extent
    by = np.linalg.lstsq(rows, change, rcond=1e-9)[0]
    left = change - rows @ by
    return float(by[0]), float(np.sqrt(3.0 * np.mean(left**2)))


def _text(found: Solution, seen: Scale) -> str:
    thing, percent = seen.by, 100.0 * abs(seen.grown)
    if seen.found:
        return (
            f"nothing that was measured has a length: with the size of the {thing} unknown the"
            " machine stays as large as drawn; state the size, or measure one distance"
        )
    rests = f"how large the machine is rests on the {thing} alone"
    if not seen.doubtful:
        return f"{rests}: a {thing} that is 0.2 % larger than stated makes it 0.2 % larger"
    machine, other = ("larger", "smaller") if seen.grown > 0 else ("smaller", "larger")
    return (
        f"{rests}, and all of it has become {percent:.2g} % {machine} than drawn: the {thing} is"
        f" rather {percent:.2g} % {other} than stated; measure it and state its size as it is, or"
        " measure one distance of the machine"
    )


CHECKS = (
    Check(
        name="scale", about="one thing of stated size that alone tells how large the machine is",
        levels=("remark", "doubt"), run=lambda found: at_most_one(scale_by_one(found)), say=_text,
        level_of=lambda found, seen: "doubt" if seen.doubtful else "remark",
    ),
)  # fmt: skip
