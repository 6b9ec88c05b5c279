"""No command replaces a file that it read, or one that is not its own as it was written."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from pkmcal.files.seal import is_sealed

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "examples"
DELTA = EXAMPLES / "linear-delta"
POSES = "x [mm],y [mm],z [mm]\n" + "".join(f"{i},{-i},{850 + i}\n" for i in range(15))
PLAN = ("plan", "hexapod", "--poses", "poses.csv", "--count", "12", "--prior", "0.5")


def own(name: str, text: str | bytes) -> Path:
    """A file of the user's."""
    path = Path(name)
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def reads_what_it_would_write(verb: str) -> tuple[Path, list[str]]:
    if verb == "plan":
        return own("poses.csv", POSES), [*PLAN, "--out", "."]
    if verb == "inverse":
        return own("commands.csv", POSES), ["inverse", "hexapod", "commands.csv", "--out", "."]
    if verb == "forward":
        commands = "q1 [mm],q2 [mm],q3 [mm],q4 [mm]\n450,452,400,405\n"
        return own("poses.csv", commands), ["forward", "2tpr2tps", "poses.csv", "--out", "."]
    if verb == "compensate":
        folder = EXAMPLES / "2tpr2tps-compensation"
        path = own("corrected.csv", (folder / "desired.csv").read_bytes())
        arguments = ["compensate", "2tpr2tps", str(path), str(folder / "measured.csv")]
        return path, [*arguments, "--out", "."]
    if verb == "sensitivity":
        path = own("poses.csv", POSES)
        return path, ["sensitivity", "hexapod", "--poses", "poses.csv", "--out", "."]
    if verb == "tolerance":
        path = own("tolerance.csv", POSES)
        arguments = ["tolerance", "hexapod", "--poses", str(path), "--sigma", "0.1"]
        return path, [*arguments, "--samples", "100", "--out", "."]
    path = own("robot.toml", (DELTA / "robot.toml").read_bytes())
    option = "--out" if verb == "calibrate" else "--report"
    return path, ["calibrate", "robot.toml", str(DELTA / "probe.csv"), option, "."]


VERBS = (
    *("plan", "inverse", "forward", "compensate", "sensitivity", "tolerance", "calibrate"),
    "calibrate --report",
)


@pytest.mark.parametrize("verb", VERBS)
def test_no_verb_replaces_its_input(refused: Any, verb: str) -> None:
    path, arguments = reads_what_it_would_write(verb)
    before = path.read_bytes()
    message = refused(*arguments)
    assert message.startswith(f"{path.name}: would be replaced, and is an input")
    assert message.endswith("name another place with --out, or give --force")
    assert path.read_bytes() == before
    assert [each.name for each in Path().iterdir()] == [path.name]


def test_an_input_by_another_name_is_still_an_input(refused: Any) -> None:
    own("here/poses.csv", POSES)
    os.link("here/poses.csv", "linked.csv")
    message = refused("plan", "hexapod", "--poses", "linked.csv", "--out", "here")
    assert "is an input" in message


def test_an_input_that_was_written_by_a_command_is_still_an_input(run: Any, refused: Any) -> None:
    own("given.csv", POSES)
    assert run("inverse", "hexapod", "given.csv", "--out", ".").exit_code in (0, 1)
    assert run("forward", "hexapod", "commands.csv", "--out", ".").exit_code in (0, 1)
    assert "is an input" in refused("plan", "hexapod", "--poses", "poses.csv", "--out", ".")


def test_force_replaces_an_input(run: Any) -> None:
    path, arguments = reads_what_it_would_write("inverse")
    assert run(*arguments, "--force").exit_code in (0, 1)
    assert is_sealed(path.read_bytes(), ".csv")


def test_columns_added_to_a_plan_are_not_lost_to_the_next_plan(run: Any, refused: Any) -> None:
    own("poses.csv", POSES)
    arguments = (*PLAN, "--out", "plan")
    assert run(*arguments).exit_code == 0
    first = {path.name: path.read_bytes() for path in Path("plan").iterdir()}
    assert run(*arguments).exit_code == 0  # nobody has touched it
    assert {path.name: path.read_bytes() for path in Path("plan").iterdir()} == first
    commands = Path("plan/commands.csv")
    lines = commands.read_text("utf-8").splitlines()
    commands.write_text("\n".join(line if line[0] == "#" else f"{line},1" for line in lines))
    measured = commands.read_bytes()
    assert "did not write it or it was changed since" in refused(*arguments)
    assert commands.read_bytes() == measured
    assert run(*arguments, "--force").exit_code == 0
    assert commands.read_bytes() == first["commands.csv"]


@pytest.mark.parametrize(
    "name", ["measured.csv", "corrected.csv", "error.png", "robot.toml", "report.json"]
)
def test_the_demonstration_leaves_files_of_the_user_alone(refused: Any, name: str) -> None:
    path = own(f"here/{name}", "mine")
    assert "would be replaced" in refused("demo", "--out", "here")
    assert [each.read_text() for each in Path("here").iterdir()] == ["mine"], path


def test_a_link_that_leads_nowhere_is_left_alone(refused: Any) -> None:
    Path("hexapod.toml").symlink_to("nowhere.toml")
    assert "exists already" in refused("new", "hexapod")
    assert Path("hexapod.toml").is_symlink() and not Path("nowhere.toml").exists()
    Path("commands.csv").symlink_to("nowhere.csv")
    assert "would be replaced" in refused("inverse", "hexapod", "0,0,860,0,0,0", "--out", ".")


def test_a_folder_in_the_place_of_a_file_is_refused_before_the_work(refused: Any) -> None:
    Path("report/report.html").mkdir(parents=True)
    robot, probe = DELTA / "robot.toml", DELTA / "probe.csv"
    message = refused("calibrate", robot, probe, "--report", "report")
    assert message == "report/report.html: this is a folder"
    assert [path.name for path in Path("report").iterdir()] == ["report.html"]


def test_everything_written_is_sealed_and_written_again(run: Any) -> None:
    robot, probe = DELTA / "robot.toml", DELTA / "probe.csv"
    arguments = ("calibrate", robot, probe, "--report", "both", "--out", "both")
    assert run(*arguments).exit_code == 0
    files = {path: path.read_bytes() for path in Path("both").iterdir()}
    assert {path.suffix for path in files} == {".toml", ".png", ".html", ".json"}
    assert all(is_sealed(content, path.suffix) for path, content in files.items())
    assert run(*arguments).exit_code == 0
    assert files == {path: path.read_bytes() for path in Path("both").iterdir()}


def test_what_changes_while_a_command_works_is_not_replaced(
    refused: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    from pkmcal.cli import inverse

    def late(*arguments: Any, **named: Any) -> None:
        own("there/commands.csv", "mine")
        write(*arguments, **named)

    write = inverse.write_commands
    monkeypatch.setattr(inverse, "write_commands", late)
    assert "would be replaced" in refused("inverse", "hexapod", "0,0,860,0,0,0", "--out", "there")
    assert Path("there/commands.csv").read_text() == "mine"


# --- provenance ----------------------------------------------------------------------------------


def sha256(path: Path | str) -> str:
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()


def test_inputs_of_one_name_are_told_apart_by_their_folders(run: Any) -> None:
    for folder in ("one", "two"):
        own(f"{folder}/probe.csv", f"# {folder}\n".encode() + (DELTA / "probe.csv").read_bytes())
    robot = DELTA / "robot.toml"
    run("calibrate", robot, "one/probe.csv", "--holdout", "two/probe.csv", "--report", "out")
    inputs = json.loads(Path("out/report.json").read_text("utf-8"))["inputs"]
    expected = {str(robot): sha256(robot)}
    expected |= {name: sha256(name) for name in ("one/probe.csv", "two/probe.csv")}
    assert inputs == expected
    for name, digest in expected.items():
        assert f"#   {name}, sha256 {digest}\n" in Path("out/robot.toml").read_text("utf-8")


def test_the_checksum_is_of_what_was_read_from_a_pipe() -> None:
    own("p.csv", POSES)
    program = f"{sys.executable} -c 'from pkmcal.cli.main import main; main()'"
    for given in ("<(cat p.csv)", "/dev/stdin < <(cat p.csv)"):
        shutil.rmtree("out", ignore_errors=True)
        command = f"{program} inverse hexapod {given} --out out"
        done = subprocess.run(["bash", "-c", command], capture_output=True, text=True)
        assert done.stderr == ""
        assert f"sha256 {sha256('p.csv')}\n" in Path("out/commands.csv").read_text("utf-8")


def test_a_file_that_changes_during_the_work_is_stated_as_it_was_read(
    run: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    from pkmcal.cli import inverse

    own("p.csv", POSES)
    digest = sha256("p.csv")
    read = inverse.read_poses

    def and_change(*arguments: Any) -> Any:
        poses = read(*arguments)
        own("p.csv", POSES + "1,2,850\n")
        return poses

    monkeypatch.setattr(inverse, "read_poses", and_change)
    run("inverse", "hexapod", "p.csv", "--out", "out")
    assert digest in Path("out/commands.csv").read_text("utf-8")


def test_export_replaces_a_file_only_if_told_to(run: Any, refused: Any) -> None:
    header = Path("arm.h")
    header.write_text("mine")
    arguments = ("export", "hexapod", "--as", "c", "--out", header)
    assert refused(*arguments).startswith("arm.h: would be replaced")
    assert header.read_text() == "mine"
    assert run(*arguments, "--force").exit_code == 0
    assert "hexapod" in header.read_text()
    link = Path("link.h")
    link.symlink_to("nowhere.h")
    refused("export", "hexapod", "--as", "c", "--out", link)
    assert link.is_symlink() and not Path("nowhere.h").exists()
