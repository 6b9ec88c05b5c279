"""What is stated of numbers and would change nothing is refused, and causes have their own words.

Of many machines: a statement that is taken is never without an effect on the result's covariance.
"""

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.exceptions import ArgumentError, ArgumentTypeError

MACHINES = ("hexapod", "linear-delta", "6-rus", "3rrr-planar", "rotary-delta")


def rows(name, kind="position", count=30):
    """A machine with a wrong offset, and readings of it."""
    robot = pk.load(name)
    q = robot.inverse(pk.sample_poses(robot, count, seed=2, share=0.5), match=True)
    true = robot.replace({robot.geometry.match("offset*")[0]: 1e-3})
    return robot, pk.VirtualMachine(true, noise=1e-3, seed=4).measure(q, kind)


@pytest.mark.parametrize("name", MACHINES)
@pytest.mark.parametrize("under", [None, "common", "consider"])
def test_uncertainty_of_what_is_free_alone_is_refused(name, under):
    robot, m = rows(name)
    stated = {"offset*": 0.1}
    given = stated if under is None else {under: stated}
    with pytest.raises(ArgumentError, match=r"uncertainty: offset\* is free"):
        pk.identify(robot, m, "offset*", uncertainty=given)


@pytest.mark.parametrize("pattern", ["anchor1.x", "target9.x", "attachment*", "mounting*"])
def test_uncertainty_of_what_no_reading_depends_on_is_refused(pattern):
    robot, m = rows("3rrr-planar")
    with pytest.raises(ArgumentError, match="no reading of these measurements depends on"):
        pk.identify(robot, m, "offset*", uncertainty={pattern: 0.1})


def test_uncertainty_of_what_is_unknown_or_held_is_refused():
    robot, m = rows("hexapod")
    beside = pk.identify(robot, m, "offset*", uncertainty={"*1": 1e-4})  # not offset1 alone
    assert any(not each.name.startswith("offset") for each in beside.nuisances)
    with pytest.raises(ArgumentError, match=r"target1\.x is free or unknown"):
        pk.identify(robot, m, "offset*", unknown="target", uncertainty={"target1.x": 0.1})
    with pytest.raises(ArgumentError, match="held as exact by fix"):
        pk.identify(robot, m, "offset*", fix="gain*", uncertainty={"gain1": 1e-3})


def test_a_robot_file_may_state_what_a_calibration_frees(tmp_path):
    robot, m = rows("hexapod")
    file = tmp_path / "robot.toml"
    robot.save(file)
    file.write_text(f'{file.read_text()}\n[uncertainty]\n"offset*" = 0.1\n"anchor*" = 1.0\n')
    found = pk.identify(pk.load(file), m, "offset*")
    plain = pk.identify(robot, m, "offset*")
    np.testing.assert_array_equal(found.covariance, plain.covariance)


@pytest.mark.parametrize("sigma", [1e300, 1e16, 1e-300])
@pytest.mark.parametrize("under", [None, "common", "consider"])
def test_deviations_whose_squares_are_no_numbers_are_refused(sigma, under):
    robot, m = rows("hexapod")
    given = {"base*": sigma} if under is None else {under: {"base*": sigma}}
    with pytest.raises(ArgumentError, match=r"uncertainty of base\* must be 0 or from"):
        pk.identify(robot, m, "offset*", uncertainty=given)


@pytest.mark.parametrize("under", [None, "common", "consider"])
@pytest.mark.parametrize("sigma", [1e15, 1e-15])
def test_deviations_at_their_limits_give_finite_results(sigma, under):
    robot, m = rows("hexapod", "pose")
    given = {"gain*": sigma} if under is None else {under: {"gain*": sigma}}
    found = pk.identify(robot, m, "offset*", uncertainty=given)
    assert np.isfinite(found.values).all()


def test_sag_that_is_sought_goes_with_a_stated_uncertainty():
    arm = pk.load("3r")
    q = np.random.default_rng(0).uniform(-1.5, 1.5, (40, 3))
    m = pk.Measurements(q, arm.forward(q)[:, :3, 3], "position", sigma=0.01)
    with pytest.raises(ArgumentError, match="uncertainty: no number"):
        pk.identify(arm, m, "joint1.dx", effects="auto", uncertainty={"nothing": 1.0})


def test_the_cause_of_an_error_of_ones_own_is_not_called_measurements():
    robot, m = rows("hexapod")

    def broken(numbers):
        if numbers["offset1"] != robot.geometry["offset1"]:
            raise ValueError("the table of the pump ends here")
        return numbers["offset1"]

    said = r"^residuals: broken failed with ValueError: the table of the pump ends here"
    with pytest.raises(ValueError, match=said):
        pk.identify(robot, m, "offset*", residuals=broken)


def test_rows_out_of_reach_are_called_measurements():
    robot, m = rows("hexapod")
    off = pk.Measurements(m.actuators * 100.0, m.values, "position")
    with pytest.raises(ArgumentError, match=r"^measurements: "):
        pk.identify(robot, off, "offset*")


def test_several_loads_are_refused_with_what_one_can_say():
    _, m = rows("hexapod")
    with pytest.raises(ArgumentTypeError, match="one Load, found several"):
        pk.Measurements(m.actuators[:2], m.values[:2], "position", load=[pk.Load(1), pk.Load(2)])
