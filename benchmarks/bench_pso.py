"""The swarm against pyswarms and pygmo on eq. 18, and the limb residual against scalar C.

    python benchmarks/bench_pso.py           ratios, everything in one run
    pytest --benchmark-only benchmarks       the parts by pytest-benchmark

pyswarms and pygmo are left out where they are not installed. All run on one thread, with the
settings of the paper: 100 particles, 200 iterations, ω = 0.8, c1 = c2 = 1.5.
"""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.core.swarm import PAPER, minimise_eq18
from pkmcal.kinematics.limb_residual import LimbResidual

Array = np.ndarray
HALF_WIDTH = 3.0  # mm
POSES = 30
MEASURED = 200
OFF = np.random.default_rng(0).normal(0.0, 0.5, (POSES, 4))  # L* - L

# What anyone would write first: a pose and a geometry at a time, libm's sines and cosines.
SCALAR = r"""
#include <math.h>
#define SLOTS %d
static void frame(const double *pose, double *R)
{
    const double sa = sin(pose[3]), ca = cos(pose[3]), sb = sin(pose[4]), cb = cos(pose[4]);
    const double sg = sin(pose[5]), cg = cos(pose[5]);
    R[0] = cg * cb, R[1] = cg * sb * sa - sg * ca, R[2] = cg * sb * ca + sg * sa;
    R[3] = sg * cb, R[4] = sg * sb * sa + cg * ca, R[5] = sg * sb * ca - cg * sa;
    R[6] = -sb, R[7] = cb * sa, R[8] = cb * ca;
}
static double pose_cost(int limbs, const double *g, const double *R, const double *p,
                        const double *q)
{
    double sum = 0.0;
    for (int i = 0; i < limbs; i++, g += SLOTS) {
        double square = 0.0;
        for (int k = 0; k < 3; k++) {
            const double *row = R + 3 * k;
            const double d = p[k] + row[0] * g[3] + row[1] * g[4] + row[2] * g[5] - g[k];
            square += d * d;
        }
        const double off = sqrt(square) - (g[7] * q[i] + g[6]);
        sum += off * off;
    }
    return sum;
}
void cost(int particles, int limbs, int n, const double *geometry, const double *pose,
          const double *q, double *out)
{
    for (int j = 0; j < particles; j++) {
        out[j] = 0.0;
        for (int k = 0; k < n; k++) {
            double R[9];
            frame(pose + 6 * k, R);
            out[j] += pose_cost(limbs, geometry + j * limbs * SLOTS, R, pose + 6 * k,
                                q + limbs * k);
        }
    }
}
void cost_hoisted(int particles, int limbs, int n, const double *geometry, const double *pose,
                  const double *q, double *out)
{
    for (int j = 0; j < particles; j++) out[j] = 0.0;
    for (int k = 0; k < n; k++) {
        double R[9];
        frame(pose + 6 * k, R);
        for (int j = 0; j < particles; j++)
            out[j] += pose_cost(limbs, geometry + j * limbs * SLOTS, R, pose + 6 * k,
                                q + limbs * k);
    }
}
"""


def eq18_compiled() -> Array:
    """Eq. 18 of all poses by the swarms in the core."""
    return minimise_eq18(PAPER, OFF[:, None], np.full(4, HALF_WIDTH), 0)[1][:, -1]


def objective(aim: Array) -> Callable[[Array], Array]:
    return lambda x: np.sqrt(((aim - x) ** 2).sum(axis=1))


def eq18_callable(poses: int = POSES) -> Array:
    """The same through `pk.pso` and a Python callable."""
    bound = np.full(4, HALF_WIDTH)
    return np.array([pk.pso(objective(aim), -bound, bound).value for aim in OFF[:poses]])


def eq18_pyswarms(poses: int = POSES) -> Array:
    swarms = pytest.importorskip("pyswarms")
    bound = np.full(4, HALF_WIDTH)
    left = []
    for aim in OFF[:poses]:
        optimizer = swarms.single.GlobalBestPSO(
            n_particles=100,
            dimensions=4,
            options={"c1": 1.5, "c2": 1.5, "w": 0.8},
            bounds=(-bound, bound),
        )
        left.append(optimizer.optimize(objective(aim), iters=200, verbose=False)[0])
    return np.array(left)


class _Eq18:
    """Eq. 18 as a problem of pygmo, with its batch of a generation in one call."""

    def __init__(self, aim: Array) -> None:
        self.aim = aim

    def fitness(self, x: Array) -> list[float]:
        return [float(np.sqrt(((self.aim - x) ** 2).sum()))]

    def batch_fitness(self, x: Array) -> Array:
        return np.sqrt(((self.aim - x.reshape(-1, 4)) ** 2).sum(axis=1))

    def get_bounds(self) -> tuple[Array, Array]:
        return np.full(4, -HALF_WIDTH), np.full(4, HALF_WIDTH)


def eq18_pygmo(poses: int = POSES) -> Array:
    pygmo = pytest.importorskip("pygmo")
    left = []
    for aim in OFF[:poses]:
        swarm = pygmo.pso_gen(
            gen=200, omega=0.8, eta1=1.5, eta2=1.5, max_vel=1.0, variant=1, neighb_type=1
        )
        swarm.set_bfe(pygmo.bfe(pygmo.member_bfe()))
        problem = pygmo.problem(_Eq18(aim))
        population = pygmo.population(problem, 100, seed=0, b=pygmo.bfe(pygmo.member_bfe()))
        left.append(pygmo.algorithm(swarm).evolve(population).champion_f[0])
    return np.array(left)


class Residual:
    """The limb residual of a hexapod: 100 geometries, 200 poses."""

    def __init__(self, folder: Path) -> None:
        rng = np.random.default_rng(1)
        robot = pk.load("hexapod")
        poses = robot.home + rng.uniform(-1, 1, (MEASURED, 6)) * [100, 100, 50, 0.2, 0.2, 0.2]
        self.cost = LimbResidual(robot, poses, robot.inverse(poses))
        self.values = self.cost.nominal + rng.normal(0.0, 0.5, (100, len(self.cost.free)))
        self.slots = self.cost.geometries(self.values)
        source, library = folder / "scalar.c", folder / "scalar.so"
        source.write_text(SCALAR % self.slots.shape[2])
        compiler = os.environ.get("CC", "gcc")
        flags = (
            "-std=c11",
            "-O3",
            "-march=native",
            "-fno-tree-vectorize",
            "-fno-math-errno",
            "-ffp-contract=off",
            "-shared",
            "-fPIC",
        )
        subprocess.run([compiler, *flags, source, "-o", library, "-lm"], check=True)
        self._scalar = ctypes.CDLL(str(library))
        self._arrays = [
            np.ascontiguousarray(a) for a in (self.slots, poses, robot.inverse(poses))
        ]  # fmt: skip

    def compiled(self) -> Array:
        return self.cost.of_slots(self.slots)

    def scalar(self, name: str = "cost") -> Array:
        out = np.empty(len(self.slots))
        numbers = [ctypes.c_void_p(a.ctypes.data) for a in (*self._arrays, out)]
        self._scalar[name](len(self.slots), 6, MEASURED, *numbers)
        return np.sqrt(out / (6 * MEASURED))


needs_compiler = pytest.mark.skipif(
    shutil.which(os.environ.get("CC", "gcc")) is None, reason="no C compiler"
)


@pytest.mark.benchmark(group="eq. 18 by PSO, 30 poses")
@pytest.mark.parametrize("way", [eq18_compiled, eq18_callable, eq18_pygmo, eq18_pyswarms])
def test_eq18(benchmark, way) -> None:  # type: ignore[no-untyped-def]
    left = benchmark.pedantic(way, rounds=3, iterations=1, warmup_rounds=1)
    assert np.median(left) < 1e-2


@needs_compiler
@pytest.mark.benchmark(group="limb residual of a hexapod, 100 geometries, 200 poses")
@pytest.mark.parametrize("way", ["compiled", "hoisted", "scalar"])
def test_limb_residual(benchmark, way, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    residual = Residual(tmp_path)
    names = {"hoisted": "cost_hoisted", "scalar": "cost"}
    call = residual.compiled if way == "compiled" else lambda: residual.scalar(names[way])
    np.testing.assert_allclose(benchmark(call), residual.scalar(), rtol=1e-9)


def least(call: Callable[[], object], repeats: int) -> float:
    """Seconds of the fastest run."""
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        call()
        times.append(time.perf_counter() - begin)
    return min(times)


def main() -> None:
    own = least(eq18_compiled, 20) / POSES
    print(f"eq. 18, one pose: compiled swarm {1e3 * own:.3f} ms")
    for name, way in (
        ("pk.pso, Python callable", eq18_callable),
        ("pygmo pso_gen, batched", eq18_pygmo),
        ("pyswarms GlobalBestPSO", eq18_pyswarms),
    ):
        try:
            other = least(lambda way=way: way(3), 3) / 3
        except pytest.skip.Exception:
            print(f"  {name:26} not installed")
            continue
        own = min(own, least(eq18_compiled, 5) / POSES)
        print(f"  {name:26} {1e3 * other:8.2f} ms   {other / own:6.1f} x")
    with tempfile.TemporaryDirectory() as folder:
        residual = Residual(Path(folder))
        own = least(residual.compiled, 300)
        per = 1e9 / (100 * MEASURED)
        print(f"limb residual of a hexapod, a geometry and a pose: compiled {own * per:.2f} ns")
        for name, function in (("scalar C", "cost"), ("scalar C, R hoisted", "cost_hoisted")):
            other = least(lambda function=function: residual.scalar(function), 300)
            print(f"  {name:26} {other * per:8.2f} ns   {other / own:6.1f} x")


if __name__ == "__main__":
    main()
