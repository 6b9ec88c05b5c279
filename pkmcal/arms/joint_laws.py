"""Laws that joints of an arm add to their commands: sag, gears, coupled axes, backlash.

Of each joint q̃ = q + Σ v φ(q), linear in numbers v that are given or identified:

    sag by products   φ = z·(R e × ĝ): the torque of gravity about the joint by a unit moment of a
                      link; v is by how much such a moment turns the joint, rad
    compliance        φ = the torque about the joint by known masses and by what the tool carries,
                      N mm
    harmonics         φ = cos k q and sin k q, k waves a turn
    coupling          φ = another joint's command
    backlash          φ = ∓ 1/2, where the joint's reading had grown or fallen

Gravity is taken at the commanded coordinates and in the axes of the arm without joint errors: what
differs is of second order, and φ depends on no number of the arm.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np

from pkmcal.arms.joint_pulls import AtTool, JointPulls, Posture
from pkmcal.arrays import FloatArray, IntArray, Unit
from pkmcal.core import screws
from pkmcal.exceptions import ArgumentError

TermKind = Literal["sag", "compliance", "cos", "sin", "coupling", "backlash"]
KINDS: tuple[TermKind, ...] = ("sag", "compliance", "cos", "sin", "coupling", "backlash")
AXES = ("x", "y", "z")
_LATELY = 4  # calls whose φ is known


class Term(NamedTuple):
    """One number of a joint's law.

    Attributes
    ----------
    joint : int
        Counted from 0.
    kind : {"sag", "compliance", "cos", "sin", "coupling", "backlash"}
        What it is.
    of : float
        Of sag 3 times the link, counted from 0, plus the axis; of harmonics the waves a turn, or
        per mm; of a coupling the other joint, counted from 0; else 0.
    """

    joint: int
    kind: TermKind
    of: float = 0

    @property
    def name(self) -> str:
        """Name of the term among the numbers of the arm."""
        own = self.joint + 1
        match self.kind:
            case "sag":
                link, axis = divmod(int(self.of), 3)
                return f"sag{own}.link{link + 1}.{AXES[axis]}"
            case "compliance":
                return f"compliance{own}"
            case "coupling":
                return f"coupling{own}.{int(self.of) + 1}"
            case "backlash":
                return f"drive{own}.backlash"
        return f"drive{own}.{self.kind}{self.of:g}"


def sag_term(joint: int, link: int, axis: int) -> Term:
    """Return the angle by which a unit moment of a link turns a joint about an axis, from 0."""
    return Term(joint, "sag", 3 * link + axis)


class Memo:
    """φ as it was asked for lately, which no other numbers of a law change.

    A search asks for the same at each step: of all rows, and of lots of them.
    """

    def __init__(self) -> None:
        self._last: deque[tuple[tuple[FloatArray | None, ...], FloatArray]] = deque(maxlen=_LATELY)

    def of(self, *key: FloatArray | None) -> FloatArray | None:
        """φ of these coordinates and this state, where it is known."""
        for known, basis in self._last:
            if len(known) == len(key) and all(map(_equal, known, key)):
                return basis
        return None

    def keep(self, basis: FloatArray, *key: FloatArray | None) -> None:
        """Know φ of these coordinates and this state; who is given it changes nothing of it."""
        basis.flags.writeable = False
        copied = tuple(None if each is None else each.copy() for each in key)
        self._last.appendleft((copied, basis))

    def __reduce__(self) -> tuple[type[Memo], tuple[()]]:
        return Memo, ()


def _equal(one: FloatArray | None, other: FloatArray | None) -> bool:
    if one is None or other is None:
        return one is other
    return np.array_equal(one, other)


@dataclass(frozen=True, eq=False)
class JointLaws:
    """The laws of all joints of an arm.

    Parameters
    ----------
    pulls : JointPulls
        The joints, and what pulls at them; compliances need the masses of the links.
    numbers : mapping of Term to float
        rad and mm, of couplings ratios, of compliances rad/(N mm).
    approach : ndarray (n,) or (N, n), or None
        +1 where a joint's reading had grown, -1 where it had fallen, 0 where that is not known.
    memo : Memo
        Of φ; shared by laws that differ in the values of their numbers alone.
    """

    pulls: JointPulls
    numbers: Mapping[Term, float] = field(default_factory=dict)
    approach: FloatArray | None = None
    memo: Memo = field(default_factory=lambda: Memo())

    def __post_init__(self) -> None:
        for term in self.numbers:
            self._check(term, self._n)
        if not np.isfinite(list(self.numbers.values())).all():
            raise ArgumentError("laws of joints: their numbers must be finite")
        if self._sagging and not self.pulls.directed:
            raise ArgumentError("gravity: must have a direction, found 0 0 0")

    def _check(self, term: Term, n: int) -> None:
        revolute = self.pulls.kinds[term.joint] == "revolute"
        if term.kind in ("sag", "compliance") and not revolute:
            raise ArgumentError(f"{term.name}: joint {term.joint + 1} slides, no moment turns it")
        if term.kind == "sag" and not term.joint <= int(term.of) // 3 < n:
            raise ArgumentError(f"{term.name}: the link must be behind the joint, one of {n}")
        if term.kind == "compliance" and not self.pulls.weighed:
            raise ArgumentError(f"{term.name}: needs the mass and the centre of each link")
        if term.kind == "compliance" and "prismatic" in self.pulls.kinds:
            raise ArgumentError(f"{term.name}: is that of an arm with turning joints alone")
        if term.kind in ("cos", "sin") and not term.of > 0:
            raise ArgumentError(f"{term.name}: the waves must be above 0")
        if term.kind == "coupling":
            if not 0 <= term.of < n or term.of == term.joint:
                raise ArgumentError(f"{term.name}: the other joint must be another one of {n}")
            if self.pulls.kinds[int(term.of)] != self.pulls.kinds[term.joint]:
                raise ArgumentError(f"{term.name}: joints must both turn, or both slide")

    @cached_property
    def terms(self) -> tuple[Term, ...]:
        """Terms of the laws, joint by joint."""
        return tuple(sorted(self.numbers, key=lambda t: (t.joint, KINDS.index(t.kind), t.of)))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of its numbers, k."""
        return tuple(term.name for term in self.terms)

    @property
    def units(self) -> tuple[Unit, ...]:
        """Units of the terms."""
        return tuple(self._unit(term) for term in self.terms)

    def _unit(self, term: Term) -> Unit:
        if term.kind == "compliance":
            return "rad/(N mm)"
        if term.kind == "coupling":
            return "1"
        return "rad" if self.pulls.kinds[term.joint] == "revolute" else "mm"

    @cached_property
    def yielding(self) -> bool:
        """True if a joint has a compliance."""
        return any(term.kind == "compliance" for term in self.numbers)

    @cached_property
    def values(self) -> FloatArray:
        """Values of the terms (k,)."""
        return np.array([self.numbers[term] for term in self.terms])

    def with_values(self, values: FloatArray) -> JointLaws:
        """Return the laws with other values of their numbers (k,)."""
        return replace(self, numbers=dict(zip(self.terms, values.tolist(), strict=True)))

    def with_terms(self, terms: Iterable[Term]) -> JointLaws:
        """Return the laws with more terms, 0 where they are new."""
        numbers = dict.fromkeys(terms, 0.0) | dict(self.numbers)
        return replace(self, numbers=numbers, memo=Memo())

    def approaching(self, approach: FloatArray) -> JointLaws:
        """Return the laws for joints that come from these coordinates, (n,) or (N, n)."""
        return replace(self, approach=approach)

    def under(self, carried: AtTool | None) -> JointLaws:
        """Return the laws under a load at the tool, which compliances follow."""
        return replace(self, pulls=self.pulls.under(carried))

    def weighing(self, masses: FloatArray, centres: FloatArray) -> JointLaws:
        """Return the laws with masses (n,) and centres (n, 3) of the links."""
        return replace(self, pulls=replace(self.pulls, masses=masses, centres=centres), memo=Memo())

    def of_rows(self, rows: IntArray) -> JointLaws:
        """Return the laws with their state in some rows of a call."""
        approach, pulls = self.approach, self.pulls.of_rows(rows)
        if approach is not None and approach.ndim == 2:
            approach = approach[rows]
        if approach is self.approach and pulls is self.pulls:
            return self
        return replace(self, pulls=pulls, approach=approach)

    # what joints add ------------------------------------------------------------------------------

    def moved(self, theta: FloatArray) -> FloatArray:
        """Return the true joint coordinates (N, n) at the commands `theta` (N, n)."""
        found: FloatArray = theta.copy()
        np.add.at(found.T, self._joint, (self.basis(theta) * self.values).T)
        return found

    def basis(self, theta: FloatArray) -> FloatArray:
        """φ of each number, (N, k)."""
        carried = self.pulls.carried if self.yielding else None
        key = theta, self.approach, *([] if carried is None else carried)
        known = self.memo.of(*key)
        if known is None:
            known = self._basis(theta)
            self.memo.keep(known, *key)
        return known

    def _basis(self, theta: FloatArray) -> FloatArray:
        found = np.zeros((len(theta), len(self.terms)))
        at = self.posture(theta) if self._sagging or self.yielding else None
        products = self.pulls.products(at) if self._sagging and at else None
        torques = self.pulls.torques(at, theta) if self.yielding and at else None
        for c, (joint, kind, of) in enumerate(self.terms):
            match kind:
                case "sag":
                    assert products is not None
                    found[:, c] = products[:, joint, int(of) // 3, int(of) % 3]
                case "compliance":
                    assert torques is not None
                    found[:, c] = torques[:, joint]
                case "cos":
                    found[:, c] = np.cos(of * theta[:, joint])
                case "sin":
                    found[:, c] = np.sin(of * theta[:, joint])
                case "coupling":
                    found[:, c] = theta[:, int(of)]
                case "backlash":
                    found[:, c] = 0.0 if self.approach is None else -0.5 * self._from(joint)
        return found

    def slope(self, theta: FloatArray) -> FloatArray:
        """Derivative (N, n, n) of `moved` to the commands."""
        n = self._n
        found = np.tile(np.eye(n), (len(theta), 1, 1))
        for (joint, kind, of), value in zip(self.terms, self.values.tolist(), strict=True):
            if kind == "cos":
                found[:, joint, joint] -= value * of * np.sin(of * theta[:, joint])
            elif kind == "sin":
                found[:, joint, joint] += value * of * np.cos(of * theta[:, joint])
            elif kind == "coupling":
                found[:, joint, int(of)] += value
        at = self.posture(theta) if self._sagging or self.yielding else None
        if self._sagging and at:
            found += self.pulls.products_turning(at, self._sags)
        if self.yielding and at:
            found += self._compliances[:, None] * self.pulls.torques_turning(at, theta)
        return found

    def posture(self, theta: FloatArray) -> Posture:
        """Return where links and axes are at coordinates (N, n), without joint errors."""
        count, n = theta.shape
        revolute = np.array([kind == "revolute" for kind in self.pulls.kinds])
        twists = np.zeros((count, n, 6))
        twists[..., :3] = (theta * revolute)[..., None] * self.pulls.axes
        turns = screws.exp(twists.reshape(-1, 6)).reshape(count, n, 4, 4)[..., :3, :3]
        return self.pulls.posture(turns)

    @property
    def _n(self) -> int:
        return len(self.pulls.axes)

    @cached_property
    def _joint(self) -> IntArray:
        return np.array([term.joint for term in self.terms], dtype=np.intp)

    @cached_property
    def _sagging(self) -> bool:
        """True if products of gravity matter."""
        return any(term.kind == "sag" for term in self.numbers)

    def _from(self, joint: int) -> FloatArray:
        assert self.approach is not None
        found: FloatArray = self.approach[..., joint]
        return found

    @cached_property
    def _sags(self) -> FloatArray:
        """Return how far unit moments of the links turn each joint, (n, n, 3)."""
        found = np.zeros((self._n, self._n, 3))
        for (joint, kind, of), value in zip(self.terms, self.values.tolist(), strict=True):
            if kind == "sag":
                found[joint, int(of) // 3, int(of) % 3] += value
        return found

    @cached_property
    def _compliances(self) -> FloatArray:
        """Return the compliance of each joint (n,), rad/(N mm)."""
        found = np.zeros(self._n)
        for (joint, kind, _), value in zip(self.terms, self.values.tolist(), strict=True):
            if kind == "compliance":
                found[joint] = value
        return found
