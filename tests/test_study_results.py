"""Results of studies: one line in a list, a table on a terminal, the same cells in a notebook."""

from __future__ import annotations

import html
import re
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.compensation.correction_grid import correction_grid
from pkmcal.result import Result

FAR = [5000.0, 0.0, 0.0, 0.0, 0.0, 0.0]


def results() -> dict[str, Any]:
    robot, delta = pk.load("2tpr2tps"), pk.load("linear-delta")
    moved = delta.replace({"offset1": delta.geometry["offset1"] + 0.1})
    steps = {"x": [-40, 0, 40], "y": [-40, 0, 40]}
    return {
        "sensitivity": pk.sensitivity(robot, robot.home, cases="offset*"),
        "tolerance": pk.tolerance(robot, robot.home, 0.1, samples=100),
        "allocation": pk.allocate_tolerance(robot, robot.home, 0.1, joints="base*", samples=100),
        "compensation": pk.compensate(robot, [robot.home], [robot.home]),
        "grid": correction_grid(delta, moved, steps),
        "swarm": pk.pso(lambda x: (x**2).sum(axis=1), [-1], [1], iterations=3),
        "check": pk.check_geometry(pk.load("rbt-6t03p-printed")),
        "finding": pk.check_geometry(pk.load("rbt-6t03p-printed")).findings[0],
    }


@pytest.mark.parametrize("found", results().values(), ids=results())
def test_terminal_list_and_notebook_say_the_same(found: Result) -> None:
    title = str(found).splitlines()[0]
    assert repr(found) == f"<{type(found).__name__}: {title}>"
    page = html.unescape(re.sub(r"<[^>]+>", " ", found._repr_html_()))
    assert page.split() == str(found).split()


def test_rows_out_of_reach_are_failed_and_named() -> None:
    delta = pk.load("linear-delta")
    desired = [delta.home, FAR]
    found = pk.compensate(delta, desired, desired)
    np.testing.assert_array_equal(found.failed, [False, True])
    assert "1 of 2 have no command" in found.failures() and "(rows 1)" in found.failures()
    assert found.failures() in str(found)
    assert pk.compensate(delta, desired[:1], desired[:1]).failures() == ""


def test_nodes_out_of_reach_are_failed_and_counted() -> None:
    delta = pk.load("linear-delta")
    found = correction_grid(delta, delta, {"x": [-40.0, 0.0, 40.0, 5000.0]})
    np.testing.assert_array_equal(found.failed, [False, False, False, True])
    assert found.failures() == "1 of 4 nodes have no correction"


def test_cases_without_a_pose_are_named() -> None:
    delta = pk.load("linear-delta")
    found = pk.sensitivity(delta, [delta.home, FAR], cases=["offset1"])
    assert found.failures() == "1 of 2 poses not solved with an error of offset1"
    assert found.failures() in str(found)
    assert pk.sensitivity(delta, delta.home, cases=["offset1"]).failures() == ""
