"""Limbs: a driver (actuator coordinate to anchor c and length ρ) and rows (closures).

Throughout, d = p + R b - c runs from the anchor to the platform joint, and q̃ = gain q + offset.
At a given q every limb is the same sphere row ‖d‖ = ρ, whatever drives it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import sympy as sp

from .emit import Function
from .rotation import rot_x, rot_y, skew


@dataclass(frozen=True)
class Axis:
    """An axis of a limb: the third column of a fixed frame, tilted by two of the limb's numbers.

    `tilts` are their slots. A row that has the axis names it; which side it is on the row says.
    """

    name: str
    tilts: tuple[str, str]


BASE = Axis("base", ("tilt1", "tilt2"))
PLATFORM = Axis("platform", ("platform_tilt1", "platform_tilt2"))
HINGE = Axis("hinge", ("hinge_tilt1", "hinge_tilt2"))
AXES = (BASE, PLATFORM, HINGE)

# The numbers of one limb, in the order of the core. Lengths in mm, tilts in rad.
SLOTS = (
    "base.x", "base.y", "base.z", "platform.x", "platform.y", "platform.z",
    "offset", "gain", "rod", "crank", *(tilt for axis in AXES for tilt in axis.tilts),
)  # fmt: skip


CONSTANTS = tuple(slot.replace(".", "_").upper() for slot in SLOTS)  # their names in C


class LimbFunction(Function):
    """A function of one limb: its numbers by name, and the pieces closures are made of."""

    def numbers(self) -> None:
        """Declare the limb's numbers and its fixed frames as inputs."""
        g = self.named("g", CONSTANTS, "the limb's numbers")
        self.g = dict(zip(SLOTS, g, strict=True))
        self.base = sp.Matrix(g[0:3])
        self.b = sp.Matrix(g[3:6])

    def tilted(self, frame: sp.Matrix, tilt1: sp.Expr, tilt2: sp.Expr, name: str) -> sp.Matrix:
        """The tilted frame, frame · Rx(tilt1) · Ry(tilt2): its third column is the axis."""
        s1, c1 = self.sincos(f"{name}1", tilt1)
        s2, c2 = self.sincos(f"{name}2", tilt2)
        return frame * rot_x(c1, s1) * rot_y(c2, s2)

    def drive(self, q: sp.Expr) -> sp.Expr:
        """q̃ = gain q + offset."""
        return self.g["gain"] * q + self.g["offset"]

    def axes(self, axis: Axis, frame: sp.Matrix, name: str) -> sp.Matrix:
        """The frame of an axis, its tilts applied."""
        first, second = axis.tilts
        return self.tilted(frame, self.g[first], self.g[second], name)

    def base_axes(self) -> sp.Matrix:
        """Frame of the slider or of the crank's axis, tilts applied."""
        F = self.matrix("F", "fixed frame of the axis, in the base, row by row")
        return self.axes(BASE, F, "u")

    def pose(self) -> None:
        """Declare R and p."""
        self.R = self.matrix("R", "platform to base, row by row")
        self.p = self.vector("p", 3, "platform origin [mm]")

    def platform_joint(self, b: sp.Matrix) -> sp.Matrix:
        """The joint p + R b, free to move by the twist (omega, v): zero in the emitted code."""
        self.omega = self.perturbation("omega", 3)
        self.v = self.perturbation("v", 3)
        r = self.let("r", self.R * b, "R b")
        return self.p + self.v + r + skew(self.omega) * r


class SinCos(Protocol):
    """Sine and cosine of an angle, as the function that is emitted has them."""

    def __call__(self, angle: sp.Expr, /) -> tuple[sp.Expr, sp.Expr]:
        """Return both."""


@dataclass(frozen=True, eq=False)
class Driver:
    """How the actuator coordinate q̃ moves the anchor and sets the length, and back.

    Nothing else in `derive/` or `csrc/` knows of a driver; one that is not whole is a TypeError.

    Attributes
    ----------
    name, unit : str
        In C, and of q̃: "mm" or "rad".
    formula, inverse_formula : str
        For the comments of what is emitted.
    anchor : callable
        Of the function that is emitted and q̃: anchor c and length ρ by the limb's numbers.
    directions : callable
        Of the same and the frame of the base axis: the two directions in which the anchor moves,
        which depend on the numbers alone; 0 where it does not move.
    moved : callable
        Of q̃, the two directions, and `SinCos`: from the base point to the anchor. A test proves it
        to be `anchor`.
    inverse : callable
        Of the function, h = p + R b - base, the two directions and the branch: q̃ in closed form,
        NaN where the limb cannot reach.
    """

    name: str
    unit: str
    formula: str
    inverse_formula: str
    anchor: Callable[[LimbFunction, sp.Expr], tuple[sp.Matrix, sp.Expr]]
    directions: Callable[[LimbFunction, sp.Matrix], tuple[sp.Matrix, sp.Matrix]]
    moved: Callable[[sp.Expr, sp.Matrix, sp.Matrix, SinCos], sp.Matrix]
    inverse: Callable[[LimbFunction, sp.Matrix, sp.Matrix, sp.Matrix, sp.Expr], sp.Expr]

    @property
    def moves(self) -> bool:
        """Whether the anchor depends on q̃."""
        return self._depends(0)

    @property
    def stretches(self) -> bool:
        """Whether the length depends on q̃."""
        return self._depends(1)

    def _depends(self, part: int) -> bool:
        f = LimbFunction("probe", "", "")
        f.numbers()
        qt = f.scalar("qt", "")
        found = f.written_out(sp.Matrix([self.anchor(f, qt)[part]]))
        return qt in found.free_symbols


def _length(f: LimbFunction, qt: sp.Expr) -> tuple[sp.Matrix, sp.Expr]:
    return f.base, qt


def _slider(f: LimbFunction, qt: sp.Expr) -> tuple[sp.Matrix, sp.Expr]:
    s = f.let("s", f.base_axes().col(2), "slider direction")
    return f.base + qt * s, f.g["rod"]


def _on_slider(
    f: LimbFunction, h: sp.Matrix, first: sp.Matrix, second: sp.Matrix, branch: sp.Expr
) -> sp.Expr:
    along = f.let("along", h.dot(first))
    across = f.let("across", h - along * first)
    root = f.let("root", sp.sqrt(f.g["rod"] ** 2 - across.dot(across)))
    return along - branch * root


def _crank(f: LimbFunction, qt: sp.Expr) -> tuple[sp.Matrix, sp.Expr]:
    axes = f.base_axes()
    e, n = f.let("e", axes.col(0), "crank at q̃ = 0"), f.let("n", axes.col(1), "and at q̃ = 90°")
    sq, cq = f.sincos("q", qt)
    return f.base + f.g["crank"] * (cq * e + sq * n), f.g["rod"]


def _turned(qt: sp.Expr, first: sp.Matrix, second: sp.Matrix, sincos: SinCos) -> sp.Matrix:
    sq, cq = sincos(qt)
    return cq * first + sq * second


def _on_crank(
    f: LimbFunction, h: sp.Matrix, first: sp.Matrix, second: sp.Matrix, branch: sp.Expr
) -> sp.Expr:
    # both sides times the crank's length, which scales the two atan2 arguments alike
    x, y = f.let("x", h.dot(first)), f.let("y", h.dot(second))
    twice = f.let("twice", h.dot(h) + f.g["crank"] ** 2 - f.g["rod"] ** 2)
    kappa = f.let("kappa", twice / 2)
    root = f.let("root", sp.sqrt(x**2 + y**2 - kappa**2))
    side = f.let("side", branch * root)
    sine = f.let("sine", y * kappa - x * side, "of q̃, up to a positive factor")
    cosine = f.let("cosine", x * kappa + y * side)
    return f.angle("turn", sine, cosine)


LENGTH = Driver(
    "length", "mm", "c = base, ρ = q̃", "q̃ = ‖h‖",
    _length,
    lambda f, axes: (sp.zeros(3, 1), sp.zeros(3, 1)),
    lambda qt, first, second, sincos: sp.zeros(3, 1),
    lambda f, h, first, second, branch: sp.sqrt(h.dot(h)),
)  # fmt: skip
SLIDER = Driver(
    "slider", "mm", "c = base + q̃ s, ρ = rod", "q̃ = h·s - branch √(rod² - ‖h - (h·s) s‖²)",
    _slider,
    lambda f, axes: (axes.col(2), sp.zeros(3, 1)),
    lambda qt, first, second, sincos: qt * first,
    _on_slider,
)  # fmt: skip
CRANK = Driver(
    "crank", "rad", "c = base + crank Rot(axis, q̃) e, ρ = rod",
    "h·(cos q̃ e + sin q̃ n) = κ = (h·h + crank² - rod²)/(2 crank)\n"
    "q̃ = atan2(h·n, h·e) - branch atan2(√((h·e)² + (h·n)² - κ²), κ)",
    _crank,
    lambda f, axes: (f.g["crank"] * axes.col(0), f.g["crank"] * axes.col(1)),
    _turned,
    _on_crank,
)  # fmt: skip
DRIVERS = (LENGTH, SLIDER, CRANK)


@dataclass(frozen=True)
class Constraint:
    """A closure beside the sphere: a scalar product of d and axes that must vanish.

    `phi` takes d, which runs from the anchor to the platform joint, the base-side axis n, the
    platform-side axis R a and the lever; `on_base` and `on_platform` are these axes, or None.
    """

    name: str
    title: str
    formula: str
    on_base: Axis | None
    on_platform: Axis | None
    phi: Callable[[sp.Matrix, sp.Matrix, sp.Matrix, sp.Expr], sp.Expr]


CONSTRAINTS = (
    Constraint("base_plane", "the platform joint stays in a plane of the base", "Φ = n·d",
               BASE, None, lambda d, n, a, lever: n.dot(d)),
    Constraint("platform_plane", "the leg stays square to the platform's revolute axis",
               "Φ = (R a)·d", None, PLATFORM, lambda d, n, a, lever: a.dot(d)),
    Constraint("couple", "revolute and universal axis stay square, at the lever λ",
               "Φ = λ (R a)·n", BASE, PLATFORM, lambda d, n, a, lever: lever * a.dot(n)),
    Constraint("hinge_plane", "the rod stays square to the axis it swings about on the carriage",
               "Φ = n·d", HINGE, None, lambda d, n, a, lever: n.dot(d)),
)  # fmt: skip


def names() -> list[str]:
    """What C calls the numbers, axes, drivers and rows of limbs, and lists of each for macros."""
    drivers = [
        f"X({driver.name.upper()}, {driver.name}, {int(driver.moves)}, {int(driver.stretches)})"
        for driver in DRIVERS
    ]
    rows, axes, rows_with_axes = [], [], []
    for row in CONSTRAINTS:
        has = [axis.name for axis in (row.on_base, row.on_platform) if axis]
        rows_with_axes.append(" ".join((row.name, *has)))
        sides = [AXES.index(axis) if axis else 0 for axis in (row.on_base, row.on_platform)]
        rows.append(f"X({row.name.upper()}, {row.name}, {sides[0]}, {sides[1]})")
    for axis in AXES:
        having = (row for row in CONSTRAINTS if axis in (row.on_base, row.on_platform))
        used = " | ".join(f"ROW_{row.name.upper()}" for row in having)
        axes.append(f"X({axis.name}, {AXES.index(axis)}, {used or 0})")
    return [
        "/* the numbers of one limb, in the order of the core */",
        "enum { " + ", ".join([*CONSTANTS, "SLOTS"]) + " };",
        f'#define SLOT_NAMES "{" ".join(SLOTS)}"',
        "/* axes: name, place, and the rows that have it */",
        f"enum {{ AXES = {len(AXES)} }};",
        f'#define AXIS_NAMES "{";".join(" ".join((axis.name, *axis.tilts)) for axis in AXES)}"',
        "#define EACH_AXIS(X) " + " ".join(axes),
        "/* drivers: does q̃ move the anchor, does it change the length? */",
        "enum { " + "".join(f"DRIVER_{driver.name.upper()}, " for driver in DRIVERS) + "DRIVERS };",
        f'#define DRIVER_NAMES "{" ".join(driver.name for driver in DRIVERS)}"',
        "#define EACH_DRIVER(X) " + " ".join(drivers),
        "/* constraint rows beside the sphere, bits of a set: the axes on base and platform */",
        *(f"#define ROW_{row.name.upper()} {1 << i}" for i, row in enumerate(CONSTRAINTS)),
        f"#define ALL_ROWS {(1 << len(CONSTRAINTS)) - 1}",
        f'#define ROW_NAMES "{";".join(rows_with_axes)}"',
        "#define EACH_ROW(X) " + " ".join(rows),
    ]
