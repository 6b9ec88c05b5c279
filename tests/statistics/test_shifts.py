"""What moved between two sessions is named, and nothing where nothing did."""

from __future__ import annotations

import numpy as np
import pytest

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.statistics.shifts import Shift, shifted

from .designs import arm, hexapod

Data = tuple[FloatArray, FloatArray, IntArray]


def sessions(
    name: str, shift: FloatArray, shared: float, rng: np.random.Generator
) -> tuple[Data, Data, FloatArray]:
    """Two sessions at different poses; the parameters of the second are shifted."""
    design = arm(40) if name == "arm" else hexapod(60)
    fit = design.fit
    jacobian = fit.design * np.sqrt(len(fit.residual) / fit.design.shape[1])
    half = fit.cluster < fit.clusters // 2
    of_pose = shared * rng.normal(size=int(fit.key().max()) + 1)[fit.key()]
    y = rng.normal(size=len(half)) + of_pose
    y[~half] += jacobian[~half] @ shift
    first = np.linalg.lstsq(jacobian[half], y[half], rcond=None)[0]
    left = y - jacobian @ first
    parts = [(jacobian[rows], left[rows], fit.cluster[rows]) for rows in (half, ~half)]
    p = jacobian.shape[1]
    return parts[0], parts[1], np.eye(p)


def search(name: str, shift: FloatArray, shared: float, rng: np.random.Generator) -> list[Shift]:
    first, later, axes = sessions(name, shift, shared, rng)
    return shifted(first, later, axes, [axes[:, [k]] for k in range(6)])


@pytest.mark.parametrize(("name", "shared"), [("hexapod", 0.0), ("arm", 2.0)])
def test_nothing_is_named_where_nothing_moved(name: str, shared: float) -> None:
    rng = np.random.default_rng(0)
    none = np.zeros(33 if name == "arm" else 6)
    named = [bool(search(name, none, shared, rng)) for _ in range(100)]
    assert np.mean(named) <= 0.04


@pytest.mark.parametrize(("name", "shared", "size"), [("hexapod", 0.0, 8.0), ("arm", 2.0, 40.0)])
def test_what_moved_is_named_with_its_size(name: str, shared: float, size: float) -> None:
    rng, off, named = np.random.default_rng(1), [], 0
    for _ in range(30):
        k = int(rng.integers(6))
        true = np.zeros(33 if name == "arm" else 6)
        true[k] = size
        found = search(name, true, shared, rng)
        named += bool(found) and (found[0].candidate == k or k in found[0].also)
        if len(found) == 1 and found[0].candidate == k:
            off.append((found[0].size[0] - size) / found[0].deviation[0])
    assert named >= 28 and len(off) > 15
    assert np.std(off) == pytest.approx(1.0, abs=0.45)


def test_seven_heights_each_name_a_height_that_moved() -> None:
    """One spare equation a session: the joint fit tells what a hold-out cannot."""
    rng = np.random.default_rng(2)
    jacobian = np.linalg.qr(rng.normal(size=(7, 6))).Q * np.sqrt(7.0 / 6.0)
    axes, together = np.eye(6), np.ones((6, 1))
    named, false = 0, 0
    for moved in (0.0, 8.0):
        for _ in range(100):
            y1, y2 = rng.normal(size=7), rng.normal(size=7) + moved * (jacobian @ together)[:, 0]
            first = np.linalg.lstsq(jacobian, y1, rcond=None)[0]
            rows = np.arange(7)
            candidates = [*(axes[:, [k]] for k in range(6)), together]
            found = shifted(
                (jacobian, y1 - jacobian @ first, rows),
                (jacobian, y2 - jacobian @ first, rows),
                axes, candidates,
            )  # fmt: skip
            if moved:
                named += any(shift.candidate == 6 or 6 in shift.also for shift in found)
            else:
                false += bool(found)
    assert false <= 4 and named > 80


@pytest.mark.parametrize("name", ["hexapod", "arm"])
def test_sizes_are_whole_where_others_of_a_kind_shifted_less(name: str) -> None:
    """A common shift of all, found or not, is a part of what one of them shifted by."""
    rng, off = np.random.default_rng(4), []
    for _ in range(30):
        true = np.zeros(33 if name == "arm" else 6)
        true[:6] = rng.uniform(1.0, 3.0, 6)
        true[0] = 30.0
        first, later, axes = sessions(name, true, 0.0, rng)
        kind = [axes[:, [k]] for k in range(6)]
        together = [axes[:, :6].sum(axis=1, keepdims=True), axes[:, :6]]
        found = shifted(first, later, axes, [*kind, *together])
        off += [
            (each.size[0] - true[0]) / each.deviation[0] for each in found if each.candidate == 0
        ]
    assert len(off) > 15
    assert np.sqrt(np.mean(np.square(off))) < 1.5


def of_a_kind(true: FloatArray, rng: np.random.Generator) -> list[Shift]:
    """Shifts of a hexapod's six numbers, all alike and each its own among what is tried."""
    first, later, axes = sessions("hexapod", true, 0.0, rng)
    kind = [axes[:, [k]] for k in range(6)]
    return shifted(first, later, axes, [*kind, axes.sum(axis=1, keepdims=True), axes])


def test_all_that_shifted_of_a_kind_are_named_each_with_its_own_size() -> None:
    """Also where a shift of all alike explains a part of each: sizes are whole."""
    rng, off, missed = np.random.default_rng(6), [], 0
    for _ in range(40):
        true = np.zeros(6)
        moved = rng.permutation(6)[:4]
        true[moved] = rng.uniform(8.0, 25.0, 4)
        found = {each.candidate: each for each in of_a_kind(true, rng)}
        if 7 in found:  # each of all six
            continue
        assert 6 not in found or len(found) == 1
        missed += sum(int(k) not in found for k in moved) if found else 4
        off += [(s.size[0] - true[k]) / s.deviation[0] for k, s in found.items() if k < 6]
    assert missed <= 6 and len(off) > 80
    assert np.sqrt(np.mean(np.square(off))) < 1.35


def test_others_of_a_kind_are_named_falsely_in_few_cases() -> None:
    rng, false = np.random.default_rng(7), 0
    for _ in range(100):
        true = np.zeros(6)
        true[2] = 30.0
        false += any(each.candidate != 2 for each in of_a_kind(true, rng))
    assert false <= 4
