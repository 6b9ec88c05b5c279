"""When a measurement stops, what it says on the way, and the same out of a log."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.live.course import UNSTATED, Course
from pkmcal.live.replay import places, replayed

ROOT = Path(__file__).resolve().parents[2]
PRINTER = pk.load(ROOT / "examples" / "linear-delta" / "robot.toml")
NOISE, UP = 0.03, (0.0, 0.0, 1.0)


def bed(count: int = 40) -> Any:
    random = np.random.default_rng(4)
    radius, turn = 110.0 * np.sqrt(random.uniform(0, 1, count)), random.uniform(0, 2 * np.pi, count)
    poses = np.zeros((count, 6))
    poses[:, 0], poses[:, 1], poses[:, 2] = radius * np.cos(turn), radius * np.sin(turn), 5.0
    return poses


def log_of(seed: int, stated: float | None = NOISE, true: float = NOISE) -> pk.Measurements:
    random = np.random.default_rng(seed)
    off = random.normal(0, 0.4, 3)
    machine = PRINTER.replace({f"offset{i + 1}": PRINTER.geometry[f"offset{i + 1}"] + off[i]
                               for i in range(3)})  # fmt: skip
    log = pk.VirtualMachine(machine, true, seed=seed).measure(PRINTER.inverse(bed()), "height")
    return replace(log, sigma=stated)


def begun(accuracy: float | None, stated: bool = True, **given: Any) -> Course:
    noise = NOISE if stated else UNSTATED
    choice = pk.next_pose(PRINTER, bed(), kind="height", noise=noise, direction=UP)
    return Course(choice, stated, accuracy, **given)


def ran(course: Course, log: pk.Measurements) -> list[Course]:
    return list(replayed(course, log, list(np.arange(len(log))[:, None])))


def test_the_prediction_at_the_stop_is_that_of_the_calibration() -> None:
    """By its covariance, which knows nothing of the plan."""
    last = ran(begun(0.02), log_of(1))[-1]
    assert last.reached and last.scatter == 1.0
    poses = bed()
    free = [PRINTER.geometry.names.index(name) for name in last.found.free]
    by = last.found.robot.error_jacobian(poses)[:, 2, free]
    wanted = np.sqrt(np.einsum("ni,ij,nj->n", by, last.found.covariance, by).mean())
    assert last.predicted == pytest.approx(wanted, rel=0.01)


def test_it_stops_as_soon_as_the_accuracy_is_there_and_not_before() -> None:
    courses = ran(begun(0.0150), log_of(1))
    assert [course.reached for course in courses].index(True) == len(courses) - 1
    assert courses[-2].predicted > 0.0150 >= courses[-1].predicted


def test_a_noise_of_twice_what_was_stated_makes_it_measure_more() -> None:
    counts = {
        true: np.mean([ran(begun(0.018), log_of(seed, NOISE, true))[-1].poses for seed in range(2)])
        for true in (NOISE, 2 * NOISE)
    }
    assert counts[2 * NOISE] > 1.3 * counts[NOISE]


def test_a_noise_that_is_not_stated_is_told_by_the_readings() -> None:
    last = ran(begun(0.03, stated=False), log_of(2, None))[-1]
    assert last.reached and last.found.dof >= 12
    # the largest that is likely is above what was found, and within a factor of what is true
    assert last.found.noise[0] < last.scatter < 3 * NOISE


@pytest.mark.slow
def test_the_intervals_hold_what_they_promise_where_it_stops() -> None:
    """40 runs of 6 numbers; `benchmarks.bench_measure` has 1000."""
    inside = []
    for seed in range(100, 140):
        random = np.random.default_rng(seed)
        off = dict(zip(("offset1", "offset2", "offset3"), random.normal(0, 0.4, 3), strict=True))
        true = PRINTER.replace({name: PRINTER.geometry[name] + x for name, x in off.items()})
        log = pk.VirtualMachine(true, NOISE, seed=seed).measure(PRINTER.inverse(bed()), "height")
        found = ran(begun(0.02), log)[-1].found
        low, high = found.interval95.T
        truth = np.array([true.geometry[name] for name in found.free])
        inside.append((low <= truth) & (truth <= high))
    assert 0.89 <= np.mean(inside) <= 0.99


def test_a_count_ends_it() -> None:
    assert ran(begun(None, count=7), log_of(3))[-1].poses == 7
    assert ran(begun(None), log_of(3))[-1].poses == len(begun(None).choice.indices)


def test_poses_of_a_log_are_those_of_its_rows(hexapod: pk.Robot) -> None:
    poses = pk.sample_poses(hexapod, 8)
    q = np.repeat(hexapod.inverse(poses), 3, axis=0)
    log = pk.VirtualMachine(hexapod, 0.01).measure(q, "pose")
    found, rows = places(hexapod, log)
    np.testing.assert_allclose(found, poses, atol=1e-6)
    assert [each.tolist() for each in rows] == [[3 * i, 3 * i + 1, 3 * i + 2] for i in range(8)]


def test_replay_says_how_many_rows_were_enough(
    run: Any, refused: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "robot.toml").write_text((ROOT / "examples/linear-delta/robot.toml").read_text())
    log_of(1).write(tmp_path / "log.csv")
    command = ("measure", "robot.toml", "--replay", "log.csv", "--noise", NOISE, "--direction", "z")
    result = run(*map(str, command), "--accuracy", "0.02")
    said = result.stdout.splitlines()
    choice = pk.next_pose(PRINTER, places(PRINTER, log_of(1))[0], kind="height", noise=NOISE,
                          direction=UP)  # fmt: skip
    last = ran(Course(choice, True, 0.02), log_of(1))[-1]
    assert said[-3].startswith(f"{last.poses} poses, {last.poses} rows: predicted error")
    assert said[-1].endswith("enough") and result.exit_code == 0
    result = run(*map(str, command), "--count", "3")
    assert "too few to identify" in result.stdout and result.exit_code == 0
    assert "all 40 candidates together predict" in refused(*map(str, command), "--accuracy", "1e-3")
    both = refused(*map(str, command), "--machine", "person")
    assert "nothing is driven" in both
