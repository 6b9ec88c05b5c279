"""Check whether a target sits elsewhere than it is stated: a reflector badly seated, say.

Where several known points of the platform are read, all of the residuals of one that is not where
it should be point the same way on the platform. Poses do not show it: rows of a pose do not share
it, and points that are held out have it as well.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray
from pkmcal.diagnostics.check import CHANCE
from pkmcal.diagnostics.columns import of_rows
from pkmcal.display import chance_text, displayed, printable
from pkmcal.estimation.fit_data import Dependence
from pkmcal.estimation.uncertainty import Uncertainty
from pkmcal.fitted.fit import Fit
from pkmcal.fitted.solution import Solution
from pkmcal.readings.predicted import Predicted
from pkmcal.statistics.score_test import Columns, Score, score_test
from pkmcal.statistics.shifts import TOLD_APART
from pkmcal.statistics.weighed import Weighed

_LARGE = 0.5  # of the squared residuals, from which they are little else


@dataclass(frozen=True)
class DisplacedTarget:
    """The target whose displacement would explain most of what a fit leaves.

    Attributes
    ----------
    name : str
        Which.
    shift, stderr : tuple of float
        By how much, mm along the platform's axes, as far as nothing else can take that up; and its
        standard deviation.
    chance : float
        How likely as much would be if all targets were where they are stated, times their number.
    share : float
        Of the squared residuals in mm that it would explain.
    also : tuple of str
        Targets of which the same could be said as well.
    """

    name: str
    shift: tuple[float, ...]
    stderr: tuple[float, ...]
    chance: float
    share: float
    also: tuple[str, ...]

    @property
    def found(self) -> bool:
        """True if the target is displaced."""
        return self.chance < CHANCE

    @property
    def large(self) -> bool:
        """True if the displacement is most of the residuals."""
        return self.found and self.share > _LARGE

    def __str__(self) -> str:
        value, unit = displayed(float(np.linalg.norm(self.shift)), "mm")
        or_as_well = f" (or as well {', '.join(self.also)})" if self.also else ""
        return (
            f"target {self.name}{or_as_well} seems to be at least {value:.2g} {unit} from where it"
            f" is stated ({chance_text(self.chance)}): look how it sits, or find where targets are,"
            " --target unknown (unknown='target')"
        )


def displaced_target(found: Solution) -> DisplacedTarget | None:
    """Test each known target of several.

    None where fewer are known, rows are mixtures, or residuals rounding errors.
    """
    fit, sure = found.fit, found.fit.uncertainty
    if sure.mixed or sure.rounded:
        return None
    targets, weighed = dict(_targets(fit)), found.weighed
    if len(targets) < 2:
        return None
    tested = {
        name: score_test(weighed.fit, weighed.columns(_columns(fit, rows)))
        for name, rows in targets.items()
    }
    known = {name: score for name, score in tested.items() if score is not None}
    if not known:
        return None
    name = max(known, key=lambda each: known[each].drop)
    best = known[name]
    return DisplacedTarget(
        name=name,
        shift=tuple(best.size.tolist()),
        stderr=tuple(best.deviation.tolist()),
        chance=min(1.0, len(known) * best.chance),
        share=_share(sure, weighed, best.explained),
        also=tuple(_alike(known, name, (weighed.fit.squares - best.drop) / weighed.fit.freedom)),
    )


def _share(sure: Uncertainty, weighed: Weighed, explained: FloatArray) -> float:
    """Share of the squared lengths that is explained."""
    lengths = sure.blocks.length
    before = sure.in_units(weighed.unweigh(weighed.fit.residual))[lengths]
    after = before - sure.in_units(weighed.unweigh(explained))[lengths]
    return 1.0 - float(after @ after) / float(before @ before)


def _alike(known: dict[str, Score], name: str, variance: float) -> Iterator[str]:
    """Others that explain as much but for chance."""
    best = known[name]
    for other, score in known.items():
        if other != name and best.drop - score.drop < TOLD_APART * variance:
            yield other


def _targets(fit: Fit) -> Iterator[tuple[str, list[BoolArray]]]:
    """Names of known targets, and their rows in each set."""
    sets = fit.equations.prediction.datasets
    places: list[FloatArray | None] = []
    for data in sets:
        given = [each.given for each in data.dependences() if _known_target(each)]
        shape = len(data.measured), 3
        places.append(np.broadcast_to(given[0], shape) if given else None)
    every = [place for place in places if place is not None]
    for each in np.unique(np.concatenate(every), axis=0) if every else ():
        rows = [
            np.zeros(len(data.measured), dtype=bool)
            if place is None
            else (place == each).all(axis=1)
            for data, place in zip(sets, places, strict=True)
        ]
        yield _name(fit, each, rows), rows


def _known_target(dependence: Dependence) -> bool:
    return dependence.role == dependence.argument == "target" and not dependence.estimated


def _name(fit: Fit, place: FloatArray, rows: list[BoolArray]) -> str:
    """The name that a file has for it, or its place."""
    for data, mine in zip(fit.equations.prediction.datasets, rows, strict=True):
        m = data.measured
        if mine.any() and m.target_names is not None and m.target_index is not None:
            return printable(m.target_names[m.target_index[int(mine.argmax())]])
    return f"({', '.join(f'{value:g}' for value in place)})"


def _columns(fit: Fit, mine: list[BoolArray]) -> Columns:
    """Differentiate equations by the place of the target of these rows of each set."""

    def change(i: int, rows: slice, seen: Predicted) -> FloatArray:
        if "target" not in seen.by:
            return np.zeros((*seen.values.shape, 3))
        return np.where(mine[i][rows, None, None], seen.by["target"], 0.0)

    return of_rows(fit, change)
