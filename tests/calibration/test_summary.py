"""The summary on one screen: paragraphs and tables that are read, not parsed."""

from __future__ import annotations

import pytest

from pkmcal.calibration.summary import filled, notes


@pytest.mark.parametrize(("lead", "blanks"), [("", 2), ("  ", 2), ("outliers: ", 10)])
def test_further_lines_of_a_paragraph_are_indented_below_what_leads_it(
    lead: str, blanks: int
) -> None:
    text = " ".join(["word"] * 60)
    first, *others = filled(lead, text).splitlines()
    assert first.startswith(lead + "word") and len(first) <= 100
    assert others
    for line in others:
        assert len(line) - len(line.lstrip(" ")) == blanks and len(line) <= 100
    assert " ".join(filled(lead, text).split()) == (lead + text).strip()


@pytest.mark.parametrize("count", range(7))
def test_at_most_three_remarks_are_shown_and_the_others_are_counted(count: int) -> None:
    remarks = [f"remark {i} of them" for i in range(count)]
    lines = list(notes(remarks))
    assert [f"  note: {text}" for text in remarks[:3]] == lines[:3]
    assert len(lines) == min(count, 4)
    if count > 3:
        assert f"{count - 3} more" in lines[3]
