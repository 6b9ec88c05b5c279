"""The counts of complex modes by Gröbner bases modulo a prime: another method, another engine.

Singular counts the solutions of the closures in the nine entries of R and in p over the integers
modulo a prime. It is Debian's ``singular`` or, from PyPI, ``passagemath-singular``.
"""

from __future__ import annotations

import random
import shutil
import subprocess
from collections.abc import Sequence
from fractions import Fraction
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.geometry.limb_kinds import KINDS
from pkmcal.modes import homotopy

PRIME = 2**31 - 1
R = [[f"r{i}{j}" for j in range(3)] for i in range(3)]
P = ["x", "y", "z"]


def singular() -> str:
    wheel = find_spec("sage_wheels")
    folders = list(wheel.submodule_search_locations or ()) if wheel else []
    places = [Path(folder) / "bin" / "Singular" for folder in folders]
    found = shutil.which("Singular") or next((str(p) for p in places if p.is_file()), None)
    if found is None:
        pytest.skip("no Singular: install Debian's singular or passagemath-singular")
    return found


def rotation() -> list[str]:
    """RᵀR = R Rᵀ = 1, and every entry is its cofactor: det R = 1."""
    rows = []
    for i in range(3):
        for j in range(3):
            rows.append("+".join(f"{R[k][i]}*{R[k][j]}" for k in range(3)) + f"-{int(i == j)}")
            rows.append("+".join(f"{R[i][k]}*{R[j][k]}" for k in range(3)) + f"-{int(i == j)}")
            a, b, c, d = (i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3
            rows.append(f"{R[a][c]}*{R[b][d]}-{R[a][d]}*{R[b][c]}-{R[i][j]}")
    return rows


POSES = {
    "spatial": [],
    "translation": [f"{R[i][j]}-{int(i == j)}" for i in range(3) for j in range(3)],
    "planar": ["z", "r02", "r12", "r20", "r21", "r22-1"],
    "2tpr2tps": ["r10", "x*r00+z*r20"],
}


def count(map: str, rows: Sequence[Sequence[str]], spheres: Sequence[Sequence[int]]) -> int:
    """Solutions modulo the prime of limbs (joint, anchor, length, axes), with multiplicity."""
    equations = rotation() + POSES[map]
    for kinds, g in zip(rows, spheres, strict=True):
        turned = ["+".join(f"{g[j]}*{R[k][j]}" for j in range(3)) for k in range(3)]
        d = [f"({P[k]}+{turned[k]}-{g[3 + k]})" for k in range(3)]
        equations.append("+".join(f"{each}*{each}" for each in d) + f"-{g[6]}*{g[6]}")
        for kind, normal in (("base_plane", 7), ("hinge_plane", 13)):
            if kind in kinds:
                equations.append("+".join(f"{g[normal + k]}*{d[k]}" for k in range(3)))
        if "platform_plane" in kinds:
            axis = ["+".join(f"{g[10 + j]}*{R[k][j]}" for j in range(3)) for k in range(3)]
            equations.append("+".join(f"({axis[k]})*{d[k]}" for k in range(3)))
    names = ",".join([*(entry for row in R for entry in row), *P])
    script = f"ring A={PRIME},({names}),dp; ideal I={','.join(equations)};"
    script += "ideal G=slimgb(I); dim(G); vdim(G); quit;\n"
    run = subprocess.run(
        [singular(), "-q"], input=script, capture_output=True, text=True, timeout=300
    )
    dimension, degree = (int(word) for word in run.stdout.split())
    assert dimension <= 0
    return degree


@pytest.mark.parametrize("family", homotopy._families(), ids=lambda family: family.start.name)
def test_start_systems_hold_as_many_solutions_as_the_gröbner_basis_says(family):
    draw = random.Random(7)
    spheres = [[draw.randrange(1, PRIME) for _ in range(16)] for _ in family.rows]
    for limb, place in family.zero:
        spheres[limb][place] = 0
    assert count(family.map, family.rows, spheres) == len(family.start.states)


def modulo(value: float) -> int:
    exact = Fraction(float(value))
    return exact.numerator * pow(exact.denominator, -1, PRIME) % PRIME


@pytest.mark.parametrize(
    ("name", "solutions"),
    [
        *(("2tpr2tps", 24), ("2tpr2tps-spatial", 24), ("rbt-6t03p", 40), ("hexapod", 36)),
        *(("linear-delta", 2), ("linear-delta-6", 40), ("rotary-delta", 2), ("6-rus", 40)),
        *(("3rps", 16), ("3prs", 16), ("3rrr-planar", 6), ("rbt-6t03p-printed", 0)),
    ],
)
def test_complex_modes_of_builtin_machines_are_as_documented(name, solutions):
    """At their own numbers, as exact binary fractions; rounding of a file's numbers counts."""
    robot = pk.load(name)
    q = robot.inverse(robot.home)
    if not np.isfinite(q).all():  # the printed geometry cannot be assembled there
        q = np.full(q.shape, 200.0)
    q = q + np.random.default_rng(0).normal(size=q.shape) * (0.02 * np.abs(q) + 0.01)
    spheres = robot.machine.spheres(robot.slots, q[None])[0]
    rows = [KINDS[limb.kind].all_rows(limb.couple > 0) for limb in robot.model.limbs]
    found = count(robot.model.map, rows, [[modulo(v) for v in limb] for limb in spheres])
    assert found == solutions
    modes = robot.forward_all(q, starts=0)
    assert modes.complete
    assert modes.paths - modes.far <= solutions <= modes.paths
