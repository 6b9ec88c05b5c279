"""Paths of solutions while limbs change: where they lead, how far they come, in how many steps."""

from __future__ import annotations

import numpy as np
import pytest

from pkmcal.core.machine import Machine
from pkmcal.core.paths import ARRIVED, FAR, LOST, Paths, follow
from pkmcal.modes import homotopy
from tests import dietmaier, robots

STEPS = 6  # of a straight path: 0.02 at first and twice as long each time


def two_circles() -> Machine:
    bases = ([0.0, 0.0, 0.0], [400.0, 0.0, 0.0])
    limbs = [{"kind": "UPS", "base": base, "platform": [0.0, 0.0, 0.0]} for base in bases]
    machine = robots.made("xy", {"x": 200.0, "y": 300.0}, limbs).machine
    assert isinstance(machine, Machine)
    return machine


def circles(centres: object, radii: object) -> np.ndarray:
    """Two limbs that hold a point."""
    found = np.zeros((2, 7), dtype=complex)
    found[:, 3:5], found[:, 6] = centres, radii
    return found


def point(paths: Paths) -> np.ndarray:
    return paths.frame[:, 9:11]


@pytest.mark.parametrize("centres", ([[3, 4], [0, 0]], [[0, 0], [3, 4]]))
def test_a_point_goes_straight_with_its_circles_in_steps_that_double(centres: object) -> None:
    """The point is straight above one of the centres: x has no part in that equation."""
    centres = np.array(centres, dtype=float)
    radii = np.hypot(*(centres - [3.0, 0.0]).T)
    a, b = circles(centres, radii), circles(centres + np.array([5.0, -2.0]), radii)
    found = follow(two_circles(), a, b, np.array([[3.0, 0.0]], dtype=complex), 1e-6)
    assert found.status == ARRIVED and found.reached == 1.0 and found.steps == STEPS
    assert np.abs(point(found) - [8.0, -2.0]).max() < 1e-14


def test_a_path_that_is_lost_says_where_on_the_line_circles_touched() -> None:
    """Radii shrink from 10 to 5 while the centres are 16 apart: they touch after 0.4 of the way."""
    a, b = (circles([[-8, 0], [8, 0]], radius) for radius in (10.0, 5.0))
    start = np.array([[0.0, 6.0], [0.0, -6.0]], dtype=complex)
    found = follow(two_circles(), a, b, start, 1e-3)
    assert (found.status == LOST).all()
    assert np.abs(found.reached - 0.4).max() < 1e-9
    assert np.abs(point(found)).max() < 1e-3


def test_a_path_through_a_system_that_says_nothing_is_lost() -> None:
    """Two circles that are one hold a point nowhere."""
    one = circles([[0, 0], [0, 0]], 5.0)
    found = follow(two_circles(), one, one, np.array([[3.0, 4.0]], dtype=complex), 1e-3)
    assert found.status == LOST and found.reached == 0.0


def test_a_path_is_far_as_soon_as_it_is_beyond_100_000() -> None:
    """The centres of circles with radii 1 and 3 meet at the end: x = ((1 - t)² - 8) / 2 (1 - t)."""
    a, b = (circles([[0, 0], [apart, 0]], [1.0, 3.0]) for apart in (1.0, 0.0))
    start = np.array([[-3.5, way * np.sqrt(11.25)] for way in (1j, -1j)])
    found = follow(two_circles(), a, b, start, 1e-6)
    assert (found.status == FAR).all()
    x, left = point(found)[:, 0], 1.0 - found.reached
    assert np.abs(x * 2 * left / (left**2 - 8) - 1).max() < 1e-5
    assert (np.abs(x) > 1e5).all() and (np.abs(x) < 1.1e5).all()


def to_forty_modes(accuracy: float, paths: int) -> Paths:
    """To the hexapod all of whose modes are real."""
    robot, families = dietmaier.hexapod(), homotopy._families()
    start = next(family.start for family in families if family.start.name == "hexapod")
    assert isinstance(robot.machine, Machine)
    spheres = robot.machine.spheres(robot.slots, np.array([dietmaier.LENGTHS], dtype=float))[0]
    target = homotopy._normalized("spatial", spheres)[0].astype(complex)
    return follow(robot.machine, start.limbs, target, start.states[:paths], accuracy)


def test_paths_arrive_apart_however_far_off_predictions_may_be() -> None:
    """Corrections that do not shrink fast are of another path: the step was too long."""
    found = to_forty_modes(1e9, 40)
    assert (found.status == ARRIVED).all() and len(homotopy.distinct(found.frame)) == 40


def test_predictions_are_of_fourth_order() -> None:
    """Cubics: a hundredth of the accuracy takes 100 ** (1 / 4) times as many steps."""
    steps = [to_forty_modes(accuracy, 10).steps.sum() for accuracy in (1e-4, 1e-6)]
    assert steps[1] / steps[0] < 1.1 * 100**0.25


def test_a_path_is_lost_after_two_thousand_steps() -> None:
    found = to_forty_modes(1e-10, 1)
    assert found.status == LOST and found.steps == 2000 and 0.0 < found.reached < 1.0
