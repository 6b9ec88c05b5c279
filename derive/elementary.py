"""Sine, cosine, arctangent and logarithm as polynomials: the same bits on every processor.

The C library's functions differ between platforms and cannot be run in lanes. The coefficients
are near-minimax fits, computed with 60 digits and rounded once.
"""

from __future__ import annotations

import mpmath as mp

# function, ends of x², coefficients, C name, what is fitted
_FITS = (
    ("SIN", 0.0, "(pi/4)**2", 6, "(sin(x)/x - 1)/x²,  |x| <= π/4"),
    ("COS", 0.0, "(pi/4)**2", 6, "((cos(x) - 1)/x² + 1/2)/x²,  |x| <= π/4"),
    ("ATAN", 0.0, "tan(pi/8)**2", 11, "(atan(x)/x - 1)/x²,  |x| <= tan(π/8)"),
    ("ATANH", 0.0, "tan(pi/8)**4", 7, "(artanh(x)/x - 1)/x²,  |x| <= tan(π/8)² = 3 - √8"),
)


def _fitted(name: str, square: mp.mpf) -> mp.mpf:
    """The even function of x that the polynomial in x² stands for, near zero by its series."""
    signs = [mp.mpf(-1) ** k for k in range(1, 40)]
    if square < mp.mpf("0.01"):
        if name == "SIN":
            return mp.fsum(s * square ** (k - 1) / mp.factorial(2 * k + 1)
                           for k, s in enumerate(signs, 1))  # fmt: skip
        if name == "COS":
            return mp.fsum(-s * square ** (k - 1) / mp.factorial(2 * k + 2)
                           for k, s in enumerate(signs, 1))  # fmt: skip
        if name == "ATANH":
            return mp.fsum(square ** (k - 1) / (2 * k + 1) for k, _ in enumerate(signs, 1))
        return mp.fsum(s * square ** (k - 1) / (2 * k + 1) for k, s in enumerate(signs, 1))
    x = mp.sqrt(square)
    if name == "SIN":
        return (mp.sin(x) / x - 1) / square
    if name == "COS":
        return ((mp.cos(x) - 1) / square + mp.mpf(1) / 2) / square
    return ((mp.atanh if name == "ATANH" else mp.atan)(x) / x - 1) / square


def polynomials() -> dict[str, tuple[list[float], str]]:
    """Coefficients, lowest power first, of each fit, with what it stands for."""
    fits = {}
    with mp.workdps(60):
        for name, low, high, count, meaning in _FITS:
            end = eval(high, {"pi": mp.pi, "tan": mp.tan})
            fit = mp.chebyfit(lambda s, n=name: _fitted(n, s), [low, end], count)
            fits[name] = ([float(c) for c in reversed(fit)], meaning)
    return fits


def half_pi_parts() -> list[float]:
    """π/2 as a sum of three doubles, the first two with 33 bits: exact multiples up to 2^20."""
    with mp.workdps(80):
        rest, parts = mp.pi / 2, []
        for bits in (33, 33, 53):
            scale = mp.mpf(2) ** (bits - 1 - int(mp.floor(mp.log(abs(rest), 2))))
            part = mp.nint(rest * scale) / scale
            parts.append(float(part))
            rest -= part
    return parts


def emit() -> str:
    """The C constants."""
    lines = []
    for name, (coefficients, meaning) in polynomials().items():
        lines.append(f"/* {meaning}, as a polynomial in x² */")
        lines += [f"#define {name}_{i} {c.hex()}" for i, c in enumerate(coefficients)]
        lines.append("")
    with mp.workdps(60):
        named = {"TWO_OVER_PI": 2 / mp.pi, "QUARTER_PI": mp.pi / 4, "HALF_PI": mp.pi / 2,
                 "PI": mp.pi, "TWO_PI": 2 * mp.pi, "TAN_PI_8": mp.tan(mp.pi / 8),
                 "SQRT_HALF": mp.sqrt(mp.mpf(1) / 2), "LN_2": mp.log(2)}  # fmt: skip
        lines += [f"#define {name} {float(value).hex()}" for name, value in named.items()]
    lines.append("/* π/2 in three parts; k times the first two is exact for |k| < 2^20 */")
    lines += [f"#define HALF_PI_PART{i} {part.hex()}" for i, part in enumerate(half_pi_parts())]
    return "\n".join([*lines, ""])
