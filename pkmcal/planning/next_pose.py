"""The pose to measure next, beside rows that are there: a measurement that goes on."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pkmcal.arguments import whole, word
from pkmcal.arms.arm import SerialArm
from pkmcal.arrays import BoolArray, FloatArray, IntArray
from pkmcal.core.library import POSE
from pkmcal.display import Table, fixed
from pkmcal.effects.effect import Effects
from pkmcal.estimation.parameters import Prior
from pkmcal.exceptions import ArgumentError
from pkmcal.kinematics.robot import Robot
from pkmcal.measurements.measurements import Measurements
from pkmcal.measurements.tracker import Tracker
from pkmcal.planning.offered import Offered, Planned, along, known_kind, offered
from pkmcal.planning.optimal_design import CRITERIA, Criterion, Design
from pkmcal.planning.planned import Unknown
from pkmcal.result import Result


@dataclass(frozen=True, eq=False, repr=False)
class NextPose(Result):
    """The candidate to be measured next, and what is predicted with those measured before.

    Attributes
    ----------
    robot : Robot or SerialArm
        The machine.
    direction : ndarray (3,) or None
        In which predicted errors count.
    """

    robot: Robot | SerialArm
    direction: FloatArray | None
    _choice: Offered
    _design: Design
    _free: BoolArray  # candidates that were not measured
    _first: tuple[int, ...] = ()  # those that come before any others: the fewest that will do

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the numbers that the calibration is to find."""
        return self._choice.parameters.names

    @property
    def indices(self) -> IntArray:
        """Candidates that can be measured and have not been, in their order."""
        return self._choice.indices[self._free]

    @property
    def left(self) -> int:
        """Number of candidates that have not been measured."""
        return int(self._free.sum())

    @property
    def index(self) -> int:
        """Index of the candidate to measure.

        Raises
        ------
        ValueError
            All of them are measured.
        """
        return int(self._choice.indices[self._best])

    @property
    def pose(self) -> FloatArray:
        """Pose of that candidate (6,), mm and rad."""
        pose: FloatArray = self._choice.poses[self._best]
        return pose

    @property
    def actuators(self) -> FloatArray:
        """Actuators of that pose (n,), mm and rad."""
        actuators: FloatArray = self._choice.actuators[self._best]
        return actuators

    @cached_property
    def predicted(self) -> float:
        """Root mean square error at the targets with the rows that are there, mm; inf: too few."""
        return self._design.predicted(np.array([], dtype=np.intp))

    @property
    def dilution(self) -> float:
        """`predicted` over the noise of a reading; see `Plan.dilution`."""
        return self.predicted / self._choice.noise

    @cached_property
    def predicted_after(self) -> float:
        """The error when this pose is measured, too, mm."""
        return self._design.predicted(np.array([self._best], dtype=np.intp))

    @cached_property
    def predicted_at_last(self) -> float:
        """The error when all candidates are measured, mm."""
        return self._design.predicted(np.flatnonzero(self._free))

    def after(self, index: int | None = None) -> NextPose:
        """Choose again when a candidate has been measured.

        Parameters
        ----------
        index : int, optional
            Which of the candidates; by default this one. The same once more is another row.

        Raises
        ------
        ValueError
            A candidate that cannot be measured: it was left out.
        """
        at = self._best if index is None else self._place(index)
        return replace(self, _design=self._design.beside(at), **self._but(at))

    def without(self, index: int) -> NextPose:
        """Choose again without a candidate, at which nothing can be measured.

        Raises
        ------
        ValueError
            A candidate that was left out already.
        """
        return replace(self, **self._but(self._place(index)))

    def _place(self, index: int) -> int:
        number = whole("index", index, 0, self._choice.given - 1, ", the candidates")
        places = np.flatnonzero(self._choice.indices == number)
        if not len(places):
            raise ArgumentError(f"index: candidate {number} was left out, found {index!r}")
        return int(places[0])

    def _but(self, at: int) -> dict[str, Any]:
        """Fields of the choice that is left without a candidate."""
        free = self._free.copy()
        free[at] = False
        return {"_free": free, "_first": tuple(each for each in self._first if each != at)}

    @cached_property
    def _best(self) -> int:
        if not self.left:
            raise ArgumentError("candidates: all of them are measured; offer others")
        return self._first[0] if self._first else self._design.best(self._free)

    def _parts(self) -> Iterator[str | Table]:
        where = along(self.direction)
        yield f"{self.robot.name}: predicted error{where} {self.predicted:.3g} mm rms"
        if not self.left:
            yield "all candidates are measured"
            return
        turned = np.array([0, 0, 0, 1, 1, 1], dtype=bool)
        shown = np.where(turned, np.degrees(self.pose), self.pose)
        heads = [f"{n} [{'deg' if t else 'mm'}]" for n, t in zip(POSE, turned, strict=True)]
        yield f"{self.predicted_after:.3g} mm with candidate {self.index}"
        yield Table(heads, [[fixed(float(value), 3) for value in shown]])


def next_pose(
    robot: Robot | SerialArm,
    candidates: ArrayLike,
    *,
    kind: Planned = "position",
    noise: float | Tracker = 0.02,
    measured: Measurements | None = None,
    done: Sequence[int] = (),
    targets: ArrayLike | None = None,
    direction: ArrayLike | None = None,
    criterion: Criterion = "prediction",
    target: ArrayLike | None = None,
    free: str | Sequence[str] | None = None,
    prior: Prior = None,
    unknown: Unknown | Sequence[Unknown] = (),
    actuator_noise: ArrayLike | None = None,
    effects: Effects = (),
) -> NextPose:
    """Choose the pose to measure next, beside rows that are there.

    The pose that a plan of one more would choose; where nothing is measured, first those of a plan
    of as many as there have to be. What each candidate brings is computed once; `NextPose.after`
    then takes some milliseconds.

    Parameters
    ----------
    robot, candidates
        As `plan_poses` takes them.
    kind, noise, target, actuator_noise
        What each candidate is measured by, likewise.
    measured : Measurements, optional
        Rows that are there.
    done : sequence of int, optional
        Candidates that are not to be measured again.
    targets, direction, criterion
        What is made least.
    free, prior, unknown, effects
        What the calibration will have to find.

    Returns
    -------
    NextPose
        ``.index``, ``.pose``, ``.predicted`` and ``.after()``, the choice when it is measured.

    Raises
    ------
    ValueError, TypeError
        As `plan_poses`.

    Examples
    --------
    >>> import pkmcal as pk
    >>> robot = pk.load("hexapod")
    >>> choice = pk.next_pose(robot, pk.sample_poses(robot, 40), kind="pose")
    >>> for _ in range(10):
    ...     choice = choice.after()
    >>> choice.predicted > choice.predicted_after
    True
    """
    word("criterion", criterion, CRITERIA)
    choice = offered(
        robot,
        candidates,
        [known_kind(kind)],
        targets=targets,
        direction=direction,
        criterion=criterion,
        target=target,
        noise=noise,
        free=free,
        prior=prior,
        unknown=unknown,
        actuator_noise=actuator_noise,
        payloads=(),
        effects=effects,
        measured=measured,
    )
    axis = None if direction is None else np.asarray(direction, dtype=np.float64)
    left = ~np.isin(choice.indices, done)
    first: tuple[int, ...] = ()
    if left.all() and (fewest := choice.design.fewest()) > 1:
        first = tuple(choice.design.grown(min(fewest, len(left))).tolist())
    return NextPose(robot, axis, choice, choice.design, left, first)
