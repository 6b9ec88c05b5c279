"""The pages are true: their blocks are run, their links, files and tests are there."""

from __future__ import annotations

import re
import runpy
from dataclasses import fields
from pathlib import Path
from pkgutil import resolve_name

import pytest

import pkmcal as pk
from pkmcal.files.toml_lines import tomllib
from pkmcal.readings import Reading

from .pages import DOCS, PAGES, ROOT, MissingLog, Session, blocks, name_of, prose

LANGUAGES = {"c", "python", "console", "text", "toml", "sh", "{eval-rst}", "{toctree}"}
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
every_page = pytest.mark.parametrize("page", PAGES, ids=name_of)
every_page_of_today = pytest.mark.parametrize(  # the list of changes names what is gone
    "page", [page for page in PAGES if page.name != "CHANGELOG.md"], ids=name_of
)


def assert_same(printed: str, shown: str) -> None:
    """The same text, and numbers that differ by one in their last digit at most.

    Or by 1e-8 of the largest number of their line: a search ends there on each processor.
    """
    assert NUMBER.sub("0", printed).split() == NUMBER.sub("0", shown).split(), printed
    for now, before in zip(_lines_with_numbers(printed), _lines_with_numbers(shown), strict=True):
        reached = 1e-8 * max(abs(float(b)) for b in before)
        for a, b in zip(now, before, strict=True):
            places = len(b.partition("e")[0].partition(".")[2])
            power = int(b.partition("e")[2] or 0)
            last = 1.001 * 10.0 ** (power - places)
            assert abs(float(a) - float(b)) <= max(last, reached), (a, b)


def _lines_with_numbers(text: str) -> list[list[str]]:
    """Return the numbers of each line that has some."""
    return [found for found in map(NUMBER.findall, text.splitlines()) if found]


def same(printed: str, shown: str) -> bool:
    try:
        assert_same(printed, shown)
    except AssertionError:
        return False
    return True


def test_comparison_sees_a_wrong_digit_and_a_wrong_word() -> None:
    assert_same("rms 0.0259 mm\n", "rms 0.0260 mm")
    for printed in ("rms 0.0257 mm", "rms 0.0259 um", "rms mm", "rms 0.0259 mm 1"):
        assert not same(printed, "rms 0.0259 mm")


@every_page
def test_every_block_runs_and_prints_what_it_shows(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    try:
        session = Session(page, tmp_path)
    except MissingLog as missing:
        pytest.skip(str(missing))
    for block, now in session.printed():
        assert_same(now, block.text)


@every_page
def test_every_block_is_of_a_kind_that_is_known(page: Path) -> None:
    assert {block.language for block in blocks(page)} <= LANGUAGES


# --- what pages name -----------------------------------------------------------------------------


def anchors(page: Path) -> set[str]:
    """Anchors of the headings as they are made of them: lower case, words joined by hyphens."""
    headings = re.findall(r"^#{1,6} (.*)$", prose(page), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", h.lower()).strip().replace(" ", "-") for h in headings}


@every_page
def test_links_lead_to_files_and_headings(page: Path) -> None:
    for link in re.findall(r"\]\(([^)\s]+)\)", prose(page)):
        if link.startswith(("http:", "https:")):
            continue
        file, _, anchor = link.partition("#")
        target = (page.parent / file).resolve() if file else page
        assert target.exists(), link
        assert ROOT in target.parents, link
        if anchor:
            assert anchor in anchors(target), link


@every_page_of_today
def test_files_named_exist(page: Path) -> None:
    """In the root or beside the page; paths that a page's own commands make are left out."""
    made = set(re.findall(r"\S+", "\n".join(b.text for b in blocks(page))))
    for name in re.findall(r"`([\w.-]+(?:/[\w.*-]+)+/?)`", prose(page)):
        folder = name.partition("/")[0]
        known = (ROOT / folder).is_dir() or (page.parent / folder).is_dir()
        if known and name not in made:
            found = [*ROOT.glob(name.rstrip("/")), *page.parent.glob(name.rstrip("/"))]
            assert found or folder == "build", name


@every_page_of_today
def test_modules_named_exist(page: Path) -> None:
    for name in re.findall(r"`(pkmcal(?:\.\w+)+)`", prose(page)):
        resolve_name(name)


@every_page
def test_tests_that_are_named_exist(page: Path) -> None:
    sources = list((ROOT / "tests").rglob("test_*.py"))
    defined = {
        name
        for path in sources
        for name in re.findall(r"^def (test_\w+)\(", path.read_text(encoding="utf-8"), re.MULTILINE)
    }
    text = page.read_text(encoding="utf-8")
    files = {path.name for path in sources}
    assert set(re.findall(r"`(test_\w+)`", text)) <= defined
    assert set(re.findall(r"(test_\w+\.py)`", text)) <= files


@pytest.mark.parametrize(("page", "least"), [("architecture.md", 20), ("extending.md", 13)])
def test_walks_quote_lines_that_stand_in_their_files(page: str, least: int) -> None:
    text = (DOCS / page).read_text(encoding="utf-8")
    rows = re.findall(r"^\| `([^`]+)` \| `([^`]+)` \| ", text, re.MULTILINE)
    assert len(rows) >= least
    for file, line in rows:
        assert line in (ROOT / file).read_text(encoding="utf-8"), (file, line)


def test_the_page_for_those_who_add_a_reading_names_all_that_its_class_may_state() -> None:
    text = (DOCS / "extending.md").read_text(encoding="utf-8")
    stated = {name for name, of in Reading.__annotations__.items() if "ClassVar" in of}
    assert len(stated) > 20
    assert {name for name in stated if f"`{name}`" not in text} <= {"name", "components"}


def test_rooms_of_the_architecture_are_those_of_the_contract() -> None:
    text = (DOCS / "architecture.md").read_text(encoding="utf-8")
    contract = re.search(
        r"^layers = \[(.*?)^\]", (ROOT / "pyproject.toml").read_text(), re.M | re.S
    )
    assert contract
    stated = [re.split(r" \| ", layer) for layer in re.findall(r'"(.*)"', contract[1])]
    shown = [
        re.findall(r"`(\w+)(?:\.py|/)`", cell)
        for cell in re.findall(r"^\| \d+ \| ([^|]+) \|", text, re.MULTILINE)
    ]
    assert [sorted(floor) for floor in stated] == [sorted(floor) for floor in shown]


def test_picture_of_the_floors_is_that_of_the_contract() -> None:
    drawn = runpy.run_path(str(DOCS / "architecture" / "draw.py"))
    assert drawn["svg"]() == (DOCS / "architecture" / "floors.svg").read_text(encoding="utf-8")


def test_gallery_has_a_picture_and_a_page_of_twelve_machines() -> None:
    folder = DOCS / "gallery"
    machines = tomllib.loads((folder / "machines.toml").read_text(encoding="utf-8"))
    text = (DOCS / "gallery.md").read_text(encoding="utf-8")
    assert len(machines) == 12
    assert re.findall(r":target: gallery/(.*)\.html$", text, re.MULTILINE) == list(machines)
    for stem, source in machines.items():
        assert f"gallery/{stem}.png" in text
        assert 2_000 < (folder / f"{stem}.png").stat().st_size < 30_000
        named = source in pk.machines()
        assert named or (ROOT / source).exists()


# --- the reference, the glossary, the citation ---------------------------------------------------


def test_reference_has_every_public_name_once() -> None:
    text = "".join(page.read_text(encoding="utf-8") for page in (DOCS / "reference").glob("*.md"))
    shown = re.findall(r"^\.\. auto(?:class|function|module|data):: pkmcal\.(\w+)$", text, re.M)
    assert sorted(shown) == sorted(pk.__all__)


def test_attributes_of_the_glossary_exist() -> None:
    text = (DOCS / "glossary.md").read_text(encoding="utf-8")
    found = {*dir(pk.Identification), *(field.name for field in fields(pk.Identification))}
    owners = {"pk": set(dir(pk)), "robot": set(dir(pk.Robot)), "found": found}
    named = re.findall(r"`(pk|robot|found)\.(\w+)`", text)
    assert len(named) >= 20
    for owner, name in named:
        assert name in owners[owner], f"{owner}.{name}"


def test_citation_has_the_version_and_licence_of_the_package() -> None:
    project = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    for key in ("version", "license"):
        stated = re.search(rf'^{key} = "(.*)"$', project, re.MULTILINE)
        assert stated
        assert re.search(rf"^{key}: {re.escape(stated[1])}$", citation, re.MULTILINE), key
