"""Names of measured points, which instruments give one by one, as pose and target."""

from __future__ import annotations

import re
from collections.abc import Sequence

_PARTING = r"[\s_\-.:/]+"
_FORMS = (
    re.compile(rf"(?P<first>.*?[0-9]+){_PARTING}(?P<last>\S.*)"),  # P01_SMR1
    re.compile(rf"(?P<first>.*[^\s_\-.:/]){_PARTING}(?P<last>\S*[0-9]+)"),  # SMR-A_P01
)
_TARGET = re.compile(r"smr|target|tgt|refl|marker|prism|nest|ball", re.IGNORECASE)


def split(names: Sequence[str]) -> tuple[list[str], list[str]] | None:
    """Poses and targets of points named after both; None where names are not made so.

    The part with fewer different words is the target: it is seen in several poses.

    Examples
    --------
    >>> split(["P01_SMR1", "P01_SMR2", "P02_SMR1"])
    (['P01', 'P01', 'P02'], ['SMR1', 'SMR2', 'SMR1'])
    >>> split(["A-1", "A-2", "B-1", "B-2", "A-3"])
    (['1', '2', '1', '2', '3'], ['A', 'A', 'B', 'B', 'A'])
    >>> split(["P01", "P02"])
    """
    for form in _FORMS:
        matches = [form.fullmatch(name) for name in names]
        if not all(matches):
            continue
        first = [match["first"] for match in matches if match]
        last = [match["last"] for match in matches if match]
        poses, targets = first, last
        by_name = len(set(filter(_TARGET.search, first))), len(set(filter(_TARGET.search, last)))
        fewer = len(set(first)) - len(set(last))
        if fewer < 0 or (fewer == 0 and by_name[0] > by_name[1]):
            poses, targets = last, first
        if len(set(poses)) > 1 and len(set(targets)) < len(names):
            return poses, targets
    return None
