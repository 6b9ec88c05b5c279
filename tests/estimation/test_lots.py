"""Derivatives of many rows are made in lots, which change nothing but the memory they take."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.estimation import derivatives, session_machines, whitening
from pkmcal.statistics import clusters, linear_fit


def fitted(robot: pk.Robot, **options: Any) -> pk.Identification:
    """Poses with full covariances, and positions of repeats in any order."""
    rng = np.random.default_rng(3)
    q = robot.inverse(pk.sample_poses(robot, 30, seed=4))
    true = robot.replace({"offset2": 0.2})
    machine = pk.VirtualMachine(true, noise=0.01, seed=5)
    spread = rng.normal(size=(30, 6, 6))
    covariance = 1e-4 * (np.eye(6) + 0.1 * spread @ spread.transpose(0, 2, 1))
    noise = np.einsum("nij,nj->ni", np.linalg.cholesky(covariance), rng.normal(size=(30, 6)))
    sets = [
        pk.Measurements(q, true.forward(q).pose + noise, "pose", sigma=covariance),
        machine.measure(np.repeat(q[:12], 3, axis=0)[rng.permutation(36)], "position"),
    ]
    return pk.identify(robot, sets, free="offset*", **options)


def in_small_lots(monkeypatch: pytest.MonkeyPatch) -> None:
    for module, name, together in (
        (session_machines, "_TOGETHER", 7),
        (whitening, "_TOGETHER", 4),
        (derivatives, "_BATCH", 5),
        (clusters, "_FEW", 7),
        (linear_fit, "_KEYS", 3),
    ):
        monkeypatch.setattr(module, name, together)


@pytest.mark.parametrize("options", [{}, {"loss": "huber"}, {"loss": "cluster"}])
def test_a_calibration_in_lots_is_that_made_at_once(
    hexapod: pk.Robot, options: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    at_once = fitted(hexapod, **options)
    in_small_lots(monkeypatch)
    in_lots = fitted(hexapod, **options)
    np.testing.assert_array_less(abs(in_lots.values - at_once.values), 1e-6 * at_once.stderr)
    np.testing.assert_allclose(in_lots.stderr, at_once.stderr, rtol=1e-6)
    np.testing.assert_allclose(in_lots.parameter_dof, at_once.parameter_dof, rtol=1e-6)
    for name, index in at_once.observability.items():
        assert abs(in_lots.observability[name] / index - 1.0) < 1e-9
    first, second = at_once.fit.uncertainty, in_lots.fit.uncertainty
    assert abs(second.covariance.score - first.covariance.score) < 1e-6
    np.testing.assert_allclose(
        second.adjusted, first.adjusted, atol=1e-6 * abs(first.adjusted).max()
    )


def test_derivatives_in_lots_are_those_made_at_once(
    hexapod: pk.Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    fit = fitted(hexapod).fit
    noise = np.ones(2)
    at_once = fit.equations.by_parameters(fit.end, noise)
    in_small_lots(monkeypatch)
    in_lots = fit.equations.by_parameters(fit.end, noise)
    assert np.abs(at_once).max() > 1.0
    np.testing.assert_allclose(in_lots, at_once, rtol=0, atol=1e-12 * np.abs(at_once).max())


def test_derivatives_are_those_of_the_residuals(hexapod: pk.Robot) -> None:
    fit = fitted(hexapod).fit
    noise, step = np.ones(2), 1e-4
    found = fit.equations.by_parameters(fit.end, noise)
    for column in range(found.shape[1]):
        by = step * np.eye(found.shape[1])[column]
        after, before = (fit.equations.at(fit.end.theta + sign * by) for sign in (1, -1))
        change = fit.equations.residual(before, noise) - fit.equations.residual(after, noise)
        difference = change / (2 * step)
        np.testing.assert_allclose(found[:, column], difference, atol=1e-5 * np.abs(found).max())
