"""What the page asks for and what its processes hold: counted, not timed (benchmarks.bench_app)."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

import pkmcal as pk
from pkmcal.jobs.calibration import Calibration
from pkmcal.jobs.project import Project

pytest.importorskip("starlette", reason="the extra app is not installed")
pytest.importorskip("uvicorn", reason="the extra app is not installed")

from . import browser
from .test_flows import PRINTER, fits
from .test_guard import ask
from .test_process import health
from .test_same_as_commands import done, measured, take


def kilobytes(pid: int) -> int:
    """Memory of a process that nobody else has."""
    lines = Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()
    return sum(int(line.split()[1]) for line in lines if line.startswith("Private_"))


def test_the_first_page_is_small_and_a_machine_is_not_much_more(tmp_path: Path) -> None:
    with browser.served(tmp_path / "project") as served, browser.page_of(served) as page:
        asked: list[str] = []
        page.on("request", lambda request: asked.append(f"{request.method} {request.url}"))

        def size() -> int:  # as the server sends it; of streams what is there at once
            paths = [each.split(f":{served.port}")[1] for each in asked if each.startswith("GET")]
            fixed = [path for path in paths if path != "/api/events"]
            return sum(len(ask(served, "GET", path)[2]) for path in fixed)

        page.reload()
        page.locator("body[data-ready]").wait_for(state="attached")
        page.wait_for_timeout(300)
        assert len(asked) <= 8, asked
        assert size() <= 45_000
        page.get_by_role("button", name="linear-delta", exact=True).click()
        page.locator(".pkmcal-view.moves").wait_for()
        assert len(asked) <= 14, asked
        answer = ask(served, "POST", "/api/run/machine", b"{}")[2]
        assert size() + len(answer) <= 140_000


def test_an_answer_for_three_thousand_rows_is_below_half_a_megabyte(tmp_path: Path) -> None:
    folder = tmp_path / "project"
    folder.mkdir()
    measured("hexapod", 3000, seed=2, kind="position").write(folder / "many.csv")
    with browser.served(folder) as served:
        take(served, Project(Calibration("hexapod", ("many.csv",))))
        answer = ask(served, "POST", "/api/run/fit", b"{}")[2]
        found = json.loads(answer.splitlines()[-1])["result"]
        assert len(found["rows"]) == 3000
        assert len(answer) <= 500_000


@pytest.mark.skipif(not Path("/proc/self/smaps_rollup").exists(), reason="no Linux")
def test_the_processes_hold_little(tmp_path: Path) -> None:
    folder = tmp_path / "project"
    folder.mkdir()
    measured("hexapod", 180, seed=2).write(folder / "m.csv")
    with browser.served(folder) as served:
        take(served, Project(Calibration("hexapod", ("m.csv",))))
        done(served, "fit")
        done(served, "report")
        worker = kilobytes(health(served)["worker"])
        print(f"server {kilobytes(served.process.pid)} kB, worker {worker} kB")
        assert kilobytes(served.process.pid) <= 60_000
        assert worker <= 200_000


def test_one_change_makes_one_fit_in_each_tab(tmp_path: Path) -> None:
    with browser.served(tmp_path / "project") as served, browser.page_of(served) as page:
        page.set_input_files("input[type=file]", PRINTER)
        page.get_by_role("button", name="Calibrate with what it has stored").click()
        fits(page, 1)
        other = page.context.new_page()
        other.goto(served.url)
        fits(other, 1)
        page.locator("tr[id] input").first.click()
        fits(page, 2)
        fits(other, 2)
        page.wait_for_timeout(1000)
        counts = [each.locator("main").get_attribute("data-fits") for each in (page, other)]
        assert counts == ["2", "2"]


def test_the_package_is_imported_without_what_serves(tmp_path: Path) -> None:
    code = "import pkmcal, sys; print({'starlette', 'uvicorn', 'asyncio'} & set(sys.modules))"
    done_ = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done_.stdout.strip() == "set()"
    assert pk.__name__ == "pkmcal"


@pytest.mark.parametrize("missing", ["starlette", "uvicorn"])
def test_without_what_serves_one_line_says_what_to_install(tmp_path: Path, missing: str) -> None:
    code = f"import sys; sys.modules['{missing}'] = None; from pkmcal.cli.main import main; main()"
    argv = [sys.executable, "-c", code, "app", str(tmp_path / "project")]
    ended = subprocess.run(argv, capture_output=True, text=True, check=False, timeout=60)
    assert ended.returncode == 2 and len(ended.stderr.splitlines()) == 1
    assert f"pkmcal app needs {missing}: python -m pip install starlette uvicorn" in ended.stderr
