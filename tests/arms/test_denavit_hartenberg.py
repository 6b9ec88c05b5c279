"""Denavit–Hartenberg numbers of any arm give the arm again, by matrices written out here."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.arrays import FloatArray


def link(convention: str, a: float, alpha: float, d: float, theta: float) -> FloatArray:
    """One link by the textbook: Rz(θ) Tz(d) Tx(a) Rx(α), or Rx(α) Tx(a) Rz(θ) Tz(d)."""
    c, s, k, w = np.cos(theta), np.sin(theta), np.cos(alpha), np.sin(alpha)
    if convention == "standard":
        rows = [[c, -s * k, s * w, a * c], [s, c * k, -c * w, a * s], [0, w, k, d], [0, 0, 0, 1]]
    else:
        rows = [
            [c, -s, 0, a],
            [s * k, c * k, -w, -w * d],
            [s * w, c * w, k, k * d],
            [0, 0, 0, 1],
        ]
    return np.array(rows)


def forward(table: pk.DHTable, kinds: tuple[str, ...], q: FloatArray) -> FloatArray:
    tool = table.base
    for i, kind in enumerate(kinds):
        turn, slide = (q[i], 0.0) if kind == "revolute" else (0.0, q[i])
        theta, d = table.theta[i] + turn, table.d[i] + slide
        tool = tool @ link(table.convention, table.a[i], table.alpha[i], d, theta)
    return tool @ table.tool


@pytest.mark.parametrize("convention", ["standard", "modified"])
@pytest.mark.parametrize("seed", range(40))
def test_an_arm_of_any_axes_is_its_table(convention: str, seed: int) -> None:
    """Skew, crossing, parallel and equal axes, either way round, with errors and without."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 8))
    kinds = list(rng.choice(["revolute", "prismatic"], n))
    square = np.eye(3)[rng.integers(0, 3, n)] * rng.choice([-1, 1], (n, 1))
    axes = rng.normal(size=(n, 3)) if seed % 3 else square
    points = rng.normal(size=(n, 3)).round(seed % 2 * 8) * 200
    errors = rng.normal(size=(n, 6)) * [1, 1, 1, 0.01, 0.01, 0.01] * (seed % 5 > 0)
    home = [*rng.normal(size=3) * 300, *rng.normal(size=3)]
    arm = pk.SerialArm(axes, points, home, kinds=kinds, joint_errors=errors)
    table = arm.dh(convention)  # type: ignore[arg-type]
    q = rng.normal(size=n)
    far = max(1.0, np.abs(table.d).max(), np.abs(table.a).max())
    np.testing.assert_allclose(forward(table, arm.kinds, q), arm.forward(q), atol=1e-11 * far)


UR10E = {
    "a": [0, -612.7, -571.55, 0, 0, 0],
    "alpha": [np.pi / 2, 0, 0, np.pi / 2, -np.pi / 2, 0],
    "d": [180.7, 0, 0, 174.15, 119.85, 116.55],
}


def test_the_table_that_an_arm_was_made_of_is_found_again() -> None:
    table = pk.SerialArm.from_dh(**UR10E).dh()  # type: ignore[arg-type]
    for name, values in (*UR10E.items(), ("theta", np.zeros(6))):
        np.testing.assert_allclose(getattr(table, name), values, atol=1e-9)
    np.testing.assert_allclose([table.base, table.tool], [np.eye(4)] * 2, atol=1e-12)


def test_a_written_table_says_order_base_and_tool(tmp_path: Path) -> None:
    arm = pk.SerialArm.from_dh(**UR10E, tool=[0, 0, 50, 0.1, 0, 0])  # type: ignore[arg-type]
    table = pk.export.dh(arm, tmp_path / "dh.csv", "modified")
    text = (tmp_path / "dh.csv").read_text()
    assert "modified Denavit-Hartenberg numbers, Rx(alpha) Tx(a) Rz(theta) Tz(d) a row" in text
    rows = [line.split(",") for line in text.splitlines() if not line.startswith("#")]
    assert rows[0] == ["joint", "kind", "a [mm]", "alpha [deg]", "d [mm]", "theta [deg]"]
    numbers = np.array([row[2:] for row in rows[1:]], dtype=float)
    np.testing.assert_allclose(numbers[:, 0], table.a)
    np.testing.assert_allclose(np.radians(numbers[:, 3]), table.theta)


def lists_of(path: Path) -> dict[str, FloatArray]:
    lines = [line.partition("=") for line in path.read_text().splitlines() if "delta" in line]
    return {name.strip(): np.fromstring(v.strip(" []"), sep=",") for name, _, v in lines}


def test_the_lists_of_universal_robots_added_to_nominal_numbers_are_the_calibrated_arm(
    tmp_path: Path,
) -> None:
    """In m and rad; axes 2, 3, 4 are no longer parallel, so d2, d3, d4 are metres that cancel."""
    rng = np.random.default_rng(4)
    nominal = pk.SerialArm.from_dh(**UR10E)  # type: ignore[arg-type]
    arm = nominal.replace(rng.normal(size=(6, 6)) * [0.5, 0.5, 0.5, 1e-3, 1e-3, 1e-3])
    pk.export.universal_robots(arm, tmp_path / "calibration.conf")
    delta = lists_of(tmp_path / "calibration.conf")
    real = arm.dh()
    table = pk.DHTable(
        np.array(UR10E["a"]) + 1000 * delta["delta_a"],
        np.array(UR10E["alpha"]) + delta["delta_alpha"],
        np.array(UR10E["d"]) + 1000 * delta["delta_d"],
        delta["delta_theta"],
        "standard",
        real.base,
        real.tool,
    )
    q = rng.uniform(-2, 2, 6)
    np.testing.assert_allclose(forward(table, arm.kinds, q), arm.forward(q), atol=1e-6)
    assert np.abs(delta["delta_d"][1:4]).max() > 0.1 > abs(delta["delta_d"][1:4].sum())
    assert (
        "not in these lists: the base frame moves by" in (tmp_path / "calibration.conf").read_text()
    )


@pytest.mark.parametrize("seed", range(12))
def test_numbers_of_a_calibrated_arm_are_on_the_side_of_its_nominal_ones(seed: int) -> None:
    """Axes that errors make skew have their common normal anywhere; what follows does not turn.

    Controllers solve near the nominal numbers: a twist from 90° to -90° is another arm to them.
    """
    rng = np.random.default_rng(seed)
    arm = pk.SerialArm.from_dh(**UR10E)  # type: ignore[arg-type]
    real = arm.replace(rng.normal(size=(6, 6)) * [0.5, 0.5, 0.5, 1e-3, 1e-3, 1e-3])
    for convention in ("standard", "modified"):
        nominal, table = arm.dh(convention), real.dh(convention)  # type: ignore[arg-type]
        assert np.abs(table.alpha - nominal.alpha).max() < 0.02
        turned = (table.theta[1:4].sum() + np.pi) % (2 * np.pi) - np.pi
        assert abs(turned) < 0.02
        assert np.abs(table.tool[:3, :3] - np.eye(3)).max() < 0.02


def with_beta(table: pk.DHTable, kinds: Any, q: FloatArray) -> FloatArray:
    """Rows with Hayati's parameter, multiplied out."""
    assert table.beta is not None
    tool = table.base
    for i, kind in enumerate(kinds):
        turn, slide = (q[i], 0.0) if kind == "revolute" else (0.0, q[i])
        own = link("standard", 0, 0, table.d[i] + slide, table.theta[i] + turn)
        across = link("standard", table.a[i], table.alpha[i], 0, 0)
        c, s = np.cos(table.beta[i]), np.sin(table.beta[i])
        across = across @ np.array([[c, 0, s, 0], [0, 1, 0, 0], [-s, 0, c, 0], [0, 0, 0, 1]])
        tool = tool @ (own @ across if table.convention == "standard" else across @ own)
    return tool @ table.tool


@pytest.mark.parametrize("convention", ["standard", "modified"])
@pytest.mark.parametrize("seed", range(20))
def test_numbers_with_hayatis_parameter_are_of_the_size_of_the_arm(
    convention: Any, seed: int
) -> None:
    """Parallel axes that errors lean by mrad and less, either way round, and others between."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 8))
    kinds = list(rng.choice(["revolute", "prismatic"], n, p=[0.8, 0.2]))
    axes = np.repeat(np.eye(3)[rng.integers(0, 3, n)], 2, axis=0)[:n] * rng.choice([-1, 1], (n, 1))
    points = rng.normal(size=(n, 3)) * 300
    lean = 10.0 ** -rng.integers(3, 9)
    errors = rng.normal(size=(n, 6)) * [1, 1, 1, lean, lean, lean]
    home = [*rng.normal(size=3) * 300, *rng.normal(size=3) * (seed % 2)]
    arm = pk.SerialArm(axes, points, home, kinds=kinds, joint_errors=errors)
    table = arm.dh(convention, "hayati")
    assert table.beta is not None and np.abs(table.beta).max() < 0.01
    assert max(np.abs(table.a).max(), np.abs(table.d).max()) < 1e4
    q = rng.normal(size=n)
    np.testing.assert_allclose(with_beta(table, arm.kinds, q), arm.forward(q), atol=1e-7)


def test_a_calibrated_arm_of_parallel_axes_has_numbers_to_type_in(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    nominal = pk.SerialArm.from_dh(**UR10E)  # type: ignore[arg-type]
    arm = nominal.replace(rng.normal(size=(6, 6)) * [0.2, 0.2, 0.2, 1e-5, 1e-5, 1e-5])
    assert np.abs(arm.dh().d).max() > 1e4
    table = pk.export.dh(arm, tmp_path / "dh.csv")
    text = (tmp_path / "dh.csv").read_text()
    assert "Rz(theta) Tz(d) Tx(a) Rx(alpha) Ry(beta) a row" in text and "beta [deg]" in text
    for name in ("a", "d"):
        np.testing.assert_allclose(getattr(table, name), UR10E[name], atol=3.0)
    q = rng.uniform(-2, 2, 6)
    np.testing.assert_allclose(with_beta(table, arm.kinds, q), arm.forward(q), atol=1e-7)
    pk.export.dh(nominal, tmp_path / "nominal.csv")
    assert "beta" not in (tmp_path / "nominal.csv").read_text()
    far = pk.export.dh(arm, tmp_path / "far.csv", parallel="normal")
    assert far.beta is None and "beta" not in (tmp_path / "far.csv").read_text()


def test_an_arm_of_another_maker_is_no_universal_robot(tmp_path: Path) -> None:
    with pytest.raises(pk.ArgumentError, match="six turning joints"):
        pk.export.universal_robots(pk.load("3r"), tmp_path / "c.conf")
    turned = pk.SerialArm.from_dh(**UR10E, theta=[0, 1, 0, 0, 0, 0])  # type: ignore[arg-type]
    with pytest.raises(pk.ArgumentError, match="offsets theta of these robots are 0"):
        pk.export.universal_robots(turned, tmp_path / "c.conf")
