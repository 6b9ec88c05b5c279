"""A hint at another reading of a file ends with options that, typed as they stand, read it so."""

from __future__ import annotations

import csv
import re
import shlex
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import pkmcal as pk

Run = Callable[..., Any]
HEADINGS = {"hexapod": "Strut {}", "linear-delta": "Achse_{}", "rotary-delta": "Motor {}"}


def written(path: Path, headings: Sequence[str], rows: Any) -> Path:
    with path.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file).writerows([headings, *np.asarray(rows).tolist()])
    return path


def measured(name: str, kind: Literal["position", "pose"]) -> tuple[pk.Robot, Any, Any]:
    """A machine with errors in its offsets, actuators and readings of 30 of its poses."""
    robot = pk.load(name)
    rng = np.random.default_rng(5)
    sizes = [0.2 if unit == "mm" else 0.002 for unit in robot.actuator_units]
    true = robot.replace({f"offset{i + 1}": rng.normal(0, s) for i, s in enumerate(sizes)})
    q = robot.inverse(pk.sample_poses(robot, 30, seed=4, share=0.6), match=True)
    values = pk.VirtualMachine(true, noise=0.01, seed=1).measure(q, kind).values
    return robot, q.copy(), values.copy()


def units_of(robot: pk.Robot) -> list[str]:
    return list(robot.actuator_units)


def options_after_hint(said: str) -> list[str]:
    """The options that follow "if …:"."""
    line = " ".join(said.split())
    typed = re.search(r" if [^:]*: ((?:--[a-z]+ (?:'[^']*'|[^ ;]+) ?)+)", line)
    assert typed is not None, line
    return shlex.split(typed[1])


def cured(run: Run, command: list[Any], *more: str) -> list[str]:
    first = run(*command, *more)
    assert first.exit_code != 0
    options = options_after_hint(first.output)
    kept = [each for each in more if each not in ("--join", "row")]
    again = run(*command, *kept, *options)
    assert again.exit_code == 0 and again.stdout.startswith("Calibrated"), again.output
    return options


@pytest.mark.parametrize("name", HEADINGS)
@pytest.mark.parametrize("mistake", ["exchanged", "x and y", "unit", "one unit"])
def test_columns_are_read_as_the_hint_types_them(
    run: Run, tmp_path: Path, name: str, mistake: str
) -> None:
    robot, q, points = measured(name, "position")
    units = units_of(robot)
    actuators = [HEADINGS[name].format(i + 1) for i in range(q.shape[1])]
    headings = [f"{each} [{unit}]" for each, unit in zip(actuators, units, strict=True)]
    expected = {"--rename"}
    if mistake == "exchanged":
        q[:, [0, 2]] = q[:, [2, 0]]
    elif mistake == "x and y":
        points[:, [0, 1]] = points[:, [1, 0]]
    elif mistake == "unit":
        points /= 25.4
    else:
        q[:, 1] = np.degrees(q[:, 1]) if units[1] == "rad" else q[:, 1] / 10.0
    rows = np.hstack([q, points])
    file = written(tmp_path / "rows.csv", [*headings, "x [mm]", "y [mm]", "z [mm]"], rows)
    options = cured(run, ["calibrate", name, file, "--free", "offset*"])
    assert set(options[::2]) == expected
    if mistake == "exchanged":
        assert options[1::2] == [f"{actuators[0]}=q3", f"{actuators[2]}=q1"]


def test_a_late_log_with_exchanged_columns_is_typed_at_once(run: Run, tmp_path: Path) -> None:
    _, q, points = measured("hexapod", "position")
    q[:, [1, 2]] = q[:, [2, 1]]
    late = np.vstack([q[:1], q[:-1]])  # each row is that of the pose before
    log = written(tmp_path / "log.csv", [f"Strut {i + 1} [mm]" for i in range(6)], late)
    tracker = written(tmp_path / "tracker.csv", ["x [mm]", "y [mm]", "z [mm]"], points)
    command = ["calibrate", "hexapod", tracker, "--controller", log, "--free", "offset*"]
    assert cured(run, command, "--join", "row") == [
        "--rename", "Strut 2=q3", "--rename", "Strut 3=q2", "--join", "row+1",
    ]  # fmt: skip


@pytest.mark.parametrize("order", ["ZYZ", "YXZ"])
def test_an_order_of_angles_is_typed(run: Run, tmp_path: Path, order: str) -> None:
    _, q, poses = measured("hexapod", "pose")
    turned = Rotation.from_euler("xyz", poses[:, 3:]).as_euler(order)
    rows = np.hstack([q, poses[:, :3], turned])
    headings = [f"q{i + 1} [mm]" for i in range(6)] + ["x [mm]", "y [mm]", "z [mm]"]
    headings += ["alpha [rad]", "beta [rad]", "gamma [rad]"]
    file = written(tmp_path / "rows.csv", headings, rows)
    options = cured(run, ["calibrate", "hexapod", file, "--free", "offset*"])
    assert options[-2:] == ["--rotation", order]


def test_nothing_is_typed_for_arrays_and_for_several_files() -> None:
    robot, q, points = measured("linear-delta", "position")
    wrong = pk.Measurements(q[:, [1, 0, 2]], points)
    with pytest.warns(pk.CalibrationWarning) as heard:
        pk.identify(robot, wrong, "offset*")
    said = " ".join(str(each.message) for each in heard)
    assert "q1 and q2 are exchanged" in said and "--rename" not in said
