"""A certificate states what its file states, and an uncertainty that comes true."""

from __future__ import annotations

import json
import re
import time
import warnings
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.core.library import POSE
from pkmcal.report import certificate, pdf, report

from .. import browser, workspaces

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "linear-delta"
HOSTILE = "<img src=x onerror=alert(1)>"
TEXT = f"""
number = "C-17"
customer = "{HOSTILE}"
serial = "0042"
operator = "somebody"
date = 2026-11-20
method = "positions by a laser tracker"
datum = 0.002

[instrument]
name = "laser tracker"
serial = "T-1"
certificate = "K-4711"
expanded = 0.015
factor = 3

[temperature]
mean = 22.0
uncertainty = 0.5
expansion = 11.5e-6
expansion_uncertainty = 1e-6
"""
NOISE = 0.01


def calibrated(seed: int, repeats: int = 3) -> tuple[pk.Robot, pk.Identification]:
    """The true hexapod, and it calibrated from poses that repeat to 0.01 mm a coordinate."""
    robot, rng = pk.load("hexapod"), np.random.default_rng(seed)
    true = robot.replace({f"offset{i}": rng.normal(0, 0.3) for i in range(1, 7)})
    q = np.repeat(robot.inverse(workspaces.poses("hexapod", 12, seed)), repeats, axis=0)
    values = true.forward(q).pose[:, :3] + rng.normal(0, NOISE, (len(q), 3))
    return true, pk.identify(robot, pk.Measurements(q, values), free="offset*")


@pytest.fixture(scope="module")
def found() -> pk.Identification:
    return calibrated(1)[1]


@pytest.fixture(scope="module")
def stated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("stated") / "certificate.toml"
    path.write_text(TEXT, "utf-8")
    return path


@pytest.fixture(scope="module")
def folder(
    found: pk.Identification, stated: Path, tmp_path_factory: pytest.TempPathFactory
) -> Path:
    made = tmp_path_factory.mktemp("report")
    found.report(made, certificate=stated)
    return made


def test_the_budget_is_what_was_stated_and_what_the_fit_shows(
    found: pk.Identification, stated: Path
) -> None:
    predicted = np.array([0.03, 0.04])
    made = certificate.budget(found, certificate.read(stated), predicted)
    lines = {line.source: line.share for line in made.contributions}
    reach = np.linalg.norm(found.fit.start.pose[:, :3], axis=1).max()
    assert lines["instrument"] == pytest.approx(0.005)
    assert lines["identified numbers"] == pytest.approx(np.sqrt((0.03**2 + 0.04**2) / 2 / 3))
    assert lines["repeatability"] == found.repeatability == pytest.approx(NOISE, rel=0.3)
    assert lines["temperature"] == pytest.approx(11.5e-6 * 0.5 / np.sqrt(3) * reach)
    assert lines["coefficient of expansion"] == pytest.approx(1e-6 / np.sqrt(3) * 2.0 * reach)
    assert lines["datum"] == 0.002 and lines["lack of fit"] == 0.0
    assert made.combined == pytest.approx(np.sqrt(sum(u**2 for u in lines.values())))
    assert made.expanded == 2 * made.combined


@pytest.mark.parametrize("repeats", [1, 3])
def test_the_expanded_uncertainty_holds_the_errors_of_new_arrivals(repeats: int) -> None:
    """Positions of the true machine at poses that were not measured: about 95 of 100 within U."""
    within, stated_coverage = [], []
    poses = pk.sample_poses(pk.load("hexapod"), 60, share=0.9)
    for seed in range(30):
        true, found = calibrated(seed, repeats)
        made = certificate.budget(found, certificate.Statement(), found.accuracy(poses))
        there = true.forward(found.robot.inverse(poses)).pose[:, :3]
        there += np.random.default_rng(seed).normal(0, NOISE, there.shape)
        within.append(np.mean(np.abs(there - poses[:, :3]) < made.expanded))
        stated_coverage.append(made.coverage)
    assert np.mean(within) == pytest.approx(np.mean(stated_coverage), abs=0.04)


def budget_of(
    sigma: float | None, expanded: float, noise: float = float("nan")
) -> dict[str, float]:
    """Shares of a calibration whose readings scatter by 0.01 mm, of which `sigma` is stated."""
    robot, rng = pk.load("hexapod"), np.random.default_rng(4)
    q = np.repeat(robot.inverse(workspaces.poses("hexapod", 12, 4)), 5, axis=0)
    values = robot.forward(q).pose[:, :3] + rng.normal(0, NOISE, (len(q), 3))
    found = pk.identify(robot, pk.Measurements(q, values, sigma=sigma), free="offset*")
    stated = certificate.Statement(expanded=expanded, factor=2.0, noise=noise)
    made = certificate.budget(found, stated, np.empty(0))
    return {line.source: line.share for line in made.contributions} | {"R": found.repeatability}


def test_noise_of_the_instrument_is_in_the_budget_once() -> None:
    """All of the scatter is the noise that sigma states, and U of the instrument holds it."""
    once = budget_of(NOISE, 4 * NOISE)
    assert once["repeatability"] < 0.4 * NOISE and once["instrument"] == 2 * NOISE
    assert once["repeatability"] == pytest.approx(
        np.sqrt(max(once["R"] ** 2 - NOISE**2, 0.0)), abs=1e-12
    )
    half = budget_of(NOISE, NOISE)  # an instrument that is better than what sigma says
    assert half["repeatability"] == pytest.approx(np.sqrt(half["R"] ** 2 - (NOISE / 2) ** 2))
    for other in (budget_of(None, 4 * NOISE), budget_of(NOISE, np.nan)):  # how much is not known
        assert other["repeatability"] == other["R"]


def test_noise_that_the_certificate_states_is_in_the_budget_once(tmp_path: Path) -> None:
    """Measurements need not state a sigma; no more than U of the instrument is taken out."""
    (tmp_path / "c.toml").write_text("[instrument]\nexpanded = 0.04\nnoise = 0.006\n", "utf-8")
    assert certificate.read(tmp_path / "c.toml").noise == 0.006
    once = budget_of(None, 4 * NOISE, 0.6 * NOISE)
    assert once["repeatability"] == pytest.approx(np.sqrt(once["R"] ** 2 - (0.6 * NOISE) ** 2))
    whole = budget_of(None, NOISE, 3 * NOISE)
    assert whole["repeatability"] == pytest.approx(np.sqrt(whole["R"] ** 2 - (NOISE / 2) ** 2))


def test_u_is_stated_over_the_measured_region_first(folder: Path, found: pk.Identification) -> None:
    page = (folder / "report.html").read_text("utf-8")
    assert 0 < page.index('id="measured"') < page.index('id="expanded"')
    told = json.loads((folder / "report.json").read_text("utf-8"))["certificate"]
    for name, own in zip(POSE, found.fit.end.pose.T, strict=True):  # angles are below half a turn
        assert told["measured"]["extent"][name] == pytest.approx([own.min(), own.max()], abs=1e-12)
    assert told["measured"]["expanded_uncertainty"] < told["expanded_uncertainty"]
    assert told["region"] and set(told["extent"]) == set(POSE)
    turns = np.degrees(told["measured"]["extent"]["gamma"])
    assert f"gamma {turns[0]:.1f} to {turns[1]:.1f} deg" in page
    assert "counter(page)" in page and f"pkmcal {pk.__version__}" in page


@pytest.mark.parametrize(
    ("degrees", "ends"),
    [
        ([170, -175, 178, 181], [170, 185]),  # a tool that points down
        ([-3, 2, 0, 1], [-3, 2]),
        ([180, 180], [180, 180]),
        ([0, 120, -120], [-120, 120]),
        ([40], [40, 40]),
    ],
)
def test_the_range_of_an_angle_is_the_shortest_arc(degrees: list[float], ends: list[float]) -> None:
    poses = np.zeros((len(degrees), 6))
    poses[:, 3] = np.radians(degrees)
    low, high = np.degrees(certificate._extent(poses)["alpha"])
    assert high - low == pytest.approx(ends[1] - ends[0], abs=1e-9)
    inside = (np.array(degrees) - low + 1e-6) % 360 <= high - low + 2e-6
    assert inside.all() and abs(low + high) / 2 <= 180 + 1e-9


def test_without_repeats_their_scatter_and_lack_of_fit_are_one_line() -> None:
    _, found = calibrated(2, repeats=1)
    made = certificate.budget(found, certificate.Statement(), np.empty(0))
    assert [line.source for line in made.contributions] == [
        "repeatability and lack of fit", "datum",
    ]  # fmt: skip
    assert made.combined == pytest.approx(NOISE, rel=0.4)


def test_the_page_begins_with_what_is_stated(folder: Path, found: pk.Identification) -> None:
    page = (folder / "report.html").read_text("utf-8")
    assert page.index('id="certificate"') < page.index('id="before-after"')
    for text in ("C-17", "0042", "2026-11-20", "K-4711", "somebody", "ISO 9283", "ISO 230-2"):
        assert text in page
    assert HOSTILE not in page
    told = json.loads((folder / "report.json").read_text("utf-8"))["certificate"]
    assert f"U = {told['expanded_uncertainty']:.3g}".rstrip("0") in page
    assert told["expanded_uncertainty"] == pytest.approx(2 * told["standard_uncertainty"])
    assert found.verdict.reasons[0].split(" falls")[0] in page
    assert "20 °C (ISO 1): lengths are not corrected to it" in page
    assert "11.5 µm/m/K, ± 1 µm/m/K; no length was reduced by it" in page
    found.report(folder.parent)
    plain = (folder.parent / "report.html").read_text("utf-8")
    assert 'id="certificate"' not in plain


def test_it_states_which_rows_were_left_out(stated: Path, tmp_path: Path) -> None:
    """Who signs has to see it, above the signature and not only in the report behind."""
    measured = calibrated(2)[1].fit.equations.table.sets[0]
    gross = measured.values.copy()
    gross[4] += 2.0
    rows = pk.Measurements(measured.actuators, gross)
    robot = pk.load("hexapod")
    pk.identify(robot, rows, free="offset*", drop=[4]).report(tmp_path, certificate=stated)
    page = (tmp_path / "report.html").read_text("utf-8")
    sheet = page[page.index('id="certificate"') : page.index('class="signatures"')]
    assert "1 row was left out, as asked: row 4" in sheet


def test_the_worst_pose_is_stated_beside_the_workspace(
    found: pk.Identification, folder: Path, stated: Path
) -> None:
    """There the tool is least certain: more than over all, by what the covariance says there."""
    told = json.loads((folder / "report.json").read_text("utf-8"))["certificate"]
    page = (folder / "report.html").read_text("utf-8")
    sample = pk.sample_poses(found.robot, 500, share=0.9)
    accuracy = found.accuracy(sample)
    assert told["poses"] == 500 and told["poses_left_out"] == 0
    assert "nothing can be predicted" not in page
    assert told["worst"]["position"] == pytest.approx(sample[np.argmax(accuracy), :3])
    others = told["standard_uncertainty"] ** 2 - np.mean(accuracy**2) / 3
    expected = 2 * np.sqrt(others + accuracy.max() ** 2 / 3)
    assert told["worst"]["expanded_uncertainty"] == pytest.approx(expected)
    assert told["worst"]["expanded_uncertainty"] > told["expanded_uncertainty"]
    assert f"U = {told['worst']['expanded_uncertainty']:.3g}".rstrip("0") in page


def test_many_degrees_of_freedom_are_written_out(found: pk.Identification, tmp_path: Path) -> None:
    """Beside a large uncertainty without any, those of the repeats count for many."""
    (tmp_path / "stated.toml").write_text("datum = 0.05\n", "utf-8")
    found.report(tmp_path, certificate=tmp_path / "stated.toml")
    page = (tmp_path / "report.html").read_text("utf-8")
    told = json.loads((tmp_path / "report.json").read_text("utf-8"))["certificate"]["dof"]
    written = re.search(r"% with (\d+) degrees of freedom", page)
    assert written and told > 1000
    assert float(written[1]) == pytest.approx(told, rel=5e-3)
    assert f"<td>{written[1]}</td>" in page


@pytest.mark.parametrize(
    "text, message",
    [
        ("mean = 21.4\nexpansion = 12e-6\nexpansion_uncertainty = 1e-6", None),
        ("mean = 22.4\nuncertainty = 0.5\nexpansion = 11.5e-6", None),
        ("mean = 22.4\nexpansion = 11.5e-6", r"mean states 22\.4 °C, .* 21 to 22 °C"),
        ("mean = 21.4\nexpansion = 23e-6", r"states 2\.3e-05/K, .* 1\.15e-05/K"),
    ],
)
def test_it_states_no_other_temperature_than_was_calibrated_with(
    text: str, message: str | None, tmp_path: Path
) -> None:
    robot = pk.load("hexapod")
    q = robot.inverse(workspaces.poses("hexapod", 12, 1))
    values = robot.forward(q).pose[:, :3] + np.random.default_rng(1).normal(0, NOISE, (12, 3))
    measured = pk.Measurements(q, values, temperature=np.linspace(21.0, 22.0, 12))
    found = pk.identify(robot, measured, free="offset*", effects=[pk.Expansion(11.5e-6)])
    (tmp_path / "stated.toml").write_text(f"[temperature]\n{text}\n", "utf-8")
    stated = certificate.read(tmp_path / "stated.toml")
    if message is None:
        told = certificate.as_data(found, stated, np.empty(0), np.empty((0, 3)))
        assert told["reference_temperature"].startswith("20 °C (ISO 1): the stated lengths are")
        sure = "± 1 µm/m/K" if "expansion_uncertainty" in text else "its uncertainty is not stated"
        assert told["expansion"] == f"base, platform, limbs 11.5 µm/m/K, {sure}"
        assert told["worst"] is None
    else:
        with pytest.raises(ValueError, match=message):
            certificate.budget(found, stated, np.empty(0))


def test_the_data_are_what_the_schema_says(folder: Path) -> None:
    jsonschema = pytest.importorskip("jsonschema")
    schema = json.loads(files("pkmcal.report").joinpath("schema.json").read_text("utf-8"))
    part = {**schema, "anyOf": [{"$ref": "#/$defs/report"}]}
    said = json.loads((folder / "report.json").read_text("utf-8"))
    jsonschema.Draft202012Validator(part).validate(said)
    said["certificate"]["coverage"] = "95 %"
    assert list(jsonschema.Draft202012Validator(part).iter_errors(said))


@pytest.mark.parametrize(
    "text, message",
    [
        ('owner = "x"', "unknown key 'owner'"),
        ("serial = 42", "serial"),
        ("datum = -1.0", "datum: must be positive"),
        ("[instrument]\nfactor = 0.0", "factor: must be positive"),
        ("[temperature]\nmean = 20.0", "state mean and expansion"),
    ],
)
def test_mistakes_in_the_file_are_named(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "certificate.toml"
    path.write_text(text, "utf-8")
    with pytest.raises(pk.FileError, match=message) as raised:
        certificate.read(path)
    assert "certificate.toml, line" in str(raised.value)


def test_it_is_part_of_a_report(run: Any, refused: Any, stated: Path, tmp_path: Path) -> None:
    command = ("calibrate", EXAMPLE / "robot.toml", EXAMPLE / "probe.csv", "--certificate", stated)
    assert "--report DIR" in refused(*command)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        assert run(*command, "--report", tmp_path / "out").exit_code == 0
    page = (tmp_path / "out" / "report.html").read_text("utf-8")
    assert 'id="certificate"' in page and "certificate.toml" in page, "its checksum is stated"


def test_it_prints_on_a4(found: pk.Identification, stated: Path, tmp_path: Path) -> None:
    browser.chromium()
    made = found.report(tmp_path, certificate=stated, pdf=True)
    assert [path.name for path in made] == [*report.FILES, "report.pdf"]
    boxes = re.findall(rb"/MediaBox \[0 0 ([\d.]+) ([\d.]+)\]", made[-1].read_bytes())
    assert len(boxes) >= 3
    sizes = np.array(boxes, dtype=float) / 72 * 25.4
    np.testing.assert_allclose(sizes, np.tile([210.0, 297.0], (len(boxes), 1)), atol=1.0)


def test_without_a_browser_a_pdf_is_refused_before_the_work(
    run: Any, refused: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    command = ("calibrate", EXAMPLE / "robot.toml", EXAMPLE / "probe.csv", "--pdf")
    assert "--pdf: it is part of the report, --report DIR" in refused(*command)
    said = refused(*command, "--report", tmp_path / "out")
    assert "pdf: no Chromium was found" in said and "open report.html in any browser" in said
    assert not (tmp_path / "out").exists()


def broken_browser(folder: Path, text: str = "#!/bin/sh\necho no display >&2\nexit 1\n") -> None:
    broken = folder / "chromium"
    broken.write_text(text)
    broken.chmod(0o755)


@pytest.mark.parametrize("text", ["#!/bin/sh\necho no display >&2\n", "\0 no program"])
def test_a_pdf_that_fails_leaves_the_report(
    run: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, text: str
) -> None:
    broken_browser(tmp_path, text)
    monkeypatch.setenv("PATH", f"{tmp_path}:/bin:/usr/bin")
    command = ("calibrate", EXAMPLE / "robot.toml", EXAMPLE / "probe.csv", "--report")
    usual = run(*command, tmp_path / "usual")
    failed = run(*command, tmp_path / "out", "--pdf")
    assert (usual.exit_code, failed.exit_code) == (0, 1)
    (line,) = failed.stderr.splitlines()
    assert line.startswith(f"pkmcal: pdf: {tmp_path / 'chromium'} printed nothing")
    assert failed.stdout == usual.stdout.replace(str(tmp_path / "usual"), str(tmp_path / "out"))
    written = {path.name: path.read_bytes() for path in (tmp_path / "out").iterdir()}
    assert written == {path.name: path.read_bytes() for path in (tmp_path / "usual").iterdir()}


def test_a_browser_that_does_not_end_leaves_none_of_its_own_behind(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """It may be a script that starts one."""
    broken_browser(tmp_path, '#!/bin/sh\nsleep 600 &\necho $! > "$0.child"\nwait\n')
    monkeypatch.setenv("PATH", f"{tmp_path}:/bin:/usr/bin")
    monkeypatch.setattr(pdf, "_PATIENCE", 2.0)
    with pytest.raises(pk.ArgumentError, match=r"printed nothing: no answer within 2\.0 s"):
        pdf.print_page(tmp_path / "page.html", tmp_path / "page.pdf")
    child = int((tmp_path / "chromium.child").read_text())
    for _ in range(100):  # until the system has seen it end
        state = Path(f"/proc/{child}/stat")
        if not state.exists() or state.read_text().rpartition(")")[2].split()[0] == "Z":
            break
        time.sleep(0.05)
    else:
        raise AssertionError(f"process {child} goes on")


def test_a_browser_is_found_where_its_system_has_it(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Applications of macOS and Windows are not on the path."""
    broken_browser(tmp_path)
    monkeypatch.setenv("PATH", "")
    place = str(tmp_path / "chromium")
    monkeypatch.setattr(pdf, "_APPLICATIONS", (str(tmp_path / "absent"), place))
    assert pdf.browser() == place


def test_a_browser_that_prints_nothing_is_named(tmp_path: Path) -> None:
    broken_browser(tmp_path)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PATH", f"{tmp_path}:/bin:/usr/bin")
        with pytest.raises(pk.ArgumentError, match="chromium printed nothing: no display"):
            pdf.print_page(tmp_path / "page.html", tmp_path / "page.pdf")
