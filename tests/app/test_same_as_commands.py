"""What the window shows and writes is what the command prints and writes, whatever is asked."""

from __future__ import annotations

import json
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.jobs.calibration import Calibration
from pkmcal.jobs.configuration import Importing
from pkmcal.jobs.project import Project
from pkmcal.jobs.reading import Reading

pytest.importorskip("starlette", reason="the extra app is not installed")
pytest.importorskip("uvicorn", reason="the extra app is not installed")

from . import browser
from .test_guard import ask, state

EXAMPLES = Path(__file__).parents[2] / "examples"
PRINTER = EXAMPLES / "linear-delta" / "printer.cfg"
MACHINES = [name for name in pk.machines() if name != "rbt-6t03p-printed"]  # its home is singular
HEX = ("hexapod", ("hexapod.csv",))
ASKED = {
    **{name: Calibration(name, (f"{name}.csv",)) for name in MACHINES},
    "rows left out": Calibration(*HEX, drop=("3", "hexapod.csv:9")),
    "held numbers": Calibration(*HEX, fix=("base1.*", "offset2")),
    "other numbers": Calibration(*HEX, free=("default", "gain1"), prior=("gain1=0.001",)),
    "a fifth held out": Calibration(*HEX, holdout="0.2"),
    "a file held out": Calibration(*HEX, holdout="later.csv", drop=("later.csv:4",)),
    "sessions": Calibration("hexapod", ("hexapod.csv", "later.csv"), per_session=("offset1",)),
    "robust": Calibration(*HEX, loss="huber"),
    "a datum": Calibration(*HEX, datum="auto", frame="unknown"),
    "other headings": Calibration(
        "hexapod", ("renamed.csv",), Reading(rename=("L1=q1 [mm]",), ignore=("Quality",))
    ),
    "a late log": Calibration(
        "hexapod", ("points.csv",), Reading(controller="log.csv", join="row+1")
    ),
    "a Maslow": Calibration("maslow.toml", ("belts.csv",)),
    "outliers": Calibration(*HEX, drop_outliers=True, covariance="classical"),
}


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[browser.Served]:
    folder = tmp_path_factory.mktemp("same")
    for name in MACHINES:
        measured(name, 40, seed=1).write(folder / f"{name}.csv")
    maslow = EXAMPLES / "maslow"
    printer = pk.import_printer(maslow / "maslow.yaml", log=maslow / "maslow.log")
    (folder / "maslow.toml").write_text(printer.text)
    assert printer.measurements is not None
    printer.measurements.write(folder / "belts.csv")
    measured("hexapod", 12, seed=5).write(folder / "later.csv")
    text = (folder / "hexapod.csv").read_text().splitlines()
    first = next(i for i, line in enumerate(text) if not line.startswith("#"))
    heads = [text[first].replace("q1 [mm]", "L1") + ",Quality"]
    rows = [f"{line},1" for line in text[first + 1 :]]
    (folder / "renamed.csv").write_text("\n".join(heads + rows))
    points = measured("hexapod", 40, seed=2, kind="position")
    save(folder / "points.csv", [f"{axis} [mm]" for axis in "xyz"], points.values)
    late = np.roll(points.actuators, 1, axis=0)  # its row is the one before
    save(folder / "log.csv", [f"q{i} [mm]" for i in range(1, 7)], late)
    with browser.served(folder) as found:
        yield found


def save(path: Path, heads: list[str], values: Any) -> None:
    np.savetxt(path, values, "%.6f", ",", header=",".join(heads), comments="")


def measured(name: str, count: int, seed: int, kind: str = "pose") -> pk.Measurements:
    robot: Any = pk.load(name)
    if isinstance(robot, pk.SerialArm):
        q = np.random.default_rng(seed).uniform(-1.0, 1.0, (count, robot.n_joints))
        return pk.VirtualMachine(robot, noise=0.02, seed=seed).measure(q, kind="position")
    q = robot.inverse(pk.sample_poses(robot, count, seed=seed, share=0.5))
    return pk.VirtualMachine(robot, noise=0.02, seed=seed).measure(q, kind=kind)


def take(served: browser.Served, project: Project) -> dict[str, Any]:
    body = {"state": project.table(), "version": state(served)["version"]}
    status, _, answer = ask(served, "POST", "/api/state", json.dumps(body).encode())
    assert status == 200, answer
    found: dict[str, Any] = json.loads(answer)
    return found


def done(served: browser.Served, operation: str, given: Any = None) -> dict[str, Any]:
    body = json.dumps(given or {}).encode()
    last = json.loads(ask(served, "POST", f"/api/run/{operation}", body)[2].splitlines()[-1])
    assert "result" in last, last
    found: dict[str, Any] = last["result"]
    return found


@pytest.mark.parametrize("name", ASKED)
def test_the_summary_is_that_of_the_command(
    served: browser.Served, run: Any, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    project = Project(ASKED[name])
    (line,) = take(served, project)["commands"]["result"]
    shown = done(served, "fit")["summary"]
    monkeypatch.chdir(served.folder)
    words = shlex.split(line)[1:]
    assert words[-2:] == ["--report", "report"]
    said = run(*words[:-2]).stdout
    assert said.rstrip("\n").endswith(shown.rstrip("\n")), (said, shown)
    assert len(shown.splitlines()) > 5


@pytest.mark.slow
def test_files_are_those_of_the_commands_to_the_last_byte(tmp_path: Path) -> None:
    window, by_hand = tmp_path / "window", tmp_path / "by hand"
    for folder in (window, by_hand):
        folder.mkdir()
        shutil.copy(PRINTER, folder)
    with browser.served(window) as served:
        importing = Importing("printer.cfg", "machine")
        take(served, Project(Calibration("machine/robot.toml"), importing=importing))
        stored = done(served, "machine")["stored"]
        job = Calibration("machine/robot.toml", tuple(stored), holdout="0.2")
        commands = take(served, Project(job, importing=importing))["commands"]
        lines = [*commands["machine"][:1], *commands["result"]]
        lines += done(served, "out")["commands"]
        done(served, "report")
    by_command(lines, by_hand)
    written = ["machine/robot.toml", "machine/probe.csv", "new.cfg", "report/robot.toml",
               "report/report.json", "report/report.html"]  # fmt: skip
    assert not differing(window, by_hand, written)


@pytest.mark.slow
def test_a_report_does_not_hang_on_the_threads_of_numpy(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where nothing is stated: window and command take one."""
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    window, by_hand = tmp_path / "window", tmp_path / "by hand"
    for folder in (window, by_hand):
        folder.mkdir()
        measured("hexapod", 300, seed=4).write(folder / "many.csv")
    with browser.served(window) as served:
        lines = take(served, Project(Calibration("hexapod", ("many.csv",))))["commands"]["result"]
        done(served, "report")
    by_command(lines, by_hand)
    assert not differing(window, by_hand, ["report/report.json"])


def by_command(lines: list[str], folder: Path) -> None:
    for line in lines:
        argv = [sys.executable, "-m", *shlex.split(line)]
        ended = subprocess.run(argv, cwd=folder, capture_output=True, text=True, check=False)
        assert ended.returncode in (0, 1), ended.stderr


def differing(one: Path, other: Path, names: list[str]) -> list[str]:
    return [name for name in names if (one / name).read_bytes() != (other / name).read_bytes()]
