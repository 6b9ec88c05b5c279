"""Proofs of the screw formulas, exact: at random rational points and as power series."""

from __future__ import annotations

import math
import random

import mpmath as mp
import pytest
import sympy as sp
from pkmcal.derive import screws
from pkmcal.derive.rotation import quaternion_matrix, rot_x, rot_y, rot_z, rpy, skew

FUNCTIONS = {f.name: f for f in screws.functions()}
ORDER = 9  # of the power series that are compared
t = sp.Symbol("t", real=True)
random_numbers = random.Random(7)


def rationals(count: int) -> list[sp.Rational]:
    return [sp.Rational(random_numbers.randint(-9, 9), random_numbers.randint(1, 9))
            for _ in range(count)]  # fmt: skip


def vector() -> sp.Matrix:
    return sp.Matrix(rationals(3))


def circle() -> tuple[sp.Rational, sp.Rational]:
    """A rational cosine and sine."""
    h = sp.Rational(random_numbers.randint(1, 9), random_numbers.randint(1, 9))
    return (1 - h**2) / (1 + h**2), 2 * h / (1 + h**2)


def rotation() -> sp.Matrix:
    return rot_z(*circle()) * rot_y(*circle()) * rot_x(*circle())


def motion(R: sp.Matrix, p: sp.Matrix) -> sp.Matrix:
    return sp.Matrix.vstack(sp.Matrix.hstack(R, p), sp.Matrix([[0, 0, 0, 1]]))


def generator(w: sp.Matrix, v: sp.Matrix) -> sp.Matrix:
    return sp.Matrix.vstack(sp.Matrix.hstack(skew(w), v), sp.zeros(1, 4))


def twist_of(matrix: sp.Matrix) -> sp.Matrix:
    """(ω, v) of a matrix of se(3)."""
    return sp.Matrix([matrix[2, 1], matrix[0, 2], matrix[1, 0], *matrix[:3, 3]])


def value(name: str, output: str, **given: object) -> sp.Matrix:
    """An output of an emitted function with numbers for its inputs."""
    places = {screws.SIXTH: sp.Rational(1, 6)}
    for key, entries in given.items():
        if isinstance(entries, list | sp.MatrixBase):
            places.update(
                {sp.Symbol(f"{key}[{i}]", real=True): entry for i, entry in enumerate(entries)}
            )
        else:
            places[sp.Symbol(key, real=True)] = entries
    return FUNCTIONS[name].result(output).subs(places)


def series(x: sp.Expr) -> list[sp.Expr]:
    """c0 … c5 at x, of order t², as polynomials."""
    return [
        sum((-x) ** j / sp.factorial(k + 2 * j) for j in range(ORDER // 2 + 1)) for k in range(6)
    ]


def cut(matrix: sp.Matrix) -> sp.Matrix:
    """Polynomials in t without what is beyond the order."""
    return matrix.applyfunc(
        lambda e: sum(c * t**k for (k,), c in sp.Poly(sp.expand(e), t).terms() if k < ORDER)
    )


def angle() -> tuple[sp.Matrix, list[sp.Expr]]:
    """ω of rational length θ, and c0 … c5 from θ, sin θ and cos θ, taken as independent."""
    theta = sp.Rational(random_numbers.randint(1, 20), 7)
    cosine, sine = circle()
    c1, c2 = sine / theta, (1 - cosine) / theta**2
    c3, c4 = (1 - c1) / theta**2, (sp.Rational(1, 2) - c2) / theta**2
    c5 = (sp.Rational(1, 6) - c3) / theta**2
    return sp.Matrix([1, -2, 2]) * theta / 3, [cosine, c1, c2, c3, c4, c5]


# --- functions of the angle -----------------------------------------------------------------------


def test_the_functions_of_the_angle_follow_from_two_series() -> None:
    x = t**2
    c = series(x)
    found = value("angle_near", "c", x=x, c4=c[4], c5=c[5])
    assert cut(found - sp.Matrix(c)) == sp.zeros(6, 1)


def test_away_from_zero_they_follow_from_sine_and_cosine() -> None:
    theta = sp.Symbol("theta", real=True)
    found = FUNCTIONS["angle_far"].result("c").subs(screws.SIXTH, sp.Rational(1, 6))
    for k, c in enumerate(found):
        wanted = series(theta**2)[k]
        difference = sp.series(c, theta, 0, 6).removeO() - wanted
        assert sp.Poly(sp.expand(difference) + theta**20, theta).terms()[-1][0][0] >= 6


@pytest.mark.parametrize("k", [4, 5])
def test_the_series_reach_a_double_up_to_their_end(k: int) -> None:
    coefficients = screws.series(k)
    with mp.workdps(50):
        for x in [0, 1e-3, 1, 5, screws.SERIES_END]:
            exact = mp.nsum(lambda j, x=x: (-mp.mpf(x)) ** j / mp.factorial(k + 2 * j), [0, mp.inf])
            found = mp.fsum(mp.mpf(c) * mp.mpf(x) ** j for j, c in enumerate(coefficients))
            assert abs(found / exact - 1) < 2e-16
    assert math.pi**2 < screws.SERIES_END  # every logarithm is within


# --- exponential and logarithm --------------------------------------------------------------------


def test_exp_is_the_exponential() -> None:
    w, v = vector(), vector()
    M = generator(w, v)
    wanted = sum((M**n * t**n / sp.factorial(n) for n in range(ORDER)), sp.zeros(4, 4))
    given = {"w": w * t, "v": v * t, "c": series(w.dot(w) * t**2)}
    R = value("screw_exp", "R", **given).reshape(3, 3)
    assert cut(R) == wanted[:3, :3].applyfunc(sp.expand)
    assert cut(value("screw_exp", "p", **given)) == wanted[:3, 3].applyfunc(sp.expand)


def test_the_derivative_of_exp_is_the_mean_of_its_adjoints() -> None:
    w, v = vector(), vector()
    ad = sp.Matrix(sp.BlockMatrix([[skew(w), sp.zeros(3, 3)], [skew(v), skew(w)]]))
    wanted = sum((ad**n * t**n / sp.factorial(n + 1) for n in range(ORDER)), sp.zeros(6, 6))
    given = {"w": w * t, "v": v * t, "c": series(w.dot(w) * t**2)}
    found = value("screw_exp_jacobian", "D", **given).reshape(6, 6)
    assert cut(found) == wanted.applyfunc(sp.expand)


def test_the_derivative_of_log_is_the_inverse() -> None:
    w, c = angle()
    v = vector()
    forth = value("screw_exp_jacobian", "D", w=w, v=v, c=c).reshape(6, 6)
    back = value("screw_log_jacobian", "D", w=w, v=v, c=c).reshape(6, 6)
    assert forth * back == sp.eye(6)


def test_log_undoes_the_displacement_of_exp() -> None:
    w, c = angle()
    v = vector()
    p = value("screw_exp", "p", w=w, v=v, c=c)
    assert value("screw_log", "v", w=w, p=p, c=c) == v


def test_a_rotation_gives_its_quaternion_four_times() -> None:
    q = sp.Matrix(rationals(4))
    R = quaternion_matrix(q).subs(dict(zip(q, q, strict=True)))
    square = q.dot(q)
    R = sp.eye(3) + (R - sp.eye(3)) / square
    found = value("rotation_quaternions", "K", R=R).reshape(4, 4)
    assert found == 4 * q * q.T / square


# --- motions --------------------------------------------------------------------------------------


def test_motions_compose_invert_and_move_twists_as_matrices() -> None:
    Ra, pa, Rb, pb = rotation(), vector(), rotation(), vector()
    A, B = motion(Ra, pa), motion(Rb, pb)
    given = {"Ra": Ra, "pa": pa, "Rb": Rb, "pb": pb}
    R = value("motion_compose", "R", **given).reshape(3, 3)
    assert motion(R, value("motion_compose", "p", **given)) == A * B
    undone = value("motion_invert", "I", R=Ra, p=pa).reshape(3, 3)
    assert motion(undone, value("motion_invert", "d", R=Ra, p=pa)) == A.inv()
    w, v = vector(), vector()
    moved = twist_of(A * generator(w, v) * A.inv())
    found = [value("screw_moved", name, R=Ra, p=pa, w=w, v=v) for name in ("moved_w", "moved_v")]
    assert sp.Matrix.vstack(*found) == moved
    adjoint = value("motion_adjoint", "A", R=Ra, p=pa).reshape(6, 6)
    assert adjoint * sp.Matrix([*w, *v]) == moved


def test_angles_come_back_from_their_rotation() -> None:
    for cb, sb in (circle(), (0, 1), (0, -1)):  # the last two are β = ±90°
        (ca, sa), (cg, sg) = circle(), circle()
        R = rot_z(cg, sg) * rot_y(cb, sb) * rot_x(ca, sa)
        if cb == 0:  # only α ∓ γ is one of R, and rounding decides on γ
            R[0, 0], R[1, 0] = sp.Rational(-3, 10**40), sp.Rational(2, 10**40)
        pose = value("motion_pose", "pose", R=R, p=vector()).evalf(60)
        back = rpy(*pose[3:]).evalf(60)
        assert (back - R).applyfunc(abs).norm() < 1e-38


# --- arms -----------------------------------------------------------------------------------------

ERROR = sp.Matrix([sp.Symbol(f"e[{i}]", real=True) for i in range(6)])


def error_motion() -> sp.Matrix:
    """Eq. 10 with the translations as they are meant, in symbols."""
    a, b, g = ERROR[3:]
    R = (
        rot_z(sp.cos(g), sp.sin(g)) * rot_y(sp.cos(b), sp.sin(b)) * rot_x(sp.cos(a), sp.sin(a))
    )  # fmt: skip
    return motion(R, sp.Matrix(ERROR[:3]))


def numbers() -> dict[sp.Expr, sp.Expr]:
    """Random shifts, and angles on rational points of the circle."""
    places: dict[sp.Expr, sp.Expr] = {}
    for angle in ERROR[3:]:
        cosine, sine = circle()
        places.update({sp.cos(angle): cosine, sp.sin(angle): sine})
    return places | dict(zip(ERROR[:3], rationals(3), strict=True))


def about(r: sp.Matrix) -> sp.Matrix:
    return motion(sp.eye(3), r)


def test_a_joint_error_acts_at_the_joints_point() -> None:
    r, places = vector(), numbers()
    R = value("joint_error", "R", r=r).reshape(3, 3)
    found = motion(R, value("joint_error", "p", r=r)).subs(places)
    assert found == (about(r) * error_motion() * about(-r)).subs(places)


def test_links_are_what_lies_between_the_joints_frames() -> None:
    Qa, ra, Q, r, places = rotation(), vector(), rotation(), vector(), numbers()
    R = value("arm_link", "R", Qa=Qa, ra=ra, Q=Q, r=r).reshape(3, 3)
    found = motion(R, value("arm_link", "p", Qa=Qa, ra=ra, Q=Q, r=r)).subs(places)
    E = (about(r) * error_motion() * about(-r)).subs(places)
    assert found == motion(Qa, ra).inv() * E * motion(Q, r)


def test_a_joint_moves_by_its_screw() -> None:
    R, p, (c, s), q = rotation(), vector(), circle(), sp.Rational(3, 7)
    turned = value("arm_turned", "turned", R=R, s=s, c=c)
    assert turned.reshape(3, 3) == R * rot_z(c, s)
    assert value("arm_slid", "slid", R=R, p=p, q=q) == p + q * R[:, 2]
    frame = motion(R, p)
    twist = twist_of(frame * generator(sp.Matrix([0, 0, 1]), sp.zeros(3, 1)) * frame.inv())
    found = [value("arm_axis_twist", name, R=R, p=p) for name in "wv"]
    assert sp.Matrix.vstack(*found) == twist


def test_error_twists_are_the_derivatives_of_the_error() -> None:
    Qa, Qx, ra, xa, r, places = rotation(), rotation(), vector(), vector(), vector(), numbers()
    before = motion(Qx, xa) * motion(Qa, ra).inv() * about(r)  # as moved, at the joint's point
    E = error_motion()
    at = (before * E.subs(places))[:3, 3]
    wanted = []
    for e in ERROR:
        change = E.diff(e).subs(places) * E.subs(places).inv()
        wanted.append(list(twist_of(before * change * before.inv())))
    given = {"Qx": Qx, "Qa": Qa, "at": at}
    along, turn, moment = (
        value("arm_error_twists", name, **given).reshape(3, 3).subs(places)
        for name in ("along", "turn", "moment")
    )
    found = [[0, 0, 0, *along.row(i)] for i in range(3)]
    found += [[*turn.row(i), *moment.row(i)] for i in range(3)]
    assert found == wanted
