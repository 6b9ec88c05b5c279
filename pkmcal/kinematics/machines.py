"""The machine in the compiled core that a model describes."""

from __future__ import annotations

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.core.chains import AnyMachine, ChainMachine
from pkmcal.core.driven import CompiledMachine, DrivenMachine
from pkmcal.core.library import MAPS, SLOTS
from pkmcal.core.machine import Machine
from pkmcal.core.pulleys import PulleyMachine, has_bent
from pkmcal.exceptions import ArgumentError
from pkmcal.geometry.model import Model
from pkmcal.kinematics.loaded import AnyCompiled, LoadedMachine
from pkmcal.kinematics.pulls import Pulls


def machine_of(model: Model, slots: FloatArray, length: float) -> AnyCompiled:
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
    made = _rigid(model, slots, length)
    return made if model.elastic is None else _loaded(model, made, slots)


def _rigid(model: Model, slots: FloatArray, length: float) -> CompiledMachine:
    inner: AnyMachine
    if model.chains is not None:
        inner = ChainMachine(model.chains.layout, model.closure_tolerance)
        width = model.chains.count
    else:
        inner, width = _of_limbs(model, slots, length), model.own_width
    if not model.driven:
        return inner
    rows, columns = slots.shape
    return DrivenMachine(inner, model.drives, (rows, columns), width)


def _of_limbs(model: Model, slots: FloatArray, length: float) -> Machine:
    """A machine of limbs; one with drive laws has a drive of its own for each of them."""
    limbs = [limb.for_core() for limb in model.limbs]
    slots = np.ascontiguousarray(slots[:, : model.own_width])
    if model.driven:
        slots = slots.copy()
        slots[:, [SLOTS.index("offset"), SLOTS.index("gain")]] = 0.0, 1.0
        limbs = [limb | {"actuator": i} for i, limb in enumerate(limbs)]
    if sum(len(limb["weights"]) for limb in limbs) == len(MAPS[model.map]):
        for limb in limbs:  # nothing to weigh: all closures hold
            limb["weights"] = [1.0] * len(limb["weights"])
    home = np.ascontiguousarray(model.home, dtype=np.float64)
    made = PulleyMachine if has_bent(limbs) else Machine
    return made(model.map, limbs, length, slots, home, model.closure_tolerance)


def _loaded(model: Model, inner: CompiledMachine, slots: FloatArray) -> LoadedMachine:
    """The machine that yields around the rigid one."""
    assert model.elastic is not None
    lead = f"robot: {model.name} has stiffness"
    if inner.rows != inner.m:
        raise ArgumentError(
            f"{lead}, and {inner.rows} closures for {inner.m} coordinates: how forces are shared"
            " then depends on how it was put together"
        )
    if not model.mechanism.apart or model.mechanism.loose:
        raise ArgumentError(f"{lead}, which chains that share joints or carry a tail cannot have")
    pulls = Pulls(model.elastic, model.base_frame, model.tool_frame)
    place = dict(zip(model.geometry.names, model.geometry.slot_index.tolist(), strict=False))
    springs = model.elastic.springs
    places = sorted({place[name] for spring in springs for name, _ in spring.moves})
    moves = np.zeros((len(springs), len(places)))
    for k, spring in enumerate(springs):
        for name, by in spring.moves:
            moves[k, places.index(place[name])] = by
    width = slots.shape[1] - len(model.elastic.units)
    return LoadedMachine(inner, pulls, np.array(places, dtype=np.intp), moves, slots.shape, width)
