"""Derivatives by the coefficients of effects, against differences of what is predicted with them.

Every effect of the package, each coefficient that it has estimated, over several machines.
"""

from __future__ import annotations

import dataclasses
import importlib
import inspect
import pkgutil
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal import effects
from pkmcal.arms.joint_laws import JointLaws
from pkmcal.arms.joint_pulls import JointPulls
from pkmcal.effects.instrument_scale import InstrumentScale
from pkmcal.effects.stated import effects_on
from pkmcal.estimation.datasets import as_fit_data
from pkmcal.estimation.equations import Equations
from pkmcal.estimation.fit_data import FitData
from pkmcal.estimation.free_parameters import parameters
from pkmcal.estimation.own_classes import require_true
from pkmcal.estimation.parameters import Asked
from pkmcal.kinematics.calibratable import as_machine

from .test_sag import ARM, CENTRES, MASSES

ROWS = 12
TARGET = np.array([40.0, -30.0, 120.0])
KNOWN = {"frame": "known", "target": "known", "attachment": "known"}
PARALLEL = ("hexapod", "linear-delta", "rotary-delta", "6-rus", "2tpr2tps")
EXACT = 2e-6  # of the largest derivative: what differences are good for
SOFT = 1e-3  # of a typical compliance: derivatives are off in proportion to it
FIRST_ORDER = 1e-3  # loads are those of the machine that does not yield
WEIGHED = ARM.with_laws(
    JointLaws(JointPulls(ARM.axes, ARM.points, ARM.kinds, masses=MASSES, centres=CENTRES))
)
ARMS = {"arm": ARM, "weighed arm": WEIGHED}

CASES: list[tuple[Any, str, str, float]] = [
    *((InstrumentScale(), name, kind, EXACT)
      for name in PARALLEL for kind in ("position", "pose", "height", "distance")),
    *((InstrumentScale(), "arm", kind, EXACT) for kind in ("position", "pose", "distance")),
    *((pk.Expansion(1e-5), name, "position", EXACT) for name in ("hexapod", "linear-delta")),
    *((pk.Elasticity(), name, "pose", FIRST_ORDER) for name in PARALLEL),
    (pk.Elasticity("rod*"), "linear-delta", "pose", FIRST_ORDER),
    (pk.Elasticity(per_length=True), "hexapod", "pose", FIRST_ORDER),
    (pk.Elasticity("joint*"), "arm", "pose", FIRST_ORDER),
    (pk.Sag((2, 3, 5), tied=True), "weighed arm", "pose", EXACT),
    *((each, "arm", "pose", EXACT) for each in (
        pk.Sag(), pk.Sag("all"), pk.Harmonics(1),
        pk.Harmonics((0.5, 2)), pk.Coupling([(6, 4), (5, 4)]), pk.Backlash())),
]  # fmt: skip


def measured(machine: Any, kind: str, seed: int) -> tuple[pk.Measurements, Sequence[str]]:
    """Rows with loads, temperatures and approaches; and a few numbers that are free beside."""
    rng = np.random.default_rng(seed)
    if machine in ARMS:
        arm, free = ARMS[machine], ["joint2.*"]
        q = rng.uniform(-1.2, 1.2, (ROWS, 6))
        poses = pk.screw.to_pose(arm.forward(q))
    else:
        arm, free = pk.load(machine), ["offset*"]
        poses = arm.complete(pk.sample_poses(arm, ROWS, seed=seed))
        q = arm.inverse(poses, match=True)
    values = poses + rng.normal(size=poses.shape) * [*[0.5] * 3, *[1e-3] * 3]
    reading: Any = pk.readings.Distance(TARGET) if kind == "distance" else kind
    target = None if kind == "pose" else TARGET
    if kind == "distance":
        values, target = np.linalg.norm(poses[:, :3], axis=1) + 300.0, np.array([900.0, 50, -20])
    values = {"position": values[..., :3], "height": values[..., 2]}.get(kind, values)
    rows = pk.Measurements(
        q, values, reading, target=target, sigma=0.05,
        temperature=rng.uniform(15.0, 30.0, ROWS), approach=np.sign(rng.normal(size=q.shape)),
    )  # fmt: skip
    return rows, free


def of_effect(effect: Any, machine: str, kind: str) -> tuple[FitData, Equations, np.ndarray, Any]:
    """The equations with an effect, where its coefficients are not 0."""
    rows, free = measured(machine, kind, 3)
    if isinstance(effect, pk.Elasticity):
        force = np.zeros((ROWS, 3))
        force[ROWS // 2 :] = -40.0, 30.0, -100.0
        load = pk.Load(force=force, moment=force * 30.0)
        rows = dataclasses.replace(rows, load=load)
    nominal = as_machine(ARMS.get(machine) or pk.load(machine))
    changed, moving, freed = effects_on(nominal, effect)
    (data,) = as_fit_data(changed, rows, KNOWN, False, moving)
    chosen = parameters(changed, [data], Asked(free, of_effects=freed))
    numbers = {*freed, *(n for each in data.dependences() for own in each.estimated.values()
                         for n in own.names)}  # fmt: skip
    mine = np.array([name in numbers for name in chosen.names])
    theta = chosen.start.copy()
    small = (SOFT if isinstance(effect, pk.Elasticity) else 0.3) * chosen.scale[mine]
    theta[mine] += np.abs(small) * np.random.default_rng(1).uniform(0.5, 1.5, mine.sum())
    return data, Equations.of([data], chosen), theta, mine


@pytest.mark.parametrize(("effect", "machine", "kind", "off"), CASES, ids=str)
def test_derivatives_by_all_coefficients_are_those_of_differences(
    effect: Any, machine: str, kind: str, off: float
) -> None:
    data, equations, theta, mine = of_effect(effect, machine, kind)
    if isinstance(effect, pk.Expansion):
        assert not mine.any() and data.effects  # its coefficients are stated and exact
        return
    assert mine.any()
    here = equations.at(theta)
    (jacobian,) = equations.jacobian(here)
    require_true(equations.prediction, here, trusted=lambda of: False)
    for j in np.flatnonzero(mine).tolist():
        step = np.eye(len(theta))[j] * 1e-3 * equations.parameters.scale[j]
        ahead, behind = (equations.at(theta + sign * step).residuals[0] for sign in (1, -1))
        expected = (behind - ahead) / (2.0 * step[j])
        assert np.abs(expected).max() > 0.0, equations.parameters.names[j]
        away = np.abs(jacobian[:, :, j] - expected).max(axis=0)
        assert (away <= off * np.abs(expected).max()).all(), equations.parameters.names[j]


def test_every_effect_of_the_package_has_a_case() -> None:
    found = set()
    for module in pkgutil.iter_modules(effects.__path__, f"{effects.__name__}."):
        for each in vars(importlib.import_module(module.name)).values():
            own = inspect.isclass(each) and each.__module__ == module.name
            if own and not getattr(each, "_is_protocol", False):
                stated = hasattr(each, "of_machine") or hasattr(each, "dependences")
                found |= {each.__name__} if stated else set()
    tried = {type(effect).__name__ for effect, *_ in CASES}
    assert found - {"MachineExpansion"} == tried  # which `Expansion` is on a machine
