"""AP, RP and AD of ISO 9283 by their definitions."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pkmcal.measurements.iso9283 import performance


def test_accuracy_is_the_distance_of_the_mean_from_the_command() -> None:
    scored = performance([[1, 2, 2], [1, 2, 2], [9, 0, 0]], np.zeros((3, 3)), [0, 0, 1])
    np.testing.assert_allclose(scored.accuracy, [3, 9])
    np.testing.assert_array_equal(scored.repeats, [2, 1])


def test_repeatability_is_the_mean_distance_and_three_deviations_of_it() -> None:
    points = [[-3, 0, 0], [-1, 0, 0], [1, 0, 0], [3, 0, 0]]  # 3 1 1 3 from their mean
    scored = performance(points, np.zeros((4, 3)), [5, 5, 5, 5])
    np.testing.assert_allclose(scored.repeatability, 2 + 3 * np.sqrt(4 / 3))


def test_one_measurement_has_no_repeatability() -> None:
    scored = performance(np.eye(3), np.zeros((3, 3)), [0, 1, 1])
    assert np.isnan(scored.repeatability[0]) and np.isfinite(scored.repeatability[1])


def test_distance_accuracy_does_not_depend_on_where_the_instrument_stands() -> None:
    random = np.random.default_rng(0)
    sent = random.uniform(-100, 100, (12, 3))
    seen = sent + random.normal(0, 0.1, sent.shape)
    turn = Rotation.from_euler("xyz", [0.4, -0.7, 2.0])
    here = performance(seen, sent, np.arange(12))
    there = performance(turn.apply(seen) + np.array([900, 20, -40]), sent, np.arange(12))
    np.testing.assert_allclose(there.distance_accuracy, here.distance_accuracy, atol=1e-10)
    assert len(here.distance_accuracy) == 12 * 11 / 2
    assert there.accuracy.min() > 100 * here.accuracy.max()


def test_distance_accuracy_is_the_mean_of_the_paired_distances() -> None:
    """Point by point, in the order measured; further points of one pose have no partner."""
    random = np.random.default_rng(4)
    repeats = [30, 30, 7, 1]
    pose = random.permutation(np.repeat([9, 2, 5, 4], repeats))
    sent = {number: random.uniform(-100, 100, 3) for number in (2, 4, 5, 9)}
    commanded = np.array([sent[number] for number in pose])
    seen = commanded + random.normal(0, 3.0, commanded.shape)
    expected = []
    numbers = sorted(sent)
    for i, one in enumerate(numbers):
        for other in numbers[i + 1 :]:
            pairs = zip(seen[pose == one], seen[pose == other], strict=False)
            mean = np.mean([np.linalg.norm(first - second) for first, second in pairs])
            expected.append(mean - np.linalg.norm(sent[one] - sent[other]))
    scored = performance(seen, commanded, pose)
    np.testing.assert_allclose(scored.distance_accuracy, expected, atol=1e-12)


def test_a_machine_that_is_too_long_by_a_share_has_distances_too_long_by_it() -> None:
    sent = np.random.default_rng(1).uniform(-100, 100, (6, 3))
    scored = performance(1.01 * sent, sent, np.arange(6))
    far = [np.linalg.norm(sent[i] - sent[j]) for i in range(6) for j in range(i + 1, 6)]
    np.testing.assert_allclose(scored.distance_accuracy, 0.01 * np.array(far))


@pytest.mark.parametrize(
    ("measured", "commanded", "pose", "message"),
    [
        (np.zeros((2, 3)), np.zeros((3, 3)), [0, 1], r"found \(2, 3\) and \(3, 3\)"),
        (np.zeros((0, 3)), np.zeros((0, 3)), [], r"found \(0, 3\)"),
        (np.zeros((2, 3)), np.zeros((2, 3)), [0, 1, 2], r"pose must have shape \(2,\)"),
    ],
)
def test_shapes_that_do_not_fit_are_refused(
    measured: np.ndarray, commanded: np.ndarray, pose: list[int], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        performance(measured, commanded, pose)
