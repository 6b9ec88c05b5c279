"""The whole way of two people in Chromium; what they get is what the shown commands write."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.measurements.pose_csv import read_poses

pytest.importorskip("starlette", reason="the extra app is not installed")
pytest.importorskip("uvicorn", reason="the extra app is not installed")

from . import browser

PRINTER = Path(__file__).parents[2] / "examples" / "linear-delta" / "printer.cfg"
SHOTS = os.environ.get("PKMCAL_SHOTS")  # a folder for the pictures of the documents


def shoot(page: Any, name: str) -> None:
    if SHOTS:
        page.screenshot(path=Path(SHOTS) / f"{name}.png")


def fits(page: Any, count: int) -> None:
    page.locator(f"main[data-fits='{count}']").wait_for()


def click_arrow(page: Any, key: str) -> None:
    """Click the arrow of a row in the picture, where it begins."""
    page.evaluate("workbench.picture.scrollIntoView()")
    at = page.evaluate(
        "(() => { const { scene, calibration } = workbench.picture.machine,"
        f" p = calibration.points.find(one => one.key === '{key}'),"
        " [x, y] = scene.seen(scene.eye, p.at), r = scene.canvas.getBoundingClientRect();"
        " return [r.x + x, r.y + y] })()"
    )
    page.mouse.click(*at)


def commands(page: Any, step: str) -> list[list[str]]:
    page.get_by_role("button", name=step, exact=True).click()
    page.locator(f"main.{page.evaluate('workbench.step')}[aria-busy=false]").wait_for()
    return [
        shlex.split(line) for line in page.locator("#terminal pre").inner_text().splitlines()[1:]
    ]


def run(argv: list[str], folder: Path) -> str:
    done = subprocess.run(
        [sys.executable, "-m", *argv], cwd=folder, capture_output=True, text=True, check=False
    )
    assert done.returncode in (0, 1), done.stderr
    return done.stdout


def test_a_printers_owner_gets_the_configuration_that_the_commands_write(tmp_path: Path) -> None:
    folder, by_hand = tmp_path / "project", tmp_path / "by hand"
    with browser.served(folder) as served, browser.page_of(served) as page:
        begin = time.monotonic()
        page.set_input_files("input[type=file]", PRINTER)  # 1
        page.locator(".pkmcal-view.moves").wait_for()
        shoot(page, "machine")
        page.get_by_role("button", name="Calibrate with what it has stored").click()  # 2
        fits(page, 1)
        assert (
            page.locator(".verdict .state")
            .inner_text()
            .startswith("Calibrated: the misfit of 41 fitted points")
        )
        shoot(page, "result")
        page.get_by_role("button", name="5 Take away").click()  # 3
        with page.expect_download() as taken:
            page.locator("button[data-file='new.cfg']").click()  # 4
        print(f"from the file to the changed configuration: {time.monotonic() - begin:.1f} s")
        new = Path(taken.value.path()).read_bytes()
        assert "position_endstop" in page.locator("pre.diff").inner_text()
        shoot(page, "out")
        lines = [
            each
            for step in ("1 Machine", "4 Result", "5 Take away")
            for each in commands(page, step)
            if each[1] != "show"
        ]
    by_hand.mkdir()
    shutil.copy(PRINTER, by_hand)
    for argv in lines:
        run(argv, by_hand)
    for name in ("machine/robot.toml", "machine/probe.csv", "report/robot.toml", "new.cfg"):
        assert (by_hand / name).read_bytes() == (folder / name).read_bytes(), name
    assert (by_hand / "new.cfg").read_bytes() == new


@pytest.fixture(scope="module")
def tracked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A tracker's points and the controller's log, two rows of 90 mistaken."""
    folder = tmp_path_factory.mktemp("tracked")
    robot = pk.load("hexapod")
    rng = np.random.default_rng(3)
    true = robot.replace({f"offset{i}": rng.normal(0, 0.3) for i in range(1, 7)})
    q = robot.inverse(pk.sample_poses(robot, 90, seed=2, share=0.5))
    m = pk.VirtualMachine(true, noise=0.02, seed=1).measure(q)
    values = m.values.copy()
    values[[17, 52]] += [[3.0, 0.0, 0.0], [0.0, -4.0, 0.0]]
    places = "\n".join(",".join(f"{x:.5f}" for x in row) for row in values)
    legs = "\n".join(",".join(f"{x:.6f}" for x in row) for row in m.actuators)
    (folder / "tracker.csv").write_text(f"x [mm],y [mm],z [mm]\n{places}\n")
    heads = ",".join(f"q{i} [mm]" for i in range(1, 7))
    (folder / "log.csv").write_text(f"{heads}\n{legs}\n")
    return folder


def test_a_metrologist_leaves_bad_rows_out_and_gets_what_the_command_says(
    tracked: Path, tmp_path: Path
) -> None:
    with browser.served(tmp_path / "project") as served, browser.page_of(served) as page:
        page.get_by_role("button", name="hexapod", exact=True).click()
        page.locator(".pkmcal-view.moves").wait_for()
        page.get_by_role("button", name="3 Measure").click()
        page.set_input_files("input[type=file]", [tracked / "tracker.csv", tracked / "log.csv"])
        page.locator("li", has_text="log.csv").get_by_role(
            "button", name="is the controller’s log"
        ).click()
        page.locator("pre", has_text="90 measured positions").wait_for()
        shoot(page, "measure")
        page.get_by_role("button", name="Calibrate", exact=True).click()
        fits(page, 1)
        assert page.locator("tr.odd").count() == 2
        before = (served.folder / "project.toml").read_bytes()
        bad = page.get_by_role("checkbox", name="use tracker.csv line 19", exact=True)
        look = page.evaluate("workbench.picture.machine.scene.turn")
        bad.focus()
        page.keyboard.press("Space")  # in the row
        fits(page, 2)
        assert bad.evaluate("box => box === document.activeElement") and not bad.is_checked()
        click_arrow(page, "52")  # in the picture
        assert page.locator("tr.named").get_attribute("id") == "row 52"
        page.locator(".picked").get_by_role("checkbox").click()
        fits(page, 3)
        assert page.evaluate("workbench.picture.machine.scene.turn") == look
        assert page.locator("tr.odd").count() == 0
        left = page.locator("tr.out td:nth-child(4)").all_inner_texts()  # how far off they would be
        assert sorted(round(float(each)) for each in left) == [3, 4]
        assert page.locator("tr.out td:last-child").all_inner_texts() == ["left out"] * 2
        page.get_by_role("button", name="show tracker.csv line 5", exact=True).click()
        assert page.evaluate("workbench.picture.machine.calibration.named.key") == "3"
        page.get_by_label("hold out").select_option("0.2")
        fits(page, 4)
        assert "held-out" in page.locator(".verdict .state").inner_text()
        assert page.locator("tr.out td:last-child", has_text="held out").count() == 18
        page.get_by_role("button", name="Numbers").click()
        page.get_by_label("find another number, too").select_option("gain1")
        fits(page, 5)
        page.get_by_role("button", name="All it says").click()
        shown = page.locator("pre", has_text="rms before").inner_text()
        (argv,) = commands(page, "4 Result")
        for _ in range(4):
            fitted = int(page.locator("main").get_attribute("data-fits") or 0)
            page.get_by_role("button", name="Undo").click()
            fits(page, fitted + 1)
        assert (served.folder / "project.toml").read_bytes() == before
    by_hand = tmp_path / "by hand"
    shutil.copytree(tracked, by_hand)
    printed = run(argv, by_hand).rsplit("\n\nreport: ", 1)[0]
    assert printed.split() == shown.split()


def test_a_plan_is_made_shown_and_saved(tmp_path: Path) -> None:
    with browser.served(tmp_path / "project") as served, browser.page_of(served) as page:
        page.get_by_role("button", name="hexapod", exact=True).click()
        page.locator(".pkmcal-view.moves").wait_for()
        page.get_by_role("button", name="2 Plan").click()
        page.get_by_label("poses", exact=True).fill("12")
        page.get_by_role("button", name="Choose poses").click()
        page.locator("main.plan .pkmcal-view.moves").wait_for()
        shoot(page, "plan")
        with page.expect_download() as taken:
            page.get_by_role("button", name="Save plan/commands.csv").click()
        assert len(Path(taken.value.path()).read_text().splitlines()) >= 13


def test_an_imported_printer_is_planned_for_its_own_probe_on_its_bed(tmp_path: Path) -> None:
    with browser.served(tmp_path / "project") as served, browser.page_of(served) as page:
        page.set_input_files("input[type=file]", PRINTER)
        page.locator(".pkmcal-view.moves").wait_for()
        page.get_by_role("button", name="2 Plan").click()
        page.get_by_role("button", name="Choose poses").click()
        page.locator("main.plan .pkmcal-view.moves").wait_for()
        assert 'kind = "probe"' in (served.folder / "project.toml").read_text()
        assert "predicted error along z" in page.locator("main.plan").inner_text()
        with page.expect_download():
            page.get_by_role("button", name="Save plan/poses.csv").click()
        robot = pk.load(served.folder / "machine" / "robot.toml")
        poses = read_poses(served.folder / "plan" / "poses.csv", robot)
        assert np.ptp(poses[:, 2]) == 0
        assert np.hypot(poses[:, 0], poses[:, 1]).max() <= 120 + 1e-5  # its radius, as rounded


def test_two_tabs_show_one_project(tmp_path: Path) -> None:
    with browser.served(tmp_path / "project") as served, browser.page_of(served) as page:
        other = page.context.new_page()
        other.goto(served.url)
        other.locator("body[data-ready]").wait_for(state="attached")
        page.get_by_role("button", name="hexapod", exact=True).click()
        other.locator("h2", has_text="hexapod").first.wait_for()  # how soon: bench_app


def test_what_others_wrote_is_shown_as_text(tmp_path: Path) -> None:
    hostile = tmp_path / "evil.csv"
    hostile.write_text("<img src=x onerror=alert(1)>,x [mm]\n1,2\n")
    with browser.served(tmp_path / "project") as served, browser.page_of(served) as page:
        page.on("dialog", lambda dialog: pytest.fail(dialog.message))
        page.get_by_role("button", name="hexapod", exact=True).click()
        page.locator(".pkmcal-view.moves").wait_for()
        page.get_by_role("button", name="3 Measure").click()
        page.set_input_files("input[type=file]", hostile)
        page.locator("pre", has_text="<img src=x").wait_for()
        assert page.locator("main img").count() == 0


@pytest.mark.parametrize("dark", [False, True])
def test_screens_are_fit_for_readers_of_screens_and_for_telephones(
    tmp_path: Path, dark: bool
) -> None:
    axe = os.environ.get("AXE")
    if not axe:
        pytest.skip("AXE names no axe-core: make test-app")
    scheme = "dark" if dark else "light"
    with (
        browser.served(tmp_path / "project") as served,
        browser.page_of(
            served, color_scheme=scheme, viewport={"width": 390, "height": 844}, bypass_csp=True
        ) as page,
    ):
        page.set_input_files("input[type=file]", PRINTER)
        page.locator(".pkmcal-view.moves").wait_for()
        page.get_by_role("button", name="Calibrate with what it has stored").click()
        fits(page, 1)
        for step in ("1 Machine", "2 Plan", "3 Measure", "4 Result", "5 Take away"):
            page.get_by_role("button", name=step, exact=True).click()
            page.wait_for_timeout(1500)
            page.evaluate(Path(axe).read_text(encoding="utf-8"))
            found = page.evaluate("axe.run(document, { resultTypes: ['violations'] })")
            assert not found["violations"], [
                (step, each["id"], each["nodes"][0]["html"]) for each in found["violations"]
            ]
            assert page.evaluate("document.documentElement.scrollWidth") <= 390, step


def test_the_printers_way_goes_by_keyboard_alone(tmp_path: Path) -> None:
    with browser.served(tmp_path / "project") as served, browser.page_of(served) as page:
        page.set_input_files("input[type=file]", PRINTER)  # the dialog of files is the system's
        page.locator(".pkmcal-view.moves").wait_for()

        def press(name: str, key: str = "Tab") -> None:
            for _ in range(60):
                page.keyboard.press(key)
                if page.evaluate("document.activeElement.textContent") == name:
                    return page.keyboard.press("Enter")
            raise AssertionError(f"{key} does not reach {name!r}")

        press("Calibrate with what it has stored")
        fits(page, 1)
        press("5 Take away", "Shift+Tab")
        page.locator("button[data-file='new.cfg']").wait_for()
        with page.expect_download():
            press("Save new.cfg")


def test_the_metrologists_way_goes_by_keyboard_alone(tracked: Path, tmp_path: Path) -> None:
    with browser.served(tmp_path / "project") as served, browser.page_of(served) as page:

        def focused(name: str, key: str = "Tab") -> None:
            """Go to what has this name."""
            told = "(e => e.ariaLabel || e.labels?.[0]?.textContent || e.textContent)"
            for _ in range(150):
                if page.evaluate(f"{told}(document.activeElement)") == name:
                    return
                page.keyboard.press(key)
            raise AssertionError(f"{key} does not reach {name!r}")

        def press(name: str, key: str = "Tab") -> None:
            focused(name, key)
            page.keyboard.press("Enter")

        press("hexapod")
        page.locator(".pkmcal-view.moves").wait_for()
        press("3 Measure", "Shift+Tab")
        page.locator("main.measure h1").wait_for()
        page.set_input_files("input[type=file]", [tracked / "tracker.csv", tracked / "log.csv"])
        page.locator("li", has_text="log.csv").wait_for()
        press("remove tracker.csv")  # which leaves the log alone, and comes back as the second
        press("is the controller’s log")
        page.locator("li", has_text="log.csv: the controller’s log").wait_for()
        page.set_input_files("input[type=file]", tracked / "tracker.csv")
        page.locator("pre", has_text="90 measured positions").wait_for()
        press("Calibrate")
        fits(page, 1)
        before = (served.folder / "project.toml").read_bytes()
        for count, line in ((2, 19), (3, 54)):
            if count == 2:
                first = page.locator("tr[id] input").first.get_attribute("aria-label")
                assert first is not None
                focused(first)
            focused(f"use tracker.csv line {line}", "ArrowDown" if count == 2 else "ArrowUp")
            page.keyboard.press("Space")
            fits(page, count)
        assert page.locator("tr.odd").count() == 0
        assert page.locator("tr.out td:last-child").all_inner_texts() == ["left out"] * 2
        for count in (4, 5):
            press("Undo", "Shift+Tab")
            fits(page, count)
        assert (served.folder / "project.toml").read_bytes() == before


def test_a_list_is_one_stop_of_the_keyboard_and_arrows_lead_through_it(tmp_path: Path) -> None:
    with browser.served(tmp_path / "project") as served, browser.page_of(served) as page:
        page.set_input_files("input[type=file]", PRINTER)
        page.get_by_role("button", name="Calibrate with what it has stored").click()
        fits(page, 1)
        here = "document.activeElement.ariaLabel"
        boxes = "[...document.querySelectorAll('tr[id] input')]"
        names = page.evaluate(f"{boxes}.map(e => e.ariaLabel)")
        shows = [name.replace("use", "show", 1) for name in names]
        page.locator("tr[id] input").first.focus()
        for key, label in (
            ("ArrowDown", names[1]), ("ArrowRight", shows[1]),
            ("ArrowRight", shows[1]), ("Control+End", shows[-1]),
            ("ArrowLeft", names[-1]), ("ArrowDown", names[-1]), ("PageUp", names[-11]),
        ):  # fmt: skip
            page.keyboard.press(key)
            assert page.evaluate(here) == label, key
        page.keyboard.press("Tab")
        assert not page.evaluate("!!document.activeElement.closest('tr[id]')")
        page.keyboard.press("Shift+Tab")
        assert page.evaluate(here) == names[-11]  # where one was


def test_what_is_touched_is_large_enough_but_in_tables(tmp_path: Path) -> None:
    viewport = {"width": 390, "height": 844}
    small = """() => [...document.querySelectorAll('button, select, input, summary, .button')]
      .filter(one => one.offsetParent && !one.closest('table, .pkmcal-view'))
      .map(one => one.closest('label.tick, label.field') ?? one)
      .filter(one => { const { width, height } = one.getBoundingClientRect()
        return Math.min(width, height) > 1 && height < 34 })
      .map(one => one.outerHTML.slice(0, 120))"""
    with (
        browser.served(tmp_path / "project") as served,
        browser.page_of(served, viewport=viewport) as page,
    ):
        page.set_input_files("input[type=file]", PRINTER)
        page.get_by_role("button", name="Calibrate with what it has stored").click()
        fits(page, 1)
        for step in ("1 Machine", "2 Plan", "3 Measure", "4 Result", "5 Take away"):
            page.get_by_role("button", name=step, exact=True).click()
            page.locator(f"main.{page.evaluate('workbench.step')} h1").wait_for()
            page.wait_for_timeout(1500)
            assert page.evaluate(small) == [], step
