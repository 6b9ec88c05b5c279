"""Limbs: a driver (actuator coordinate to anchor c and length ρ) and rows (closures).

Throughout, d = p + R b - c runs from the anchor to the platform joint, and q̃ = gain q + offset.
At a given q every limb is the same sphere row ‖d‖ = ρ, whatever drives it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import sympy as sp

from .emit import Function
from .rotation import rot_x, rot_y, skew

# The numbers of one limb, in the order of the core. Lengths in mm, tilts in rad.
SLOTS = (
    "base.x", "base.y", "base.z", "platform.x", "platform.y", "platform.z",
    "offset", "gain", "rod", "crank", "tilt1", "tilt2", "platform_tilt1", "platform_tilt2",
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

    def base_axes(self) -> sp.Matrix:
        """Frame of slider, crank axis, base-plane normal or universal joint, tilts applied."""
        F = self.matrix("F", "fixed frame of the axis, in the base, row by row")
        return self.tilted(F, self.g["tilt1"], self.g["tilt2"], "u")

    def platform_axes(self) -> sp.Matrix:
        """Frame of the platform's revolute joint, tilts applied."""
        P = self.matrix("P", "fixed frame of the revolute axis, in the platform, row by row")
        return self.tilted(P, self.g["platform_tilt1"], self.g["platform_tilt2"], "w")

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


@dataclass(frozen=True)
class Driver:
    """How the actuator coordinate q̃ moves the anchor and sets the length."""

    name: str
    formula: str
    anchor: Callable[[LimbFunction, sp.Expr], tuple[sp.Matrix, sp.Expr]]


def _length(f: LimbFunction, qt: sp.Expr) -> tuple[sp.Matrix, sp.Expr]:
    return f.base, qt


def _slider(f: LimbFunction, qt: sp.Expr) -> tuple[sp.Matrix, sp.Expr]:
    s = f.let("s", f.base_axes().col(2), "slider direction")
    return f.base + qt * s, f.g["rod"]


def _crank(f: LimbFunction, qt: sp.Expr) -> tuple[sp.Matrix, sp.Expr]:
    axes = f.base_axes()
    e, n = f.let("e", axes.col(0), "crank at q̃ = 0"), f.let("n", axes.col(1), "and at q̃ = 90°")
    sq, cq = f.sincos("q", qt)
    return f.base + f.g["crank"] * (cq * e + sq * n), f.g["rod"]


LENGTH = Driver("length", "c = base, ρ = q̃", _length)
SLIDER = Driver("slider", "c = base + q̃ s, ρ = rod", _slider)
CRANK = Driver("crank", "c = base + crank Rot(axis, q̃) e, ρ = rod", _crank)
DRIVERS = (LENGTH, SLIDER, CRANK)


def _half_square(f: LimbFunction, d: sp.Matrix, rho2: sp.Expr) -> sp.Expr:
    """(d·d - ρ²)/2, with the half on a line of its own (SymPy would distribute it)."""
    return f.let("square", d.dot(d) - rho2) / 2


def _sphere() -> Function:
    """Φ = (‖d‖² - ρ²)/2 at a known anchor: the row of every limb inside Newton."""
    f = LimbFunction("sphere_row", "closure of one limb at a known anchor",
                     "Φ = (d·d - ρ²)/2,  d = p + R b - c\n∂Φ/∂v = d,  ∂Φ/∂ω = R b × d")  # fmt: skip
    f.pose()
    b = f.vector("b", 3, "platform joint, platform frame [mm]")
    c = f.vector("c", 3, "anchor, base frame [mm]")
    rho2 = f.scalar("rho2", "ρ² [mm²]")
    d = f.let("d", f.platform_joint(b) - c, "from the anchor to the platform joint")
    phi = _half_square(f, d, rho2)
    f.output("phi", phi, "Φ [mm²]")
    f.output("omega", f.gradient(phi, f.omega), "∂Φ/∂ω [mm²/rad]")
    f.output("v", f.gradient(phi, f.v), "∂Φ/∂v [mm]")
    return f


def _basics() -> list[Function]:
    """The affine pieces: joint position, drive and command."""
    joint = LimbFunction(
        "limb_joint", "from the base point to the platform joint", "h = p + R b - base"
    )
    joint.pose()
    b = joint.vector("b", 3, "platform joint, platform frame [mm]")
    base = joint.vector("base", 3, "base point [mm]")
    joint.output("h", joint.platform_joint(b) - base, "base frame [mm]")

    drive = LimbFunction(
        "limb_drive", "an actuator's command as the limb sees it", "q̃ = gain q + offset"
    )
    q = drive.scalar("q", "actuator coordinate [mm or rad]")
    drive.numbers()
    drive.output("qt", drive.drive(q), "q̃ [mm or rad]")

    command = LimbFunction("limb_command", "the command that gives q̃", "q = (q̃ - offset)/gain")
    qt = command.scalar("qt", "q̃ [mm or rad]")
    per_gain = command.scalar("per_gain", "1/gain, once per geometry: divisions are slow")
    command.numbers()
    q = sp.Symbol("q")
    solved = sp.solve(command.drive(q) - qt, q)[0]
    command.output("q", solved * command.g["gain"] * per_gain, "actuator coordinate [mm or rad]")
    return [joint, drive, command]


def _anchor(driver: Driver) -> Function | None:
    """Anchor of a slider or crank from its two prepared directions."""
    if driver is LENGTH:
        return None
    f = LimbFunction(
        f"{driver.name}_anchor", f"{driver.name}: where the anchor stands", driver.formula
    )
    qt = f.scalar("qt", "q̃ [mm or rad]")
    base = f.vector("base", 3, "base point [mm]")
    first = f.vector("first", 3, "s, or crank e")
    if driver is SLIDER:
        f.output("c", base + qt * first, "anchor [mm]")
    else:
        second = f.vector("second", 3, "crank axis × e")
        sq, cq = f.sincos("q", qt)
        f.output("c", base + cq * first + sq * second, "anchor [mm]")
    return f


def _prepare(driver: Driver) -> Function | None:
    """The two directions an anchor moves in, of the numbers alone: once per geometry."""
    if driver is LENGTH:
        return None
    f = LimbFunction(
        f"{driver.name}_directions",
        f"{driver.name}: the directions the anchor moves in",
        driver.formula,
    )
    f.numbers()
    axes = f.base_axes()
    first, second = (axes.col(2), sp.zeros(3, 1)) if driver is SLIDER else (
        f.g["crank"] * axes.col(0), f.g["crank"] * axes.col(1))  # fmt: skip
    f.output("first", first, "s, or crank e")
    f.output("second", second, "0, or crank axis × e")
    return f


def _inverse(driver: Driver) -> Function:
    """q̃ from the joint h = p + R b - base in closed form; NaN where the limb cannot reach."""
    formulas = {
        LENGTH: "q̃ = ‖h‖",
        SLIDER: "q̃ = h·s - branch √(rod² - ‖h - (h·s) s‖²)",
        CRANK: "h·(cos q̃ e + sin q̃ n) = κ = (h·h + crank² - rod²)/(2 crank)\n"
        "q̃ = atan2(h·n, h·e) - branch atan2(√((h·e)² + (h·n)² - κ²), κ)",
    }
    f = LimbFunction(
        f"{driver.name}_inverse",
        f"{driver.name}: actuator coordinate at a joint position",
        formulas[driver],
    )
    f.numbers()
    h = f.vector("h", 3, "p + R b - base [mm]")
    if driver is LENGTH:
        f.output("qt", sp.sqrt(h.dot(h)), "q̃ [mm]")
        return f
    first = f.vector("first", 3, "s, or crank e")
    if driver is SLIDER:
        branch = f.scalar("branch", "sign of d·∂c/∂q̃")
        along = f.let("along", h.dot(first))
        across = f.let("across", h - along * first)
        root = f.let("root", sp.sqrt(f.g["rod"] ** 2 - across.dot(across)))
        f.output("qt", along - branch * root, "q̃ [mm]")
        return f
    second = f.vector("second", 3, "crank axis × e")
    branch = f.scalar("branch", "sign of d·∂c/∂q̃")
    # both sides times the crank's length, which scales the two atan2 arguments alike
    x, y = f.let("x", h.dot(first)), f.let("y", h.dot(second))
    twice = f.let("twice", h.dot(h) + f.g["crank"] ** 2 - f.g["rod"] ** 2)
    kappa = f.let("kappa", twice / 2)
    root = f.let("root", sp.sqrt(x**2 + y**2 - kappa**2))
    side = f.let("side", branch * root)
    f.output("sine", sp.Matrix([y * kappa - x * side]), "of q̃, up to a positive factor")
    f.output("cosine", sp.Matrix([x * kappa + y * side]), "of q̃")
    return f


def _derivatives(driver: Driver) -> Function:
    """The sphere row's derivatives by q and by the limb's numbers (by twist: `sphere_row`)."""
    f = LimbFunction(
        f"{driver.name}_derivatives",
        f"{driver.name}: the sphere row by q and numbers",
        f"Φ = (d·d - ρ²)/2,  d = p + R b - c,  {driver.formula}\nq̃ = gain q + offset",
    )
    f.pose()
    q = f.scalar("q", "actuator coordinate [mm or rad]")
    f.numbers()
    qt = f.let("qt", f.drive(q), "q̃")
    c, rho = driver.anchor(f, qt)
    d = f.let("d", f.platform_joint(f.b) - c, "from the anchor to the platform joint")
    phi = _half_square(f, d, rho**2)
    f.output("by_q", f.gradient(phi, [q])[0], "∂Φ/∂q")
    f.output("by_g", f.gradient(phi, f.g.values()), "∂Φ/∂(the limb's numbers)", CONSTANTS)
    return f


@dataclass(frozen=True)
class Constraint:
    """A closure beside the sphere: a scalar product of d and axes that must vanish.

    `phi` takes the function, d, the base-side axis n and the platform-side axis R a.
    """

    name: str
    title: str
    formula: str
    on_base: bool
    on_platform: bool
    phi: Callable[[sp.Matrix, sp.Matrix, sp.Matrix, sp.Expr], sp.Expr]


CONSTRAINTS = (
    Constraint("base_plane", "the platform joint stays in a plane of the base", "Φ = n·d",
               True, False, lambda d, n, a, lever: n.dot(d)),
    Constraint("platform_plane", "the leg stays square to the platform's revolute axis",
               "Φ = (R a)·d", False, True, lambda d, n, a, lever: a.dot(d)),
    Constraint("couple", "revolute and universal axis stay square, at the lever λ",
               "Φ = λ (R a)·n", True, True, lambda d, n, a, lever: lever * a.dot(n)),
)  # fmt: skip


def _constraint(row: Constraint, known_axes: bool) -> Function:
    """A constraint of a length-driven limb; with known axes it is what Newton iterates on."""
    f = LimbFunction(f"{row.name}_{'row' if known_axes else 'derivatives'}",
                     f"{row.name}: {row.title}", f"{row.formula},  d = p + R b - base")  # fmt: skip
    f.pose()
    n, a = sp.zeros(3, 1), sp.zeros(3, 1)
    if known_axes:
        b = f.vector("b", 3, "platform joint, platform frame [mm]")
        base = f.vector("c", 3, "base joint [mm]")
        if row.on_base:
            n = f.vector("n", 3, "base-side axis, base frame")
        if row.on_platform:
            a = f.vector("a", 3, "platform-side axis, platform frame")
    else:
        f.numbers()
        b, base = f.b, f.base
        if row.on_base:
            n = f.let("n", f.base_axes().col(2), "base-side axis")
        if row.on_platform:
            a = f.let("a", f.platform_axes().col(2), "platform-side axis")
    lever = f.scalar("lever", "λ [mm]") if row.name == "couple" else sp.S.One
    d = f.let("d", f.platform_joint(b) - base, "from the base joint to the platform joint")
    if row.on_platform:
        a = f.let("Ra", f.R * a)
        a = f.let("turned", a + skew(f.omega) * a)
    phi = row.phi(d, n, a, lever)
    if known_axes:
        f.output("phi", phi, "Φ [mm]")
        f.output("omega", f.gradient(phi, f.omega), "∂Φ/∂ω")
        f.output("v", f.gradient(phi, f.v), "∂Φ/∂v")
    else:
        f.output("by_g", f.gradient(phi, f.g.values()), "∂Φ/∂(the limb's numbers)", CONSTANTS)
    return f


def _moving(row: Constraint | None) -> Function:
    """The rate of a row while the limb's sphere and axes change at a held pose: for homotopies."""
    f = LimbFunction(f"{row.name if row else 'sphere'}_rate", "rate of the row as the limb changes",
                     f"{row.formula if row else 'Φ = (d·d - ρ²)/2'},  d = p + R b - c")  # fmt: skip
    s = f.perturbation("s", 1)[0]

    def moving(name: str, doc: str) -> sp.Matrix:
        return f.vector(name, 3, doc) + s * f.vector(f"{name}_rate", 3, "its rate")

    f.pose()
    d = f.p + f.R * moving("b", "platform joint") - moving("c", "anchor")
    if row is None:
        rho2 = f.scalar("rho2", "ρ²") + s * f.scalar("rho2_rate", "its rate")
        phi = _half_square(f, f.let("d", d), rho2)
    else:
        n = moving("n", "base-side axis") if row.on_base else sp.zeros(3, 1)
        a = f.R * moving("a", "platform-side axis") if row.on_platform else sp.zeros(3, 1)
        lever = f.scalar("lever", "λ") if row.name == "couple" else sp.S.One
        phi = row.phi(f.let("d", d), n, a, lever)
    f.output("rate", f.gradient(phi, [s])[0], "Φ's rate")
    return f


def _axis(name: str, where: str) -> Function:
    """The third axis of a tilted frame: once per geometry."""
    f = LimbFunction(f"{name}_axis", f"{name}-side axis of a limb", "frame Rx(tilt1) Ry(tilt2) ez")
    f.numbers()
    axes = f.base_axes() if name == "base" else f.platform_axes()
    f.output("axis", axes.col(2), where)
    return f


def functions() -> list[Function]:
    """The emitted functions of every driver and row."""
    made: list[Function | None] = [*_basics(), _sphere()]
    made += [_axis("base", "in the base"), _axis("platform", "in the platform")]
    for step in (_prepare, _anchor, _inverse, _derivatives):
        made += [step(driver) for driver in DRIVERS]
    made += [_constraint(row, known) for row in CONSTRAINTS for known in (True, False)]
    made += [_moving(row) for row in (None, *CONSTRAINTS)]
    return [f for f in made if f is not None]
