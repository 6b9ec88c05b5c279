"""Choice of poses to measure, so that a calibration knows best where the machine goes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pkmcal.arguments import number, whole, word
from pkmcal.arms.arm import SerialArm
from pkmcal.arrays import FloatArray, IntArray, mm_per_unit
from pkmcal.display import Table, fixed
from pkmcal.effects.effect import Effects
from pkmcal.estimation.parameters import Prior
from pkmcal.exceptions import ArgumentError
from pkmcal.geometry.carried import Load
from pkmcal.kinematics.calibratable import Calibratable, as_machine, as_parallel
from pkmcal.kinematics.robot import Robot
from pkmcal.measurements.measurements import Measurements
from pkmcal.measurements.tracker import Tracker
from pkmcal.planning.offered import Planned, along, known_kind, name_of, offered
from pkmcal.planning.optimal_design import CRITERIA, Criterion
from pkmcal.planning.planned import Unknown
from pkmcal.planning.tour import short_tour, tour_length
from pkmcal.planning.travel_weight import with_travel
from pkmcal.result import Result

_DRAWS = 25  # of poses at random, to compare a plan with


@dataclass(frozen=True, eq=False, repr=False)
class Plan(Result):
    """Poses to measure.

    Attributes
    ----------
    robot : Robot or SerialArm
        The machine they are for.
    indices : ndarray of int (count,)
        Which of the candidates, in the order of a short tour from home.
    poses : ndarray (count, 6)
        mm and rad.
    actuators : ndarray (count, n)
        What leads there, mm and rad.
    predicted : float
        Root mean square over the targets of how far off a machine calibrated at these poses will
        be, √trace(J C Jᵀ), mm.
    at_random : float
        The same for as many candidates drawn at random, median of 25 draws.
    all_candidates : float
        The same for all candidates that keep the machine's limits.
    left_out : int
        How many candidates break limits, are not found by forward kinematics from home, are so
        near a singularity that errors of the geometry bar the way there or a payload makes the
        machine give way, or are `unpulled`.
    parameters : tuple of str
        What the calibration is to find.
    travel : float
        Length of the tour, mm: of each move what the drive travels that has farthest to go,
        angles as arcs, whatever the actuators read.
    own_frame : bool
        Whether predicted errors are those in the machine's own frame, because nothing that is read
        says where it stands.
    kinds : tuple of str, count
        What to measure at each pose.
    target : dict of str to ndarray (k, 3)
        Of each kind the points that are measured at every pose, mm, where they were stated.
    travel_weight : float
        By what share the predicted error may grow for a tour that is shorter by a share, as given.
    predicted_unweighted, travel_unweighted : float
        Predicted error and length of the tour without this weight, mm.
    stderr : ndarray (p,)
        Expected standard deviations of `parameters`, in their units; inf where not determined.
    load : Load or None
        What the machine carries at each pose, where `payloads` were given.
    unpulled : int
        How many candidates within limits were left out because some cable would have to push there:
        under the load of the robot file or, where that states none, against what holds the platform
        at home.
    """

    robot: Robot | SerialArm
    indices: IntArray
    poses: FloatArray
    actuators: FloatArray
    predicted: float
    at_random: float
    all_candidates: float
    left_out: int
    parameters: tuple[str, ...]
    travel: float = float("nan")
    own_frame: bool = False
    kinds: tuple[str, ...] = ()
    target: Mapping[str, FloatArray] = field(default_factory=dict)
    travel_weight: float = 0.0
    predicted_unweighted: float = float("nan")
    travel_unweighted: float = float("nan")
    unpulled: int = 0
    stderr: FloatArray = field(default_factory=lambda: np.empty(0))
    load: Load | None = None
    direction: FloatArray | None = None
    dilution: float = float("nan")

    def __len__(self) -> int:
        return len(self.indices)

    def _parts(self) -> Iterator[str | Table]:
        left_out = f"; {self.left_out} candidates left out" if self.left_out else ""
        machine = as_machine(self.robot)
        given = machine.as_commands(self.poses, self.actuators)
        turning = np.array([unit == "rad" for unit in machine.commands.values()])
        heads = ["candidate"]
        heads += [
            f"{n} [{'deg' if unit == 'rad' else unit}]" for n, unit in machine.commands.items()
        ]
        rows = [
            [str(index), *(fixed(float(value), 3) for value in row)]
            for index, row in zip(
                self.indices, np.where(turning, np.degrees(given), given), strict=True
            )
        ]
        count = _poses(len(self))
        several = len(set(self.kinds)) > 1
        if several:
            heads.append("measure")
            rows = [[*row, kind] for row, kind in zip(rows, self.kinds, strict=True)]
        if self.load is not None:
            heads.append("payload [kg]")
            masses = np.asarray(self.load.mass).tolist()
            rows = [[*row, f"{mass:g}"] for row, mass in zip(rows, masses, strict=True)]
        yield f"{self.robot.name}: measure {count} for {len(self.parameters)} parameters{left_out}"
        yield (
            f"predicted error{along(self.direction)} {self.predicted:.3g} mm rms;"
            f" {count} at random {self.at_random:.3g}, all candidates {self.all_candidates:.3g};"
            f" a tour of {_way(self.travel)} mm"
        )
        if np.isfinite(self.dilution):
            yield (
                f"dilution {self.dilution:.2g}: the error predicted at the targets is"
                f" {self.dilution:.2g} times the noise of a reading, whatever the errors of the"
                " machine"
            )
        if self.travel_weight:
            yield (
                f"travel weight {self.travel_weight:g}; without it"
                f" {self.predicted_unweighted:.3g} mm rms and a tour of"
                f" {_way(self.travel_unweighted)} mm"
            )
        if self.own_frame:
            yield "in the machine's own frame: nothing that is read says where it stands"
        if not np.isfinite(self.predicted):
            yield "too few to identify all of them"
        if self.unpulled:
            load = (
                "the load of its file"
                if as_machine(self.robot).model.load
                else "what holds it at home"
            )
            yield f"under {load} some cable would have to push at {self.unpulled} of those left out"
        yield Table(heads, rows)


def plan_poses(
    robot: Robot | SerialArm,
    candidates: ArrayLike,
    count: int | None = None,
    *,
    accuracy: float | None = None,
    targets: ArrayLike | None = None,
    criterion: Criterion = "prediction",
    kind: Planned | Mapping[Any, int] = "position",
    target: ArrayLike | Mapping[Any, ArrayLike] | None = None,
    noise: float | Tracker | Mapping[Any, float | Tracker] = 0.02,
    free: str | Sequence[str] | None = None,
    prior: Prior = None,
    unknown: Unknown | Sequence[Unknown] = (),
    actuator_noise: ArrayLike | None = None,
    travel_weight: float = 0.0,
    payloads: Sequence[float | Load] = (),
    effects: Effects = (),
    measured: Measurements | None = None,
    direction: ArrayLike | None = None,
) -> Plan:
    """Choose poses to measure among candidates, by exchange.

    Poses enter one by one, always the one that helps most; then each in turn makes room for the
    best of all candidates, until none wants to be exchanged.

    Parameters
    ----------
    robot : Robot or SerialArm
        The nominal machine, or as last calibrated.
    candidates : array_like (N, 6), for a serial arm (N, n)
        Poses that could be measured, mm and rad; of an arm its joint coordinates. Those that break
        the machine's limits are left out, those at which some cable would have to push, and those
        that machines with twice the errors of the prior (0.5 mm without one) do not reach. A pose
        that its closures do not allow is completed (`Robot.complete`). An arm's file has no limits:
        offer what it may take.
    count : int, optional
        How many to choose.
    accuracy : float, optional
        Instead of `count`: as few as predict this error at the targets, mm.
    targets : array_like (T, 6), for a serial arm (T, n), optional
        The poses where the machine is to be accurate; by default the candidates. Accurate at the
        origin of its platform or tool, wherever `target` is measured.
    criterion : {"prediction", "D", "A"}
        What is made least: the predicted error at the targets, the volume of the parameters'
        confidence region (largest det of the information), or the sum of their variances, scaled
        to mm at the machine.
    kind : {"position", "pose", "height", "distance", "orientation", "tilt", "closure"} or Reading
        What will be measured, a word or an object of `pkmcal.readings`; see `Measurements`.
        "closure" is nothing but the actuators, of a machine that has more of them than ways to
        move. Of several kinds how many poses of each, instead of `count`:
        ``{"position": 20, "distance": 10}``.
    target : array_like (3,) or (k, 3), or a mapping of kinds to them, optional
        The measured point of the platform, mm, or several that are measured at every pose. For
        distances the fixed points of the base.
    noise : float or Tracker, or a mapping of kinds to them
        Of the instrument, as `VirtualMachine` takes it.
    free, prior
        As `identify` takes them.
    unknown : str or sequence of str
        What `identify` will have to estimate beside the machine: "frame", "target".
    actuator_noise : float or array_like (n,), optional
        Standard deviation of what the actuators read, mm or rad; see `Measurements`. Machines with
        more actuators than ways to move need it, for their actuators are measured, too.
    travel_weight : float
        What a shorter tour is worth: with 0.5, a tour that is 10 % shorter is worth a predicted
        error that is 5 % larger (of other criteria, their standard deviation). 0.5 is best where
        the tour is driven as often as there is time, if driving takes the time: the error falls
        with the root of the number of tours. The `accuracy` wanted is reached with any weight.
        Some ten times as many exchanges are tried as without.
    payloads : sequence of float or Load
        What a machine that yields carries in turn, kg: every candidate can be measured under each,
        and the targets are to be met under each. Poses with one payload come one after another.
    effects : sequence of effects
        Those that are numbers of the machine, which the calibration is to find as well: `Sag`,
        `Elasticity`, `Harmonics`, `Coupling`, `Backlash`.
    measured : Measurements, optional
        Rows that are there, with their sigma: the plan is for poses beside them, `count` more, or
        as many as lead to `accuracy`, none if they do. Read in the same frame as those to come.
    direction : array_like (3,), optional
        In which direction of the base the error counts at the targets: ``(0, 0, 1)`` of a printer
        that needs its height over the bed. By default all three count.

    Returns
    -------
    Plan
        ``.indices``, ``.poses``, ``.actuators`` and the ``.predicted`` error.

    Raises
    ------
    ValueError, TypeError
        An argument that does not fit; no candidate within limits; a wanted accuracy that not even
        all candidates reach; unidentifiable parameters that move the targets.

    Notes
    -----
    V. V. Fedorov, Theory of Optimal Experiments, Academic Press 1972. The predicted error is that
    of optimal design for prediction (I- or V-optimality) over the targets.

    Examples
    --------
    >>> import pkmcal as pk
    >>> robot = pk.load("hexapod")
    >>> plan = pk.plan_poses(robot, pk.sample_poses(robot, 100), count=20, kind="pose")
    >>> len(plan), plan.predicted < plan.at_random
    (20, True)
    """
    word("criterion", criterion, CRITERIA)
    counts = _counts(kind, count, accuracy)
    kinds = list(counts)
    choice = offered(
        robot,
        candidates,
        kinds,
        targets=targets,
        direction=direction,
        criterion=criterion,
        target=target,
        noise=noise,
        free=free,
        prior=prior,
        unknown=unknown,
        actuator_noise=actuator_noise,
        payloads=payloads,
        effects=effects,
        measured=measured,
    )
    design, loads, q = choice.design, choice.loads, choice.actuators
    everything = design.predicted(np.arange(len(choice.sort)))
    if everything == 0.0 and (criterion == "prediction" or accuracy is not None):
        raise ArgumentError(
            f"{'criterion' if accuracy is None else 'accuracy'}: nothing that is free moves the"
            " origin of the platform or tool, whose error would be predicted; state a count and"
            " the criterion 'A' or 'D'"
        )
    weight = _weight(travel_weight, accuracy, criterion)
    if accuracy is None:
        of = "kind" if isinstance(kind, Mapping) else "count"
        most = len(q) * len(loads)
        each = [whole(of, n, 1, most, ", the candidates") for n in counts.values()]
        found = design.grown(*each)
    else:
        found = design.reaching(_accuracy(accuracy, everything, len(q)))
    ways, home = _drives(choice.machine, q)
    places, start = _by_payload(ways, home, len(kinds), len(loads))
    if len(found):
        found = found[short_tour(places[found], start)[0]]
    unweighted = design.predicted(found), tour_length(np.vstack([home, ways[found % len(q)]]))
    if weight and len(found):
        least = np.inf if accuracy is None else max(accuracy, unweighted[0])
        found = with_travel(design, found, places, start, weight, least)[0]
    chosen = found % len(q)
    predicted = design.predicted(found)
    return Plan(
        robot=robot,
        indices=choice.indices[chosen],
        poses=choice.poses[chosen],
        actuators=q[chosen],
        predicted=predicted,
        at_random=design.at_random(found, _DRAWS),
        all_candidates=everything,
        left_out=choice.given - len(choice.indices),
        parameters=choice.parameters.names,
        travel=tour_length(np.vstack([home, ways[chosen]])),
        own_frame=choice.own_frame,
        kinds=tuple(name_of(kinds[choice.sort[i]]) for i in found),
        target={name_of(each): place for each, place in choice.points.items()},
        travel_weight=weight,
        predicted_unweighted=unweighted[0],
        travel_unweighted=unweighted[1],
        unpulled=choice.unpulled,
        stderr=design.deviations(found) * choice.parameters.scale,
        load=_carried(loads, found // len(q) % len(loads)),
        direction=None if direction is None else np.asarray(direction, dtype=np.float64),
        dilution=predicted / choice.noise,
    )


def _counts(
    kind: Planned | Mapping[Any, int], count: object, accuracy: object
) -> dict[Planned, int | None]:
    """Return the number of poses of each kind; None where an accuracy decides."""
    if isinstance(kind, Mapping):
        if not kind or count is not None or accuracy is not None:
            raise ArgumentError(
                "kind: a mapping says how many poses of each kind, and goes without count and"
                f" accuracy; found {kind!r}"
            )
        return {known_kind(each): n for each, n in kind.items()}
    if (count is None) == (accuracy is None):
        raise ArgumentError(
            "give either count, how many poses, or accuracy, the error wanted in mm"
        )
    return {known_kind(kind): count}  # type: ignore[dict-item]


def _weight(given: object, accuracy: object, criterion: Criterion) -> float:
    weight = number("travel_weight", given, least=0)
    if weight and accuracy is not None and criterion != "prediction":
        raise ArgumentError(
            f"travel_weight: with accuracy it goes with the criterion prediction, found {criterion}"
        )
    return weight


def _drives(robot: Calibratable, q: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the way of the drives (N, n), and at home, mm, angles as arcs; zero of an arm.

    Lengths and angles, whatever the actuators read: those may be steps or turns.
    """
    parallel = as_parallel(robot)
    if parallel is None:
        arcs = mm_per_unit(robot.actuator_units, robot.length)
        return q * arcs, np.zeros(robot.n_actuators)
    home = robot.commanded(robot.home)[1]
    drives = parallel.machine.drives(parallel.slots, np.vstack([home, q]))
    drives = drives * np.array([robot.length if d.angle else 1.0 for d in parallel.model.drives])
    return drives[1:], drives[0]


def _by_payload(
    ways: FloatArray, home: FloatArray, kinds: int, loads: int
) -> tuple[FloatArray, FloatArray]:
    """Places of all candidates for a tour and its start, far apart where payloads differ."""
    apart = 2.0 * float(np.abs(ways - home).max(initial=1.0))
    of_load = np.repeat(np.arange(loads), len(ways)) * apart
    places = np.hstack([np.tile(ways, (loads, 1)), of_load[:, None]])
    return np.tile(places, (kinds, 1)), np.append(home, 0.0)


def _carried(loads: Sequence[Load | None], which: IntArray) -> Load | None:
    """The loads of a plan's poses, (count,) each."""
    each = [load.rows(()) for load in loads if load is not None]
    return Load.of_rows(np.array(each)[which]) if each else None


def _way(travel: float) -> str:
    return f"{travel:.4g}" if travel < 1e4 else f"{travel:.0f}"


def _poses(count: int) -> str:
    return f"{count} pose{'s' * (count != 1)}"


def _accuracy(accuracy: object, best: float, candidates: int) -> float:
    wanted = number("accuracy", accuracy, above=0)
    if not wanted > best:
        raise ArgumentError(
            f"accuracy: all {candidates} candidates together predict {best:.3g} mm, found"
            f" {wanted:g}; offer other candidates, a better instrument or a prior"
        )
    return wanted
