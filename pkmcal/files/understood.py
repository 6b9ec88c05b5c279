"""Meaning of the headings of a table."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Understood:
    """A column of a file, and what was made of it.

    Attributes
    ----------
    heading : str
        As it is written, without its unit.
    meaning : str or None
        The name of what is read of it, such as ``q1`` or ``x``; None where the column is left out.
    unit : str or None
        The unit in which its numbers were taken; None of words and numbers without one.
    unit_from : str
        Where that unit is stated: "heading", "line 3", "options", or the heading of the column like
        which it was taken; "" without a unit.
    file : str
        The file that the column stands in.
    line : int
        The line of its heading; 0 where none has it.
    """

    heading: str
    meaning: str | None
    unit: str | None
    unit_from: str
    file: str
    line: int
