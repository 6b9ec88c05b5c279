"""What the window costs: until it listens, of a fit after a click, in bytes and memory, until Stop.

python -m benchmarks.bench_app
"""

from __future__ import annotations

import http.client
import json
import os
import statistics
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import pkmcal as pk
from benchmarks.timing import Report
from tests.app import browser

ROUNDS = 7
FIRST_PAGE = ("/", "/app.css", "/app.js", "/transport.js", "/frame.js", "/machine.js",
              "/api/state")  # and the stream of events  # fmt: skip


class Asking:
    """Requests of a page, without one."""

    def __init__(self, served: browser.Served) -> None:
        self.served = served

    def __call__(self, method: str, path: str, body: Any = None) -> bytes:
        connection = http.client.HTTPConnection("127.0.0.1", self.served.port, timeout=120)
        text = body if isinstance(body, bytes) else json.dumps(body or {}).encode()
        connection.request(method, path, text, {"x-pkmcal-token": self.served.token})
        answer = connection.getresponse().read()
        connection.close()
        if (
            path.startswith("/api/run/")
            and b'"result"' not in answer
            and b'"crashed"' not in answer
        ):
            raise RuntimeError(f"{path}: {answer.decode()}")  # its time is none of a result
        return answer

    def take(self, table: dict[str, Any]) -> None:
        version = json.loads(self("GET", "/api/state"))["version"]
        self("POST", "/api/state", {"state": {"pkmcal-project": 1, **table}, "version": version})


def processor_seconds(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def memory(pid: int) -> float:
    line = next(each for each in Path(f"/proc/{pid}/status").read_text().splitlines()
                if each.startswith("VmRSS"))  # fmt: skip
    return int(line.split()[1]) / 1024


def log(rows: int) -> bytes:
    """Return the positions of a hexapod with errors, as a file."""
    robot = pk.load("hexapod")
    rng = np.random.default_rng(1)
    true = robot.replace({f"base{i}.{x}": robot.geometry[f"base{i}.{x}"] + rng.normal(0, 0.3)
                          for i in range(1, 7) for x in "xyz"})  # fmt: skip
    q = robot.inverse(pk.sample_poses(robot, rows, seed=2, share=0.5))
    m = pk.VirtualMachine(true, noise=0.02, seed=1).measure(q)
    heads = [*(f"q{i} [mm]" for i in range(1, 7)), "x [mm]", "y [mm]", "z [mm]"]
    lines = np.hstack([m.actuators, m.values]).tolist()
    return "\n".join([",".join(heads), *(",".join(map(repr, line)) for line in lines)]).encode()


def main() -> None:
    report = Report("The window")
    with TemporaryDirectory() as folder:
        begin = time.perf_counter()
        with browser.served(Path(folder) / "project") as served:
            report.text(f"listening after {time.perf_counter() - begin:.2f} s")
            ask = Asking(served)
            sizes = [len(ask("GET", path)) for path in FIRST_PAGE]
            report.text(f"first page: {sum(sizes) / 1e3:.1f} kB in {len(sizes)} requests")
            sizes = [len(ask("GET", path)) for path in ("/view.js", "/wasm/limbs")]
            report.text(f"scripts and core of a machine: {sum(sizes) / 1e3:.1f} kB more")
            for rows in (180, 600, 3000):
                ask("PUT", f"/api/file/m{rows}.csv", log(rows))
                table = {"machine": {"builtin": "hexapod"}, "measured": {"files": [f"m{rows}.csv"]}}
                free = ["default", "gain1", "gain2", "gain3"]
                ask.take({**table, "fit": {"free": free}})
                ask("POST", "/api/run/fit")
                worker = json.loads(ask("GET", "/api/health"))["worker"]
                seconds, wall = [], []
                for k in range(ROUNDS):
                    ask.take({**table, "fit": {"free": free, "drop": [str(k)]}})
                    used, begin = processor_seconds(worker), time.perf_counter()
                    answer = ask("POST", "/api/run/fit")
                    seconds.append(processor_seconds(worker) - used)
                    wall.append(time.perf_counter() - begin)
                report.text(
                    f"a row left out of {rows}, 45 numbers: {spread(seconds)} s of"
                    f" the worker, {spread(wall)} s until the answer of"
                    f" {len(answer) / 1e3:.0f} kB"
                )
            ask("POST", "/api/run/report")
            report.text(
                f"memory: server {memory(served.process.pid):.0f} MB, worker after a report"
                f" {memory(worker):.0f} MB"
            )
            ask.take({"machine": {"builtin": "hexapod"}, "measured": {"files": ["m180.csv"]}})
            stops, again, used = [], [], []
            for _ in range(ROUNDS):
                waits = ready(ask)
                connection = http.client.HTTPConnection("127.0.0.1", served.port, timeout=60)
                connection.request("POST", "/api/run/wait", b"{}", {"x-pkmcal-token": served.token})
                answer_ = connection.getresponse()
                job = json.loads(answer_.readline())["job"]
                answer_.readline()
                before, begin = processor_seconds(waits), time.perf_counter()
                ask("POST", f"/api/cancel/{job}")
                answer_.read()
                stops.append(time.perf_counter() - begin)
                connection.close()
                ask("POST", "/api/run/fit")
                again.append(time.perf_counter() - begin)
                used.append(processor_seconds(waits) - before)
            report.text(
                f"Stop: {spread([1e3 * each for each in stops], 0)} ms until the answer; the next"
                f" fit, of 180 rows, {spread(again)} s after it, of which {spread(used)} s of the"
                " process that waited"
            )
            again, used, later = [], [], []
            table = {"machine": {"builtin": "hexapod"}, "measured": {"files": ["m180.csv"]}}
            for k in range(ROUNDS):
                waits = ready(ask)
                before, begin = processor_seconds(waits), time.perf_counter()
                ask("POST", "/api/run/crash")
                ask("POST", "/api/run/fit")
                again.append(time.perf_counter() - begin)
                used.append(processor_seconds(waits) - before)
                ask.take({**table, "fit": {"drop": [str(k)]}})
                before = processor_seconds(waits)
                ask("POST", "/api/run/fit")
                later.append(processor_seconds(waits) - before)
            report.text(
                f"a process that dies: the next fit, of 180 rows, {spread(again)} s after it was"
                f" told to, of which {spread(used)} s of the process that waited"
            )
            more = [first - second for first, second in zip(used, later, strict=True)]
            report.text(
                f"the first fit of a process, with what it reads for it, takes {spread(more)} s of"
                f" the processor more than its second, {spread(later)} s"
            )
            if browser.CHROMIUM is not None:
                report.text(f"first paint: {painted(served)} ms after the address was given")
                own, other = clicked(served)
                report.text(
                    f"a row of 180 unticked: {own} ms until the page has its new fit and picture,"
                    f" {other} ms in a second tab, one after the other in one process"
                )


def spread(found: list[float], digits: int = 2) -> str:
    """Median, least and most."""
    middle, least, most = statistics.median(found), min(found), max(found)
    return f"{middle:.{digits}f} ({least:.{digits}f} to {most:.{digits}f})"


def painted(served: browser.Served) -> str:
    """Times until the page shows something, ms; by Chromium's own clock."""
    found = []
    for _ in range(ROUNDS):
        with browser.page_of(served) as page:
            entry = "performance.getEntriesByName('first-contentful-paint')[0].startTime"
            found.append(float(page.evaluate(entry)))
    return spread(found, 0)


def clicked(served: browser.Served) -> tuple[str, str]:
    """Times from a click until the page and a second tab have another fit, ms."""
    watch = """() => { const main = document.getElementById('main')
      new MutationObserver(() => { window.seen = performance.timeOrigin + performance.now() })
        .observe(main, { attributes: true, attributeFilter: ['data-fits'] }) }"""
    click = """() => { const now = performance.timeOrigin + performance.now()
      document.querySelector('tr[id] input').click(); return now }"""
    fits = "document.getElementById('main').dataset.fits"
    own, other = [], []
    with browser.page_of(served) as page:
        second = page.context.new_page()
        for each in (page, second):
            each.goto(served.url)
            each.locator("body[data-ready]").wait_for(state="attached")
            each.get_by_role("button", name="4 Result").click()
            each.locator("tr[id] input").first.wait_for()
            each.evaluate(watch)
        for _ in range(ROUNDS):
            page.wait_for_timeout(2000)
            counts = [int(each.evaluate(fits)) for each in (page, second)]
            begin = page.evaluate(click)
            for each, count, found in zip((page, second), counts, (own, other), strict=True):
                each.locator(f"main[data-fits='{count + 1}']").wait_for(state="attached")
                found.append(each.evaluate("window.seen") - begin)
    return spread(own, 0), spread(other, 0)


def ready(ask: Asking) -> int:
    """Return the process that waits, once it has imported everything."""
    spare, used = 0, -1.0
    while not spare or used != (used := processor_seconds(spare)):
        spare = json.loads(ask("GET", "/api/health"))["spare"] or 0
        time.sleep(1.0)
    return spare


if __name__ == "__main__":
    main()
