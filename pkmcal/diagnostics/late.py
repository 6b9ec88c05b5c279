"""Readings before the machine had arrived, or after it left, and logs that are late: a test.

Such a reading is off where the machine stops by a share of the way from the pose before, or to the
next. One number says how much; a score test of it, through the machine's own derivatives, sees what
is far below a row: trials of whole rows that are late do not.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from pkmcal.diagnostics.cause_columns import LAG, of_lag, possible
from pkmcal.diagnostics.check import CHANCE, RARE
from pkmcal.diagnostics.visits import visits_of
from pkmcal.display import chance_text
from pkmcal.fitted.solution import Solution
from pkmcal.statistics.causes import taken_along
from pkmcal.statistics.score_test import Beside, Score, beside

_NAMED = 2  # causes of another kind
_MOST = 2.0  # ways: rows that are late by more are tried as whole rows


@dataclass(frozen=True)
class Late:
    """The lag of readings: before the machine arrived, or after it left.

    Attributes
    ----------
    share : float
        Of the way from the pose before, or to the next; negative where the actuators were read
        there and not the instrument.
    stderr : float
        Its standard deviation.
    chance : float
        How likely a share as large, of either way, would be if they were not.
    leaving : bool
        Whether it is of the way to the next pose.
    instead : tuple of str
        Causes of another kind beside which no lag is seen.
    rather : bool
        Whether one of them explains what no lag does.
    """

    share: float
    stderr: float
    chance: float
    leaving: bool
    instead: tuple[str, ...] = ()
    rather: bool = False

    @property
    def found(self) -> bool:
        """True if residuals follow the way to or from a pose."""
        return self.chance < RARE

    def __str__(self) -> str:
        odds = chance_text(self.chance)
        way = "to the next pose" if self.leaving else "from the pose before"
        if not self.instead:
            return self._lag(way, f" ({odds})")
        follow = f"residuals follow the way {way} ({odds})"
        others = " or ".join(self.instead)
        if self.rather:
            return f"{follow}, and no lag explains them all: they look like {others}"
        return f"{follow}: they look like {others}, or {self._lag(way)}"

    def _lag(self, way: str, odds: str = "") -> str:
        """Readings that are late by this share, and what helps."""
        late, far = self.share > 0.0, f"{100 * abs(self.share):.2g} % of the way {way}"
        if self.leaving:
            return (
                f"{'readings' if late else 'actuators'} are as if"
                f" {'taken' if late else 'logged'} after the machine had gone {far}{odds}: log both"
                " at one moment, when the machine stands; or the rows stand in the reversed order"
                " of measuring, and readings are late"
            )
        if late:
            return (
                f"readings are as if taken {far}, before the machine arrived{odds}: let it settle"
                " for longer before each reading, and see that actuators and instrument are logged"
                " at one moment"
            )
        return (
            f"actuators are as if logged {far}, before the machine arrived where the instrument"
            f" read it{odds}: log both at one moment, when the machine stands"
        )


def late(found: Solution) -> Late | None:
    """Test for late readings; None where chance explains as much, or residuals are rounding."""
    sure = found.fit.uncertainty
    if sure.rounded or not sure.equations.whitening.any_read:
        return None
    visits, weighed = visits_of(found), found.weighed
    tested = {
        leaving: beside(weighed.fit, weighed.columns(of_lag(found.fit, visits.actuators, place)))
        for leaving, place in ((False, visits.before), (True, visits.after))
    }
    ways = {leaving: each for leaving, each in tested.items() if each is not None}
    # shared errors make as much more likely: of what is likely without them nothing else is asked
    scores = {
        leaving: each.score() for leaving, each in ways.items() if len(ways) * each.chance < RARE
    }
    known = {
        leaving: score
        for leaving, score in scores.items()
        if score is not None and abs(score.size[0]) <= _MOST
    }
    if not known:
        return None
    leaving = min(known, key=lambda each: (known[each].chance, -known[each].drop))
    score = known[leaving]
    chance = min(1.0, len(ways) * score.chance)
    seen = Late(float(score.size[0]), float(score.deviation[0]), chance, leaving)
    return _beside_other_causes(found, seen, ways[leaving], score) if seen.found else seen


def _beside_other_causes(found: Solution, seen: Late, lag: Beside, score: Score) -> Late:
    """Say which causes of another kind show as that lag does.

    Play follows the signs of the ways of the actuators; where poses were drawn at random a drive
    whose error follows its reading seems to follow the way from the last one, too. Beside the true
    cause there is no lag, and beside a lag the cause still explains something.
    """
    weighed, instead = found.weighed, list[tuple[float, str, bool]]()
    for cause, columns in possible(found):
        own = None if cause.name == LAG else beside(weighed.fit, weighed.columns(columns))
        known = None if own is None or own.chance >= CHANCE else own.score()
        if own is None or known is None or known.chance >= CHANCE:
            continue
        if _chance_after(own, known, lag) < RARE:
            continue
        rather = _chance_after(lag, score, own) < CHANCE
        instead.append((known.chance, f"{cause.name} ({cause.cure})", rather))
    instead.sort()
    better = [each for each in instead if each[2]]
    return replace(
        seen,
        instead=tuple(name for _, name, _ in (better or instead)[:_NAMED]),
        rather=bool(better),
    )


def _chance_after(taken: Beside, score: Score, other: Beside) -> float:
    """Chance of the other columns beside what these explain; 1 where nothing is left of them."""
    after = beside(taken_along(taken), other.columns)
    found = None if after is None else after.score()
    return 1.0 if found is None else found.chance
