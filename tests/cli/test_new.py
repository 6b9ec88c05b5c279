"""`pkmcal new`: a file that loads as the machine it was made from, with words on every key."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.cli.new import template
from pkmcal.geometry.limb_kinds import KINDS

from ..workspaces import CHAINS


@pytest.mark.parametrize("name", pk.machines())
def test_written_file_loads_as_the_machine(run: Any, name: str, tmp_path: Path) -> None:
    result = run("new", name)
    assert (result.exit_code, result.stderr) == (0, "")
    made, built_in = pk.load(tmp_path / f"{name}.toml"), pk.load(name)
    if isinstance(made, pk.SerialArm):
        for field in ("axes", "points", "home", "joint_errors"):
            np.testing.assert_array_equal(getattr(made, field), getattr(built_in, field))
        return
    assert made.geometry.names == built_in.geometry.names
    assert made.geometry.values.tobytes() == built_in.geometry.values.tobytes()
    assert made.model.free == built_in.model.free and made.model.match == built_in.model.match
    np.testing.assert_array_equal(made.home, built_in.home)
    for one, other in zip(made.model.limbs, built_in.model.limbs, strict=True):
        assert (one.kind, one.actuator, one.branch) == (other.kind, other.actuator, other.branch)
        assert (one.stroke, one.weights) == (other.stroke, other.weights)


@pytest.mark.parametrize("name", sorted({*pk.machines()} - {"3r", *CHAINS}))
def test_every_key_that_a_limb_may_have_is_explained(name: str) -> None:
    head = template(name).partition("#\n# ")[2]
    explained = {
        word
        for names in re.findall(r"^#   ([a-z_, ]+?)  ", template(name), re.MULTILINE)
        for word in names.split(", ")
    }
    assert head
    kinds = [KINDS[limb.kind] for limb in pk.load(name).model.limbs]
    keys = {key for kind in kinds for key in kind.keys()}  # noqa: SIM118
    assert {key for key in keys if not key.endswith("_tilt")} <= explained


@pytest.mark.parametrize("name", [n for n in pk.machines() if n != "3r"])
def test_uncertainties_that_it_offers_are_of_numbers_of_the_machine(name: str) -> None:
    (line,) = (line for line in template(name).splitlines() if "all alike" in line)
    geometry, offered = pk.load(name).geometry, re.findall(r'"([^"]+)" =', line)
    assert len(offered) >= 2
    for pattern in offered:
        assert geometry.match(pattern)


def test_command_in_the_file_names_the_file(run: Any, tmp_path: Path) -> None:
    for name in ("mine.toml", "two words.toml", "line\nbreak.toml"):
        assert run("new", "3r", str(tmp_path / name)).exit_code == 0
        told = (tmp_path / name).read_text("utf-8").splitlines()[1].partition(" measured.csv")[0]
        named = shlex.split(told.removeprefix("#"))
        assert named == ["pkmcal", "calibrate", name if name.isprintable() else "FILE"]
        assert len(pk.load(tmp_path / name).axes) == 3


def test_lines_are_short_enough_to_read() -> None:
    for name in pk.machines():
        lines = template(name).splitlines()
        end = lines.index("#", lines.index("#") + 1)  # of what `new` says; the machine's own follow
        assert max(map(len, lines[:end])) <= 100, name


def test_an_existing_file_is_left_alone(run: Any, tmp_path: Path) -> None:
    (tmp_path / "hexapod.toml").write_text("mine")
    result = run("new", "hexapod")
    assert result.exit_code == 2 and "exists already" in result.stderr
    assert (tmp_path / "hexapod.toml").read_text() == "mine"


def test_a_mistyped_machine_is_refused_with_the_one_that_is_near(run: Any) -> None:
    result = run("new", "hexapd", "mine.toml")
    assert (result.exit_code, Path("mine.toml").exists()) == (2, False)
    assert result.stderr == "pkmcal: unknown machine 'hexapd'; did you mean 'hexapod'?\n"


def test_a_path_is_no_machine(run: Any, tmp_path: Path) -> None:
    assert run("new", str(tmp_path / "x.toml")).exit_code == 2


def test_json_names_the_file(run: Any) -> None:
    said = json.loads(run("new", "3rps", "mine.toml", "--json").stdout)
    assert said == {"schema": "pkmcal/new/1", "machine": "3rps", "file": "mine.toml"}
