"""Calibration side by side: identify, and least squares on a model of the machine in NumPy."""

from __future__ import annotations

import itertools
import multiprocessing
import resource
import time
import tracemalloc
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor

import numpy as np
from scipy.optimize import least_squares

import pkmcal as pk
from benchmarks.timing import Report, medians, medians_of_made, times
from pkmcal.estimation.begin import estimator_at
from pkmcal.estimation.estimator import Estimator
from pkmcal.estimation.solving import solve
from tests.simulated import hexapod_poses, tilted_poses, with_errors

POSES, SIGMA, NOISE = 30, 0.5, 0.02
WANTED = 50.0
REPLICATES = 1000
CANDIDATES, CHOSEN = 500, 20
BELTS, BELT_NOISE = 100_000, 0.5


class Plain:
    """A 2TPR&2TPS in NumPy: Newton on y, z, α, β (eq. 13), `together` poses at once.

    With eq. 7 in the form x = w sin β, z = w cos β; 28 parameters: base, platform, offset by limb.
    It starts from the pose of the nominal machine and has its derivatives in closed form.
    """

    def __init__(
        self, robot: pk.Robot, actuators: np.ndarray, values: np.ndarray, together: int
    ) -> None:
        self.q, self.values = actuators, values
        self.blocks = [slice(i, i + together) for i in range(0, len(actuators), together)]
        geometry = robot.geometry
        self.start = np.array([geometry[name] for name in robot.model.free])
        self.order = [
            robot.model.free.index(name)
            for i in range(1, 5)
            for name in (*(f"base{i}.{a}" for a in "xyz"), *(f"platform{i}.{a}" for a in "xyz"))
        ]
        self.offsets = [robot.model.free.index(f"offset{i}") for i in range(1, 5)]
        pose = robot.forward(actuators).pose
        self.guess = np.column_stack([pose[:, 1], pose[:, 2] / np.cos(pose[:, 4]), pose[:, 3:5]])

    def points(self, theta: np.ndarray) -> np.ndarray:
        """Where the platform's origin is, (N, 3)."""
        return np.concatenate([self.solve(theta, block) for block in self.blocks])

    def solve(self, theta: np.ndarray, block: slice) -> np.ndarray:
        """The same for some of the poses."""
        joints = theta[self.order].reshape(4, 2, 3)
        base, platform, lengths = joints[:, 0], joints[:, 1], self.q[block] + theta[self.offsets]
        y, w, alpha, beta = self.guess[block].T.copy()
        for _ in range(20):
            (sa, ca), (sb, cb) = ((np.sin(t), np.cos(t)) for t in (alpha, beta))
            zero = np.zeros_like(sa)
            R = np.array([[cb, sb * sa, sb * ca], [zero, ca, -sa], [-sb, cb * sa, cb * ca]])
            by_alpha = np.array(
                [[zero, sb * ca, -sb * sa], [zero, -sa, -ca], [zero, cb * ca, -cb * sa]]
            )
            by_beta = np.array(
                [[-sb, cb * sa, cb * ca], [zero, zero, zero], [-cb, -sb * sa, -sb * ca]]
            )
            p = np.array([w * sb, y, w * cb])
            d = p.T[:, None] + np.einsum("ijn,kj->nki", R, platform) - base
            length = np.sqrt((d * d).sum(axis=-1))
            missed = length - lengths
            if np.abs(missed).max() < 1e-10:
                break
            d /= length[..., None]
            dp_dbeta = np.array([w * cb, zero, -w * sb]).T
            jacobian = np.stack(
                [
                    d[..., 1],
                    d[..., 0] * sb[:, None] + d[..., 2] * cb[:, None],
                    np.einsum("nki,ijn,kj->nk", d, by_alpha, platform),
                    np.einsum("nki,ijn,kj->nk", d, by_beta, platform)
                    + np.einsum("nki,ni->nk", d, dp_dbeta),
                ],
                axis=-1,
            )
            step = np.linalg.solve(jacobian, -missed[..., None])[..., 0]
            y, w, alpha, beta = np.array([y, w, alpha, beta]) + step.T
        return p.T

    def residual(self, theta: np.ndarray) -> np.ndarray:
        """Equations of the measurements and of the prior, in standard deviations."""
        off = (self.points(theta) - self.values).ravel() / NOISE
        return np.concatenate([off, (theta - self.start) / SIGMA])

    def fit(self) -> np.ndarray:
        """By SciPy's least squares with finite differences."""
        return least_squares(self.residual, self.start, method="lm", xtol=1e-10).x


def bench_28_parameters(report: Report) -> None:
    """The paper's machine, one target, 30 poses."""
    robot = pk.load("2tpr2tps")
    rng = np.random.default_rng(1)
    true = with_errors(robot, SIGMA, rng)
    q = robot.inverse(tilted_poses(robot, POSES, rng))
    measured = pk.VirtualMachine(true, NOISE, seed=1).measure(q)
    models = {
        "one pose after another": Plain(robot, q, measured.values, 1),
        "all poses at once": Plain(robot, q, measured.values, POSES),
    }
    found = pk.identify(robot, measured, prior=SIGMA)
    apart = max(
        np.abs((model.fit() - found.values) / found.stderr).max() for model in models.values()
    )
    if apart > 0.01:
        raise RuntimeError(f"the fits differ by {apart} standard deviations")
    took = medians(
        {"identify": lambda: pk.identify(robot, measured, prior=SIGMA)}
        | {f"least_squares, NumPy, {name}": model.fit for name, model in models.items()},
        5,
    )
    report.text(
        f"2TPR&2TPS, {len(found.free)} parameters with a prior from {POSES} positions. All end"
        f" within {apart:.1g} standard deviations of each other. The models in NumPy have Newton's"
        " method with derivatives in closed form from good guesses, and finite differences by the"
        " parameters; identify's time includes rank, covariance, outliers and the combinations that"
        " cannot be identified."
    )
    rows = [
        [name, f"{1e3 * seconds:.2f}", times(seconds / took["identify"])]
        for name, seconds in took.items()
    ]
    report.table(["fit", "ms", "identify is"], rows)
    report.text(f"Wanted: {WANTED:.0f}x a model in NumPy.")


def bench_others(report: Report) -> None:
    """What else a calibration takes: the hexapod, bootstrap, a plan."""
    robot = pk.load("hexapod")
    rng = np.random.default_rng(1)
    true = with_errors(robot, SIGMA, rng)
    q = robot.inverse(hexapod_poses(robot, 40, rng))
    measured = pk.VirtualMachine(true, NOISE, seed=1).measure(q, kind="pose")
    candidates = pk.sample_poses(robot, CANDIDATES, share=0.9)
    found = pk.identify(robot, measured)
    hexapod = f"hexapod, {len(found.free)} parameters from {len(measured)} poses"
    took = medians({hexapod: lambda: pk.identify(robot, measured)}, 20)
    took |= medians(
        {
            f"{REPLICATES} bootstrap replicates of it": lambda: pk.bootstrap(found, REPLICATES),
            f"plan of {CHOSEN} among {CANDIDATES} poses": lambda: pk.plan_poses(
                robot, candidates, CHOSEN, kind="pose"
            ),
        },
        3,
    )
    report.table(["job", "ms"], [[name, f"{1e3 * s:.1f}"] for name, s in took.items()])


def belts(rows: int, error: float = 10.0) -> tuple[pk.Robot, pk.Measurements]:
    """Four belts, 5 numbers free and off by `error` mm, whose lengths alone were read."""
    robot = pk.load("examples/belts/robot.toml")
    rng = np.random.default_rng(0)
    off = dict(zip(robot.model.free, rng.normal(0, error, len(robot.model.free)), strict=True))
    true = robot.replace({name: robot.geometry[name] + error for name, error in off.items()})
    at = np.zeros((rows, 6))
    at[:, :2] = rng.uniform([400, 300], [2600, 1700], (rows, 2))
    q = true.inverse(at) + rng.normal(0, BELT_NOISE, (rows, 4))
    return robot, pk.Measurements(q, None, "closure", actuator_sigma=BELT_NOISE)


class PlainBelts:
    """Anchors of belts and the places of all rows, in NumPy, from the same start."""

    def __init__(self, robot: pk.Robot, log: pk.Measurements, start: np.ndarray) -> None:
        self.q, geometry = log.actuators, robot.geometry
        self.anchors = np.array([[geometry[f"base{i}.{a}"] for a in "xy"] for i in range(1, 5)])
        names = [f"base{i}.{a}" for i in range(1, 5) for a in "xy"]
        self.free = [names.index(name) for name in robot.model.free]
        self.start = np.concatenate([self.anchors.flat[self.free], start[:, :2].ravel()])

    def arms(self, unknowns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Vectors from the anchors to the places, and their lengths."""
        anchors, own = self.anchors.copy(), len(self.free)
        anchors.flat[self.free] = unknowns[:own]
        arms = unknowns[own:].reshape(-1, 1, 2) - anchors
        return arms, np.linalg.norm(arms, axis=2)

    def residual(self, unknowns: np.ndarray) -> np.ndarray:
        """In standard deviations."""
        return ((self.arms(unknowns)[1] - self.q) / BELT_NOISE).ravel()

    def slopes(self, unknowns: np.ndarray) -> np.ndarray:
        """Its derivative, dense."""
        arms, lengths = self.arms(unknowns)
        unit = arms / lengths[:, :, None] / BELT_NOISE
        rows = np.arange(len(unit))
        by_anchors = np.zeros((len(unit), 4, 4, 2))
        by_anchors[:, range(4), range(4)] = -unit
        by_places = np.zeros((len(unit), 4, len(unit), 2))
        by_places[rows, :, rows] = unit
        parts = by_anchors.reshape(4 * len(unit), 8)[:, self.free], by_places
        return np.hstack([part.reshape(4 * len(unit), -1) for part in parts])

    def fit(self) -> np.ndarray:
        """As SciPy does it if it is told nothing else."""
        return least_squares(self.residual, self.start).x

    def fit_with_slopes(self) -> np.ndarray:
        """With derivatives in closed form, by MINPACK."""
        return least_squares(self.residual, self.start, self.slopes, method="lm").x


def bench_belts(report: Report) -> None:
    """A machine that calibrates itself, a pose of its own for every row; processor time."""
    for error in 10.0, 100.0:
        bench_100_belts(report, error)
    robot, many = belts(BELTS)
    jobs = {f"{BELTS} rows": lambda: pk.identify(robot, many)}
    took = medians(jobs, 3, time.thread_time)
    tracemalloc.start()
    pk.identify(robot, many)
    peak = tracemalloc.get_traced_memory()[1] / BELTS
    tracemalloc.stop()
    report.table(["four belts, ms", ""], [[name, f"{1e3 * s:.1f}"] for name, s in took.items()])
    report.text(f"Memory at its peak: {peak / 1e3:.2f} kB a row.")


def _many(free: str | None, rows: int) -> tuple[float, float]:
    """Processor seconds and GB of a calibration and its verdict, in a process of its own."""
    robot = pk.load("hexapod")
    rng = np.random.default_rng(0)
    true = robot.replace({"offset2": 0.3, "offset5": -0.2})
    q = robot.inverse(hexapod_poses(robot, rows, rng))
    measured = pk.VirtualMachine(true, NOISE, seed=1).measure(q)
    start = time.process_time()
    state = pk.identify(robot, measured, free).verdict.state
    if state != "calibrated":
        raise RuntimeError(state)
    took = time.process_time() - start
    return took, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6


def bench_many(report: Report) -> None:
    """Many positions of a hexapod."""
    rows = []
    for free, count in itertools.product(("offset*", None), (100_000, 1_000_000)):
        with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as alone:
            took, held = alone.submit(_many, free, count).result()
        numbers = "6" if free else "42"
        rows.append([f"{count} positions, {numbers} numbers", f"{took:.1f}", f"{held:.2f}"])
    report.table(["hexapod, with its verdict", "processor s", "GB at most"], rows)


def bench_100_belts(report: Report, error: float) -> None:
    """100 rows of them, anchors off by `error` mm."""
    robot, log = belts(100, error)
    found = pk.identify(robot, log)
    fit = found.fit

    def begin() -> Estimator:
        return estimator_at(fit.uncertainty.equations, fit.start, "linear")

    def alone() -> Callable[[], object]:
        """The least squares from there to the minimum."""
        made = begin()
        units, n = len(made.equations.blocks.components), len(made.scale)
        given = np.zeros(n), np.ones(len(made.unstated)), np.ones(units), np.empty((0, n))
        return lambda: made.best(*given)

    plain = PlainBelts(robot, log, begin().start.pose)
    for far in plain.fit(), plain.fit_with_slopes():
        off = np.abs((far[: len(found.values)] - found.values) / found.stderr).max()
        if off > 1e-3:
            raise RuntimeError(f"the fits differ by {off} standard deviations")
    jobs: dict[str, Callable[[], Callable[[], object]]] = {
        "the solve alone": alone,
        "with its start, rank and noise": lambda: lambda: solve(begin()),
        "identify": lambda: lambda: pk.identify(robot, log),
        "NumPy and least_squares": lambda: plain.fit,
        "NumPy and least_squares, derivatives given": lambda: plain.fit_with_slopes,
    }
    took = medians_of_made(jobs, 25, time.thread_time)
    report.table(
        [f"four belts, 100 rows, anchors off by {error:.0f} mm", "ms", "the solve alone is"],
        [[name, f"{1e3 * s:.2f}", times(s / took["the solve alone"])] for name, s in took.items()],
    )


def main() -> None:
    report = Report("Calibration")
    bench_28_parameters(report)
    bench_others(report)
    bench_belts(report)
    bench_many(report)
    report.write("identify")


if __name__ == "__main__":
    main()
