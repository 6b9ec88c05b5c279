"""Keywords of the version before: they mean what they meant, and the warning says the new form."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import pkmcal as pk

from ..simulated import hexapod_poses


@pytest.fixture(scope="module")
def measured(hexapod: pk.Robot) -> pk.Measurements:
    rng = np.random.default_rng(8)
    q = hexapod.inverse(hexapod_poses(hexapod, 25, rng))
    seen = hexapod.replace({"offset1": 0.3}).forward(q).pose[:, :3]
    noisy = seen + rng.normal(0, 0.02, (25, 3))
    return pk.Measurements(q, noisy, "position", temperature=np.linspace(20, 25, 25))


@pytest.mark.parametrize(("before", "now", "written"), [
    ({"frame": "unknown"}, {"unknown": "frame"}, "write unknown='frame'"),
    ({"frame": "unknown", "target": "unknown"}, {"unknown": ["frame", "target"]},
     r"write unknown=\['frame', 'target'\]"),
    ({"frame": ["unknown"], "target": "known"}, {"unknown": {"frame": ["unknown"]}},
     r"write unknown={'frame': \['unknown'\]}"),
    ({"frame": "unknown", "unknown": "target"}, {"unknown": ["frame", "target"]},
     "write unknown="),
    ({"frame": "known", "slack": "keep", "datum": "none"}, {}, "leave it out"),
    ({"datum": "auto", "fix": "offset2"}, {"fix": ["offset2", "datum"]},
     r"write fix=\['offset2', 'datum'\]"),
    ({"slack": "drop", "drop": [3]}, {"drop": [3, "slack"]}, r"write drop=\[3, 'slack'\]"),
    ({"expansion": 1e-5}, {"effects": [pk.Expansion(1e-5)]}, "write effects="),
    ({"covariance": "cluster"}, {"loss": "cluster"}, "write loss='cluster'"),
    ({"covariance": "classical", "loss": "huber"}, {"loss": ("classical", "huber")},
     r"write loss=\['huber', 'classical'\]"),
    ({"covariance": "auto"}, {}, "leave it out"),
])  # fmt: skip
def test_they_give_the_same_numbers(
    hexapod: pk.Robot, measured: pk.Measurements, before: dict[str, Any], now: dict[str, Any],
    written: str,
) -> None:  # fmt: skip
    with pytest.warns(DeprecationWarning, match=written):
        old = pk.identify(hexapod, measured, "offset*", **before)
    new = pk.identify(hexapod, measured, "offset*", **now)
    np.testing.assert_array_equal(old.values, new.values)
    np.testing.assert_array_equal(old.stderr, new.stderr)
    assert (old.free, old.dropped, old.datum) == (new.free, new.dropped, new.datum)


def test_the_warning_points_at_the_call(hexapod: pk.Robot, measured: pk.Measurements) -> None:
    with pytest.warns(DeprecationWarning) as heard:
        pk.identify(hexapod, measured, "offset*", slack="keep")  # type: ignore[call-arg]
    assert heard[0].filename == __file__


@pytest.mark.parametrize(("arguments", "says"), [
    ({"datum": "automatic"}, "datum must be one of none, auto"),
    ({"slack": "left"}, "slack must be one of keep, drop"),
    ({"covariance": "clusters"}, "covariance must be one of auto, classical, cluster"),
])  # fmt: skip
def test_a_wrong_word_is_refused_as_before(
    hexapod: pk.Robot, measured: pk.Measurements, arguments: dict[str, Any], says: str
) -> None:
    with pytest.raises(pk.ArgumentError, match=says):
        pk.identify(hexapod, measured, "offset*", **arguments)


@pytest.mark.parametrize(("arguments", "says"), [
    ({"drop": "outlier"}, "drop: 'outliers', 'slack' or numbers of rows, found 'outlier'; did"),
    ({"drop": [1.5]}, "drop: rows are whole numbers"),
    ({"unknown": "anchor"}, "unknown must be one of frame, target, attachment"),
    ({"loss": ["huber", "cauchy"]}, "loss: huber and cauchy exclude each other"),
    ({"loss": ("cluster", "classical")}, "loss: cluster and classical exclude each other"),
    ({"loss": ["huber", "auto"]}, "loss must be one of linear, huber, cauchy, classical, cluster"),
    ({"loss": 3}, "loss must be a name or several, found 3"),
    ({"effects": 11.5e-6}, "effects: expected such as"),
    ({"effects": [pk.Expansion(1e-5)] * 2}, "effects: expansion is stated more than once"),
])  # fmt: skip
def test_a_word_that_is_not_known_is_named(
    hexapod: pk.Robot, measured: pk.Measurements, arguments: dict[str, Any], says: str
) -> None:
    with pytest.raises(pk.Error, match=says):
        pk.identify(hexapod, measured, "offset*", **arguments)
