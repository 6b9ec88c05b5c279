"""An evaluation does not depend on what else has been computed: it says where searches begin."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.estimation.evaluation import Cache


@pytest.fixture(scope="module")
def fit(request: pytest.FixtureRequest) -> pk.Identification:
    """A hexapod whose actuators are read with noise: poses have unknowns."""
    robot = pk.load("hexapod")
    q = robot.inverse(pk.sample_poses(robot, 16, seed=3))
    readings = pk.VirtualMachine(robot.replace({"offset2": 0.3}), noise=0.01, seed=5).measure(q)
    readings = replace(readings, actuator_sigma=np.full(q.shape, 0.02))
    return pk.identify(robot, readings, free="offset*")


def test_exact_actuators_do_not_follow_the_unknowns_of_others(fit: pk.Identification) -> None:
    """Derivatives by parameters say how unknowns follow: of those equations alone."""
    equations, end = fit.fit.uncertainty.equations, fit.fit.estimate.evaluation
    equations.by_parameters(end, np.ones(len(equations.blocks.unstated)))
    exact = equations.with_exact_actuators()
    np.testing.assert_array_equal(
        exact.at(end.theta, near=end).pose, exact.at(end.theta, near=end.states).pose
    )
    assert not np.array_equal(exact.at(end.theta, near=end).pose, end.pose)


def test_what_is_kept_changes_no_residual(fit: pk.Identification) -> None:
    equations, end = fit.fit.uncertainty.equations, fit.fit.estimate.evaluation
    noise = fit.fit.estimate.state.noise
    kept, bare = equations.at(end.theta, noise, end), replace(end, cache=Cache())
    equations.by_parameters(bare, noise)
    for each in (kept, bare):
        emptied = replace(each, cache=Cache())
        np.testing.assert_allclose(
            equations.residual(each, noise), equations.residual(emptied, noise), atol=1e-9
        )


def test_equations_of_other_noise_do_not_take_what_is_kept(fit: pk.Identification) -> None:
    equations, end = fit.fit.uncertainty.equations, fit.fit.estimate.evaluation
    noise = fit.fit.estimate.state.noise
    whole = equations.residual(end, noise)
    np.testing.assert_allclose(equations.residual(end, 2.0 * noise), whole / 2.0, atol=1e-9)
    other = equations.reweighted([np.full(3, 0.5)])
    assert not np.allclose(other.residual(end, noise), whole, atol=1e-3)
    np.testing.assert_array_equal(equations.residual(end, noise), whole)
