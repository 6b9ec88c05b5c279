"""Numbers that are not free and not exact: fitted along within their stated uncertainty."""

import warnings
from dataclasses import replace

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.effects.instrument_scale import InstrumentScale
from pkmcal.exceptions import ArgumentError, ArgumentTypeError
from pkmcal.geometry.stated_uncertainty import stated_uncertainty

MACHINES = {  # what is free, what is uncertain
    "hexapod": ("offset*", {"gain*": 1e-3, "base*": 0.05}),
    "linear-delta-6": ("offset*", {"rod*": 0.1}),
    "rotary-delta": ("offset*", {"crank*": 0.1, "rod*": 0.2}),
    "6-rus": ("offset*", {"platform*": 0.05}),
}


def measured(name, wrong, seed=0, noise=0.01, poses=40, kind=None):
    """A machine whose free and uncertain numbers are wrong, and what is measured of it."""
    robot, random = pk.load(name), np.random.default_rng(seed)
    free = robot.geometry.match(MACHINES[name][0])
    small = {"mm": 0.2, "rad": 2e-3, "1": 1e-4}
    unit = dict(zip(robot.geometry.names, robot.geometry.units, strict=True))
    changes = {n: robot.geometry[n] + small[unit[n]] * random.normal() for n in free}
    for pattern, sigma in wrong.items():
        changes |= {
            n: robot.geometry[n] + sigma * random.normal() for n in robot.geometry.match(pattern)
        }
    true = robot.replace(changes)
    q = robot.inverse(pk.sample_poses(robot, poses, seed=seed), match=True)
    kind = kind or ("pose" if robot.model.map == "spatial" else "position")
    return robot, true, pk.VirtualMachine(true, noise=noise, seed=seed).measure(q, kind)


@pytest.mark.parametrize("name", MACHINES)
def test_it_is_a_prior_on_numbers_that_are_not_free(name):
    free, wrong = MACHINES[name]
    robot, _, m = measured(name, wrong)
    found = pk.identify(robot, m, free, uncertainty=wrong)
    other = pk.identify(robot, m, [*np.atleast_1d(free), *wrong], prior=wrong)
    both = [other.free.index(each) for each in found.free]
    np.testing.assert_allclose(found.values, other.values[both], rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.stderr, other.stderr[both], rtol=1e-6)
    assert found.holdout_rms is not None
    assert len(found.nuisances) == len(other.free) - len(robot.geometry.match(free))
    assert not set(robot.geometry.match(free)) - set(found.free)


def test_common_errors_weigh_as_their_covariance_does():
    """Against generalised least squares, the uncertain numbers integrated out."""
    robot, _, m = measured("hexapod", {}, kind="position")
    m = replace(m, sigma=0.01)
    names = robot.geometry.match("gain*")
    own, common = 3e-5, 1e-4
    found = pk.identify(
        robot, m, "offset*", uncertainty={"gain*": own, "common": {"gain*": common}}
    )
    chosen = found.fit.parameters
    jacobian = np.concatenate([
        each.reshape(-1, len(chosen))
        for each in found.fit.equations.jacobian(found.fit.end)
    ])  # fmt: skip
    free = [chosen.names.index(n) for n in found.free if n.startswith("offset")]
    gains = [chosen.names.index(n) for n in names]
    spread = own**2 * np.eye(6) + common**2
    weight = np.linalg.inv(
        0.01**2 * np.eye(len(jacobian)) + jacobian[:, gains] @ spread @ jacobian[:, gains].T
    )
    design = jacobian[:, free]
    covariance = np.linalg.inv(design.T @ weight @ design)
    theta = found.fit.end.theta
    # the readings of a linear machine with the numbers where they were
    off = m.values.ravel() - np.concatenate(
        [each.ravel() for each in found.fit.equations.prediction.values(found.fit.end)]
    )
    off += jacobian[:, gains] @ (theta - chosen.start)[gains]
    values = theta[free] + covariance @ design.T @ weight @ off
    np.testing.assert_allclose(theta[free], values, rtol=0, atol=2e-5)
    assert found.fit.uncertainty.covariance.scale == 1.0
    np.testing.assert_allclose(found.stderr[:6], np.sqrt(np.diagonal(covariance)), rtol=1e-4)


@pytest.mark.parametrize("stated", [None, {}, {"gain*": 0.0}])
def test_without_a_statement_nothing_changes(stated):
    robot, _, m = measured("hexapod", {})
    before = pk.identify(robot, m, "offset*", holdout=0.25)
    after = pk.identify(robot, m, "offset*", holdout=0.25, uncertainty=stated)
    for name in ("values", "stderr", "covariance", "interval95", "residuals"):
        np.testing.assert_array_equal(getattr(before, name), getattr(after, name))
    assert str(before) == str(after)
    assert after.nuisances == ()


def test_a_number_is_in_the_result_only_if_it_moved_by_twice_its_uncertainty():
    robot, _, m = measured("hexapod", {"gain2": 0.0}, noise=1e-4)
    true = robot.replace({"gain1": 1.0019, "gain4": 0.9979})
    q = m.actuators
    m = pk.VirtualMachine(true, noise=1e-3, seed=2).measure(q, "pose")
    found = pk.identify(robot, m, "offset*", uncertainty={"gain*": 1e-3})
    assert found.free == (*robot.geometry.match("offset*"), "gain4")
    moved = [each.name for each in found.nuisances if each.moved]
    assert moved == ["gain4"]
    assert found.rank == len(found.free) == len(found.values) == len(found.covariance)
    assert found.robot.geometry["gain1"] == pytest.approx(1.0019, abs=1e-5)
    assert "gain4" in found.summary()
    assert "gain1" not in found.summary()


def test_a_number_far_from_its_uncertainty_is_named():
    robot, _, m = measured("hexapod", {}, noise=0.005)
    true = robot.replace({"base3.z": 0.2 + robot.geometry["base3.z"]})
    m = pk.VirtualMachine(true, noise=0.005, seed=3).measure(m.actuators, "pose")
    with pytest.warns(pk.CalibrationWarning, match=r"base3\.z is"):
        found = pk.identify(robot, m, "offset*", uncertainty={"base*": 0.04})
    said = {each.check: each for each in found.verdict.said}
    finding = said["uncertainty-contradicted"].finding
    assert finding.names[0] == "base3.z"
    assert found.verdict.state == "doubtful"
    wide = pk.identify(robot, m, "offset*", uncertainty={"base*": 0.04, "base3.z": 0.2})
    assert wide.verdict.state == "calibrated"


def test_what_is_free_or_held_is_not_fitted_along():
    robot, _, m = measured("hexapod", {})
    found = pk.identify(robot, m, "offset*", uncertainty={"*1": 1e-3})
    assert [each.name for each in found.nuisances] == ["gain1"]
    found = pk.identify(robot, m, "offset*", fix="*1", uncertainty={"*[12]": 1e-3})
    assert [each.name for each in found.nuisances] == ["gain2"]
    assert found.robot.geometry["offset1"] == robot.geometry["offset1"]


def test_targets_that_lean_alike_are_found_within_their_uncertainty():
    robot = pk.load("hexapod")
    targets = np.array([[80.0, 0.0, 60.0], [-40.0, 70.0, 60.0], [-40.0, -70.0, 60.0]])
    q = np.repeat(robot.inverse(pk.sample_poses(robot, 30, seed=5)), 3, axis=0)
    about = {"target_index": np.tile([0, 1, 2], 30)}
    lean = np.array([0.3, -0.2, 0.1])
    there = pk.VirtualMachine(robot, noise=0.005, seed=1).measure(
        q, "position", np.tile(targets + lean, (30, 1))
    )
    m = pk.Measurements(q, there.values, "position", target=targets, **about)
    found = pk.identify(robot, m, "offset*", uncertainty={"common": {"target*": 0.3}})
    moved = {each.name: each.value - each.start for each in found.nuisances}
    for k in range(3):
        for axis, by in zip("xyz", lean, strict=True):
            assert moved[f"target{k + 1}.{axis}"] == pytest.approx(by, abs=0.02)
    assert found.rms < 0.012
    assert found.rms_before > 0.3  # the targets are where they were stated until they are found


@pytest.mark.parametrize("kind", ["position", "pose", "distance"])
def test_the_scale_of_an_instrument_is_found(kind):
    robot, true, m = measured("hexapod", {}, noise=1e-5)
    reading, target = kind, [20.0, -30.0, 40.0]
    if kind == "pose":
        target = None
    if kind == "distance":
        reading = pk.readings.Distance(attachment=[30.0, 20.0, 40.0])
        places = [[900.0, 100.0, 0.0], [-500.0, 700.0, 20.0], [0.0, -800.0, 10.0]]
    else:
        places = [target]
    sets = []
    for place in places:
        each = pk.VirtualMachine(true, noise=1e-5, seed=1).measure(m.actuators, reading, place)
        values = each.values.copy()
        long = values[..., :3] if kind == "pose" else values
        long *= 1.0 + 2e-4
        sets.append(replace(each, values=values))
    found = pk.identify(robot, sets, "offset*", uncertainty={"scale": 1e-4})
    assert found.nuisances[0].value == pytest.approx(2e-4, abs=2e-7)
    free = pk.identify(robot, sets, "offset*", effects=[InstrumentScale()])
    assert free.free[-1] == "scale"
    assert free.values[-1] == pytest.approx(2e-4, abs=2e-7)
    assert free.nuisances == ()


def test_a_frame_that_is_known_to_some_deviation_is_a_nuisance():
    robot, _, m = measured("hexapod", {}, noise=0.005, kind="position")
    values = m.values + np.array([0.1, 0.0, -0.1])
    stated = {"frame.?": 0.1, "frame.alpha": 1e-4, "frame.beta": 1e-4, "frame.gamma": 1e-4}
    found = pk.identify(robot, replace(m, values=values), "offset*", uncertainty=stated)
    assert [each.name for each in found.nuisances][:2] == ["frame.x", "frame.y"]
    assert found.rms < 0.02
    with pytest.raises(ArgumentError, match=r"frame\.y has none"):
        pk.identify(robot, m, "offset*", uncertainty={"frame.x": 0.1})


@pytest.mark.parametrize(
    ("given", "kind"),
    [
        ({"gian*": 1e-3}, ArgumentError),
        ({"gain*": -1e-3}, ArgumentError),
        ({"gain*": "wide"}, ArgumentTypeError),
        ({"gain*": {"gain1": 1.0}}, ArgumentTypeError),
        ({"common": 1.0}, ArgumentTypeError),
        ([1.0], ArgumentTypeError),
    ],
)
def test_mistakes_are_refused(given, kind):
    robot, _, m = measured("hexapod", {})
    with pytest.raises(kind, match="uncertainty"):
        pk.identify(robot, m, "offset*", uncertainty=given)


FILE = """
[uncertainty]
"gain*" = 1e-3
base1.x = 0.0004
"frame.alpha" = 0.1
common = { "target*" = 0.0003 }
consider = { "platform*" = 0.00001 }
"""


def test_a_robot_file_states_it_in_its_own_units_and_is_read_back(tmp_path):
    path = tmp_path / "robot.toml"
    robot = pk.load("hexapod")
    robot.save(path)
    text = path.read_text()
    path.write_text(text.replace("\n[pose]", FILE + "\n[pose]"))
    path.write_text(path.read_text().replace('length = "mm"', 'length = "m"'))
    path.write_text(path.read_text().replace('angle = "rad"', 'angle = "deg"'))
    stated = pk.load(path).model.uncertainty
    assert stated.own == {
        "gain*": 1e-3, "base1.x": pytest.approx(0.4), "frame.alpha": pytest.approx(np.radians(0.1))
    }  # fmt: skip
    assert stated.common == {"target*": pytest.approx(0.3)}
    assert stated.consider == {"platform*": pytest.approx(0.01)}
    pk.load(path).save(tmp_path / "again.toml")
    assert pk.load(tmp_path / "again.toml").model.uncertainty == stated
    later = stated.with_later(stated_uncertainty({"gain*": 2e-3}))
    assert later.own["gain*"] == 2e-3
    assert [*later.own] == ["base1.x", "frame.alpha", "gain*"]


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ('"gian*" = 1e-3', "no number of the geometry matches"),
        ('"gain*" = -1.0', "must be 0 or more"),
        ('"gain*" = "wide"', "must be a number"),
        ('"frame*" = 0.1', "covers lengths"),
    ],
)
def test_mistakes_in_a_file_name_their_line(tmp_path, line, said):
    path = tmp_path / "robot.toml"
    pk.load("hexapod").save(path)
    path.write_text(path.read_text().replace("\n[pose]", f"\n[uncertainty]\n{line}\n\n[pose]"))
    with pytest.raises(ValueError, match=rf"line \d+.*\[uncertainty\].*{said}"):
        pk.load(path)


def test_the_statement_of_a_file_is_used(tmp_path):
    path = tmp_path / "robot.toml"
    robot, _, m = measured("hexapod", {"gain*": 1e-3})
    robot.save(path)
    path.write_text(
        path.read_text().replace("\n[pose]", '\n[uncertainty]\n"gain*" = 1e-3\n\n[pose]')
    )
    by_file = pk.identify(pk.load(path), m, "offset*")
    by_argument = pk.identify(robot, m, "offset*", uncertainty={"gain*": 1e-3})
    np.testing.assert_array_equal(by_file.values, by_argument.values)
    with pytest.warns(pk.CalibrationWarning, match="sigma"):
        exact = pk.identify(pk.load(path), m, "offset*", uncertainty={"gain*": 0.0})
    assert not exact.nuisances


def test_numbers_that_stay_where_they_are_widen_the_deviations_alone():
    """Against the formula, with derivatives by differences of whole calibrations."""
    robot, _, m = measured("hexapod", {}, noise=1e-6)
    m = replace(m, sigma=[0.01] * 3 + [2e-5] * 3)
    names = robot.geometry.match("base?.x")
    plain = pk.identify(robot, m, "offset*")
    found = pk.identify(robot, m, "offset*", uncertainty={"consider": {"base?.x": 0.02}})
    np.testing.assert_array_equal(found.values, plain.values)
    assert found.nuisances == ()
    step, added, elsewhere = 1e-3, np.zeros((6, 6)), 0.0
    poses = pk.sample_poses(robot, 5, seed=9)
    q = robot.inverse(poses)
    for name in names:
        other = robot.replace({name: robot.geometry[name] + step})
        by = pk.identify(other, m, "offset*")
        change = (by.values - plain.values) / step * 0.02
        added += np.outer(change, change)
        ahead = (by.robot.forward(q).pose - plain.robot.forward(q).pose)[:, :3] / step * 0.02
        elsewhere = elsewhere + (ahead**2).sum(axis=1)
    np.testing.assert_allclose(found.covariance - plain.covariance, added, rtol=1e-2, atol=1e-8)
    np.testing.assert_allclose(
        found.accuracy(poses) ** 2 - plain.accuracy(poses) ** 2, elsewhere, rtol=2e-2, atol=1e-9
    )


def test_held_out_points_count_with_what_considered_numbers_make_of_them():
    ratios = []
    for seed in range(12):
        robot, _, m = measured("hexapod", {"base*": 0.05, "platform*": 0.05}, seed, kind="position")
        m = replace(m, sigma=0.01)
        stated = {"consider": {"base*": 0.05, "platform*": 0.05}}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found = pk.identify(robot, m, "offset*", holdout=0.3, uncertainty=stated)
        ratios.append(found.holdout_rms / found.holdout_expected)
    assert np.sqrt(np.mean(np.square(ratios))) == pytest.approx(1.0, abs=0.25)


def test_consider_needs_exact_actuators_and_numbers_of_the_geometry():
    robot, _, m = measured("hexapod", {})
    stated = {"consider": {"gain*": 1e-3}}
    with pytest.raises(ArgumentError, match="consider needs poses that follow"):
        pk.identify(robot, replace(m, actuator_sigma=0.01), "offset*", uncertainty=stated)
    with pytest.raises(ArgumentError, match="no number of the geometry"):
        pk.identify(robot, m, "offset*", uncertainty={"consider": {"target*": 0.1}})
