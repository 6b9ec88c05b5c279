"""The blocks of the equations of a calibration: which of them count together.

Where poses follow from the actuators a block is what was read in one row. Where poses have unknowns
it is all that was read at one pose, less the equations that determine that pose.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, IntArray, held_once
from pkmcal.estimation.elimination import Elimination
from pkmcal.estimation.pose_table import PoseTable
from pkmcal.estimation.session_machines import Machines


@dataclass(frozen=True, eq=False)
class RowBlocks:
    """Blocks of equations that count together, and the noise of each.

    Attributes
    ----------
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


@dataclass(frozen=True, eq=False)
class PoseBlocks(RowBlocks):
    """Blocks where poses have unknowns.

    The equations (E,) are those of the closures that count, pose by pose, then the readings.

    Attributes
    ----------
    elimination : Elimination
        Takes the unknowns of each pose out of its equations.
    slack, counts : ndarray of bool (K, e)
        Closures that are left out, of slack cables; and those that are equations: neither slack nor
        missing.
    groups : ndarray of int (e,)
        The group of each closure.
    group_of_equation : ndarray of int (E,)
        The group of each equation.
    """

    elimination: Elimination
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

    def counted(self, part: FloatArray) -> FloatArray:
        """Equations of closures (K, e, ...) that count, one after another."""
        whole = part.reshape(-1, *part.shape[2:])
        return whole if self.counting is None else whole[self.counting]


def row_blocks(table: PoseTable, unstated: BoolArray, missing: int) -> RowBlocks:
    """Find the blocks of readings; `missing` rows had been left out, for nothing was read there."""
    read = table.count > 0
    return RowBlocks(
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
    elimination = Elimination(pose_of_equation, poses, machines.unknowns, size)
    block_of_pose = np.full(poses, -1)
    block_of_pose[elimination.pose_of_block] = np.arange(len(elimination.pose_of_block))
    return PoseBlocks(
        components=elimination.components,
        pose_of_block=elimination.pose_of_block,
        block_of_row=block_of_pose[pose_of_row],
        family_of_block=np.zeros(len(elimination.components), dtype=np.intp),
        unstated=unstated,
        uninformative=elimination.uninformative,
        elimination=elimination,
        slack=slack,
        counts=counts,
        groups=groups,
        group_of_equation=np.concatenate([groups[closure], of_readings]),
    )
