"""The end of a message about a mistyped name."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


def did_you_mean(name: object, known: Iterable[str], listed: int = 12) -> str:
    """Say which known name is near, or list the known ones where they are few.

    Parameters
    ----------
    name : str
        What was found; anything else is near to nothing.
    known : iterable of str
        What would have been right.
    listed : int
        Up to so many known names are listed when none is near.

    Returns
    -------
    str
        The end of a sentence, empty when there is nothing to say.

    Examples
    --------
    >>> did_you_mean("ofset1", ["base1.x", "offset1"])
    "; did you mean 'offset1'?"
    >>> did_you_mean("q", ["mm", "rad"])
    '; known: mm, rad'
    """
    names = list(dict.fromkeys(known))
    by_lower = {each.lower(): each for each in reversed(names)}
    found = name if isinstance(name, str) else ""
    near = difflib.get_close_matches(found.lower(), list(by_lower), n=1, cutoff=0.6)
    if near and len(found) > 2:  # two letters are near to too much
        return f"; did you mean {by_lower[near[0]]!r}?"
    if 0 < len(names) <= listed:
        return f"; known: {', '.join(names)}"
    return ""
