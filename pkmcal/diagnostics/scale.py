"""Things of stated size that tell how large a machine is: a board, printed larger or smaller."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.core import screws
from pkmcal.diagnostics.cause_columns import columns_of_held
from pkmcal.diagnostics.check import Check, at_most_one
from pkmcal.fitted.fit import Fit
from pkmcal.fitted.machine_accuracy import times_stated
from pkmcal.fitted.solution import Solution
from pkmcal.statistics.score_test import beside

_FEW = 5  # poses, of which a size is compared
_GROWN = 3e-3  # share by which a machine has become larger, from which on no part was made so badly
_ALIKE = 3.0  # times what else has changed in where the machine goes
_PRINTED = 2e-3  # share by which printers are off
_SIZE = "size"  # what readings call the number


@dataclass(frozen=True)
class Scale:
    """What a machine's size rests on.

    Attributes
    ----------
    by : str
        The thing of stated size.
    alone : bool
        Whether nothing else that was measured has a length.
    known : float
        Standard deviation of its size as a share: 0 where it counts as exact, inf where it is found
        from nothing.
    harmful : float
        Share by which it may be larger than stated until the machine is off by as much as ± state;
        inf where its size is not held.
    grown : float
        How much larger the machine has become, all of it alike; 0.04: by 4 %.
    rest : float
        Change of where it goes beside that, as a share of its size.
    """

    by: str
    alone: bool
    known: float
    harmful: float
    grown: float
    rest: float

    @property
    def doubtful(self) -> bool:
        """Whether the thing hardly has the size that is stated."""
        if not self.alone:
            return False
        return np.isinf(self.known) or abs(self.grown) > max(_GROWN, _ALIKE * self.rest)


def scale_by_one(found: Solution) -> Scale | None:
    """Find the thing of stated size on which the machine rests; None where that does no harm."""
    fit = found.fit
    by = {m.instrument.scaled_by for m in fit.uncertainty.equations.table.sets}
    things = by - {""}
    if len(things) != 1:
        return None
    (thing,) = things
    machine = fit.end.robot
    gains = [f"gain{i + 1}" for i, unit in enumerate(machine.actuator_units) if unit == "mm"]
    alone, harmful = len(by) == 1 and {*gains} <= {*found.free}, _harmful(fit)
    if not alone and harmful > _PRINTED:
        return None
    return Scale(thing, alone, _known(fit, thing), harmful, *_grown(fit.start.pose, fit.end.pose))


def _known(fit: Fit, thing: str) -> float:
    """How well the sizes of things are known, the worst of them."""
    chosen = fit.parameters
    sizes = [
        i for i, name in enumerate(chosen.names)
        if name.startswith(f"{thing}.") and name.endswith(f".{_SIZE}")
    ]  # fmt: skip
    sigma = chosen.prior.copy()
    sigma[chosen.uncertain] = np.sqrt(np.diagonal(chosen.spread))
    return float(sigma[sizes].max(initial=0.0))


def _harmful(fit: Fit) -> float:
    """Find the share of all sizes that are held that moves the machine by as much as ± state."""
    sure = fit.uncertainty
    kinds = {type(m.instrument) for m in sure.equations.table.sets}
    held = {each for kind in kinds for each in kind.held if each.argument == _SIZE}
    columns = columns_of_held(held.pop())(fit) if len(held) == 1 and sure.known else None
    taken = None if columns is None else beside(sure.fit, columns)
    if taken is None:
        return np.inf
    times = times_stated(fit, fit.parameters.scale[:, None] * sure.fit.back @ taken.by_basis)
    return 1.0 / times if times > 0.0 else np.inf


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
    if seen.alone and np.isinf(seen.known):
        return (
            f"nothing that was measured has a length: with the size of the {thing} unknown the"
            " machine stays as large as drawn; state the size, or measure one distance"
        )
    rests = f"how large the machine is rests on the {thing} alone"
    if seen.doubtful:
        machine, other = ("larger", "smaller") if seen.grown > 0 else ("smaller", "larger")
        return (
            f"{rests}, and all of it has become {percent:.2g} % {machine} than drawn: the {thing}"
            f" is rather {percent:.2g} % {other} than stated; measure it and state its size as it"
            " is, or measure one distance of the machine"
        )
    if np.isinf(seen.harmful):  # none is held, or the machine is not determined at all
        known = f", whose size is stated to {100.0 * seen.known:.2g} %" if seen.known else ""
        return f"{rests}{known}"
    one = f"{rests}: one" if seen.alone else f"a {thing}"
    return (
        f"{one} that is some {100.0 * seen.harmful:.1g} % larger or smaller than stated puts the"
        " machine off by as much as its ± say; state how well the size is known, --size-sigma"
        " (size_sigma=), and they contain it"
    )


CHECKS = (
    Check(
        name="scale", about="a thing of stated size on which the size of the machine rests",
        levels=("remark", "doubt"), run=lambda found: at_most_one(scale_by_one(found)), say=_text,
        level_of=lambda found, seen: "doubt" if seen.doubtful else "remark",
    ),
)  # fmt: skip
