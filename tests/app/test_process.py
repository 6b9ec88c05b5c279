"""The process that computes may be stopped or die at any time: nothing is lost, nothing stays."""

from __future__ import annotations

import http.client
import json
import time
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("starlette", reason="the extra app is not installed")
pytest.importorskip("uvicorn", reason="the extra app is not installed")

from . import browser
from .test_guard import ask, state


def lines(served: browser.Served, operation: str) -> list[dict[str, Any]]:
    return [
        json.loads(line)
        for line in ask(served, "POST", f"/api/run/{operation}", b"{}")[2].splitlines()
    ]


def health(served: browser.Served) -> dict[str, int]:
    found: dict[str, int] = json.loads(ask(served, "GET", "/api/health")[2])
    return found


def gone(pid: int, seconds: float = 5.0) -> bool:
    end = time.monotonic() + seconds
    while Path(f"/proc/{pid}").exists() and time.monotonic() < end:
        time.sleep(0.02)
    return not Path(f"/proc/{pid}").exists()


def take_hexapod(served: browser.Served) -> None:
    table = {"pkmcal-project": 1, "machine": {"builtin": "hexapod"}}
    body = json.dumps({"state": table, "version": state(served)["version"]}).encode()
    assert ask(served, "POST", "/api/state", body)[0] == 200


def test_a_process_that_dies_is_said_and_replaced(tmp_path: Path) -> None:
    with browser.served(tmp_path / "project") as served:
        take_hexapod(served)
        *_, last = lines(served, "crash")
        assert last["error"]["crashed"] and "signal SIGSEGV" in last["error"]["message"]
        *_, found = lines(served, "machine")
        assert found["result"]["name"] == "hexapod"
        assert health(served)["starts"] == 2
        worker = health(served)["worker"]
    assert gone(worker)
    assert not list(served.folder.glob(".*"))


def test_stop_answers_at_once_and_the_next_work_goes_on(tmp_path: Path) -> None:
    with browser.served(tmp_path / "project") as served:
        take_hexapod(served)
        connection = http.client.HTTPConnection("127.0.0.1", served.port, timeout=30)
        headers = {"x-pkmcal-token": served.token}
        connection.request("POST", "/api/run/wait", b"{}", headers)
        answer = connection.getresponse()
        job = json.loads(answer.readline())["job"]
        assert "progress" in json.loads(answer.readline())
        assert json.loads(ask(served, "POST", f"/api/cancel/{job}")[2]) == {"stopped": True}
        *_, last = answer.read().splitlines()
        connection.close()
        assert json.loads(last)["error"] == {"message": "stopped", "stopped": True}
        assert "result" in lines(served, "machine")[-1]


def test_a_tab_that_is_closed_ends_its_work(tmp_path: Path) -> None:
    with browser.served(tmp_path / "project") as served:
        worker = health(served)["worker"]
        connection = http.client.HTTPConnection("127.0.0.1", served.port, timeout=30)
        connection.request("POST", "/api/run/wait", b"{}", {"x-pkmcal-token": served.token})
        answer = connection.getresponse()
        answer.readline(), answer.readline()
        answer.close()
        connection.close()
        assert gone(worker)


def test_an_error_of_the_users_is_in_words_with_file_and_line(tmp_path: Path) -> None:
    with browser.served(tmp_path / "project") as served:
        ask(served, "PUT", "/api/file/broken.csv", b"q1 [mm],x [mm]\n1,2\n3,abc\n")
        table = {
            "pkmcal-project": 1,
            "machine": {"builtin": "hexapod"},
            "measured": {"files": ["broken.csv"]},
        }
        body = json.dumps({"state": table, "version": 1}).encode()
        assert ask(served, "POST", "/api/state", body)[0] == 200
        found = lines(served, "look")[-1]["result"]
        assert "broken.csv" in found["error"]["message"]
        assert found["files"]["broken.csv"][0] == "q1 [mm],x [mm]"
        assert "broken.csv" in lines(served, "fit")[-1]["error"]["message"]


def test_a_server_that_is_ended_ends_what_it_started(tmp_path: Path) -> None:
    with browser.served(tmp_path / "project") as served:
        worker = health(served)["worker"]
        served.process.kill()  # not even asked
        assert gone(worker)


def test_the_server_itself_computes_nothing(tmp_path: Path) -> None:
    with browser.served(tmp_path / "project") as served:
        maps = Path(f"/proc/{served.process.pid}/maps").read_text()
        assert "numpy" not in maps and "_core" not in maps
