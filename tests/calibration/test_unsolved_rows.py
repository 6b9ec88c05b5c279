"""A search that ends where rows have no solution is an error that names them."""

from dataclasses import replace

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.calibration import steps

POSES, TWICE = 12, 3  # the last of them are measured again


def measured(robot: pk.Robot) -> pk.Measurements:
    """Positions, read twice at some poses: their rows share what is solved."""
    q = robot.inverse(pk.sample_poses(robot, POSES, seed=1, share=0.3))
    q = np.vstack([q, q[-TWICE:]])
    return pk.VirtualMachine(robot, noise=0.02, seed=1).measure(q, "position")


@pytest.mark.parametrize("name", ["hexapod", "6-rus", "tricept"])
@pytest.mark.parametrize("lost", [[4], [0, POSES - 1]])
def test_rows_without_a_solution_at_the_end_are_named(
    name: str, lost: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    robot = pk.load(name)
    data = measured(robot)
    free = robot.geometry.names[:2]
    solved = steps.solved_in_least_minima

    def ended(estimator):  # as where Newton's method does not converge at some poses
        estimate = solved(estimator)
        states = estimate.evaluation.states
        q = states.actuators
        poses = [int(np.flatnonzero((q == data.actuators[row]).all(axis=1))[0]) for row in lost]
        status = states.status.copy()
        status[poses] = 1
        return replace(
            estimate,
            evaluation=replace(estimate.evaluation, states=replace(states, status=status)),
        )

    assert pk.identify(robot, data, free).converged
    monkeypatch.setattr(steps, "solved_in_least_minima", ended)
    rows = [row for row in range(POSES) if row in lost]
    rows += [row + TWICE for row in rows if row >= POSES - TWICE]
    listed = ", ".join(str(row) for row in sorted(rows))
    with pytest.raises(pk.ArgumentError, match=rf"^{len(rows)} of .*rows {listed}\).* where the"):
        pk.identify(robot, data, free)


@pytest.mark.parametrize("sigma", [None, 0.02])
def test_a_row_of_which_nothing_was_read_takes_no_part(sigma: float | None) -> None:
    """Also one that the machine cannot reach, beside actuators of stated deviation."""
    robot = pk.load("hexapod")
    data = replace(measured(robot), actuator_sigma=sigma)
    q, values = data.actuators.copy(), data.values.copy()
    q[3, 0] += 400.0
    assert not robot.forward(q[3]).ok
    values[3] = np.nan
    with_it = pk.identify(
        robot, replace(data, actuators=q, values=values), robot.geometry.names[:2]
    )
    without = pk.identify(robot, data.select(np.arange(len(data)) != 3), robot.geometry.names[:2])
    assert with_it.values.tobytes() == without.values.tobytes()
