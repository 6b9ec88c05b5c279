"""Start systems for following every assembly mode; ``python -m derive.modes [NAME ...]`` writes.

The closures of a machine are polynomial equations in the state of its pose map, with the numbers of
its limbs as coefficients. For complex numbers chosen at random they have as many solutions as any
choice has isolated ones at most, and all of them are connected: leading the numbers around a loop
carries one solution to another (monodromy). So one solution, which is easy (choose the state, then
the lengths that fit), gives all, and loops go on until none has been new for long.

Published counts (40, 32, 24, 16, 6) are where they should end; `tests/modes/test_counts.py` checks
them by other means.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import sympy as sp

from . import limbs, posemaps

ROOT = Path(__file__).parent.parent
FILE = (ROOT / "pkmcal" if (ROOT / "pkmcal").is_dir() else ROOT) / "modes" / "modes.json"
Array = Any  # of complex numbers
AXIS = {axis: slice(7 + 3 * k, 10 + 3 * k) for k, axis in enumerate(limbs.AXES)}
ROW = {row.name: row for row in limbs.CONSTRAINTS}
UNIT = {"spatial": ([3, 4, 5, 6],), "planar": ([2, 3],), "2tpr2tps": ([2, 3], [4, 5])}
QUIET = 12  # loops without a new solution that end the search


@dataclass(frozen=True)
class Family:
    """Machines whose closures have the same form: a pose map, and of each limb its rows.

    `zero` are the coordinates of the joints that vanish: (limb, place among the limb's numbers).
    """

    name: str
    map: str
    rows: tuple[tuple[str, ...], ...]
    zero: tuple[tuple[int, int], ...] = ()

    @property
    def width(self) -> int:
        """Numbers of a limb: joint b, anchor c, length, and axes up to the last that a row has.

        Those of base and platform in any case. So start systems stay when an axis is declared.
        """
        used = {axis for kinds in self.rows for axis in axes_of(kinds)}
        return max(AXIS[axis].stop for axis in {limbs.BASE, limbs.PLATFORM} | used)


def axes_of(kinds: tuple[str, ...]) -> set[limbs.Axis]:
    """The axes that these rows have."""
    sides = ((ROW[kind].on_base, ROW[kind].on_platform) for kind in kinds)
    return {axis for both in sides for axis in both if axis}


IN_PLANE = tuple((limb, place) for limb in (2, 3) for place in (0, 2, 3, 5))  # on the y axes
FAMILIES = (
    Family("hexapod", "spatial", ((),) * 6),
    Family("3rps", "spatial", (("base_plane",),) * 3),
    Family("3prs", "spatial", (("hinge_plane",),) * 3),
    Family("2tpr2tps-spatial", "spatial", ((),) * 2 + (("platform_plane",),) * 2),
    Family("delta", "translation", ((),) * 3),
    Family("planar", "planar", ((),) * 3),
    Family("2tpr2tps", "2tpr2tps", ((),) * 4),
    Family("2tpr2tps-published", "2tpr2tps", ((),) * 4, IN_PLANE),
)


class System:
    """The closures of a family, and what the state has to keep, as compiled functions."""

    def __init__(self, family: Family) -> None:
        pose_map = next(each for each in posemaps.MAPS if each.name == family.map)
        self.state_size = pose_map.state_size
        state = sp.Matrix(sp.symbols(f"x0:{pose_map.state_size}"))
        shape = (len(family.rows), family.width)
        numbers = sp.Matrix(*shape, sp.symbols(f"g0:{shape[0] * shape[1]}"))
        R, p = pose_map.frame(state)
        rows = []
        for i, kinds in enumerate(family.rows):
            b, c = numbers[i, 0:3].T, numbers[i, 3:6].T
            d = p + R * b - c
            rows.append(d.dot(d) - numbers[i, 6] ** 2)
            for kind in kinds:
                n, a = (
                    numbers[i, AXIS[axis]].T if axis else sp.zeros(3, 1)
                    for axis in (ROW[kind].on_base, ROW[kind].on_platform)
                )
                rows.append(ROW[kind].phi(d, n, R * a, sp.S.One))
        rows += kept(pose_map.name, state)
        system = sp.Matrix(rows)
        given = (list(state), list(numbers))
        self.rows = compiled(given, system)
        self.by_state = compiled(given, system.jacobian(state))
        self.frame = compiled((list(state),), sp.Matrix([*R, *p]))


def kept(name: str, state: Array) -> list[sp.Expr]:
    """What is 0 on the states of a map: a unit quaternion, unit circles."""
    return [sum(state[i] ** 2 for i in group) - 1 for group in UNIT.get(name, ())]


def compiled(given: Any, what: sp.Matrix) -> Callable[..., Array]:
    """A function of vectors whose entries may have any batch shape, behind the entries' axis."""
    function = sp.lambdify(given, list(what), cse=True)

    def call(*values: Array) -> Array:
        batch = values[0].shape[1:]
        entries = [np.broadcast_to(entry, batch) for entry in function(*values)]
        out = np.moveaxis(np.array(entries), 0, -1)
        return out if what.shape[1] == 1 else out.reshape(*batch, *what.shape)

    return call


def newton(system: System, x: Array, g: Array, steps: int) -> tuple[Array, Array, Array]:
    """Newton's method on states (N, state) at numbers (N, numbers).

    Returns the states, and the first and the last correction of each beside the state's size.
    """
    offs = []
    for _ in range(steps):
        rows, slope = system.rows(x.T, g.T), system.by_state(x.T, g.T)
        good = np.isfinite(slope).all(axis=(1, 2)) & (np.abs(np.linalg.det(slope)) > 1e-200)
        slope[~good] = np.eye(slope.shape[-1])
        step = np.linalg.solve(slope, rows[..., None])[..., 0]
        offs.append(np.where(good, np.abs(step).max(axis=1) / np.abs(x).max(axis=1), np.inf))
        x = x - step
    return x, offs[0], offs[-1]


def follow(system: System, x: Array, start: Array, end: Array) -> Array:
    """States (N, state) continued straight from numbers `start` to `end`; failed paths left out."""
    t, h, before, last = 0.0, 0.01, x, 0.01
    while t < 1.0 and len(x):
        h = min(h, 1.0 - t)
        g = np.broadcast_to(start + (end - start) * (t + h), (len(x), len(start)))
        at, first, off = newton(system, x + (x - before) * (h / last), g, 3)
        good = (first < 0.05) & (off < 1e-6)
        if not good.all() and h > 2e-4:
            h /= 2.0
            continue
        before, x, t, last = x[good], at[good], t + h, h
        h *= 2.0 if not good.any() or first[good].max() < 0.01 else 1.0
    return x


def distinct(system: System, x: Array, near: float = 1e-6) -> Array:
    """The states whose frames differ: a quaternion and its opposite are one."""
    frames = system.frame(x.T)
    kept: list[int] = []
    for k in range(len(x)):
        if not kept or np.abs(frames[kept] - frames[k]).max(axis=1).min() > near:
            kept.append(k)
    return x[kept]


def start_system(family: Family, seed: int = 1) -> tuple[Array, Array]:
    """Numbers (limbs, width) and all the solutions (N, state) there."""
    rng = np.random.default_rng(seed)
    system = System(family)
    g, x = solved_at_random(family, system, rng)
    found, quiet = x[None], 0
    while quiet < QUIET:
        corners = [random_numbers(family, rng).ravel() for _ in range(2)]
        at = found
        for start, end in zip([g, *corners], [*corners, g], strict=True):
            at = follow(system, at, start, end)
        more = distinct(system, np.concatenate([found, at]))
        quiet = quiet + 1 if len(more) == len(found) else 0
        print(f"{family.name}: {len(more)} solutions")
        found = more
    found, _, off = newton(system, found, np.broadcast_to(g, (len(found), len(g))), 4)
    if off.max() > 1e-10:
        raise ValueError(f"{family.name}: a solution is known to {off.max():.0e} only")
    return g.reshape(-1, family.width), found


def random_numbers(family: Family, rng: np.random.Generator) -> Array:
    """Complex numbers of every limb, those that vanish in the family zero."""
    g = rng.normal(size=(len(family.rows), family.width, 2)) @ [1, 1j] / np.sqrt(2)
    for i, kinds in enumerate(family.rows):
        for axis, entries in AXIS.items():
            g[i, entries] *= axis in axes_of(kinds)
    for i, place in family.zero:
        g[i, place] = 0
    return g


def solved_at_random(
    family: Family, system: System, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Numbers, as one vector, and a state that solves the closures there."""
    g = random_numbers(family, rng)
    x = rng.normal(size=(system.state_size, 2)) @ [1, 1j] / np.sqrt(2)
    for group in UNIT.get(family.map, ()):
        x[group] /= np.sqrt(np.sum(x[group] ** 2))
    frame = system.frame(x[:, None])[0]
    R, p = frame[:9].reshape(3, 3), frame[9:]
    for i, kinds in enumerate(family.rows):
        d = p + R @ g[i, 0:3] - g[i, 3:6]
        g[i, 6] = np.sqrt(d @ d)
        for kind in kinds:  # a plane: its one axis becomes square to d
            (axis,) = axes_of((kind,))
            along = d if axis is ROW[kind].on_base else R.T @ d
            g[i, AXIS[axis]] -= along * (g[i, AXIS[axis]] @ along) / (along @ along)
    return g.ravel(), x


def pairs(z: Array) -> list[Any]:
    """Complex numbers as nested lists with real and imaginary part last."""
    listed: list[Any] = np.stack([z.real, z.imag], axis=-1).tolist()
    return listed


def main() -> None:
    """Find and write the start systems of the families named, or of all; the others stay."""
    known = {family.name: family for family in FAMILIES}
    named = sys.argv[1:] or list(known)
    if unknown := set(named) - set(known):
        raise SystemExit(f"no family {', '.join(sorted(unknown))}; there are {', '.join(known)}")
    content = json.loads(FILE.read_text(encoding="utf-8")) if FILE.exists() else {}
    for family in map(known.__getitem__, named):
        numbers, states = start_system(family)
        content[family.name] = {
            "map": family.map,
            "rows": family.rows,
            "zero": family.zero,
            "limbs": pairs(numbers),
            "states": pairs(states),
        }
    lines = [
        f"{json.dumps(name)}: {json.dumps(content[name])}" for name in known if name in content
    ]
    FILE.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")


if __name__ == "__main__":
    main()
