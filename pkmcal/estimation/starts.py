"""Start of what readings depend on, found with the nominal machine.

Zeros of runs, mountings of sensors and touched things have no present value; each follows in closed
form from the poses of the machine as it is described. A plane or a line is counted from the axis of
the base that is nearest to it, so that its two turnings stay below 55° and regular.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pkmcal.estimation.fit_data import FitData
from pkmcal.exceptions import ArgumentError
from pkmcal.kinematics.calibratable import Calibratable
from pkmcal.measurements.measurements import Measurements
from pkmcal.readings.reading import Reading, Sets
from pkmcal.readings.registry import KINDS
from pkmcal.readings.touches import TouchDistance
from pkmcal.readings.unknowns import Found


def with_starts(machine: Calibratable, datasets: Sequence[FitData]) -> list[FitData]:
    """The sets, with where the search begins for all that is never known before."""
    found: Found = {}
    for kind in dict.fromkeys([*KINDS, *(data.measured.kind for data in datasets)]):
        mine = [data for data in datasets if data.measured.kind == kind]
        if mine:
            first = mine[0].measured.instrument
            nowhere = [(data, np.empty(0)) for data in mine]
            pairs = (
                [(data, machine.forward(data.measured.actuators).pose) for data in mine]
                if first.starts_by_pose
                else nowhere
            )
            _ask(first, machine, pairs, found)
    return [replace(data, starts=found) for data in datasets]


def _ask(reading: Reading, machine: Calibratable, pairs: Sets, found: Found) -> None:
    """Have a reading say where the search starts; one of the user's may fail for want of poses."""
    if reading.starts_by_pose or reading.name in KINDS:
        reading.starts(machine, pairs, found)
        return
    try:
        reading.starts(machine, pairs, found)
    except Exception as error:
        raise ArgumentError(
            f"kind: starts of {reading.name!r} failed with {type(error).__name__}: {error}; where"
            " it needs the poses of the nominal machine, its class states starts_by_pose = True"
        ) from error


def known_distances(datasets: Sequence[FitData]) -> list[FitData]:
    """Distances between touched things that are stated, as readings of their own."""
    stated = [each for data in datasets for each in data.measured.touch_distances]
    if not stated:
        return []
    actuators, sigmas = [], []
    for one, other, _, _ in stated:
        places = {
            name: (data.measured, int(row))
            for name in (one, other)
            for data in datasets
            if data.measured.touched is not None
            for row in np.flatnonzero(data.measured.touched == name)[:1]
        }
        for name in (one, other):
            if name not in places:
                raise ArgumentError(f"touch_distances: no row touches {name!r}")
        measured, row = places[one]
        actuators.append(measured.actuators[row])  # a pose that is there; it has no part in them
        sigmas.append(None if measured.actuator_sigma is None else measured.actuator_sigma[row])
    first = 1 + max(int(data.rows.max()) for data in datasets)
    noisy = sigmas[0] is not None
    readings = Measurements(
        np.array(actuators),
        [mm for _, _, mm, _ in stated],
        TouchDistance(tuple(stated)),
        sigma=[sigma for *_, sigma in stated],
        actuator_sigma=np.array(sigmas, dtype=np.float64) if noisy else None,
    )
    rows = np.arange(first, first + len(stated))
    return [FitData(readings, rows, False, False, starts=datasets[0].starts)]
