"""Normal numbers of the core: the bits of every ISA, and the laws of the distribution."""

from __future__ import annotations

import mpmath as mp
import numpy as np
import pytest
from scipy import stats

from pkmcal.core.library import lib
from pkmcal.core.random import Normals

COUNT = 1 << 20
ROOT = np.random.SeedSequence(5)


@pytest.fixture(scope="module")
def numbers() -> np.ndarray:
    return Normals(ROOT).fill(np.empty(COUNT))


def below_five_sigma(found: float | np.ndarray, expected: float, deviation: float) -> bool:
    return bool((np.abs(found - expected) < 5 * deviation).all())


@pytest.mark.parametrize("count", [1, 7, 8, 9, 16, 203, 4096])
def test_the_same_bits_on_every_isa(count: int) -> None:
    drawn = []
    for isa in range(lib.pkm_best_isa() + 1):
        normals = Normals(ROOT, isa)
        drawn.append(np.stack([normals.fill(np.empty(count)), normals.fill(np.empty(count))]))
    assert np.isfinite(drawn[0]).all()
    assert len({d.tobytes() for d in drawn}) == 1


def test_a_tail_has_the_first_of_the_numbers_and_nothing_is_written_beyond() -> None:
    whole = Normals(ROOT).fill(np.empty(32))
    for count in range(1, 32):
        room = np.full(40, np.nan)
        Normals(ROOT).fill(room[:count])
        np.testing.assert_array_equal(room[:count], whole[:count])
        assert np.isnan(room[count:]).all()


def test_one_seed_gives_one_sequence_and_batches_go_on_where_it_stopped() -> None:
    normals = Normals(ROOT)
    parts = [normals.fill(np.empty((32, 28))) for _ in range(3)]
    np.testing.assert_array_equal(np.concatenate(parts), Normals(ROOT).fill(np.empty((96, 28))))


def test_numbers_are_the_transform_of_xoshiro256plus_by_box_and_muller() -> None:
    """Against integers of Python and 40 digits."""
    words = Normals(ROOT)._state.reshape(4, 8).astype(object)
    found = Normals(ROOT).fill(np.empty(64)).reshape(4, 2, 8)
    for lane in range(8):
        s = [int(w) for w in words[:, lane]]

        def uniform(s: list[int] = s) -> mp.mpf:
            total, t = (s[0] + s[3]) % 2**64, (s[1] << 17) % 2**64
            s[2] ^= s[0]
            s[3] ^= s[1]
            s[1] ^= s[2]
            s[0] ^= s[3]
            s[2] ^= t
            s[3] = ((s[3] << 45) | (s[3] >> 19)) % 2**64
            return mp.mpf(total >> 12) / 2**52

        with mp.workdps(40):
            for pair in found[:, :, lane]:
                radius = mp.sqrt(-2 * mp.log(1 - uniform()))
                angle = 2 * mp.pi * uniform()
                for one, exact in zip(pair, (mp.cos(angle), mp.sin(angle)), strict=True):
                    assert abs(mp.mpf(one) - radius * exact) < mp.mpf("4e-15")


def test_moments_are_those_of_the_normal_distribution(numbers: np.ndarray) -> None:
    for power, moment in ((1, 0), (2, 1), (3, 0), (4, 3), (6, 15), (8, 105)):
        spread = stats.norm.moment(2 * power) - moment**2
        assert below_five_sigma((numbers**power).mean(), moment, np.sqrt(spread / COUNT)), power


def test_the_distribution_is_normal_into_its_tails(numbers: np.ndarray) -> None:
    assert stats.kstest(numbers, "norm").pvalue > 1e-4
    for end in (2.0, 3.0, 4.0, 4.5):
        share = stats.norm.sf(end)
        expected, deviation = COUNT * share, np.sqrt(COUNT * share)
        assert below_five_sigma(np.sum(numbers > end), expected, deviation), end
        assert below_five_sigma(np.sum(numbers < -end), expected, deviation), -end


def test_neighbours_and_lanes_are_independent(numbers: np.ndarray) -> None:
    """Neither values nor squares correlate, among 32 neighbours or from one row to the next."""
    rows = numbers.reshape(-1, 32)
    table = np.hstack([rows[:-1], rows[1:]])
    for values in (table, table**2):
        off = np.corrcoef(values.T) - np.eye(64)
        assert below_five_sigma(off, 0.0, 1 / np.sqrt(len(table)))


def test_children_of_a_seed_are_independent() -> None:
    drawn = np.stack([Normals(s).fill(np.empty(1 << 16)) for s in ROOT.spawn(24)])
    off = np.corrcoef(drawn) - np.eye(24)
    assert below_five_sigma(off, 0.0, 1 / np.sqrt(drawn.shape[1]))
    assert stats.kstest(drawn.ravel(), "norm").pvalue > 1e-4
