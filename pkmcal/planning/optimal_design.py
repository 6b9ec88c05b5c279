"""Optimal design by exchange: which rows of a large Jacobian to keep.

SciPy has no design by exchange. Everything is in coordinates in which all candidates have unit
information about every combination of parameters: that of a choice is between 0 and 1, unitless.

An exchange ends in a local optimum, and of nearly equal candidates rounding would decide in which.
So what differs by less than `TIED` is equal, of equals the first is taken, and the exchange
starts more than once and keeps the best.
"""

from __future__ import annotations

import copy
import itertools
from collections.abc import Iterator, Sequence
from typing import Literal

import numpy as np

from pkmcal.arrays import TIED, BoolArray, FloatArray, IntArray, first_largest, lots
from pkmcal.estimation.identifiability import decompose
from pkmcal.exceptions import ArgumentError
from pkmcal.statistics.linear_fit import ROUNDING

Criterion = Literal["prediction", "D", "A"]

CRITERIA: tuple[Criterion, ...] = ("prediction", "D", "A")

_SHORTLIST = 1000  # candidates that help most, which exchanges are first sought among
_RENEWED = 10  # members that grow on one shortlist
_TRIED = 12  # members that matter least, one of which must want to be exchanged
_TOGETHER = 512  # candidates that are looked at at once, as many as caches hold
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
        self._determinant = criterion == "D"
        self._blocks, self._all = _times(blocks, unit), np.arange(len(blocks))
        self._prior = (prior @ unit).T @ (prior @ unit)
        metric = unit.T @ unit  # of the scaled parameters
        self._ridge = metric / worst**2
        aimed = _times(aims, unit).reshape(-1, rank)
        self._errors = aimed.T @ aimed / len(aims)
        self._cost = metric if criterion == "A" else self._errors
        self._coarse = self._blocks.reshape(-1, rank).astype(np.float32)
        self._lengths = np.sqrt(np.einsum("nij,nij->n", self._blocks, self._blocks))

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
            order = random.permutation(len(self._blocks))
            each = [order[self._sort[order] == s][:count] for s, count in enumerate(counts)]
            drawn.append(self.predicted(np.concatenate(each)))
        return float(np.median(drawn))

    def grown(self, *counts: int) -> IntArray:
        """The best candidates that exchanges find, in order: so many of each sort."""
        total = sum(counts)
        grown = [list(itertools.islice(self._growing(worth, counts), total)) for worth in _STARTS]
        ridge = self._lacking(grown[0])
        found = [self._settled(chosen, ridge) for chosen in grown]
        costs = np.array([self._log_cost(np.sort(chosen), ridge) for chosen in found])
        return self._exchanged(found[first_largest(-costs, TIED)], ridge)

    def reaching(self, error: float) -> IntArray:
        """Choose as few candidates as predict an error (mm) that all together reach."""
        error *= 1.0 + _ROUNDED
        nothing = np.array([], dtype=np.intp)
        if self.predicted(nothing) <= error:
            return nothing
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
        gains = self._gains([], self._lacking([]), self._all)
        gains[~allowed] = -np.inf
        return first_largest(gains, TIED * gains.max())

    def exchanged_for(self, chosen: IntArray, member: int) -> FloatArray:
        """Return the criterion with each candidate (N,) in place of a member.

        Logarithm of a standard deviation, of the prediction or of the scaled parameters; infinite
        for the other members and for candidates of another sort.
        """
        others = chosen[chosen != member]
        ridge = self._lacking(chosen.tolist())
        gains = self._gains(others.tolist(), ridge, self._all)
        gains[self._sort != self._sort[member]] = -np.inf
        cost = self._log_cost(others, ridge)
        if self._determinant:
            deviations: FloatArray = (cost - gains) / (2 * len(ridge))
            return deviations
        return np.asarray(np.log(np.maximum(np.exp(cost) - gains, np.finfo(float).tiny)) / 2.0)

    def _worth(self, candidates: float) -> FloatArray:
        """Information of so many candidates, alike in all directions."""
        worth: FloatArray = candidates / len(self._blocks) * np.eye(self._blocks.shape[2])
        return worth

    def _lacking(self, chosen: list[int]) -> FloatArray:
        """Return a stand-in for the information that a choice lacks.

        Choices too small to identify everything differ in what they identify only if the rest is
        not unknown beyond all measure.
        """
        information = self._information(np.array(chosen, dtype=np.intp))
        if np.linalg.eigvalsh(information)[0] < _NOTHING:
            return np.asarray(self._ridge + self._worth(min(_STARTS)))
        return np.asarray(self._ridge)

    def _growing(self, worth: float, counts: Sequence[int] = ()) -> Iterator[int]:
        """Candidates one by one, always the one that helps most those that entered before.

        At most `counts` of each sort.
        """
        ridge, chosen, among = self._ridge + self._worth(worth), list[int](), self._all
        most = sum(counts) if counts else len(self._blocks)
        while len(chosen) < most:
            among = self._shortlist(chosen, ridge) if len(chosen) % _RENEWED == 0 else among
            gains = self._gains(chosen, ridge, among)
            if counts:
                entered = np.bincount(self._sort[chosen], minlength=len(counts))
                gains[(entered >= counts)[self._sort[among]]] = -np.inf
            chosen.append(int(among[first_largest(gains, TIED * gains.max())]))
            yield chosen[-1]

    def _reduced(self, chosen: list[int], error: float) -> IntArray:
        """Fewer that still predict an error (mm)."""
        ridge = self._lacking(chosen)
        best = self._exchanged(chosen, ridge)
        while len(best) > 1:
            least = self._least(best.tolist(), ridge)[0]
            fewer = self._exchanged([j for j in best.tolist() if j != least], ridge)
            if self.predicted(fewer) > error:
                break
            best = fewer
        return best

    def _exchanged(self, chosen: list[int], ridge: FloatArray) -> IntArray:
        """Members that matter least make room for the best of all, until none has to.

        Exchanges with all candidates take time with their number: those on a shortlist come first.
        """
        exchanged = True
        while exchanged:
            chosen, exchanged = self._exchange(self._settled(chosen, ridge), ridge, self._all)
        return np.sort(np.array(chosen, dtype=np.intp))

    def _settled(self, chosen: list[int], ridge: FloatArray) -> list[int]:
        """Settle the gains of candidates on a shortlist."""
        short, exchanged = self._shortlist(chosen, ridge), True
        while exchanged:
            chosen, exchanged = self._exchange(chosen, ridge, short)
        return chosen

    def _shortlist(self, chosen: list[int], ridge: FloatArray) -> IntArray:
        """In order the members, and of each sort the candidates that add most to them."""
        sizes = np.bincount(self._sort)
        if len(self._all) <= _SHORTLIST * len(sizes):
            return self._all
        short = np.zeros(len(self._all), dtype=bool)
        for sort, size in enumerate(sizes):
            gains = self._largest(chosen, ridge, self._sort == sort, min(_SHORTLIST, size))
            least = np.partition(gains, -min(_SHORTLIST, size))[-min(_SHORTLIST, size)]
            short |= gains >= least - TIED * abs(least)  # all that are equal
        short[chosen] = True
        return np.flatnonzero(short)

    def _exchange(
        self, chosen: list[int], ridge: FloatArray, among: IntArray
    ) -> tuple[list[int], bool]:
        """Exchange one member for the best of these candidates, if that is an improvement."""
        for i in self._least(chosen, ridge):
            others = [j for j in chosen if j != i]
            if len(among) == len(self._all):
                gains = self._largest(others, ridge, self._sort == self._sort[i], 1)
            else:
                gains = self._gains(others, ridge, among)
                gains[self._sort[among] != self._sort[i]] = -np.inf
            own = self._gains(others, ridge, np.array([i]))[0]
            best = first_largest(gains, TIED * gains.max())
            if gains[best] > (1.0 + TIED) * own:
                return [*others, int(among[best])], True
        return chosen, False

    def _least(self, chosen: list[int], ridge: FloatArray) -> list[int]:
        """The `_TRIED` members that matter least, in order; of equals the first."""
        at = np.sort(np.array(chosen, dtype=np.intp))
        losses = self._changes(self._blocks[at], at, -1.0, ridge)
        order: list[int] = []
        while len(order) < min(_TRIED, len(at)):
            least = first_largest(-losses, TIED * abs(losses.min()))
            order.append(int(at[least]))
            losses[least] = np.inf
        return order

    def _information(self, chosen: IntArray) -> FloatArray:
        rows = self._blocks[chosen].reshape(-1, self._blocks.shape[2])
        information: FloatArray = rows.T @ rows + self._prior
        return information

    def _gains(self, chosen: list[int], ridge: FloatArray, among: IntArray) -> FloatArray:
        """Return the gain of each of these candidates beside the chosen; 0 for the chosen."""
        at = np.sort(np.array(chosen, dtype=np.intp))
        every = len(among) == len(self._blocks)
        gains = self._changes(self._blocks if every else self._blocks[among], at, 1.0, ridge)
        gains[np.isin(among, at)] = -np.inf
        return gains

    def _largest(
        self, chosen: list[int], ridge: FloatArray, allowed: BoolArray, count: int
    ) -> FloatArray:
        """`_gains` among all, as far as they may be of the `count` largest; -inf of the others.

        A gain takes several times as long as a bound of it, for which single precision will do.
        """
        first = max(4 * count, _SHORTLIST)
        if len(self._all) <= first:
            gains = self._gains(chosen, ridge, self._all)
            gains[~allowed] = -np.inf
            return gains
        gains = np.full(len(self._all), -np.inf)
        bounds = self._bounds(np.sort(np.array(chosen, dtype=np.intp)), ridge)
        bounds[~allowed] = -np.inf
        bounds[chosen] = -np.inf
        some = np.sort(np.argpartition(-bounds, first - 1)[:first])
        gains[some] = self._gains(chosen, ridge, some)
        gains[~allowed] = -np.inf
        least = np.partition(gains, -count)[-count]
        rest = np.flatnonzero(
            (bounds >= least - 2.0 * TIED * abs(least)) & np.isinf(gains) & allowed
        )
        if len(rest):
            gains[rest] = self._gains(chosen, ridge, rest)
        return gains

    def _bounds(self, chosen: IntArray, ridge: FloatArray) -> FloatArray:
        """Bound the gain of every candidate (N,).

        With G = B C Bᵀ of a block, ln det(1 + G) ≤ k ln(1 + tr G / k), and what it takes off the
        cost, tr((1 + G)⁻¹ S), is at most tr S. Single precision is allowed for.
        """
        covariance = np.asarray(np.linalg.inv(self._information(chosen) + ridge), np.float64)
        square = covariance if self._determinant else covariance @ self._cost @ covariance
        sizes, axes = np.linalg.eigh(0.5 * (square + square.T))
        root = (axes * np.sqrt(np.maximum(sizes, 0.0))).astype(np.float32)
        k, found = self._blocks.shape[1], np.empty(len(self._all))
        for some in lots(len(found), _TOGETHER):
            through = self._coarse[some.start * k : some.stop * k] @ root
            found[some] = np.einsum("ij,ij->i", through, through).reshape(-1, k).sum(1)
        rounding = len(root) * np.finfo(np.float32).eps * float(np.linalg.norm(root))
        traces: FloatArray = (np.sqrt(found) + 2.0 * rounding * self._lengths) ** 2
        return k * np.log1p(traces / k) if self._determinant else traces

    def _log_cost(self, chosen: IntArray, ridge: FloatArray) -> float:
        """Logarithm of what the criterion makes least."""
        information = self._information(chosen) + ridge
        if self._determinant:
            return -float(np.linalg.slogdet(information)[1])
        cost = float(np.trace(np.linalg.solve(information, self._cost)))
        return float(np.log(max(cost, np.finfo(float).tiny)))

    def _changes(
        self, blocks: FloatArray, chosen: IntArray, sign: float, ridge: FloatArray
    ) -> FloatArray:
        """Return the change of the criterion by adding a block to the chosen, or removing it."""
        covariance = np.asarray(np.linalg.inv(self._information(chosen) + ridge), np.float64)
        found = [
            self._change(blocks[some], covariance, sign) for some in lots(len(blocks), _TOGETHER)
        ]
        return np.concatenate(found)

    def _change(self, blocks: FloatArray, covariance: FloatArray, sign: float) -> FloatArray:
        through = _times(blocks, covariance)
        own = np.eye(blocks.shape[1]) + sign * (through @ blocks.transpose(0, 2, 1))
        if self._determinant:
            changes: FloatArray = sign * np.linalg.slogdet(own)[1]
            return changes
        spread = _times(through, self._cost) @ through.transpose(0, 2, 1)
        return np.asarray(np.trace(np.linalg.solve(own, spread), axis1=1, axis2=2))


def _times(blocks: FloatArray, matrix: FloatArray) -> FloatArray:
    """Blocks (..., n) times a matrix (n, m), in one product, which takes less time than many."""
    product: FloatArray = blocks.reshape(-1, len(matrix)) @ matrix
    return product.reshape(*blocks.shape[:-1], -1)
