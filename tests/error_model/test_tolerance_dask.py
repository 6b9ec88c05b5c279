"""Dask as executor: the same bits as without, also when a worker dies on the way."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator
from typing import Any

import pytest

import pkmcal as pk
from pkmcal.error_model import monte_carlo
from pkmcal.error_model.tolerance import Tolerance

from ..workspaces import poses
from .test_tolerance import assert_same_bits

distributed = pytest.importorskip("distributed", reason="the extra pkmcal[dask] is not installed")

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("default")]
CHUNKS = 60  # at two blocks of poses: more tasks than are on their way at a time


@pytest.fixture
def client() -> Iterator[Any]:
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client


def spread(executor: Any = None, progress: Any = None) -> Tolerance:
    robot = pk.load("2tpr2tps")
    at = poses("2tpr2tps", monte_carlo.POSES + 2)
    samples = CHUNKS // 2 * monte_carlo.CHUNK - 100
    return pk.tolerance(
        robot, at, 0.1, samples=samples, seed=3, executor=executor, progress=progress
    )


def test_two_worker_processes_give_the_same_bits(client: Any) -> None:
    assert_same_bits(spread(client.get_executor()), spread())


def test_a_killed_worker_loses_nothing(client: Any) -> None:
    before = client.run(os.getpid)
    victim = next(iter(before.values()))
    killed = threading.Event()

    def kill_midway(done: int, total: int) -> None:
        if done > total // 4 and not killed.is_set():
            os.kill(victim, signal.SIGKILL)
            killed.set()

    found = spread(client.get_executor(), kill_midway)
    assert killed.is_set()
    client.wait_for_workers(2)
    assert victim not in client.run(os.getpid).values()
    assert_same_bits(found, spread())
