"""A seven-joint arm whose ball was set into sockets 50 mm apart: no instrument measured it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.arrays import FloatArray
from pkmcal.measurements.measurements import Measurements

LOGS = Path(__file__).parents[3] / "shared" / "data" / "mukca"

pytestmark = pytest.mark.skipif(
    not LOGS.exists(), reason="the joint angles are not beside this checkout (../shared/data)"
)

FILES = {"A": "front_center_0", "B": "front_center_1", "C": "mid_left_0", "D": "mid_left_1"}
TIP = [0.0, 0.0, 100.0]  # mm, more or less; it is found along
APART = 50.0  # mm, of the two sockets of each placement


@pytest.fixture(scope="module")
def arm() -> pk.SerialArm:
    return pk.SerialArm.from_dh(
        a=[0, 0, 0, 82.5, -82.5, 0, 88],
        alpha=np.radians([0, -90, 90, 90, -90, 90, 90]),
        d=[333, 0, 316, 0, 384, 0, 0],
        convention="modified",
        tool=[0, 0, 107, 0, 0, 0],
        name="panda",
    )


@pytest.fixture(scope="module")
def rows() -> dict[str, FloatArray]:
    return {name: np.loadtxt(LOGS / f"{file}.csv", delimiter=",") for name, file in FILES.items()}


def touches(rows: dict[str, FloatArray], sockets: str, apart: str) -> Measurements:
    """Of some sockets; the distance of two of them is known."""
    names = np.repeat(list(sockets), [len(rows[name]) for name in sockets])
    q = np.concatenate([rows[name] for name in sockets])
    known = {(apart[0], apart[1]): APART} if apart else {}
    return Measurements(q, None, pk.readings.Touch(names, distances=known), target=TIP)


def tips(found: pk.Identification, q: FloatArray) -> FloatArray:
    """Where the calibrated arm says that its ball was, (N, 3)."""
    motions = found.robot.forward(q)
    target = found.values[found.free.index("target1.x") :][:3]
    return motions[:, :3, :3] @ target + motions[:, :3, 3]


def judged(
    found: pk.Identification, rows: dict[str, FloatArray]
) -> tuple[dict[str, FloatArray], dict[str, float]]:
    """The middle of each socket's tips, and how they scatter about it, mm rms."""
    seen = {name: tips(found, q) for name, q in rows.items()}
    middle = {name: x.mean(axis=0) for name, x in seen.items()}
    off = {name: np.linalg.norm(x - middle[name], axis=1) for name, x in seen.items()}
    return middle, {name: float(np.sqrt(np.mean(each**2))) for name, each in off.items()}


def apart(middle: dict[str, FloatArray], one: str, other: str) -> float:
    return float(np.linalg.norm(middle[one] - middle[other]))


def test_with_nominal_numbers_and_a_fitted_tip_sockets_scatter_by_7_to_9_mm(
    arm: pk.SerialArm, rows: dict[str, FloatArray]
) -> None:
    still = {"joint1.dx": 1e-6}
    data = touches(rows, "ABCD", "")
    found = pk.identify(arm, data, "joint1.dx", unknown="target", prior=still)
    _, scatter = judged(found, rows)
    assert all(6.5 <= each <= 9.1 for each in scatter.values()), scatter


@pytest.mark.parametrize(("fitted", "held"), [("AB", "CD"), ("CD", "AB")])
def test_one_placement_whose_sockets_are_50_mm_apart_calibrates_for_the_other(
    arm: pk.SerialArm, rows: dict[str, FloatArray], fitted: str, held: str
) -> None:
    """The distance of the other is not known to the fit: an arm that had shrunk would show it."""
    found = pk.identify(arm, touches(rows, fitted, fitted), unknown="target")
    middle, scatter = judged(found, rows)
    distance = apart(middle, *held)
    print(f"{fitted}: {held} {distance:.3f} mm apart, scatter {scatter}")
    assert found.verdict.state != "not calibrated"  # halves of the rows want other numbers
    assert distance == pytest.approx(APART, abs=0.1)
    assert max(scatter[name] for name in held) < 0.6
    assert max(scatter[name] for name in fitted) < 0.2


def test_all_four_sockets_scatter_by_less_than_a_quarter_of_a_millimetre(
    arm: pk.SerialArm, rows: dict[str, FloatArray]
) -> None:
    found = pk.identify(arm, touches(rows, "ABCD", "AB"), unknown="target")
    middle, scatter = judged(found, rows)
    distance = apart(middle, "C", "D")
    print(f"C and D {distance:.3f} mm apart, scatter {scatter}")
    assert max(scatter.values()) <= 0.25
    assert distance == pytest.approx(APART, abs=0.1)


def test_a_placement_that_is_held_out_finds_its_own_sockets_first(
    arm: pk.SerialArm, rows: dict[str, FloatArray]
) -> None:
    found = pk.identify(
        arm, touches(rows, "AB", "AB"), unknown="target", holdout=touches(rows, "CD", "")
    )
    _, scatter = judged(found, rows)
    of_both = [scatter["C"] ** 2 * len(rows["C"]), scatter["D"] ** 2 * len(rows["D"])]
    expected = np.sqrt(sum(of_both) / (len(rows["C"]) + len(rows["D"])))
    assert found.holdout_rms == pytest.approx(expected, rel=0.01)


@pytest.mark.filterwarnings("ignore:.*further than errors of a machine")
def test_touches_alone_shrink_the_arm_and_it_is_said(
    arm: pk.SerialArm, rows: dict[str, FloatArray]
) -> None:
    with pytest.warns(pk.CalibrationWarning, match="touch_distances"):
        found = pk.identify(arm, touches(rows, "ABCD", ""), unknown="target")
    assert found.verdict.state != "calibrated"
