"""Moments and quantiles batch by batch are those of all values together."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pkmcal.core import library
from pkmcal.core.statistics import BINS, REACH, Bins, Stream, pose_errors

SHARES = (0.0, 0.0015, 0.025, 0.5, 0.975, 0.997, 0.9985, 1.0)


def streamed(values: np.ndarray, cuts: list[int], bins: Bins | None = None) -> Stream:
    stream = Stream(Bins.around(values) if bins is None else bins)
    for part in np.split(values, sorted(cuts), axis=1):
        stream.add(np.ascontiguousarray(part))
    return stream


@settings(max_examples=30)
@given(seed=st.integers(0, 1000), cuts=st.lists(st.integers(0, 500), max_size=5))
def test_moments_do_not_depend_on_the_batches(seed: int, cuts: list[int]) -> None:
    rng = np.random.default_rng(seed)
    values = rng.normal(1e3, [[1e-3], [5.0]], (2, 500))
    stream = streamed(values, cuts)
    assert stream.count == 500
    np.testing.assert_allclose(stream.mean, values.mean(axis=1), rtol=1e-14)
    np.testing.assert_allclose(stream.std, values.std(axis=1, ddof=1), rtol=1e-9)
    np.testing.assert_allclose(stream.mean_square, (values**2).mean(axis=1), rtol=1e-13)


@settings(max_examples=30)
@given(seed=st.integers(0, 1000), share=st.sampled_from(SHARES), power=st.sampled_from([1, 3]))
def test_quantiles_are_off_by_less_than_a_bin(seed: int, share: float, power: int) -> None:
    values = np.random.default_rng(seed).normal(size=(3, 2000)) ** power
    stream = streamed(values, [700])
    exact = np.quantile(values, share, axis=1, method="lower")
    inside = np.abs(exact - values.mean(axis=1)) < REACH * values.std(axis=1)
    off = np.abs(stream.quantile(share) - exact)
    assert (off[inside] < stream.bins.width[inside]).all()


def test_a_bin_is_a_128th_of_a_standard_deviation() -> None:
    values = np.random.default_rng(0).normal(0.0, 3.0, (1, 10_000))
    assert Bins.around(values).width[0] == pytest.approx(values.std() / 128, rel=1e-12)
    assert BINS / (2 * REACH) == 128


def test_extremes_beyond_the_bins_are_kept() -> None:
    bins = Bins.around(np.random.default_rng(0).normal(size=(1, 1000)))
    values = np.array([[-1e6, 0.0, 0.1, 0.2, 1e6]])
    stream = streamed(values, [], bins)
    assert stream.quantile(0.0)[0] <= bins.low[0]
    assert stream.quantile(1.0)[0] > 8.0
    assert abs(stream.quantile(0.5)[0] - 0.1) < bins.width[0]


def test_what_does_not_vary_has_its_value_as_every_quantile() -> None:
    stream = streamed(np.full((2, 50), 7.25), [20])
    for share in SHARES:
        assert (stream.quantile(share) == 7.25).all()
    assert (stream.std == 0).all()


def test_columns_with_nan_fail_and_count_in_nothing() -> None:
    values = np.random.default_rng(3).normal(size=(2, 100))
    holed = values.copy()
    holed[1, 10:30] = np.nan
    stream = streamed(holed, [15], Bins.around(values))
    assert (stream.count, stream.n_failed) == (80, 20)
    np.testing.assert_allclose(stream.mean, np.delete(values, range(10, 30), axis=1).mean(axis=1))


def test_merged_streams_are_one_stream_to_rounding() -> None:
    values = np.random.default_rng(4).normal(size=(2, 900))
    bins = Bins.around(values)
    whole = streamed(values, [300, 600], bins)
    parts = [streamed(part, [], bins) for part in np.split(values, 3, axis=1)]
    for other in parts[1:]:
        parts[0].merge(other)
    np.testing.assert_allclose(parts[0].mean, whole.mean, rtol=1e-13)
    np.testing.assert_allclose(parts[0].std, whole.std, rtol=1e-13)
    for share in SHARES:
        np.testing.assert_array_equal(parts[0].quantile(share), whole.quantile(share))


def test_without_values_nothing_is_known() -> None:
    stream = streamed(np.full((2, 5), np.nan), [], Bins.around(np.empty((2, 0))))
    assert stream.n_failed == 5
    assert np.isnan(stream.std).all()
    assert (stream.quantile(0.5) == np.inf).all()  # a machine without a pose is beyond all limits
    assert np.isnan(stream.mean_square).all()


@pytest.mark.parametrize("rows", [2, 7, 255, 256, 257, 1000])
def test_what_poses_are_off_is_their_difference_the_short_way_round(rows: int) -> None:
    """Eq. 16, and the distance of the positions."""
    rng = np.random.default_rng(rows)
    meant, poses = rng.normal(size=6) * 2, rng.normal(size=(rows, 6)) * 2
    poses[-1] = np.nan
    off = pose_errors(poses, meant)
    turned = Rotation.from_rotvec(np.array([0, 0, 1]) * (poses[:-1, 3:] - meant[3:]).reshape(-1, 1))
    np.testing.assert_allclose(off[:3, :-1], (poses[:-1, :3] - meant[:3]).T, rtol=1e-15)
    np.testing.assert_allclose(off[3:6, :-1].T.ravel(), turned.as_rotvec()[:, 2], atol=1e-14)
    np.testing.assert_allclose(off[6, :-1], np.linalg.norm(off[:3, :-1], axis=0), rtol=1e-14)
    assert np.isnan(off[:, -1]).all()


def test_moments_and_counts_have_the_same_bits_on_every_isa(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rng = np.random.default_rng(6)
    values = rng.normal(size=(7, 1031)) + 100.0
    values[3, rng.integers(0, 1031, 40)] = np.nan
    meant = rng.normal(size=6)
    seen = []
    for isa in range(library.lib.pkm_best_isa() + 1):
        monkeypatch.setattr(library, "ISA", isa)
        stream = streamed(values, [1, 300, 556], Bins.around(values[:, ~np.isnan(values[3])]))
        stream.add(pose_errors(meant + np.linspace(99.0, 101.0, 54).reshape(9, 6), meant))
        seen.append((stream.mean, stream.std, *(stream.quantile(share) for share in SHARES)))
        assert stream.n_failed == np.isnan(values[3]).sum()
    for other in seen[1:]:
        np.testing.assert_array_equal(np.array(other), np.array(seen[0]))
