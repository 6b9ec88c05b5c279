"""The option that a missing column's error ends with, typed as it stands, cures it."""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import pkmcal as pk

Run = Callable[..., Any]


@pytest.mark.parametrize("name", ["hexapod", "linear-delta", "rotary-delta", "3rps"])
@pytest.mark.parametrize("heading", ["Feeler {}", "S{}'s way", "pot_{}"])
def test_the_option_of_a_missing_column_cures_it(
    run: Run, tmp_path: Path, name: str, heading: str
) -> None:
    robot, file = pk.load(name), tmp_path / "rows.csv"
    q = robot.inverse(pk.sample_poses(robot, 4, seed=1), match=True)
    pk.VirtualMachine(robot, seed=1).measure(q, "position").write(file)
    wanted = run("check", name, file, "--json")
    text = file.read_text()
    for number in map(str, range(1, robot.n_actuators)):
        file.write_text(re.sub(rf"\bq{number}\b", heading.format(number), text))
        said = run("check", name, file)
        assert said.exit_code == 2
        option = shlex.split(said.stderr.strip().partition("if one of them is it: ")[2])
        assert option == ["--rename", f"{heading.format(number)}=q{number}"]
        assert run("check", name, file, *option, "--json").stdout == wanted.stdout
