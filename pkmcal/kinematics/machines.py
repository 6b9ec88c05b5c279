"""The machine in the compiled core that a model describes."""

from __future__ import annotations

from typing import Any

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.core.chains import AnyMachine, ChainMachine
from pkmcal.core.driven import CompiledMachine, DrivenMachine
from pkmcal.core.library import MAPS, SLOTS
from pkmcal.core.machine import Machine
from pkmcal.geometry.limb_kinds import KINDS
from pkmcal.geometry.model import Limb, Model


def machine_of(model: Model, slots: FloatArray, length: float) -> CompiledMachine:
    """Make the compiled machine.

    Parameters
    ----------
    model : Model
        Read from a robot file.
    slots : ndarray
        Its numbers as the core takes them.
    length : float
        Characteristic length, mm.
    """
    if model.driven:
        return _driven(model, slots, length)
    if model.chains is not None:
        return ChainMachine(model.chains.layout, model.closure_tolerance)
    return _of_limbs(model, slots, length, [_limb(limb) for limb in model.limbs])


def _driven(model: Model, slots: FloatArray, length: float) -> DrivenMachine:
    """A machine with drive laws: the machine within has a drive of its own for each of them."""
    inner: AnyMachine
    if model.chains is not None:
        inner, width = (
            ChainMachine(model.chains.layout, model.closure_tolerance),
            model.chains.count,
        )
    else:
        width = len(SLOTS)
        bare = np.ascontiguousarray(slots[:, :width])
        bare[:, [SLOTS.index("offset"), SLOTS.index("gain")]] = 0.0, 1.0
        limbs = [_limb(limb) | {"actuator": i} for i, limb in enumerate(model.limbs)]
        inner = _of_limbs(model, bare, length, limbs)
    rows, columns = slots.shape
    return DrivenMachine(inner, model.drives, (rows, columns), width)


def _of_limbs(
    model: Model, slots: FloatArray, length: float, limbs: list[dict[str, Any]]
) -> Machine:
    if sum(len(limb["weights"]) for limb in limbs) == len(MAPS[model.map]):
        for limb in limbs:  # nothing to weigh: all closures hold
            limb["weights"] = [1.0] * len(limb["weights"])
    home = np.ascontiguousarray(model.home, dtype=np.float64)
    return Machine(model.map, limbs, length, slots, home, model.closure_tolerance)


def _limb(limb: Limb) -> dict[str, Any]:
    kind = KINDS[limb.kind]
    rows = kind.all_rows(limb.couple > 0)
    return {
        "driver": kind.driver,
        "rows": rows,
        "actuator": limb.actuator,
        "branch": limb.branch,
        "angle": kind.actuator_unit == "rad",
        "near": np.nan if limb.stroke is None else sum(limb.stroke) / 2,
        "frames": limb.frames,
        "lever": limb.couple,
        "weights": [1.0, *(limb.weights or [1.0] * len(rows))],
    }
