"""The report of a calibration: what it says, and what a real browser makes of it."""

from __future__ import annotations

import dataclasses
import hashlib
import html
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib import image

import pkmcal as pk
from pkmcal.calibration.identification import Identification
from pkmcal.report import contents as report_data
from pkmcal.report import report
from pkmcal.report.contents import verdict

from .. import browser
from ..simulated import altered, hexapod_poses

HOSTILE = "<img src=x onerror=alert(1)>&\"'$\\frac{"
FIGURES = ("points", "residuals", "machine", "correlation", "convergence", "accuracy", "iso0")
FILES = {"robot.toml": b"robot", "<b>tracker.csv": b"rows"}

# Writes the size of every figure into the title, which --dump-dom shows; not part of a report.
_MEASURE = """<script>
document.title = JSON.stringify({
  figures: [...document.querySelectorAll("svg.figure")].map(svg => {
    const box = svg.getBoundingClientRect();
    return [svg.getAttribute("aria-label"), box.width, box.height];
  }),
  page: document.documentElement.scrollWidth, window: window.innerWidth,
});
</script></body>"""


def calibrated(name: str = "hexapod", **options: Any) -> Identification:
    """A hexapod with one error, from repeated positions of two targets."""
    robot = pk.load("hexapod")
    robot = pk.Robot(dataclasses.replace(robot.model, name=name))
    poses = np.repeat(hexapod_poses(robot, 20, np.random.default_rng(0)), 3, axis=0)
    true = robot.replace({"offset1": 0.4, "offset4": -0.3})
    machine = pk.VirtualMachine(true, noise=0.01)
    return pk.identify(robot, machine.measure(robot.inverse(poses)), free="offset*", **options)


@pytest.fixture(scope="module")
def found() -> Identification:
    return calibrated(holdout=0.2)


@pytest.fixture(scope="module")
def folder(found: Identification, tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("report")
    found.report(made, FILES)
    return made


@pytest.fixture(scope="module")
def page(folder: Path) -> str:
    return (folder / "report.html").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def data(folder: Path) -> dict[str, Any]:
    return json.loads((folder / "report.json").read_text(encoding="utf-8"))


@pytest.mark.slow
def test_a_report_of_very_many_rows_is_no_larger_than_a_browser_shows(tmp_path: Path) -> None:
    robot, rng = pk.load("linear-delta"), np.random.default_rng(0)
    poses = np.pad(rng.uniform([-50, -50, 50], [50, 50, 150], (100_000, 3)), ((0, 0), (0, 3)))
    true = robot.replace({"offset1": robot.geometry["offset1"] + 0.3})
    measured = pk.VirtualMachine(true, noise=0.01).measure(robot.inverse(poses), "position")
    pk.identify(robot, measured, free="offset*").report(tmp_path)
    page = (tmp_path / "report.html").read_bytes()
    assert len(page) < 5_000_000
    assert b"1000 of 100000 rows drawn" in page
    data = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))
    assert len(data["points"]) == 100_000  # for programs: all of them


# --- what it says --------------------------------------------------------------------------------


def test_verdict_comes_first_and_names_the_held_out_error(
    found: Identification, page: str, data: dict[str, Any]
) -> None:
    state, sentence = verdict(found)
    assert state == "good"
    assert f"{found.holdout_rms:.3g} mm rms" in sentence
    assert data["verdict"] == sentence
    body = re.sub(r"<[^>]+>", " ", page[page.index("<body>") :])
    assert body.split(maxsplit=3)[:3] == ["Calibration", "of", "hexapod"]
    assert page.index(html.escape(sentence)) < page.index("<h2>")


@pytest.mark.parametrize(
    ("changes", "state", "words"),
    [
        ({"converged": False}, "bad", "Not calibrated: the least squares did not converge."),
        (
            {"holdout_unreached": "row 3 failed"},
            "doubtful",
            "Doubtful: holdout: row 3 failed; left out",
        ),
        ({"at_bounds": ("offset1",)}, "doubtful", "Doubtful: offset1 ended at a bound"),
        ({"holdout_off": np.empty(0)}, "good", "none was held out"),
    ],
)
def test_verdict_is_no_better_than_the_calibration(
    found: Identification, changes: dict[str, Any], state: str, words: str
) -> None:
    said = verdict(altered(found, **changes))
    assert said[0] == state and words in said[1]


def test_data_are_those_of_the_calibration(found: Identification, data: dict[str, Any]) -> None:
    assert data["calibration"]["rms"] == found.rms
    assert data["calibration"]["values"] == found.values.tolist()
    rows = data["points"]
    assert [row["row"] for row in rows] == found.rows.tolist()
    after = np.array([row["after"] for row in rows])
    np.testing.assert_allclose(after, np.linalg.norm(found.residuals[0], axis=1), atol=1e-12)
    assert np.sqrt(np.mean(after**2)) == pytest.approx(found.rms)
    before = np.array([row["before"] for row in rows])
    assert np.sqrt(np.mean(before**2)) == pytest.approx(found.rms_before, rel=1e-9)
    by_direction = {row["name"]: row["rms_after"] for row in data["directions"]}
    assert sum(rms**2 for rms in by_direction.values()) == pytest.approx(found.rms**2)


def test_history_begins_and_ends_with_the_misfit(found: Identification) -> None:
    assert found.history[0] == pytest.approx(found.rms_before)
    assert found.history[-1] == pytest.approx(found.rms, rel=1e-6)
    assert len(found.history) <= found.evaluations + 1


def test_held_out_distances_are_those_of_their_rms(found: Identification) -> None:
    assert len(found.holdout_off) == 12
    for off, rms in (
        (found.holdout_off, found.holdout_rms),
        (found.holdout_off_before, found.holdout_rms_before),
    ):
        assert np.sqrt(np.mean(off**2)) == pytest.approx(rms)


def test_repeatability_is_what_the_noise_makes_it(data: dict[str, Any]) -> None:
    (score,) = data["iso9283"]
    assert score["repeats"] == [3, 3] and score["poses"] == 16
    # of three points with noise σ: l̄ about 1.25 σ; 3 S_l is of the same size
    assert 0.01 < np.median(score["repeatability"]) < 0.06
    assert max(score["accuracy"]) < 0.1 * min(score["accuracy_before"])


def test_inputs_are_known_again_by_their_checksums(folder: Path, data: dict[str, Any]) -> None:
    digest = hashlib.sha256(b"robot").hexdigest()
    assert data["inputs"]["robot.toml"] == digest
    for name in ("report.html", "robot.toml"):
        assert digest in (folder / name).read_text(encoding="utf-8")
    assert data["version"] == pk.__version__


def test_robot_beside_it_is_the_calibrated_one(found: Identification, folder: Path) -> None:
    written = pk.load(folder / "robot.toml")
    np.testing.assert_array_equal(written.geometry.values, found.robot.geometry.values)


def test_same_calibration_gives_the_same_bytes(
    found: Identification, folder: Path, tmp_path: Path
) -> None:
    found.report(tmp_path, FILES)
    for path in folder.iterdir():
        assert (tmp_path / path.name).read_bytes() == path.read_bytes(), path.name


def test_page_asks_nothing_of_the_network(page: str) -> None:
    assert "default-src 'none'" in page
    addresses = set(re.findall(r"https?://[^\"'<> ]+", page))
    assert addresses <= {"http://www.w3.org/2000/svg", "http://www.w3.org/1999/xlink"}
    assert set(re.findall(r"(?:src|href)=\"([^\"#]{1,5})", page)) <= {"data:"}


def test_ids_are_there_once_and_references_lead_to_them(page: str) -> None:
    ids = re.findall(r' id="([^"]+)"', page)
    assert len(ids) == len(set(ids)) > 50
    used = set(re.findall(r"(?:url\(|href=\")#([^\")]+)", page))
    assert used and used <= set(ids)


@pytest.mark.parametrize("kind", ["pose", "height", "distance"])
def test_every_kind_of_measurement_has_a_report(kind: str, tmp_path: Path) -> None:
    robot = pk.load("hexapod")
    q = robot.inverse(hexapod_poses(robot, 15, np.random.default_rng(2)))
    target = {"target": [400.0, 300.0, -100.0]} if kind == "distance" else {}
    measured = pk.VirtualMachine(robot.replace({"offset2": 0.2})).measure(q, kind, **target)
    pk.identify(robot, measured, free="offset*").report(tmp_path)
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert ("ISO 9283" in text) == (kind == "pose")


def test_an_arm_has_a_report(tmp_path: Path) -> None:
    arm = pk.load("3r")
    q = np.random.default_rng(0).uniform(-1, 1, (40, 3))
    true = arm.replace(np.full((3, 6), 1e-3))
    places = true.forward(q)[:, :3, 3]
    found = pk.identify(arm, pk.Measurements(q, places, sigma=0.01), prior=0.5)
    found.report(tmp_path)
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "joint positions drawn within the range" in text
    assert json.loads((tmp_path / "report.json").read_text())["calibration"]["robot"]["geometry"]


def test_unidentifiable_parameters_are_named(tmp_path: Path) -> None:
    robot = pk.load("hexapod")
    q = robot.inverse(hexapod_poses(robot, 20, np.random.default_rng(3)))
    measured = pk.VirtualMachine(robot, noise=0.01).measure(q, "height")
    found = pk.identify(robot, measured, free=["offset*", "base*.x"])
    assert found.rank < len(found.free)
    status = {row["name"]: row["knowledge"] for row in report_data.parameters(found)}
    unidentifiable = [
        n for n, s in zip(found.free, found.stderr, strict=True) if not np.isfinite(s)
    ]
    assert unidentifiable
    assert all(status[name] == "not identifiable" for name in unidentifiable)
    found.report(tmp_path)
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert all(html.escape(words) in text for words in found.unidentifiable)


# --- in a browser --------------------------------------------------------------------------------


def measured_copy(page: str, to: Path) -> Path:
    """The page with a script that measures its figures, which its own policy forbids."""
    policy = r'<meta http-equiv="Content-Security-Policy"[^>]*>'
    to.write_text(re.sub(policy, "", page).replace("</body>", _MEASURE), encoding="utf-8")
    return to


@pytest.mark.parametrize("width", [1000, 420])
def test_every_figure_is_laid_out_and_nothing_is_cut_off(
    page: str, tmp_path: Path, width: int
) -> None:
    seen = browser.dump(measured_copy(page, tmp_path / "page.html"), width)
    title = re.search(r"<title>(.*?)</title>", seen.dom, re.DOTALL)
    assert title
    laid_out = json.loads(html.unescape(title[1]))
    assert len(laid_out["figures"]) == len(FIGURES)
    for name, wide, high in laid_out["figures"]:
        assert wide > min(300, 0.8 * width) and high > 80, name
    assert laid_out["page"] <= laid_out["window"]


def test_console_is_silent_and_the_document_whole(folder: Path) -> None:
    seen = browser.dump(folder / "report.html")
    assert seen.console == []
    for name in FIGURES:
        assert f'id="{name}-figure_1"' in seen.dom
    assert seen.dom.count("<script") == 1  # what moves the machine, named by its hash


def test_console_of_a_faulty_page_is_not_silent(tmp_path: Path) -> None:
    (tmp_path / "page.html").write_text("<script>console.error('x'); nothing()</script>")
    assert len(browser.dump(tmp_path / "page.html").console) == 2


def test_names_of_others_stay_text(tmp_path: Path) -> None:
    robot = pk.load("hexapod")
    robot = pk.Robot(dataclasses.replace(robot.model, name=HOSTILE + "\x07\n"))
    q = robot.inverse(hexapod_poses(robot, 15, np.random.default_rng(0)))
    rows = [",".join(map(repr, r)) for r in np.hstack([q, robot.forward(q).pose[:, :3]]).tolist()]
    quoted = '"' + HOSTILE.replace('"', '""') + '"'
    heads = [*(f"q{i + 1} [mm]" for i in range(6)), "x [mm]", "y [mm]", "z [mm]", "target"]
    text = "\n".join([",".join(heads), *(f"{row},{quoted}" for row in rows)])
    (tmp_path / "tracker.csv").write_text(text, encoding="utf-8")
    measured = pk.read_measurements(tmp_path / "tracker.csv", robot)
    found = pk.identify(robot, measured, free="offset*", unknown="target")
    assert any(HOSTILE in name for name in found.free)
    report.write(found, tmp_path, {HOSTILE: b""})
    seen = browser.dump(tmp_path / "report.html")
    assert seen.console == []
    assert "<img" not in seen.dom.replace("<image", "")
    parsed = html.unescape(seen.dom)
    assert parsed.count(HOSTILE) > 5


@pytest.mark.parametrize("dark", [False, True])
def test_page_follows_the_colours_that_the_reader_likes(
    folder: Path, tmp_path: Path, dark: bool
) -> None:
    browser.screenshot(folder / "report.html", tmp_path / "page.png", dark)
    picture = image.imread(tmp_path / "page.png")[..., :3]
    brightness = picture.mean(axis=2)
    ground = np.median(brightness)
    assert ground < 0.2 if dark else ground > 0.9
    assert (np.abs(brightness - ground) > 0.4).mean() > 0.01  # text and lines stand out


def test_page_prints(folder: Path, tmp_path: Path) -> None:
    browser.look(folder / "report.html", f"--print-to-pdf={tmp_path / 'page.pdf'}")
    content = (tmp_path / "page.pdf").read_bytes()
    assert content.startswith(b"%PDF") and 3 <= len(re.findall(rb"/Type\s*/Page\b", content)) <= 12


# --- from the command line -----------------------------------------------------------------------


def test_calibrate_writes_the_report_and_says_where(
    run: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    delta = Path(__file__).resolve().parents[2] / "examples" / "linear-delta"
    monkeypatch.chdir(tmp_path)
    files = [str(delta / "robot.toml"), str(delta / "probe.csv")]
    result = run("calibrate", *files, "--report", "out")
    assert result.exit_code == 0
    assert result.stdout.endswith("\nreport: out/report.html\n")
    assert {path.name for path in Path("out").iterdir()} == {
        *("report.html", "report.json", "robot.toml")
    }
    said = json.loads(Path("out/report.json").read_text(encoding="utf-8"))
    digests = [hashlib.sha256(Path(file).read_bytes()).hexdigest() for file in files]
    assert list(said["inputs"].values()) == digests


def test_report_does_not_replace_the_robot_it_reads(run: Any, tmp_path: Path) -> None:
    delta = Path(__file__).resolve().parents[2] / "examples" / "linear-delta"
    arguments = [str(delta / "robot.toml"), str(delta / "probe.csv"), "--report", str(delta)]
    result = run("calibrate", *arguments)
    assert result.exit_code == 2 and "is an input" in result.stderr
    assert not (delta / "report.html").exists()
