"""What is emitted of limbs: the functions of every axis, driver and row that `limbs` declares."""

from __future__ import annotations

import sympy as sp

from .emit import Function
from .limbs import (
    AXES,
    CONSTANTS,
    CONSTRAINTS,
    DRIVERS,
    Axis,
    Constraint,
    Driver,
    LimbFunction,
)
from .rotation import skew


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


def _anchor(driver: Driver) -> Function:
    """The anchor from the driver's two prepared directions."""
    f = LimbFunction(
        f"{driver.name}_anchor", f"{driver.name}: where the anchor stands", driver.formula
    )
    qt = f.scalar("qt", "q̃ [mm or rad]")
    f.numbers()
    first, second = directions(f)
    moved = driver.moved(qt, first, second, lambda angle: f.sincos("q", angle))
    f.output("c", f.base + moved if driver.moves else f.base, "anchor [mm]")
    return f


def directions(f: Function) -> tuple[sp.Matrix, sp.Matrix]:
    """Declare the two directions in which an anchor moves, as `_prepare` has them."""
    return f.vector("first", 3, "s, or crank e"), f.vector("second", 3, "0, or crank axis × e")


def _radius(driver: Driver) -> Function:
    """The length of the limb."""
    f = LimbFunction(f"{driver.name}_radius", f"{driver.name}: the limb's length", driver.formula)
    qt = f.scalar("qt", "q̃ [mm or rad]")
    f.numbers()
    f.output("rho", qt if driver.stretches else f.g["rod"], "ρ [mm]")
    return f


def carry(driver: Driver) -> Function:
    """What a row that pulls at the anchor asks of the actuator and of the limb's numbers."""
    f = LimbFunction(
        f"{driver.name}_carry",
        f"{driver.name}: covector of the anchor to covectors of q and the limb's numbers",
        f"λ·∂c,  {driver.formula}\nq̃ = gain q + offset",
    )
    q = f.scalar("q", "actuator coordinate [mm or rad]")
    f.numbers()
    pull = f.vector("pull", 3, "λ, covector of the anchor")
    if not driver.moves:  # every driver takes the same arguments
        f.matrix("F", "fixed frame of the axis, in the base, row by row")
    qt = f.let("qt", f.drive(q), "q̃")
    c, _ = driver.anchor(f, qt)
    work = f.let("work", pull.dot(c))
    f.output("by_q", f.gradient(work, [q])[0], "λ·∂c/∂q")
    f.output("by_g", f.gradient(work, f.g.values()), "λ·∂c/∂(the limb's numbers)", CONSTANTS)
    return f


def _prepare(driver: Driver) -> Function:
    """The two directions an anchor moves in, of the numbers alone: once per geometry."""
    f = LimbFunction(
        f"{driver.name}_directions",
        f"{driver.name}: the directions the anchor moves in",
        driver.formula,
    )
    f.numbers()
    first, second = driver.directions(f, f.base_axes())
    f.output("first", first, "s, or crank e")
    f.output("second", second, "0, or crank axis × e")
    return f


def _inverse(driver: Driver) -> Function:
    """q̃ from the joint h = p + R b - base in closed form; NaN where the limb cannot reach."""
    f = LimbFunction(
        f"{driver.name}_inverse",
        f"{driver.name}: actuator coordinate at a joint position",
        driver.inverse_formula,
    )
    f.numbers()
    h = f.vector("h", 3, "p + R b - base [mm]")
    first, second = directions(f)
    branch = f.scalar("branch", "sign of d·∂c/∂q̃, where there are two")
    f.output("qt", driver.inverse(f, h, first, second, branch), f"q̃ [{driver.unit}]")
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
    if not driver.moves:  # every driver takes the same arguments
        f.matrix("F", "fixed frame of the axis, in the base, row by row")
    qt = f.let("qt", f.drive(q), "q̃")
    c, rho = driver.anchor(f, qt)
    d = f.let("d", f.platform_joint(f.b) - c, "from the anchor to the platform joint")
    phi = _half_square(f, d, rho**2)
    f.output("by_q", f.gradient(phi, [q])[0], "∂Φ/∂q")
    f.output("by_g", f.gradient(phi, f.g.values()), "∂Φ/∂(the limb's numbers)", CONSTANTS)
    return f


def _constraint(row: Constraint, known_axes: bool) -> Function:
    """A constraint at a known anchor; with known axes it is what Newton iterates on."""
    f = LimbFunction(f"{row.name}_{'row' if known_axes else 'derivatives'}",
                     f"{row.name}: {row.title}", f"{row.formula},  d = p + R b - c")  # fmt: skip
    f.pose()
    n, a = sp.zeros(3, 1), sp.zeros(3, 1)
    if known_axes:
        b = f.vector("b", 3, "platform joint, platform frame [mm]")
    c = f.vector("c", 3, "anchor [mm]")
    if known_axes:
        n = f.vector("n", 3, "base-side axis, base frame")
        a = f.vector("a", 3, "platform-side axis, platform frame")
    else:
        f.numbers()
        b = f.b
        F = f.matrix("F", "fixed frame of the base-side axis, in the base, row by row")
        P = f.matrix("P", "fixed frame of the platform-side axis, in the platform, row by row")
        if row.on_base:
            n = f.let("n", f.axes(row.on_base, F, "u").col(2), "base-side axis")
        if row.on_platform:
            a = f.let("a", f.axes(row.on_platform, P, "w").col(2), "platform-side axis")
    lever = f.scalar("lever", "λ [mm]")
    d = f.let("d", f.platform_joint(b) - c, "from the anchor to the platform joint")
    if row.on_platform:
        a = f.let("Ra", f.R * a)
        a = f.let("turned", a + skew(f.omega) * a)
    phi = row.phi(d, n, a, lever)
    if known_axes:
        f.output("phi", phi, "Φ [mm]")
        f.output("omega", f.gradient(phi, f.omega), "∂Φ/∂ω")
        f.output("v", f.gradient(phi, f.v), "∂Φ/∂v")
    else:
        f.output("v", f.gradient(phi, f.v), "∂Φ/∂v = -∂Φ/∂c")
        by_g = f.gradient(phi, f.g.values())
        f.output("by_g", by_g, "∂Φ/∂(the limb's numbers), c held", CONSTANTS)
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
        n, a = moving("n", "base-side axis"), f.R * moving("a", "platform-side axis")
        lever = f.scalar("lever", "λ")
        phi = row.phi(f.let("d", d), n, a, lever)
    f.output("rate", f.gradient(phi, [s])[0], "Φ's rate")
    return f


def _axis(axis: Axis) -> Function:
    """The third axis of a tilted frame: once per geometry."""
    f = LimbFunction(f"{axis.name}_axis", f"{axis.name} axis of a limb",
                     "frame Rx(tilt1) Ry(tilt2) ez")  # fmt: skip
    f.numbers()
    frame = f.matrix("F", "fixed frame of the axis, row by row")
    f.output("axis", f.axes(axis, frame, "u").col(2), "as its frame")
    return f


def functions() -> list[Function]:
    """The emitted functions of every driver and row."""
    made = [*_basics(), _sphere(), *map(_axis, AXES)]
    for step in (_prepare, _anchor, _radius, _inverse, _derivatives, carry):
        made += [step(driver) for driver in DRIVERS]
    made += [_constraint(row, known) for row in CONSTRAINTS for known in (True, False)]
    return made + [_moving(row) for row in (None, *CONSTRAINTS)]
