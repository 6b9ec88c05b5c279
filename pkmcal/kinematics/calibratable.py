"""The interface that calibration asks of a machine: the one door to parallel machines and arms."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Literal, Protocol

from numpy.typing import ArrayLike

from pkmcal.arguments import instance
from pkmcal.arms.arm import SerialArm
from pkmcal.arrays import BoolArray, FloatArray, Int32Array, Unit
from pkmcal.geometry.carried import Load
from pkmcal.geometry.controller import Controller
from pkmcal.geometry.elastic import Elastic
from pkmcal.geometry.laws import Law
from pkmcal.geometry.limbs import Limb
from pkmcal.geometry.load import CableLoad
from pkmcal.geometry.stated_uncertainty import StatedUncertainty
from pkmcal.kinematics.arm_machine import ArmMachine
from pkmcal.kinematics.robot import Robot


class Solved(Protocol):
    """Poses at actuator coordinates, row by row; `Forward` describes each."""

    @property
    def pose(self) -> FloatArray:
        """Poses (N, 6), NaN where there is none."""

    @property
    def ok(self) -> BoolArray:
        """Mask of rows that have a pose, (N,)."""


class SolvedRows(Solved, Protocol):
    """Solved rows with the reason where a row failed."""

    @property
    def status(self) -> Int32Array:
        """0 where a row has a pose, else why not, (N,)."""


class Solvable(Protocol):
    """A machine whose poses can be computed: what a virtual one needs."""

    def forward(self, q: FloatArray) -> Solved:
        """Poses at actuator coordinates (N, n)."""


class NamedNumbers(Protocol):
    """The numbers of a geometry; `Geometry` describes each."""

    @property
    def names(self) -> Sequence[str]:
        """Names of the p numbers."""

    @property
    def units(self) -> Sequence[str]:
        """Units of the numbers: "mm", "rad" or "1"."""

    @property
    def values(self) -> FloatArray:
        """Values of the numbers (p,)."""

    @property
    def chain(self) -> FloatArray:
        """Derivative of the numbers that may be tied, by all of them."""

    def items(self) -> Iterable[tuple[str, float]]:
        """Name and value of each number."""

    def match(self, patterns: str | Iterable[str], argument: str = "") -> list[str]:
        """Names that names and wildcards choose."""


class Declarations(Protocol):
    """The declarations of a robot file; `Model` describes each. Most of an arm's are empty."""

    @property
    def free(self) -> tuple[str, ...]:
        """Numbers that a calibration frees unless it is given others."""

    @property
    def uncertainty(self) -> StatedUncertainty:
        """Stated uncertainty of numbers that a calibration does not look for."""

    @property
    def limbs(self) -> tuple[Limb, ...]:
        """The limbs."""

    @property
    def closed_form(self) -> bool:
        """True if limbs are in closed form, and their numbers are places and lengths."""

    @property
    def laws(self) -> tuple[Law | None, ...]:
        """The law of each drive of a limb."""

    @property
    def driven(self) -> bool:
        """True if a drive of a limb has a law beside its gain and offset."""

    @property
    def elastic(self) -> Elastic | None:
        """Springs of the limbs, and the loads on them."""

    @property
    def load(self) -> CableLoad | None:
        """The load on a platform on cables."""

    @property
    def balanced_load(self) -> CableLoad | None:
        """The load that tensions of the rows balance."""

    @property
    def controller(self) -> Controller | None:
        """The firmware from which the numbers were imported."""


class Calibratable(Protocol):
    """A machine that can be calibrated: `Robot`, and a `SerialArm` through `ArmMachine`."""

    @property
    def kind(self) -> Literal["parallel", "arm"]:
        """Kind of the machine."""

    @property
    def name(self) -> str:
        """Name of the machine."""

    @property
    def length(self) -> float:
        """Characteristic length of the machine, mm: an angle counts as its arc there."""

    @property
    def n_actuators(self) -> int:
        """Number of actuators, n."""

    @property
    def actuator_units(self) -> tuple[str, ...]:
        """Unit of each, "mm" or "rad"."""

    @property
    def home(self) -> FloatArray:
        """The pose (6,) from which the forward kinematics start."""

    @property
    def geometry(self) -> NamedNumbers:
        """The p numbers that may be free."""

    @property
    def model(self) -> Declarations:
        """The declarations of its file."""

    @property
    def commands(self) -> Mapping[str, Unit]:
        """Name and unit of what a user commands: coordinates of the pose, or of an arm's joints."""

    def as_commands(self, pose: FloatArray, actuators: FloatArray) -> FloatArray:
        """Commands of a user that lead to poses (N, 6) by coordinates (N, n)."""

    @property
    def passive_names(self) -> tuple[str, ...]:
        """Names of the joints that may be read beside the actuators."""

    @property
    def yields(self) -> bool:
        """True if a number of the machine follows its load."""

    def replace(self, changes: FloatArray) -> Calibratable:
        """A machine with other numbers (p,), checked as those of a file are."""

    def with_values(self, values: FloatArray) -> Calibratable:
        """Return the machine for a step of a search: quickly, for numbers near the present ones."""

    def approaching(self, approach: FloatArray) -> Calibratable:
        """The machine with actuators that come from these coordinates (N, n)."""

    def tensioned(self, tension: FloatArray) -> Calibratable:
        """The machine with drives under tension (N, n), N; an arm does not follow it."""

    def under(self, load: Load) -> Calibratable:
        """The machine under the load of its platform or tool."""

    def forward(self, q: FloatArray, guess: FloatArray | None = None) -> SolvedRows:
        """Poses at actuator coordinates (N, n)."""

    def error_twists(self, pose: FloatArray, actuators: FloatArray) -> FloatArray:
        """Derivative (N, 6, p) of the platform's twist to each number."""

    def actuator_twists(self, pose: FloatArray, actuators: FloatArray) -> FloatArray:
        """Derivative (N, 6, n) of the platform's twist to each actuator coordinate."""

    def commanded(self, places: ArrayLike) -> tuple[FloatArray, FloatArray, tuple[int, ...]]:
        """Poses (N, 6), actuator coordinates (N, n) and batch shape of what a user commands."""


def as_machine(robot: Robot | SerialArm | ArmMachine) -> Calibratable:
    """The robot itself, or an arm through its adapter."""
    if isinstance(robot, SerialArm):
        return ArmMachine(robot)
    if isinstance(robot, ArmMachine):
        return robot
    return instance("robot", robot, Robot, " or SerialArm")


def as_given(machine: Calibratable) -> Robot | SerialArm:
    """The reverse of `as_machine`: what the user gave, an arm as an arm."""
    return machine.arm if isinstance(machine, ArmMachine) else instance("robot", machine, Robot)


def as_parallel(machine: Calibratable | SerialArm) -> Robot | None:
    """The machine where it is parallel; None of an arm, for what only closed loops have."""
    return machine if isinstance(machine, Robot) else None


def as_arm(machine: Calibratable | SerialArm) -> SerialArm | None:
    """The arm where the machine is one; None of a parallel machine."""
    if isinstance(machine, SerialArm):
        return machine
    return machine.arm if isinstance(machine, ArmMachine) else None
