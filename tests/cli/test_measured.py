"""Files of instruments on the command line: two files, several, and options for their columns."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

import pkmcal as pk
from tests.files.instruments import TARGETS, leica_semicolons, log_struts, truth

DELTA = Path(__file__).resolve().parents[2] / "examples" / "linear-delta"


def test_a_trackers_file_and_a_log_are_calibrated_with(run: Any) -> None:
    t = truth(30)
    Path("tracker.txt").write_bytes(leica_semicolons(t))
    Path("log.csv").write_bytes(log_struts(t))
    done = run(
        "calibrate", "hexapod", "tracker.txt", "--controller", "log.csv", "--target", "unknown",
        "--free", "offset*", "--out", "out",
    )  # fmt: skip
    assert "hexapod: 15 parameters from 90 measured points" in done.stdout
    assert "pkmcal: tracker.txt: joined with log.csv by name: the pose in 'Point ID'" in done.stderr
    text = Path("out/robot.toml").read_text()
    assert "tracker.txt, sha256" in text and "log.csv, sha256" in text
    found = pk.load("out/robot.toml").geometry.values
    np.testing.assert_allclose(found, pk.load("hexapod").geometry.values, atol=1e-3)
    assert list(TARGETS) == ["SMR1", "SMR2", "SMR3"]


def test_several_files_are_one_calibration_with_a_word_each(run: Any, refused: Any) -> None:
    robot = pk.load(DELTA / "robot.toml")
    measured = pk.read_measurements(DELTA / "probe.csv", robot)
    measured.select(slice(0, 20)).write("one.csv")
    measured.select(slice(20, None)).write("two.csv")
    arguments = ("calibrate", DELTA / "robot.toml", "one.csv", "two.csv")
    done = run(*arguments, "--frame", "known,known")
    assert "6 parameters from 41 measured points" in done.stdout
    assert "--frame known,unknown,known: 3 words for 2 files" in refused(
        *arguments, "--frame", "known,unknown,known"
    )


def test_columns_are_described_in_a_file(run: Any, refused: Any) -> None:
    lines = (DELTA / "probe.csv").read_text().splitlines()
    rows = [line for line in lines if line[0] in "-0123456789"]
    Path("bare.csv").write_text("\n".join(rows))
    Path("columns.toml").write_text(
        'header = ["q1", "q2", "q3", "z", "Quality"]\nignore = ["Quality"]\nunits = ["mm"]\n'
    )
    done = run("check", DELTA / "robot.toml", "bare.csv", "--columns", "columns.toml")
    assert "bare.csv: 41 rows of kind height, readable" in done.stdout
    Path("columns.toml").write_text('heading = ["q1"]\n')
    assert (
        "columns.toml, line 1: unknown key 'heading' of columns; did you mean 'header'"
        in refused("check", DELTA / "robot.toml", "bare.csv", "--columns", "columns.toml")
    )
    assert "--rename Lg: expected OLD=NEW" in refused(
        "check", DELTA / "robot.toml", "bare.csv", "--rename", "Lg"
    )


def test_options_that_say_nothing_of_what_is_read_are_refused_or_said(
    run: Any, refused: Any
) -> None:
    probe = ("calibrate", DELTA / "robot.toml", DELTA / "probe.csv")
    for given in (
        ("--size-sigma", "0.001"), ("--find-size",), ("--lens", "all"), ("--camera-on", "platform"),
    ):  # fmt: skip
        said = refused(*probe, *given)
        assert (
            said == f"{given[0]}: it is of pixels that a camera saw; state its lens, --camera FILE"
        )
    done = run(*probe, "--units", "deg")
    assert "--units deg has no effect: every column that is read has a unit" in done.stderr
    actuators = ",".join(f"q{i} [mm]" for i in range(1, 7))
    Path("pixels.csv").write_text(f"corner,u,v,{actuators}\n0,1,2" + ",800" * 6 + "\n")
    Path("lens.yaml").write_text(
        "camera_matrix: [[1000, 0, 500], [0, 1000, 400], [0, 0, 1]]\n"
        "distortion_coefficients: [0, 0, 0, 0, 0]\n"
    )
    seen = ("calibrate", "hexapod", "pixels.csv", "--camera", "lens.yaml", "--board")
    said = refused(*seen, "chessboard:5x4,30")
    assert "column 'u' has no unit" in said and said.endswith("or --rename 'u=u [px]'")


def test_a_probes_log_that_contradicts_itself_is_not_trusted(run: Any) -> None:
    """Heights that the robot file gives itself: written, and exit code 1."""
    robot = pk.load(DELTA / "robot.toml")
    rng = np.random.default_rng(0)
    points = rng.uniform(-80, 80, (20, 6)) * [1, 1, 0, 0, 0, 0]
    points[:, 2] = rng.uniform(0, 0.5, 20)
    m = pk.Measurements(robot.inverse(points), points[:, 2], "height", actuator_units="mm")
    m.write("circular.csv")
    done = run("calibrate", DELTA / "robot.toml", "circular.csv")
    assert done.exit_code == 1 and "those that the robot file itself gives" in done.stderr


def test_a_warm_machine_is_referred_to_20_degrees(run: Any, refused: Any) -> None:
    robot = pk.load("hexapod")
    poses = pk.sample_poses(robot, 30, seed=1, share=0.5)
    larger = poses[:, :3] * (1 + 11.5e-5)
    warm = pk.Measurements(robot.inverse(poses), larger, sigma=0.01, temperature=30.0)
    warm.write("warm.csv")
    arguments = ("calibrate", "hexapod", "warm.csv", "--free", "offset*")
    assert "which is not taken into account; --expansion" in " ".join(
        run(*arguments).stdout.split()
    )
    done = run(*arguments, "--expansion", "base=11.5e-6,limbs=11.5e-6", "--expansion",
               "platform=11.5e-6", "--report", ".")  # fmt: skip
    said = " ".join(done.stdout.split())
    assert "numbers are those at 20 °C; the machine was at 30 °C, expansion: base, limbs" in said
    assert "Numbers are those at 20 °C" in Path("report.html").read_text("utf-8")
    assert "--expansion base: expected PART=NUMBER" in refused(*arguments, "--expansion", "base")
    assert "stands alone" in refused(*arguments, "--expansion", "1e-5,base=1e-5")
    assert "of steel 11.5e-6; found 11.5" in refused(*arguments, "--expansion", "11.5")
