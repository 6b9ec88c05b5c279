"""Small servers of controllers, written from their makers' public pages, with a machine behind.

They prove that what is sent and read is as those pages have it, not that a firmware does the same.
"""

from __future__ import annotations

import json
import re
import socketserver
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import parse_qs, urlparse

import numpy as np

_WORD = re.compile(r"([A-Z])([-+]?[\d.]+)")


class Machine:
    """Where a machine is, and how it moves: a part of the way at each look."""

    def __init__(self) -> None:
        self.place = np.array([0.0, 0.0, 100.0])
        self.goal = self.place.copy()
        self.homed, self.stopped, self.mesh = True, False, "none"
        self.lines: list[str] = []
        self.looks = 0  # that a move lasts
        self.dead = self.long = False
        self.stuck = False  # it says ok, and does not move
        self.session: int | None = None
        self.sessions = 0

    def gcode(self, line: str) -> None:
        self.lines.append(line)
        if "M112" in line:
            self.stopped = True
        words = dict(_WORD.findall(line))
        if words.get("G") == "1" or "G1" in line:
            if self.stuck:
                return
            self.looks = 10**6 if self.long else 3
            self.goal = np.array(
                [float(words.get(axis, old)) for axis, old in zip("XYZ", self.goal, strict=True)]
            )

    @property
    def moving(self) -> bool:
        return bool(self.looks) and not self.stopped

    def look(self) -> None:
        if self.moving:
            self.looks -= 1
            self.place = self.goal - (self.goal - self.place) * (0.5 if self.looks else 0.0)


class _Duet(BaseHTTPRequestHandler):
    """RepRapFirmware in standalone mode: github.com/Duet3D/RepRapFirmware/wiki/HTTP-requests."""

    machine: Machine
    password = "reprap"

    def do_GET(self) -> None:
        parts = urlparse(self.path)
        asked = {key: values[0] for key, values in parse_qs(parts.query).items()}
        if parts.path == "/rr_connect":
            good = asked["password"] == self.password
            self.machine.sessions += good
            self.machine.session = 4711 + self.machine.sessions
            said: dict[str, Any] = {"err": 0, "sessionTimeout": 8000, "boardType": "duet3",
                                    "apiLevel": 1, "sessionKey": self.machine.session}  # fmt: skip
            return self._say(said if good else {"err": 1})
        if self.headers.get("X-Session-Key") != str(self.machine.session):
            return self.send_error(401)
        if parts.path == "/rr_reply":
            body = b"Error: G1: target position outside machine limits\n"
            self.send_response(200)
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)
            return None
        if parts.path == "/rr_gcode":
            self.machine.gcode(asked["gcode"])
            return self._say({"buff": 255})
        if parts.path == "/rr_model":
            return self._say({"key": asked["key"], "flags": asked["flags"],
                              "result": self._model(asked["key"])})  # fmt: skip
        if parts.path == "/rr_disconnect":
            return self._say({"err": 0})
        self.send_error(404)

    def _model(self, key: str) -> dict[str, Any]:
        m = self.machine
        if key == "state":
            m.look()
            return {"status": "halted" if m.stopped else "busy" if m.moving else "idle"}
        axes = [{"letter": letter, "homed": m.homed, "machinePosition": round(float(place), 3)}
                for letter, place in zip("XYZ", m.place, strict=True)]  # fmt: skip
        return {"axes": axes, "compensation": {"type": m.mesh}}

    def _say(self, found: dict[str, Any]) -> None:
        body = json.dumps(found).encode()
        self.send_response(200)
        self.send_header("Content-Type", "application/json")
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *_: Any) -> None: ...


@contextmanager
def duet(password: str = "reprap") -> Iterator[tuple[str, Machine]]:
    """Address and machine."""
    machine = Machine()
    handler = type("Duet", (_Duet,), {"machine": machine, "password": password})
    server = ThreadingHTTPServer(("127.0.0.1", 0), handler)
    with _served(server):
        yield f"http://127.0.0.1:{server.server_address[1]}", machine


@contextmanager
def http(answer: Any) -> Iterator[str]:
    """A server that gives each request to a function of handler and path."""

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            answer(self)

        do_POST = do_GET

        def log_message(self, *_: Any) -> None: ...

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    with _served(server):
        yield f"http://127.0.0.1:{server.server_address[1]}"


class _Grbl(socketserver.StreamRequestHandler):
    """FluidNC at telnet: wiki.fluidnc.com, and the Grbl 1.1 interface it keeps."""

    machine: Machine

    def handle(self) -> None:
        m = self.machine
        self._say("Grbl 3.7 [FluidNC v3.7.8 (wifi) '$' for help]")
        line = b""
        while byte := self.rfile.read(1):
            if m.dead:
                return
            if byte == b"?":
                m.look()
                state = (
                    "Alarm"
                    if not m.homed
                    else "Hold:0"
                    if m.stopped
                    else "Run"
                    if m.moving
                    else "Idle"
                )
                place = ",".join(f"{x:.3f}" for x in m.place)
                kind = "WPos" if m.mesh == "work" else "MPos"
                self._say(f"<{state}|{kind}:{place}|FS:0,0>")
            elif byte in (b"!", b"\x18"):
                m.stopped = True
                m.lines.append(repr(byte))
            elif byte == b"\n":
                text, line = line.decode(), b""
                if "X9999" in text:
                    self._say("error:2")
                else:
                    m.gcode(text)
                    self._say("[MSG:INFO: something by the way]")
                    self._say("ok")
            else:
                line += byte

    def _say(self, text: str) -> None:
        self.wfile.write(f"{text}\r\n".encode())


@contextmanager
def grbl() -> Iterator[tuple[str, Machine]]:
    """Host with port, and machine."""
    machine = Machine()
    handler = type("Grbl", (_Grbl,), {"machine": machine})
    server = socketserver.ThreadingTCPServer(("127.0.0.1", 0), handler)
    server.daemon_threads = True
    with _served(server):
        yield f"127.0.0.1:{server.server_address[1]}", machine


@contextmanager
def _served(server: Any) -> Iterator[None]:
    thread = threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True)
    thread.start()
    try:
        yield
    finally:
        server.shutdown()
        server.server_close()
        thread.join()
