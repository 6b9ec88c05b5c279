"""2TPR&2TPS in closed form, from eq. 1 to eq. 12 of paper A: one function per equation.

Limbs come in pairs that differ in the sign n of a y coordinate (eq. 9): 1 and 2 stand at the
front (S1, S2), 3 and 4 at the platform's origin (R2, R1). Each formula is derived once a pair.
"""

from __future__ import annotations

from functools import cache

import sympy as sp

from .emit import Function
from .rotation import rpy

SIZE = a, b, c, d, e, f = sp.symbols("a b c d e f", positive=True)  # mm
POSE = x, y, z, alpha, beta, gamma = sp.symbols("x y z alpha beta gamma", real=True)  # mm, rad
FREE = (y, z, alpha, beta)
n = sp.Symbol("n", real=True)  # n_i, which is +1 or -1
SIGNS = (1, -1, 1, -1)  # eq. 9
FRONT, BACK = 0, 1  # the pairs
PAIRS = (FRONT, FRONT, BACK, BACK)  # of limbs 1 to 4

ORIGIN = sp.Matrix([x, y, z])  # o1 in the base
R = rpy(alpha, beta, gamma)  # eq. 1

# what the C calls the sines and cosines, 1/cos β and tan β
sa, ca, sb, cb, k, tb = sp.symbols("sa ca sb cb k tb", real=True)
MEANING = {
    sa: sp.sin(alpha),
    ca: sp.cos(alpha),
    sb: sp.sin(beta),
    cb: sp.cos(beta),
    k: 1 / sp.cos(beta),
    tb: sp.tan(beta),
}


def joints(pair: int) -> tuple[sp.Matrix, sp.Matrix]:
    """Eq. 2: T_i in the base and S_i (R2, R1 of the pair at the back) in the platform."""
    if pair == FRONT:
        return sp.Matrix([d, -n * e / 2, 0]), sp.Matrix([a, -n * b / 2, 0])
    return sp.Matrix([0, n * f / 2, 0]), sp.Matrix([0, n * c / 2, 0])


def midpoint() -> sp.Matrix:
    """Eq. 5: s12, half way between S1 and S2, in the base."""
    _, S = joints(FRONT)
    return R * (S.subs(n, 1) + S.subs(n, -1)) / 2 + ORIGIN


def right_angles() -> sp.Matrix:
    """Eq. 4, left side less right side: T_i s12 is the hypotenuse over T_i o1 and o1 s12."""
    T, _ = joints(BACK)
    legs = [ORIGIN - T, midpoint() - ORIGIN]
    hypotenuse = midpoint() - T
    closure = sum(leg.dot(leg) for leg in legs) - hypotenuse.dot(hypotenuse)
    return sp.Matrix([sp.expand(closure.subs(n, sign)) for sign in (-1, 1)])  # T4, T3


def decoupled() -> tuple[sp.Expr, sp.Expr]:
    """Eq. 6: difference and sum of the two lines of eq. 4, without their constant factors."""
    fourth, third = right_angles()
    return sp.cancel((third - fourth) / (2 * a * f)), sp.cancel((third + fourth) / (-4 * a))


def coupling() -> dict[sp.Symbol, sp.Expr]:
    """Eq. 7: γ = 0 and x = z tan β, the root of eq. 6 with the platform facing the front."""
    turn, lean = decoupled()
    facing = next(root for root in sp.solve(turn, gamma) if sp.cos(root) > 0)
    (lean_x,) = sp.solve(lean.subs(gamma, facing), x)
    return {gamma: facing, x: lean_x}


def leg(pair: int) -> tuple[sp.Matrix, sp.Matrix]:
    """Eq. 3: the two parts of u_i - T_i = (o1 - T_i) + R S_i, whose norm is L_i."""
    T, S = joints(pair)
    return ORIGIN - T, R * S


@cache
def squared_length(pair: int) -> sp.Expr:
    """Eq. 8: L_i² of eq. 3 with eq. 7 put in; the square in z tan β - d is left closed."""
    reach, turned = (part.subs(coupling()) for part in leg(pair))
    total = reach.dot(reach) + 2 * reach.dot(turned) + turned.dot(turned)
    return reach[0] ** 2 + _sorted_out(total - reach[0] ** 2)


def slopes(pair: int) -> sp.Matrix:
    """Eq. 12 without its denominator: the row ∂(L_i²)/∂(y, z, α, β), which is 2 L_i J_i."""
    square = squared_length(pair)
    return sp.Matrix([[_sorted_out(sp.diff(square, u)) for u in FREE]])


def jacobian(pair: int) -> sp.Matrix:
    """Eq. 12: the row J_i1 … J_i4 = ∂L_i/∂(y, z, α, β)."""
    return slopes(pair) / (2 * sp.sqrt(squared_length(pair)))


def _sorted_out(expr: sp.Expr) -> sp.Expr:
    """By powers of 1/cos β, with tan = sin/cos, sin² + cos² = 1 and n² = 1 used up."""
    polynomial = sp.expand(_named(expr).subs(tb, sb * k))
    relations = [sa**2 + ca**2 - 1, sb**2 + cb**2 - 1, k * cb - 1, n**2 - 1]
    _, rest = sp.reduced(polynomial, relations, sa, sb, ca, cb, k, n)
    return sp.collect(rest, k).xreplace(MEANING)


def _named(expr: sp.Expr) -> sp.Expr:
    """The expression in the names of `MEANING`."""
    expr = expr.replace(
        lambda part: part.is_Pow and part.base == sp.cos(beta) and part.exp.is_negative,
        lambda part: k**-part.exp,
    )
    return expr.xreplace({meaning: name for name, meaning in MEANING.items()})


class _ClosedForm(Function):
    """A function of size and free coordinates; what it computes is split by the sign n_i."""

    def coordinates(self) -> None:
        """Declare the inputs, and name the sines, cosines, 1/cos β and tan β."""
        size = self.vector("size", 6, "a b c d e f [mm]")
        free = self.vector("free", 4, "y z [mm], α β [rad]")
        self.meant = dict(zip((*SIZE, *FREE), (*size, *free), strict=True))
        self.sincos("a", free[2])
        sine, cosine = self.sincos("b", free[3])
        secant = self.let("k", 1 / cosine, "1/cos β and tan β")
        tangent = self.let("tb", sine * secant)
        ahead = self.let("ahead", free[1] * tangent - size[3], "x of o1 as seen from T1 and T2")
        self.meant[z * tb - d] = ahead

    def limbs(self, front: sp.Matrix, back: sp.Matrix, even: str, odd: str, doc: str) -> sp.Matrix:
        """The rows of limbs 1 to 4, even + n_i odd, from the rows of the two pairs."""
        rows = _named(sp.Matrix.vstack(front, back))
        plain, signed = (part.subs(sb * k, tb) for part in (rows.subs(n, 0), rows.diff(n)))
        signed = signed.applyfunc(lambda entry: sp.collect(entry, [b, c]))
        evens = self.let(even, plain.xreplace(self.meant), f"{doc} without n_i, front and back")
        odds = self.let(odd, signed.xreplace(self.meant), f"{doc} with n_i")
        of_limbs = zip(PAIRS, SIGNS, strict=True)
        return sp.Matrix.vstack(*(evens.row(i) + sign * odds.row(i) for i, sign in of_limbs))

    def squares(self) -> sp.Matrix:
        """L_i², eq. 8."""
        front, back = (sp.Matrix([[squared_length(pair)]]) for pair in (FRONT, BACK))
        return self.limbs(front, back, "even", "odd", "terms of L_i²")


def lengths() -> Function:
    """Derive the leg lengths, eq. 8."""
    made = _ClosedForm(
        "tpr2tps_lengths",
        "2TPR&2TPS: leg lengths",
        "L_i² = even + n_i odd, n = +1 -1 +1 -1, with x = z tan β, γ = 0 (A eq. 8, 9)",
    )
    made.coordinates()
    made.output("L", made.squares().applyfunc(sp.sqrt), "leg lengths [mm]")
    return made


def by_free() -> Function:
    """Derive their derivatives, eq. 12."""
    made = _ClosedForm(
        "tpr2tps_jacobian",
        "2TPR&2TPS: leg lengths by y z α β",
        "J_ij = ∂L_i/∂u_j = (∂even/∂u_j + n_i ∂odd/∂u_j)/(2 L_i) (A eq. 12)",
    )
    made.coordinates()
    halves = made.squares().applyfunc(lambda square: 1 / (2 * sp.sqrt(square)))
    r = made.let("r", halves, "1/(2 L_i)")
    rows = made.limbs(slopes(FRONT), slopes(BACK), "D_even", "D_odd", "terms of ∂L_i²")
    rows = sp.Matrix.vstack(*(rows.row(i) * r[i] for i in range(4)))
    made.output("J", rows, "∂L/∂(y z α β), row by row")
    return made


def functions() -> list[Function]:
    """The emitted closed forms, eq. 8 and eq. 12."""
    return [lengths(), by_free()]
