"""Test of residuals against the order of measuring: F in the linear model at a fit.

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

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from pkmcal.arrays import FloatArray, IntArray, lots
from pkmcal.statistics.distributions import f_tail
from pkmcal.statistics.linear_fit import orthonormal, sums, triangle
from pkmcal.statistics.singular_values import svd

WAVES = 3  # of each component
LEAST = 5  # degrees of freedom beside them: below, nothing but a large jump would show
_NEW = 0.05  # share of a course that must be left beside the parameters
_BOTH = 2  # visits on either side of a jump, at least
_VISITS = 1024  # visits of which jumps are looked for at once, likewise


@dataclass(frozen=True, eq=False)
class Course:
    """Change of residuals in a series of visits.

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
        """Shift of each component, (k,): by the jump, or from its lowest to its highest."""
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
        """Number of visits."""
        return int(self.visit.max()) + 1

    @cached_property
    def _unit(self) -> FloatArray:
        """Return the part of each component (k,) that changes an equation by 1; 0 if not read."""
        squares, count = np.zeros((2, self.by_component.shape[1]))
        for rows in lots(len(self.visit)):
            mine = self.by_component[rows][self.visit[rows] >= 0]
            squares += np.einsum("ij,ij->j", mine, mine)
            count += np.count_nonzero(mine, axis=0)
        unit: FloatArray = np.sqrt(count / np.where(count, squares, 1.0))
        return unit

    def _own(self, rows: slice | IntArray) -> FloatArray:
        """Rows of `by_component` of this series, in these units."""
        own: FloatArray = self.by_component[rows] * self._unit
        own[self.visit[rows] < 0] = 0.0
        return own

    @cached_property
    def _factor(self) -> FloatArray:
        """Return the factor (p + k, r) that makes `_both` a basis."""
        factor = np.zeros((0, self.design.shape[1] + self.by_component.shape[1]))
        for rows in lots(len(self.visit)):
            factor = triangle(factor, [self.design[rows], self._own(rows)])
        return orthonormal(factor)

    def _both(self, steps: FloatArray, rows: slice | IntArray) -> FloatArray:
        """Rows of what parameters and a constant of each component explain by (p + k, ...)."""
        p = self.design.shape[1]
        both: FloatArray = self.design[rows] @ steps[:p] + self._own(rows) @ steps[p:]
        return both

    def _onto(self, columns: FloatArray, rows: slice) -> FloatArray:
        """Project parameters and constants onto rows of columns (b, ...)."""
        return np.concatenate([self.design[rows].T @ columns, self._own(rows).T @ columns])

    @cached_property
    def _left(self) -> FloatArray:
        """The residuals beside that."""
        every = list(lots(len(self.visit)))
        along = sum(self._onto(self.residual[rows], rows) for rows in every)
        steps = self._factor @ (self._factor.T @ along)
        left = np.empty(len(self.visit))
        for rows in every:
            left[rows] = self.residual[rows] - self._both(steps, rows)
        return left

    def course(self) -> Course | None:
        """Test the series; None where too little is left to say."""
        k = self.by_component.shape[1]
        when = (np.arange(self.visits) + 0.5) / self.visits
        waves = np.cos(np.pi * when[:, None] * np.arange(1, WAVES + 1))
        count = len(self.visit)

        def columns(rows: slice) -> FloatArray:
            courses = self._own(rows)[:, :, None] * waves[self.visit[rows]][:, None]
            return courses.reshape(len(courses), k * WAVES)

        squares, pulls = np.zeros((2, k * WAVES))
        inner = np.zeros((len(self._factor), k * WAVES))
        for rows in lots(count):
            some = columns(rows)
            squares += np.einsum("ij,ij->j", some, some)
            pulls += some.T @ self._left[rows]
            inner += self._onto(some, rows)
        known = self._factor @ (self._factor.T @ inner)
        factor = np.zeros((0, k * WAVES))
        for rows in lots(count):
            factor = triangle(factor, columns(rows) - self._both(known, rows))
        _, sizes, back = svd(factor)
        new = sizes > _NEW * float(squares.max()) ** 0.5
        taken = int(new.sum())
        freedom = len(self.residual) - self._factor.shape[1] - taken
        if not taken or freedom < LEAST:
            return None
        onto = back[new].T / sizes[new]
        along = onto.T @ pulls
        explained = float(along @ along)
        whole = float(self._left @ self._left)
        variance = (whole - explained) / freedom
        if not variance > 0:
            return None
        shares = (onto @ along).reshape(k, WAVES)
        values, steps = waves @ shares.T, known @ (onto @ along)

        def course(rows: slice) -> FloatArray:
            moved = np.einsum("ij,ij->i", self._own(rows), values[self.visit[rows]])
            beside: FloatArray = moved - self._both(steps, rows)
            return beside

        share = self._share(course, freedom / len(self.residual))
        values *= self._unit
        return Course(
            chance=f_tail(min(explained / taken / variance, 1e300), taken, freedom),
            explained=explained,
            share=share,
            values=values,
            scatter=np.sqrt(variance) * self._unit,
        )

    def _share(self, explained: Callable[[slice], FloatArray], spare: float) -> float:
        """Share of the variance of a component, the largest, of what is explained of rows.

        `spare` are the degrees of freedom of an equation.
        """
        k = self.by_component.shape[1]
        count, before, after = np.zeros((3, k))
        for rows in lots(len(self.visit)):
            mine = self.visit[rows] >= 0
            of, left = np.abs(self._own(rows)).argmax(axis=1)[mine], self._left[rows][mine]
            count += np.bincount(of, minlength=k)
            before += np.bincount(of, left**2, k)
            after += np.bincount(of, (left - explained(rows)[mine]) ** 2, k)
        known = (self._unit != 0.0) & (before > 0.0)
        freedom = spare * count[known]
        shares = 1.0 - after[known] / before[known] * (freedom + WAVES) / freedom
        return max(0.0, float(shares.max(initial=0.0)))

    def jumped(self, course: Course) -> Course:
        """The course as one jump, where that explains at least as much."""
        order = np.argsort(self.visit, kind="stable")
        rows = order[self.visit[order] >= 0]
        visit, rank = self.visit[rows], self._factor.shape[1]
        best, at, jump = course.explained, None, np.zeros(0)
        every = np.zeros(1)  # of all visits behind
        for first in reversed(range(0, self.visits, _VISITS)):
            some = slice(*np.searchsorted(visit, [first, first + _VISITS]))
            mine = rows[some]
            own = self._own(mine)
            known = self._both(self._factor, mine)
            parts = np.concatenate([known, self._left[mine, None], own], axis=1)
            of_visit = sums(own[:, :, None] * parts[:, None], visit[some])
            # of all visits from each on: the jump by what is known, what is left, and itself
            behind = np.cumsum(of_visit[::-1], axis=0)[::-1] + every
            every = behind[0]
            begin = max(_BOTH - first, 0)
            behind = behind[begin : max(self.visits - _BOTH + 1 - first, begin)]
            if not len(behind):
                continue
            within, pull, size = behind[:, :, :rank], behind[:, :, rank], behind[:, :, rank + 1 :]
            beside = size - within @ within.transpose(0, 2, 1)
            values, ways = np.linalg.eigh(beside)
            new = values > _NEW**2 * size.max(axis=(1, 2))[:, None]
            along = (ways.transpose(0, 2, 1) @ pull[:, :, None])[:, :, 0]
            along = np.where(new, along / np.where(new, values, 1.0), 0.0)
            jumps = (ways @ along[:, :, None])[:, :, 0]
            explained = (jumps * pull).sum(axis=1)
            largest = int(np.argmax(explained))
            if explained[largest] >= best:
                best, at, jump = float(explained[largest]), first + begin + largest, jumps[largest]
        if at is None:
            return course
        after = np.arange(self.visits)[:, None] >= at
        return replace(course, values=after * jump * self._unit, jump=at)
