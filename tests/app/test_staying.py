"""Nobody gets lost in the window, and nothing that was typed or given is lost."""

from __future__ import annotations

import shutil
import signal
from pathlib import Path
from typing import Any

import pytest

import pkmcal as pk

pytest.importorskip("starlette", reason="the extra app is not installed")
pytest.importorskip("uvicorn", reason="the extra app is not installed")

from . import browser
from .test_flows import PRINTER, commands, fits

DROP = """([name, text]) => {
  const data = new DataTransfer()
  data.items.add(new File([text], name))
  const settings = { dataTransfer: data, bubbles: true, cancelable: true }
  document.body.dispatchEvent(new DragEvent('drop', settings))
}"""
POINTS = "Point;X;Y;Z;Quality\n" + "".join(f"P{i};{i};2;800;1\n" for i in range(4))


def drop(page: Any, name: str, text: str) -> None:
    """Drop a file somewhere in the window, not on the place for files."""
    page.evaluate(DROP, [name, text])


def take_hexapod(page: Any) -> None:
    page.get_by_role("button", name="hexapod", exact=True).click()
    page.locator(".pkmcal-view.moves").wait_for()


def test_measurements_that_are_dropped_beside_the_machine_leave_it_there(tmp_path: Path) -> None:
    with browser.served(tmp_path / "project") as served, browser.page_of(served) as page:
        take_hexapod(page)
        drop(page, "t.csv", POINTS)
        page.locator("#said", has_text="t.csv: measurements").wait_for()
        # the browser did not open it
        assert page.url == f"http://127.0.0.1:{served.port}/#machine"
        text = (served.folder / "project.toml").read_text()
        assert 'builtin = "hexapod"' in text and 'files = ["t.csv"]' in text


def test_two_files_of_machines_are_both_told_of_and_either_can_be_had(tmp_path: Path) -> None:
    for name in ("first", "second"):
        pk.load("hexapod").save(tmp_path / f"{name}.toml")
    with browser.served(tmp_path / "project") as served, browser.page_of(served) as page:
        files = [tmp_path / "first.toml", tmp_path / "second.toml"]
        page.set_input_files("input[type=file]", files)
        page.locator("#said", has_text="second.toml is kept in the project").wait_for()
        page.get_by_role("button", name="second.toml", exact=True).click()
        page.locator("#said", has_text="machine: second.toml").wait_for()
        assert 'file = "second.toml"' in (served.folder / "project.toml").read_text()


def test_the_firmware_is_asked_for_where_a_file_does_not_show_it(tmp_path: Path) -> None:
    with browser.served(tmp_path / "project") as served, browser.page_of(served) as page:
        drop(page, "delta.g", "M665 L330 R120 H300 B100\nM666 X-0.1 Y0.2 Z0\n")
        page.get_by_role("alert").filter(has_text="it does not show whose file it is").wait_for()
        firmware = page.get_by_label("delta.g is of")
        firmware.focus()
        firmware.select_option("reprap")
        page.locator(".pkmcal-view.moves").wait_for()
        assert page.evaluate("document.activeElement.value") == "reprap"
        assert "--from reprap" in page.locator("#terminal pre").inner_text()


def test_a_long_name_of_a_file_makes_no_page_wider_than_its_window(tmp_path: Path) -> None:
    size = {"width": 320, "height": 640}
    with (
        browser.served(tmp_path / "project") as served,
        browser.page_of(served, viewport=size) as page,
    ):
        take_hexapod(page)
        drop(page, "without_any_space_" * 5 + ".csv", POINTS)
        page.locator("#said", has_text="measurements").wait_for()
        page.get_by_role("button", name="3 Measure").click()
        page.get_by_label("Quality is", exact=True).wait_for()
        assert page.evaluate("document.documentElement.scrollWidth") == 320


def test_headings_are_named_one_after_the_other_without_losing_the_place(tmp_path: Path) -> None:
    with browser.served(tmp_path / "project") as served, browser.page_of(served) as page:
        take_hexapod(page)
        drop(page, "t.csv", POINTS)
        page.get_by_role("button", name="3 Measure").click()
        quality = page.get_by_label("Quality is", exact=True)
        quality.wait_for()
        quality.evaluate("field => { window.kept = field }")
        quality.fill("leave out")
        quality.press("Tab")  # it is read again
        page.locator("#terminal pre", has_text="--ignore Quality").wait_for()
        assert page.evaluate("document.activeElement.ariaLabel") == "unit of Quality"
        page.get_by_label("X is", exact=True).focus()
        page.keyboard.type("q1")
        page.get_by_label("units of columns that state none").evaluate("field => field.onchange()")
        page.wait_for_timeout(1500)  # read again while something is typed
        assert page.get_by_label("X is", exact=True).input_value() == "q1"
        assert page.evaluate("window.kept.isConnected")


def test_a_row_that_is_ticked_keeps_its_place_and_the_focus(tmp_path: Path) -> None:
    with browser.served(tmp_path / "project") as served, browser.page_of(served) as page:
        page.set_input_files("input[type=file]", PRINTER)
        page.get_by_role("button", name="Calibrate with what it has stored").click()
        fits(page, 1)
        rows = "[...document.querySelectorAll('tr[id]')].map(row => row.id)"
        before = page.evaluate(rows)
        third = page.locator("tr[id] input").nth(2)
        third.focus()
        for count, checked in ((2, False), (3, True)):
            page.keyboard.press("Space")
            fits(page, count)
            assert page.evaluate(rows) == before
            assert third.is_checked() is checked
            assert third.evaluate("box => box === document.activeElement")
        page.get_by_label("outliers").focus()
        page.get_by_label("outliers").select_option("huber")
        fits(page, 4)
        assert page.evaluate("document.activeElement.value") == "huber"


def test_a_certificate_that_is_being_written_outlives_other_changes(tmp_path: Path) -> None:
    with browser.served(tmp_path / "project") as served, browser.page_of(served) as page:
        page.set_input_files("input[type=file]", PRINTER)
        page.get_by_role("button", name="Calibrate with what it has stored").click()
        fits(page, 1)
        page.get_by_role("button", name="5 Take away").click()
        page.get_by_label("serial").fill("A 17")
        page.get_by_label("operator").fill("me")
        others = page.get_by_label("for another controller")
        offered = others.locator("option").evaluate_all("all => all.map(one => one.value)")
        assert {"c", "reprap", "linuxcnc"} < set(offered)
        assert not {"urdf", "dh", "ur", "klipper"} & set(offered)  # of arms; its own
        others.select_option("c")
        page.locator("button[data-file='machine.h']").wait_for()
        assert page.get_by_label("serial").input_value() == "A 17"
        page.get_by_role("button", name="Write the report").click()
        page.locator("button[data-file='report/report.html']").wait_for()
        page.get_by_role("button", name="remove c", exact=True).click()
        page.locator("button[data-file='machine.h']").wait_for(state="detached")
        assert "export" not in (served.folder / "project.toml").read_text()
        page.reload()
        page.locator("body[data-ready]").wait_for(state="attached")
        page.get_by_role("button", name="5 Take away").click()
        page.locator("button[data-file='new.cfg']").wait_for()
        assert page.get_by_label("operator").input_value() == "me"


def test_a_plan_is_made_again_while_its_fields_change(tmp_path: Path) -> None:
    with browser.served(tmp_path / "project") as served, browser.page_of(served) as page:
        page.set_input_files("input[type=file]", PRINTER)
        page.locator(".pkmcal-view.moves").wait_for()
        page.get_by_role("button", name="2 Plan").click()
        count = page.get_by_label("poses", exact=True)
        count.press_sequentially("12", delay=20)
        page.locator("p.lead", has_text="measure 12 poses").wait_for()
        count.fill("8")
        page.locator("p.lead", has_text="measure 8 poses").wait_for()
        assert count.evaluate("field => field === document.activeElement")
        page.get_by_label("within, such as z=0:300").fill("radius=0:60")
        page.locator("#terminal pre", has_text="--within radius=0:60").wait_for()
        page.get_by_label("noise of the actuators, mm or rad").fill("0.5")
        page.locator("#terminal pre", has_text="--actuator-noise 0.5").wait_for()
        page.locator("p.lead", has_text="measure 8 poses").wait_for()
        (argv,) = commands(page, "2 Plan")
        assert "--actuator-noise" in argv and "radius=0:60" in argv
        page.emulate_media(media="print")
        sheet = page.locator(".sheet table")
        sheet.wait_for()
        assert not page.locator("header").is_visible()
        heads = sheet.locator("th").all_inner_texts()
        assert heads == ["pose", "x [mm]", "y [mm]", "z [mm]"]
        assert sheet.locator("td.box").count() == 8


def test_a_server_that_ends_is_told_in_words(tmp_path: Path) -> None:
    with browser.served(tmp_path / "project") as served, browser.page_of(served, "ERR_") as page:
        take_hexapod(page)
        served.process.terminate()
        page.locator("#trouble", has_text=f"pkmcal app {served.folder}").wait_for()


@pytest.mark.skipif(not hasattr(signal, "SIGSTOP"), reason="halts it as a terminal does")
def test_a_server_that_is_halted_is_told_until_it_goes_on(tmp_path: Path) -> None:
    with browser.served(tmp_path / "project") as served, browser.page_of(served) as page:
        take_hexapod(page)
        served.process.send_signal(signal.SIGSTOP)
        page.get_by_role("button", name="tricept", exact=True).click()
        page.locator("#trouble", has_text="goes on there by fg").wait_for()
        served.process.send_signal(signal.SIGCONT)
        page.locator("h2", has_text="tricept").first.wait_for()
        assert not page.locator("#trouble").is_visible()


def test_what_is_dropped_twice_with_another_content_is_kept_twice(tmp_path: Path) -> None:
    with browser.served(tmp_path / "project") as served, browser.page_of(served) as page:
        take_hexapod(page)
        drop(page, "t.csv", POINTS)
        page.locator("#said", has_text="t.csv: measurements").wait_for()
        drop(page, "t.csv", POINTS.replace("800", "801"))
        page.locator("#said", has_text="the one before is kept as t.1.csv").wait_for()
        assert (served.folder / "t.1.csv").read_text() == POINTS


def test_a_project_that_is_edited_beside_the_window_is_shown_as_it_is(tmp_path: Path) -> None:
    with browser.served(tmp_path / "project") as served, browser.page_of(served, "409") as page:
        take_hexapod(page)
        file = served.folder / "project.toml"
        file.write_text(file.read_text().replace("hexapod", "linear-delta"))
        page.get_by_role("button", name="tricept", exact=True).click()
        page.locator("#trouble", has_text="do it again").wait_for()
        page.locator("h2", has_text="linear delta").first.wait_for()
        assert "linear-delta" in file.read_text()


def test_what_was_edited_beside_the_window_is_what_all_of_a_screen_shows(tmp_path: Path) -> None:
    """A fit takes it over, and so do boxes, choices and the lines for a terminal."""
    with browser.served(tmp_path / "project") as served, browser.page_of(served) as page:
        page.set_input_files("input[type=file]", PRINTER)
        page.get_by_role("button", name="Calibrate with what it has stored").click()
        fits(page, 1)
        file = served.folder / "project.toml"
        file.write_text(file.read_text() + '\n[fit]\ndrop = ["3"]\nholdout = "0.2"\n')
        page.get_by_role("button", name="4 Result").click()
        page.locator("#terminal pre", has_text="--holdout 0.2 --drop 3").wait_for()
        page.locator(".verdict .state", has_text="8 held-out points").wait_for()
        page.locator("main.result[aria-busy=false]").wait_for()
        assert page.get_by_label("hold out").input_value() == "0.2"
        assert not page.locator("tr[id='row 3'] input").is_checked()


def test_who_comes_back_from_an_editor_sees_what_was_written(tmp_path: Path) -> None:
    with browser.served(tmp_path / "project") as served, browser.page_of(served) as page:
        take_hexapod(page)
        file = served.folder / "project.toml"
        file.write_text(file.read_text().replace("hexapod", "linear-delta"))
        page.evaluate("dispatchEvent(new Event('focus'))")
        page.locator("h2", has_text="linear delta").first.wait_for()


def test_a_project_of_the_former_folder_is_the_same(tmp_path: Path) -> None:
    with browser.served(tmp_path / "project") as served, browser.page_of(served) as page:
        page.set_input_files("input[type=file]", PRINTER)
        page.get_by_role("button", name="Calibrate with what it has stored").click()
        fits(page, 1)
        said = page.locator(".verdict .state").inner_text()
    shutil.copytree(served.folder, tmp_path / "moved")
    with browser.served(tmp_path / "moved") as again, browser.page_of(again) as page:
        fits(page, 1)
        assert page.locator(".verdict .state").inner_text() == said


def test_a_plan_can_be_taken_along_as_a_program(tmp_path: Path) -> None:
    with browser.served(tmp_path / "project") as served, browser.page_of(served, "400") as page:
        page.set_input_files("input[type=file]", PRINTER)
        page.locator(".pkmcal-view.moves").wait_for()
        page.get_by_role("button", name="2 Plan").click()
        assert not page.get_by_label("it waits at each, s").is_visible()
        page.get_by_label("poses", exact=True).fill("8")
        page.get_by_label("a program, too").select_option("klipper")
        with page.expect_download() as taken:
            page.get_by_role("button", name="Save plan/poses.gcode").click()
        assert Path(taken.value.path()).read_text().count("\nPROBE\n") == 8
        page.get_by_label("what the instrument reads").select_option("height")
        page.get_by_label("it waits at each, s").fill("x")
        page.locator("#trouble", has_text="found 'x'").wait_for()
        page.get_by_label("it waits at each, s").fill("20")
        page.locator("#terminal pre", has_text="--gcode klipper --dwell 20").wait_for()
        page.locator("section:not([inert]) p.lead", has_text="measure 8 poses").wait_for()
        with page.expect_download() as taken:
            page.get_by_role("button", name="Save plan/poses.gcode").click()
        assert Path(taken.value.path()).read_text().count("G4 P20000") == 8
