"""A machine that is measured from the window: driven by who looks at it, and by nobody else."""

from __future__ import annotations

import http.client
import json
import os
import signal
import subprocess
import time
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk

pytest.importorskip("starlette", reason="the extra app is not installed")
pytest.importorskip("uvicorn", reason="the extra app is not installed")

from tests.live.servers import duet

from . import browser
from .test_guard import ask, state

ROBOT = Path(__file__).parents[2] / "examples" / "linear-delta" / "robot.toml"
PLAN = {"kind": "height", "noise": "0.03", "direction": "z", "within": ["z=5:40"], "count": 4}


def project(folder: Path) -> Path:
    folder.mkdir()
    (folder / "robot.toml").write_text(ROBOT.read_text())
    (folder / "project.toml").write_text('pkmcal-project = 1\n\n[machine]\nfile = "robot.toml"\n')
    return folder


def until(true: Callable[[], object], seconds: float = 60.0) -> None:
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end
        time.sleep(0.05)


def rows(folder: Path) -> int:
    text = (folder / "measured.csv").read_text()
    return sum(line[0] not in "#q" for line in text.splitlines())


class Stream:
    """What the server says of a measurement, and what is said to it, without a browser."""

    def __init__(self, served: browser.Served, machine: str, **given: Any) -> None:
        self.served = served
        self.connection = http.client.HTTPConnection("127.0.0.1", served.port, timeout=60)
        asked = {"machine": machine, "instrument": "person", "out": "measured.csv", "dwell": 0.0,
                 "plan": PLAN, **given}  # fmt: skip
        body = json.dumps(asked).encode()
        self.connection.request("POST", "/api/live", body, {"x-pkmcal-token": served.token})
        self.answer = self.connection.getresponse()
        self.name = self.next("run")["run"] if self.answer.status == 200 else ""

    def next(self, *kinds: str) -> dict[str, Any]:
        """The next message of a kind; an error where it is none of them."""
        while line := self.answer.readline():
            if line.strip():
                message: dict[str, Any] = json.loads(line)
                if message.keys() & set(kinds):
                    return message
                assert "error" not in message, message
        raise AssertionError("the stream has ended")

    def say(self, word: str, **what: Any) -> int:
        path = f"/api/live/{self.name}/{word}"
        return ask(self.served, "POST", path, json.dumps(what).encode())[0]

    def read(self, text: str) -> None:
        number = self.next("asked")["number"]
        assert self.say("type", number=number, text=text) == 200

    def close(self) -> None:
        self.answer.close()
        self.connection.close()


def test_a_person_connects_starts_reads_and_calibrates(tmp_path: Path) -> None:
    folder = project(tmp_path / "project")
    with duet() as (address, machine), browser.served(folder) as served:
        with browser.page_of(served) as page:
            page.get_by_role("button", name="3 Measure").click()
            page.get_by_text("Measure with a machine now").click()
            form = page.locator("details form")
            form.get_by_label("address of the machine").wait_for()
            assert form.get_by_label("address of the machine").is_disabled()  # a person has none
            form.get_by_role("combobox", name="machine", exact=True).select_option("reprap")
            typed = form.get_by_label("address of the machine")
            assert typed.input_value() == ""
            typed.fill(address)
            form.get_by_label("its noise, mm, or unknown").fill("0.03")
            form.get_by_label("within, such as z=0:300").fill("z=5:40")
            form.get_by_label("direction that counts").fill("z")
            form.get_by_label("or poses").fill("19")
            form.get_by_label("rest before it is read, s").fill("0")
            form.get_by_role("button", name="Connect").click()
            panel = page.locator("#measuring")
            panel.get_by_role("button", name="Start").wait_for()
            words = panel.locator("pre").inner_text()
            assert f"driven by reprap:{address}" in words and "between poses" not in words
            assert "pkmcal measure robot.toml" in words and "--count 19" in words
            time.sleep(0.5)
            assert machine.lines == [] and rows(folder) == 0
            panel.get_by_role("button", name="Start").press("Enter")
            true = pk.load(ROBOT).replace({"radius": 171.0})
            noise = np.random.default_rng(1)
            box = panel.get_by_role("textbox")
            for row in range(19):
                box.wait_for()
                place = np.array([*machine.place, 0, 0, 0])
                reading = true.forward(pk.load(ROBOT).inverse(place)).pose[2]
                if row == 3:
                    box.fill("a")
                    box.press("Enter")
                    panel.get_by_text("expected a number").wait_for()
                if row == 16:  # a slip of the pen
                    reading += 2.0
                page.get_by_role("button", name="1 Machine").click()  # it stays on every screen
                box.fill(f"{reading + noise.normal(0, 0.03):.3f}")
                box.press("Enter")
                panel.locator(f"tr:has(td:text-is('{row + 1}'))").wait_for()
                assert rows(folder) == row + 1
                warned = panel.locator("p.warn").inner_text()
                assert ("contradict" in warned) == (row == 16), (row, warned)
            panel.get_by_text("all the poses that were asked for are measured").wait_for()
            assert panel.locator("meter").is_visible()
            panel.get_by_role("button", name="Calibrate with these rows").click()
            page.locator("main[data-fits='1']").wait_for()
        assert len(machine.lines) == 19
    measured = pk.read_measurements(folder / "measured.csv", pk.load(ROBOT))
    assert len(measured) == 19


def test_stop_is_at_hand_on_every_screen_and_stops_the_machine(tmp_path: Path) -> None:
    folder = project(tmp_path / "project")
    with (
        duet() as (address, machine),
        browser.served(folder) as served,
        browser.page_of(served) as page,
    ):
        page.get_by_role("button", name="3 Measure").click()
        page.get_by_text("Measure with a machine now").click()
        form = page.locator("details form")
        form.get_by_role("combobox", name="machine", exact=True).select_option("reprap")
        form.get_by_label("address of the machine").fill(address)
        form.get_by_label("within, such as z=0:300").fill("z=5:40")
        form.get_by_label("or poses").fill("4")
        form.get_by_role("button", name="Connect").click()
        panel = page.locator("#measuring")
        panel.get_by_role("button", name="Start").click()
        box = panel.get_by_role("textbox")
        box.wait_for()
        machine.long = True  # the next move does not end
        box.fill("20.0")
        box.press("Enter")
        until(lambda: len(machine.lines) == 2)
        page.get_by_role("button", name="2 Plan").click()
        panel.get_by_role("button", name="Stop").click()
        panel.get_by_text("stopped with 1 row in measured.csv").wait_for()
        assert machine.lines[-1] == "M112" and len(machine.lines) == 3
        panel.get_by_role("button", name="Close").click()
        assert panel.count() == 0
    assert rows(folder) == 1


@pytest.mark.parametrize("dark", [False, True])
def test_its_panel_is_fit_for_readers_of_screens_and_for_telephones(
    tmp_path: Path, dark: bool
) -> None:
    axe = os.environ.get("AXE")
    if not axe:
        pytest.skip("AXE names no axe-core: make test-app")
    look = {"color_scheme": "dark" if dark else "light", "viewport": {"width": 390, "height": 844}}
    with (
        browser.served(project(tmp_path / "project")) as served,
        browser.page_of(served, bypass_csp=True, **look) as page,
    ):
        page.get_by_role("button", name="3 Measure").click()
        page.get_by_text("Measure with a machine now").click()
        form = page.locator("details form")
        form.get_by_label("within, such as z=0:300").fill("z=5:40")
        form.get_by_label("or poses").fill("8")
        form.get_by_label("rest before it is read, s").fill("0")
        form.get_by_role("button", name="Connect").click()
        panel = page.locator("#measuring")
        panel.get_by_role("button", name="Start").click()
        box = panel.get_by_role("textbox")
        for row in range(8):
            panel.get_by_text("press Enter").wait_for()
            box.press("Enter")
            panel.get_by_text(f"row {row + 1}, at").wait_for()
            box.fill("20.0")
            box.press("Enter")
        panel.get_by_text("all the poses that were asked for are measured").wait_for()
        page.evaluate(Path(axe).read_text(encoding="utf-8"))
        found = page.evaluate("axe.run(document, { resultTypes: ['violations'] })")
        assert not found["violations"], [
            (each["id"], each["nodes"][0]["html"]) for each in found["violations"]
        ]
        assert page.evaluate("document.documentElement.scrollWidth") <= 390


def test_nothing_moves_without_the_start_of_the_page_that_connected(tmp_path: Path) -> None:
    folder = project(tmp_path / "project")
    with duet() as (address, machine), browser.served(folder) as served:
        run = Stream(served, f"reprap:{address}")
        for _ in range(20):  # before anybody could read what it does
            assert run.say("start") in (200, 409)
        assert "driven by" in run.next("ready")["ready"]
        for name in ("x", "", run.name[:-1]):
            assert ask(served, "POST", f"/api/live/{name}/start", b"{}")[0] in (404, 409)
        second = Stream(served, f"reprap:{address}")  # another tab
        assert second.answer.status == 409
        second.close()
        assert run.say("type", number=1, text="start") == 200
        assert run.say("move") == 400
        time.sleep(1.5)
        assert machine.lines == []
        assert ask(served, "POST", "/api/live/stop", b"{}")[0] == 200  # whoever asks
        assert run.next("error")["error"]["stopped"]
        assert machine.lines == []
        run.close()


def test_enter_twice_does_not_answer_the_next_question(tmp_path: Path) -> None:
    folder = project(tmp_path / "project")
    with duet() as (address, machine), browser.served(folder) as served:
        run = Stream(served, f"reprap:{address}")
        run.next("ready")
        run.say("start")
        number = run.next("asked")["number"]
        for _ in range(3):
            run.say("type", number=number, text="20.0")
        assert run.next("row")["row"]["number"] == 1
        run.next("asked")
        time.sleep(0.5)
        assert rows(folder) == 1 and len(machine.lines) == 2
        run.close()


@pytest.mark.parametrize("pulled", ["tab", "server", "measurer"])
def test_whoever_goes_stops_the_machine_and_no_row_is_lost(tmp_path: Path, pulled: str) -> None:
    """A tab that is closed, a server that is killed; one that was killed itself can do nothing."""
    folder = project(tmp_path / "project")
    with duet() as (address, machine):
        with browser.served(folder) as served:
            run = Stream(served, f"reprap:{address}")
            run.next("ready")
            run.say("start")
            run.read("20.0")
            number = run.next("asked")["number"]
            machine.long = True  # the move to the third pose does not end
            run.say("type", number=number, text="20.0")
            until(lambda: len(machine.lines) == 3)
            if pulled == "tab":
                run.close()
            elif pulled == "server":
                served.process.kill()
                served.process.wait(20)
            else:
                pids = subprocess.run(
                    ["pgrep", "-P", str(served.process.pid), "-f", "pkmcal.app.measurer"],
                    capture_output=True, text=True, check=True,
                ).stdout.split()  # fmt: skip
                assert len(pids) == 1
                subprocess.run(["kill", "-9", *pids], check=True)
                assert "look whether the machine moves" in run.next("error")["error"]["message"]
            run.close()
            if pulled != "measurer":
                until(lambda: machine.lines[-1] == "M112")
            assert len(machine.lines) == 3 + (pulled != "measurer")
        assert rows(folder) == 2
    with duet() as (address, machine), browser.served(folder) as served:
        run = Stream(served, f"reprap:{address}")
        assert run.next("said")["said"].endswith("goes on behind 2 rows")
        run.next("ready")
        run.say("start")
        run.read("20.0")
        assert run.next("row")["row"]["number"] == 3
        run.close()


def test_no_file_of_the_folder_is_run_by_what_measures(tmp_path: Path) -> None:
    folder, ran = project(tmp_path / "project"), tmp_path / "ran"
    (folder / "pkmcal").mkdir()
    for name in ("json", "queue", "numpy", "serial", "pkmcal/__init__"):
        (folder / f"{name}.py").write_text(f"open({str(ran)!r}, 'w').close()\n")
    with duet() as (address, _), browser.served(folder) as served:
        run = Stream(served, f"reprap:{address}")
        run.next("ready")
        run.close()
    assert not ran.exists()


def test_ctrl_c_at_the_server_stops_the_machine(tmp_path: Path) -> None:
    folder = project(tmp_path / "project")
    with duet() as (address, machine), browser.served(folder) as served:
        run = Stream(served, f"reprap:{address}")
        run.next("ready")
        machine.long = True
        run.say("start")
        until(lambda: len(machine.lines) == 1)
        served.process.send_signal(signal.SIGTERM)
        until(lambda: machine.lines[-1] == "M112")
        assert served.process.wait(30) is not None
        run.close()


WRONG: list[tuple[str, dict[str, Any], str]] = [
    ("nothing:a", {}, "it has person"),
    ("reprap:http://127.0.0.1:9", {}, "does not answer"),
    ("moonraker:http://a/path", {}, "expected an address"),
    ("person", {"out": "../x.csv"}, "a file of this project"),
    ("person", {"out": "robot.toml"}, "a file of this project"),
    ("person", {"safe_height": "high"}, "--safe-height"),
    ("person", {"plan": {"kind": "height"}}, "state when to stop"),
    ("person", {"plan": {"kind": "height", "count": 2, "odd": 1}}, "odd"),
    ("person", {"instrument": "serial:/dev/nowhere"}, "nowhere" if find_spec("serial")
     else "needs pyserial"),
]  # fmt: skip


def test_what_does_not_fit_is_said_and_nothing_is_written(tmp_path: Path) -> None:
    folder = project(tmp_path / "project")
    before = {each.name: each.read_bytes() for each in folder.iterdir()}
    with browser.served(folder) as served:
        for machine, given, said in WRONG:
            run = Stream(served, machine, **given)
            message = run.next("error", "ready")
            assert said in message["error"]["message"], (machine, given)
            while run.answer.readline():  # until its process has ended
                continue
            run.close()
        assert ask(served, "POST", "/api/live", b"[]")[0] == 400
        assert ask(served, "POST", "/api/live", b"x" * 30_000)[0] == 400
        assert state(served)["version"] == 1
    for name, content in before.items():
        assert (folder / name).read_bytes() == content
    log = folder / "measured.csv"
    assert not log.exists() or rows(folder) == 0
