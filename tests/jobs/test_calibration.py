"""A calibration as an object: its command line, its table, and what is read of both."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings

import pkmcal as pk
from pkmcal.cli import calibrate
from pkmcal.diagnostics.check import Remedy
from pkmcal.exceptions import ArgumentError
from pkmcal.jobs import calibrating
from pkmcal.jobs.calibration import Calibration, Writing
from pkmcal.jobs.effects_option import read_effects
from pkmcal.jobs.inputs import Inputs
from pkmcal.jobs.project import Project
from pkmcal.jobs.reading import Reading
from pkmcal.jobs.stated import Stated

from .states import RENAMED, TEXT, said_by, states

ROOT = Path(__file__).resolve().parents[2]
DELTA = ROOT / "examples" / "linear-delta"
ROBOT, PROBE = str(DELTA / "robot.toml"), str(DELTA / "probe.csv")

CALIBRATIONS = states(
    Calibration,
    robot=st.sampled_from(["hexapod", "-x.toml", "my robot.toml", "kuka.urdf#tool0"]),
    files=st.lists(TEXT, min_size=1, max_size=3),
    reading=states(Reading, rename=st.lists(RENAMED, max_size=3)),
)
WRITINGS = states(Writing)


def round_trip(run: Any, job: Calibration, asked: Writing) -> None:
    program, verb, *words = job.argv()
    assert (program, verb) == ("pkmcal", "calibrate")
    argv = [verb, *asked.options(), *words]
    assert said_by(run, calibrate, "carried_out", Stated, argv) == [job, asked]


@given(CALIBRATIONS, WRITINGS)
@settings(max_examples=40, suppress_health_check=list(HealthCheck))
def test_a_command_line_says_the_same_calibration(run: Any, job: Any, asked: Any) -> None:
    round_trip(run, job, asked)


@pytest.mark.slow
@given(CALIBRATIONS, WRITINGS)
@settings(max_examples=1000, suppress_health_check=list(HealthCheck))
def test_a_thousand_command_lines_say_the_same_calibration(run: Any, job: Any, asked: Any) -> None:
    round_trip(run, job, asked)


@given(CALIBRATIONS)
@settings(suppress_health_check=list(HealthCheck))
def test_a_project_file_says_the_same_calibration(job: Any) -> None:
    project = Project(job)
    assert Project.of_table(project.table()) == project
    assert Project.of_text(project.text()) == project


def test_every_option_of_the_verb_is_said_by_one_object() -> None:
    said = [each.name for part in (Calibration, Reading, Writing) for each in fields(part)]
    options = [name for name in calibrate.calibrate.__annotations__ if name != "return"]
    assert sorted([*said, "context", "project", "json"]) == sorted([*options, "reading"])


def test_a_project_gives_what_its_options_give(run: Any, tmp_path: Path) -> None:
    job = Calibration(ROBOT, (PROBE,), free=("default",), datum="auto", holdout="0.3", drop=("3",))
    (tmp_path / "project.toml").write_text(Project(job).text(), encoding="utf-8")
    by_options = run(*job.argv()[1:])
    by_project = run("calibrate", "--project", tmp_path / "project.toml")
    assert by_project.stdout == by_options.stdout and by_options.stdout
    assert by_project.exit_code == by_options.exit_code
    found = calibrating.run(job, Inputs(), lambda line: None)
    assert by_options.stdout == found.summary() + "\n"


def test_files_of_a_project_lie_beside_it(run: Any, tmp_path: Path) -> None:
    for name in ("robot.toml", "probe.csv"):
        (tmp_path / name).write_bytes((DELTA / name).read_bytes())
    job = Calibration("robot.toml", ("probe.csv",), holdout="probe.csv")
    (tmp_path / "project.toml").write_text(Project(job).text(), encoding="utf-8")
    (below := tmp_path / "below").mkdir()
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(below)
        result = run("calibrate", "--project", "../project.toml", "--out", "out")
    assert result.exit_code in (0, 1)
    assert (below / "out" / "robot.toml").exists()


@pytest.mark.parametrize(
    ("text", "where"),
    [
        ("pkmcal-project = 2\n", "line 1: pkmcal-project: must be 1"),
        ("", "pkmcal-project: must be 1"),
        ("pkmcal-project = 1\n[fit]\nfre = ['a']\n", "line 3: unknown key 'fre' of [fit]"),
        ("pkmcal-project = 1\n[fot]\nfree = ['a']\n", "line 2: unknown key 'fot'"),
        ("pkmcal-project = 1\n[measured]\nunit = 'mm'\n", "line 3: unknown key 'unit'"),
        ("pkmcal-project = 1\n[machine]\nname = 'x'\n", "line 3: unknown key 'name'"),
        (
            "pkmcal-project = 1\n[machine]\nbuiltin = 'x'\n",
            "line 3: [machine]: builtin: 'x' is no built-in",
        ),
        ("pkmcal-project = 1\n[fit]\n\ndrop = 3\n", "line 4: [fit]: drop: must be a list"),
        ("pkmcal-project = 1\n[fit]\ndrop-slack = 1\n", "line 3: [fit]: drop-slack: must be true"),
        ("pkmcal-project = 1\nfit = 3\n", "line 2: fit: must be a table"),
        ("pkmcal-project = 1\n[fit\n", "not valid TOML"),
    ],
)
def test_a_mistake_in_a_project_is_named_with_line_and_key(
    refused: Any, tmp_path: Path, text: str, where: str
) -> None:
    (file := tmp_path / "project.toml").write_text(text, encoding="utf-8")
    said = refused("calibrate", "--project", file)
    assert said.startswith(str(file)) and where in said


@pytest.mark.parametrize("option", [("--free", "x"), ("--drop-slack",), ("robot.toml",)])
def test_a_project_says_all_of_the_calibration(
    refused: Any, tmp_path: Path, option: tuple[str, ...]
) -> None:
    (file := tmp_path / "project.toml").write_text("pkmcal-project = 1\n")
    assert "--project says" in refused("calibrate", "--project", file, *option)


def test_a_project_without_a_machine_is_refused(refused: Any, tmp_path: Path) -> None:
    (file := tmp_path / "project.toml").write_text("pkmcal-project = 1\n")
    assert "ROBOT" in refused("calibrate", "--project", file)


def test_default_is_the_word_for_the_numbers_that_the_robot_file_frees() -> None:
    job = Calibration(ROBOT, (PROBE,), free=("default",))
    sources = calibrating.read(job, Inputs(), lambda line: None)
    free = list(pk.load(ROBOT).model.free)
    said = [("default",), (f"{free[0]},default",), ("default", "rod1")]
    for given_free in said:
        asked = replace(job, free=given_free)
        found = calibrating.arguments(asked, sources, lambda line: None)["free"]
        assert found == list(dict.fromkeys([*free, *["rod1"] * ("rod1" in given_free)]))


@pytest.mark.parametrize(
    ("remedy", "changed"),
    [
        (Remedy("drop", (3, 17)), {"drop": ("a.csv:9", "3,17")}),
        (Remedy("drop", "slack"), {"drop_slack": True}),
        (Remedy("loss", "cauchy"), {"loss": "cauchy"}),
        (Remedy("unknown", "target"), {"target": "unknown"}),
        (Remedy("fix", "datum"), {"datum": "auto"}),
        (Remedy("fix", ("base1.x", "it's")), {"fix": ("gain1", "base1.x", "it's")}),
        (Remedy("free", ("rod*",)), {"free": ("rod*",)}),
        (Remedy("effects", (pk.Sag((2, 3)),)), {"effects": ("sag=2:3",)}),
        (Remedy("per_session", ("offset*", "frame.*")), {"per_session": ("offset*", "frame.*")}),
    ],
    ids=str,
)
def test_a_remedy_changes_one_option_beside_what_there_is(
    remedy: Remedy, changed: dict[str, Any]
) -> None:
    job = Calibration("r.toml", ("a.csv",), free=("x",), fix=("gain1",), drop=("a.csv:9",),
                      effects=("none",))  # fmt: skip
    assert job.with_remedy(remedy) == replace(job, **changed)


@pytest.mark.parametrize("remedy", [Remedy("prior"), Remedy("bounds"), Remedy("free")], ids=str)
def test_a_remedy_of_which_only_the_user_knows_the_value_is_refused(remedy: Remedy) -> None:
    with pytest.raises(ArgumentError, match=remedy.argument):
        Calibration("r.toml", ("a.csv",)).with_remedy(remedy)


def test_a_server_needs_no_numerical_package_to_hold_a_calibration() -> None:
    program = """
import sys
from pkmcal.jobs.project import Project
from pkmcal.jobs.calibration import Calibration, Writing
job = Calibration("hexapod", ("a.csv",), holdout="b.csv", free=("default",))
project = Project(job).in_folder("folder")
assert Project.of_table(project.table()) == project
assert project.calibration.argv() and Writing(report="x").options() and project.text()
found = {"numpy", "scipy", "typer"} & set(sys.modules)
assert not found, found
"""
    subprocess.run([sys.executable, "-c", program], check=True)


@pytest.mark.parametrize(
    "effect",
    [
        pk.Sag(), pk.Sag("all"), pk.Sag((2, 3)), pk.Sag("all", tied=True), pk.Harmonics([1, 2]),
        pk.Harmonics([200], joints=3),
        pk.Elasticity(("offset*",)),
    ],
    ids=lambda effect: effect.option,
)  # fmt: skip
def test_an_effect_that_a_check_proposes_is_the_one_that_the_calibration_has(effect: Any) -> None:
    job = Calibration("arm.toml", ("a.csv",)).with_remedy(Remedy("effects", (effect,)))
    assert [each.option for each in read_effects(job.effects)] == [effect.option]


def test_an_effect_that_a_check_proposes_stands_in_for_that_of_its_name() -> None:
    job = Calibration("arm.toml", ("a.csv",), effects=("elasticity=joint*,sag", "harmonics=1"))
    after = job.with_remedy(Remedy("effects", (pk.Sag("all"),)))
    assert after.effects == ("elasticity=joint*", "harmonics=1", "sag=all")
    assert replace(job, effects=("auto",)).with_remedy(Remedy("effects", (pk.Sag(),))).effects == (
        "sag",
    )


@pytest.mark.parametrize(
    "remedy",
    [
        Remedy("drop", (3, 17)), Remedy("drop", "outliers"), Remedy("loss", "cauchy"),
        Remedy("unknown", "target"), Remedy("fix", ("offset2",)), Remedy("fix", "datum"),
        Remedy("free", ("offset*",)),
    ],
    ids=str,
)  # fmt: skip
def test_a_remedy_is_the_argument_of_identify_that_it_names(remedy: Remedy) -> None:
    """Beside what the calibration has: fixed and dropped rows, another loss."""
    job = Calibration(ROBOT, (PROBE,), fix=("offset1",), drop=("5",), loss="huber")
    sources = calibrating.read(job, Inputs(), lambda line: None)

    def said(asked: Calibration) -> dict[str, Any]:
        return calibrating.arguments(asked, sources, lambda line: None)

    before, after = said(job), said(job.with_remedy(remedy))
    wanted = {"measurements": before.pop("measurements"), **remedy.applied(before)}
    assert after.pop("measurements") is wanted.pop("measurements")
    found = [
        calibrating.identified(sources, {"measurements": sources.measured[0], **each})
        for each in (after, wanted)
    ]
    assert [found[0].free, found[0].dropped] == [found[1].free, found[1].dropped]
    np.testing.assert_array_equal(found[0].values, found[1].values)
