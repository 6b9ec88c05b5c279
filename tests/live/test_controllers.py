"""RepRapFirmware, FluidNC, and any server: against small servers of the makers' public pages."""

from __future__ import annotations

import json
import time
from contextlib import suppress
from pathlib import Path
from random import Random
from typing import Any
from urllib.parse import parse_qs, urlparse

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.exceptions import ArgumentError
from pkmcal.live import registry
from pkmcal.live.address import host_and_port, http_address
from pkmcal.live.device import DeviceError
from pkmcal.live.fluidnc import FluidNC
from pkmcal.live.http import Server
from pkmcal.live.lines import Lines
from pkmcal.live.linuxcnc import LinuxCNC
from pkmcal.live.moonraker import Moonraker
from pkmcal.live.reprap import RepRap

from .servers import duet, grbl, http

PRINTER = pk.load(Path(__file__).resolve().parents[2] / "examples" / "linear-delta" / "robot.toml")
POSE = np.array([30.0, -20.5, 7.25, 0.0, 0.0, 0.0])


def test_reprap_drives_in_machine_coordinates_and_waits_until_it_is_there() -> None:
    with duet() as (address, machine):
        driven = RepRap(address, PRINTER)
        driven.require_ready()
        driven.go(POSE, 3000.0)
        assert machine.lines == ["G21 G90 G53 G1 X30.00000 Y-20.50000 Z7.25000 F3000.0"]
        assert not machine.moving
        np.testing.assert_array_equal(driven.where().pose, POSE)
        assert driven.where().actuators is None
        driven.stop()
        assert machine.lines[-1] == "M112"
        with pytest.raises(DeviceError, match="halted"):
            driven.require_ready()
        driven.close()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"homed": False}, "not homed"),
        ({"mesh": "mesh"}, "compensation"),
        ({"stopped": True}, "halted"),
    ],
)
def test_reprap_that_cannot_be_driven_says_why(change: dict[str, Any], said: str) -> None:
    with duet() as (address, machine):
        driven = RepRap(address, PRINTER)
        vars(machine).update(change)
        with pytest.raises(DeviceError, match=said):
            driven.require_ready()
        if machine.stopped:
            with pytest.raises(DeviceError, match="in a move"):
                driven.go(POSE, 3000.0)


def test_a_board_with_a_password_is_left_alone() -> None:
    with duet("secret") as (address, machine), pytest.raises(DeviceError, match="password"):
        RepRap(address, PRINTER)
    assert machine.lines == []


def test_a_board_that_ended_its_session_while_a_person_read_is_asked_in_a_new_one() -> None:
    with duet() as (address, machine):
        driven = RepRap(address, PRINTER)
        machine.session = None  # as after eight seconds without a question
        driven.require_ready()
        machine.session = None
        driven.go(POSE, 3000.0)
        machine.session = None
        driven.stop()
        assert machine.sessions == 4 and machine.lines[-1] == "M112"


@pytest.mark.parametrize(
    ("server", "kind", "said"),
    [(duet, RepRap, "outside machine limits"), (grbl, FluidNC, r"stopped 9\d\.\d+ mm")],
)
def test_a_machine_that_says_ok_and_does_not_move_is_told_soon(
    server: Any, kind: Any, said: str
) -> None:
    with server() as (address, machine):
        driven = kind(address, PRINTER)
        machine.stuck = True
        began = time.monotonic()
        with pytest.raises(DeviceError, match=said):
            driven.go(POSE, 3000.0)
        assert time.monotonic() - began < 30.0  # a move may take ten minutes
        driven.close()


GOOD: dict[str, Any] = {
    "/rr_connect": {"err": 0, "sessionKey": 1},
    "/rr_gcode": {"buff": 255},
    "state": {"status": "idle"},
    "move": {
        "axes": [{"letter": axis, "homed": True, "machinePosition": 0.0} for axis in "XYZ"],
        "compensation": {"type": "none"},
    },
    "/printer/info": {"state": "ready", "state_message": "Printer is ready"},
    "/printer/objects/query": {
        "status": {
            "toolhead": {"homed_axes": "xyz", "position": [0.0, 0.0, 0.0, 0.0]},
            "gcode_move": {"gcode_position": [0.0, 0.0, 0.0, 0.0], "speed_factor": 1.0},
            "print_stats": {"state": "standby"},
            "bed_mesh": {"profile_name": ""},
        }
    },
    "/server/gcode_store": {"gcode_store": [{"time": 1.0, "message": "// stepper: stepper_a:1.0"}]},
}
JUNK = [None, 1, "x", [], {}, [1], {"a": 1}, float("nan"), True, [None] * 3, {"status": None}]


def damaged(answer: Any, random: Random) -> Any:
    """An answer of which something is missing or is something else."""
    if random.random() < 0.2:
        return random.choice(JUNK)
    if isinstance(answer, dict) and answer:
        key = random.choice([*answer])
        without = {name: each for name, each in answer.items() if name != key}
        return without if random.random() < 0.2 else {**without, key: damaged(answer[key], random)}
    if isinstance(answer, list) and answer:
        at = random.randrange(len(answer))
        return [*answer[:at], damaged(answer[at], random), *answer[at + 1 :]]
    return random.choice(JUNK)


@pytest.mark.parametrize("kind", [RepRap, Moonraker])
def test_answers_of_another_form_are_said_and_nothing_is_moved(
    kind: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever is damaged in an answer, the machine is ready and somewhere, or it is said why."""
    monkeypatch.setattr("pkmcal.live.moonraker._TRIED", 1)
    monkeypatch.setattr("pkmcal.live.moonraker._PAUSE", 0.0)
    own = [key for key in GOOD if key.startswith("/rr") or key[0] != "/"]
    keys = own if kind is RepRap else [key for key in GOOD if key not in own]
    random, seen, now, moved = Random(26), set[str](), "", list[str]()

    def answer(handler: Any) -> None:
        parts = urlparse(handler.path)
        asked = parse_qs(parts.query)
        moved.extend(asked.get("gcode", []))
        key = asked["key"][0] if parts.path == "/rr_model" else parts.path
        found = GOOD.get(key, {})
        found = damaged(found, random) if key == now else found
        wrapped = parts.path == "/rr_model" or kind is Moonraker
        said(json.dumps({"result": found} if wrapped else found).encode())(handler)

    with http(answer) as address:
        for turn in range(200):
            now = keys[turn % len(keys)]
            try:
                driven = kind(address, PRINTER)
                driven.require_ready()
                place = driven.where().pose
                assert np.isfinite(place[:3]).all()
                seen.add("ready")
            except DeviceError as error:
                seen.add(str(error)[:12])
    assert len(seen) > 5 and moved == []


@pytest.mark.parametrize("code", [200, 500])
def test_an_answer_that_does_not_end_is_not_waited_for(code: int) -> None:
    def drips(handler: Any) -> None:
        handler.send_response(code)
        handler.send_header("Content-Length", "1000")
        handler.end_headers()
        with suppress(OSError):
            for _ in range(100):
                handler.wfile.write(b" ")
                time.sleep(0.1)

    with http(drips) as address:
        began = time.monotonic()
        with pytest.raises(DeviceError, match="does not answer"):
            Server(address, "it").ask("/x", wait=0.5)
        assert time.monotonic() - began < 5.0


@pytest.mark.parametrize(
    ("status", "message"),
    [
        ({"gcode_move": {"gcode_position": [0, 0, -5.0, 0], "speed_factor": 1.0}}, "an offset"),
        ({"gcode_move": {"gcode_position": [0, 0, 0, 0], "speed_factor": 2.0}}, "2 times as fast"),
        ({"bed_mesh": {"profile_name": "default"}}, "mesh 'default'"),
        ({"toolhead": {"homed_axes": "xy", "position": [0, 0, 0, 0]}}, "not homed"),
        ({"toolhead": {"homed_axes": "xyz", "position": []},
          "gcode_move": {"gcode_position": [], "speed_factor": 1.0}}, "not understood"),
    ],
)  # fmt: skip
def test_a_printer_whose_moves_would_be_bent_or_hurried_is_not_moved(
    status: dict[str, Any], message: str
) -> None:
    """An offset of -5 mm would drive the nozzle into the bed before anybody saw it."""
    scripts: list[str] = []

    def answer(handler: Any) -> None:
        parts = urlparse(handler.path)
        scripts.extend(parse_qs(parts.query).get("script", []))
        found = GOOD[parts.path]
        if parts.path.endswith("query"):
            found = {"status": {**found["status"], **status}}
        said(json.dumps({"result": found}).encode())(handler)

    with http(answer) as address:
        driven = Moonraker(address, PRINTER)
        with pytest.raises(DeviceError, match=message):
            driven.require_ready()
        if "toolhead" not in status:
            with pytest.raises(DeviceError, match=message):
                driven.go(POSE, 3000.0)
    assert scripts == []


def test_a_line_that_never_says_what_was_asked_is_not_waited_for_without_end() -> None:
    with grbl() as (address, _):
        lines = Lines(*host_and_port(address, 23, "x"), "it", wait=0.5)
        lines.send(b"?" * 2000)  # answers enough, and none of them the one
        with pytest.raises(DeviceError, match="does not answer"):
            lines.answer(lambda line: None)
        lines.close()


def test_fluidnc_drives_in_machine_coordinates_and_waits_until_it_is_there() -> None:
    with grbl() as (address, machine):
        driven = FluidNC(address, PRINTER)
        driven.require_ready()
        driven.go(POSE, 1200.0)
        assert machine.lines == ["G21 G90 G53 G1 X30.0000 Y-20.5000 Z7.2500 F1200.0"]
        np.testing.assert_array_equal(driven.where().pose, POSE)
        with pytest.raises(DeviceError, match="error:2"):
            driven.go(np.array([9999.0, 0, 0, 0, 0, 0]), 100.0)
        driven.stop()
        with pytest.raises(DeviceError, match="Hold"):
            driven.require_ready()
        assert machine.lines[-2:] == ["b'!'", r"b'\x18'"]
        driven.close()


@pytest.mark.parametrize(
    ("change", "said"), [({"homed": False}, "Alarm"), ({"mesh": "work"}, "no MPos")]
)
def test_fluidnc_that_cannot_be_driven_says_why(change: dict[str, Any], said: str) -> None:
    with grbl() as (address, machine):
        driven = FluidNC(address, PRINTER)
        vars(machine).update(change)
        with pytest.raises(DeviceError, match=said):
            driven.require_ready()
        driven.close()


def test_what_turns_its_platform_is_not_driven_by_x_y_z() -> None:
    hexapod = pk.load("hexapod")
    for kind in (RepRap, FluidNC):
        with pytest.raises(DeviceError, match="drives x, y and z alone"):
            kind("http://127.0.0.1:9", hexapod)


@pytest.mark.parametrize("kind", [RepRap, FluidNC, LinuxCNC])
def test_nobody_there_is_said_with_the_address(kind: Any) -> None:
    address = "http://127.0.0.1:9" if kind is RepRap else "127.0.0.1:9"
    with pytest.raises(DeviceError, match=r"127\.0\.0\.1:9 does not answer"):
        kind(address, PRINTER)


def redirect(handler: Any) -> None:
    handler.send_response(302)
    handler.send_header("Location", "http://127.0.0.1:9/elsewhere")
    handler.end_headers()


def said(body: bytes, length: int | None = None, code: int = 200) -> Any:
    def answer(handler: Any) -> None:
        handler.send_response(code)
        handler.send_header("Content-Length", str(len(body) if length is None else length))
        handler.end_headers()
        handler.wfile.write(body)

    return answer


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        (redirect, "302"),
        (said(b"[1, 2]"), "no JSON object"),
        (said(b"<html>"), "no JSON object"),
        (said(b'{"a":', 1000), "broke off|no JSON"),
        (said(b"[" * 200_000), "no JSON object"),
        (said(b" " * 1_000_002), "more than"),
        (said(b'{"error": {"message": "Must home axis first"}}', code=400), "400, Must home"),
        (said(b"\xff\x00", code=500), "500"),
    ],
    ids=["elsewhere", "list", "html", "half", "deep", "long", "error", "fault"],
)
def test_answers_that_are_none_are_said(answer: Any, message: str) -> None:
    with http(answer) as address, pytest.raises(DeviceError, match=message):
        Server(address, "it").ask("/x")


@pytest.mark.parametrize(
    "text",
    ["printer", "ftp://a", "http://me:pw@a", "http://a/path", "http://a:0", "http://a:99999",
     "http://a b", "http://a?x=1", "http://a#b", "", "http://", "http://a\n"],
)  # fmt: skip
def test_addresses_are_hosts_and_ports_and_nothing_else(text: str) -> None:
    with pytest.raises(ArgumentError, match="expected an address"):
        http_address(text, "x")


def test_plain_addresses() -> None:
    assert host_and_port("a.local", 23, "x") == ("a.local", 23)
    assert host_and_port("[::1]:24", 23, "x") == ("::1", 24)
    assert http_address("http://a.local:7125/", "x") == "http://a.local:7125"
    for text in ("a:b", "a:0", "a/b", "me@a", ""):
        with pytest.raises(ArgumentError, match="expected HOST"):
            host_and_port(text, 23, "x")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("moonracker:http://a", "did you mean 'moonraker'|it has person"),
        ("moonraker", "expected moonraker:http"),
        ("moonraker:", "expected moonraker:http"),
        ("person:x", "expected person"),
        ("moonraker:file:///etc/passwd", "expected an address"),
    ],
)
def test_words_that_are_no_machine_are_refused(text: str, message: str) -> None:
    with pytest.raises(ArgumentError, match=message):
        registry.machine(text, PRINTER)


def test_every_registered_kind_says_its_address_and_answers_the_protocol() -> None:
    for kinds, methods in (
        (registry.MACHINES, ("require_ready", "go", "where", "stop", "close")),
        (registry.INSTRUMENTS, ("read", "close")),
    ):
        for word, kind in kinds.items():
            assert isinstance(kind.ADDRESS, str) and kind.__doc__, word
            assert all(callable(getattr(kind, name)) for name in methods), word
