"""What joints of an arm add to their commands: sag, gears, coupled axes, backlash.

Of each joint q̃ = q + Σ v φ(q), linear in numbers v that are given or identified:

    sag by products   φ = z·(R e × ĝ): the torque of gravity about the joint by a unit moment of a
                      link; v is by how much such a moment turns the joint, rad
    compliance        φ = the torque of gravity about the joint by known masses, N mm
    harmonics         φ = cos k q and sin k q, k waves a turn
    coupling          φ = another joint's command
    backlash          φ = ∓ 1/2, where the joint's reading had grown or fallen

Gravity is taken at the commanded coordinates and in the axes of the arm without joint errors: what
differs is of second order, and φ depends on no number of the arm.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np

from pkmcal.arrays import FloatArray, IntArray, Unit
from pkmcal.core import screws
from pkmcal.exceptions import ArgumentError
from pkmcal.geometry.elastic import GRAVITY

TermKind = Literal["sag", "compliance", "cos", "sin", "coupling", "backlash"]
KINDS: tuple[TermKind, ...] = ("sag", "compliance", "cos", "sin", "coupling", "backlash")
AXES = ("x", "y", "z")


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
        """Its name among the numbers of the arm."""
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
    """What a moment of a link along an axis, all counted from 0, turns a joint."""
    return Term(joint, "sag", 3 * link + axis)


class Memo:
    """φ at the coordinates that were asked for last, which no other numbers of a law change.

    A search asks for the same ones at each step.
    """

    def __init__(self) -> None:
        self._last: tuple[FloatArray, FloatArray] | None = None

    def of(self, theta: FloatArray) -> FloatArray | None:
        """φ at these coordinates, where it is known."""
        last = self._last
        return last[1] if last is not None and np.array_equal(last[0], theta) else None

    def keep(self, theta: FloatArray, basis: FloatArray) -> None:
        """Know φ at these coordinates; who is given it changes nothing of it."""
        basis.flags.writeable = False
        self._last = theta.copy(), basis

    def __reduce__(self) -> tuple[type[Memo], tuple[()]]:
        return Memo, ()


@dataclass(frozen=True, eq=False)
class JointLaws:
    """The laws of all joints of an arm.

    Parameters
    ----------
    axes : ndarray (n, 3)
        Directions of the joints' axes at zero, in the base.
    points : ndarray (n, 3)
        A point on each, mm.
    kinds : tuple of str, n
        "revolute" or "prismatic".
    numbers : mapping of Term to float
        rad and mm, of couplings ratios, of compliances rad/(N mm).
    gravity : sequence of float
        m/s², in the axes of the base.
    masses : ndarray (n,) or None
        Of the link behind each joint, kg; compliances need them.
    centres : ndarray (n, 3) or None
        Their centres at zero, in the base, mm.
    approach : ndarray (n,) or (N, n), or None
        +1 where a joint's reading had grown, -1 where it had fallen, 0 where that is not known.
    memo : Memo
        Of φ; shared by laws that differ in the values of their numbers alone.
    """

    axes: FloatArray
    points: FloatArray
    kinds: tuple[str, ...]
    numbers: Mapping[Term, float]
    gravity: tuple[float, float, float] = GRAVITY
    masses: FloatArray | None = None
    centres: FloatArray | None = None
    approach: FloatArray | None = None
    memo: Memo = field(default_factory=lambda: Memo())

    def __post_init__(self) -> None:
        n = len(self.axes)
        for term in self.numbers:
            self._check(term, n)
        if not np.isfinite(list(self.numbers.values())).all():
            raise ArgumentError("laws of joints: their numbers must be finite")
        if self._pulled and not float(np.linalg.norm(self.gravity)) > 0.0:
            raise ArgumentError("gravity: must have a direction, found 0 0 0")

    def _check(self, term: Term, n: int) -> None:
        revolute = self.kinds[term.joint] == "revolute"
        if term.kind in ("sag", "compliance") and not revolute:
            raise ArgumentError(f"{term.name}: joint {term.joint + 1} slides, no moment turns it")
        if term.kind == "sag" and not term.joint <= int(term.of) // 3 < n:
            raise ArgumentError(f"{term.name}: the link must be behind the joint, one of {n}")
        if term.kind == "compliance" and (self.masses is None or self.centres is None):
            raise ArgumentError(f"{term.name}: needs the mass and the centre of each link")
        if term.kind == "compliance" and "prismatic" in self.kinds:
            raise ArgumentError(f"{term.name}: is that of an arm with turning joints alone")
        if term.kind in ("cos", "sin") and not term.of > 0:
            raise ArgumentError(f"{term.name}: the waves must be above 0")
        if term.kind == "coupling":
            if not 0 <= term.of < n or term.of == term.joint:
                raise ArgumentError(f"{term.name}: the other joint must be another one of {n}")
            if self.kinds[int(term.of)] != self.kinds[term.joint]:
                raise ArgumentError(f"{term.name}: joints must both turn, or both slide")

    @cached_property
    def terms(self) -> tuple[Term, ...]:
        """Its numbers, joint by joint."""
        return tuple(sorted(self.numbers, key=lambda t: (t.joint, KINDS.index(t.kind), t.of)))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of its numbers, k."""
        return tuple(term.name for term in self.terms)

    @property
    def units(self) -> tuple[Unit, ...]:
        """Their units."""
        return tuple(self._unit(term) for term in self.terms)

    def _unit(self, term: Term) -> Unit:
        if term.kind == "compliance":
            return "rad/(N mm)"
        if term.kind == "coupling":
            return "1"
        return "rad" if self.kinds[term.joint] == "revolute" else "mm"

    @cached_property
    def values(self) -> FloatArray:
        """Its numbers (k,)."""
        return np.array([self.numbers[term] for term in self.terms])

    def with_values(self, values: FloatArray) -> JointLaws:
        """Other numbers (k,), in the same order."""
        return replace(self, numbers=dict(zip(self.terms, values.tolist(), strict=True)))

    def with_terms(self, terms: Iterable[Term]) -> JointLaws:
        """With these numbers beside its own, 0 where they are new."""
        numbers = dict.fromkeys(terms, 0.0) | dict(self.numbers)
        return replace(self, numbers=numbers, memo=Memo())

    def approaching(self, approach: FloatArray) -> JointLaws:
        """With joints that come from there, (n,) or (N, n)."""
        return replace(self, approach=approach, memo=Memo())

    # what joints add ------------------------------------------------------------------------------

    def moved(self, theta: FloatArray) -> FloatArray:
        """Where joints (N, n) are that are commanded to `theta` (N, n)."""
        found: FloatArray = theta.copy()
        np.add.at(found.T, self._joint, (self.basis(theta) * self.values).T)
        return found

    def basis(self, theta: FloatArray) -> FloatArray:
        """φ of each number, (N, k)."""
        known = self.memo.of(theta)
        if known is None:
            known = self._basis(theta)
            self.memo.keep(theta, known)
        return known

    def _basis(self, theta: FloatArray) -> FloatArray:
        found = np.zeros((len(theta), len(self.terms)))
        products = self._products(theta) if self._pulled else None
        for c, (joint, kind, of) in enumerate(self.terms):
            match kind:
                case "sag":
                    assert products is not None
                    found[:, c] = products[:, joint, int(of) // 3, int(of) % 3]
                case "compliance":
                    assert products is not None
                    behind = products[:, joint, joint:], self._moments[joint:]
                    found[:, c] = np.einsum("nle,le->n", *behind)
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
        if self._pulled:
            found += self._turning(theta)
        return found

    @property
    def _n(self) -> int:
        return len(self.axes)

    @cached_property
    def _joint(self) -> IntArray:
        return np.array([term.joint for term in self.terms], dtype=np.intp)

    @cached_property
    def _pulled(self) -> bool:
        """Whether gravity matters."""
        return any(term.kind in ("sag", "compliance") for term in self.numbers)

    def _from(self, joint: int) -> FloatArray:
        assert self.approach is not None
        found: FloatArray = self.approach[..., joint]
        return found

    @cached_property
    def _direction(self) -> FloatArray:
        found: FloatArray = np.array(self.gravity) / np.linalg.norm(self.gravity)
        return found

    @cached_property
    def _moments(self) -> FloatArray:
        """Moments of the links times gravity, (n, 3) N mm, as `weights.link_moments` has them."""
        assert self.masses is not None and self.centres is not None
        behind = self.masses.sum() - np.cumsum(self.masses)
        found = self.masses[:, None] * (self.centres - self.points)
        found[:-1] += behind[:-1, None] * (self.points[1:] - self.points[:-1])
        moments: FloatArray = found * np.linalg.norm(self.gravity)
        return moments

    def _turned(self, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Rotations of the links (N, n, 3, 3), and axes of the joints (N, n, 3) as they stand."""
        count, n = theta.shape
        revolute = np.array([kind == "revolute" for kind in self.kinds])
        twists = np.zeros((count, n, 6))
        twists[..., :3] = (theta * revolute)[..., None] * self.axes
        turns = screws.exp(twists.reshape(-1, 6)).reshape(count, n, 4, 4)[..., :3, :3]
        rotation = np.empty_like(turns)
        before: FloatArray = np.broadcast_to(np.eye(3), (count, 3, 3))
        for i in range(n):
            before = before @ turns[:, i]
            rotation[:, i] = before
        return rotation, np.einsum("nijk,ik->nij", rotation, self.axes)

    def _products(self, theta: FloatArray) -> FloatArray:
        """Of joint i by link l, as `weights.gravity_products`, (N, n, n, 3).

        Of the arm without joint errors; links before a joint are not left out.
        """
        rotation, axes = self._turned(theta)
        across = np.cross(self._direction, axes)
        found: FloatArray = np.einsum("nlkj,nik->nilj", rotation, across)
        return found

    @cached_property
    def _sags(self) -> FloatArray:
        """Moments of the links that turn each joint, (n, n, 3), times what they turn it."""
        found = np.zeros((self._n, self._n, 3))
        for (joint, kind, of), value in zip(self.terms, self.values.tolist(), strict=True):
            if kind == "sag":
                found[joint, int(of) // 3, int(of) % 3] += value
            elif kind == "compliance":
                found[joint, joint:] += value * self._moments[joint:]
        return found

    def _turning(self, theta: FloatArray) -> FloatArray:
        """How sag changes with the commands, (N, n, n): moments and axes turn with joints."""
        rotation, axes = self._turned(theta)
        n, g = self._n, self._direction
        revolute = np.array([kind == "revolute" for kind in self.kinds])
        moments = np.einsum("nlab,ilb->nila", rotation, self._sags)
        found = np.zeros((len(theta), n, n))
        for j in np.flatnonzero(revolute).tolist():
            z = axes[:, j, None]
            behind = np.cross(z, moments[:, :, j:].sum(axis=2))  # links behind the joint turn
            found[:, :, j] = (behind * np.cross(g, axes)).sum(axis=2)
            carried = np.cross(z, axes[:, j + 1 :])  # so do the axes behind it
            whole = moments[:, j + 1 :].sum(axis=2)
            found[:, j + 1 :, j] += (whole * np.cross(g, carried)).sum(axis=2)
        return found
