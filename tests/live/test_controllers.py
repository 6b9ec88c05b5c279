"""RepRapFirmware, FluidNC, and any server: against small servers of the makers' public pages."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.exceptions import ArgumentError
from pkmcal.live import registry
from pkmcal.live.address import host_and_port, http_address
from pkmcal.live.device import DeviceError
from pkmcal.live.fluidnc import FluidNC
from pkmcal.live.http import Server
from pkmcal.live.linuxcnc import LinuxCNC
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
        (said(b" " * 1_000_002), "more than"),
        (said(b'{"error": {"message": "Must home axis first"}}', code=400), "400, Must home"),
        (said(b"\xff\x00", code=500), "500"),
    ],
    ids=["elsewhere", "list", "html", "half", "long", "error", "fault"],
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
