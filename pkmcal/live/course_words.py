"""Messages of a measurement that goes on, for a terminal and for a page."""

from __future__ import annotations

import math

from pkmcal.live.course import Course


def line(course: Course) -> str:
    """Numbers of poses and rows, and the predicted error."""
    rows = 0 if course.rows is None else len(course.rows)
    return f"{_many(course.poses, 'pose')}, {_many(rows, 'row')}: {predicted(course)}"


def warnings(course: Course) -> list[str]:
    """Doubts about the newest rows."""
    found = []
    if course.odd is not None:
        found.append(f"the newest rows contradict the others: {course.odd}")
    if course.trouble:
        found.append(f"no calibration of the rows so far: {course.trouble}")
    return found


def predicted(course: Course) -> str:
    """The predicted error, or why there is none."""
    if math.isinf(course.predicted):
        return "too few to identify all parameters"
    if math.isnan(course.predicted):
        return "too few to tell their noise"
    said = f"predicted error {course.predicted:.3g} mm"
    if course.stated and course.scatter > 1.0:
        said += f", for they scatter {course.scatter:.2g} times as far as stated"
    return said


def conclusion(course: Course) -> list[str]:
    """Lines on how the measurement ended."""
    found = []
    dilution = course.choice.dilution
    if course.stated and dilution == dilution:
        found.append(
            f"dilution {dilution:.2g}: the error predicted at the targets is {dilution:.2g} times"
            " the noise of a reading, whatever the errors of the machine"
        )
    if course.reached:
        end = "enough"
    elif course.accuracy is None:
        end = "all the poses that were asked for are measured"
    else:
        end = f"the {course.accuracy:g} mm that were asked for are not reached"
    return [*found, f"{predicted(course)}: {end}"]


def stopped(rows: int, path: str) -> str:
    """Line on the rows of a measurement that was stopped."""
    return f"stopped with {_many(rows, 'row') if rows else 'no row'} in {path}"


def _many(count: int, what: str) -> str:
    return f"{count} {what}{'s' * (count != 1)}"
