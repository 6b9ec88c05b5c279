"""What is said beside what: reasons that explain others, few points beside the rest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.calibration.identification import Identification
from pkmcal.diagnostics.checks import CHECKS
from pkmcal.diagnostics.displaced import DisplacedTarget
from pkmcal.diagnostics.drift import Drift
from pkmcal.diagnostics.measuring_order import MeasuringOrder
from pkmcal.diagnostics.robust_check import RobustCheck
from pkmcal.diagnostics.verdict import diagnose
from pkmcal.fitted.held_points import HeldFamily
from pkmcal.fitted.holdout import HeldOut
from pkmcal.readings.components import Family
from pkmcal.statistics.holdout_test import HoldoutTest

from ..simulated import hexapod_poses


@pytest.mark.parametrize(("odd", "others", "contradicts"), [
    ((), 1.1, True), ((7,), 1.1, False), ((7,), 1.3, True), ((7, 8, 9, 11), 1.1, True),
])  # fmt: skip
def test_points_contradict_a_fit_unless_it_is_a_few_and_the_others_do_not(
    odd: tuple[int, ...], others: float, contradicts: bool
) -> None:
    """Twelve points, whose rms may be 1.2 times what is expected; a quarter of them is a few."""
    tested = HoldoutTest(ratio=3.0, median_ratio=2.0, chance=1e-6, freedom=(12.0, 30.0))
    agrees = replace(tested, median_ratio=1.1)
    held = HeldOut(
        holdout_off=np.append(np.ones(12), np.nan),  # one was not reached
        holdout_outliers=odd,
        holdout_families=(of_unit("mm", 1.0, agrees), of_unit("rad", others, tested)),
    )
    assert held.holdout_contradicts == contradicts
    assert [each.family.noun for each in held.holdout_contradicting] == ["angles"] * contradicts
    assert not replace(held, holdout_families=(of_unit("mm", others, agrees),)).holdout_contradicts


def of_unit(unit: str, others: float, test: HoldoutTest) -> HeldFamily:
    """Components that are 0.5 by what is expected, and `others` times as much besides outliers."""
    return HeldFamily(
        family=Family(unit), rms=1.0, expected=0.5, rms_without_outliers=0.5 * others, test=test
    )


@pytest.fixture(scope="module")
def found(hexapod: pk.Robot) -> Identification:
    """A sound calibration, a quarter of its points held out."""
    rng = np.random.default_rng(0)
    q = hexapod.inverse(hexapod_poses(hexapod, 40, rng))
    seen = hexapod.replace({"offset1": 0.3, "offset4": -0.4}).forward(q).pose[:, :3]
    measured = pk.Measurements(q, seen + rng.normal(0, 0.02, (40, 3)), "position")
    return pk.identify(hexapod, measured, "offset*", holdout=0.25)


def drifted(by: float) -> Drift:
    """Of 1 mm of scatter."""
    return Drift(("z",), (by,), (1.0,), 1e-6, 3, 12, 2.0, (float("nan"), float("nan")))


def ordered(share: float) -> MeasuringOrder:
    return MeasuringOrder(("z",), (2.0,), (1.0,), ("mm",), 1e-6, share, "", 20, "")


def elsewhere(share: float) -> DisplacedTarget:
    return DisplacedTarget("west", (2.0,), (0.1,), 1e-6, share, ())


BEGIN = {"drift": "3 poses, measured 12", "order": "residuals are as", "displaced": "target west"}


@pytest.mark.parametrize("carried", [True, False])
@pytest.mark.parametrize("large", [True, False])
@pytest.mark.parametrize("drift", [None, "drift"])
def test_what_may_come_of_another_cause_is_not_said_beside_it(
    found: Identification, carried: bool, large: bool, drift: str | None
) -> None:
    """Rows that carry a fit off explain what targets and order seem to say; a drift, the order.

    What is most of what is left is a doubt, the rest a remark.
    """
    share, by = (0.9, 5.0) if large else (0.1, 0.5)
    rows = (int(found.rows[3]),)
    findings = {
        "rows-disagree": (RobustCheck(100.0, 1.0, rows, 0.02),) if carried else (),
        "drift": (drifted(by),) if drift else (),
        "measuring-order": (ordered(share),),
        "displaced-target": (elsewhere(share),),
    }
    verdict = diagnose(found, CHECKS, findings)
    expected = {"drift"} if drift else {"order"} - ({"order"} if carried else set())
    expected |= set() if carried else {"displaced"}
    for texts, mine in ((verdict.reasons, large), (verdict.remarks, not large)):
        said = {key for key, begin in BEGIN.items() for text in texts if text.startswith(begin)}
        assert said == (expected if mine else set())
    doubtful = "doubtful" if large else "calibrated"
    assert verdict.state == ("not calibrated" if carried else doubtful)
    assert verdict.reasons[0].startswith("1 row disagrees") == carried
