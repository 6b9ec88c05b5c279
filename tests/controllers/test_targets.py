"""Laws of targets: those of the package, registered ones, and those of installed packages."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

import pkmcal as pk
from pkmcal.app import commands
from pkmcal.arms.joint_laws import sag_term
from pkmcal.cli import verbs
from pkmcal.controllers import targets as registry
from pkmcal.controllers.target import OPTIONS
from pkmcal.export import Target
from pkmcal.jobs.output import seal

TARGETS = pk.export.targets()
every_target = pytest.mark.parametrize("target", TARGETS.values(), ids=TARGETS)
ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(autouse=True)
def _nothing_stays_registered(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr(registry, "_REGISTERED", {})
    registry._installed.cache_clear()
    yield
    registry._installed.cache_clear()


def held(name: str) -> Any:
    """A machine that a target holds; None where a test of its own has one."""
    if name in ("hangprinter", "maslow", "ur"):
        return None
    if name in ("klipper", "reprap", "marlin"):  # 0 at the end stops
        return pk.import_printer(ROOT / "examples" / "linear-delta" / "printer.cfg").robot
    return pk.load("3r" if TARGETS[name].takes == "arm" else "hexapod")


def run(*arguments: object) -> Any:
    return CliRunner().invoke(verbs.app, [str(each) for each in arguments], prog_name="pkmcal")


@every_target
def test_a_target_has_its_function_and_options_that_the_command_line_knows(target: Target) -> None:
    assert callable(target.writer)
    assert set(target.options) <= set(OPTIONS)
    assert target.about and not target.about.endswith(".")
    assert target.writer.__doc__


def test_no_two_targets_have_one_file_in_the_window() -> None:
    files = [target.file for target in TARGETS.values()]
    assert len(set(files)) == len(files)


@every_target
def test_the_help_says_what_a_target_writes(target: Target) -> None:
    said = " ".join(run("export", "--help").output.replace("│", " ").split())
    assert f"{target.name}: {target.about}" in said


@every_target
def test_the_other_kind_of_machine_is_refused_and_nothing_is_written(
    target: Target, tmp_path: Path
) -> None:
    wrong = {"arm": "hexapod", "parallel": "3r"}[target.takes]
    done = run("export", wrong, "--as", target.name, "--out", tmp_path / "made")
    assert done.exit_code == 2
    assert "arm" in done.stderr
    assert not list(tmp_path.iterdir())


@every_target
def test_options_that_a_target_has_not_are_refused(target: Target, tmp_path: Path) -> None:
    given = {"number": ["float"], "config": ["mine.cfg"], "project": []}
    for name, value in given.items():
        if name not in target.options:
            done = run(
                "export",
                "hexapod",
                "--as",
                target.name,
                "--out",
                tmp_path / "x",
                f"--{name}",
                *value,
            )
            assert done.exit_code == 2
            assert f"--{name} says nothing of --as {target.name}" in done.stderr


@every_target
def test_the_command_line_writes_what_the_function_writes(target: Target, tmp_path: Path) -> None:
    machine = held(target.name)
    if machine is None:
        pytest.skip("machines of its own: its test file")
    machine.save(tmp_path / "robot.toml")
    if target.name == "marlin":
        with (tmp_path / "robot.toml").open("a") as file:
            file.write("[probe]\noffset = { z = 0.5 }\n")
    for folder in ("by_hand", "by_verb"):
        (tmp_path / folder).mkdir()
    target.writer(pk.load(tmp_path / "robot.toml"), tmp_path / "by_hand" / target.file)
    out = tmp_path / "by_verb" / target.file
    done = run("export", tmp_path / "robot.toml", "--as", target.name, "--out", out)
    assert done.exit_code == 0, done.output
    names = [p.relative_to(tmp_path / "by_hand") for p in (tmp_path / "by_hand").rglob("*")]
    files = [name for name in names if (tmp_path / "by_hand" / name).is_file()]
    assert files
    for name in files:
        one, two = (tmp_path / folder / name for folder in ("by_hand", "by_verb"))
        assert seal(one) == two.read_bytes()


# --- a user's own ---------------------------------------------------------------------------------


def _names(robot: Any, path: Path, project: bool = False) -> None:
    path.write_text(" ".join(robot.geometry.names) + " projected" * project)


def test_a_registered_target_is_known_to_verb_and_window(tmp_path: Path) -> None:
    own = Target("names", _names, "the names of its numbers", label="Names", file="names.txt")
    pk.export.register(own)
    done = run("export", "hexapod", "--as", "names", "--out", tmp_path / "a.txt", "--project")
    assert done.exit_code == 0, done.output
    assert (tmp_path / "a.txt").read_text().endswith("gain6 projected")
    assert own in commands.offered(pk.load("hexapod"))
    assert own not in commands.offered(pk.SerialArm.from_dh(a=[300, 200], alpha=0, d=0))
    assert commands.export("names").out == "names.txt"
    assert run("export", "hexapod", "--as", "nams", "--out", tmp_path / "b").exit_code == 2


def test_a_target_that_takes_arms_gets_them_without_laws(tmp_path: Path) -> None:
    given: list[Any] = []
    pk.export.register(Target("seen", lambda arm, path: given.append(arm), "seen", takes="any"))
    arm = pk.load("3r").with_terms([sag_term(1, 1, 2)])
    assert arm.laws is not None
    with pytest.raises(pk.Error, match="the target seen wrote no x"):
        pk.export.targets()["seen"].export(arm, tmp_path / "x")
    assert given[0].laws is None


def test_a_name_of_pkmcal_cannot_be_taken() -> None:
    with pytest.raises(pk.Error, match="pkmcal has a target klipper"):
        pk.export.register(Target("klipper", _names, "mine"))


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"name": "two words"}, "name must be one word"),
        ({"write": 3}, "write must be a function"),
        ({"takes": "arms"}, "takes"),
        ({"about": None}, "about of the target own must be a str"),
        ({"file": 3}, "file of the target own must be a str"),
    ],
)
def test_a_wrong_target_is_refused(wrong: dict[str, Any], message: str) -> None:
    with pytest.raises(pk.Error, match=message):
        Target(**({"name": "own", "write": _names, "about": "names"} | wrong))


def _half(robot: Any, path: Path) -> None:
    path.write_text("half of it")
    raise KeyError("the other half")


def _nothing(robot: Any, path: Path) -> None:
    """Write nothing."""


@pytest.mark.parametrize(
    ("write", "message"), [(_half, "KeyError: 'the other half'"), (_nothing, "wrote no old.txt")]
)
def test_a_target_that_does_not_write_the_whole_leaves_what_was_there(
    write: Any, message: str, tmp_path: Path
) -> None:
    old = tmp_path / "old.txt"
    old.write_text("a machine that works")
    with pytest.raises(pk.Error, match=f"^the target own .*{message}"):
        Target("own", write, "mine").export(pk.load("hexapod"), old)
    assert old.read_text() == "a machine that works" and list(tmp_path.iterdir()) == [old]


def test_a_target_writes_a_file_or_a_folder_as_it_states(tmp_path: Path) -> None:
    robot, old = pk.load("hexapod"), tmp_path / "old.txt"
    with pytest.raises(pk.Error, match="wrote a file new, and states folder=True"):
        Target("own", _names, "mine", folder=True).export(robot, tmp_path / "new")
    with pytest.raises(pk.Error, match="wrote a folder new, and states folder=False"):
        Target("own", lambda robot, path: path.mkdir(), "mine").export(robot, tmp_path / "new")
    old.write_text("a machine that works")
    both = Target("own", lambda robot, path: path.mkdir(), "mine", folder=True)
    with pytest.raises(pk.Error, match=r"old.txt: the target own writes a folder, this is a file"):
        both.export(robot, old)
    assert list(tmp_path.iterdir()) == [old]
    both.export(robot, tmp_path / "new")
    assert (tmp_path / "new").is_dir()


@pytest.mark.parametrize("path", [None, 3])
def test_a_path_that_is_none_is_named(path: Any) -> None:
    with pytest.raises(TypeError, match="path must be a str or path, found"):
        Target("own", _names, "mine").export(pk.load("hexapod"), path)


def _refusing(robot: Any, path: Path) -> None:
    raise ValueError("no more than five legs")


def _failing(robot: Any, path: Path) -> None:
    path.write_text(robot.legs)


@pytest.mark.parametrize(
    ("write", "message"),
    [
        (_refusing, "the target own: no more than five legs"),
        (_failing, "the target own failed with AttributeError: 'Robot' object has no attribute"),
        ("no_such_module:write", "the target own: its function 'no_such_module:write' cannot be"),
        ("pkmcal:no_such", "the target own: its function 'pkmcal:no_such' cannot be had"),
    ],
)
def test_a_target_that_fails_is_named_and_is_no_mistake_in_pkmcal(
    write: Any, message: str, tmp_path: Path
) -> None:
    pk.export.register(Target("own", write, "mine"))
    done = run("export", "hexapod", "--as", "own", "--out", tmp_path / "a.txt")
    assert done.exit_code == 2 and done.stderr.startswith(f"pkmcal: {message}")
    assert not (tmp_path / "a.txt").exists()


@pytest.mark.parametrize(
    ("takes", "machine", "message"),
    [
        ("parallel", "3r", "is for parallel machines, found a serial arm"),
        ("arm", "hexapod", "is for serial arms, found a parallel machine"),
    ],
)
def test_a_machine_that_a_target_does_not_take_is_refused(
    takes: Any, machine: str, message: str, tmp_path: Path
) -> None:
    own = Target("own", lambda machine, path: path.write_text("x"), "mine", takes=takes)
    with pytest.raises(pk.ArgumentError, match=f"^the target own {message}"):
        own.export(pk.load(machine), tmp_path / "a.txt")
    assert not (tmp_path / "a.txt").exists()
    Target("own", own.write, "mine", takes="any").export(pk.load(machine), tmp_path / "a.txt")
    assert (tmp_path / "a.txt").read_text() == "x"


def installed(folder: Path, value: str) -> None:
    """A package with one target, as an installer leaves it."""
    (folder / "their_names.py").write_text(
        "import pkmcal as pk\n"
        "def write(robot, path):\n    path.write_text(robot.name)\n"
        "TARGET = pk.export.Target('their-names', write, 'its name')\n"
    )
    info = folder / "their_names-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: their-names\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[{registry.GROUP}]\ntheir-names = {value}\n")


def test_a_target_of_an_installed_package_is_known(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    installed(tmp_path, "their_names:TARGET")
    monkeypatch.syspath_prepend(tmp_path)
    done = run("export", "hexapod", "--as", "their-names", "--out", tmp_path / "a")
    sys.modules.pop("their_names", None)
    assert done.exit_code == 0, done.output
    assert (tmp_path / "a").read_text() == "hexapod"


@pytest.mark.parametrize("value", ["their_names:MISSING", "their_names:write", "absent:TARGET"])
def test_a_broken_one_is_left_out_with_a_warning_and_the_others_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, value: str
) -> None:
    installed(tmp_path, value)
    monkeypatch.syspath_prepend(tmp_path)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        assert set(pk.export.targets()) == set(TARGETS)
    sys.modules.pop("their_names", None)
    assert "the target their-names of an installed package is left out" in str(said[0].message)
