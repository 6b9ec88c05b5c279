"""Elastic numbers and loads, written so that `robot_file_elastic` reads the same bits."""

from __future__ import annotations

from typing import Any

from pkmcal.geometry.elastic import COMPLIANCE, PER_LENGTH, Elastic
from pkmcal.geometry.geometry import Geometry
from pkmcal.geometry.robot_file_elastic import MASSES


def elastic_tables(
    elastic: Elastic | None, geometry: Geometry
) -> tuple[dict[str, Any], dict[str, dict[str, Any]], list[dict[str, Any]]]:
    """The keys of the head, the tables, and the balancers, in mm, rad, N and kg.

    None of them where nothing yields.
    """
    if elastic is None:
        return {}, {}, []
    written = _Written(geometry)
    compliance: dict[str, Any] = {}
    for spring in elastic.springs:
        name = COMPLIANCE + spring.number
        compliance[spring.number] = written(name)
        if spring.drive >= 0:
            grows = {"at": spring.at, "per_length": written(name + PER_LENGTH)}
            compliance[spring.number] = {"value": written(name)} | grows
    tables: dict[str, dict[str, Any]] = {"compliance": compliance}
    if elastic.platform:
        centre = written.point("centre.platform")
        tables["platform"] = {"mass": written("mass.platform"), "centre": centre}
    if elastic.payload:
        tables["payload"] = {"mass": written("payload.mass")} | {
            key: written.point(f"payload.{key}") for key in ("centre", "force", "moment")
        }
    head = {
        "gravity": list(elastic.gravity),
        "gravity_tilt": [written(f"gravity.tilt{k}") for k in (1, 2)],
    }
    balancers = [
        {end: written.point(f"balancer{j}.{end}") for end in ("base", "platform")}
        | {key: written(f"balancer{j}.{key}") for key in ("rate", "free")}
        for j in range(1, elastic.balancers + 1)
    ]
    return head, tables, balancers


def limb_masses(elastic: Elastic, geometry: Geometry, i: int) -> dict[str, Any]:
    """The masses of limb `i`, counted from 0, by key."""
    written, having = (
        _Written(geometry),
        dict(zip(MASSES, (elastic.rods, elastic.anchors), strict=True)),
    )
    return {
        key: written(f"mass.{MASSES[key]}{i + 1}") for key, limbs in having.items() if i in limbs
    }


class _Written:
    """Numbers of a geometry as a file has them: values, or the parameters they follow."""

    def __init__(self, geometry: Geometry) -> None:
        self._geometry = geometry
        self._ties = {number.name: number.tie for number in geometry.numbers}

    def __call__(self, name: str) -> float | str:
        tie = self._ties[name]
        return self._geometry[name] if tie is None else tie.terms[0].written

    def point(self, name: str) -> list[float | str]:
        """The three coordinates of a point, by the names of its numbers."""
        return [self(f"{name}.{axis}") for axis in "xyz"]
