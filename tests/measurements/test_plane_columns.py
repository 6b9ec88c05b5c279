"""Logs of machines in a plane: what is across it need not be there, and is not read."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pkmcal as pk

SLED = pk.load(Path(__file__).parents[2] / "examples" / "belts" / "robot.toml")
NOISE = 0.5


def places(rows: int) -> tuple[np.ndarray, np.ndarray]:
    """Readings of the belts, and places with noise."""
    rng = np.random.default_rng(0)
    at = np.zeros((rows, 6))
    at[:, :2] = rng.uniform([500, 300], [2500, 1700], (rows, 2))
    true = SLED.replace({"base2.x": 3020.0, "base3.y": 2040.0})
    q = true.inverse(at) + rng.normal(0, 0.2, (rows, 4))
    return q, at[:, :2] + rng.normal(0, NOISE, (rows, 2))


def read(path: Path, q: np.ndarray, columns: dict[str, np.ndarray]) -> pk.Measurements:
    head = [*(f"q{i + 1} [mm]" for i in range(4)), *columns]
    rows = np.column_stack([q, *columns.values()])
    text = "\n".join(",".join(map(repr, row)) for row in rows.tolist())
    (path / "log.csv").write_text(",".join(head) + "\n" + text + "\n")
    return pk.read_measurements(path / "log.csv", SLED)


def test_a_column_across_the_plane_may_be_missing(tmp_path: Path) -> None:
    """Noise is what it is; heights of 0 at every row, as if read, would dilute it."""
    q, xy = places(200)
    columns = {"x [mm]": xy[:, 0], "y [mm]": xy[:, 1]}
    log = read(tmp_path, q, columns)
    np.testing.assert_array_equal(log.values[:, :2], xy)
    assert np.isnan(log.values[:, 2]).all()
    found = pk.identify(SLED, log)
    assert found.noise[0] == pytest.approx(NOISE, rel=0.12)
    flat = read(tmp_path, q, columns | {"z [mm]": np.zeros(200)})
    assert "'z' is the same in all rows" in " ".join(flat.notes)
    np.testing.assert_array_equal(flat.values, log.values)
    zero = pk.identify(SLED, pk.Measurements(q, np.c_[xy, np.zeros(200)]))
    assert zero.noise[0] < 0.9 * NOISE
    measured = read(tmp_path, q, columns | {"z [mm]": xy[:, 0] * 1e-3})
    assert np.isfinite(measured.values).all()  # these are readings


def test_deviations_and_targets_go_without_it(tmp_path: Path) -> None:
    q, xy = places(20)
    columns = {"x [mm]": xy[:, 0] + 30.0, "y [mm]": xy[:, 1]}
    each = {"sigma.x [mm]": np.full(20, 0.5), "sigma.y [mm]": np.full(20, 0.8)}
    point = {"target.x [mm]": np.full(20, 30.0), "target.y [mm]": np.zeros(20)}
    log = read(tmp_path, q, columns | each | point)
    assert log.sigma is not None and log.target is not None
    np.testing.assert_array_equal(log.sigma[:, :2], np.tile([0.5, 0.8], (20, 1)))
    np.testing.assert_array_equal(log.target, [30.0, 0.0, 0.0])
    together = {
        "cov.x.x [mm*mm]": np.full(20, 0.25),
        "cov.x.y [mm*mm]": np.full(20, 0.1),
        "cov.y.y [mm*mm]": np.full(20, 0.64),
    }
    log = read(tmp_path, q, columns | together | point)
    assert log.sigma is not None
    np.testing.assert_array_equal(log.sigma[0, :2, :2], [[0.25, 0.1], [0.1, 0.64]])
    weighted = pk.identify(SLED, log)
    known = pk.Measurements(
        q,
        log.values,
        sigma=np.where(np.eye(3) == 0, log.sigma, [0.25, 0.64, 9.0]),
        target=log.target,
    )
    np.testing.assert_allclose(weighted.values, pk.identify(SLED, known).values, rtol=1e-12)


def test_several_targets_go_without_it(tmp_path: Path) -> None:
    q, xy = places(20)
    rng = np.random.default_rng(1)
    columns = {}
    for name, away in (("A", 40.0), ("B", -40.0)):
        columns[f"{name}.x [mm]"] = xy[:, 0] + away + rng.normal(0, 0.5, 20)
        columns[f"{name}.y [mm]"] = xy[:, 1] + rng.normal(0, 0.5, 20)
    log = read(tmp_path, q, columns)
    assert len(log) == 40 and log.target_names == ("A", "B")
    assert np.isnan(log.values[:, 2]).all() and np.isfinite(log.values[:, :2]).all()


def test_a_machine_that_leaves_the_plane_needs_the_column(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text("q1 [mm],q2 [mm],q3 [mm],x [mm],y [mm]\n300,300,300,1,2\n")
    with pytest.raises(pk.FileError, match="missing column 'z'"):
        pk.read_measurements(tmp_path / "log.csv", pk.load("linear-delta"))
    with pytest.raises(pk.FileError, match="missing column 'z'"):
        pk.read_measurements(tmp_path / "log.csv")


def test_an_unknown_frame_is_laid_on_what_was_read() -> None:
    """Somewhere else and turned; in other rows nothing was read, or not all of it."""
    q, xy = places(30)
    turn = np.array([[np.cos(2.0), -np.sin(2.0)], [np.sin(2.0), np.cos(2.0)]])
    seen = np.full((30, 3), np.nan)
    seen[:, :2] = xy @ turn.T + [500.0, -900.0]
    seen[20:25, 0] = np.nan
    seen[25:] = np.nan
    known = pk.Measurements(q, np.where(np.isnan(seen), np.nan, np.c_[xy, xy[:, :1]]))
    found = pk.identify(SLED, pk.Measurements(q, seen), unknown="frame")
    assert found.rms == pytest.approx(pk.identify(SLED, known).rms, rel=0.2)
    assert "frame.z" in found.unidentifiable
