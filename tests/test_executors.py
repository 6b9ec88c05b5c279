"""Many machines at once: what is handed to processes or Dask comes back as from this one."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any

import numpy as np
import pytest

import pkmcal as pk

MACHINES = ("hexapod", "linear-delta", "2tpr2tps")


@pytest.fixture(params=["processes", "dask"])
def executor(request: pytest.FixtureRequest) -> Iterator[Executor]:
    if request.param == "processes":
        with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
            yield pool
        return
    distributed = pytest.importorskip("distributed", reason="needs the extra pkmcal[dask]")
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client.get_executor()


def solved(robot: pk.Robot, poses: np.ndarray) -> tuple[np.ndarray, list[np.ndarray], list[int]]:
    """Rows of a table, every assembly mode of some, and a plan."""
    q = robot.inverse(poses)
    modes = [mode.poses for mode in (robot.forward_all(row) for row in q[:2])]
    plan = pk.plan_poses(robot, poses, 8, prior=0.5)
    return robot.forward(q).pose, modes, plan.indices.tolist()


def calibrated(robot: pk.Robot, log: pk.Measurements) -> pk.Identification:
    return pk.identify(robot, log, free="offset*", prior=0.5)


@pytest.mark.slow
@pytest.mark.filterwarnings("default")
def test_many_machines_at_once_are_each_as_alone(executor: Any) -> None:
    robots = [pk.load(name) for name in MACHINES]
    poses = [pk.sample_poses(robot, 30) for robot in robots]
    logs = [
        pk.VirtualMachine(robot, 0.01, seed=k).measure(robot.inverse(at))
        for k, (robot, at) in enumerate(zip(robots, poses, strict=True))
    ]
    for alone, apart in zip(
        map(solved, robots, poses), executor.map(solved, robots, poses), strict=True
    ):
        assert alone[0].tobytes() == apart[0].tobytes()
        assert [each.tobytes() for each in alone[1]] == [each.tobytes() for each in apart[1]]
        assert alone[2] == apart[2]
    for alone, apart in zip(
        map(calibrated, robots, logs), executor.map(calibrated, robots, logs), strict=True
    ):
        assert np.abs(alone.values - apart.values).max() < 1e-4 * alone.stderr.min()
