"""The session of each row: when it was measured, by a name."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from pkmcal import display
from pkmcal.arguments import shown, words
from pkmcal.arrays import TextArray
from pkmcal.exceptions import ArgumentError
from pkmcal.files.csv_writer import WrittenColumn
from pkmcal.files.reading import LONGEST_NAME
from pkmcal.measurements.field import Field
from pkmcal.readings.rows import is_name


class Session(Field):
    """Session in which the rows were measured."""

    logged = True
    unit = None

    def kept(self, given: Any, m: Any) -> TextArray:
        """Check session names, given for all rows or for each."""
        named = given.tolist() if isinstance(given, np.ndarray) else given
        names = words("session", named)
        if isinstance(named, str):
            names = names * len(m)
        if len(names) != len(m):
            raise ArgumentError(
                f"session must be one name, or one for each of {len(m)} rows; found {len(names)}"
            )
        for name in dict.fromkeys(names):
            if not is_name(name) or "@" in name:
                raise ArgumentError(
                    "session must be a name on one line, of at most"
                    f" {LONGEST_NAME} characters and without '@'; found {shown(name)}"
                )
        return np.array(names)

    def printed(self, m: Any) -> Iterator[WrittenColumn]:
        """Return the column of sessions, where there are several."""
        return self.framed(m) if len(m.sessions) > 1 else iter(())

    def said(self, m: Any) -> str:
        """Say the names of the sessions."""
        if not m.sessions:
            return ""
        many = "s" if len(m.sessions) > 1 else ""
        return f"session{many} {', '.join(map(display.printable, m.sessions))}"
