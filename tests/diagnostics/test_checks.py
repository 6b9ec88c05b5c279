"""The list of checks: how they refer to each other, their remedies, and a check of one's own."""

from __future__ import annotations

import inspect
import pickle
from collections.abc import Iterator
from typing import Any, cast

import numpy as np
import pytest
import typer

import pkmcal as pk
from pkmcal.calibration.identification import Identification
from pkmcal.calibration.identify import identify
from pkmcal.cli.calibrate import calibrate
from pkmcal.diagnostics.check import Check, Level, Remedy
from pkmcal.diagnostics.checks import CHECKS
from pkmcal.diagnostics.diagnosis import verified

from ..docs.checks_table import stated, table
from ..simulated import hexapod_poses


def check(name: str, *unless: str, levels: tuple[Level, ...] = ("doubt",), **more: Any) -> Any:
    return Check(
        name=name, about="", run=lambda found: [name], say=lambda found, seen: f"{seen} speaks",
        unless=unless, levels=levels, **more,
    )  # fmt: skip


@pytest.fixture(scope="module")
def found(hexapod: pk.Robot) -> Identification:
    """A sound calibration."""
    rng = np.random.default_rng(3)
    q = hexapod.inverse(hexapod_poses(hexapod, 30, rng))
    seen = hexapod.replace({"offset1": 0.3}).forward(q).pose[:, :3]
    measured = pk.Measurements(q, seen + rng.normal(0, 0.02, (30, 3)), "position")
    return pk.identify(hexapod, measured, "offset*")


@pytest.mark.parametrize(("checks", "says"), [
    ([check("a"), check("a")], "a: two checks have this name"),
    ([check("a", "b")], "a: unless names no check: b"),
    ([check("a", levels=("doubt", "remark"))], "a: level_of must say which"),
    ([check("a", levels=())], "a: levels are of grave, doubt, remark; found none"),
    ([check("a", "b", at_once=True), check("b")], "a: made at once, it cannot wait for b"),
    ([check("a", "doubt", at_once=True), check("b")], "a: made at once, it cannot wait for b"),
    ([check("a", "b"), check("b", "c"), check("c", "a")], "wait for each other: a"),
    ([check("a", "doubt"), check("b", "doubt")], "wait for each other"),
])  # fmt: skip
def test_checks_that_do_not_agree_are_refused(checks: list[Any], says: str) -> None:
    with pytest.raises(ValueError, match=says):
        verified(checks)


def test_a_check_keeps_silent_beside_what_explains_it(found: Identification) -> None:
    """Whatever their order; one that keeps silent hides nothing itself; no check hides itself."""
    checks = [check("a", "b"), check("b", "c"), check("c", levels=("grave",)), check("d", "a")]
    assert [said.check for said in pk.diagnose(found, checks).said] == ["a", "c"]
    checks = [check("a", "grave"), check("b", "remark"), check("c", levels=("remark",))]
    assert [said.check for said in pk.diagnose(found, checks).said] == ["a", "c"]


@pytest.mark.parametrize(("levels", "state"), [
    ([], "calibrated"), (["remark"], "calibrated"), (["remark", "doubt"], "doubtful"),
    (["doubt", "grave", "remark"], "not calibrated"),
])  # fmt: skip
def test_the_verdict_is_the_worst_that_is_said(
    found: Identification, levels: list[Level], state: str
) -> None:
    verdict = pk.diagnose(found, [check(level, levels=(level,)) for level in levels])
    assert verdict.state == state
    grave_first = [level for level in ("grave", "doubt") if level in levels]
    if grave_first:
        assert verdict.reasons == tuple(f"{level} speaks" for level in grave_first)
    assert verdict.remarks == ("remark speaks",) * ("remark" in levels)


def test_no_check_is_made_twice_and_all_survive_a_pickle(found: Identification) -> None:
    made: list[str] = []

    def run(name: str) -> Any:
        return lambda _: made.append(name) or [name]

    checks = [
        Check(name=name, about="", run=run(name), say=lambda _, seen: seen, unless=unless)
        for name, unless in (("a", ("b",)), ("b", ()), ("c", ("b", "a")))
    ]
    pk.diagnose(found, checks)
    assert sorted(made) == sorted(set(made))
    again = pickle.loads(pickle.dumps(found))
    assert again.verdict == found.verdict


def remedies() -> list[Remedy]:
    """One of every kind that a check proposes."""
    return [
        Remedy("drop", (3, 17)), Remedy("drop", "outliers"), Remedy("drop", "slack"),
        Remedy("loss", "cauchy"), Remedy("unknown", "target"), Remedy("fix", "datum"),
        Remedy("fix", ("base1.x", "offset2")), Remedy("per_session", ("offset*", "frame.*")),
        Remedy("free"), Remedy("prior"), Remedy("bounds"), Remedy("effects"),
    ]  # fmt: skip


@pytest.mark.parametrize("remedy", remedies(), ids=str)
def test_a_remedy_is_an_argument_of_identify_and_an_option_of_the_command_line(
    remedy: Remedy,
) -> None:
    assert remedy.argument in inspect.signature(identify).parameters
    app = typer.Typer()
    app.command()(calibrate)
    command = cast(Any, typer.main.get_command(app))
    known = {option for parameter in command.params for option in parameter.opts}
    if remedy.option is not None:
        given = {word for word in remedy.option.split() if word.startswith("--")}
        assert given and given <= known
        assert remedy.option in str(remedy)
    assert f"{remedy.argument}=" in str(remedy)


def test_rows_are_named_as_the_command_line_takes_them() -> None:
    assert str(Remedy("drop", (3, 17))) == "--drop 3,17 (drop=[3, 17])"
    assert str(Remedy("per_session", ("offset*",))) == (
        "--per-session 'offset*' (per_session='offset*')"
    )


def test_a_remedy_stands_beside_what_was_asked_for() -> None:
    asked = {"drop": (3,), "fix": "base1.x", "loss": "huber"}
    assert Remedy("drop", "outliers").applied(asked)["drop"] == (3, "outliers")
    assert Remedy("fix", ("base1.x", "datum")).applied(asked)["fix"] == ("base1.x", "datum")
    assert Remedy("loss", "cauchy").applied(asked) == asked | {"loss": "cauchy"}
    assert Remedy("drop", "slack").applied({}) == {"drop": "slack"}
    assert asked == {"drop": (3,), "fix": "base1.x", "loss": "huber"}


def test_the_remedies_of_a_verdict_mend_what_it_says(hexapod: pk.Robot) -> None:
    """A row that is 5 mm off: each remedy alone gives a sound machine."""
    rng = np.random.default_rng(5)
    true = hexapod.replace({"offset2": 0.4})
    q = hexapod.inverse(hexapod_poses(hexapod, 40, rng))
    seen = true.forward(q).pose[:, :3] + rng.normal(0, 0.02, (40, 3))
    seen[7] += 5.0
    measured = pk.Measurements(q, seen, "position")
    spoilt = pk.identify(hexapod, measured, "offset*")
    assert spoilt.verdict.state == "not calibrated"
    (said,) = (each for each in spoilt.verdict.said if each.check == "rows-disagree")
    assert Remedy("drop", (7,)) in said.remedies and len(said.remedies) == 3
    for remedy in said.remedies:
        mended = pk.identify(hexapod, measured, "offset*", **remedy.applied({}))
        assert mended.robot.geometry["offset2"] == pytest.approx(0.4, abs=0.05)
        assert mended.verdict.state != "not calibrated"


def test_the_page_has_the_table_of_all_checks() -> None:
    assert stated() == table(), "python -m tests.docs.checks_table writes it"


def test_every_check_says_in_one_line_what_it_looks_for() -> None:
    for each in CHECKS:
        assert 10 < len(each.about) < 90 and each.about[0].islower() and each.about[-1] != "."


def test_a_check_alone_and_what_is_none_are_refused() -> None:
    one = pk.CHECKS[0]
    for wrong, message in ((one, "the check alone"), (7, "found int"), ([one, 7], "be a Check")):
        with pytest.raises(pk.ArgumentTypeError, match=f"^checks.*{message}"):
            verified(wrong)  # type: ignore[arg-type]


def test_a_remedy_without_a_value_is_not_applied() -> None:
    for before in ({}, {"fix": "offset1"}):
        with pytest.raises(pk.ArgumentError, match=r"^fix: the remedy states no value"):
            pk.Remedy("fix").applied(before)


@pytest.mark.parametrize(("wrong", "says"), [
    ({"run": lambda found: None}, r"own: run must return its findings, \[\] of none; found None"),
    ({"run": lambda found: 1.0}, "own: run must return its findings"),
    ({"run": lambda found: "ab"}, "own: run must return its findings"),
    ({"say": lambda found, seen: None}, "own: what say returns must be a str, found NoneType"),
    ({"remedies": lambda found, seen: Remedy("drop", (0,))}, "own: remedies must return a tuple"),
    ({"remedies": lambda found, seen: ("drop",)}, "own: remedies must return a tuple"),
])  # fmt: skip
def test_what_functions_of_a_check_return_wrongly_is_named(
    found: Identification, wrong: dict[str, Any], says: str
) -> None:
    given = {"run": lambda found: [1], "say": lambda found, seen: "it", **wrong}
    with pytest.raises(pk.ArgumentTypeError, match=says):
        pk.diagnose(found, [Check(name="own", about="", **given)])


def _fails(*given: Any) -> Any:
    return found_nothing  # type: ignore[name-defined]  # noqa: F821


def _fails_late(found: Any) -> Iterator[int]:
    yield found.no_such_thing


@pytest.mark.parametrize(
    ("member", "function", "says"),
    [
        ("run", _fails, "own: run failed with NameError: .* it is given the calibration"),
        ("run", _fails_late, "own: run failed with AttributeError"),
        ("run", lambda: [1], "own: run failed with TypeError"),
        ("say", _fails, "own: say failed with NameError: .* what run found: 1"),
        ("level_of", _fails, "own: level_of failed with NameError"),
        ("remedies", _fails, "own: remedies failed with NameError"),
    ],
)
def test_a_function_of_a_check_that_fails_is_named(
    found: Identification, member: str, function: Any, says: str
) -> None:
    whole = {"run": lambda found: [1], "say": lambda found, seen: "it"}
    with pytest.raises(pk.ArgumentTypeError, match=says):
        pk.diagnose(found, [Check(name="own", about="", **{**whole, member: function})])


def test_one_level_or_one_name_may_stand_alone_and_a_check_has_a_name() -> None:
    assert check("a", levels=cast(Any, "remark")).levels == ("remark",)
    assert check("a", levels=cast(Any, ["remark"])).levels == ("remark",)
    for member in ("levels", "unless"):
        with pytest.raises(pk.ArgumentTypeError, match=f"{member} of the check a must be a name"):
            pk.Check(**{"name": "a", "about": "b", "run": len, "say": str, member: 3})
    one = Check(name="a", about="", run=len, say=str, unless=cast(Any, "grave"))  # type: ignore
    assert one.unless == ("grave",)
    with pytest.raises(pk.ArgumentError, match="name of a check must be a word, found None"):
        check(cast(Any, None))


@pytest.mark.parametrize(
    ("members", "says"),
    [
        ({"run": [1]}, "a: run must be a function, found "),
        ({"say": None}, "a: say must be a function, found None"),
        ({"level_of": "doubt"}, "a: level_of must be a function, found 'doubt'"),
        ({"about": None}, "about of the check a must be a str"),
    ],
)
def test_a_check_is_looked_at_when_it_is_made(members: dict[str, Any], says: str) -> None:
    whole = {"about": "", "run": len, "say": str, **members}
    with pytest.raises(pk.ArgumentTypeError, match=f"^{says}"):
        Check(name="a", **whole)  # type: ignore[arg-type]


def test_a_level_that_no_check_has_is_an_error(found: Identification) -> None:
    strange = check("a", levels=("doubt", "remark"), level_of=lambda found, seen: "sure")
    with pytest.raises(ValueError, match="a: level_of must say doubt, remark or None; said 'sure'"):
        pk.diagnose(found, [strange])
