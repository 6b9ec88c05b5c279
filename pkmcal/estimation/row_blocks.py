"""The blocks of the equations of a calibration: which of them count together.

Where poses follow from the actuators a block is what was read in one row, and its equations are
readings. Where poses have unknowns it is all that was read at one pose, less the equations that
determine that pose. Its equations are mixtures of all that, closures included: of such a one only
the pose is known, and no two have the same component.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, IntArray, held_once
from pkmcal.core.elimination import PoseEquations
from pkmcal.estimation.pose_table import PoseTable
from pkmcal.estimation.session_machines import Machines
from pkmcal.measurements import repeats
from pkmcal.measurements.poses import joined
from pkmcal.statistics.linear_fit import numbered


@dataclass(frozen=True, eq=False)
class RowBlocks:
    """Blocks of equations that count together, and the noise of each.

    Attributes
    ----------
    table : PoseTable
        The rows.
    components : ndarray of int (B,)
        Equations of each block.
    pose_of_block : ndarray of int (B,)
        The pose of each block: rows of one pose have its errors in common.
    block_of_row : ndarray of int (N,)
        The block of each row of the sets; -1 where none of its equations counts.
    family_of_block : ndarray of int (B,)
        The set of each block; one family for all where poses mix the noise of the groups.
    unstated : ndarray of bool (G,)
        Whether the deviation is not known, of each group of equations with a noise of its own: the
        sets; or the lengths and angles of each, then load cells and actuators, where poses have
        unknowns.
    uninformative : int
        How many rows or poses have no equation: nothing was read, or all that was read determines
        the pose.
    beyond : ndarray of int (B, G) or None
        How many more equations of each group a block has which are 0 whatever the parameters are;
        None: none has any.
    """

    table: PoseTable
    components: IntArray
    pose_of_block: IntArray
    block_of_row: IntArray
    family_of_block: IntArray
    unstated: BoolArray
    uninformative: int
    beyond: IntArray | None = field(default=None, kw_only=True)

    @cached_property
    def stands_for(self) -> IntArray:
        """Number of equations that each block (B,) stands for: its own, and those beyond."""
        if self.beyond is None:
            return self.components
        many: IntArray = self.components + self.beyond.sum(axis=1)
        return many

    @property
    def family_of_group(self) -> IntArray:
        """Family of each group (G,): the set."""
        return np.arange(len(self.unstated))

    def squares(self, residual: FloatArray) -> FloatArray:
        """Squared length of the residuals (M,) of each block, (B,)."""
        first = np.cumsum(self.components) - self.components
        squares: FloatArray = np.add.reduceat(residual**2, first)
        return squares

    # what the equations (M,) are of ---------------------------------------------------------------

    @cached_property
    def row(self) -> IntArray:
        """Row of each equation (M,), counted through all sets; of mixtures the block."""
        return self._of_rows([np.arange(len(self.table.rows))])

    @cached_property
    def set_of(self) -> IntArray:
        """Set of each equation (M,); of mixtures the first."""
        return held_once(self.table.set_of[self.row])

    @cached_property
    def pose(self) -> IntArray:
        """Pose of each equation (M,), as `pose_of_row` counts them."""
        pose: IntArray = self.pose_of_row[self.row]
        return pose

    @cached_property
    def target(self) -> IntArray:
        """Target of each equation (M,), by number."""
        return held_once(self._of_rows([repeats.targets(m) for m in self.table.sets]))

    @cached_property
    def component(self) -> IntArray:
        """Component of each equation (M,): those of one name have one number."""
        names = dict.fromkeys(name for m in self.table.sets for name in m.components)
        number = {name: i for i, name in enumerate(names)}
        return self._of_numbers([[number[name] for name in m.components] for m in self.table.sets])

    @cached_property
    def family(self) -> IntArray:
        """Unit of each equation (M,), by number."""
        units = dict.fromkeys(unit for m in self.table.sets for unit in m.units)
        number = {unit: i for i, unit in enumerate(units)}
        found = self._of_numbers([[number[unit] for unit in m.units] for m in self.table.sets])
        return held_once(found)

    @cached_property
    def length(self) -> BoolArray:
        """Whether each equation (M,) is of the first unit of its reading; of mixtures none is.

        A noise in mm is told of these; of a pose they are the position.
        """
        first = [[unit == m.units[0] for unit in m.units] for m in self.table.sets]
        return self._of_numbers(first).astype(bool)

    @cached_property
    def pose_of_row(self) -> IntArray:
        """Pose of each row (N,): rows of one `Measurements.group` of a set are at one.

        And rows at the same actuators, in all sets.
        """
        command = self.table.command_of_pose[np.concatenate(self.table.pose_of)]
        grouped = command.copy()
        for k, measured in enumerate(self.table.sets):
            if measured.group is not None:
                own = measured.pose_index + grouped.max() + 1
                grouped[self.table.set_of == k] = own
        return numbered(joined(grouped, command))

    @cached_property
    def _read(self) -> BoolArray:
        """Which numbers of all sets were read, row by row."""
        return np.concatenate([np.isfinite(m.values).reshape(-1) for m in self.table.sets])

    def _of_rows(self, parts: Sequence[IntArray]) -> IntArray:
        """What is known of the rows of all sets, of each equation (M,)."""
        widths = [len(m.components) for m in self.table.sets]
        every: IntArray = np.repeat(np.concatenate(parts), np.array(widths)[self.table.set_of])
        return every[self._read]

    def _of_numbers(self, parts: Sequence[Sequence[int]]) -> IntArray:
        """What is known of the components (k,) of each set, of each equation (M,)."""
        rows = [len(m) for m in self.table.sets]
        whole = [np.tile(np.array(p, np.intp), n) for p, n in zip(parts, rows, strict=True)]
        found: IntArray = np.concatenate(whole)[self._read]
        return found


@dataclass(frozen=True, eq=False)
class PoseBlocks(RowBlocks):
    """Blocks where poses have unknowns.

    The equations (E,) are those of the closures that count, pose by pose, then the readings.

    Attributes
    ----------
    equations : PoseEquations
        Those of each pose.
    size : float
        The largest number that they are made of, mm.
    slack, counts : ndarray of bool (K, e)
        Closures that are left out, of slack cables; and those that are equations: neither slack nor
        missing.
    groups : ndarray of int (e,)
        The group of each closure.
    group_of_equation : ndarray of int (E,)
        The group of each equation.
    """

    equations: PoseEquations
    size: float
    slack: BoolArray
    counts: BoolArray
    groups: IntArray
    group_of_equation: IntArray

    @property
    def family_of_group(self) -> IntArray:
        """Family of each group (G,): one for all."""
        return np.zeros(len(self.unstated), dtype=np.intp)

    @cached_property
    def counting(self) -> IntArray | None:
        """Places of the closures that count among all of them (K * e,); None: all count."""
        return None if self.counts.all() else np.flatnonzero(self.counts)

    @cached_property
    def row(self) -> IntArray:
        """Block of each equation (M,)."""
        return np.repeat(np.arange(len(self.components)), self.components)

    @cached_property
    def set_of(self) -> IntArray:
        """The first set."""
        return np.zeros_like(self.row)

    @cached_property
    def pose(self) -> IntArray:
        """Pose of each equation (M,): blocks whose rows share a pose are of one."""
        used = self.block_of_row >= 0
        group = joined(self.block_of_row[used], self.pose_of_row[used])
        of_block = numbered(group[np.unique(self.block_of_row[used], return_index=True)[1]])
        pose: IntArray = of_block[self.row]
        return pose

    @cached_property
    def target(self) -> IntArray:
        """No target."""
        return np.zeros_like(self.row)

    @cached_property
    def component(self) -> IntArray:
        """Number of each equation (M,) among those of its pose."""
        order, count = np.argsort(self.pose, kind="stable"), np.bincount(self.pose)
        component = np.empty_like(self.row)
        component[order] = np.arange(len(order)) - np.repeat(np.cumsum(count) - count, count)
        return component

    @cached_property
    def family(self) -> IntArray:
        """One for all."""
        return np.zeros_like(self.row)

    @cached_property
    def length(self) -> BoolArray:
        """None is a length."""
        return np.zeros(len(self.row), dtype=bool)

    def counted(self, part: FloatArray) -> FloatArray:
        """Equations of closures (K, e, ...) that count, one after another."""
        whole = part.reshape(-1, *part.shape[2:])
        return whole if self.counting is None else whole[self.counting]


def row_blocks(table: PoseTable, unstated: BoolArray, missing: int) -> RowBlocks:
    """Find the blocks of readings; `missing` rows had been left out, for nothing was read there."""
    read = table.count > 0
    return RowBlocks(
        table=table,
        components=held_once(table.count[read]),
        pose_of_block=np.concatenate(table.pose_of)[read],
        block_of_row=np.where(read, np.cumsum(read) - 1, -1),
        family_of_block=held_once(table.set_of[read]),
        unstated=unstated,
        uninformative=missing + int((~read).sum()),
    )


def pose_blocks(
    table: PoseTable,
    machines: Machines,
    slack: BoolArray,
    unstated: BoolArray,
    of_readings: IntArray,
    size: float,
) -> PoseBlocks:
    """Find the blocks of poses with unknowns.

    `of_readings` are the groups of the equations of readings; `size` is the largest number that the
    equations are made of, mm.
    """
    counts = ~slack
    if machines.missing is not None:
        counts = counts & ~machines.missing
    poses, pose_of_row = len(table.actuators), np.concatenate(table.pose_of)
    groups = np.full(machines.equations, len(unstated) - 1)
    groups[machines.equations - machines.cells :] -= 1  # load cells are one before the actuators
    own, closure = np.nonzero(counts)
    pose_of_equation = np.concatenate([own, np.repeat(pose_of_row, table.count)])
    equations = PoseEquations.of(pose_of_equation, poses, machines.unknowns)
    pose_of_block = np.flatnonzero(equations.left_of)
    block_of_pose = np.full(poses, -1)
    block_of_pose[pose_of_block] = np.arange(len(pose_of_block))
    return PoseBlocks(
        table=table,
        components=equations.left_of[pose_of_block],
        pose_of_block=pose_of_block,
        block_of_row=block_of_pose[pose_of_row],
        family_of_block=np.zeros(len(pose_of_block), dtype=np.intp),
        unstated=unstated,
        uninformative=poses - len(pose_of_block),
        equations=equations,
        size=size,
        slack=slack,
        counts=counts,
        groups=groups,
        group_of_equation=np.concatenate([groups[closure], of_readings]),
    )


def component_classes(blocks: RowBlocks, place: IntArray) -> list[IntArray]:
    """Classes of equations (M,) that may have unlike variances, coarse ones first.

    Sets; lengths and angles of each; x y, z and angles; each component. `place` (M,) is which
    component each equation is.
    """
    schemes = (np.zeros(6), [0, 0, 0, 1, 1, 1], [0, 0, 1, 2, 2, 2], np.arange(6))
    return [numbered(blocks.set_of, np.asarray(each, dtype=np.intp)[place]) for each in schemes]
