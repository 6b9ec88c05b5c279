"""The command line: what it prints and writes, its exit codes, and one line for wrong input."""

from __future__ import annotations

import json
import math
import os
import re
import shlex
import shutil
import subprocess
import sys
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

import pkmcal as pk
from pkmcal.calibration.identification import Identification
from pkmcal.calibration.identify import identify
from pkmcal.cli import verbs
from pkmcal.cli.demonstration import demonstrate
from pkmcal.cli.main import main
from pkmcal.files import atomic as whole_file
from pkmcal.jobs import calibrating, read_files
from pkmcal.jobs.geometry_options import read_deviations
from pkmcal.measurements.measurements import Measurements

from ..simulated import altered

ROOT = Path(__file__).resolve().parents[2]
DELTA = ROOT / "examples" / "linear-delta"
ROBOT, PROBE = str(DELTA / "robot.toml"), str(DELTA / "probe.csv")
GROUP = typer.main.get_group(verbs.app)
VERBS = GROUP.list_commands(typer.Context(GROUP))


def files_below(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*")}


# --- the command itself --------------------------------------------------------------------------


def test_command_is_installed_under_its_name() -> None:
    (entry,) = metadata.entry_points(group="console_scripts", name="pkmcal")
    assert entry.load() is main


def test_version_is_that_of_the_package(run: Any) -> None:
    assert run("--version").stdout == f"pkmcal {metadata.version('pkmcal')}\n"


def test_without_a_verb_the_verbs_are_listed(run: Any) -> None:
    result = run()
    assert result.exit_code == 0
    assert all(verb in result.stdout for verb in VERBS)


def draw_pictures(folder: Path, cv2: Any) -> None:
    """Pictures of the board of the example, tilted in several ways."""
    from pkmcal.examples.camera.render import Photographer

    board = pk.readings.Board.parse("charuco:8x6,20,15,5X5_100")
    lens = {"fx": 1150.0, "fy": 1152.0, "cx": 402.0, "cy": 296.0, "width": 800, "height": 600}
    lens |= dict.fromkeys(("k1", "k2", "p1", "p2", "k3"), 0.0)
    photographer, middle = Photographer(board, lens), board.places.mean(axis=0)
    folder.mkdir()
    for k in range(8):
        motion = pk.screw.exp([0.5 * np.cos(k), 0.5 * np.sin(k), 0.0, 0.0, 0.0, 0.0])
        place = [30.0 * np.sin(3 * k), 20.0 * np.cos(2 * k), 380.0]
        motion[:3, 3] = place - motion[:3, :3] @ middle
        cv2.imwrite(str(folder / f"{k}.png"), photographer.take(motion))


@pytest.mark.parametrize("verb", VERBS)
def test_help_shows_an_example_that_runs(
    run: Any, verb: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if verb == "app":  # it serves until it is interrupted; tests/app does that
        launch = pytest.importorskip("pkmcal.app.launch", reason="the extra app is not installed")
        monkeypatch.setattr(launch, "launch", lambda *given: None)
    if verb in ("detect", "board"):
        cv2 = pytest.importorskip("cv2", reason="the extra vision is not installed")
    if verb == "detect":
        draw_pictures(tmp_path / "pictures", cv2)
    for folder in (DELTA, DELTA.parent / "2tpr2tps-compensation"):
        shutil.copytree(folder, tmp_path / "examples" / folder.name)
    words = " ".join(run(verb, "--help").stdout.split())
    match = re.search(r"Example: (pkmcal .*?) [╭+]", words)
    assert match
    command, *arguments = shlex.split(match[1])
    assert (command, arguments[0]) == ("pkmcal", verb)
    if verb == "measure":  # nobody is there who types that it may start
        assert "not started" in run(*arguments).stderr
        return
    assert run(*arguments).exit_code == 0


@pytest.mark.parametrize("verb", VERBS)
def test_help_shows_the_units_of_columns(run: Any, verb: str) -> None:
    words = " ".join(run(verb, "--help").stdout.replace("│", " ").split())
    for column in re.findall(r"'(?:x|y|z|alpha) [^']*'", words):
        assert "[" in column, column


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_explains_itself_and_speaks_json(run: Any, verb: str) -> None:
    words = " ".join(run(verb, "--help").stdout.split())
    assert f"Example: pkmcal {verb}" in words
    assert "--json" in words or verb in ("app", "measure")  # an address alone; with a person


def test_shell_completion_knows_the_verbs() -> None:
    asked = {"_PKMCAL_COMPLETE": "complete_bash", "COMP_WORDS": "pkmcal cal", "COMP_CWORD": "1"}
    done = subprocess.run(
        [sys.executable, "-c", "from pkmcal.cli.main import main; main()"],
        env=os.environ | asked,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stdout.split() == ["calibrate"]


def test_process_refuses_in_one_line_and_with_exit_code_2(tmp_path: Path) -> None:
    code = "from pkmcal.cli.main import main; main()"
    done = subprocess.run(
        [sys.executable, "-c", code, "calibrate", "hexapd", "x.csv"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "pkmcal: unknown machine 'hexapd'; did you mean 'hexapod'?\n"


def test_process_prints_to_a_terminal_that_lacks_letters(tmp_path: Path) -> None:
    code = (
        "import sys; from pkmcal.cli.main import main\n"
        "sys.stdout.reconfigure(encoding='cp437')\n"
        "main()"
    )  # fmt: skip
    arguments = ["calibrate", ROBOT, PROBE, "--frame", "unknown"]
    done = subprocess.run(
        [sys.executable, "-c", code, *arguments], cwd=tmp_path, capture_output=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, b"")
    assert b"?" in done.stdout and b"offset1" in done.stdout  # of a sum: a minus sign


# --- machines ------------------------------------------------------------------------------------


def test_machines_lists_every_built_in_machine_with_what_it_frees(run: Any) -> None:
    lines = run("machines").stdout.splitlines()[1:]
    assert [line.split()[0] for line in lines] == list(pk.machines())
    parallel = [pk.load(name) for name in pk.machines() if name != "3r"]
    free = [*(len(robot.model.free) for robot in parallel), 18]  # six errors of each joint
    assert [int(line.split()[-1]) for line in lines] == free


def test_machines_as_json(run: Any) -> None:
    listed = json.loads(run("machines", "--json").stdout)
    assert listed["linear-delta"]["limbs"] == ["PUS", "PUS", "PUS"]
    assert listed["2tpr2tps"]["coordinates"] == ["y", "z", "alpha", "beta"]


# --- calibrate -----------------------------------------------------------------------------------


def test_calibrate_prints_the_summary_of_identify(run: Any) -> None:
    robot = pk.load(ROBOT)
    result = run("calibrate", ROBOT, PROBE)
    assert (result.exit_code, result.stderr) == (0, "")
    assert result.stdout == identify(robot, pk.read_measurements(PROBE)).summary() + "\n"


def test_calibrate_writes_the_robot_it_found(run: Any, tmp_path: Path) -> None:
    assert run("calibrate", ROBOT, PROBE, "--out", "new/folder").exit_code == 0
    expected = identify(pk.load(ROBOT), pk.read_measurements(PROBE)).robot
    written = pk.load(tmp_path / "new" / "folder" / "robot.toml")
    np.testing.assert_array_equal(written.geometry.values, expected.geometry.values)
    files = {"new/folder/robot.toml", "new/folder/residuals.png"}
    assert files_below(tmp_path) == {"new", "new/folder", *files}


def test_json_stands_alone_and_holds_the_attributes_of_the_result(run: Any, tmp_path: Path) -> None:
    result = run("calibrate", ROBOT, PROBE, "--json", "--out", ".")
    found = json.loads(result.stdout)
    expected = identify(pk.load(ROBOT), pk.read_measurements(PROBE))
    assert found["rms"] == expected.rms
    assert found["converged"] is True
    assert found["gap"] is None  # infinite
    names = ["radius", "angle1", "angle2", "offset1", "offset2", "offset3"]
    assert list(found["parameters"]) == names
    for name, value, stderr in zip(names, expected.values, expected.stderr, strict=True):
        assert found["parameters"][name] == {"value": value, "stderr": stderr}
    for name in set(found) - {"schema", "parameters", "correlations"}:
        assert hasattr(expected, name), name
    assert {"free", "covariance", "rank", "outliers", "warnings", "holdout_rms"} <= set(found)
    assert found["robot"]["geometry"]["radius"] == expected.robot.geometry["radius"]
    assert (tmp_path / "robot.toml").exists()


@pytest.mark.parametrize(
    "options",
    [
        ["--free", "radius", "--free", "angle[12]", "--free", "offset*", "--free", "rod*"],
        ["--free", "radius,angle[12],offset*,rod*"],
    ],
)
def test_free_replaces_the_default_set(run: Any, options: list[str]) -> None:
    found = json.loads(run("calibrate", ROBOT, PROBE, "--json", *options).stdout)
    assert found["free"] == [
        *("radius", "angle1", "angle2", "offset1", "offset2", "offset3"),
        *("rod1", "rod2", "rod3"),
    ]


def test_holdout_is_a_fraction_or_a_file(run: Any, tmp_path: Path) -> None:
    whole = pk.read_measurements(PROBE)
    whole.select(slice(30)).write("fit.csv")
    whole.select(slice(30, None)).write("held.csv")
    fraction = json.loads(run("calibrate", ROBOT, PROBE, "--json", "--holdout", "0.2").stdout)
    other = json.loads(run("calibrate", ROBOT, "fit.csv", "--json", "--holdout", "held.csv").stdout)
    assert len(fraction["rows"]) == 33
    assert len(other["rows"]) == 30
    for found in (fraction, other):
        assert 0 < found["holdout_rms"] < 2 * 0.03 < found["holdout_rms_before"]


def test_prior_holds_what_is_given_a_small_sigma(run: Any) -> None:
    options = ["--free", "radius,angle1,offset*", "--json"]
    priors = ["--prior", "angle1=0.001deg", "--prior", "offset*=1um"]
    found = json.loads(run("calibrate", ROBOT, PROBE, *options, *priors).stdout)
    assert found["parameters"]["angle1"]["stderr"] <= math.radians(0.001)
    assert found["parameters"]["offset2"]["stderr"] <= 0.001
    assert found["parameters"]["radius"]["stderr"] > 0.01


def test_prior_units_are_those_of_the_number() -> None:
    robot = pk.load(ROBOT)
    free = ["radius", "angle1", "angle2", "offset1"]
    assert read_deviations("--prior", [], robot, free) is None
    assert read_deviations("--prior", ["0.5"], robot, free) == 0.5
    assert read_deviations("--prior", ["500um"], robot, free) == 0.5
    assert read_deviations("--prior", ["radius = 2e-1", "angle*=90deg"], robot, free) == {
        "radius": 0.2,
        "angle*": math.pi / 2,
    }
    assert read_deviations("--prior", ["frame.alpha=2mrad"], robot, free) == {"frame.alpha": 0.002}


def test_result_with_a_warning_is_not_to_be_trusted(run: Any) -> None:
    pk.read_measurements(PROBE).select([0, 1, 2, 3]).write("few.csv")
    result = run("calibrate", ROBOT, "few.csv")
    assert result.exit_code == 1
    assert "4 equations for 6 parameters" in result.stdout
    assert result.stderr == ""
    assert run("calibrate", ROBOT, "few.csv", "--json").exit_code == 1


def test_result_that_did_not_converge_is_not_to_be_trusted(
    run: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def gave_up(*arguments: Any, **settings: Any) -> Identification:
        return altered(identify(*arguments, **settings), converged=False)

    monkeypatch.setattr(calibrating, "identify", gave_up)
    result = run("calibrate", ROBOT, PROBE)
    assert result.exit_code == 1
    assert result.stdout.startswith("Not calibrated: the least squares did not converge\n")


# --- wrong input ---------------------------------------------------------------------------------

HEADER = "q1 [mm],q2 [mm],q3 [mm],z [mm]\n"
ROWS = "-330,-330,-330,0.6\n-347,-317,-332,0.8\n"


@pytest.mark.parametrize(
    ("csv", "said"),
    [
        ("q1 [mm],q2 [mm],z [mm]\n-330,-330,0.6\n", "m.csv, line 1: 2 actuator columns, q1 to q2"),
        ("q1 [mm],q3 [mm],z [mm]\n-330,-330,0.6\n", "m.csv, line 1: missing column 'q2'"),
        ("q1 [mm],q2 [mm],q3 [mm]\n-330,-330,-330\n", "nothing was read but the actuators"),
        ("q1 [mm],q2 [mm],q3 [mm],z\n-330,-330,-330,0.6\n", "line 1: column 'z' has no unit"),
        ("q1 [mm],q2 [mm],q3 [deg],z [mm]\n-330,-330,-330,0.6\n", "column 'q3' is an angle"),
        (HEADER + "-330,-330,low,0.6\n", "m.csv, line 2, column 'q3': expected a number"),
        (HEADER + ROWS + "-330,-330,nan,0.6\n", "line 4, column 'q3': expected a finite number"),
        (HEADER + ROWS + "-330,-330,-330\n", "m.csv, line 4: 3 cells under 4 column names"),
        (HEADER, "m.csv: no rows"),
        ("", "m.csv: the file is empty"),
    ],
)
def test_mistake_in_measurements_is_named_with_file_row_and_column(
    refused: Any, csv: str, said: str
) -> None:
    Path("m.csv").write_text(csv)
    assert said in refused("calibrate", ROBOT, "m.csv", "--out", "new")
    assert not Path("new").exists()


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("radius = 170.0", "radius = nan", "finite"),
        ("radius = 170.0", 'radius = "wide"', "radius"),
        ("rod = 340.0 ", "rood = 340.0 ", "'rood'"),
        ('length = "mm"', 'length = "ft"', "ft"),
        ('map = "translation"', 'map = "translatoin"', "did you mean 'translation'"),
        ('"offset1"', '"ofset1"', "did you mean 'offset1'"),
        ("slider = [0, 0, 1]", "slider = [0, 1]", "slider"),
    ],
)
def test_mistake_in_a_robot_file_is_named_with_the_file(
    refused: Any, old: str, new: str, said: str
) -> None:
    text = Path(ROBOT).read_text(encoding="utf-8")
    assert old in text
    Path("robot.toml").write_text(text.replace(old, new, 1), encoding="utf-8")
    message = refused("calibrate", "robot.toml", PROBE)
    assert message.startswith("robot.toml")
    assert said in message


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ([], "Missing argument 'ROBOT'"),
        (["linear-delt", PROBE], "unknown machine 'linear-delt'; did you mean 'linear-delta'?"),
        (["none.toml", PROBE], "none.toml"),
        ([ROBOT, "none.csv"], "none.csv: no such file"),
        (["hexapod", PROBE], "3 actuator columns, q1 to q3; the robot has 6"),
        ([ROBOT, PROBE, "--free", "radus"], "--free: no number of the geometry matches 'radus'"),
        ([ROBOT, PROBE, "--free", "base1.x"], "--free: base1.x is driven by the parameters radius"),
        ([ROBOT, PROBE, "--free", ""], "--free: no number of the geometry matches ''"),
        ([ROBOT, PROBE, "--prior", "radus=1"], "prior: no free parameter matches 'radus'"),
        ([ROBOT, PROBE, "--prior", "radius"], "--prior radius: expected NAME=NUMBER"),
        ([ROBOT, PROBE, "--prior", "radius=1.2.3"], "--prior radius=1.2.3"),
        ([ROBOT, PROBE, "--prior", "radius=-1"], "prior of radius must be positive"),
        ([ROBOT, PROBE, "--prior", "radius=1deg"], "expected one of mm, "),
        ([ROBOT, PROBE, "--prior", "angle1=1"], "angle1 is an angle; give it a unit"),
        ([ROBOT, PROBE, "--prior", "*=1"], "covers lengths ("),
        ([ROBOT, PROBE, "--prior", "1", "--prior", "radius=2"], "--prior 1: a number without"),
        ([ROBOT, PROBE, "--free", "gain*", "--prior", "gain*=1mm"], "unit 'mm'; expected none"),
        ([ROBOT, PROBE, "--holdout", "1.5"], "holdout must be a fraction between 0 and 1"),
        ([ROBOT, PROBE, "--holdout", "none.csv"], "none.csv: no such file"),
        ([ROBOT, PROBE, "--loss", "hubr"], "loss must be one of linear, huber, cauchy"),
        ([ROBOT, PROBE, "--frame", "unkown"], "frame must be one of known, unknown"),
        ([ROBOT, PROBE, "--target", "unkown"], "target must be one of known, unknown"),
        ([ROBOT, PROBE, "--los", "huber"], "No such option"),
        ([ROBOT, PROBE, "--out", PROBE], "this is not a folder"),
        ([ROBOT, PROBE, "--out", str(DELTA)], "would be replaced, and is an input"),
        (["rbt-6t03p-printed", "six.csv"], "free: RBT-6T03P"),
    ],
)
def test_wrong_argument_is_named(
    refused: Any, arguments: list[str], said: str, tmp_path: Path
) -> None:
    if "six.csv" in arguments:
        robot = pk.load("rbt-6t03p-printed")
        Measurements([robot.inverse(robot.home)], [robot.home[2]], "height").write("six.csv")
    before = files_below(tmp_path)
    assert said in refused("calibrate", *arguments)
    assert files_below(tmp_path) == before


def test_unknown_verb_is_named(refused: Any) -> None:
    assert "calibrat" in refused("calibrat")


def test_wrong_seed_is_named(refused: Any) -> None:
    assert "--seed" in refused("demo", "--seed", "one")
    assert "--seed" in refused("demo", "--seed", "-1")


def test_mistake_of_the_program_is_not_taken_for_wrong_input(
    run: Any,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def broken(*arguments: Any, **options: Any) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr(read_files, "read_measurements", broken)
    result = run("calibrate", ROBOT, PROBE)
    assert result.exit_code == 3 and "ZeroDivisionError" in result.stderr


def test_ctrl_c_ends_the_command_without_a_traceback(
    run: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stopped(*arguments: Any, **options: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(read_files, "read_measurements", stopped)
    result = run("calibrate", ROBOT, PROBE)
    assert result.exit_code == 130
    assert "Traceback" not in result.output


def test_full_disk_leaves_nothing_half_written(
    refused: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def full(source: str, destination: str) -> None:
        raise OSError(28, "No space left on device", destination)

    (tmp_path / "robot.toml").write_text("what was there")
    monkeypatch.setattr(whole_file.os, "replace", full)
    message = refused("calibrate", ROBOT, PROBE, "--out", ".", "--force")
    assert "No space left on device" in message
    assert (tmp_path / "robot.toml").read_text() == "what was there"
    assert files_below(tmp_path) == {"robot.toml"}


# --- demo ----------------------------------------------------------------------------------------


def test_demo_tells_its_story_and_lists_what_it_wrote(run: Any, tmp_path: Path) -> None:
    result = run("demo", "--out", "tour", "--seed", "3")
    assert (result.exit_code, result.stderr) == (0, "")
    story, _, files = result.stdout.rpartition("\n\n")
    assert story == str(demonstrate(3))
    assert {line.split()[0] for line in files.splitlines()[1:]} == {
        f"tour/{path.name}" for path in (tmp_path / "tour").iterdir()
    }


def test_demo_as_json(run: Any) -> None:
    found = json.loads(run("demo", "--json").stdout)
    assert found["seed"] == 1
    assert len(found["after"]) == 100
    assert found["identification"]["rank"] == 26  # as many as whole poses tell


def test_check_says_at_which_rows_the_machine_has_no_pose(run: Any, tmp_path: Path) -> None:
    log = tmp_path / "log.csv"
    log.write_text("q1 [mm],q2 [mm],q3 [mm],z [mm]\n-330,-330,-330,0\n9000,-330,-330,0\n")
    result = run("check", ROBOT, log)
    assert result.exit_code == 1
    assert "no pose at the actuators of 1 of them (rows 1)" in result.stdout


# --- completion ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("line", "names"),
    [
        ("check lin", ["linear-delta", "linear-delta-6"]),
        ("new 6", ["6-rus"]),
        ("forward 3r", ["3rps", "3rrr-planar", "3r"]),
        ("inverse 3r", ["3rps", "3rrr-planar"]),  # which takes no arm
        ("check my-", []),  # then the shell goes on with files
    ],
)
def test_shells_complete_the_names_of_machines(line: str, names: list[str]) -> None:
    typed = {"COMP_WORDS": f"pkmcal {line}", "COMP_CWORD": "2"}
    result = CliRunner().invoke(
        verbs.app, [], prog_name="pkmcal", env={"_PKMCAL_COMPLETE": "complete_bash", **typed}
    )
    assert result.stdout.split() == names
