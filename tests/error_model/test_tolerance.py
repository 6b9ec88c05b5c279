"""Monte Carlo, linear propagation and worst case agree where they must; the same seed, the same."""

from __future__ import annotations

import multiprocessing
import tracemalloc
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pkmcal as pk
from pkmcal.error_model import monte_carlo
from pkmcal.error_model.tolerance import Tolerance, sigma_of
from pkmcal.kinematics.perturbed import Geometries, forward_of
from pkmcal.kinematics.robot import Robot

from ..workspaces import WORKSPACE, poses

ROOT = Path(__file__).resolve().parents[2]
DELTA = ROOT / "examples" / "linear-delta" / "robot.toml"
MACHINES = sorted(WORKSPACE)
ARRAYS = (
    *("mean", "std", "interval95", "interval997", "distance_rms", "distance95", "distance997"),
    *("linear_std", "worst_case", "contribution", "failed"),
)
NEARLY_SINGULAR = np.array([0, 0, 0, 0, 0, 1.5])  # for a hexapod: Fichter, a quarter turn
SAMPLES = 40_000  # three chunks, the last of them not full


def assert_same_bits(one: Tolerance, other: Tolerance) -> None:
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)


def several_poses() -> np.ndarray:
    return poses("2tpr2tps", 3)


@pytest.fixture(scope="module")
def reference() -> Tolerance:
    return pk.tolerance(pk.load("2tpr2tps"), several_poses(), 0.1, samples=SAMPLES, seed=5)


# --- one geometry per row --------------------------------------------------------------------


@pytest.mark.parametrize("name", [*MACHINES, str(DELTA)])
def test_a_row_with_its_own_geometry_is_that_robot(name: str) -> None:
    robot = pk.load(name)
    geometry = robot.geometry
    own = [n for n, tied in zip(geometry.names, geometry.tied, strict=True) if not tied]
    places = np.array([geometry.names.index(n) for n in own])
    errors = np.random.default_rng(0).normal(0, 1e-3, (4, len(own)))
    (pose,) = robot.complete(poses(name, 1)) if name in WORKSPACE else robot.home[None]
    q = robot.inverse(pose)
    slots = Geometries(geometry, places, len(errors)).with_errors(errors)
    (found,) = forward_of(robot, slots, q[None], pose[None])
    for row, given_slots, each in zip(errors, slots, found, strict=True):
        values = {n: geometry[n] + e for n, e in zip(own, row, strict=True)}
        single = robot.replace(values)
        np.testing.assert_allclose(given_slots, single.geometry.slots, rtol=0, atol=1e-12)
        np.testing.assert_allclose(each, single.forward(q, guess=pose).pose, atol=1e-9)


def test_errors_are_those_of_the_tool_in_the_users_frame() -> None:
    plain = pk.load("hexapod")
    base, tool = np.array([50.0, -20, 300, 0, 0, np.pi / 2]), np.array([0, 0, 120.0, 0, 0, 0])
    robot = Robot(replace(plain.model, base_frame=base, tool_frame=tool))
    found = pk.tolerance(robot, robot.home, {"base*.z": 0.01}, samples=30_000)
    np.testing.assert_allclose(found.std, found.linear_std, rtol=0.02)
    assert robot.home[:3] == pytest.approx([50, -20, 300 + plain.home[2] + 120])
    # after a quarter turn x is the machine's -y, and a tilt dalpha moves the tool by -120 dalpha
    places = [plain.geometry.names.index(name) for name in found.names]
    own = plain.error_jacobian(plain.home)[:, places]
    expected = 0.01 * np.linalg.norm(own[1] - 120.0 * own[3])
    assert found.linear_std[0] == pytest.approx(expected)
    assert found.std[0] == pytest.approx(expected, rel=0.02)


# --- what the numbers are --------------------------------------------------------------------


@pytest.mark.parametrize("name", MACHINES)
def test_small_errors_spread_as_linear_propagation_says(name: str) -> None:
    robot = pk.load(name)
    found = pk.tolerance(robot, robot.complete(poses(name, 2)), 1e-4, samples=20_000)
    moved = found.linear_std > 1e-7
    ratio = found.std[moved] / found.linear_std[moved]
    np.testing.assert_allclose(ratio, 1.0, atol=5 / np.sqrt(2 * 20_000))
    assert (np.abs(found.mean) <= 5 * found.linear_std / np.sqrt(20_000) + 1e-9).all()
    assert found.std[~moved].max(initial=0.0) < 1e-6


def test_linear_propagation_contributions_and_worst_case_are_those_of_the_error_jacobian() -> None:
    robot = pk.load("hexapod")
    at = poses("hexapod", 4)
    names = robot.geometry.match(["base1.*", "platform3.z", "offset*"])
    sigma = dict(zip(names, np.linspace(0.05, 0.2, len(names)), strict=True))
    found = pk.tolerance(robot, at, sigma, samples=2)
    places = [robot.geometry.names.index(name) for name in found.names]
    jacobian = robot.error_jacobian(at)[..., places]
    covariance = np.diag([sigma[name] ** 2 for name in found.names])
    full = jacobian @ covariance @ jacobian.swapaxes(-1, -2)
    variance = np.diagonal(full, axis1=-2, axis2=-1)
    np.testing.assert_allclose(found.linear_std**2, variance)
    np.testing.assert_allclose(found.contribution.sum(axis=-1), 100.0)
    alone = pk.tolerance(robot, at, {"offset2": sigma["offset2"]}, samples=2).linear_std ** 2
    share = found.contribution[..., found.names.index("offset2")]
    np.testing.assert_allclose(share, 100 * alone / variance)
    assert found.position_share.sum() == pytest.approx(100.0)


@settings(max_examples=25)
@given(seed=st.integers(0, 10_000))
def test_no_errors_within_three_sigma_are_worse_than_the_worst_case(seed: int) -> None:
    robot = pk.load("2tpr2tps")
    found = pk.tolerance(robot, robot.home, 1e-4, samples=2)
    rng = np.random.default_rng(seed)
    errors = 3e-4 * rng.choice([-1.0, 1.0, rng.uniform(-1, 1)], len(found.names))
    changed = {n: robot.geometry[n] + e for n, e in zip(found.names, errors, strict=True)}
    off = robot.replace(changed).forward(robot.inverse(robot.home)).pose - robot.home
    assert (np.abs(off) <= found.worst_case * (1 + 1e-3) + 1e-9).all()


def test_the_worst_case_happens() -> None:
    robot = pk.load("2tpr2tps")
    found = pk.tolerance(robot, robot.home, 1e-4, samples=2)
    places = [robot.geometry.names.index(name) for name in found.names]
    signs = np.sign(robot.error_jacobian(robot.home)[1, places])
    changed = {n: robot.geometry[n] + 3e-4 * s for n, s in zip(found.names, signs, strict=True)}
    off = robot.replace(changed).forward(robot.inverse(robot.home)).pose - robot.home
    assert off[1] == pytest.approx(found.worst_case[1], rel=1e-3)


@pytest.mark.parametrize("name", MACHINES)
def test_the_worst_case_is_the_pose_of_a_machine(name: str) -> None:
    """Every number off by three sigma as the error Jacobian says, solved without it."""
    robot = pk.load(name)
    at = robot.complete(poses(name, 2))
    found = pk.tolerance(robot, at, 0.3, samples=2)
    places = [robot.geometry.names.index(number) for number in found.names]
    for pose, worst in zip(at, found.worst_case, strict=True):
        q = robot.inverse(pose)
        jacobian = robot.error_jacobian(pose, q)[:, places]
        for i in np.flatnonzero(np.abs(jacobian).max(axis=1) > 1e-9):
            if np.abs(jacobian[i]).min(where=jacobian[i] != 0, initial=1.0) < 1e-9:
                continue  # which side rounding decides
            off = []
            for side in (1.0, -1.0):
                errors = side * 0.9 * np.sign(jacobian[i])
                changed = robot.geometry.values.copy()
                changed[places] += errors
                moved = robot.replace(changed).forward(q, guess=pose)
                step = moved.pose[i] - pose[i]
                off.append(abs(np.angle(np.exp(1j * step)) if i >= 3 else step))
            expected = np.inf if np.isnan(off).any() else max(off)
            assert worst[i] == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_the_worst_case_of_large_errors_is_not_the_linear_one() -> None:
    robot = pk.load("hexapod")
    found = pk.tolerance(robot, robot.home, 0.5, samples=2)
    places = [robot.geometry.names.index(name) for name in found.names]
    linear = 1.5 * np.abs(robot.error_jacobian(robot.home)[:, places]).sum(axis=1)
    assert (found.worst_case >= linear * (1 - 1e-9)).sum() >= 3
    assert np.abs(found.worst_case / linear - 1).max() > 1e-3
    gone = pk.tolerance(robot, robot.home + NEARLY_SINGULAR, 5.0, samples=2)
    assert (gone.worst_case == np.inf).any()


def test_intervals_of_small_errors_are_those_of_a_normal_distribution() -> None:
    robot = pk.load("hexapod")
    found = pk.tolerance(robot, robot.home, 1e-3, samples=200_000)
    scaled95 = found.interval95 / found.linear_std[:, None]
    scaled997 = found.interval997 / found.linear_std[:, None]
    np.testing.assert_allclose(scaled95, np.tile([-1.95996, 1.95996], (6, 1)), atol=0.03)
    np.testing.assert_allclose(scaled997, np.tile([-2.96774, 2.96774], (6, 1)), atol=0.1)


def test_intervals_are_quantiles_of_the_machines_that_were_drawn(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    kept: list[np.ndarray] = []
    add = monte_carlo.Stream.add
    monkeypatch.setattr(
        monte_carlo.Stream, "add", lambda self, v: (kept.append(v.copy()), add(self, v))[1]
    )
    found = pk.tolerance(pk.load("2tpr2tps"), [10, 20, 400, 0.2, 0.1, 0], 0.5, samples=SAMPLES)
    drawn = np.concatenate(kept, axis=1)
    assert drawn.shape == (7, SAMPLES)
    bin_width = drawn.std(axis=1) / 100  # a 128th of the pilot's spread
    bin_width += 1e-12  # of gamma, which does not vary
    for name, ends in (("interval95", (0.025, 0.975)), ("interval997", (0.0015, 0.9985))):
        exact = np.quantile(drawn[:6], ends, axis=1).T
        assert (np.abs(getattr(found, name) - exact) <= bin_width[:6, None]).all()
    assert abs(found.distance95 - np.quantile(drawn[6], 0.95)) <= bin_width[6]
    assert abs(found.distance997 - np.quantile(drawn[6], 0.997)) <= bin_width[6]
    np.testing.assert_allclose(found.mean, drawn[:6].mean(axis=1), atol=1e-12)
    np.testing.assert_allclose(found.std, drawn[:6].std(axis=1, ddof=1), rtol=1e-9, atol=1e-15)
    distance = np.linalg.norm(drawn[:3], axis=0)
    assert found.distance_rms == pytest.approx(np.sqrt((distance**2).mean()))


def test_large_errors_are_biased_as_the_second_order_says() -> None:
    robot = pk.load("2tpr2tps")
    found = pk.tolerance(robot, robot.home, {"offset1": 4.0}, samples=100_000)
    q, h = robot.inverse(robot.home), 0.5
    two = [robot.replace({"offset1": s * h}).forward(q).pose - robot.home for s in (1, -1)]
    bias = (two[0] + two[1]) / h**2 / 2 * 4.0**2
    assert found.mean[2] == pytest.approx(bias[2], rel=0.1)
    assert abs(found.mean[2]) > 5 * found.std[2] / np.sqrt(100_000)


# --- the same numbers, whoever computes them -----------------------------------------------------


def test_the_same_seed_gives_the_same_bits_and_another_seed_others(reference: Tolerance) -> None:
    robot = pk.load("2tpr2tps")
    assert_same_bits(pk.tolerance(robot, several_poses(), 0.1, samples=SAMPLES, seed=5), reference)
    other = pk.tolerance(robot, several_poses(), 0.1, samples=SAMPLES, seed=6)
    assert (other.mean[:, :5] != reference.mean[:, :5]).all()


@pytest.mark.parametrize("workers", [1, 2, 5])
def test_threads_give_the_same_bits(workers: int, reference: Tolerance) -> None:
    with ThreadPoolExecutor(workers) as executor:
        found = pk.tolerance(
            pk.load("2tpr2tps"), several_poses(), 0.1, samples=SAMPLES, seed=5, executor=executor
        )
    assert_same_bits(found, reference)


def test_processes_give_the_same_bits(reference: Tolerance) -> None:
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(2, mp_context=context) as executor:
        found = pk.tolerance(
            pk.load("2tpr2tps"), several_poses(), 0.1, samples=SAMPLES, seed=5, executor=executor
        )
    assert_same_bits(found, reference)


class Backwards(Executor):
    """Runs a task only when a later one was submitted, or at its result: always out of order."""

    def __init__(self) -> None:
        self.waiting: list[tuple[Future[Any], Any, Any]] = []

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        future.result = lambda timeout=None: self._all(future)  # type: ignore[method-assign]
        self.waiting.append((future, fn, args))
        return future

    def _all(self, future: Future[Any]) -> Any:
        for other, fn, args in reversed(self.waiting):
            other.set_result(fn(*args))
        self.waiting = []
        return Future.result(future)


def test_the_order_in_which_chunks_are_done_does_not_matter(reference: Tolerance) -> None:
    found = pk.tolerance(
        pk.load("2tpr2tps"), several_poses(), 0.1, samples=SAMPLES, seed=5, executor=Backwards()
    )
    assert_same_bits(found, reference)


def test_poses_do_not_influence_each_other(reference: Tolerance) -> None:
    robot = pk.load("2tpr2tps")
    alone = pk.tolerance(robot, several_poses()[1], 0.1, samples=SAMPLES, seed=5)
    for name in ARRAYS:
        expected = getattr(reference, name)[1]
        np.testing.assert_allclose(getattr(alone, name), expected, rtol=1e-12, atol=1e-15)


def test_more_poses_than_a_task_takes_come_back_in_their_order() -> None:
    robot = pk.load("2tpr2tps")
    at = poses("2tpr2tps", 2 * monte_carlo.POSES + 3)
    found = pk.tolerance(robot, at.reshape(5, 7, 6), 1e-3, samples=5_000)
    assert found.std.shape == (5, 7, 6) and found.interval95.shape == (5, 7, 6, 2)
    assert found.distance95.shape == found.n_failed.shape == (5, 7)
    np.testing.assert_allclose(found.std[..., 1:5], found.linear_std[..., 1:5], rtol=0.05)


def test_a_failing_worker_is_heard_and_the_rest_is_called_off() -> None:
    class Broken(ThreadPoolExecutor):
        def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
            future: Future[Any] = Future()
            future.set_exception(OSError("no worker"))
            return future

    with Broken(1) as executor, pytest.raises(OSError, match="no worker"):
        pk.tolerance(
            pk.load("2tpr2tps"), several_poses(), 0.1, samples=SAMPLES, seed=5, executor=executor
        )


def test_memory_does_not_grow_with_the_samples() -> None:
    robot = pk.load("2tpr2tps")
    peaks = []
    for chunks in (2, 12):
        tracemalloc.start()
        pk.tolerance(robot, robot.home, 0.1, samples=chunks * monte_carlo.CHUNK)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 1.1 * peaks[0]
    assert peaks[1] < 20e6


def test_progress_grows_to_the_whole() -> None:
    steps: list[tuple[int, int]] = []
    pk.tolerance(
        pk.load("2tpr2tps"),
        several_poses(),
        0.1,
        samples=SAMPLES,
        progress=lambda done, total: steps.append((done, total)),
    )
    done = [step[0] for step in steps]
    assert done == sorted(done) and len(set(done)) == len(done) == 3
    assert steps[-1] == (3 * SAMPLES, 3 * SAMPLES)


# --- what goes wrong -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "sigma"),
    [("linear-delta", 45.0), ("linear-delta", 60.0), ("6-rus", 30.0), ("6-rus", 60.0)],
)
def test_machines_without_a_pose_are_beyond_every_limit(
    name: str, sigma: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept: list[np.ndarray] = []
    add = monte_carlo.Stream.add
    monkeypatch.setattr(
        monte_carlo.Stream, "add", lambda self, v: (kept.append(v.copy()), add(self, v))[1]
    )
    robot = pk.load(name)
    found = pk.tolerance(robot, robot.home, {"rod*": sigma}, samples=5_000)
    drawn = np.concatenate(kept, axis=1)
    lost = np.isnan(drawn[0])
    assert found.n_failed == lost.sum() > 0
    solved = drawn[:, ~lost]
    np.testing.assert_allclose(found.mean, solved[:6].mean(axis=1), atol=1e-9)
    np.testing.assert_allclose(found.std, solved[:6].std(axis=1, ddof=1), rtol=1e-9, atol=1e-12)
    width = 0.02 * drawn[:, ~lost].std(axis=1) + 1e-9  # two bins: between two values of few
    drawn[6, lost] = np.inf
    drawn[:6, lost] = np.where(np.arange(lost.sum()) % 2, np.inf, -np.inf)  # as many either way
    for share, at in ((0.95, found.distance95), (0.997, found.distance997)):
        assert_beyond(at, np.quantile(drawn[6], share, method="higher"), width[6])
    for ends, shares in (
        (found.interval95, (0.025, 0.975)),
        (found.interval997, (0.0015, 0.9985)),
    ):
        for k, share in enumerate(shares):
            method: Any = "higher" if k else "lower"
            exact = np.quantile(drawn[:6], share, axis=1, method=method)
            assert_beyond(ends[:, k], exact, width[:6])
    assert f"{int(found.n_failed)} of 5000 machines have no pose" in str(found)


def assert_beyond(found: Any, exact: Any, width: Any) -> None:
    same_end = np.isinf(found) & (found == exact)
    assert (same_end | (np.abs(found - np.where(np.isinf(exact), np.nan, exact)) <= width)).all()


def test_no_share_of_machines_is_said_to_be_within_what_fewer_reach() -> None:
    """Near Fichter's singularity nearly half of these hexapods have no pose."""
    robot = pk.load("hexapod")
    found = pk.tolerance(robot, robot.home + NEARLY_SINGULAR, 0.5, samples=5_000)
    assert found.n_failed > 0.3 * 5_000
    assert found.distance95 == found.distance997 == np.inf
    assert (found.interval95 == [-np.inf, np.inf]).all()
    assert "95 % of the machines within no limit, 99.7 % within no limit" in str(found)
    both = pk.tolerance(robot, [robot.home, robot.home + NEARLY_SINGULAR], 0.5, samples=5_000)
    assert "95 % of the machines within no limit" in str(both)  # a rms over poses is no less
    assert f"{int(both.n_failed.sum())} of 10000 machines at 2 poses have no pose" in str(both)


def test_a_pose_out_of_reach_is_nan() -> None:
    robot = pk.load("linear-delta")
    found = pk.tolerance(robot, [robot.home, [5000.0, 0, 0, 0, 0, 0]], 0.1, samples=1_000)
    assert found.n_failed.tolist() == [0, 1_000]
    for name in ARRAYS[:-1]:
        assert np.isnan(getattr(found, name)[1]).all(), name
        assert np.isfinite(getattr(found, name)[0]).all(), name
    str(found)


def test_one_sigma_is_for_every_length() -> None:
    robot = pk.load("linear-delta")
    places, sigma = sigma_of(robot, 0.2)
    units = [robot.geometry.units[place] for place in places]
    assert set(units) == {"mm"} and (sigma == 0.2).all()
    assert len(places) == list(robot.geometry.units).count("mm")


def test_later_entries_override_and_arrays_go_by_place() -> None:
    robot = pk.load("2tpr2tps")
    given = {"base*": 0.1, "base2.*": 0.3, "base2.y": 0.0, "offset1": 0.05}
    by_name = pk.tolerance(robot, robot.home, given, samples=2)
    sigma = dict(zip(by_name.names, by_name.sigma, strict=True))
    assert sigma["base1.x"] == 0.1 and sigma["base2.z"] == 0.3 and sigma["offset1"] == 0.05
    assert "base2.y" not in sigma and len(sigma) == 12
    array = np.zeros(len(robot.geometry))
    array[[robot.geometry.names.index(name) for name in sigma]] = list(sigma.values())
    assert_same_bits(pk.tolerance(robot, robot.home, array, samples=2), by_name)


@pytest.mark.parametrize(
    ("sigma", "error", "words"),
    [
        ({"bse1.x": 0.1}, ValueError, "did you mean 'base1.x'"),
        (-0.1, ValueError, "sigma must be 0 or more, found -0.1"),
        ({"offset1": float("inf")}, ValueError, "sigma of offset1 must be finite"),
        ({"offset1": "wide"}, TypeError, "sigma of offset1 must be a number"),
        ({"*": 0.1}, ValueError, "covers numbers in 1 and mm; name them apart"),
        (0.0, ValueError, "sigma must be above 0"),
        (np.ones(5), ValueError, r"sigma must have shape \(32,\), found \(5,\)"),
    ],
)
def test_a_wrong_sigma_is_named(sigma: Any, error: type, words: str) -> None:
    robot = pk.load("2tpr2tps")
    with pytest.raises(error, match=words):
        pk.tolerance(robot, robot.home, sigma, samples=10)


def test_one_sigma_is_refused_where_there_are_no_lengths() -> None:
    robot = pk.load("agile-eye")
    with pytest.raises(
        ValueError, match="sigma: one number is for lengths, and agile eye has none"
    ):
        pk.tolerance(robot, robot.home, 0.01, samples=10)
    assert pk.tolerance(robot, robot.home, {"offset*": 0.01}, samples=10).std[3:].all()


def test_a_tied_number_has_no_sigma_of_its_own() -> None:
    robot = pk.load(DELTA)
    with pytest.raises(ValueError, match="driven by the parameter"):
        pk.tolerance(robot, robot.home, {"base1.x": 0.1}, samples=10)
    sigma = np.zeros(len(robot.geometry))
    sigma[robot.geometry.names.index("base1.x")] = 0.1
    with pytest.raises(ValueError, match="driven by the parameter"):
        pk.tolerance(robot, robot.home, sigma, samples=10)


@pytest.mark.parametrize("samples", [0, 1, 2.5, True, "many"])
def test_samples_are_a_whole_number_from_two(samples: Any) -> None:
    robot = pk.load("2tpr2tps")
    with pytest.raises(ValueError, match="samples must be a whole number from 2"):
        pk.tolerance(robot, robot.home, 0.1, samples=samples)


def test_no_poses_are_refused() -> None:
    with pytest.raises(ValueError, match="poses must be at least one"):
        pk.tolerance(pk.load("2tpr2tps"), np.empty((0, 6)), 0.1, samples=10)


def test_the_report_lists_what_matters_most_first() -> None:
    robot = pk.load("2tpr2tps")
    found = pk.tolerance(
        robot, robot.home, {"offset1": 0.2, "offset3": 0.1, "base*.x": 0.01}, samples=500
    )
    listed = [line.split()[0] for line in str(found).splitlines()[-6:]]
    order = np.argsort(-found.position_share, kind="stable")
    assert listed == [found.names[k] for k in order]
    assert listed[0] == "offset1"
