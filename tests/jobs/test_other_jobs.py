"""Plans, imports and exports as objects: their command lines, their tables."""

from __future__ import annotations

from typing import Any

import hypothesis.strategies as st
import pytest
from hypothesis import HealthCheck, given, settings

import pkmcal as pk
from pkmcal.cli import plan
from pkmcal.exceptions import ArgumentError
from pkmcal.jobs import exporting, importing, planning
from pkmcal.jobs.calibration import Calibration
from pkmcal.jobs.configuration import Exporting, Importing
from pkmcal.jobs.inputs import Inputs
from pkmcal.jobs.plan import Planning
from pkmcal.jobs.project import Project

from .states import said_by, states

ROBOTS = st.sampled_from(["hexapod", "-x.toml", "my robot.toml"])
JOBS = {
    "plan": (Planning, states(Planning, robot=ROBOTS), plan, "carried_out"),
    "import": (Importing, states(Importing), importing, "run"),
    "export": (
        Exporting,
        states(Exporting, robot=ROBOTS, out=st.sampled_from(["a.h", "b c"])).filter(
            lambda job: bool(job.target)
        ),
        exporting,
        "run",
    ),
}


@pytest.mark.parametrize("verb", JOBS)
@given(data=st.data())
@settings(max_examples=25, suppress_health_check=list(HealthCheck))
def test_a_command_line_says_the_same_job(run: Any, verb: str, data: st.DataObject) -> None:
    of, jobs, where, function = JOBS[verb]
    job: Any = data.draw(jobs)
    assert job.argv()[:2] == ["pkmcal", verb]
    assert said_by(run, where, function, of, job.argv()[1:]) == [job]


@pytest.mark.parametrize("verb", JOBS)
@given(data=st.data())
@settings(suppress_health_check=list(HealthCheck))
def test_a_table_says_the_same_job(verb: str, data: st.DataObject) -> None:
    of, jobs, *_ = JOBS[verb]
    job: Any = data.draw(jobs)
    assert of.of_table(job.table()) == job


@given(states(Planning, robot=ROBOTS))
@settings(suppress_health_check=list(HealthCheck))
def test_a_project_holds_a_plan_of_its_machine(job: Any) -> None:
    project = Project(Calibration(job.robot), job)
    assert Project.of_text(project.text()) == project and project.plan == job


def test_a_plan_is_that_of_its_options(run: Any) -> None:
    job = Planning("hexapod", kind="pose", count=8, seed=3)
    made = planning.run(job, Inputs())
    assert run(*job.argv()[1:]).stdout == f"{made}\n"
    assert made.poses.shape == (8, 6) and isinstance(made.robot, pk.Robot)


@pytest.mark.parametrize(
    ("of", "table", "key"),
    [
        (Planning, {"plan": {"cuont": 3}}, "cuont"),
        (Planning, {"plan": {"count": 3.5}}, "count"),
        (Planning, {"plan": {"accuracy": "0.1"}}, "accuracy"),
        (Planning, {"plan": {"accuracy": float("nan")}}, "accuracy"),
        (Planning, {"plan": {"seed": True}}, "seed"),
        (Importing, {"import": {"from": "klipper"}}, "file"),
        (Importing, {"import": {"file": "a", "firmware": "klipper"}}, "firmware"),
        (Exporting, {"export": {"target": "c"}}, "target"),
        (Exporting, {"machine": {"builtin": "hexapod", "file": "a"}}, "machine"),
    ],
)
def test_a_mistake_in_a_table_is_named(of: Any, table: dict[str, Any], key: str) -> None:
    with pytest.raises(ArgumentError, match=key):
        of.of_table(table)
