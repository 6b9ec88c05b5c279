"""The laws of a geometry: its order, its ties, and what may be replaced."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pkmcal.geometry.geometry import SLOTS, Geometry, LimbNumber, Term, Tie

POINT = ("x", "y", "z")
NUMBER = st.floats(-500.0, 500.0).map(lambda v: round(v, 6))
ANGLE = st.floats(-3.0, 3.0).map(lambda v: round(v, 9))
SIGN = st.sampled_from([1.0, -1.0])


def length_limb(limb: int, ties: dict[str, Tie] | None = None) -> list[LimbNumber]:
    """The eight numbers of a limb of variable length."""
    ties = ties or {}
    numbers = [
        LimbNumber(f"{point}{limb + 1}.{x}", "mm", limb, f"{point}.{x}", ties.get(f"{point}.{x}"))
        for point in ("base", "platform")
        for x in POINT
    ]
    numbers.append(LimbNumber(f"offset{limb + 1}", "mm", limb, "offset", ties.get("offset")))
    numbers.append(LimbNumber(f"gain{limb + 1}", "1", limb, "gain", ties.get("gain")))
    return numbers


def polar(radius: Term, angle: Term) -> dict[str, Tie]:
    return {"base.x": Tie("cos", (radius, angle)), "base.y": Tie("sin", (radius, angle))}


def delta() -> Geometry:
    """Two limbs on one radius at angles of their own, and a shared zero length."""
    numbers = []
    for limb, angle in enumerate(("angle1", "angle2")):
        ties = polar(Term(1.0, "radius"), Term(1.0, angle))
        ties["offset"] = Tie("equal", (Term(1.0 if limb == 0 else -1.0, "stop"),))
        numbers += length_limb(limb, ties)
    values = {number.name: 10.0 * i for i, number in enumerate(numbers) if number.tie is None}
    parameters = {"radius": "mm", "angle1": "rad", "angle2": "rad", "stop": "mm"}
    given = {"radius": 160.0, "angle1": 2.0, "angle2": -1.0, "stop": 25.0}
    return Geometry(numbers, parameters, values | given)  # type: ignore[arg-type]


@st.composite
def geometries(draw: st.DrawFn) -> Geometry:
    """Limbs with any of the ties, through parameters that some of them share."""
    numbers: list[LimbNumber] = []
    parameters = {"r": "mm", "s": "mm", "a": "rad", "b": "rad", "k": "1"}
    length = st.builds(Term, SIGN, st.sampled_from(["r", "s"])) | NUMBER.map(Term)
    angle = st.builds(Term, SIGN, st.sampled_from(["a", "b"])) | ANGLE.map(Term)
    for limb in range(draw(st.integers(1, 4))):
        ties = {}
        if draw(st.booleans()):
            radius, turn = draw(length), draw(angle)
            if radius.name or turn.name:
                ties.update(polar(radius, turn))
        for slot in ("base.z", "platform.x", "platform.z", "offset"):
            term = draw(length)
            if term.name and draw(st.booleans()):
                ties[slot] = Tie("equal", (term,))
        if draw(st.booleans()):
            ties["gain"] = Tie("equal", (Term(draw(SIGN), "k"),))
        numbers += length_limb(limb, ties)
    values = {n.name: draw(NUMBER) for n in numbers if n.tie is None}
    values |= {"r": draw(NUMBER), "s": draw(NUMBER), "a": draw(ANGLE), "b": draw(ANGLE)}
    return Geometry(numbers, parameters, values | {"k": 1.0})  # type: ignore[arg-type]


# reading ------------------------------------------------------------------------------------------


def test_names_go_limb_by_limb_and_end_with_the_parameters() -> None:
    geometry = delta()
    limb1 = ("base1.x", "base1.y", "base1.z", "platform1.x", "platform1.y", "platform1.z")
    assert geometry.names[:8] == (*limb1, "offset1", "gain1")
    assert geometry.names[8] == "base2.x"
    assert geometry.names[16:] == geometry.parameters == ("radius", "angle1", "angle2", "stop")


def test_geometry_reads_like_a_mapping() -> None:
    geometry = delta()
    assert len(geometry) == 20
    assert list(geometry) == list(geometry.names)
    assert "base1.x" in geometry and "base3.x" not in geometry and 3 not in geometry
    assert dict(geometry) == dict(geometry.items())
    assert [geometry[name] for name in geometry] == geometry.values.tolist()
    with pytest.raises(KeyError, match=r"did you mean 'base1\.x'"):
        geometry["bse1.x"]


def test_polar_ties_put_a_joint_on_its_circle() -> None:
    geometry = delta()
    assert np.hypot(geometry["base1.x"], geometry["base1.y"]) == pytest.approx(160.0, rel=1e-15)
    assert np.arctan2(geometry["base2.y"], geometry["base2.x"]) == pytest.approx(-1.0, rel=1e-15)
    assert geometry["offset1"] == 25.0 and geometry["offset2"] == -25.0


@given(geometries())
def test_slots_hold_the_named_numbers_and_nothing_else(geometry: Geometry) -> None:
    k = len(geometry.numbers)
    assert geometry.slots.shape[1] == len(SLOTS)
    assert np.array_equal(geometry.slots.ravel()[geometry.slot_index], geometry.values[:k])
    rest = np.delete(geometry.slots.ravel(), geometry.slot_index)
    assert not rest.any()


def test_gain_is_one_where_a_limb_does_not_name_it() -> None:
    geometry = Geometry([LimbNumber("rod1", "mm", 0, "rod")], {}, {"rod1": 340.0})
    assert dict(zip(SLOTS, geometry.slots[0], strict=True)) == {
        slot: {"rod": 340.0, "gain": 1.0}.get(slot, 0.0) for slot in SLOTS
    }


def test_arrays_cannot_be_written() -> None:
    geometry = delta()
    for array in (
        geometry.values,
        geometry.slots,
        geometry.slot_index,
        geometry.tied,
        geometry.chain,
    ):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1


def test_a_geometry_survives_pickling() -> None:
    geometry = delta()
    copy = pickle.loads(pickle.dumps(geometry))
    assert copy.names == geometry.names and copy.units == geometry.units
    assert np.array_equal(copy.values, geometry.values)
    assert np.array_equal(
        copy.replace({"radius": 1.0}).slots, geometry.replace({"radius": 1}).slots
    )


# ties ---------------------------------------------------------------------------------------------


@given(geometries())
def test_chain_is_the_derivative_of_the_slots(geometry: Geometry) -> None:
    k = len(geometry.numbers)
    for j, name in enumerate(geometry.names):
        if geometry.tied[j]:
            assert not geometry.chain[:, j].any()
            continue
        step = 1e-5 if geometry.units[j] == "rad" else 0.5
        ahead = geometry.replace({name: geometry[name] + step}).values[:k]
        behind = geometry.replace({name: geometry[name] - step}).values[:k]
        quotient = (ahead - behind) / (2.0 * step)
        assert np.allclose(geometry.chain[:, j], quotient, rtol=1e-6, atol=1e-6)


@given(geometries(), st.data())
def test_replacing_a_name_moves_what_it_drives_and_nothing_else(
    geometry: Geometry, data: st.DataObject
) -> None:
    own = [name for name, tied in zip(geometry.names, geometry.tied, strict=True) if not tied]
    name = data.draw(st.sampled_from(own))
    value = data.draw(NUMBER)
    changed = geometry.replace({name: value})
    driven = {n.name for n in geometry.numbers if n.tie is not None and name in n.tie.drivers}
    assert changed[name] == value
    for other in geometry.names:
        if other != name and other not in driven:
            assert changed[other] == geometry[other]


@given(geometries(), st.data())
def test_replacing_by_name_and_by_array_agree(geometry: Geometry, data: st.DataObject) -> None:
    own = np.flatnonzero(~geometry.tied)
    values = geometry.values.copy()
    for i in own:
        values[i] = data.draw(NUMBER)
    by_array = geometry.replace(values)
    by_name = geometry.replace({geometry.names[i]: values[i] for i in own})
    assert np.array_equal(by_array.values, by_name.values)
    assert np.array_equal(geometry.replace(by_array.values).values, by_array.values)


def test_the_first_geometry_stays_as_it_was() -> None:
    geometry = delta()
    before = geometry.values.copy()
    geometry.replace({"radius": 1.0})
    geometry.replace(before + ~geometry.tied)
    assert np.array_equal(geometry.values, before)


# what may not be replaced -------------------------------------------------------------------------


def test_a_tied_number_names_the_parameters_that_drive_it() -> None:
    geometry = delta()
    with pytest.raises(ValueError) as one:
        geometry.replace({"offset1": 3.0})
    assert str(one.value) == "offset1 is driven by the parameter stop (replace that instead)"
    with pytest.raises(ValueError) as two:
        geometry.replace({"base2.y": 3.0})
    assert "parameters radius and angle2 (replace those instead)" in str(two.value)
    changed = geometry.values.copy()
    changed[geometry.names.index("base1.x")] += 1.0
    with pytest.raises(ValueError, match=r"base1\.x is driven by"):
        geometry.replace(changed)


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        ({"radios": 3.0}, ValueError, "no number 'radios'; did you mean 'radius'"),
        ({3: 3.0}, ValueError, "no number 3"),
        ({"radius": np.nan}, ValueError, "radius must be finite, found nan"),
        ({"radius": np.inf}, ValueError, "radius must be finite, found inf"),
        ({"radius": "160"}, TypeError, "radius must be a number, found '160'"),
        ({"radius": True}, TypeError, "radius must be a number, found True"),
        ({"radius": None}, TypeError, "radius must be a number, found None"),
        (np.zeros(19), ValueError, r"must have shape \(20,\), found \(19,\)"),
        (np.zeros((1, 20)), ValueError, r"must have shape \(20,\), found \(1, 20\)"),
        (["a"] * 20, TypeError, "changes must be an array of numbers, found dtype <U1"),
        (np.full(20, np.nan), ValueError, r"base1\.x must be finite, found nan"),
    ],
)
def test_wrong_changes_say_what_is_wrong(
    changes: object, error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        delta().replace(changes)  # type: ignore[arg-type]


def test_a_name_cannot_stand_for_two_numbers() -> None:
    numbers = [LimbNumber("rod1", "mm", 0, "rod")]
    with pytest.raises(ValueError, match="'rod1' stands for two numbers"):
        Geometry(numbers, {"rod1": "mm"}, {"rod1": 3.0})


# wildcards ----------------------------------------------------------------------------------------


def test_wildcards_find_numbers_that_can_be_replaced() -> None:
    geometry = delta()
    assert geometry.match(["platform*.x"]) == ["platform1.x", "platform2.x"]
    assert geometry.match(["base*"]) == ["base1.z", "base2.z"]  # x and y follow the radius
    assert geometry.match(["angle?", "radius", "angle*"]) == ["angle1", "angle2", "radius"]
    assert geometry.match("gain[2]") == ["gain2"]


@pytest.mark.parametrize(
    ("pattern", "message"),
    [
        ("platfrm1.x", r"matches 'platfrm1\.x'; did you mean 'platform1\.x'"),
        ("slider*", r"matches 'slider\*'"),
        ("base1.x", "parameters radius and angle1"),
        ("base*.y", "parameters radius and angle1"),
    ],
)
def test_a_wildcard_that_finds_nothing_to_replace_is_an_error(pattern: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        delta().match(["radius", pattern])
