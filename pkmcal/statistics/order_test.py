"""Whether residuals change with the order of measuring: an F test in the linear model at a fit.

Each component of what was read is given a slow course of its own, the first waves of a discrete
cosine transform over the visits: a drift, a warming up, a jump are mostly these. They enter the
linear model beside the fitted parameters, so that what the parameters took of the course is not
missed, and what they leave to chance is not counted: with independent Gaussian errors of visits
the F test is exact, however few they are. Von Neumann's ratio of successive differences is not: it
is blind to what a fit does to neighbours, and to a jump it has less power.

A wrong model gives residuals such a course as well, where visits that follow each other are near
each other: the test says that residuals follow the order, not why.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.statistics.distributions import f_tail
from pkmcal.statistics.linear_fit import column_basis, sums, triangle

WAVES = 3  # of each component
LEAST = 5  # degrees of freedom beside them: below, nothing but a large jump would show
_NEW = 0.05  # share of a course that must be left beside the parameters
_BOTH = 2  # visits on either side of a jump, at least


@dataclass(frozen=True, eq=False)
class Course:
    """How the residuals of a series of visits change.

    Attributes
    ----------
    chance : float
        How likely as much would be if they did not.
    explained : float
        How much of the residuals' sum of squares it is.
    share : float
        Share of their variance in the component in which it is most: what chance alone would
        explain is taken off.
    values : ndarray (T, k)
        The course of each component.
    scatter : ndarray (k,)
        Standard deviation of a visit beside it; 0 of what was not read in this series.
    jump : int or None
        The visit from which on all are displaced, where one jump explains at least as much.
    """

    chance: float
    explained: float
    share: float
    values: FloatArray
    scatter: FloatArray
    jump: int | None = None

    @property
    def shift(self) -> FloatArray:
        """How far each component went, (k,): by the jump, or from its lowest to its highest."""
        if self.jump is not None:
            behind: FloatArray = self.values[-1]
            return behind
        ends: FloatArray = np.ptp(self.values, axis=0)
        return ends


@dataclass(frozen=True, eq=False)
class Series:
    """Equations of a fit, some of which are visits one after the other.

    Attributes
    ----------
    design : ndarray (E, p)
        By the parameters of the fit.
    residual : ndarray (E,)
        All of equal variance.
    by_component : ndarray (E, k)
        By what was read: how much an equation changes if a component does by 1.
    visit : ndarray of int (E,)
        From 0 in the order of measuring; -1 of equations of another series.

    Examples
    --------
    >>> noise, one = np.random.default_rng(0).normal(0, 0.1, 30), np.ones((30, 1))
    >>> when = np.arange(30)
    >>> Series(one, noise, one, when).course().chance > 0.05
    True
    >>> moved = Series(one, noise + (when >= 12), one, when)
    >>> course = moved.jumped(moved.course())
    >>> course.chance < 1e-9, course.jump, course.shift.round(1)
    (True, 12, array([1.]))
    """

    design: FloatArray
    residual: FloatArray
    by_component: FloatArray
    visit: IntArray

    @property
    def visits(self) -> int:
        """How many there are."""
        return int(self.visit.max()) + 1

    @cached_property
    def _mine(self) -> FloatArray:
        """`by_component` of this series."""
        mine: FloatArray = np.where(self.visit[:, None] >= 0, self.by_component, 0.0)
        return mine

    @cached_property
    def _unit(self) -> FloatArray:
        """How much of each component (k,) changes an equation by 1; 0 of what was not read."""
        squares, count = (self._mine**2).sum(axis=0), (self._mine != 0).sum(axis=0)
        unit: FloatArray = np.sqrt(count / np.where(count, squares, 1.0))
        return unit

    @cached_property
    def _own(self) -> FloatArray:
        """The same in these units."""
        own: FloatArray = self._mine * self._unit
        return own

    @cached_property
    def _known(self) -> FloatArray:
        """Basis of what parameters and a constant of each component explain."""
        return column_basis(np.hstack([self.design, self._own]))

    @cached_property
    def _left(self) -> FloatArray:
        """The residuals beside that."""
        return self._beside(self.residual)

    def _beside(self, columns: FloatArray) -> FloatArray:
        """What of columns (E, ...) parameters and constants do not explain."""
        beside: FloatArray = columns - self._known @ (self._known.T @ columns)
        return beside

    def course(self) -> Course | None:
        """Test the series; None where too little is left to say."""
        k = self.by_component.shape[1]
        when = (np.arange(self.visits) + 0.5) / self.visits
        waves = np.cos(np.pi * when[:, None] * np.arange(1, WAVES + 1))
        columns = (self._own[:, :, None] * waves[self.visit][:, None]).reshape(len(self.visit), -1)
        largest = float(np.einsum("ij,ij->j", columns, columns).max()) ** 0.5
        columns = self._beside(columns)
        _, sizes, back = np.linalg.svd(triangle(columns), full_matrices=False)
        new = sizes > _NEW * largest
        taken = int(new.sum())
        freedom = len(self.residual) - self._known.shape[1] - taken
        if not taken or freedom < LEAST:
            return None
        onto = back[new].T / sizes[new]
        along = onto.T @ (columns.T @ self.residual)
        explained = float(along @ along)
        whole = float(self._left @ self._left)
        variance = (whole - explained) / freedom
        if not variance > 0:
            return None
        shares = (onto @ along).reshape(k, WAVES)
        return Course(
            chance=f_tail(min(explained / taken / variance, 1e300), taken, freedom),
            explained=explained,
            share=self._share(columns @ (onto @ along), freedom / len(self.residual)),
            values=waves @ shares.T * self._unit,
            scatter=np.sqrt(variance) * self._unit,
        )

    def _share(self, explained: FloatArray, spare: float) -> float:
        """Share of the variance of a component, the largest, of what (E,) is explained.

        `spare` are the degrees of freedom of an equation.
        """
        largest = 0.0
        of = np.abs(self._own).argmax(axis=1)
        for component in np.flatnonzero(self._unit):
            mine = (self.visit >= 0) & (of == component)
            before, after = (
                float((each[mine] ** 2).sum()) for each in (self._left, self._left - explained)
            )
            freedom = spare * float(mine.sum())
            if before > 0:
                largest = max(largest, 1.0 - after / before * (freedom + WAVES) / freedom)
        return largest

    def jumped(self, course: Course) -> Course:
        """The course as one jump, where that explains at least as much."""
        order = np.argsort(self.visit, kind="stable")
        rows = order[self.visit[order] >= 0]
        own, visit = self._own[rows], self.visit[rows]
        parts = np.concatenate([self._known[rows], self._left[rows, None], own], axis=1)
        of_visit = sums(own[:, :, None] * parts[:, None], visit)
        # of all visits from each on: the jump by what is known, what is left, and itself
        behind = np.cumsum(of_visit[::-1], axis=0)[::-1][_BOTH : self.visits - _BOTH + 1]
        if not len(behind):
            return course
        rank = self._known.shape[1]
        within, pull, size = behind[:, :, :rank], behind[:, :, rank], behind[:, :, rank + 1 :]
        beside = size - within @ within.transpose(0, 2, 1)
        values, ways = np.linalg.eigh(beside)
        new = values > _NEW**2 * size.max(axis=(1, 2))[:, None]
        along = (ways.transpose(0, 2, 1) @ pull[:, :, None])[:, :, 0]
        along = np.where(new, along / np.where(new, values, 1.0), 0.0)
        jump = (ways @ along[:, :, None])[:, :, 0]
        explained = (jump * pull).sum(axis=1)
        best = int(np.argmax(explained))
        if explained[best] < course.explained:
            return course
        after = np.arange(self.visits)[:, None] >= best + _BOTH
        return replace(course, values=after * jump[best] * self._unit, jump=best + _BOTH)
