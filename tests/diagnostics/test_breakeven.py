"""How wrong numbers that are not free may be: exact, and as draws of such machines show."""

import json
import warnings

import numpy as np
import pytest

import pkmcal as pk
from benchmarks.bench_uncertainty import ABOVE, JOINTS, NOISE, SPREAD
from pkmcal.diagnostics.breakeven import breakeven
from pkmcal.report.as_json import as_json

ROBOT = pk.load("hexapod")


def identified(kind, changes=(), seed=0, noise=0.02):
    """Offsets of a hexapod that has these numbers."""
    true = ROBOT.replace(dict(changes))
    q = ROBOT.inverse(pk.sample_poses(ROBOT, 40, seed=1))
    m = pk.VirtualMachine(true, noise=noise, seed=seed).measure(q, kind)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of residuals that are no noise
        return pk.identify(ROBOT, m, "offset*")


@pytest.mark.parametrize("kind", ["position", "pose"])
def test_standard_deviations_double_where_it_says(kind):
    """Machines of which one number after the other is wrong by as much, measured without noise."""
    at = identified(kind)
    found = {each.unit: each for each in at.breakeven}
    assert found["mm"].kinds == ("base*", "platform*")
    for unit, kinds in (("mm", ("base*", "platform*")), ("1", ("gain*",))):
        t, squares = found[unit].deviation, 0.0
        for name in ROBOT.geometry.match(kinds):
            other = identified(kind, {name: ROBOT.geometry[name] + t}, noise=1e-7)
            squares += float((other.values**2).sum())
        assert squares == pytest.approx(3.0 * float((at.stderr**2).sum()), rel=0.02)


def test_figures_of_the_hexapod():
    """Those of a program of its own, at the poses that it drew: of effects.md, A16.

    Other poses have other figures.
    """
    rng = np.random.default_rng(0)
    every = ["base*", "platform*", "offset*"]
    for free, kind, count, unit, expected in (
        ("offset*", "position", 40, "mm", 0.007048796273276328),
        ("offset*", "pose", 40, "mm", 0.005357940535570026),
        (every, "pose", 45, "1", 0.0002217395152292856),
    ):
        places = ROBOT.home + ABOVE + rng.uniform(-1.0, 1.0, (count, 6)) * SPREAD
        q = ROBOT.inverse(places)
        sigma = {"position": NOISE, "pose": [NOISE] * 3 + [NOISE / ROBOT.length] * 3}[kind]
        m = pk.Measurements(q, places[:, : 3 if kind == "position" else 6], kind, sigma=sigma)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # nothing is wrong with this machine, not even noise
            found = pk.identify(ROBOT, m, free).breakeven
        (own,) = [each.deviation for each in found if each.unit == unit]
        assert own == pytest.approx(expected, rel=1e-3)


def test_what_is_stated_free_or_redundant_is_not_in_it():
    found = identified("pose")
    assert [each.unit for each in found.breakeven] == ["mm", "1"]
    q = ROBOT.inverse(pk.sample_poses(ROBOT, 40, seed=1))
    m = pk.VirtualMachine(ROBOT, noise=0.02, seed=1).measure(q, "pose")
    stated = pk.identify(ROBOT, m, "offset*", uncertainty=JOINTS)
    assert [each.unit for each in stated.breakeven] == ["1"]
    everything = pk.identify(ROBOT, m, ["base*", "platform*", "offset*", "gain*"])
    assert everything.breakeven == ()
    # the offset of a slider and its base along it are one number
    delta = pk.load("linear-delta-6")
    q = delta.inverse(pk.sample_poses(delta, 30, seed=1), match=True)
    m = pk.VirtualMachine(delta, noise=0.01, seed=1).measure(q, "position")
    free = [n for n in delta.geometry.match("*") if n not in delta.geometry.match("offset*")]
    assert breakeven(pk.identify(delta, m, free).fit) == ()


def test_where_some_of_a_kind_are_stated_the_others_are_named_one_by_one():
    q = ROBOT.inverse(pk.sample_poses(ROBOT, 40, seed=1))
    m = pk.VirtualMachine(ROBOT, noise=0.02, seed=1).measure(q, "pose")
    own = {**JOINTS, "gain[1-4]": 1e-3}
    (gains,) = pk.identify(ROBOT, m, "offset*", uncertainty=own).breakeven
    assert gains.kinds == ("gain5", "gain6")
    considered = pk.identify(ROBOT, m, "offset*", uncertainty={"consider": own})
    assert [each.kinds for each in considered.breakeven] == [("gain5", "gain6")]


def test_it_is_in_the_result_as_json():
    found = identified("pose")
    lengths, ratios = json.loads(as_json(found))["breakeven"]
    assert lengths == {
        "kinds": ["base*", "platform*"], "unit": "mm", "deviation": found.breakeven[0].deviation
    }  # fmt: skip
    assert ratios["unit"] == "1"


def test_the_summary_says_it():
    found = identified("pose")
    line = "double on the whole if base*, platform* are wrong by"
    assert line in found.summary().replace("\n  ", " ")
