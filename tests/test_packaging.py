"""What is installed: a wheel that carries everything, an import that loads little."""

from __future__ import annotations

import os
import re
import runpy
import shutil
import subprocess
import sys
import zipfile
from importlib import metadata
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
NOT_SOURCES = shutil.ignore_patterns(
    *(".git", ".venv*", ".*_cache", ".benchmarks", ".hypothesis", "__pycache__"),
    *("build", "dist", "*.egg-info", "*.so"),
)


def run(*arguments: str | Path, cwd: Path, **environment: str) -> str:
    """Return what this Python prints when it runs `arguments` in `cwd`."""
    done = subprocess.run(
        [sys.executable, *arguments],
        cwd=cwd,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_a_compiler_is_not_given_flags_that_it_does_not_know(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    build = runpy.run_path(str(ROOT / "csrc" / "build.py"))
    required, faster = build["FLAGS"], build["FASTER"]
    strange = tmp_path / "cc"
    strange.write_text(f'#!/bin/sh\ncase "$*" in *{faster[0]}*) exit 1;; esac\n')
    strange.chmod(0o755)
    monkeypatch.setenv("CC", f"{strange} -m64")
    monkeypatch.delenv("CFLAGS", raising=False)
    assert build["flags"]() == [*required, *faster[1:], "-g0"]
    monkeypatch.setenv("CC", str(tmp_path / "nothing here"))
    assert build["flags"]() == [*required, "-g0"]


def test_line_numbers_stay_where_the_flags_of_the_environment_ask_for_them(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    build = runpy.run_path(str(ROOT / "csrc" / "build.py"))
    monkeypatch.setenv("CFLAGS", "-O1 -g -fsanitize=address")
    assert "-g0" not in build["flags"]()


def lacking(*, python: str | Path = sys.executable, **environment: str) -> str:
    """Return the complaint of the prerequisites check, which must be one line."""
    done = subprocess.run(
        ["sh", ROOT / ".ci" / "prerequisites", python],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1
    return done.stderr


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the wheel from the source archive of a copy of the checkout, and unpack it."""
    folder = tmp_path_factory.mktemp("packaging")
    checkout = shutil.copytree(ROOT, folder / "checkout", ignore=NOT_SOURCES)
    build = "import setuptools.build_meta as backend; backend.build_sdist('..')"
    run("-c", build, cwd=checkout)
    (archive,) = folder.glob("*.tar.gz")
    options = ("--quiet", "--no-deps", "--no-index", "--no-build-isolation")
    run("-m", "pip", "wheel", *options, archive, cwd=folder)
    (built,) = folder.glob("*.whl")
    assert "-cp310-abi3-" in built.name
    zipfile.ZipFile(built).extractall(folder / "site")
    return folder / "site"


def test_every_room_is_packed() -> None:
    said = (ROOT / "pyproject.toml").read_text(encoding="utf-8").partition("packages = [")[2]
    packed = set(re.findall(r'"(pkmcal[.a-z_]*)"', said.partition("]")[0]))
    rooms = {path.parent.relative_to(ROOT) for path in ROOT.glob("pkmcal/**/__init__.py")}
    beside = {"pkmcal.derive", "pkmcal.generated", "pkmcal.examples"}
    assert packed == {".".join(room.parts) for room in rooms} | beside


@pytest.mark.slow
@pytest.mark.parametrize(
    ("source", "pattern", "installed"),
    [
        ("pkmcal", "**/*.py", "pkmcal"),
        ("pkmcal", "builtin/machines/*.toml", "pkmcal"),
        ("pkmcal", "builtin/arms/*.toml", "pkmcal"),
        ("pkmcal", "py.typed", "pkmcal"),
        ("derive", "**/*.py", "pkmcal/derive"),
        ("generated", "*.h", "pkmcal/generated"),
        ("examples", "**/*.toml", "pkmcal/examples"),
        ("examples", "**/*.csv", "pkmcal/examples"),
    ],
)
def test_wheel_carries_the_folder(wheel: Path, source: str, pattern: str, installed: str) -> None:
    expected = {path.relative_to(ROOT / source) for path in (ROOT / source).glob(pattern)}
    found = {path.relative_to(wheel / installed) for path in (wheel / installed).glob(pattern)}
    assert expected
    assert expected <= found


@pytest.mark.slow
def test_wheel_works_away_from_the_checkout(wheel: Path, tmp_path: Path) -> None:
    code = (
        "import pkmcal, pkmcal._core\n"
        "assert [pkmcal.load(name) for name in pkmcal.machines()]\n"
        "print(pkmcal.__file__, pkmcal._core.__file__)"
    )
    for file in run("-c", code, cwd=tmp_path, PYTHONPATH=str(wheel)).split():
        assert Path(file).parent == wheel / "pkmcal"


def test_a_machine_loads_numpy_and_the_core_alone(tmp_path: Path) -> None:
    heavy = {"matplotlib", "rich", "scipy", "sympy", "typer"}
    code = "import sys, pkmcal; pkmcal.load('hexapod'); print(*sys.modules)"
    loaded = run("-c", code, cwd=tmp_path).split()
    assert "pkmcal._core" in loaded
    assert not heavy & set(loaded)


def test_a_calibration_without_a_report_loads_nothing_of_a_report(tmp_path: Path) -> None:
    files = [str(ROOT / "examples" / "linear-delta" / name) for name in ("robot.toml", "probe.csv")]
    code = f"""
import sys
from pkmcal.cli.main import main
sys.argv[1:] = ["calibrate", "--free", "offset*", *{files}]
try:
    main()
except SystemExit:
    print(*sys.modules)
"""
    loaded = set(run("-c", code, cwd=tmp_path).split())
    assert "pkmcal.calibration.identification" in loaded
    assert not loaded & {"pkmcal.view", "pkmcal.report.report", "pkmcal.report.certificate"}
    assert not loaded & {"jinja2", "matplotlib"}
    typed = "import sys, typer\ntyper.run(lambda: print(*sys.modules))"  # older ones load it always
    needed = set(run("-c", typed, cwd=tmp_path).split())
    assert "rich" not in loaded - needed  # of bars on a terminal


def test_a_type_checker_finds_the_package_where_it_is_installed(tmp_path: Path) -> None:
    """It looks at folders and runs no code, such as the finder of an editable install."""
    pytest.importorskip("mypy")
    (tmp_path / "script.py").write_text("import pkmcal\nimport no_such_package\n")
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "--follow-imports=skip", "--no-incremental", "script.py"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    found = re.findall(r"script\.py:(\d): error", done.stdout)
    assert found == ["2"], f"make installs a file that says where it is: {done.stdout}"


@pytest.mark.slow
def test_the_robot_that_was_found_is_of_the_type_that_was_given(tmp_path: Path) -> None:
    """In a script of a user, who need not ask which it is; what is no Robot is refused."""
    pytest.importorskip("mypy")
    lines = [
        "import pkmcal as pk",
        "def found(robot: pk.Robot, arm: pk.SerialArm, read: pk.Measurements) -> None:",
        "    machine: pk.Robot = pk.identify(robot, read).robot",
        "    same: pk.Robot = pk.identify(robot, read, unknown='frame').robot_of('thursday')",
        "    other: pk.SerialArm = pk.identify(arm, read).robot",
        "    wrong: pk.Robot = pk.identify(arm, read).robot",
        "def shown(found: pk.Identification) -> None:",
        "    unasked: pk.Robot = found.robot",
    ]
    (tmp_path / "script.py").write_text("\n".join(lines) + "\n")
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "--ignore-missing-imports", "script.py"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    assert re.findall(r"^script\.py:(\d+): error", done.stdout, re.MULTILINE) == ["6", "8"], done


def test_version_is_stated_once() -> None:
    files = [ROOT / "pyproject.toml", ROOT / "setup.py"]
    for folder in ("pkmcal", "derive", "csrc", "generated"):
        files += [path for path in (ROOT / folder).rglob("*") if path.suffix in {".py", ".h", ".c"}]
    quoted = f'"{metadata.version("pkmcal")}"'
    stated = [path.name for path in files if quoted in path.read_text(encoding="utf-8")]
    assert stated == ["pyproject.toml"]


def test_missing_compiler_is_named_with_its_debian_package() -> None:
    complaint = lacking(CC="no-such-compiler")
    assert re.search(
        r"C compiler as 'no-such-compiler'.*apt-get install gcc libc6-dev\)", complaint
    )


def test_missing_python_is_named_with_its_debian_package() -> None:
    complaint = lacking(python="no-such-python")
    assert re.search(r"3\.10.*'no-such-python'.*apt-get install python3 ", complaint)


@pytest.mark.parametrize(
    ("lost", "package"), [("ensurepip", "python3-venv"), ("Python.h", "python3-dev")]
)
def test_missing_part_of_python_is_named_with_its_debian_package(
    tmp_path: Path, lost: str, package: str
) -> None:
    python = tmp_path / "python3"
    without = f'case "$2" in *{lost}*) exit 1;; esac'
    python.write_text(f'#!/bin/sh\n{without}\nexec {sys.executable} "$@"\n')
    python.chmod(0o755)
    assert f"apt-get install {package})" in lacking(python=python)
