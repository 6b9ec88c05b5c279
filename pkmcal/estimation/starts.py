"""Start of what readings depend on, found with the nominal machine.

Zeros, mountings and places of unknown things have no present value; each follows in closed form
from the poses of the machine as it is described, which the class of each kind of reading does.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from pkmcal.arguments import kind
from pkmcal.estimation.fit_data import FitData
from pkmcal.exceptions import ArgumentError, ArgumentTypeError, of_the_package
from pkmcal.kinematics.calibratable import Calibratable
from pkmcal.measurements.measurements import Measurements
from pkmcal.readings.reading import Reading
from pkmcal.readings.registry import KINDS
from pkmcal.readings.unknowns import Found, Start


def with_starts(machine: Calibratable, datasets: Sequence[FitData]) -> list[FitData]:
    """The sets, with where the search begins for all that is never known before."""
    found: Found = {}
    for _, mine in _by_kind(datasets):
        _ask(mine[0].measured.instrument, machine, mine, found)
    return [replace(data, measured=_sized(machine, data), starts=found) for data in datasets]


def _sized(machine: Calibratable, data: FitData) -> Measurements:
    """The measurements, with a reading that knows what its units are in mm."""
    m = data.measured
    reading = m.instrument.with_sizes(m, lambda: machine.forward(m.actuators).pose)
    return m if reading is m.instrument else replace(m, instrument=reading)


def _ask(reading: Reading, machine: Calibratable, mine: Sequence[FitData], found: Found) -> None:
    """Have a reading say where the search starts; one of the user's may fail for want of poses."""
    what = f"kind: starts of the class {type(reading).__name__}"

    def ask(poses: bool) -> None:
        pairs = [
            (data, machine.forward(data.measured.actuators).pose if poses else np.empty(0))
            for data in mine
        ]
        reading.starts(machine, pairs, found)

    try:
        ask(reading.starts_by_pose)
    except ArgumentError as error:
        if reading.starts_by_pose or of_the_package(reading):
            raise
        try:
            ask(True)
        except ArgumentError:
            raise error from None
        raise ArgumentTypeError(
            f"{what} needs the poses of the nominal machine: its class has to state"
            f" starts_by_pose = True. Without them it failed: {error}"
        ) from error
    for role, start in found.items():
        if not isinstance(start, Start):
            raise ArgumentTypeError(
                f"{what}: found[{role!r}] must be a Start(slots, values); found {kind(start)}"
            )


def stated_beside(datasets: Sequence[FitData]) -> list[FitData]:
    """What instruments state beside their rows, as sets of their own."""
    found, first = list[FitData](), 1 + max(int(data.rows.max()) for data in datasets)
    for _, mine in _by_kind(datasets):
        sets = [data.measured for data in mine]
        stated = sets[0].instrument.stated_beside(sets)
        if stated is None:
            continue
        places = [(sets[i], row) for i, row in stated.places]
        sigmas = [m.actuator_sigma[row] for m, row in places if m.actuator_sigma is not None]
        readings = Measurements(
            np.array([m.actuators[row] for m, row in places]),  # which have no part in them
            stated.values,
            stated.instrument,
            sigma=stated.sigma,
            actuator_sigma=np.array(sigmas) if sigmas else None,
        )
        rows = np.arange(first, first + len(places))
        found.append(FitData(readings, rows, False, False, starts=datasets[0].starts))
        first += len(places)
    return found


def _by_kind(datasets: Sequence[FitData]) -> Iterator[tuple[str, list[FitData]]]:
    """The sets of each kind: those of the package first, in the order of their names."""
    for name in dict.fromkeys([*KINDS, *(data.measured.kind for data in datasets)]):
        mine = [data for data in datasets if data.measured.kind == name]
        if mine:
            yield name, mine
