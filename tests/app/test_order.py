"""Answers that come late, or in another order, are neither shown nor counted, and nothing is lost.

What a page asks for is held here and let go by the test, so that every order is certain.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("starlette", reason="the extra app is not installed")
pytest.importorskip("uvicorn", reason="the extra app is not installed")
pytest.importorskip("playwright.sync_api", reason="no Playwright: make test-app")
from playwright.sync_api import Error

from . import browser
from .test_flows import PRINTER, fits, tracked
from .test_guard import ask
from .test_staying import drop, take_hexapod

__all__ = ["tracked"]  # a fixture
ANSWERED = 1000  # ms in which nothing more happens than has happened


class Held:
    """Requests of a page that wait, or their answers, in the order in which they were made."""

    def __init__(self, page: Any, path: str, method: str, answered: bool) -> None:
        self._page, self._path, self._method = page, f"**{path}", method
        self._answered, self._open = answered, False
        self.waiting: list[tuple[Any, Any]] = []
        page.route(self._path, self._hold)

    def _hold(self, route: Any) -> None:
        if route.request.method == self._method and not self._open:
            self.waiting.append((route, route.fetch() if self._answered else None))
        else:
            route.continue_()

    def wait(self, count: int = 1) -> None:
        """Wait until so many were made."""
        for _ in range(600):
            if len(self.waiting) >= count:
                return
            self._page.wait_for_timeout(50)
        raise AssertionError(f"{self._path} was asked {len(self.waiting)} times")

    def let_go(self) -> None:
        """Let all go that wait, and hold no more."""
        self._open = True
        for route, answer in self.waiting:
            with contextlib.suppress(Error):  # the page has given it up
                if answer is None:
                    route.continue_()
                else:
                    route.fulfill(response=answer)


@contextlib.contextmanager
def held(page: Any, path: str, method: str = "POST", answered: bool = False) -> Iterator[Held]:
    """Hold requests for a path, or the answers to them, until the end of the block."""
    requests = Held(page, path, method, answered)
    yield requests
    requests.let_go()


def change_elsewhere(served: browser.Served, **parts: Any) -> None:
    """Change the project as another tab does."""
    state = json.loads(ask(served, "GET", "/api/state")[2])
    table = {**state["state"], **parts}
    body = json.dumps({"state": table, "version": state["version"]}).encode()
    assert ask(served, "POST", "/api/state", body)[0] == 200


def calibrated(page: Any) -> None:
    page.set_input_files("input[type=file]", PRINTER)
    page.get_by_role("button", name="Calibrate with what it has stored").click()
    fits(page, 1)


def test_a_project_that_changes_while_a_screen_is_begun_does_not_begin_it_anew(
    tmp_path: Path,
) -> None:
    with browser.served(tmp_path / "project") as served, browser.page_of(served) as page:
        page.set_input_files("input[type=file]", PRINTER)
        calibrate = page.get_by_role("button", name="Calibrate with what it has stored")
        calibrate.wait_for()
        with held(page, "/api/run/fit") as first:
            calibrate.click()
            first.wait()
            page.evaluate("window.kept = document.getElementById('main').firstElementChild")
            change_elsewhere(served, fit={"drop": ["3"]})
            page.locator("#terminal pre", has_text="--drop 3").wait_for()
        page.locator("tr.out").wait_for()
        page.wait_for_timeout(ANSWERED)
        assert page.locator("main").get_attribute("data-fits") == "1"
        assert page.evaluate("window.kept.isConnected")


def test_a_project_that_changes_while_a_screen_is_fetched_is_shown_as_it_is_then(
    tmp_path: Path,
) -> None:
    with browser.served(tmp_path / "project") as served, browser.page_of(served) as page:
        page.set_input_files("input[type=file]", PRINTER)
        calibrate = page.get_by_role("button", name="Calibrate with what it has stored")
        calibrate.wait_for()
        with held(page, "/result.js", "GET") as script:
            calibrate.click()
            script.wait()
            change_elsewhere(served, fit={"drop": ["3"]})
            page.locator("#terminal pre", has_text="--drop 3").wait_for()
        page.locator("tr.out").wait_for()
        page.wait_for_timeout(ANSWERED)
        assert page.locator("main").get_attribute("data-fits") == "1"


def test_files_that_are_asked_for_one_after_the_other_all_change_what_the_one_before_left(
    tracked: Path, tmp_path: Path
) -> None:
    with browser.served(tmp_path / "project") as served, browser.page_of(served) as page:
        take_hexapod(page)
        page.get_by_role("button", name="3 Measure").click()
        page.set_input_files("input[type=file]", [tracked / "tracker.csv", tracked / "log.csv"])
        remove = page.get_by_role("button", name="remove tracker.csv")
        log = page.locator("li", has_text="log.csv").get_by_role(
            "button", name="is the controller’s log"
        )
        remove.wait_for()
        with held(page, "/api/state") as changes:
            remove.click()
            changes.wait()
            log.click()
        page.locator("li", has_text="log.csv: the controller’s log").wait_for()
        assert page.locator("li", has_text="tracker.csv").count() == 0
        assert "tracker.csv" not in (served.folder / "project.toml").read_text()


def test_files_that_are_removed_while_they_are_read_are_not_shown(
    tracked: Path, tmp_path: Path
) -> None:
    with browser.served(tmp_path / "project") as served, browser.page_of(served) as page:
        take_hexapod(page)
        page.get_by_role("button", name="3 Measure").click()
        with held(page, "/api/run/look") as looks:
            page.set_input_files("input[type=file]", tracked / "log.csv")
            looks.wait()
            page.get_by_role("button", name="remove log.csv").click()
            page.locator("ul.files li").wait_for(state="detached")
        page.wait_for_timeout(ANSWERED)
        assert page.get_by_role("button", name="Calibrate", exact=True).count() == 0
        assert page.locator("main pre").count() == 0


def test_a_screen_that_was_left_takes_neither_the_picture_nor_words_of_the_next(
    tmp_path: Path,
) -> None:
    with browser.served(tmp_path / "project") as served, browser.page_of(served) as page:
        calibrated(page)
        for step, operation in (("1 Machine", "machine"), ("5 Take away", "out")):
            with held(page, f"/api/run/{operation}") as left:
                page.get_by_role("button", name=step).click()
                left.wait()
                page.get_by_role("button", name="3 Measure").click()
                page.locator("main.measure h1").wait_for()
            page.wait_for_timeout(ANSWERED)
            assert page.evaluate("workbench.picture") is None
            assert page.locator("main.measure pre", has_text="41 measured heights").count() == 1
        page.get_by_role("button", name="4 Result").click()
        page.locator(".pkmcal-view.moves").wait_for()
        assert page.evaluate("workbench.picture.isConnected")


def test_files_that_are_dropped_while_others_are_looked_at_are_taken_with_them(
    tmp_path: Path,
) -> None:
    with browser.served(tmp_path / "project") as served, browser.page_of(served) as page:
        take_hexapod(page)
        with held(page, "/api/run/take") as takes:
            drop(page, "one.csv", "x [mm],y [mm],z [mm]\n1,2,3\n")
            takes.wait()
            drop(page, "two.csv", "x [mm],y [mm],z [mm]\n1,2,4\n")
            page.wait_for_timeout(500)
        page.locator("#said", has_text="two.csv: measurements").wait_for()
        assert 'files = ["one.csv", "two.csv"]' in " ".join(
            (served.folder / "project.toml").read_text().split()
        ).replace("[ ", "[").replace(", ]", "]")


def test_a_row_that_is_ticked_while_a_file_is_looked_at_stays_ticked(tmp_path: Path) -> None:
    with browser.served(tmp_path / "project") as served, browser.page_of(served) as page:
        calibrated(page)
        with held(page, "/api/run/take", answered=True) as takes:
            drop(page, "more.csv", "x [mm],y [mm],z [mm]\n1,2,3\n")
            takes.wait()
            page.locator("tr[id] input").first.click()
            page.wait_for_timeout(500)
        page.locator("#terminal pre", has_text="--drop").wait_for()
        page.wait_for_timeout(ANSWERED)
        text = (served.folder / "project.toml").read_text()
        assert "drop = " in text and "more.csv" in text


def test_undo_that_is_pressed_before_a_change_is_answered_takes_that_change_back(
    tmp_path: Path,
) -> None:
    with browser.served(tmp_path / "project") as served, browser.page_of(served) as page:
        calibrated(page)
        before = (served.folder / "project.toml").read_bytes()
        with held(page, "/api/state") as changes:
            page.locator("tr[id] input").first.click()
            changes.wait()
            page.get_by_role("button", name="Undo").click()
            page.wait_for_timeout(500)
        page.locator("tr[id]").first.locator("input:checked").wait_for()
        page.wait_for_timeout(ANSWERED)
        assert (served.folder / "project.toml").read_bytes() == before
        assert page.locator("tr.out").count() == 0
        assert not page.locator("#trouble").is_visible()


def test_a_state_that_is_answered_late_is_not_shown_in_place_of_a_newer_one(
    tmp_path: Path,
) -> None:
    with browser.served(tmp_path / "project") as served, browser.page_of(served, "409") as page:
        calibrated(page)
        with held(page, "/api/state", "GET", answered=True) as states:
            change_elsewhere(served, fit={"drop": ["3"]})
            states.wait()
            page.locator("tr[id] input").nth(1).click()  # too late
            page.locator("#trouble", has_text="do it again").wait_for()
            page.locator("tr.out").wait_for()
            page.locator("tr:not(.out)[id] input").first.click()
            page.locator("tr.out").nth(1).wait_for()
        page.wait_for_timeout(ANSWERED)
        assert page.locator("tr.out").count() == 2
        page.locator("tr:not(.out)[id] input").first.click()
        page.locator("tr.out").nth(2).wait_for()
        assert not page.locator("#trouble").is_visible()
