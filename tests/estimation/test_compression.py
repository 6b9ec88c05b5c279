"""A picture's triangle has the squares, products and degrees of freedom of all its corners."""

from __future__ import annotations

import warnings
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.estimation.equations import Equations
from pkmcal.readings import Board, Camera

from ..sweeps import sweep

FREE = ["base*", "platform*", "offset*"]
BOARD = Board.chessboard(5, 4, 35)
LENS = {"fx": 1500.0, "fy": 1505.0, "cx": 640.0, "cy": 400.0, "k1": -0.15, "k2": 0.1, "p1": 1e-3}
STANDS, CARRIED = [-150, 120, 1950, 3.0, 0.1, 0.2], [0, 0, 20, np.pi, 0, 0.3]


def pictures(on: str = "base", count: int = 14, **options: Any) -> pk.Measurements:
    """Of a hexapod with errors in its joints and scatter in its legs; a corner here and there."""
    random, drawn = np.random.default_rng(3), pk.load("hexapod")
    names = drawn.geometry.match(FREE)
    true = drawn.replace({n: drawn.geometry[n] + random.normal(0.0, 0.3) for n in names})
    place: dict[str, Any] = {"stands": STANDS, "carried": CARRIED}
    if on == "platform":  # it looks up at a board that hangs above
        board = pk.screw.to_pose(np.linalg.inv(pk.screw.from_pose([60, -40, 1500, 0.1, 0, 0.3])))
        place = {"stands": board, "carried": [0, 0, 30, 0.05, -0.04, 0.2]}
    camera = Camera(**LENS, **place, on=on, **options)
    told = drawn.inverse(pk.sample_poses(drawn, count, seed=1, share=0.25))
    at, seeing = camera.seeing(told + random.normal(0.0, 0.02, told.shape), BOARD)
    seen = pk.VirtualMachine(true, 0.1, 5).measure(at, seeing)
    corners = len(BOARD.ids)
    whole = pk.Measurements(
        np.repeat(told, corners, axis=0), seen.values, seen.instrument,
        group=np.repeat(np.arange(count), corners),
    )  # fmt: skip
    return whole.select(np.flatnonzero(random.uniform(size=len(whole)) < 0.9))


def fitted(measured: pk.Measurements | list[pk.Measurements], **options: Any) -> pk.Identification:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", pk.CalibrationWarning)
        return pk.identify(pk.load("hexapod"), measured, FREE, **options)


@pytest.mark.parametrize("sigma", [None, 0.0], ids=["poses of their own", "exact actuators"])
@pytest.mark.parametrize(
    ("on", "options"),
    [("base", {}), ("platform", {"lens": "focal"}), ("base", {"lens": "all", "find_size": True})],
    ids=["known lens", "focal lengths", "lens and size"],
)
def test_triangles_have_the_squares_and_products_of_all_rows(
    on: str, options: dict[str, Any], sigma: Any
) -> None:
    measured = replace(pictures(on, **options), actuator_sigma=sigma)
    whole = fitted(measured).fit.estimator.equations
    fewer, random = whole.compressed, np.random.default_rng(0)
    assert fewer is not None and len(fewer.blocks.components) < len(measured)
    noise = random.uniform(0.5, 2.0, len(whole.blocks.unstated))
    theta = whole.parameters.start + 0.3 * whole.parameters.scale
    at = whole.at(theta, noise)
    several = [(each.residual(at, noise), each.by_parameters(at, noise)) for each in (whole, fewer)]
    (one, by_one), (other, by_other) = several
    assert len(other) < 0.6 * len(one)
    assert other @ other == pytest.approx(one @ one, rel=1e-12)
    size = np.linalg.norm(by_one, axis=0)
    gradient = size * np.linalg.norm(one)
    np.testing.assert_allclose(by_other.T @ other / gradient, by_one.T @ one / gradient, atol=1e-12)
    products = np.outer(size, size)
    np.testing.assert_allclose(
        by_other.T @ by_other / products, by_one.T @ by_one / products, atol=1e-12
    )
    leverage = np.linalg.inv(np.linalg.cholesky(by_one.T @ by_one + np.diag(size**2)))
    shares = [
        each.by_groups(at, noise, np.ones(len(each.blocks.components)), r, by @ leverage.T)
        for each, (r, by) in zip((whole, fewer), several, strict=True)
    ]
    for first, second in zip(*shares, strict=True):
        np.testing.assert_allclose(second, first, rtol=1e-9)


@sweep(
    "loss, sigma",  # None: pictures have poses of their own
    product(["linear", "cauchy"], [None, 0.0]),
    quick=[("linear", None), ("cauchy", 0.0)],
)
def test_a_fit_is_that_of_all_rows(monkeypatch: pytest.MonkeyPatch, loss: str, sigma: Any) -> None:
    """Within the search's tolerance; beside readings that are no pictures."""
    robot = pk.load("hexapod")
    places = robot.inverse(pk.sample_poses(robot, 20, seed=4, share=0.3))
    heights = pk.VirtualMachine(robot, 0.02, 1).measure(places, "height")
    sets = [
        replace(pictures(count=10), actuator_sigma=sigma),
        replace(heights, actuator_sigma=sigma),
    ]
    fewer = fitted(sets, loss=loss)
    monkeypatch.setattr(Equations, "compressed", None)
    whole = fitted(sets, loss=loss)
    assert fewer.free == whole.free and fewer.rank == whole.rank
    told = np.isfinite(whole.stderr)
    np.testing.assert_array_equal(np.isfinite(fewer.stderr), told)
    off = np.abs(fewer.values - whole.values)[told] / whole.stderr[told]
    assert off.max() < 1e-3
    np.testing.assert_allclose(fewer.stderr[told], whole.stderr[told], rtol=1e-4)
    assert fewer.rms == pytest.approx(whole.rms, rel=1e-6)
    assert fewer.dof == pytest.approx(whole.dof, rel=1e-9)
    assert fewer.outliers == whole.outliers


def test_pictures_of_few_corners_stay_as_they_are() -> None:
    measured = pictures(count=12)
    few = measured.select(np.flatnonzero(np.arange(len(measured)) % 5 == 0))
    assert fitted(few).fit.estimator.equations.compressed is None
