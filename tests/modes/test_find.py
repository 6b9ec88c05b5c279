"""Every assembly mode: found, proven, and never called complete when a path is missing."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.core.paths import FAR, LOST, Paths
from pkmcal.modes import homotopy

from .. import dietmaier, robots, twin_rows

SQUARE = [
    *("2tpr2tps", "2tpr2tps-spatial", "rbt-6t03p", "hexapod", "linear-delta", "rotary-delta"),
    *("6-rus", "3rps", "3prs", "3rrr-planar"),
]


def near_home(robot: pk.Robot, seed: int = 0) -> np.ndarray:
    q = robot.inverse(robot.home)
    return q + np.random.default_rng(seed).normal(size=q.shape) * (0.02 * np.abs(q) + 0.01)


def stroke_lengths(count: int, seed: int = 1) -> np.ndarray:
    """Leg lengths of the 2TPR&2TPS at poses of its workspace."""
    robot, rng = pk.load("2tpr2tps"), np.random.default_rng(seed)
    low, high = [0, -60, 330, -0.35, -0.35, 0], [0, 60, 450, 0.35, 0.35, 0]
    poses = rng.uniform(low, high, (4 * count, 6))
    poses[:, 0] = poses[:, 2] * np.tan(poses[:, 4])
    return robot.inverse(poses[robot.feasible(poses).ok])[:count]


@pytest.mark.parametrize("name", SQUARE)
def test_modes_of_builtin_machines_are_complete_certified_and_close(name):
    robot = pk.load(name)
    q = near_home(robot)
    modes = robot.forward_all(q)
    assert modes.complete and modes.certified.all() and len(modes) >= 2
    every = np.broadcast_to(q, (len(modes), len(q)))
    residual = twin_rows.closures(robot.model, modes.poses, every)
    assert np.abs(residual).max() < 1e-8
    found = robot.forward(q)
    assert found.ok
    assert np.abs(modes.poses[modes.nearest(found.pose)] - found.pose).max() < 1e-8


def test_forty_real_modes_of_dietmaiers_hexapod_are_all_found():
    modes = dietmaier.hexapod().forward_all(dietmaier.LENGTHS)
    assert len(modes) == modes.paths == 40
    assert modes.complete and modes.certified.all()
    assert modes.far == modes.lost == 0
    assert "40" in str(modes)


def test_balls_in_which_modes_are_unique_hold_one_mode_each():
    robot = dietmaier.hexapod()
    modes = robot.forward_all(dietmaier.LENGTHS)
    for k in range(len(modes)):
        apart = modes._distance(modes.poses[[k]])
        apart[k] = np.inf
        assert apart.min() > modes.unique[k] - modes.error.max()


def check_stroke(lengths: np.ndarray) -> None:
    robot = pk.load("2tpr2tps")
    for q in lengths:
        modes = robot.forward_all(q)
        assert modes.complete and modes.certified.all() and modes.paths == 24
        assert len(modes) == 8
        assert (modes.mirror[modes.mirror] == np.arange(8)).all()
        assert (modes.mirror != np.arange(8)).all()
        flipped = modes.poses[modes.mirror] * [1, 1, -1, 1, 1, 1]
        assert np.abs(modes.poses[:, :3] - flipped[:, :3]).max() < 1e-6
        inside = (modes.poses[:, 2] > 0) & (np.abs(modes.poses[:, 3:5]) < np.pi / 2).all(axis=1)
        assert inside.sum() == 1


def test_2tpr2tps_in_its_stroke_has_eight_modes_in_mirror_pairs_and_one_is_the_working_one():
    check_stroke(stroke_lengths(50))


@pytest.mark.slow
def test_2tpr2tps_has_eight_modes_over_ten_thousand_length_sets():
    check_stroke(stroke_lengths(10_000))


def test_2tpr2tps_of_general_geometry_has_32_paths_and_of_published_structure_24():
    robot = pk.load("2tpr2tps")
    q = stroke_lengths(1)[0]
    assert robot.forward_all(q).paths == 24
    rng = np.random.default_rng(3)
    free = [n for n in robot.geometry.names if n.startswith(("base", "platform"))]
    bent = robot.replace({n: robot.geometry[n] + rng.normal() for n in free})
    modes = bent.forward_all(q)
    assert modes.paths == 32 and modes.far == 0
    assert modes.complete and len(modes) == 8


def lose(monkeypatch: pytest.MonkeyPatch, change: Any) -> None:
    """Have every run of the paths come back changed."""
    honest = homotopy.follow
    monkeypatch.setattr(homotopy, "follow", lambda *arguments: change(honest(*arguments)))


class SameEnd:
    """Which path of each run ends where a given one of the first run did; None where none does."""

    def __init__(self, path: int) -> None:
        self.path = path
        self.end: np.ndarray | None = None

    def __call__(self, paths: Paths) -> int | None:
        if self.end is None:
            self.end = paths.frame[self.path].copy()
        apart = np.abs(paths.frame - self.end).max(axis=1)
        return int(apart.argmin()) if apart.min() < 1e-6 else None


@pytest.mark.parametrize("path", [0, 17, 39])
def test_a_lost_path_is_never_complete(monkeypatch, path):
    same = SameEnd(path)

    def change(paths: Paths) -> Paths:
        if (which := same(paths)) is not None:
            paths.status[which] = LOST
        return paths

    lose(monkeypatch, change)
    modes = dietmaier.hexapod().forward_all(dietmaier.LENGTHS, starts=0)
    assert not modes.complete and modes.lost == 1 and "paths failed" in modes.reason
    assert len(modes) == 39 and modes.certified.all()


@pytest.mark.parametrize("path", [0, 17, 39])
def test_a_path_that_jumped_onto_another_is_never_complete(monkeypatch, path):
    same = SameEnd(path)

    def change(paths: Paths) -> Paths:
        if (which := same(paths)) is not None:
            paths.frame[which] = paths.frame[which - 1]
        return paths

    lose(monkeypatch, change)
    modes = dietmaier.hexapod().forward_all(dietmaier.LENGTHS, starts=0)
    assert not modes.complete and modes.lost == 1 and len(modes) == 39


def test_a_path_lost_by_one_way_is_found_by_another(monkeypatch):
    def change(paths: Paths) -> Paths:
        paths.status[5] = LOST
        return paths

    lose(monkeypatch, change)
    modes = dietmaier.hexapod().forward_all(dietmaier.LENGTHS, starts=0)
    assert modes.complete and len(modes) == 40


def test_a_path_that_jumped_onto_one_to_infinity_is_found_out_by_the_other_way(monkeypatch):
    calls = []

    def change(paths: Paths) -> Paths:
        if not calls:
            real = np.abs(paths.frame.imag).max(axis=1) < 1e-8
            paths.status[np.flatnonzero(real)[0]] = FAR
        calls.append(1)
        return paths

    robot = pk.load("hexapod")
    honest = robot.forward_all(near_home(robot))
    lose(monkeypatch, change)
    modes = robot.forward_all(near_home(robot))
    assert len(modes) == len(honest)
    assert modes.complete and modes.far == honest.far


def test_random_starts_find_no_mode_that_complete_ones_lack():
    for name in ("2tpr2tps", "3rps", "hexapod", "3rrr-planar"):
        robot = pk.load(name)
        modes = robot.forward_all(near_home(robot), starts=4000)
        assert modes.complete
        assert len(modes) == len(robot.forward_all(near_home(robot), starts=0))


def test_a_double_mode_is_not_certified_and_not_complete():
    """A delta whose carriages are level and as far out as the rods are long: both modes are one."""
    robot = robots.linear_delta(rod=160.0, radius=160.0)
    modes = robot.forward_all([300.0, 300.0, 300.0], starts=0)
    assert not modes.certified.any()
    assert not modes.complete


@pytest.mark.parametrize("closeness", [1e-2, 1e-5, 1e-8, 1e-11])
def test_nearly_double_modes_are_two_or_not_called_complete(closeness):
    for rod, count in ((160.0 * (1 + closeness), 2), (160.0 * (1 - closeness), 0)):
        modes = robots.linear_delta(rod=rod, radius=160.0).forward_all([300.0] * 3, starts=0)
        assert not modes.complete or len(modes) == count
        assert modes.certified.sum() in (0, count)
        if closeness > 1e-6:
            assert modes.complete


@pytest.mark.parametrize("name", ["3rrr-planar", "2tpr2tps", "hexapod", "3rps"])
def test_up_to_a_singularity_modes_are_complete_and_in_pairs_or_not_called_complete(name):
    """Towards coordinates where two modes meet and vanish, by bisection down to rounding."""
    robot = pk.load(name)
    inside, rng = near_home(robot), np.random.default_rng(2)
    count = len(robot.forward_all(inside))
    reach = 0.3 * (np.abs(inside) + 0.5)
    outside = next(
        q
        for q in inside + rng.normal(size=(50, len(inside))) * reach
        if len(robot.forward_all(q, starts=0)) < count
    )
    low, high = 0.0, 1.0
    for _ in range(54):
        middle = (low + high) / 2.0
        modes = robot.forward_all(inside + middle * (outside - inside), starts=0)
        if modes.complete:
            assert len(modes) % 2 == 0 and modes.certified.all()
        else:
            assert high - low < 1e-6
        low, high = (middle, high) if len(modes) >= count else (low, middle)
    assert not modes.complete


def test_a_machine_that_cannot_be_assembled_has_no_modes_and_that_is_complete():
    modes = pk.load("linear-delta").forward_all([100.0, 900.0, 100.0])
    assert len(modes) == 0 and modes.complete


def test_self_motion_is_not_complete():
    robot = robots.griffis_duffy()
    modes = robot.forward_all(robot.inverse([0, 0, 300, 0, 0, 0.3]), starts=50)
    assert not modes.complete and not modes.certified.any()


def test_more_closures_than_coordinates_are_left_to_random_starts():
    robot = pk.load("examples/2tpr2tps-eight-rows.toml")
    modes = robot.forward_all(robot.inverse(robot.home), starts=200)
    assert not modes.complete and "more closures" in modes.reason
    assert not modes.certified.any() and not modes.sign.any()
    home = modes.poses[modes.nearest(robot.home)]
    assert np.abs(home - robot.home).max() < 1e-6


def test_frames_of_the_robot_are_respected():
    plain = robots.hexapod()
    moved = robots.hexapod(frames={"base": {"x": 10.0, "gamma": 0.3}, "tool": {"z": 25.0}})
    q = near_home(plain)
    modes, same = moved.forward_all(q), plain.forward_all(q)
    assert modes.complete and len(modes) == len(same)
    assert np.abs(moved.inverse(modes.poses) - q).max() < 1e-8
    assert not np.allclose(modes.poses, same.poses)


@pytest.mark.parametrize("name", ["2tpr2tps", "hexapod", "6-rus", "linear-delta-6"])
@pytest.mark.parametrize("error", [1e-12, 1e-6, 1e-3, 1e-1])
def test_errors_of_the_geometry_bring_solutions_back_from_infinity_and_modes_stay(name, error):
    robot = pk.load(name)
    q = near_home(robot)
    noise = error * np.random.default_rng(3).normal(size=len(robot.geometry.names))
    joints = zip(robot.geometry.names, noise, strict=True)
    changes = {n: robot.geometry[n] + e for n, e in joints if n.startswith(("base", "platform"))}
    modes, nominal = robot.replace(changes).forward_all(q), robot.forward_all(q)
    assert modes.complete and modes.certified.all()
    assert len(modes) == len(nominal)
    if error == 1e-12:
        assert modes.far >= nominal.far
        assert np.abs(modes.poses[0] - nominal.poses[0]).max() < 1e-9


@pytest.mark.parametrize("q", [[800.0] * 5 + [-800.0], [800.0] * 5 + [np.nan]])
def test_coordinates_without_a_sphere_have_no_modes_and_say_why(q):
    modes = pk.load("hexapod").forward_all(q)
    assert len(modes) == 0 and not modes.complete and "length" in modes.reason


def test_order_of_limbs_does_not_matter():
    robot = pk.load("3rps")
    q = near_home(robot)
    limbs = [
        {"kind": "RPS", "base": g[0:3], "platform": g[3:6], "normal": limb.frame[:, 2]}
        for g, limb in zip(robot.geometry.slots, robot.model.limbs, strict=True)
    ]
    turned = robots.made("spatial", {"z": 1640.0}, limbs[::-1])
    assert len(turned.forward_all(q[::-1])) == len(robot.forward_all(q))


def test_machine_stays_in_the_mode_it_is_in():
    robot = pk.load("2tpr2tps")
    pose = robot.complete([0, 10, 400, 0.1, 0.05, 0])
    modes = robot.forward_all(stroke_lengths(1)[0])
    mine = modes.reached_from(pose)
    inside = (modes.poses[:, 2] > 0) & (np.abs(modes.poses[:, 3:5]) < np.pi / 2).all(axis=1)
    assert mine == np.flatnonzero(inside)[0]
    assert modes.feasible[mine]
    at_mirror = modes.poses[modes.mirror[mine]]
    assert modes.reached_from(at_mirror) == modes.mirror[mine]


def test_no_mode_is_reached_across_a_singularity():
    robot = pk.load("linear-delta")
    q = np.array([200.0, 200.0, 200.0])
    modes = robot.forward_all(q + 10.0)
    assert sorted(modes.sign) == [-1, 1]
    for pose in robot.forward_all(q).poses:
        reached = modes.reached_from(pose, q)
        assert np.abs(modes.poses[reached] - pose - [0, 0, 10, 0, 0, 0]).max() < 1e-8
    far = robot.inverse(robot.home) + np.array([0.0, 0.0, 600.0])
    assert robot.forward_all(far).reached_from(robot.home) is None


def test_wrong_arguments_are_named():
    robot = pk.load("hexapod")
    with pytest.raises(ValueError, match="q must have shape"):
        robot.forward_all(np.zeros((2, 6)))
    with pytest.raises(ValueError, match="starts"):
        robot.forward_all(np.full(6, 800.0), starts=-1)
    modes = robot.forward_all(near_home(robot))
    with pytest.raises(ValueError, match="pose must have shape"):
        modes.nearest(np.zeros((2, 6)))
    with pytest.raises(ValueError, match="no modes"):
        pk.load("linear-delta").forward_all([100.0, 900.0, 100.0]).nearest(np.zeros(6))


@pytest.mark.slow
def test_homotopy_and_exhaustive_starts_agree_on_a_thousand_random_hexapods():
    rng = np.random.default_rng(5)
    counts = []
    for _ in range(1000):
        points = rng.normal(size=(2, 6, 3)) * 300.0
        limbs = [
            {"kind": "UPS", "base": a, "platform": b}
            for a, b in zip(points[0], points[1], strict=True)
        ]
        robot = robots.made("spatial", {"z": 0.0}, limbs)
        pose = np.concatenate([rng.normal(size=3) * 200.0, rng.uniform(-1.5, 1.5, 3)])
        q = robot.inverse(pose)
        modes = robot.forward_all(q, starts=0)
        assert modes.complete and modes.paths == 40 and len(modes) % 2 == 0
        assert modes._distance(pose[None]).min() < 1e-6
        both = robot.forward_all(q, starts=5000)
        assert len(both) == len(modes) and both.complete
        counts.append(len(modes))
    assert max(counts) <= 40 and min(counts) >= 2


def test_start_systems_are_read_once_and_their_counts_are_the_known_ones():
    known = {"hexapod": 40, "3rps": 16, "2tpr2tps-spatial": 32, "delta": 2, "planar": 6}
    known |= {"3prs": 16, "2tpr2tps": 32, "2tpr2tps-published": 24}
    families = homotopy._families()
    assert {f.start.name: len(f.start.states) for f in families} == known
    assert homotopy._families() is families
