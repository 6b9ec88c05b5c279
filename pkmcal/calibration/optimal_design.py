"""Optimal design by exchange: which rows of a large Jacobian to keep.

SciPy has no design by exchange. Everything is in coordinates in which all candidates have unit
information about every combination of parameters: that of a choice is between 0 and 1, unitless.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.calibration.identifiability import ROUNDING, decompose

Criterion = Literal["prediction", "D", "A"]

CRITERIA: tuple[Criterion, ...] = ("prediction", "D", "A")

_TRIED = 12  # members that matter least, one of which must want to be exchanged
_BETTER = 1e-9  # share by which an exchange must gain
_NOTHING = 1e-12  # share of the information of all candidates that is none


class Design:
    """Candidates, what each would tell, and what for.

    Parameters
    ----------
    blocks : ndarray (N, k, n)
        Derivative of what is measured at each candidate by the parameters, both scaled by their
        standard deviations.
    prior : ndarray (p, n)
        Rows that are there whatever is chosen.
    aims : ndarray (T, 3, n)
        Derivative of the points that are to be known, mm.
    criterion : str
        One of `CRITERIA`.
    worst : float
        Scaled deviation from which a combination counts as unidentifiable while poses are chosen.

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
    ) -> None:
        n = blocks.shape[2]
        singular, basis = decompose(np.vstack([blocks.reshape(-1, n), prior]))
        rank = int(np.count_nonzero(singular > ROUNDING * singular[0]))
        unit = basis[:, :rank] / singular[:rank]
        self.unidentifiable = basis[:, rank:]
        self._determinant = criterion == "D"
        self._blocks = blocks @ unit
        self._prior = (prior @ unit).T @ (prior @ unit)
        metric = unit.T @ unit  # of the scaled parameters
        self._ridge = metric / worst**2
        aimed = (aims @ unit).reshape(-1, rank)
        self._errors = aimed.T @ aimed / len(aims)
        self._cost = metric if criterion == "A" else self._errors

    def predicted(self, chosen: IntArray) -> float:
        """Root mean square error (mm) at the aims if these candidates are measured."""
        information, directions = np.linalg.eigh(self._information(chosen))
        errors = np.einsum("ij,ik,kj->j", directions, self._errors, directions)
        known = information > _NOTHING
        if (errors[~known] > _NOTHING * errors.sum()).any():
            return float("inf")
        return float(np.sqrt((errors[known] / information[known]).sum()))

    def at_random(self, count: int, draws: int) -> float:
        """Median of `predicted` over choices of `count` candidates at random."""
        random = np.random.default_rng(0)
        every = len(self._blocks)
        return float(
            np.median([self.predicted(random.permutation(every)[:count]) for _ in range(draws)])
        )

    def grown(self, count: int) -> IntArray:
        """The best `count` candidates that exchanges find, in order."""
        chosen: list[int] = []
        while len(chosen) < count:
            chosen.append(int(np.argmax(self._gains(chosen))))
        return self._exchanged(chosen)

    def reaching(self, error: float) -> IntArray:
        """As few candidates as predict an error (mm) that all together do."""
        chosen: list[int] = []
        while self.predicted(np.array(chosen, dtype=np.intp)) > error:
            chosen.append(int(np.argmax(self._gains(chosen))))
        best = self._exchanged(chosen)
        while len(best) > 1:
            fewer = self._exchanged(np.delete(best, np.argmin(self._losses(best))).tolist())
            if self.predicted(fewer) > error:
                break
            best = fewer
        return best

    def _exchanged(self, chosen: list[int]) -> IntArray:
        """Members that matter least make room for the best of all, until none has to."""
        tried = 0
        while tried < min(_TRIED, len(chosen)):
            i = chosen[int(np.argsort(self._losses(chosen), kind="stable")[tried])]
            others = [j for j in chosen if j != i]
            gains = self._gains(others)
            best = int(np.argmax(gains))
            if gains[best] > (1.0 + _BETTER) * gains[i]:
                chosen, tried = [*others, best], 0
            else:
                tried += 1
        return np.sort(np.array(chosen, dtype=np.intp))

    def _information(self, chosen: IntArray) -> FloatArray:
        rows = self._blocks[chosen].reshape(-1, self._blocks.shape[2])
        information: FloatArray = rows.T @ rows + self._prior
        return information

    def _gains(self, chosen: list[int]) -> FloatArray:
        """What each candidate (N,) would add to these; nothing for themselves."""
        at = np.array(chosen, dtype=np.intp)
        gains = self._changes(self._blocks, at, 1.0)
        gains[at] = -np.inf
        return gains

    def _losses(self, chosen: list[int] | IntArray) -> FloatArray:
        """What each of these would take away."""
        at = np.array(chosen, dtype=np.intp)
        return self._changes(self._blocks[at], at, -1.0)

    def _changes(self, blocks: FloatArray, chosen: IntArray, sign: float) -> FloatArray:
        """By how much the criterion changes if a block is added to the chosen ones, or removed."""
        covariance = np.linalg.inv(self._information(chosen) + self._ridge)
        through = blocks @ covariance
        own = np.eye(blocks.shape[1]) + sign * (through @ blocks.transpose(0, 2, 1))
        if self._determinant:
            changes: FloatArray = sign * np.linalg.slogdet(own)[1]
            return changes
        spread = through @ self._cost @ through.transpose(0, 2, 1)
        return np.asarray(np.trace(np.linalg.solve(own, spread), axis1=1, axis2=2))
