"""The process that computes may be stopped or die at any time: nothing is lost, nothing stays."""

from __future__ import annotations

import asyncio
import http.client
import json
import os
import signal
import subprocess
import sys
import time
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("starlette", reason="the extra app is not installed")
pytest.importorskip("uvicorn", reason="the extra app is not installed")

from pkmcal.app.process import Worker

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


def gone(pid: int, seconds: float = 20.0) -> bool:
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


def stopped(served: browser.Served) -> float:
    """Stop work that runs; the seconds until it was answered."""
    with closing(http.client.HTTPConnection("127.0.0.1", served.port, timeout=30)) as connection:
        headers = {"x-pkmcal-token": served.token}
        connection.request("POST", "/api/run/wait", b"{}", headers)
        answer = connection.getresponse()
        job = json.loads(answer.readline())["job"]
        assert "progress" in json.loads(answer.readline())
        begin = time.monotonic()
        assert json.loads(ask(served, "POST", f"/api/cancel/{job}")[2]) == {"stopped": True}
        *_, last = answer.read().splitlines()
        took = time.monotonic() - begin
    assert json.loads(last)["error"] == {"message": "stopped", "stopped": True}
    return took


def test_stop_answers_at_once_and_the_next_work_goes_on(tmp_path: Path) -> None:
    with browser.served(tmp_path / "project") as served:
        take_hexapod(served)
        lines(served, "machine")
        spare_of(served)
        time.sleep(2)  # it imports
        took, begin = stopped(served), time.monotonic()
        assert "result" in lines(served, "machine")[-1]
        print(f"stopped in {1000 * took:.0f} ms, works again in {time.monotonic() - begin:.2f} s")


def test_a_tab_that_is_closed_ends_its_work(tmp_path: Path) -> None:
    with browser.served(tmp_path / "project") as served:
        worker = health(served)["worker"]
        with closing(http.client.HTTPConnection("127.0.0.1", served.port, timeout=30)) as tab:
            tab.request("POST", "/api/run/wait", b"{}", {"x-pkmcal-token": served.token})
            answer = tab.getresponse()
            answer.readline(), answer.readline()
            answer.close()
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
        assert found["files"]["broken.csv"][0] == [1, "q1 [mm],x [mm]"]
        assert "broken.csv" in lines(served, "fit")[-1]["error"]["message"]


def spare_of(served: browser.Served) -> int:
    """The process that waits, as soon as there is one."""
    end = time.monotonic() + 20
    while time.monotonic() < end:
        if spare := health(served)["spare"]:
            return spare
        time.sleep(0.05)
    raise AssertionError("no process was started to wait")


def test_a_server_that_is_ended_ends_what_it_started(tmp_path: Path) -> None:
    with browser.served(tmp_path / "project") as served:
        take_hexapod(served)
        lines(served, "machine")
        worker, spare = health(served)["worker"], spare_of(served)
        served.process.kill()  # not even asked
        assert gone(worker) and gone(spare)


@pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="of terminals elsewhere")
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_a_terminal_that_is_closed_ends_the_server_in_order(tmp_path: Path, name: str) -> None:
    with browser.served(tmp_path / "project", stderr=subprocess.PIPE) as served:
        take_hexapod(served)
        lines(served, "machine")
        worker, spare = health(served)["worker"], spare_of(served)
        headers = {"x-pkmcal-token": served.token}
        with closing(http.client.HTTPConnection("127.0.0.1", served.port, timeout=30)) as tab:
            tab.request("GET", "/api/events", headers=headers)
            tab.getresponse().readline()
            number = signal.Signals[name]
            served.process.send_signal(number)
            said = "Ctrl-C" if name == "SIGINT" else name
            assert served.process.communicate(timeout=20)[1] == f"pkmcal: stopped by {said}\n"
        assert served.process.returncode == 128 + number
        assert gone(worker) and gone(spare)
    assert not list(served.folder.glob(".*"))


def test_a_request_that_does_not_end_holds_no_server_and_is_no_error(tmp_path: Path) -> None:
    """Of a file that is given half, as on a busy computer, nothing is kept or said."""
    with browser.served(tmp_path / "project", stderr=subprocess.PIPE) as served:
        state(served)
        with closing(http.client.HTTPConnection("127.0.0.1", served.port, timeout=30)) as tab:
            tab.putrequest("PUT", "/api/file/half.csv")
            tab.putheader("x-pkmcal-token", served.token)
            tab.putheader("content-length", "1000")
            tab.endheaders(b"q1 [mm],x [mm]\n")
            end = time.monotonic() + 20
            while not list(served.folder.glob(".upload*")) and time.monotonic() < end:
                time.sleep(0.02)
            served.process.send_signal(signal.SIGINT)
            assert served.process.communicate(timeout=20)[1] == "pkmcal: stopped by Ctrl-C\n"
    assert not list(served.folder.glob("*half*")) and not list(served.folder.glob(".*"))


def test_a_process_that_waits_takes_the_place_of_one_that_is_ended(tmp_path: Path) -> None:
    with browser.served(tmp_path / "project") as served:
        take_hexapod(served)
        lines(served, "machine")
        spare = spare_of(served)
        lines(served, "crash")
        assert health(served)["worker"] == spare
        assert spare_of(served) != spare
        assert "result" in lines(served, "machine")[-1]


@pytest.mark.slow
def test_after_twenty_stops_and_crashes_nothing_is_left(tmp_path: Path) -> None:
    seen = set[int]()
    with browser.served(tmp_path / "project") as served:
        take_hexapod(served)
        for count in range(20):
            if count % 4:
                lines(served, "crash")
            else:
                stopped(served)
            seen.add(health(served)["worker"])
        assert "result" in lines(served, "machine")[-1]
        seen |= {health(served)["worker"], spare_of(served)}
        assert not list(served.folder.glob("*.part")) and not list(served.folder.glob(".*.part"))
    assert all(map(gone, seen))


def test_a_folder_has_one_server(tmp_path: Path) -> None:
    with browser.served(tmp_path / "project") as served:
        code = (
            "import sys, pathlib; from pkmcal.app.launch import launch;"
            "launch(pathlib.Path(sys.argv[1]), print, browser=False)"
        )
        done = subprocess.run(
            [sys.executable, "-c", code, str(served.folder)],
            capture_output=True, text=True, check=False, timeout=60,
        )  # fmt: skip
        assert done.returncode and "its window is open already" in done.stderr
        assert state(served)["version"] == 1
        served.process.kill()  # what it held is free
        served.process.wait()
    with browser.served(served.folder) as again:
        assert state(again)["version"] == 1


def test_what_a_killed_upload_left_is_removed(tmp_path: Path) -> None:
    folder = tmp_path / "project"
    folder.mkdir()
    for name in (".upload-abc.part", "mine.part"):
        (folder / name).write_text("half")
    with browser.served(folder) as served:
        state(served)
        assert not (folder / ".upload-abc.part").exists() and (folder / "mine.part").exists()


def test_the_server_itself_computes_nothing() -> None:
    code = "import pkmcal.app.launch, sys; print({'numpy', 'pkmcal._core'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"


def test_a_process_that_is_killed_unseen_ends_no_server(tmp_path: Path) -> None:
    """Before the server knows it, it writes into a pipe that nobody reads."""
    with browser.served(tmp_path / "project") as served:
        take_hexapod(served)
        for _ in range(5):
            os.kill(health(served)["worker"], signal.SIGKILL)
            last = lines(served, "machine")[-1]
            assert "result" in last or last["error"]["crashed"]
        assert served.process.poll() is None
        assert "result" in lines(served, "machine")[-1]


def test_a_request_that_is_left_twice_does_not_hand_its_dying_process_on(tmp_path: Path) -> None:
    """As by a tab that presses Stop and closes the stream."""

    async def answer() -> dict[str, Any]:
        worker = Worker(tmp_path)
        try:
            messages = worker.run("wait", state={}, given={})
            await anext(messages)
            following = asyncio.ensure_future(anext(messages))
            for _ in range(2):
                await asyncio.sleep(0)
                following.cancel()
            *_, last = [each async for each in worker.run("devices", state={}, given={})]
            return last
        finally:
            await worker.stop()

    assert "result" in asyncio.run(answer())
