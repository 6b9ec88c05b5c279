"""Drive laws: what an actuator's reading q is as the coordinate q̃ of its driver.

In the order of a robot file: gain, quadratic, spool, then corrections at q, harmonics and a table,
then backlash and the offset, which are sums and need no formula.
"""

from __future__ import annotations

import sympy as sp

from .emit import Function


def drive() -> Function:
    """Derive the way of a drive without corrections: gain, quadratic number and spool.

    A spool of radius R that its line builds up has the radius R + u, u = c w / 2, when it has
    turned by w, and has taken up ((R + u)² - R²) / c of line. Multiplied out nothing is divided by
    c, which may be 0; a drive without a spool is one with R = 1, c = 0.
    """
    f = Function(
        "law_drive",
        "the way of a drive at its reading q, without corrections",
        "w = gain q + quadratic q²,  t = ((R + u)² - R²)/c = R w + c w²/4  with u = c w/2",
    )
    q, gain, quadratic, R, c = x = f.named("x", "01234", "q, gain, quadratic, R, c")
    w = f.let("w", gain * q + quadratic * q**2, "turn of the spool, or the way without one")
    way = R * w + c * w**2 / 4
    f.output("way", way, "t")
    f.output("by_x", f.gradient(way, x).T, "∂t by each of x")
    slope = f.gradient(way, [q])[0]
    f.output("bend", f.gradient(slope, [q])[0], "∂²t/∂q²")
    return f


def drive_inverse() -> Function:
    """Derive the reading of a drive at its way, on the branch through q = 0."""
    f = Function(
        "law_drive_inverse",
        "the reading q of a drive at its way t, without corrections; NaN beyond its turning point",
        "w = 2 t/R / (1 + √(1 + c t/R²)),  q = 2 w/gain / (1 + √(1 + 4 quadratic w/gain²))",
    )
    t, gain, quadratic, R, c = f.named("x", "01234", "t, gain, quadratic, R, c")
    w = f.let("w", 2 * t / R / (1 + sp.sqrt(1 + c * t / R**2)), "turn of the spool")
    f.output("q", 2 * w / gain / (1 + sp.sqrt(1 + 4 * quadratic * w / gain**2)), "its reading")
    return f


def harmonic() -> Function:
    """Derive an error that returns with a period, of a gear or an encoder."""
    f = Function("law_harmonic", "an error with a period", "a cos(k q) + b sin(k q)")
    q, k, a, b = f.named("x", "0123", "q, k, a, b")
    s, c = f.sincos("k", k * q)
    error = a * c + b * s
    f.output("error", error, "as the way")
    f.output("by_x", f.gradient(error, [q, a, b]).T, "by q, a and b")
    f.output("bend", f.gradient(f.gradient(error, [q])[0], [q])[0], "∂²/∂q²")
    return f


def segment() -> Function:
    """Derive the correction of a table between two of its places."""
    f = Function(
        "law_segment",
        "the correction of a table between two places",
        "y0 + (q - q0)/(q1 - q0) (y1 - y0)",
    )
    q, q0, q1, y0, y1 = f.named("x", "01234", "q, q0, q1, y0, y1")
    part = f.let("part", (q - q0) / (q1 - q0))
    error = y0 + part * (y1 - y0)
    f.output("error", error, "as the way")
    f.output("by_x", f.gradient(error, [q, y0, y1]).T, "by q, y0 and y1")
    return f


def functions() -> list[Function]:
    """The emitted functions of drive laws."""
    return [drive(), drive_inverse(), harmonic(), segment()]
