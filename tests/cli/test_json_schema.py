"""What --json prints is what its schema says, for every verb, and for errors."""

from __future__ import annotations

import json
import subprocess
import sys
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest

import pkmcal as pk

jsonschema = pytest.importorskip("jsonschema")

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
DELTA = EXAMPLES / "linear-delta"
PAPER = EXAMPLES / "2tpr2tps-compensation"
SCHEMA = json.loads(files("pkmcal.report").joinpath("schema.json").read_text("utf-8"))
COMMANDS = {
    "calibrate": ("calibrate", DELTA / "robot.toml", DELTA / "probe.csv", "--holdout", "0.2"),
    "check": ("check", DELTA / "robot.toml", DELTA / "probe.csv"),
    "machines": ("machines",),
    "forward": ("forward", "linear-delta", "300,310,1e6"),
    "inverse": ("inverse", "hexapod", "0,0,860,0,0,0"),
    "stiffness": (
        "stiffness",
        "hexapod",
        "0,0,800,0,0,0",
        "--compliance",
        "offset*=5e-5",
        "--cut",
        "9,0,0",
    ),
    "sensitivity": ("sensitivity", "3rps"),
    "tolerance": ("tolerance", "3rps", "--sigma", "base*.z=0.1", "--samples", "100"),
    "allocation": ("tolerance", "3rps", "--allowed", "0.5", "--samples", "200"),
    "plan": ("plan", "2tpr2tps", "--prior", "0.5", "--count", "10"),
    "compensate": ("compensate", "2tpr2tps", PAPER / "desired.csv", PAPER / "measured.csv"),
    "export": ("export", "hexapod", "--as", "c", "--out", "robot.h"),
    "import": ("import", DELTA / "printer.cfg", "--out", "imported"),
    "new": ("new", "hexapod", "mine.toml"),
    "show": ("show", "hexapod"),
}


def check(said: dict[str, Any], name: str) -> None:
    part = {**SCHEMA, "anyOf": [{"$ref": f"#/$defs/{name}"}]}
    jsonschema.Draft202012Validator(part).validate(said)


def test_the_schema_is_one() -> None:
    jsonschema.Draft202012Validator.check_schema(SCHEMA)


@pytest.mark.parametrize("name", COMMANDS)
def test_what_a_verb_prints_is_what_the_schema_says(run: Any, name: str) -> None:
    said = json.loads(run(*COMMANDS[name], "--json").stdout)
    check(said, name)
    described = SCHEMA["$defs"][name].get("properties", {})
    if name not in ("machines", "sensitivity"):
        assert said["schema"] == f"pkmcal/{name}/1" and next(iter(said)) == "schema"
        absent = {key for key in described if key not in said}
        assert not absent, "described and never said"


def test_a_wrong_type_is_not_what_the_schema_says(run: Any) -> None:
    said = json.loads(run(*COMMANDS["inverse"], "--json").stdout)
    for broken in ({**said, "ok": "yes"}, {**said, "units": ["ft"]}, {"schema": said["schema"]}):
        with pytest.raises(jsonschema.ValidationError):
            check(broken, "inverse")


def test_the_report_states_its_schema(run: Any) -> None:
    run(*COMMANDS["calibrate"], "--report", "report")
    check(json.loads(Path("report/report.json").read_text("utf-8")), "report")


ERRORS = [
    (("check", "hexapd"), "input", 2, (None, None, None)),
    (("check", "linear-delta", "m.csv"), "input", 2, ("m.csv", 2, "z")),
    (("check", "absent.toml"), "input", 2, ("absent.toml", None, None)),
    (("chek", "hexapod"), "input", 2, (None, None, None)),
]


@pytest.mark.parametrize(("arguments", "kind", "code", "where"), ERRORS)
def test_an_error_is_json_on_stdout_and_a_line_on_stderr(
    run: Any, arguments: tuple[str, ...], kind: str, code: int, where: tuple[Any, ...]
) -> None:
    Path("m.csv").write_text("q1 [mm],q2 [mm],q3 [mm],z [mm]\n1,2,3,no number\n")
    done = run(*arguments, "--json")
    said = json.loads(done.stdout)
    check(said, "error")
    error = said["error"]
    assert (error["kind"], error["exit_code"], done.exit_code) == (kind, code, code)
    assert (error["file"], error["line"], error["column"]) == where
    assert done.stderr == f"pkmcal: {error['message']}\n"


def test_a_mistake_of_the_program_is_json_too(run: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*arguments: Any) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr(pk, "load", broken)
    said = json.loads(run("check", "hexapod", "--json").stdout)
    check(said, "error")
    assert said["error"]["exit_code"] == 3


def test_the_schema_is_printed() -> None:
    program = "from pkmcal.cli.main import main; main()"
    command = [sys.executable, "-c", program, "--json-schema"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert json.loads(done.stdout) == SCHEMA
