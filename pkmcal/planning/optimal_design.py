"""Optimal design by exchange: which rows of a large Jacobian to keep.

SciPy has no design by exchange. Everything is in coordinates in which all candidates have unit
information about every combination of parameters: that of a choice is between 0 and 1, unitless.

An exchange ends in a local optimum, and of nearly equal candidates rounding would decide in which.
So what differs by less than `TIED` is equal, of equals the first is taken, and the exchange
starts more than once and keeps the best. Of many candidates it starts with what it found among a
tenth of them.
"""

from __future__ import annotations

import copy
import itertools
from collections.abc import Iterator, Sequence
from typing import Literal

import numpy as np

from pkmcal.arrays import TIED, BoolArray, FloatArray, IntArray, first_largest
from pkmcal.estimation.identifiability import decompose
from pkmcal.exceptions import ArgumentError
from pkmcal.planning.additions import gains, losses, times
from pkmcal.planning.gain_bounds import Bounds, Screen
from pkmcal.statistics.linear_fit import ROUNDING

Criterion = Literal["prediction", "D", "A"]

CRITERIA: tuple[Criterion, ...] = ("prediction", "D", "A")

_SHORTLIST = 1000  # candidates that help most, which exchanges are first sought among
_MANY = 50_000  # candidates of a sort from which on a tenth of them comes first
_RENEWED = 10  # members that grow on one shortlist
_GOLDEN = (5.0**0.5 - 1.0) / 2.0  # whose multiples, modulo 1, have no period that rows may have
_NEXT = 100  # candidates, best in place of a member that was tried, that enter the shortlist
_TRIED = 12  # members that matter least, one of which must want to be exchanged
_STARTS = (1e-2, 1.0, 1e-4)  # candidates' worth of information that growing begins with
_ROUNDED = 1e-9  # share by which a predicted error may exceed the one that was asked for
_OPEN = 1e-6  # of a combination that is left open: a share of a parameter that is none
_NOTHING = 1e-12  # share of the information of all candidates that is none


class Design:
    """Candidates with their information, and the points to predict with it.

    Parameters
    ----------
    blocks : ndarray (N, k, n)
        Derivative of what is measured at each candidate by the parameters, both scaled by their
        standard deviations.
    prior : ndarray (p, n)
        Rows that are there whatever is chosen.
    aims : ndarray (T, 3, n)
        Derivative of the points to predict, mm.
    criterion : str
        One of `CRITERIA`.
    worst : float
        Scaled deviation from which a combination counts as unidentifiable while poses are chosen.
    sort : ndarray of int (N,), optional
        Of which sort each candidate is, from 0; a choice has so many of each.

    Attributes
    ----------
    unidentifiable : ndarray (n, d)
        Orthonormal combinations of parameters that not even all candidates identify.
    """

    def __init__(
        self,
        blocks: FloatArray,
        prior: FloatArray,
        aims: FloatArray,
        criterion: Criterion,
        worst: float,
        sort: IntArray | None = None,
    ) -> None:
        self._sort = np.zeros(len(blocks), dtype=np.intp) if sort is None else sort
        n = blocks.shape[2]
        singular, basis = decompose(np.vstack([blocks.reshape(-1, n), prior]))
        rank = int(np.count_nonzero(singular > ROUNDING * singular[0]))
        if not rank:
            raise ArgumentError(
                "candidates: what would be measured there depends on no parameter that is free"
            )
        unit = self._unit = basis[:, :rank] / singular[:rank]
        self.unidentifiable = basis[:, rank:]
        self._one = np.eye(rank) / len(blocks)  # a candidate's worth, alike in all directions
        self._offer(times(blocks, unit))
        self._prior = (prior @ unit).T @ (prior @ unit)
        metric = unit.T @ unit  # of the scaled parameters
        self._ridge = metric / worst**2
        aimed = times(aims, unit).reshape(-1, rank)
        self._errors = aimed.T @ aimed / len(aims)
        self._cost = None if criterion == "D" else metric if criterion == "A" else self._errors

    def _offer(self, blocks: FloatArray) -> None:
        self._blocks, self._all = blocks, np.arange(len(blocks))
        self._few = len(blocks) <= _SHORTLIST * int(self._sort.max() + 1)
        self._screen = Screen(blocks[:0] if self._few else blocks)

    def predicted(self, chosen: IntArray) -> float:
        """Root mean square error (mm) at the aims if these candidates are measured."""
        information, directions = np.linalg.eigh(self._information(chosen))
        errors = np.einsum("ij,ik,kj->j", directions, self._errors, directions)
        known = information > _NOTHING
        if (errors[~known] > _NOTHING * errors.sum()).any():
            return float("inf")
        return float(np.sqrt((errors[known] / information[known]).sum()))

    def deviations(self, chosen: IntArray) -> FloatArray:
        """Standard deviations (n,) of the scaled parameters; inf of what these leave open."""
        information, directions = np.linalg.eigh(self._information(chosen))
        known = information > _NOTHING
        ways = self._unit @ directions
        found: FloatArray = np.sqrt((ways[:, known] ** 2 / information[known]).sum(axis=1))
        left = np.hstack([ways[:, ~known], self.unidentifiable])
        sizes = np.linalg.norm(self._unit, axis=1)
        found[np.abs(left).max(axis=1, initial=0.0) > _OPEN * np.maximum(sizes, _OPEN)] = np.inf
        return found

    def at_random(self, chosen: IntArray, draws: int) -> float:
        """Median of `predicted` over choices at random, of as many of each sort."""
        random = np.random.default_rng(0)
        counts = np.bincount(self._sort[chosen], minlength=1)
        drawn = []
        for _ in range(draws):
            order = random.permutation(len(self._all))
            each = [order[self._sort[order] == s][:count] for s, count in enumerate(counts)]
            drawn.append(self.predicted(np.concatenate(each)))
        return float(np.median(drawn))

    def grown(self, *counts: int) -> IntArray:
        """The best candidates that exchanges find, in order: so many of each sort."""
        if len(self._all) > _MANY * int(self._sort.max() + 1):
            some = self._tenth()
            first = some[self._among(some).grown(*counts)]
            return self._exchanged(first.tolist(), self._lacking(first.tolist()))
        total = sum(counts)
        grown = [list(itertools.islice(self._growing(worth, counts), total)) for worth in _STARTS]
        ridge, found = self._lacking(grown[0]), []
        for each in grown:
            found.append(self._settled(each, ridge, self._shortlist(each, ridge)))
        costs = np.array([self._log_cost(np.sort(chosen), ridge) for chosen in found])
        return self._exchanged(found[first_largest(-costs, TIED)], ridge)

    def reaching(self, error: float) -> IntArray:
        """Choose as few candidates as predict an error (mm) that all together reach."""
        error *= 1.0 + _ROUNDED
        nothing = np.array([], dtype=np.intp)
        if self.predicted(nothing) <= error:
            return nothing
        if not self._few:
            some = self._tenth()
            part = self._among(some)
            if part.predicted(part._all) <= error:
                return self._reduced(some[part.reaching(error)].tolist(), error)
        found = []
        for worth in _STARTS:
            growing, chosen = self._growing(worth), list[int]()
            while self.predicted(np.array(chosen, dtype=np.intp)) > error:
                chosen.append(next(growing))
            found.append(self._reduced(chosen, error))
        return min(found, key=len)

    def beside(self, candidate: int) -> Design:
        """The design where what this candidate brings is there, whatever is chosen."""
        made = copy.copy(self)
        block = self._blocks[candidate]
        made._prior = self._prior + block.T @ block
        return made

    def fewest(self) -> int:
        """Least number of further candidates that identify all numbers."""
        nothing = np.array([], dtype=np.intp)
        information = np.linalg.eigvalsh(self._information(nothing))
        lacking = int((information < _NOTHING).sum())
        return -(-lacking // int(self._blocks.shape[1]))

    def best(self, allowed: BoolArray) -> int:
        """The candidate that helps most, of those that are allowed (N,)."""
        found = self._gains([], self._lacking([]), self._blocks)
        found[~allowed] = -np.inf
        return first_largest(found, TIED * found.max())

    def exchanged_for(self, chosen: IntArray, member: int) -> FloatArray:
        """Return the criterion with each candidate (N,) in place of a member.

        Logarithm of a standard deviation, of the prediction or of the scaled parameters; infinite
        for the other members and for candidates of another sort.
        """
        others = chosen[chosen != member]
        ridge = self._lacking(chosen.tolist())
        gained = self._gains(others.tolist(), ridge, self._blocks)
        gained[others] = -np.inf
        gained[self._sort != self._sort[member]] = -np.inf
        cost = self._log_cost(others, ridge)
        if self._cost is None:
            deviations: FloatArray = (cost - gained) / (2 * len(ridge))
            return deviations
        return np.asarray(np.log(np.maximum(np.exp(cost) - gained, np.finfo(float).tiny)) / 2.0)

    def _lacking(self, chosen: list[int]) -> FloatArray:
        """Return a stand-in for the information that a choice lacks.

        Choices too small to identify everything differ in what they identify only if the rest is
        not unknown beyond all measure.
        """
        information = self._information(np.array(chosen, dtype=np.intp))
        if np.linalg.eigvalsh(information)[0] < _NOTHING:
            return np.asarray(self._ridge + min(_STARTS) * self._one)
        return np.asarray(self._ridge)

    def _tenth(self) -> IntArray:
        """In order some of many candidates, spread evenly over those of each sort."""
        some = []
        for sort in range(int(self._sort.max()) + 1):
            mine = np.flatnonzero(self._sort == sort)
            count = max(len(mine) // 10, min(_SHORTLIST, len(mine)))
            some.append(mine[np.argsort(np.arange(len(mine)) * _GOLDEN % 1.0)[:count]])
        return np.sort(np.concatenate(some))

    def _among(self, some: IntArray) -> Design:
        """The same design, with some of the candidates alone."""
        made = copy.copy(self)
        made._sort = self._sort[some]
        made._offer(self._blocks[some])
        return made

    def _growing(self, worth: float, counts: Sequence[int] = ()) -> Iterator[int]:
        """Candidates one by one, always the one that helps most those that entered before.

        At most `counts` of each sort.
        """
        ridge, chosen = self._ridge + worth * self._one, list[int]()
        among, offered = self._all, self._blocks
        most = sum(counts) if counts else len(self._all)
        while len(chosen) < most:
            if len(chosen) % _RENEWED == 0 and not self._few:
                among = self._shortlist(chosen, ridge)
                offered = self._blocks[among]
            gained = self._gains(chosen, ridge, offered)
            gained[np.isin(among, chosen)] = -np.inf
            if counts:
                entered = np.bincount(self._sort[chosen], minlength=len(counts))
                gained[(entered >= counts)[self._sort[among]]] = -np.inf
            chosen.append(int(among[first_largest(gained, TIED * gained.max())]))
            yield chosen[-1]

    def _reduced(self, chosen: list[int], error: float) -> IntArray:
        """Fewer that still predict an error (mm)."""
        ridge = self._lacking(chosen)
        best = self._exchanged(chosen, ridge)
        while len(best) > 1:
            least = self._least(best, ridge)[0]
            fewer = self._exchanged(best[best != least].tolist(), ridge)
            if self.predicted(fewer) > error:
                break
            best = fewer
        return best

    def _exchanged(self, chosen: list[int], ridge: FloatArray) -> IntArray:
        """Members that matter least make room for the best of all, until none has to.

        Exchanges with all candidates take time with their number: those on a shortlist come first,
        which what is best in place of members enters.
        """
        short = self._shortlist(chosen, ridge)
        while True:
            settled = self._settled(chosen, ridge, short)
            if not self._few:
                chosen, entering = self._exchange_with_all(settled, ridge)
            if self._few or chosen == settled:
                return np.sort(np.array(settled, dtype=np.intp))
            short = np.union1d(short, [*chosen, *entering])

    def _settled(self, chosen: list[int], ridge: FloatArray, short: IntArray) -> list[int]:
        """Exchange with candidates on a shortlist until none has to."""
        offered, exchanged = self._blocks[short], True
        while exchanged:
            exchanged = False
            for i in self._least(np.array(chosen, dtype=np.intp), ridge):
                others = [j for j in chosen if j != i]
                gained = self._gains(others, ridge, offered)
                best = self._better(i, others, short, gained)
                if self._lower([*others, best], [*others, i], ridge):
                    chosen, exchanged = [*others, best], True
                    break
        return chosen

    def _exchange_with_all(
        self, chosen: list[int], ridge: FloatArray
    ) -> tuple[list[int], IntArray]:
        """Exchange one member for the best of all candidates, if that is an improvement.

        Returned with the candidates that are best in place of each member that was tried.
        """
        bounds, entering = self._bounds(chosen, ridge), []
        for i in self._least(np.array(chosen, dtype=np.intp), ridge):
            others, member = [j for j in chosen if j != i], self._blocks[i]
            information = self._information(np.array(others, dtype=np.intp)) + ridge
            least = float(gains(member[None], information, self._cost)[0])
            most = self._screen.most_without(bounds.most, member, information, self._cost)
            most[i] = np.inf
            some = np.flatnonzero(most >= least)
            gained = gains(self._blocks[some], information, self._cost)
            entering.append(some[_largest(gained, _NEXT)])
            best = self._better(i, others, some, gained)
            if self._lower([*others, best], [*others, i], ridge):
                return [*others, best], np.concatenate(entering)
        return chosen, np.concatenate(entering)

    def _better(self, member: int, others: list[int], among: IntArray, gained: FloatArray) -> int:
        """The best of some candidates beside the others; the member itself if it is one of them."""
        least = (1.0 + TIED) * float(gained[np.searchsorted(among, member)])
        gained[self._sort[among] != self._sort[member]] = -np.inf
        gained[np.isin(among, others)] = -np.inf
        most = float(gained.max())
        best = first_largest(gained, TIED * most)
        return int(among[best]) if most > least and gained[best] > least else member

    def _lower(self, exchanged: list[int], chosen: list[int], ridge: FloatArray) -> bool:
        """Whether an exchange makes the criterion less.

        By the criterion itself: gains beside a choice that leaves much open are inaccurate, and of
        exchanges that each gain by them there may be circles.
        """
        if exchanged == chosen:
            return False
        after, before = (
            self._log_cost(np.array(each, dtype=np.intp), ridge) for each in (exchanged, chosen)
        )
        return after < before - TIED

    def _shortlist(self, chosen: list[int], ridge: FloatArray) -> IntArray:
        """In order the members, and of each sort the candidates that add most; all of few."""
        if self._few:
            return self._all
        bounds, sizes = self._bounds(chosen, ridge), np.bincount(self._sort)
        short = np.zeros(len(self._all), dtype=bool)
        for sort, size in enumerate(sizes):
            allowed, count = self._sort == sort, min(_SHORTLIST, size)
            allowed[chosen] = False
            at_least = np.where(allowed, bounds.least, -np.inf)
            floor = np.partition(at_least, -count)[-count] * (1.0 - 2.0 * TIED)
            some = np.flatnonzero(allowed & (bounds.most >= floor))
            gained = self._gains(chosen, ridge, self._blocks[some])
            some = some[_largest(gained, count)]
            short[some] = True
        short[chosen] = True
        return np.flatnonzero(short)

    def _bounds(self, chosen: list[int], ridge: FloatArray) -> Bounds:
        """Between what each candidate may add to the chosen."""
        information = self._information(np.array(chosen, dtype=np.intp)) + ridge
        return self._screen.bounds(information, self._cost)

    def _least(self, chosen: IntArray, ridge: FloatArray) -> list[int]:
        """The `_TRIED` members without which the least is lost, in order; of equals the first."""
        at = np.sort(chosen)
        members = self._blocks[at]
        left, order = losses(members, self._information(at) + ridge, self._cost), list[int]()
        while len(order) < min(_TRIED, len(at)):
            least = first_largest(-left, TIED * abs(left.min()))
            order.append(int(at[least]))
            left[least] = np.inf
        return order

    def _gains(self, chosen: list[int], ridge: FloatArray, offered: FloatArray) -> FloatArray:
        """Return the gain of each of these candidates beside the chosen."""
        information = self._information(np.array(chosen, dtype=np.intp)) + ridge
        return gains(offered, information, self._cost)

    def _information(self, chosen: IntArray) -> FloatArray:
        rows = self._blocks[np.sort(chosen)].reshape(-1, self._blocks.shape[2])
        information: FloatArray = rows.T @ rows + self._prior
        return information

    def _log_cost(self, chosen: IntArray, ridge: FloatArray) -> float:
        """Logarithm of what the criterion makes least."""
        information = self._information(chosen) + ridge
        if self._cost is None:
            return -float(np.linalg.slogdet(information)[1])
        cost = float(np.trace(np.linalg.solve(information, self._cost)))
        return float(np.log(max(cost, np.finfo(float).tiny)))


def _largest(values: FloatArray, count: int) -> IntArray:
    """Where the largest of some values are, so many, and all that are equal to the last."""
    if len(values) <= count:
        return np.arange(len(values))
    least = np.partition(values, -count)[-count]
    return np.flatnonzero(values >= least - TIED * abs(least))
