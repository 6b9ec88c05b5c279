"""Measurements: what is taken, what is refused, and how they are chosen, split and printed."""

from __future__ import annotations

import copy
import dataclasses
import pickle
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pkmcal.exceptions import ArgumentError
from pkmcal.measurements.measurements import Measurements
from pkmcal.measurements.virtual_machine import VirtualMachine
from pkmcal.readings import Distance, Height, Touch

from .kinds import PUBLIC, needed, shape, width


def make(kind: str = "position", **fields: Any) -> Measurements:
    random = np.random.default_rng(0)
    fields = needed(kind, 5, 4) | fields
    q = random.uniform(300, 500, (5, 4))
    return Measurements(q, random.normal(size=shape(kind, 5)), kind, **fields)


@pytest.mark.parametrize("kind", PUBLIC)
def test_every_kind_has_its_shape_components_and_units(kind: str) -> None:
    m = make(kind)
    assert len(m) == 5
    assert m.values.shape == shape(kind, 5)
    assert len(m.components) == len(m.units) == width(kind)


def test_arrays_are_copies_that_cannot_be_changed() -> None:
    q, values = np.ones((2, 3)), np.ones((2, 3))
    m = Measurements(q, values, sigma=0.1)
    q[:] = 7
    assert (m.actuators == 1).all()
    with pytest.raises(ValueError, match="read-only"):
        m.values[0, 0] = 2
    with pytest.raises(dataclasses.FrozenInstanceError):
        m.kind = "pose"  # type: ignore[misc]


@pytest.mark.parametrize("shape", [(), (3,), (5, 1), (5, 3)])
def test_sigma_of_any_stated_shape_is_one_per_component_and_row(shape: tuple[int, ...]) -> None:
    given_sigma = 0.01 * (1 + np.arange(np.prod(shape, dtype=int))).reshape(shape)
    sigma = make(sigma=given_sigma).sigma
    np.testing.assert_array_equal(sigma, np.broadcast_to(given_sigma, (5, 3)))


def test_names_of_an_instrument_stay_read_only_in_a_pickle() -> None:
    m = Measurements(np.zeros((2, 6)), None, Touch(np.array(["A", "B"])))
    for again in (m, pickle.loads(pickle.dumps(m)), copy.deepcopy(m)):
        with pytest.raises(ValueError, match="read-only"):
            again.instrument.touched[0] = "B"


@pytest.mark.parametrize("kind", PUBLIC)
def test_measurements_pickle_and_stay_read_only(kind: str) -> None:
    m = make(kind, sigma=0.1 if width(kind) else None, group=[1, 1, 2, 3, 4])
    again = pickle.loads(pickle.dumps(m))
    assert str(again) == str(m)
    assert (again.actuators == m.actuators).all() and (again.group == m.group).all()
    with pytest.raises(ValueError, match="read-only"):
        again.actuators[0] = 0.0


@pytest.mark.parametrize("kind", PUBLIC)
def test_one_row_is_taken_as_it_is(kind: str) -> None:
    """Actuators (n,) with the value that goes with them, and all else that has one entry a row."""
    several = make(kind, sigma=0.1 if width(kind) else None, group=[4, 1, 2, 3, 4])
    for row in range(5):
        value = several.values[row] if width(kind) else None
        fields: dict[str, Any] = {} if several.sigma is None else {"sigma": several.sigma[row]}
        of_rows = needed(kind, 5, 4)
        own_of_rows = {
            "between": "other",
            "relative-distance": "run",
            "touch": "touched",
            "pixel": "corner",
        }
        if name := own_of_rows.get(kind):
            own = of_rows["instrument"]
            of_rows["instrument"] = dataclasses.replace(own, **{name: getattr(own, name)[row]})
        fields |= of_rows
        one = Measurements(
            several.actuators[row], value, kind, group=several.group[row], lines=7, **fields
        )
        expected = several.select([row])
        assert str(one) == str(expected) and one.values.shape == expected.values.shape
        assert one.actuators.shape == (1, 4) and one.lines.tolist() == [7]
        assert one.group.tolist() == [several.group[row]]


def test_one_row_may_have_a_covariance_and_one_of_several_targets() -> None:
    covariance = np.diag([1.0, 4.0, 9.0])
    one = Measurements([1, 2, 3, 4], [5, 6, 7], sigma=covariance, target=np.eye(3), target_index=2)
    np.testing.assert_array_equal(one.sigma, [covariance])
    np.testing.assert_array_equal(one.targets, [[0, 0, 1]])


def test_sigma_of_heights_may_be_one_per_row() -> None:
    sigma = make("height", sigma=[1, 2, 3, 4, 5]).sigma
    np.testing.assert_array_equal(sigma, [[1], [2], [3], [4], [5]])


def test_covariances_are_kept_and_must_be_positive() -> None:
    covariances = np.stack([np.diag([1.0, 4.0, 9.0])] * 5)
    np.testing.assert_array_equal(make(sigma=covariances).sigma, covariances)
    covariances[3, 0, 1] = covariances[3, 1, 0] = 3.0
    with pytest.raises(ValueError, match="sigma: row 3 is not a covariance"):
        make(sigma=covariances)


def test_the_target_of_every_row() -> None:
    np.testing.assert_array_equal(make().targets, np.zeros((5, 3)))
    np.testing.assert_array_equal(make(target=[1, 2, 3]).targets, [[1, 2, 3]] * 5)
    per_row = np.arange(15.0).reshape(5, 3)
    np.testing.assert_array_equal(make(target=per_row).targets, per_row)
    several = make(target=[[1, 0, 0], [0, 2, 0]], target_index=[0, 1, 1, 0, 1])
    np.testing.assert_array_equal(several.targets[:, 0], [1, 0, 0, 1, 0])
    assert several.target_names == ("1", "2")


def test_the_attachment_of_every_row() -> None:
    np.testing.assert_array_equal(make("distance").attachments, np.zeros((5, 3)))
    per_row = np.arange(15.0).reshape(5, 3)
    wires = make("distance", instrument=Distance(per_row))
    np.testing.assert_array_equal(wires.attachments, per_row)
    np.testing.assert_array_equal(wires.select([4, 1]).attachments, per_row[[4, 1]])
    several: dict[str, Any] = {"target": np.eye(3)[:2], "target_index": [0, 1, 1, 0, 1]}
    each = make("distance", instrument=Distance([[7, 0, 0], [8, 0, 0]]), **several)
    np.testing.assert_array_equal(each.attachments[:, 0], [7, 8, 8, 7, 8])
    one = make("distance", instrument=Distance([7, 8, 9]), **several)
    np.testing.assert_array_equal(one.attachments, [[7, 8, 9]] * 5)


def test_targets_without_places_are_an_error_only_when_places_are_asked_for() -> None:
    m = make(target_index=[0, 1, 0, 1, 0], target_names=["A", "B"])
    with pytest.raises(ValueError, match="target: the places of A, B"):
        _ = m.targets


BAD: list[tuple[dict[str, Any], type[Exception], str]] = [
    ({"kind": "points"}, ValueError, "kind must be one of angle, between.*'points'"),
    ({"actuators": 1}, ValueError, r"actuators must have shape \(N, n\), or \(n,\).*\(\)"),
    (
        {"actuators": [1, 2]},
        ValueError,
        r"'position' must have shape \(3,\) for one row of actuators \(2,\), or .*\(2, 3\)",
    ),
    (
        {"actuators": [1, 2], "values": [1.0, 2.0], "kind": "height"},
        ValueError,
        r"'height' must be a number for one row of actuators \(2,\).*found \(2,\)",
    ),
    ({"actuators": np.empty((0, 3))}, ValueError, r"actuators must .*\(0, 3\)"),
    ({"actuators": [[1, 2], [3]]}, ValueError, "actuators must have shape .* a ragged list"),
    ({"actuators": [["1", "2"]] * 2}, TypeError, "actuators must be an array of numbers"),
    ({"actuators": None}, TypeError, "actuators must be an array of numbers, found None"),
    ({"values": [[1, 2], [3, 4]]}, ValueError, r"values of kind 'position' .*\(2, 3\).*\(2, 2\)"),
    ({"values": [[1, 2, 3], [4, np.inf, 6]]}, ValueError, "values must be finite.* at index 1, 1"),
    ({"values": None}, ValueError, "'position' must be given, found None: that goes with"),
    ({"kind": "closure", "sigma": 0.1, "values": None}, ValueError, "sigma: nothing was read"),
    (
        {"kind": "closure", "target": [0, 0, 1], "values": None},
        ValueError,
        "target: closures are not of a point",
    ),
    (
        {"kind": "pose", "values": [[1, 2, 3, 0, np.nan, 0], [1, 2, 3, 0, 0, 0]]},
        ValueError,
        "values: an orientation has three angles or none; found one left out in row 0",
    ),
    ({"actuator_sigma": -1.0}, ValueError, "actuator_sigma must be positive"),
    ({"actuator_sigma": [1, 2, 3, 4]}, ValueError, r"actuator_sigma must be .*found \(4,\)"),
    ({"values": np.ones((2, 3)) * 1j}, TypeError, "values must be an array of numbers"),
    ({"sigma": 0.0}, ValueError, "sigma must be positive; found 0.0"),
    ({"sigma": [1, 2]}, ValueError, r"sigma for 2 measurements .*found \(2,\)"),
    ({"target": [1, 2]}, ValueError, r"target must have shape \(3,\).*found \(2,\)"),
    ({"target": np.ones((4, 3))}, ValueError, "target_index"),
    ({"target_index": [0, -1]}, ValueError, "target_index counts from 0; found -1"),
    ({"target": np.ones((1, 3)), "target_index": [0, 1]}, ValueError, "below 1"),
    ({"target_index": [0, 0.5]}, ValueError, "target_index must be whole numbers.*row 1"),
    ({"target_index": [0, 1], "target_names": 3}, TypeError, "target_names must be"),
    ({"target_index": [0, 1], "target_names": ["A", "A"]}, ValueError, "different names"),
    ({"target_index": [0, 1], "target_names": ["A" * 201, "B"]}, ValueError, "at most 200"),
    ({"target_index": [0, 1], "target_names": ["A"]}, ValueError, "must name 2 targets; found 1"),
    ({"attachment": [0, 0, 1]}, ValueError, "attachment: goes with .*'distance'.*'position'"),
    (
        {"kind": "distance", "values": [1, 2], "target": [0, 0, 0], "instrument": Distance([1, 2])},
        ValueError,
        r"attachment must have shape \(3,\) or \(2, 3\); found \(2,\)",
    ),
    ({"target_names": ["A"]}, ValueError, "target_names need target_index"),
    ({"group": [1, 2, 3]}, ValueError, r"group must have shape \(2,\)"),
    ({"actuator_units": "deg"}, ValueError, "actuator_units .*'deg'"),
    ({"actuator_units": ["mm"]}, ValueError, "actuator_units"),
    ({"kind": "height", "values": [[1.0], [2.0]]}, ValueError, r"\(2,\) for 2 rows"),
    ({"kind": "distance", "values": [1, 2]}, ValueError, "target: a distance needs"),
    (
        {"kind": "pose", "values": np.ones((2, 6)), "target": [0, 0, 1]},
        ValueError,
        "target: poses are not of a point",
    ),
]


@pytest.mark.parametrize(("changes", "error", "message"), BAD)
def test_what_does_not_fit_is_named(
    changes: dict[str, Any], error: type[Exception], message: str
) -> None:
    fields = {"actuators": np.ones((2, 2)), "values": np.ones((2, 3))} | changes
    with pytest.raises(error, match=message) as caught:
        Measurements(**fields)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("rows", [[3, 1], slice(1, 4), np.array([True, False, True, True, False])])
def test_select_takes_everything_of_a_row_along(rows: Any) -> None:
    m = make(sigma=np.arange(1.0, 16).reshape(5, 3), target=np.ones((5, 3)), group=[5, 4, 3, 2, 1])
    part = m.select(rows)
    for name in ("actuators", "values", "sigma", "target", "group"):
        np.testing.assert_array_equal(getattr(part, name), getattr(m, name)[rows])


def test_select_keeps_several_targets_and_their_names() -> None:
    m = make(target=np.eye(3), target_index=[0, 1, 2, 1, 0], target_names=["A", "B", "C"])
    part = m.select([3, 0])
    np.testing.assert_array_equal(part.targets, m.targets[[3, 0]])
    assert part.target_names == ("A", "B", "C")


@pytest.mark.parametrize("rows", [[], [9], np.zeros(5, bool), np.zeros(4, bool), [0.5]])
def test_select_of_nothing_or_too_much_is_an_error(rows: Any) -> None:
    with pytest.raises(ValueError, match="rows"):
        make().select(rows)


@given(st.integers(0, 1000), st.integers(1, 7) | st.floats(0.01, 0.9))
def test_split_leaves_no_row_out_and_no_pose_on_both_sides(seed: int, holdout: float) -> None:
    pose = np.random.default_rng(1).integers(0, 8, 40)
    m = Measurements(np.arange(80.0).reshape(40, 2), np.ones((40, 3)), group=pose)
    fit, held = m.split(holdout, seed)
    assert not set(fit.group) & set(held.group)
    both = np.concatenate([fit.actuators, held.actuators])
    assert sorted(map(tuple, both)) == sorted(map(tuple, m.actuators))
    wanted = holdout if isinstance(holdout, int) else max(1, round(8 * holdout))
    assert len(set(held.group)) == wanted


def test_rows_with_the_same_actuators_are_repeats_of_one_pose() -> None:
    m = Measurements([[1, 2], [3, 4], [1, 2], [3, 5]], np.ones((4, 3)))
    index = m.pose_index
    assert index[0] == index[2] and len(set(index)) == 3


def test_split_is_drawn_by_its_seed() -> None:
    m = Measurements(np.arange(100.0)[:, None], np.ones((100, 3)))
    same = [m.split(0.3, seed=4)[1].actuators for _ in range(2)]
    np.testing.assert_array_equal(*same)
    assert (m.split(0.3, seed=5)[1].actuators != same[0]).any()


@pytest.mark.parametrize("holdout", [0, 5, -1, 1.0, 2.5, True])
def test_split_refuses_an_empty_side(holdout: float) -> None:
    with pytest.raises(ValueError, match=r"holdout must be .* below 5"):
        make().split(holdout)


def test_print_shows_units_and_the_digits_of_sigma() -> None:
    m = Measurements(
        [[0.5, 300.0]], [[1, 2, 3, 0.1, 0, 0]], "pose", sigma=[0.02] * 3 + [2e-4] * 3,
        actuator_units=["rad", "mm"],
    )  # fmt: skip
    title, heads, row = str(m).splitlines()
    assert title == "1 measured pose, 2 actuators, sigma 0.020 mm and 0.011 deg"
    assert "q1 [deg]" in heads and "q2 [mm]" in heads and "alpha [deg]" in heads
    assert f"{np.degrees(0.1):.3f}" in row and " 1.000 " in row


def test_print_fits_a_screen_and_says_what_it_leaves_out() -> None:
    m = Measurements(np.ones((500, 6)), np.ones((500, 3)), group=np.arange(500))
    lines = str(m).splitlines()
    assert lines[0] == "500 measured positions, 6 actuators, sigma not known"
    assert len(lines) <= 24 and max(map(len, lines)) <= 120
    assert "⋮" in lines[10] and lines[-1].split()[0] == "499"
    assert repr(m) == f"<Measurements: {lines[0]}>"


# --- the virtual machine -----------------------------------------------------------------------


class Gantry:
    """Three actuators that are x, y, z, tilted by 90 degrees about z; solves within 1 m."""

    actuator_units = ("mm",) * 3

    def forward(self, q: np.ndarray) -> SimpleNamespace:
        pose = np.hstack([q, np.tile([0, 0, np.pi / 2], (len(q), 1))])
        return SimpleNamespace(pose=pose, ok=(np.abs(q) < 1000).all(axis=1))


Q = np.array([[3.0, 4.0, 0.0], [0.0, 0.0, 10.0]])


@pytest.mark.parametrize(
    ("kind", "target", "expected"),
    [
        ("pose", None, [[3, 4, 0, 0, 0, np.pi / 2], [0, 0, 10, 0, 0, np.pi / 2]]),
        ("position", None, Q),
        ("position", [1, 0, 0], [[3, 5, 0], [0, 1, 10]]),
        ("position", [[1, 0, 0], [0, 1, 0]], [[3, 5, 0], [-1, 0, 10]]),
        ("height", None, [0, 10]),
        ("height", [5, 0, 2], [2, 12]),
        ("distance", [0, 0, 0], [5, 10]),
    ],
)
def test_without_noise_a_virtual_machine_reads_what_is_there(
    kind: str, target: Any, expected: Any
) -> None:
    m = VirtualMachine(Gantry(), noise=0).measure(Q, kind, target)
    np.testing.assert_allclose(m.values, expected, atol=1e-14)
    assert m.sigma is None and m.kind == kind and m.actuator_units == ("mm",) * 3


def test_distances_run_from_the_target_to_the_attachment() -> None:
    m = VirtualMachine(Gantry(), noise=0).measure(Q, Distance([2, 0, 0]), [0, 0, 10])
    np.testing.assert_allclose(m.values, [np.sqrt(9 + 36 + 100), 2], atol=1e-14)
    np.testing.assert_array_equal(m.attachment, [2, 0, 0])


def test_noise_has_the_stated_deviation_and_is_stated() -> None:
    q = np.zeros((20_000, 3))
    m = VirtualMachine(Gantry(), noise=0.1, seed=1, angle_noise=0.01).measure(q, "pose")
    np.testing.assert_array_equal(m.sigma[0], [0.1] * 3 + [0.01] * 3)
    np.testing.assert_allclose(m.values.std(axis=0), m.sigma[0], rtol=0.03)
    np.testing.assert_allclose(m.values.mean(axis=0)[:5], 0, atol=4e-3)


def test_noise_is_drawn_by_its_seed_and_never_twice() -> None:
    one, other = (VirtualMachine(Gantry(), seed=3) for _ in range(2))
    first = one.measure(Q).values
    np.testing.assert_array_equal(first, other.measure(Q).values)
    assert (first != one.measure(Q).values).all()


def test_rows_that_the_true_machine_cannot_reach_are_named() -> None:
    with pytest.raises(ValueError, match=r"q: 2 of 3 rows .* \(rows 0, 2\)"):
        VirtualMachine(Gantry()).measure([[2000, 0, 0], [0, 0, 0], [0, -5000, 0]])


@pytest.mark.parametrize("noise", [-1.0, np.nan])
def test_noise_must_be_a_deviation(noise: float) -> None:
    with pytest.raises(ValueError, match="noise must be"):
        VirtualMachine(Gantry(), noise=noise)


def test_a_distance_needs_its_point_and_a_target_its_shape() -> None:
    machine = VirtualMachine(Gantry())
    with pytest.raises(ValueError, match="target"):
        machine.measure(Q, "distance")
    with pytest.raises(ValueError, match="target must have shape"):
        machine.measure(Q, "position", target=[1, 2])
    with pytest.raises(ValueError, match="kind must be one of"):
        machine.measure(Q, "heigth")
    with pytest.raises(ValueError, match="q must be finite"):
        machine.measure([[np.nan, 0, 0]])
    with pytest.raises(ValueError, match=r"q must have shape \(N, 3\)"):
        machine.measure(np.zeros((2, 2, 3)))


def test_a_covariance_that_is_symmetric_to_rounding_is_accepted() -> None:
    rng = np.random.default_rng(0)
    for _ in range(100):
        turn = np.linalg.qr(rng.normal(size=(3, 3))).Q
        stated = turn @ np.diag([1e-4, 9e-4, 1e-2]) @ turn.T
        kept = Measurements(np.ones((1, 6)), np.zeros((1, 3)), sigma=stated[None]).sigma
        np.testing.assert_array_equal(kept[0], kept[0].T)
        np.testing.assert_allclose(kept[0], stated, rtol=0, atol=1e-15)
    skew = np.eye(3) + 1e-6 * np.eye(3, k=1)
    with pytest.raises(ValueError, match="row 0 is not a covariance"):
        Measurements(np.ones((1, 6)), np.zeros((1, 3)), sigma=skew[None])


def test_sessions_stay_with_their_rows() -> None:
    m = make(session=["mon", "mon", "thu", "mon", "thu"])
    assert m.sessions == ("mon", "thu")
    assert m.select([4, 0]).session.tolist() == ["thu", "mon"]
    fit, held = m.split(0.4)
    assert sorted([*fit.session.tolist(), *held.session.tolist()]) == sorted(m.session.tolist())
    assert "sessions mon, thu" in str(m) and str(m).count("thu") == 3
    one = make(session="mon")
    assert one.session.tolist() == ["mon"] * 5 and "session mon" in str(one)
    assert make().session is None and make().sessions == ()
    assert pickle.loads(pickle.dumps(m)).session.tolist() == m.session.tolist()


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (["mon"] * 4, "session must be one name, or one for each of 5 rows; found 4"),
        ("a@b", "session must be a name on one line"),
        ("", "session must be a name on one line"),
        (["a\nb"] * 5, "session must be a name on one line"),
        (5, "session must be a name or several, found 5"),
    ],
)
def test_what_is_no_session_is_refused(given: Any, message: str) -> None:
    with pytest.raises((ValueError, TypeError), match=message):
        make(session=given)


def test_kind_and_instrument_never_contradict_each_other_silently() -> None:
    q, values, fixed = np.full((2, 6), 400.0), [1.0, 2.0], [0, 0, 100.0]
    m = Measurements(q, values, target=fixed, instrument=Distance([1, 2, 3]))
    assert m.kind == "distance" and m.attachments[0].tolist() == [1, 2, 3]
    other = dataclasses.replace(m, kind=Distance([4, 5, 6]))
    assert other.attachments[0].tolist() == [4, 5, 6]
    assert dataclasses.replace(m, instrument=Distance([4, 5, 6])).attachments[0, 0] == 4
    for wrong in ({"kind": "height"}, {"instrument": Height()}):
        with pytest.raises(ArgumentError, match=r"kind: .* contradicts the instrument"):
            dataclasses.replace(m, **wrong)
    for classes in ({"kind": Height}, {"instrument": Height}, {"instrument": 3}):
        with pytest.raises(TypeError, match="must be a word or a Reading, found"):
            Measurements(q, values, **classes)  # type: ignore[arg-type]
