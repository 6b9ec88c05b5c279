"""Labels of each equation of a calibration: set, row, pose, target and component.

Where poses follow from the actuators the equations are readings. Where poses have unknowns an
equation is a mixture of all that was read at a pose, closures included: of such a unit only the
pose is known, and no two equations have the same component.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import BoolArray, IntArray, held_once
from pkmcal.estimation.equations import Equations
from pkmcal.measurements import repeats
from pkmcal.measurements.poses import joined
from pkmcal.statistics.linear_fit import numbered


@dataclass(frozen=True, eq=False)
class Labels:
    """Labels of M equations, by number.

    Attributes
    ----------
    set_of, row, pose, target, component : ndarray of int (M,)
        Rows count through all sets; a pose is that of `poses_of_rows`; components of the same name
        have the same number. Of mixtures, the row is the unit, and the set the first.
    family : ndarray of int (M,)
        Components of one unit have the same number.
    length : ndarray of bool (M,)
        Whether it is of the first unit of its reading, which a noise in mm is told of; of a pose
        the position. Of mixtures none is.
    """

    set_of: IntArray
    row: IntArray
    pose: IntArray
    target: IntArray
    component: IntArray
    family: IntArray
    length: BoolArray


def poses_of_rows(equations: Equations) -> IntArray:
    """Number of the pose of each row (N,): by `Measurements.group`, else by actuators.

    Rows at the same actuators are one pose in all sets.
    """
    pose = equations.table.command_of_pose[np.concatenate(equations.table.pose_of)]
    for k, measured in enumerate(equations.table.sets):
        if measured.group is not None:
            pose[equations.table.set_of == k] = measured.pose_index + pose.max() + 1
    return numbered(pose)


def labels(equations: Equations) -> Labels:
    """Label the equations."""
    return _of_mixtures(equations) if equations.machines.unknowns else _of_readings(equations)


def component_classes(named: Labels, place: IntArray) -> list[IntArray]:
    """Classes of equations (M,) that may have unlike variances, coarse ones first.

    Sets; lengths and angles of each; x y, z and angles; each component. `place` (M,) is which
    component each equation is.
    """
    schemes = (np.zeros(6), [0, 0, 0, 1, 1, 1], [0, 0, 1, 2, 2, 2], np.arange(6))
    return [numbered(named.set_of, np.asarray(scheme, dtype=np.intp)[place]) for scheme in schemes]


def _of_readings(equations: Equations) -> Labels:
    names: dict[str, int] = {}
    units: dict[str, int] = {}
    targets, components, families, lengths, rows = [], [], [], [], []
    first = 0
    for m in equations.table.sets:
        targets.append(np.repeat(repeats.targets(m), len(m.components)))
        numbers = [names.setdefault(name, len(names)) for name in m.components]
        components.append(np.tile(np.array(numbers, dtype=np.intp), len(m)))
        of_units = [units.setdefault(unit, len(units)) for unit in m.units]
        families.append(np.tile(np.array(of_units, dtype=np.intp), len(m)))
        counted = [unit == m.units[0] for unit in m.units]
        lengths.append(np.tile(np.array(counted, dtype=bool), len(m)))
        rows.append(np.repeat(np.arange(first, first + len(m)), len(m.components)))
        first += len(m)
    read = equations.whitening.present
    row = np.concatenate(rows)[read]
    return Labels(
        set_of=held_once(equations.table.set_of[row]),
        row=row,
        pose=poses_of_rows(equations)[row],
        target=held_once(np.concatenate(targets)[read]),
        component=np.concatenate(components)[read],
        family=held_once(np.concatenate(families)[read]),
        length=np.concatenate(lengths)[read],
    )


def _of_mixtures(equations: Equations) -> Labels:
    unit = np.repeat(np.arange(len(equations.blocks.components)), equations.blocks.components)
    pose = _poses_of_units(equations)[unit]
    order = np.argsort(pose, kind="stable")
    count = np.bincount(pose)
    component = np.empty_like(unit)
    component[order] = np.arange(len(unit)) - np.repeat(np.cumsum(count) - count, count)
    nothing = np.zeros_like(unit)
    none = np.zeros(len(unit), dtype=bool)
    return Labels(nothing, unit, pose, nothing, component, nothing, none)


def _poses_of_units(equations: Equations) -> IntArray:
    """Number of the pose of each unit (U,): units whose rows share a pose are of one."""
    unit, pose = equations.blocks.block_of_row, poses_of_rows(equations)
    used = unit >= 0
    group = joined(unit[used], pose[used])
    return numbered(group[np.unique(unit[used], return_index=True)[1]])
