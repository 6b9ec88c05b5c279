"""The keys of an arm's file that say what joints add to their commands, read and written."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Literal

import numpy as np

from pkmcal.arms.joint_laws import AXES, JointLaws, Term, sag_term
from pkmcal.arms.joint_pulls import Balancer, JointPulls
from pkmcal.arrays import FloatArray, Unit
from pkmcal.exceptions import ArgumentError
from pkmcal.files.toml_table import Table
from pkmcal.geometry.elastic import GRAVITY

KEYS = ("drive", "mass", "centre", "stiffness", "balancer")
_DRIVE = ("sag", "compliance", "harmonics", "coupled", "backlash")


def read(
    top: Table,
    joints: Sequence[Table],
    axes: FloatArray,
    points: FloatArray,
    kinds: tuple[str, ...],
) -> JointLaws | None:
    """The laws of all joints; None where none is stated.

    Raises
    ------
    ValueError
        A mistake in the file, with its line.
    """
    gravity = top.list_of("gravity", 3, "three numbers") if "gravity" in top else GRAVITY
    x, y, z = (top.as_number("gravity", each, "1") for each in gravity)
    weighed = [joint for joint in joints if "mass" in joint or "centre" in joint]
    if not any(key in joint for joint in joints for key in KEYS) and "gravity" not in top:
        return None
    masses = centres = None
    if weighed:
        masses = np.array([joint.number("mass", "1", 0.0) for joint in joints])
        centres = np.array([_centre(joint, at) for joint, at in zip(joints, points, strict=True)])
        if (masses < 0.0).any():
            joints[int(np.argmax(masses < 0.0))].fail("mass", "must not be negative")
    balancers = {
        i: _balancer(joint.table("balancer"), kinds[i])
        for i, joint in enumerate(joints)
        if "balancer" in joint
    }
    numbers: dict[Term, float] = {}
    laws = JointLaws(JointPulls(axes, points, kinds, (x, y, z), masses, centres, balancers))
    for i, joint in enumerate(joints):
        for term, value in _terms(i, joint, kinds):
            numbers[term] = value
            try:
                laws = laws.with_terms([term])
            except ArgumentError as error:
                joint.fail("stiffness" if "stiffness" in joint else "drive", str(error))
    return laws.with_values(np.array([numbers[term] for term in laws.terms]))


def _terms(i: int, joint: Table, kinds: Sequence[str]) -> Iterator[tuple[Term, float]]:
    """The numbers of a joint's law."""
    if "stiffness" in joint:
        yield Term(i, "compliance"), _compliance(joint)
    if "drive" not in joint:
        return
    drive, own = joint.table("drive"), _unit(kinds[i])
    drive.only(_DRIVE, "a joint's drive")
    for sag in drive.tables("sag", "the key") if "sag" in drive else []:
        sag.only(("link", *AXES), "a sag")
        link = sag.integer("link") - 1
        if not i <= link < len(kinds):
            sag.fail("link", f"must be one behind the joint, {i + 1} to {len(kinds)}")
        for axis, name in enumerate(AXES):
            if name in sag:
                yield sag_term(i, link, axis), sag.number(name, "rad")
    if "compliance" in drive:
        if "stiffness" in joint:
            drive.fail("compliance", "is stated as the joint's stiffness already")
        yield Term(i, "compliance"), drive.number("compliance", "rad/(N mm)")
    for wave in drive.tables("harmonics", "the key") if "harmonics" in drive else []:
        wave.only(("k", "cos", "sin"), "a harmonic")
        k = wave.number("k", "1" if own == "rad" else "1/mm")
        kinds_of_wave: tuple[Literal["cos", "sin"], ...] = ("cos", "sin")
        for kind in kinds_of_wave:
            if kind in wave:
                yield Term(i, kind, k), wave.number(kind, own)
    for by in drive.tables("coupled", "the key") if "coupled" in drive else []:
        by.only(("joint", "by"), "a coupling")
        other = by.integer("joint") - 1
        if not 0 <= other < len(kinds) or other == i:
            by.fail("joint", f"must be another one, 1 to {len(kinds)}")
        yield Term(i, "coupling", other), by.number("by", "1")
    if "backlash" in drive:
        yield Term(i, "backlash"), drive.number("backlash", own)


def keys(laws: JointLaws, i: int) -> dict[str, Any]:
    """The keys of joint `i`, counted from 0, in mm and rad."""
    drive: dict[str, Any] = {}
    for term, value in zip(laws.terms, laws.values.tolist(), strict=True):
        if term.joint != i:
            continue
        match term.kind:
            case "sag":
                link, axis = divmod(int(term.of), 3)
                _entry(drive, "sag", "link", link + 1)[AXES[axis]] = value
            case "cos" | "sin":
                _entry(drive, "harmonics", "k", float(term.of))[term.kind] = value
            case "coupling":
                _entry(drive, "coupled", "joint", int(term.of) + 1)["by"] = value
            case _:
                drive[term.kind] = value
    found: dict[str, Any] = {}
    pulls = laws.pulls
    if pulls.masses is not None and pulls.centres is not None:
        found = {"mass": float(pulls.masses[i]), "centre": pulls.centres[i].tolist()}
    if i in pulls.balancers:
        spring = pulls.balancers[i]._asdict()
        found["balancer"] = spring | {"base": [*spring["base"]], "link": [*spring["link"]]}
    return found | ({"drive": drive} if drive else {})


def _entry(drive: dict[str, Any], key: str, by: str, value: float) -> dict[str, Any]:
    """The table of a list in which `by` has this value, a new one where there is none."""
    of: list[dict[str, Any]] = drive.setdefault(key, [])
    for each in of:
        if each[by] == value:
            return each
    of.append({by: value})
    return of[-1]


def _unit(kind: str) -> Unit:
    return "rad" if kind == "revolute" else "mm"


def _compliance(joint: Table) -> float:
    """rad/(N mm) of a joint whose stiffness is in N m/rad."""
    stiffness = joint.number("stiffness", "1")
    if not stiffness > 0.0:
        joint.fail("stiffness", f"must be above 0 N m/rad, found {stiffness:g}")
    return 1e-3 / stiffness


def _balancer(table: Table, kind: str) -> Balancer:
    """A spring between points at zero in the base; its rate is in N/mm."""
    table.only(("base", "link", "rate", "free"), "a balancer")
    if kind != "revolute":
        table.fail("", "is of a joint that turns")
    bx, by, bz, lx, ly, lz = (
        table.as_number(key, value, "mm")
        for key in ("base", "link")
        for value in table.list_of(key, 3, "three coordinates")
    )
    rate = table.number("rate", "1")
    if rate < 0.0:
        table.fail("rate", f"must not be negative, found {rate:g}")
    return Balancer((bx, by, bz), (lx, ly, lz), rate, table.number("free", "mm"))


def _centre(joint: Table, point: FloatArray) -> list[float]:
    """The centre of a link at zero; on its joint where none is stated, as a point mass there."""
    if "centre" not in joint:
        return [float(each) for each in point]
    found = joint.list_of("centre", 3, "three coordinates")
    return [joint.as_number("centre", each, "mm") for each in found]
