"""Labels such as runs: one of another file or session is another, whatever its name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import PurePath

import numpy as np

from pkmcal.measurements.measurements import Measurements

Place = tuple[str, str]  # session and file of a row


def runs_apart(
    sets: Sequence[Measurements], beside: Sequence[Measurements] = ()
) -> list[Measurements]:
    """Return the sets with runs of one name renamed where they are of several files or sessions.

    An instrument is set to zero anew in each: "1" becomes "monday.1" and "tuesday.1". `beside` are
    sets with other runs, which keep their names.
    """
    places: dict[str, dict[Place, None]] = {}
    for measured in (*beside, *sets):
        for run, place in zip(_runs(measured), _places(measured), strict=True):
            places.setdefault(run, {})[place] = None
    found = []
    for measured in sets:
        runs = _runs(measured)
        named = [
            run if len(places[run]) == 1 else f"{_name(place, list(places[run]))}.{run}"
            for run, place in zip(runs, _places(measured), strict=True)
        ]
        if named != runs:
            instrument = measured.instrument
            changed = instrument.with_fields({instrument.anew: np.array(named)})
            measured = replace(measured, instrument=changed)
        found.append(measured)
    return found


def _runs(measured: Measurements) -> list[str]:
    """Return the run of each row; nothing of readings without such a label."""
    label = measured.instrument.anew
    return np.asarray(getattr(measured.instrument, label)).astype(str).tolist() if label else []


def _places(measured: Measurements) -> list[Place]:
    """Return session and file of each row that has a run."""
    session = [""] * len(_runs(measured)) if measured.session is None else measured.session.tolist()
    return [(each, measured.file) for each in session[: len(_runs(measured))]]


def _name(place: Place, others: Sequence[Place]) -> str:
    """The session of a place where that tells it from the others, else its file, else both."""
    session, file = place[0], PurePath(place[1]).stem.replace("@", " ")
    if session and [other[0] for other in others].count(session) == 1:
        return session
    stems = [PurePath(other[1]).stem.replace("@", " ") for other in others]
    return file if file and stems.count(file) == 1 else f"{session}.{file}".strip(".") or "other"
