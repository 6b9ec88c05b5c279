"""`pkmcal sensitivity` and `pkmcal tolerance`: what they print and write, and their exit codes."""

from __future__ import annotations

import csv
import hashlib
import json
import re
import shlex
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.cli import tolerance as cli_tolerance
from pkmcal.error_model.sensitivity import STUDIES, own_names, study_cases
from pkmcal.jobs.geometry_options import read_deviations
from pkmcal.measurements.pose_csv import read_poses, write_poses
from pkmcal.report import drawing
from pkmcal.report import error_figures as figures


@pytest.fixture
def without_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Drawing takes seconds; one test draws all."""
    for name in ("errors_by_pose", "mean_errors"):
        monkeypatch.setattr(figures, name, lambda found, title: None)

    def write_both(figure: None, path: Path) -> None:
        for kind in drawing.KINDS:
            path.with_name(f"{path.name}.{kind}").write_bytes(b"no picture")

    monkeypatch.setattr(drawing, "write_both", write_both)


@pytest.mark.usefixtures("without_figures")
@pytest.mark.parametrize("verb", ["sensitivity", "tolerance"])
def test_help_shows_an_example_that_runs(run: Any, verb: str) -> None:
    words = " ".join(run(verb, "--help").stdout.split())
    match = re.search(r"Example: (pkmcal .*?) [╭+]", words)
    assert match
    command, *arguments = shlex.split(match[1])
    assert (command, arguments[0]) == ("pkmcal", verb)
    assert run(*arguments).exit_code == 0


def _rows(table: Path) -> list[dict[str, str]]:
    """Rows of a table below its comments."""
    lines = table.read_text(encoding="utf-8").splitlines()
    return list(csv.DictReader(line for line in lines if not line.startswith("#")))


@pytest.mark.usefixtures("without_figures")
@pytest.mark.parametrize(
    ("verb", "files"),
    [
        (["sensitivity"], ["sensitivity.csv", "poses.csv"]),
        (["tolerance", "--sigma", "0.1", "--samples", "100"], ["tolerance.csv"]),
    ],
)
def test_tables_say_what_they_were_made_of(run: Any, verb: list[str], files: list[str]) -> None:
    write_poses("at.csv", pk.sample_poses(pk.load("2tpr2tps"), 3))
    assert run(verb[0], "2tpr2tps", "--poses", "at.csv", *verb[1:], "--out", "out").exit_code == 0
    digest = hashlib.sha256(Path("at.csv").read_bytes()).hexdigest()
    for name in files:
        head = Path("out", name).read_text(encoding="utf-8").split("\n")[1:4]
        assert head[0] == f"# Written by pkmcal {pk.__version__} from"
        assert head[1].startswith("#   built-in machine 2tpr2tps, sha256 ")
        assert head[2] == f"#   at.csv, sha256 {digest}"


# --- sensitivity -----------------------------------------------------------------------------


def test_one_command_draws_the_six_figures_and_writes_the_table(run: Any, tmp_path: Path) -> None:
    result = run("sensitivity", "2tpr2tps", "--out", "errors")
    assert (result.exit_code, result.stderr) == (0, "")
    expected = {
        f"{study}-{what}.{kind}"
        for study in STUDIES
        for what in ("poses", "mean")
        for kind in ("png", "svg")
    }
    files = {path.name for path in (tmp_path / "errors").iterdir()}
    assert files == expected | {"sensitivity.csv", "poses.csv"}
    robot = pk.load("2tpr2tps")
    found = pk.sensitivity(robot, pk.sample_poses(robot), 1.0, cases=study_cases(robot, "offsets"))
    assert str(found) in result.stdout
    table = _rows(tmp_path / "errors" / "sensitivity.csv")
    rows = {row["error of"]: row for row in table if row["study"] == "offsets"}
    assert list(rows) == list(found.cases)
    for case, mean, linear in zip(found.cases, found.mean, found.mean_linear, strict=True):
        assert float(rows[case]["mean dy [mm]"]) == pytest.approx(mean[1], rel=1e-5)
        assert float(rows[case]["linear dalpha [deg]"]) == pytest.approx(
            np.degrees(linear[3]), rel=1e-5
        )


@pytest.mark.usefixtures("without_figures")
def test_the_poses_it_wrote_give_the_same_again(run: Any) -> None:
    first = run("sensitivity", "2tpr2tps", "--out", "one", "--seed", "3")
    again = run("sensitivity", "2tpr2tps", "--out", "two", "--poses", "one/poses.csv")
    tables = [r.stdout.split("\none/")[0].split("\ntwo/")[0] for r in (first, again)]
    assert tables[0] == tables[1]
    assert run("sensitivity", "2tpr2tps", "--seed", "4").stdout != first.stdout


@pytest.mark.usefixtures("without_figures")
def test_sensitivity_as_json_stands_alone(run: Any) -> None:
    found = json.loads(run("sensitivity", "linear-delta", "--step", "0.5", "--json").stdout)
    assert set(found) == set(STUDIES)
    robot = pk.load("linear-delta")
    expected = pk.sensitivity(
        robot, pk.sample_poses(robot), 0.5, cases=study_cases(robot, "all-limbs")
    )
    assert found["all-limbs"]["cases"] == list(expected.cases)
    np.testing.assert_allclose(found["all-limbs"]["exact"], expected.exact)
    np.testing.assert_allclose(found["all-limbs"]["mean"], expected.mean)


@pytest.mark.usefixtures("without_figures")
def test_poses_that_are_not_solved_make_exit_code_1(run: Any, tmp_path: Path) -> None:
    Path("far.csv").write_text("x [mm],z [mm]\n0,120\n5000,120\n", encoding="utf-8")
    result = run("sensitivity", "linear-delta", "--poses", "far.csv")
    assert result.exit_code == 1
    assert "not solved" in result.stdout


def test_wrong_input_is_refused_in_one_line(refused: Any) -> None:
    assert "did you mean 'hexapod'" in refused("sensitivity", "hexapd")
    assert "step must not be 0, found 0" in refused("sensitivity", "hexapod", "--step", "0")
    assert "home is singular" in refused("sensitivity", "rbt-6t03p-printed")
    Path("p.csv").write_text("x [mm],zz [mm]\n0,1\n", encoding="utf-8")
    assert "unknown column 'zz'" in refused("sensitivity", "hexapod", "--poses", "p.csv")


# --- tolerance -------------------------------------------------------------------------------


def test_tolerance_prints_what_the_library_finds(run: Any, tmp_path: Path) -> None:
    options = ["--sigma", "base*=0.1", "--sigma", "offset1=20um", "--samples", "3000"]
    result = run("tolerance", "2tpr2tps", *options, "--seed", "7", "--out", "t")
    robot = pk.load("2tpr2tps")
    found = pk.tolerance(
        robot, pk.sample_poses(robot, seed=7), {"base*": 0.1, "offset1": 0.02}, samples=3000, seed=7
    )
    assert (result.exit_code, result.stderr) == (0, "")
    assert result.stdout == f"{found}\n"
    rows = _rows(tmp_path / "t" / "tolerance.csv")
    assert len(rows) == 30
    assert float(rows[4]["std dz [mm]"]) == pytest.approx(found.std[4, 2], rel=1e-6)
    assert float(rows[4]["distance 95 % [mm]"]) == pytest.approx(found.distance95[4], rel=1e-6)


def test_a_map_is_drawn_over_two_coordinates(
    run: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cli_tolerance, "_MACHINES", 100)
    options = ["--sigma", "0.1", "--samples", "100", "--map", "y,z", "--out", "t"]
    assert run("tolerance", "2tpr2tps", *options).exit_code == 0
    assert {p.name for p in (tmp_path / "t").iterdir()} == {"map.png", "map.svg", "tolerance.csv"}


def test_allowed_asks_the_inverse_question(run: Any) -> None:
    options = ["--allowed", "0.2", "--samples", "3000"]
    robot = pk.load("2tpr2tps")
    expected = pk.allocate_tolerance(robot, pk.sample_poses(robot), 0.2, samples=3000)
    assert run("tolerance", "2tpr2tps", *options).stdout == f"{expected}\n"
    found = json.loads(run("tolerance", "2tpr2tps", *options, "--json").stdout)
    np.testing.assert_allclose(found["sigma"], expected.sigma)
    assert found["joints"] == list(expected.joints)
    assert found["reached"] == {"distance": expected.reached["distance"]}


def test_tolerance_as_json_holds_the_attributes_of_the_result(run: Any) -> None:
    options = ["--sigma", "0.1", "--samples", "500", "--json"]
    found = json.loads(run("tolerance", "2tpr2tps", *options).stdout)
    for name in ("mean", "std", "interval95", "linear_std", "worst_case", "contribution", "names"):
        assert name in found
    assert found["samples"] == 500 and np.shape(found["interval997"]) == (30, 6, 2)


def test_sigma_has_the_units_of_prior() -> None:
    robot = pk.load("rbt-6t03p")
    names = own_names(robot)
    assert read_deviations("--sigma", ["0.1"], robot, names) == 0.1
    given = ["slider*.tilt1=0.1deg", "rod*=10um"]
    read = read_deviations("--sigma", given, robot, names)
    assert isinstance(read, dict)
    assert read["slider*.tilt1"] == pytest.approx(np.radians(0.1))
    assert read["rod*"] == pytest.approx(0.01)


def test_wrong_options_are_refused_in_one_line(refused: Any) -> None:
    assert "--sigma or --allowed" in refused("tolerance", "2tpr2tps")
    assert "--sigma or --allowed" in refused(
        "tolerance", "2tpr2tps", "--sigma", "0.1", "--allowed", "1"
    )
    assert "into the folder of --out" in refused(
        "tolerance", "2tpr2tps", "--sigma", "0.1", "--map", "y,z"
    )
    assert "--sigma base1.x: expected NAME=NUMBER" in refused(
        "tolerance", "2tpr2tps", "--sigma", "base1.x"
    )
    assert "covers lengths (" in refused("tolerance", "rbt-6t03p", "--sigma", "*=1")
    few = ["tolerance", "2tpr2tps", "--sigma", "0.1", "--samples", "10", "--out", "t"]
    assert "'x' is not one of y, z, alpha, beta" in refused(*few, "--map", "x,z")
    assert "expected two coordinates" in refused(*few, "--map", "y")
    assert "did you mean 'base1.x'" in refused("tolerance", "2tpr2tps", "--sigma", "bse1.x=1")
    assert "allowed distance must be" in refused("tolerance", "2tpr2tps", "--allowed", "-1")


# --- poses in a file -----------------------------------------------------------------------------


def test_poses_come_back_from_a_file(tmp_path: Path) -> None:
    robot = pk.load("hexapod")
    drawn = pk.sample_poses(robot, 5)
    write_poses(tmp_path / "p.csv", drawn)
    np.testing.assert_allclose(read_poses(tmp_path / "p.csv", robot), drawn, atol=1e-6)


def test_a_column_that_is_missing_is_that_of_home(tmp_path: Path) -> None:
    file = tmp_path / "p.csv"
    file.write_text("alpha [deg]; z [m]\n10; 0,8\n-5; 0,85\n", encoding="utf-8")
    found = read_poses(file, pk.load("hexapod"))
    np.testing.assert_allclose(found[:, 2], [800, 850])
    np.testing.assert_allclose(found[:, 3], np.radians([10, -5]))
    assert (found[:, [0, 1, 4, 5]] == 0).all()


def test_an_error_at_which_nothing_is_solved_leaves_empty_figures(run: Any) -> None:
    result = run("sensitivity", "2tpr2tps", "--step", "500")
    assert result.exit_code == 1
    assert "not solved" in result.stdout
    assert Path("pkmcal-sensitivity/limb1-mean.png").exists()
