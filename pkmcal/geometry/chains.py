"""Limbs as chains of joints: what a robot file says of them, and the machine the core makes of it.

A joint of several axes (U, S, C) is listed once and stands for a row of R and P, its parts: the
second and third have the letters b and c behind their number. A ball, an S without axes of its
own, has no orientation to be wrong: behind all other joints it closes in a point, elsewhere it is
three R of which only the place can be wrong.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.core.chains import ChainLayout
from pkmcal.display import Table, fixed
from pkmcal.geometry.chain_joints import (
    BY_MAP,
    ERRORS,
    PARTS,
    Joint,
    Part,
    ball_axes,
    error_unit,
    frame_of,
)
from pkmcal.geometry.laws import LawNumber, gain_unit
from pkmcal.geometry.mechanism import StatedDrive
from pkmcal.geometry.ties import LimbNumber
from pkmcal.screw import from_pose

_DEPENDENT = 1e-7  # of the largest singular value: the least is none


@dataclass(frozen=True, eq=False)
class Chains:
    """The limbs of a machine of chains, as `pkmcal.geometry.mechanism.Mechanism`.

    Attributes
    ----------
    map : str
        Pose map.
    home : ndarray (6,)
        Of the platform.
    limbs : tuple of tuple of Joint
        Of each limb its joints from the base to the platform, and those of the tail.
    tail : int
        How many joints are behind the platform, the same in all limbs: the pose is that of a tool
        which they carry.
    """

    map: str
    home: FloatArray
    limbs: tuple[tuple[Joint, ...], ...]
    tail: int = 0

    closed_form: Literal[False] = field(default=False, init=False)
    key_of_drives: Literal["joints"] = field(default="joints", init=False)

    @property
    def apart(self) -> bool:
        """True if no passive joint is of several limbs and none behind the platform."""
        return not (self.layout.shared or self.tail)

    @property
    def loose(self) -> bool:
        """True if limbs hold each other by joints that they share."""
        return self.layout.loose

    @property
    def n_actuators(self) -> int:
        """Number of actuators."""
        return 1 + max(
            (j.actuator for limb in self.limbs for j in limb if j.actuator is not None), default=-1
        )

    def name_of(self, i: int, k: int) -> str:
        """The name of joint k of limb i, both counted from 0, before the letter of its part.

        The first joint of the tail has errors for each limb: where the limb ends on the platform.
        """
        behind = k - (len(self.limbs[i]) - self.tail)
        if behind >= 0:
            return f"tail{behind + 1}" if behind else f"limb{i + 1}.tail"
        return self.limbs[i][k].share or f"limb{i + 1}.joint{k + 1}"

    def end_of(self, i: int) -> str:
        """The name of the end of limb i, counted from 0: on the platform, or all on the tool."""
        return "tool" if self.tail else f"limb{i + 1}.platform"

    @cached_property
    def actuated(self) -> tuple[tuple[int, Joint], ...]:
        """The first limb of each actuator, and the joint that it moves."""
        found: dict[int, tuple[int, Joint]] = {}
        for i, limb in enumerate(self.limbs):
            for joint in limb:
                if joint.actuator is not None:
                    found.setdefault(joint.actuator, (i, joint))
        return tuple(found[a] for a in sorted(found))

    @property
    def stated_drives(self) -> tuple[StatedDrive, ...]:
        """The drive of each actuator."""
        return tuple(
            StatedDrive(a, joint.law, joint.unit, joint.stroke, limb)
            for a, (limb, joint) in enumerate(self.actuated)
        )

    @property
    def first_drives(self) -> tuple[int, ...]:
        """The first actuator of each limb before the platform, counted from 0; -1 of none."""
        return tuple(
            next((j.actuator for j in limb[: len(limb) - self.tail] if j.actuator is not None), -1)
            for limb in self.limbs
        )

    @property
    def passive_names(self) -> tuple[str, ...]:
        """The passive joints, by their coordinates in the core."""
        names, coordinate = list(self.parts), self.layout.coordinate
        order = sorted(range(len(names)), key=lambda k: int(coordinate[k]))
        return tuple(names[k] for k in order if coordinate[k] >= 0)

    @property
    def read_at_home(self) -> FloatArray:
        """The ways of the drives at home."""
        return self.layout.zero

    def row_actuators(self, rows: int) -> list[int]:
        """Return the actuator of each closure: first one of each, then those of passive joints."""
        return [*range(self.n_actuators), *[-1] * (rows - self.n_actuators)]

    def characteristic_length(self, slots: FloatArray) -> float:
        """Return `length`, whatever the errors of the joints."""
        return self.length

    def extent(self, slots: FloatArray, home: FloatArray) -> float:
        """Return `size`, whatever the errors of the joints."""
        return self.size

    def base_points(self, slots: FloatArray) -> FloatArray:
        """Return the first joint of each limb, (limbs, 3), mm."""
        return np.array([limb[0].at for limb in self.limbs])

    def table(self, slots: FloatArray) -> Table:
        """Return every joint from the base to the platform, in the base frame, at home."""
        rows = []
        for i, limb in enumerate(self.limbs, 1):
            for k, joint in enumerate(limb, 1):
                drive = "" if joint.actuator is None else f"q{joint.actuator + 1}"
                place = [fixed(float(x), 3) for x in joint.at]
                own = k <= len(limb) - self.tail
                name = joint.share or str(k) if own else f"tail{k - len(limb) + self.tail}"
                if own or i == 1:
                    rows.append([str(i) if own else "", name, joint.kind, drive, *place])
        return Table(
            ["limb", "joint", "kind", "actuator", "x [mm]", "y [mm]", "z [mm]"], rows, left=4
        )

    @property
    def arms(self) -> tuple[tuple[Joint, float], ...]:
        """The joint of each actuator, and the distance of the next joint from its axis, mm."""
        found = []
        for i, joint in self.actuated:
            limb = self.limbs[i]
            arm = self.length
            for other in limb[limb.index(joint) + 1 :]:
                way = np.cross(other.at - joint.at, joint.axes[0])
                if np.linalg.norm(way) > 1e-9 * self.size:
                    arm = float(np.linalg.norm(way))
                    break
            found.append((joint, arm))
        return tuple(found)

    @cached_property
    def members(self) -> tuple[tuple[str, ...], ...]:
        """The names of each limb's parts, without a last ball."""
        return tuple(
            tuple(
                self.name_of(i, k) + suffix
                for k, joint in enumerate(limb)
                if not _closes(limb, joint)
                for suffix in PARTS[: joint.parts]
            )
            for i, limb in enumerate(self.limbs)
        )

    @cached_property
    def parts(self) -> dict[str, Part]:
        """Every axis by its name, the first of each shared joint's limbs."""
        found: dict[str, Part] = {}
        for i, limb in enumerate(self.limbs):
            for k, joint in enumerate(limb):
                if _closes(limb, joint):
                    continue
                name = self.name_of(i, k)
                errors = BY_MAP[self.map]
                axes = joint.axes
                if joint.ball:
                    axes, errors = ball_axes(limb, k), BY_MAP[self.map][:3]
                if joint.kind == "C":
                    axes = axes * 2
                for n, (suffix, axis) in enumerate(zip(PARTS, axes, strict=False)):
                    own = errors if n == 0 or not joint.ball else ()
                    slides = joint.kind == "P" or (joint.kind == "C" and n == 1)
                    found.setdefault(
                        name + suffix, Part(name + suffix, slides, axis, joint, i, own)
                    )
        return found

    @cached_property
    def numbers(self) -> tuple[LimbNumber, ...]:
        """Every number: of each limb its errors, then those of its actuators."""
        made: list[LimbNumber] = []
        places = self._places
        seen: set[str] = set()
        ends: set[int] = set()
        for i, names in enumerate(self.members):
            ball = _ends_in_ball(self.limbs[i])
            for name in names:
                if name not in seen:
                    made += _errors(name, self.parts[name].errors, i, places[name])
                seen.add(name)
            if ball:
                name = f"limb{i + 1}.joint{len(self.limbs[i])}"
                made += _errors(name, ERRORS[:3], i, places[name])
            name = self.end_of(i)
            if places[name] not in ends:
                ends.add(places[name])
                made += _errors(name, ERRORS[:3] if ball else BY_MAP[self.map], i, places[name])
            for a, (first, joint) in enumerate(self.actuated):
                if first == i:
                    place = places[f"drive{a + 1}"]
                    made.append(LimbNumber(f"offset{a + 1}", joint.unit, i, "offset", None, place))
                    unit = gain_unit(joint.law, joint.unit)
                    made.append(LimbNumber(f"gain{a + 1}", unit, i, "gain", None, place + 1))
                    for j, number in enumerate(self._law_numbers(a)):
                        place, slot = self._law_start(a) + j, f"drive.{number.key}"
                        made.append(LimbNumber(number.name, number.unit, i, slot, None, place))
        return tuple(made)

    @cached_property
    def _places(self) -> dict[str, int]:
        """Places of the six errors of each part and end, and of each actuator's offset and gain."""
        names: list[tuple[str, int]] = [(name, 6) for name in self.parts]
        ends: dict[str, int] = {}
        for i, limb in enumerate(self.limbs):
            if _ends_in_ball(limb):
                names.append((f"limb{i + 1}.joint{len(limb)}", 6))
            if not (self.tail and i):
                names.append((self.end_of(i), 6))
        names += [(f"drive{a + 1}", 2) for a in range(self.n_actuators)]
        place = 0
        for name, count in names:
            ends[name] = place
            place += count
        for i, limb in enumerate(self.limbs):  # limbs that end in the same joint have one end
            if self.tail:
                break
            first = next(k for k, other in enumerate(self.limbs) if _same_end(other, limb))
            ends[f"limb{i + 1}.platform"] = ends[f"limb{first + 1}.platform"]
        return ends

    def _soft(self, part: Part) -> float:
        """Return how much a part yields: nothing behind the platform, a ball before it as one."""
        limb = self.limbs[part.limb]
        behind = [id(joint) for joint in limb[len(limb) - self.tail :]]
        if id(part.joint) in behind:
            return 0.0
        last = self.tail > 0 and part.joint is limb[-1 - self.tail]
        return 0.0 if last and part.joint.ball and not part.errors else part.joint.soft

    def _law_numbers(self, a: int) -> tuple[LawNumber, ...]:
        joint = self.actuated[a][1]
        return () if joint.law is None else joint.law.numbers(a + 1, joint.unit)

    def _law_start(self, a: int) -> int:
        """Return the place of an actuator's law numbers, behind those of the core."""
        return self.count + sum(len(self._law_numbers(before)) for before in range(a))

    @property
    def count(self) -> int:
        """Number of the machine's numbers in the core, those that are always 0 included."""
        return self._places["drive1"] + 2 * self.n_actuators

    @cached_property
    def blank(self) -> FloatArray:
        """The numbers without errors, those of the core and of the laws, (1, …): gains are 1."""
        blank = np.zeros((1, self._law_start(self.n_actuators)))
        for a in range(self.n_actuators):
            blank[0, self._places[f"drive{a + 1}"] + 1] = 1.0
        return blank

    @cached_property
    def length(self) -> float:
        """Characteristic length, mm: root mean square distance of the ends from their centre.

        Of the joints at the base, and then of all, where the ends are in one point.
        """
        ends = np.array([limb[-1 - self.tail].at for limb in self.limbs])
        first = np.array([limb[0].at for limb in self.limbs])
        every = np.array([
            joint.at for limb in self.limbs for joint in limb[: len(limb) - self.tail]
        ])  # fmt: skip
        for points in (ends, first, every):
            spread = points - points.mean(axis=0)
            radius = float(np.sqrt((spread**2).sum(axis=1).mean()))
            if radius > 1e-9 * (1.0 + float(np.abs(every).max())):
                return radius
        return 100.0

    @property
    def size(self) -> float:
        """Size by which rounding is measured, mm."""
        every = np.array([joint.at for limb in self.limbs for joint in limb])
        return float(max(np.abs(every).sum(axis=1).max(), np.abs(self.home[:3]).sum(), self.length))

    def dependent(self, limb: int) -> bool:
        """Return whether passive joints can move at home while the platform stands still."""
        joints = self.limbs[limb]
        end = joints[-1].at if joints[-1].ball else self.home[:3]
        columns = []
        for name in self.members[limb]:
            part = self.parts[name]
            if part.joint.actuator is not None:
                continue
            turns = np.zeros(3) if part.slides else part.axis
            arm = (end - part.joint.at) / self.length
            moves = part.axis if part.slides else np.cross(part.axis, arm)
            columns.append(np.concatenate([turns, moves]))
        if not columns:
            return False
        closing = {"planar": slice(2, 5), "spherical": slice(0, 3)}.get(self.map, slice(0, 6))
        J = np.array(columns).T[slice(3, 6) if joints[-1].ball else closing]
        sigma = np.linalg.svd(J, compute_uv=False)
        return bool(len(sigma) < J.shape[1] or sigma[-1] < _DEPENDENT * max(sigma[0], 1.0))

    @cached_property
    def layout(self) -> ChainLayout:
        """The machine as the core takes it."""
        parts, places = self.parts, self._places
        index = {name: k for k, name in enumerate(parts)}
        member = [index[name] for limb in self.members for name in limb]
        chains = [set(limb) for limb in self.members]
        passive = [n for n, part in parts.items() if part.joint.actuator is None]
        passive.sort(key=lambda name: sum(name in limb for limb in chains) < 2)  # shared first
        coordinate = {name: k for k, name in enumerate(passive)}
        ends = [limb[-1] for limb in self.limbs]
        balls = [f"limb{i}.joint{len(limb)}" for i, limb in enumerate(self.limbs, 1)]
        first = np.cumsum([0, *(len(limb) for limb in self.members)])
        zero = np.array([joint.home_value for _, joint in self.actuated])
        middle = [z if j.stroke is None else sum(j.stroke) / 2
                  for z, (_, j) in zip(zero, self.actuated, strict=True)]  # fmt: skip

        def ints(values: object) -> np.ndarray[tuple[int, ...], np.dtype[np.int32]]:
            return np.array(values, dtype=np.int32)

        every = list(parts.values())
        return ChainLayout(
            map=self.map,
            home=from_pose(self.home),
            size=self.size,
            length=self.length,
            numbers=self.count,
            first=ints(first),
            member=ints(member),
            ball=ints([_ends_in_ball(limb) for limb in self.limbs]),
            end_place=ints([places[self.end_of(i)] for i in range(len(ends))]),
            ball_place=ints([places.get(ball, 0) for ball in balls]),
            end=np.array([joint.at for joint in ends]),
            prismatic=ints([part.slides for part in every]),
            actuator=ints([-1 if p.joint.actuator is None else p.joint.actuator for p in every]),
            coordinate=ints([coordinate.get(part.name, -1) for part in every]),
            place=ints([places[part.name] for part in every]),
            axes=np.array([frame_of(part.axis) for part in every]),
            point=np.array([part.joint.at for part in every]),
            soft=np.array([self._soft(part) for part in every]),
            drive_place=ints([places[f"drive{a + 1}"] for a in range(self.n_actuators)]),
            zero=zero,
            near=np.array(middle),
            tail=self.n_actuators - self.tail,
        )


def _errors(name: str, errors: tuple[str, ...], limb: int, place: int) -> list[LimbNumber]:
    found = []
    for error in errors:
        slot = name.partition(".")[2] or name
        at = place + ERRORS.index(error)
        found.append(
            LimbNumber(f"{name}.{error}", error_unit(error), limb, f"{slot}.{error}", None, at)
        )
    return found


def _ends_in_ball(limb: tuple[Joint, ...]) -> bool:
    return limb[-1].ball


def _closes(limb: tuple[Joint, ...], joint: Joint) -> bool:
    return joint is limb[-1] and joint.ball


def _same_end(a: tuple[Joint, ...], b: tuple[Joint, ...]) -> bool:
    return a is b or (a[-1].share is not None and a[-1].share == b[-1].share)
